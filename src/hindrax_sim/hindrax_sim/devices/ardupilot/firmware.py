"""ArduSub 4.5 as far as a companion computer meets it: arming, sticks, motor test, failsafes, streams.

Public sources: ArduSub/motors.cpp (motor test), joystick.cpp (sticks), failsafe.cpp, mode_manual.cpp;
libraries/AP_Motors/AP_Motors6DOF.cpp (frames, mixer). Modes other than MANUAL hold the thrusters still here: this
project flies in none of them. A stream that nobody has asked for is not sent, but for the heartbeat and the named
values. Those cannot be asked for (GCS_Common.cpp has no number for them): they come with a group of streams.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from hindrax_core.readings import Vec3
from hindrax_core.vehicle import Thruster
from hindrax_sim.devices.ardupilot.wire import Fields, Received, Receiver, frame
from hindrax_sim.devices.emulator import Part
from hindrax_sim.physics.geometry import quaternion, rotate
from hindrax_sim.world import Mounting, World

SYSTEM, COMPONENT, OTHER_STATION = 1, 1, 190
SUBMARINE, ARDUPILOT = 12, 3
STABILIZE, ALT_HOLD, SURFACE, MANUAL = 0, 2, 9, 19
MODES = (0, 1, 2, 3, 4, 7, 9, 16, 19, 20, 21)
ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
ALERT, CRITICAL, WARNING, INFO = 1, 2, 4, 6
BOOT_S = 1.0
"""Until it speaks again; the real one needs 10 s and more, which would only make the tests longer."""
NAMED, NAMED_EVERY_S = 251, 0.5
SERVO_OUTPUT = 36
TEST_TIMEOUT_S, TEST_COOLDOWN_S = 0.5, 10.0
HANDED_S = 0.03
"""Time between two deliveries of the link: firmware, router and network pass messages on in batches."""
VERSION = (4, 5, 1)
VECTORED = ((0, 0, 1, 0, -1, 1), (0, 0, -1, 0, -1, -1), (0, 0, -1, 0, 1, 1), (0, 0, 1, 0, 1, -1))
"""Factors of a motor as the source lists them: roll, pitch, yaw, throttle, forward, lateral."""
FRAMES: Mapping[int, tuple[tuple[int, ...], ...]] = {
    1: (*VECTORED, (1, 0, 0, -1, 0, 0), (-1, 0, 0, -1, 0, 0)),
    2: (*VECTORED, (1, -1, 0, -1, 0, 0), (-1, -1, 0, -1, 0, 0), (1, 1, 0, -1, 0, 0), (-1, 1, 0, -1, 0, 0)),
}
_HORIZONTAL: tuple[Vec3, ...] = tuple(
    (math.cos(math.radians(azimuth)), math.sin(math.radians(azimuth)), 0.0) for azimuth in (135.0, -135.0, 45.0, -45.0)
)
PUSHES: Mapping[int, tuple[Vec3, ...]] = {count: _HORIZONTAL + ((0.0, 0.0, 1.0),) * (count - 4) for count in (6, 8)}
"""Where a pulse above 1500 us pushes (body axes, z down), by the number of motors."""


@dataclass(frozen=True, slots=True)
class AutopilotTruth:
    """What is true at the autopilot, in SNAME axes: attitude, rates, specific force, field; water, supply, leak."""

    attitude_rad: Vec3 = (0.0, 0.0, 0.0)
    rate_radps: Vec3 = (0.0, 0.0, 0.0)
    specific_force_mps2: Vec3 = (0.0, 0.0, -9.80665)
    field_T: Vec3 = (17.5e-6, 0.0, -13.8e-6)
    water_Pa: float = 101325.0
    water_C: float = 21.0
    supply_V: float = 14.8
    supply_A: float = 0.0
    range_m: float | None = None
    wet: bool = False
    velocity_mps: Vec3 | None = None
    """Over ground in body axes, where something aids the estimator (GPS, a DVL behind the autopilot); else None."""


def autopilot_truth(world: World, at: Mounting) -> AutopilotTruth:
    """What is true at an autopilot with its Bar30, where it is mounted."""
    force, rates = world.inertial(at)
    return AutopilotTruth(
        world.attitude_rad,
        rates,
        force,
        world.magnetic_T(at),
        world.pressure_Pa(at),
        supply_V=world.supply_V,
        supply_A=world.supply_A,
        wet=world.water_in_hull,
    )


def parameters_of(thrusters: Sequence[Thruster]) -> dict[str, float]:
    """Parameters of an ArduSub that is wired as a vehicle file says, motors 1 to n in its order."""
    count = len(thrusters)
    found: dict[str, float] = {
        "FRAME_CONFIG": 2.0 if count > 6 else 1.0,
        **{f"SERVO{number}_FUNCTION": 0.0 for number in range(1, 17)},
        "MOT_PWM_MIN": 1100.0,
        "MOT_PWM_TYPE": 0.0,
        "MOT_PWM_MAX": 1900.0,
        "JS_GAIN_DEFAULT": 0.5,
        "JS_THR_GAIN": 1.0,
        "FS_PILOT_INPUT": 2.0,
        "FS_PILOT_TIMEOUT": 3.0,
        "FS_GCS_ENABLE": 2.0,
        "FS_GCS_TIMEOUT": 5.0,
        "FS_EKF_ACTION": 0.0,
        "FS_LEAK_ENABLE": 1.0,
        "SYSID_MYGCS": 255.0,
    }
    for number, (thruster, push) in enumerate(zip(thrusters, PUSHES.get(count, PUSHES[8]), strict=False), start=1):
        along = sum(one * other for one, other in zip(thruster.direction, push, strict=True))
        backwards = (along < 0.0) != thruster.reversed
        found[f"SERVO{thruster.channel + 1}_FUNCTION"] = 32.0 + number
        found[f"MOT_{number}_DIRECTION"] = -1.0 if backwards else 1.0
    return found


@dataclass(slots=True)
class _Channel:
    """One MAVLink channel: what was received in part, what waits to be sent, and the streams that were asked for."""

    receiver: Receiver = field(default_factory=Receiver)
    outbox: list[bytes] = field(default_factory=list)
    intervals_s: dict[int, float] = field(default_factory=dict)
    due_s: dict[int, float] = field(default_factory=dict)
    handed_s: float = -math.inf


class ArduSub(Part[AutopilotTruth]):
    """One autopilot, powered up at `now_s`. Disguised, it is a copter; saturated, its sensors are at their ends."""

    def __init__(self, thrusters: Sequence[Thruster], seed: int = 0, now_s: float = 0.0) -> None:
        super().__init__(AutopilotTruth())
        self.parameters = parameters_of(thrusters)
        self.refuses_arming = ""
        """Text of a check that fails; empty when it arms."""
        self.refuses_modes = ""
        """Why it changes its mode for nobody."""
        self.depth_healthy = True
        """Whether its sensor of depth measures; else it sends the last pressure again and again."""
        self._last_hPa = 1013.25
        self.unsupported: set[int] = set()
        """Commands that this firmware does not know."""
        self.version = VERSION
        self._texts: list[Fields] = []
        self._long_texts = 0
        self._random = np.random.default_rng(seed)
        self._commands: Mapping[int, Callable[[tuple[float, ...], _Channel], int]] = {
            176: self._set_mode,
            209: self._motor_test,
            400: self._arm,
            511: self._set_interval,
            512: self._request,
        }
        self._messages: Mapping[int, Callable[[], Fields]] = {
            1: self._sys_status,
            27: self._raw_imu,
            30: self._attitude,
            32: self._local_position,
            SERVO_OUTPUT: self._servo_output,
            65: self._rc_channels,
            132: self._distance,
            137: self._pressure,
            148: self._autopilot_version,
            193: self._estimator,
        }
        self.channels: list[_Channel] = [_Channel()]
        self.power_cycle(now_s)
        self._silent_until_s = self._beat_s = now_s

    # ---- the emulator's face

    def power_cycle(self, now_s: float) -> None:
        """Restart: disarmed in MANUAL, neutral, with no stream."""
        self._now_s = self._boot_s = now_s
        self._silent_until_s = now_s + BOOT_S
        self.armed, self.mode, self.gain = False, MANUAL, self.parameters["JS_GAIN_DEFAULT"]
        self._sticks_us = [1500.0] * 6
        self._pulses_us: dict[int, float] = dict.fromkeys(self._motor_channels(), 1500.0)
        self._testing = self._driven = False
        self._test_s = self._test_failed_s = -math.inf
        self._pilot_s: float = now_s
        self._station_s: float | None = None
        self._pilot_lost = self._station_lost = False
        self._beat_s = self._named_s = now_s + BOOT_S
        self._sequence, self._leak_warned_s = 0, -math.inf
        self.channels[:] = [_Channel() for _ in self.channels]

    def step(self, now_s: float) -> bytes:
        """Run until now; return what the first channel has sent."""
        self._now_s = now_s
        if now_s < self._silent_until_s:
            return b""
        self._check_failsafes()
        self._output()
        texts, self._texts = self._texts, []
        for text in texts:
            self._send_all(253, text)
        if now_s >= self._beat_s:
            self._beat_s += 1.0
            self._send_all(0, self._heartbeat())
        if now_s >= self._named_s:
            self._named_s += NAMED_EVERY_S
            self._send_all(NAMED, self._pilot_gain())
        for channel in self.channels:
            for number, interval_s in channel.intervals_s.items():
                if now_s >= channel.due_s[number]:
                    channel.due_s[number] = max(channel.due_s[number] + interval_s, now_s - interval_s)
                    self._send(channel, number, self._messages[number]())
                    if number == SERVO_OUTPUT:
                        self._send(channel, number, self._further_outputs())
        return self.sent(0)

    def jump_clock(self, seconds: float) -> None:
        """Fault: the time since power-up jumps."""
        self._boot_s -= seconds

    def receive(self, data: bytes, now_s: float) -> bytes:
        """Bytes of the host on the first channel."""
        return self.receive_on(0, data, now_s)

    def receive_on(self, index: int, data: bytes, now_s: float) -> bytes:
        """Process bytes of a channel.

        Parameters
        ----------
        index
            Of the channel: the line of the stack, then those of other ground stations.
        data
            From the host.
        now_s : [s]
            Time of the mock.

        Returns
        -------
        bytes
            What it has sent on that channel since the last time.
        """
        self._now_s = now_s
        channel = self.channels[index]
        for one in channel.receiver.feed(data) if now_s >= self._silent_until_s else ():
            self._on_frame(one, channel)
        return self.sent(index)

    def sent(self, index: int) -> bytes:
        """Take what a channel has sent, where it is time for a batch."""
        channel = self.channels[index]
        if not channel.outbox or self._now_s < channel.handed_s + HANDED_S:
            return b""
        channel.handed_s = self._now_s
        data = b"".join(channel.outbox)
        channel.outbox.clear()
        return data

    def take_driven(self) -> bool:
        """Whether a stick or a motor test has come since the last call, but for those of another ground station."""
        driven, self._driven = self._driven, False
        return driven

    def pulse_us(self, channel: int) -> float | None:
        """Pulse of one output; None where there is none."""
        return self._pulses_us.get(channel)

    def pulses_us(self) -> tuple[float | None, ...]:
        """Pulses of all sixteen outputs."""
        return tuple(self.pulse_us(channel) for channel in range(16))

    # ---- frames

    def _on_frame(self, one: Received, channel: _Channel) -> None:
        station = one.system == round(self.parameters["SYSID_MYGCS"])
        if one.number == 0 and station:
            self._station_s = self._now_s
        elif one.number == 20:
            self._send_parameter(one.values[3], channel)
        elif one.number == 23:
            name = one.values[3].rstrip(b"\x00").decode(errors="replace")
            if name in self.parameters:
                self.parameters[name] = one.values[0]
            self._send_parameter(one.values[3], channel)
        elif one.number == 69 and station and one.values[5] == SYSTEM:
            self._manual_control(one.values)
            self._driven |= one.component != OTHER_STATION
        elif one.number == 76 and one.values[8] in (0, SYSTEM):
            number = one.values[7]
            known = number in self._commands and number not in self.unsupported
            result = self._commands[number](one.values, channel) if known else UNSUPPORTED
            self._send(channel, 77, (number, result, 0, 0, one.system, one.component))

    def _send_parameter(self, name: bytes, channel: _Channel) -> None:
        known = name.rstrip(b"\x00").decode(errors="replace")
        if known in self.parameters:
            index, real = list(self.parameters).index(known), 9
            self._send(channel, 22, (self.parameters[known], len(self.parameters), index, name, real))

    def _send(self, channel: _Channel, number: int, values: Fields) -> None:
        channel.outbox.append(frame(number, values, self._sequence, SYSTEM, COMPONENT))
        self._sequence += 1

    def _send_all(self, number: int, values: Fields) -> None:
        for channel in self.channels:
            self._send(channel, number, values)

    def _text(self, severity: int, text: str) -> None:
        """Queued, as in ArduSub: the answer to a command comes before the text that says why; a long one in parts."""
        said = text.encode()
        parts = [said[begin : begin + 50] for begin in range(0, len(said), 50)]
        self._long_texts += len(parts) > 1
        number = self._long_texts if len(parts) > 1 else 0
        self._texts += [(severity, part, number, at) for at, part in enumerate(parts)]

    # ---- commands

    def _set_mode(self, values: tuple[float, ...], _channel: _Channel) -> int:
        mode = round(values[1])
        if mode not in MODES:
            return DENIED
        if self.refuses_modes:
            self._text(WARNING, self.refuses_modes)
            return FAILED
        self.mode = mode
        self._sticks_us = [1500.0] * 6
        return ACCEPTED

    def _arm(self, values: tuple[float, ...], _channel: _Channel) -> int:
        if not values[0]:
            self._disarm()
            return ACCEPTED
        if self.refuses_arming:
            self._text(CRITICAL, f"Arm: {self.refuses_arming}")
            return FAILED
        self.armed = True
        self._pulses_us = dict.fromkeys(self._pulses_us, 1500.0)
        self._pilot_s, self._pilot_lost = max(self._pilot_s, self._now_s), False
        return ACCEPTED

    def _disarm(self) -> None:
        self.armed = False
        self._output()

    def _motor_test(self, values: tuple[float, ...], _channel: _Channel) -> int:
        self._test_s = self._now_s
        if not self._testing and not self._begin_test():
            self._text(WARNING, "motor test initialization failed!")
            return FAILED
        motor, by_pulse, pulse_us, order = round(values[0]), values[1] == 1.0, values[2], values[5]
        if order != 2.0:
            self._text(WARNING, f"bad test type {order:.2f}")
            return FAILED
        channels = [channel for channel, number in self._motor_channels().items() if number == motor + 1]
        if not by_pulse or not channels or not self.armed:
            return FAILED
        self._pulses_us[channels[0]] = float(int(pulse_us))
        self._driven = True
        return ACCEPTED

    def _begin_test(self) -> bool:
        if self._now_s < self._test_failed_s + TEST_COOLDOWN_S:
            self._text(CRITICAL, "10 second cooldown required after motor test")
            return False
        if not self.armed:
            self._text(WARNING, "Arm motors before testing motors.")
            return False
        self._pulses_us = dict.fromkeys(self._pulses_us, 1500.0)
        self._testing = True
        return True

    def _set_interval(self, values: tuple[float, ...], channel: _Channel) -> int:
        number, interval_us = round(values[0]), values[1]
        if number not in self._messages:
            self._text(INFO, f"No ap_message for mavlink id ({number})")
            return DENIED
        channel.intervals_s[number], channel.due_s[number] = 1e-6 * interval_us, self._now_s
        return ACCEPTED

    def _request(self, values: tuple[float, ...], channel: _Channel) -> int:
        number = round(values[0])
        if number not in self._messages:
            return FAILED
        self._send(channel, number, self._messages[number]())
        return ACCEPTED

    # ---- sticks and mixer

    def _manual_control(self, values: tuple[float, ...]) -> None:
        x, y, z, r = values[:4]
        enabled, s, t = int(values[7]), *values[8:10]
        scale, vertical = 0.4 * self.gain, 0.8 * self.gain * self.parameters["JS_THR_GAIN"]
        centered = (
            s * (enabled & 1) + 1500,
            t * (enabled >> 1 & 1) + 1500,
            z * vertical + 1500 - 500 * vertical,
            *(one * scale + 1500 for one in (r, x, y)),
        )
        self._sticks_us = [float(int(min(1900.0, max(1100.0, one)))) for one in centered]
        self._pilot_s, self._pilot_lost = self._now_s, False
        self._station_s = self._now_s

    def _motor_channels(self) -> dict[int, int]:
        """Motor by output channel."""
        functions = {channel: round(self.parameters[f"SERVO{channel + 1}_FUNCTION"]) for channel in range(16)}
        return {channel: function - 32 for channel, function in functions.items() if 33 <= function <= 40}

    def _output(self) -> None:
        if self._testing:
            if self._now_s > self._test_s + TEST_TIMEOUT_S:
                self._text(INFO, "Motor test timed out!")
                self._testing, self._test_failed_s = False, self._now_s
                self.armed = False
                self._pulses_us = dict.fromkeys(self._pulses_us, 1500.0)
            return  # disarmed or not: a test refuses then, but what it has put out stays to its end
        if not self.armed or self.mode != MANUAL:
            self._pulses_us = dict.fromkeys(self._pulses_us, 1500.0)
            return
        pitch, roll, throttle, yaw, forward, lateral = ((one - 1500.0) / 400.0 for one in self._sticks_us)
        factors = FRAMES[round(self.parameters["FRAME_CONFIG"])]
        turning = [a * roll + b * pitch + d * throttle for a, b, _, d, _, _ in factors]
        moving = [c * yaw + e * forward + f * lateral for _, _, c, _, e, f in factors]
        most = max(1.0, *map(abs, turning)), max(1.0, *map(abs, moving))
        for channel, motor in self._motor_channels().items():
            thrust = turning[motor - 1] / most[0] + moving[motor - 1] / most[1]
            thrust = min(1.0, max(-1.0, self.parameters.get(f"MOT_{motor}_DIRECTION", 1.0) * thrust))
            up_us, down_us = self.parameters["MOT_PWM_MAX"] - 1500.0, 1500.0 - self.parameters["MOT_PWM_MIN"]
            self._pulses_us[channel] = float(int(1500.0 + thrust * (up_us if thrust > 0.0 else down_us)))

    def _check_failsafes(self) -> None:
        lost = self._now_s > self._pilot_s + self.parameters["FS_PILOT_TIMEOUT"]
        if lost and self.parameters["FS_PILOT_INPUT"] and not self._pilot_lost:
            self._pilot_lost, self._sticks_us = True, [1500.0] * 6
            if self.armed:
                self._text(CRITICAL, "Lost manual control")
            if self.parameters["FS_PILOT_INPUT"] == 2.0:
                self._disarm()
        silent = self._station_s is not None and self._now_s > self._station_s + self.parameters["FS_GCS_TIMEOUT"]
        if silent and self.armed and not self._station_lost:
            self._text(WARNING, "MYGCS: 255, heartbeat lost")
            if self.parameters["FS_GCS_ENABLE"] == 2.0:
                self._disarm()
        self._station_lost = silent
        if self._truth.wet and self._now_s > self._leak_warned_s + 20.0:
            self._leak_warned_s = self._now_s
            self._text(CRITICAL, "Leak Detected")
            if self.parameters["FS_LEAK_ENABLE"] == 2.0 and self.armed:
                self.mode = SURFACE

    # ---- messages

    @property
    def _ms(self) -> int:
        return max(0, int(1e3 * (self._now_s - self._boot_s)))

    @property
    def _us(self) -> int:
        return max(0, int(1e6 * (self._now_s - self._boot_s)))

    def _heartbeat(self) -> Fields:
        kind = 2 if self._disguised else SUBMARINE
        return self.mode, kind, ARDUPILOT, 0x41 | 0x80 * self.armed, 4 if self.armed else 3, 3

    def _sys_status(self) -> Fields:
        truth = self._truth
        millivolts = 65534 if self._saturated else round(1e3 * truth.supply_V)
        depth = 1 << 3
        return (
            depth,
            depth,
            depth * self.depth_healthy,
            0,
            millivolts,
            round(100.0 * truth.supply_A),
            *(0,) * 6,
            -1,
            0,
            0,
            0,
        )

    def _raw_imu(self) -> Fields:
        """In mg, mrad/s and mG."""
        noise = self._random.normal(0.0, (0.02,) * 3 + (1e-3,) * 3 + (2e-7,) * 3).tolist()
        true = (*self._truth.specific_force_mps2, *self._truth.rate_radps, *self._truth.field_T)
        units = (9.80665e-3,) * 3 + (1e-3,) * 3 + (1e-7,) * 3
        found = [round((one + error) / unit) for one, error, unit in zip(true, noise, units, strict=True)]
        if self._saturated:
            found[:6] = [32767, -32768, 32767] * 2
        return (self._us, *(max(-32768, min(32767, one)) for one in found), 0, 2500)

    def _attitude(self) -> Fields:
        noise = self._random.normal(0.0, 1e-3, 6).tolist()
        true = (*self._truth.attitude_rad, *self._truth.rate_radps)
        roll, pitch, yaw, p, q, r = (one + error for one, error in zip(true, noise, strict=True))
        return self._ms, roll, pitch, math.remainder(yaw, math.tau), p, q, r

    def _servo_output(self) -> Fields:
        pulses = [round(self._pulses_us.get(channel, 0.0)) for channel in range(16)]
        return (self._us & 0xFFFFFFFF, *pulses[:8], 0, *pulses[8:])

    def _further_outputs(self) -> Fields:
        """Outputs 17 to 32, as every board with room for them sends right behind the others (GCS_Common.cpp)."""
        later_us, port = 20, 1
        return ((self._us + later_us) & 0xFFFFFFFF, *(0,) * 8, port, *(0,) * 8)

    def _rc_channels(self) -> Fields:
        return (self._ms, *map(round, self._sticks_us), *(65535,) * 12, 16, 255)

    def _distance(self) -> Fields:
        far_cm = 0 if self._truth.range_m is None else min(65535, round(100.0 * self._truth.range_m))
        return (self._ms, 30, 3000, far_cm, 2, 0, 25, 0, 0.0, 0.0, *(0.0,) * 4, 100 if far_cm else 1)

    def _pressure(self) -> Fields:
        pascal = 3.1e6 if self._saturated else self._truth.water_Pa + self._random.normal(0.0, 20.0)
        self._last_hPa = pascal / 100.0 if self.depth_healthy else self._last_hPa
        return self._ms, self._last_hPa, 0.0, round(100.0 * self._truth.water_C), 0

    def _autopilot_version(self) -> Fields:
        major, minor, patch = self.version
        official = 255
        number = major << 24 | minor << 16 | patch << 8 | official
        return (0, 0, number, 0, 0, 0, 0, 0, b"", b"", b"", b"")

    def _estimator(self) -> Fields:
        attitude, vertical, constant_position = 1, 1 << 5, 1 << 7
        velocity, position = 0b110, 0b11000
        aided = self._truth.velocity_mps is not None
        return (
            0.1,
            0.1,
            0.1,
            0.1,
            0.0,
            attitude | vertical | (velocity | position if aided else constant_position),
            0.0,
        )

    def _local_position(self) -> Fields:
        """In north, east, down; what is not aided is nonsense near rest."""
        noise = self._random.normal(0.0, 0.01, 3).tolist()
        body = self._truth.velocity_mps or (0.0, 0.0, 0.0)
        turned = rotate(quaternion(self._truth.attitude_rad), body)
        return (self._ms, 0.0, 0.0, 0.0, *(one + error for one, error in zip(turned, noise, strict=True)))

    def _pilot_gain(self) -> Fields:
        return self._ms, self.gain, b"PilotGain"
