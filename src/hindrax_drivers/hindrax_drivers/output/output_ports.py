"""The two outputs behind the guard as ports: a PCA9685 on a register bus, an STM32 on a serial line.

One thread owns an output and its clock, that of all decisions about safety; only `wake` may be called by others.
"""

from collections.abc import Iterable, Sequence
from functools import partial
from typing import TypeAlias, TypeVar

from hindrax_core.bus_operations import DeviceError, Program, Transaction, pack_transaction, run
from hindrax_core.driver_interface import Output
from hindrax_core.events import Stamp, Stamped, after
from hindrax_core.readings import AppliedPulses
from hindrax_core.vehicle import Vehicle
from hindrax_drivers.buses.clock import Clock, Meanwhile, RegisterBus, nothing, pause
from hindrax_drivers.buses.line import SerialPort, Tap
from hindrax_drivers.buses.ports import open_bus, open_clock
from hindrax_drivers.devices.pca9685 import Pca9685, pca9685_of
from hindrax_drivers.devices.stm32 import BOARD_NEUTRAL_us, Stm32
from hindrax_drivers.output.enable_line import EnableLine, open_enable_line
from hindrax_drivers.output.output_guard import Pulses

ResultT = TypeVar("ResultT")

FOUND_WITHIN_S = 3.0
SERIAL_TURN_S = 0.02


class RegisterOutput:
    """A PCA9685, and the line that enables it."""

    def __init__(self, bus: RegisterBus, chip: Pca9685, line: EnableLine, tap: Tap) -> None:
        self._bus, self._chip, self._line, self._tap = bus, chip, line, tap
        self.now = bus.now
        self.wake = bus.wake

    def wait(self, until: Stamp, meanwhile: Meanwhile = nothing) -> None:
        """Sleep until then, or until `wake`; `meanwhile` runs first."""
        self._bus.sleep_until(until, meanwhile=meanwhile)

    def set_up(self) -> str:
        """Configure the chip to neutral; only then are its outputs enabled. DeviceError when it is not as expected."""
        identity = self._run(self._chip.configure()).text
        self._line.set(enabled=True)
        return identity

    def write(self, pulses: Pulses, *, armed: bool) -> None:
        """Write one burst; the chip has no arming state. DeviceError when it was not delivered."""
        del armed
        self._run(self._chip.write(pulses.all_us))
        self._line.written()

    def applied(self, pulses: Pulses) -> tuple[float, ...]:
        """Pulses of the thrusters as the counts make them [us]."""
        return self._chip.applied(pulses.thrusters)

    def serve(self) -> Sequence[Output]:
        """Return nothing: a register chip sends nothing unprompted."""
        return ()

    def check(self, pulses: Pulses) -> None:
        """Verify the registers that a supply loss changes, and the channels."""
        self._run(self._chip.check(pulses.all_us))

    def fault(self) -> str:
        """Return no fault: a register chip has no state of its own."""
        return ""

    def shut_off(self) -> None:
        """Disable the outputs: the only way out when the bus is stuck."""
        self._line.set(enabled=False)

    def close(self) -> None:
        """Close bus and line."""
        self._line.close()
        self._bus.close()

    def _run(self, program: Program[ResultT]) -> ResultT:
        return run(program, self._bus.transfer, partial(pause, self._bus), self._keep)

    def _keep(self, transaction: Transaction, answer: bytes) -> None:
        stamp = self._bus.now()
        self._tap(stamp, True, pack_transaction(transaction))
        self._tap(stamp, False, answer)


