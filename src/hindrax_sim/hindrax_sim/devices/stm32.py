"""The STM32F407 thruster controller on its serial line: the firmware itself, behind a wire with a speed.

Runs the same files as the board (`firmware/hindrax_mcu`); only pins, timers and the line are
simulated. `pulses_us` is the input of the speed controllers.
"""

import math

from hindrax_core.readings import Battery
from hindrax_sim.devices.emulator import BaudRateLine, Part
from hindrax_sim.firmware.controller import Controller

BAUD = 115200
PINS = 16


class Stm32(Part[Battery]):
    """One board, powered up at `now_s`; no supply is wired to it. Disguised, it is a GPS receiver."""

    def __init__(self, thrusters: int = 8, lights: int = 2, now_s: float = 0.0) -> None:
        super().__init__(Battery(0.0))
        self._outputs = (thrusters, lights)
        self._wire = BaudRateLine(BAUD)
        self._controller = Controller(thrusters, lights, 0)
        self.power_cycle(now_s)

    @property
    def armed(self) -> bool:
        """Whether the firmware is armed."""
        return self._controller.failsafe.armed

    def pulse_us(self, channel: int) -> float | None:
        """Length of the pulses on an output; None where there is none."""
        pulses = self._controller.pulses
        return float(pulses[channel]) if channel < len(pulses) else None

    def pulses_us(self) -> tuple[float | None, ...]:
        """Pulses of all outputs as of the last `step`."""
        return tuple(self.pulse_us(channel) for channel in range(PINS))

    def step(self, now_s: float) -> bytes:
        """Run the firmware; return its output on the wire."""
        full_scale_mV = 65534
        self._controller.millivolts = full_scale_mV if self._saturated else round(self._truth.voltage_V * 1e3)
        output = self._controller.step(self._ms(now_s))
        if output:
            self._wire.send(self._garble(output), now_s)
        return self._wire.receive_complete(now_s)

    def receive(self, data: bytes, now_s: float) -> bytes:
        """Handle bytes of the host; answers follow on the wire."""
        answer = self._controller.receive(data, self._ms(now_s))
        if answer:
            self._wire.send(self._garble(answer), now_s)
        return self._wire.receive_complete(now_s)

    def power_cycle(self, now_s: float) -> None:
        """Boot: disarmed, neutral, with nothing on the wire."""
        self._boot_s = now_s
        self._wire.clear()
        self._controller = Controller(*self._outputs, 0)

    def jump_clock(self, seconds: float) -> None:
        """Fault: the board's millisecond counter jumps; it never decreases."""
        self._boot_s -= max(0.0, seconds)

    def _garble(self, output: bytes) -> bytes:
        return b"$GPTXT," + output.hex().encode() + b"\r\n" if self._disguised else output

    def _ms(self, now_s: float) -> int:
        return math.floor((now_s - self._boot_s) * 1e3)
