"""Failsafe of the thruster controller: the last state machine before the outputs.

Times are milliseconds that only grow; the caller sees to that. Pulses are whole microseconds.
"""

NEUTRAL, LIGHT_OFF, LOW, HIGH = 1500, 1100, 1100, 1900
PLAUSIBLE_LOW, PLAUSIBLE_HIGH = 800, 2200
# Half of the band in which a Basic ESC R3 stands still (Blue Robotics, bescr3).
AT_REST = 25
ARM_MS = 7000
SILENCE_MS = 300
DISARM_MS = 2000


class Failsafe:
    """Starts disarmed at neutral. Only fresh overrides to an armed controller move a thruster."""

    def __init__(self, thrusters: int, lights: int, now_ms: int, arm_ms: int = ARM_MS) -> None:
        self.armed = False
        self.reason = "boot"
        self._thrusters = thrusters
        self._rest = [NEUTRAL] * thrusters + [LIGHT_OFF] * lights
        self._wanted = list(self._rest)
        self._arm_ms = arm_ms
        self._neutral_since = now_ms
        self._received_ms = now_ms
        self._received = False

    def override(self, channels: list[int], now_ms: int) -> None:
        """Set the wanted pulses. A released, ignored, missing or invalid channel rests, never holds."""
        for index, rest in enumerate(self._rest):
            pulse = channels[index] if index < len(channels) else 0
            plausible = PLAUSIBLE_LOW <= pulse <= PLAUSIBLE_HIGH
            self._wanted[index] = max(LOW, min(HIGH, pulse)) if plausible else rest
        self._received_ms = now_ms
        self._received = True

    def arm(self, now_ms: int) -> str:
        """Arm, unless something may move by it.

        The speed controllers must have seen neutral, and overrides must be fresh and neutral: arming moves nothing.

        Parameters
        ----------
        now_ms : [ms]
            Of the board's clock.

        Returns
        -------
        str
            Why it does not arm; empty when it does, or was armed.
        """
        if self.armed:
            return ""
        if not self._fresh(now_ms):
            return "no override from the host"
        waited = now_ms - self._neutral_since
        if waited < self._arm_ms:
            return f"neutral for {waited} of {self._arm_ms} ms"
        for index in range(self._thrusters):
            if abs(self._wanted[index] - NEUTRAL) > AT_REST:
                return f"override {index + 1} is {self._wanted[index]} us"
        self.armed = True
        self.reason = ""
        return ""

    def disarm(self, reason: str, now_ms: int) -> None:
        """Disarm and go neutral."""
        if self.armed:
            self._neutral_since = now_ms
        self.armed = False
        self.reason = reason

    def step(self, now_ms: int) -> list[int]:
        """Pulses to output now: thrusters, then lights [us]."""
        silence = now_ms - self._received_ms
        if silence >= DISARM_MS:
            if self.armed:
                self.disarm(f"no override for {DISARM_MS} ms", now_ms)
            self._wanted = list(self._rest)
        if self.armed and self._fresh(now_ms):
            return list(self._wanted)
        return self._rest[: self._thrusters] + self._wanted[self._thrusters :]

    def silent(self, now_ms: int) -> bool:
        """Whether an armed controller is neutral because overrides are missing."""
        return self.armed and not self._fresh(now_ms)

    def _fresh(self, now_ms: int) -> bool:
        return self._received and now_ms - self._received_ms < SILENCE_MS