class SerialOutput:
    """An STM32 on a serial port."""

    def __init__(self, path: str, device: Stm32, clock: Clock, tap: Tap) -> None:
        self._path, self._device, self._clock, self._tap = path, device, clock, tap
        self._port: SerialPort | None = None
        self._outputs: list[Output] = []
        self._seen: tuple[float, ...] = ()
        self._asked = False
        self.now = clock.now
        self.wake = clock.wake

    def wait(self, until: Stamp, meanwhile: Meanwhile = nothing) -> None:
        """Sleep until bytes come, but no longer than overrides may stay away."""
        soon = min(until, after(self._clock.now(), SERIAL_TURN_S))
        if self._port is None:
            self._clock.sleep_until(soon, meanwhile=meanwhile)
        else:
            self._port.wait(soon, meanwhile)

    def set_up(self) -> str:
        """Open the port and wait for a heartbeat."""
        self.close_port()
        self._port = SerialPort(self._path, self._device.baud, self._clock)
        self._send(self._device.start(self._clock.now()))
        deadline = after(self._clock.now(), FOUND_WITHIN_S)
        while not self._device.ready:
            if self._clock.now() >= deadline:
                raise DeviceError(f"{self._path}: no MAVLink heartbeat within {FOUND_WITHIN_S:g} s; check the board")
            self.wait(deadline)
            self._outputs = list(self.serve())
        return self._device.identity

    def write(self, pulses: Pulses, *, armed: bool) -> None:
        """Send the wanted pulses; request arming once, and disarming until confirmed.

        Until the board is armed the thrusters stay neutral: it refuses to arm otherwise.
        """
        now = self._clock.now()
        waiting = armed and not self._device.armed
        thrusters = (BOARD_NEUTRAL_us,) * len(pulses.thrusters) if waiting else pulses.thrusters
        self._send([self._device.override(thrusters + pulses.lights, now)])
        if armed and not self._asked:
            self._send([self._device.arm(now)])
        elif not armed and (self._asked or self._device.armed):
            self._send([self._device.disarm(now)])
        self._asked = armed

    def applied(self, pulses: Pulses) -> tuple[float, ...]:
        """Last reported pulses of the board; before a report, the wanted ones."""
        return self._seen[: len(pulses.thrusters)] or pulses.thrusters

    def serve(self) -> Sequence[Output]:
        """Decode received bytes, run the driver's timers, keep the reported pulses."""
        outputs, self._outputs = self._outputs, []
        if self._port is None:
            return outputs
        data, stamp = self._port.read()
        if data:
            self._tap(stamp, False, data)
            outputs += self._send(self._device.feed(data, stamp))
        outputs += self._send(self._device.tick(stamp))
        for one in outputs:
            if isinstance(one, Stamped) and isinstance(one.reading, AppliedPulses):
                self._seen = one.reading.pulses_us
        return outputs

    def check(self, pulses: Pulses) -> None:
        """Require heartbeats; the board reports its pulses unprompted."""
        del pulses
        if not self._device.ready:
            raise DeviceError(f"{self._path}: the board has fallen silent; check power and line")

    def fault(self) -> str:
        """Whether the board refused to arm, or has disarmed itself."""
        if not self._asked or self._device.armed or self._device.asking:
            return ""
        return self._device.refusal or "the board has disarmed itself"

    def shut_off(self) -> None:
        """Do nothing: the board goes neutral by itself without commands."""

    def close(self) -> None:
        """Close port and clock."""
        self.close_port()
        self._clock.close()

    def close_port(self) -> None:
        """Close the port only."""
        if self._port is not None:
            self._port.close()
            self._port = None

    def _send(self, outputs: Iterable[Output]) -> list[Output]:
        return [] if self._port is None else self._port.send_all(outputs, self._tap)


ThrusterOutput: TypeAlias = RegisterOutput | SerialOutput


def open_output(vehicle: Vehicle, port: str, clock: str, tap: Tap, name: str, *, neutral: Pulses) -> ThrusterOutput:
    """Open the output of a vehicle file at a port ("mock:..." too), set up to the neutral of its guard.

    DeviceError says what is missing.
    """
    if vehicle.output.device == "stm32":
        return SerialOutput(port, Stm32(vehicle.output_channels()), open_clock(clock, name), tap)
    line = open_enable_line(vehicle.output, port)
    try:
        return RegisterOutput(open_bus(port, name), pca9685_of(vehicle, neutral.all_us), line, tap)
    except DeviceError:
        line.close()
        raise
