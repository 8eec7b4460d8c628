"""The two outputs behind the guard as ports: a PCA9685 on a register bus, an STM32 on a serial line."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Protocol, TypeAlias, TypeVar

from hindrax_core.bus import DeviceError, Program, Transaction, Write, run
from hindrax_core.device import Output, Send
from hindrax_core.events import Stamp, Stamped, after
from hindrax_core.readings import AppliedPulses
from hindrax_core.vehicle import Vehicle
from hindrax_core.wire import pack_transaction
from hindrax_drivers.arming import Pulses
from hindrax_drivers.buses.bus import RegisterBus, open_bus
from hindrax_drivers.buses.clock import Clock, Meanwhile, nothing, open_clock
from hindrax_drivers.buses.enable_line import EnableLine, open_enable_line
from hindrax_drivers.buses.serial import SerialPort
from hindrax_drivers.devices.pca9685 import Pca9685, pca9685_of
from hindrax_drivers.devices.stm32 import Stm32, stm32_of

ResultT = TypeVar("ResultT")
Tap: TypeAlias = Callable[[Stamp, bool, bytes], None]
"""Told of everything that passes the port: time, whether it was sent, bytes."""

FOUND_WITHIN_S = 3.0
SERIAL_TURN_S = 0.02


class ThrusterOutput(Protocol):
    """What makes the pulses, with the clock that goes with it. One thread owns it; only `wake` is for others."""

    kind: str

    def now(self) -> Stamp:
        """Time of the output's clock: that of all decisions about safety."""

    def wait(self, until: Stamp, meanwhile: Meanwhile = nothing) -> None:
        """Sleep until then, or until there is something to serve, or until `wake`; `meanwhile` is done first."""

    def wake(self) -> None:
        """End the sleep. From any thread."""

    def set_up(self) -> str:
        """Find the output, bring it to neutral, and say who it is. DeviceError when it is not as it should be."""

    def write(self, pulses: Pulses, *, armed: bool) -> None:
        """Put pulses out. DeviceError when they did not get there."""

    def applied(self, pulses: Pulses) -> tuple[float, ...]:
        """Thruster pulses that are really made for those last written [us]."""

    def serve(self) -> Sequence[Output]:
        """Read what has come, let time pass; what the output says."""

    def check(self, pulses: Pulses) -> None:
        """DeviceError when the output is not as it was left, with these pulses."""

    def complaint(self) -> str:
        """Why the output does not follow although the guard is armed; empty when it does."""

    def shut_off(self) -> None:
        """No pulses at all, where that can be done without the bus."""

    def close(self) -> None:
        """Give back what is open."""


class RegisterOutput:
    """A PCA9685, and the line that enables it."""

    kind = "pca9685"

    def __init__(self, bus: RegisterBus, chip: Pca9685, line: EnableLine, tap: Tap) -> None:
        self._bus, self._chip, self._line, self._tap = bus, chip, line, tap
        self.now = bus.now
        self.wake = bus.wake

    def wait(self, until: Stamp, meanwhile: Meanwhile = nothing) -> None:
        """Sleep on the clock of the bus."""
        self._bus.sleep_until(until, meanwhile=meanwhile)

    def set_up(self) -> str:
        """Configure the chip; only then are its outputs enabled."""
        identity = self._run(self._chip.configure()).text
        self._line.set(enabled=True)
        return identity

    def write(self, pulses: Pulses, *, armed: bool) -> None:
        """One burst; the chip knows nothing of arming."""
        del armed
        self._run(self._chip.write(pulses.all_us))

    def applied(self, pulses: Pulses) -> tuple[float, ...]:
        """As the counts make them."""
        return self._chip.applied(pulses.thrusters)

    def serve(self) -> Sequence[Output]:
        """Nothing comes by itself."""
        return ()

    def check(self, pulses: Pulses) -> None:
        """Look at the registers that a lost supply would have changed, and at the channels."""
        self._run(self._chip.check(pulses.all_us))

    def complaint(self) -> str:
        """A register does what it is told."""
        return ""

    def shut_off(self) -> None:
        """Disable the outputs: the only way out when the bus is stuck."""
        self._line.set(enabled=False)

    def close(self) -> None:
        """Close bus and line."""
        self._line.close()
        self._bus.close()

    def _run(self, program: Program[ResultT]) -> ResultT:
        return run(program, self._transfer, self._pause)

    def _transfer(self, transaction: Transaction) -> bytes:
        answer = self._bus.transfer(transaction)
        wanted = 0 if isinstance(transaction, Write) else transaction.count
        if len(answer) != wanted:
            address = f"address {transaction.address:#04x}"
            raise DeviceError(f"{address}: short read, found {len(answer)} bytes, wanted {wanted}")
        stamp = self._bus.now()
        self._tap(stamp, True, pack_transaction(transaction))
        self._tap(stamp, False, answer)
        return answer

    def _pause(self, seconds: float) -> None:
        end = after(self._bus.now(), seconds)
        while self._bus.now() < end:
            self._bus.sleep_until(end)


class SerialOutput:
    """An STM32 on a serial port."""

    kind = "stm32"

    def __init__(self, path: str, device: Stm32, clock: Clock, tap: Tap) -> None:
        self._path, self._device, self._clock, self._tap = path, device, clock, tap
        self._port: SerialPort | None = None
        self._said: list[Output] = []
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
        self._take(self._device.start(self._clock.now()))
        deadline = after(self._clock.now(), FOUND_WITHIN_S)
        while not self._device.ready:
            if self._clock.now() >= deadline:
                raise DeviceError(f"{self._path}: no MAVLink heartbeat within {FOUND_WITHIN_S:g} s; check the board")
            self.wait(deadline)
            self._said = list(self.serve())
        return self._device.identity

    def write(self, pulses: Pulses, *, armed: bool) -> None:
        """Say what is wanted; ask the board to arm once, and to disarm until it has."""
        now = self._clock.now()
        self._take([self._device.override(pulses.all_us, now)])
        if armed and not self._asked:
            self._take([self._device.arm(now)])
        elif not armed and (self._asked or self._device.armed):
            self._take([self._device.disarm(now)])
        self._asked = armed

    def applied(self, pulses: Pulses) -> tuple[float, ...]:
        """As the board has told last; before it has told, as they are wanted."""
        return self._seen[: len(pulses.thrusters)] or pulses.thrusters

    def serve(self) -> Sequence[Output]:
        """Feed the driver, let it repeat itself, keep what the board says it puts out."""
        said, self._said = self._said, []
        if self._port is None:
            return said
        data, stamp = self._port.read()
        if data:
            self._tap(stamp, False, data)
            said += self._take(self._device.feed(data, stamp))
        said += self._take(self._device.tick(stamp))
        for one in said:
            if isinstance(one, Stamped) and isinstance(one.reading, AppliedPulses):
                self._seen = one.reading.pulses_us
        return said

    def check(self, pulses: Pulses) -> None:
        """Insist on heartbeats; the board tells its pulses by itself."""
        del pulses
        if not self._device.ready:
            raise DeviceError(f"{self._path}: the board has fallen silent; check power and line")

    def complaint(self) -> str:
        """Whether the board refused to arm, or has disarmed itself."""
        if not self._asked or self._device.armed or self._device.asking:
            return ""
        return self._device.refusal or "the board has disarmed itself"

    def shut_off(self) -> None:
        """Nothing to switch: the board goes neutral by itself when nobody talks to it."""

    def close(self) -> None:
        """Close port and clock."""
        self.close_port()
        self._clock.close()

    def close_port(self) -> None:
        """Close the port only."""
        if self._port is not None:
            self._port.close()
            self._port = None

    def _take(self, outputs: Iterable[Output]) -> list[Output]:
        kept = list(outputs)
        for output in kept:
            if isinstance(output, Send) and self._port is not None:
                self._port.send(output)
                self._tap(self._clock.now(), True, output.data)
        return [output for output in kept if not isinstance(output, Send)]


def open_output(vehicle: Vehicle, port: str, clock: str, tap: Tap, name: str) -> ThrusterOutput:
    """Open the output of a vehicle file at a port ("mock:..." too). DeviceError says what is missing."""
    if vehicle.output.device == "stm32":
        return SerialOutput(port, stm32_of(vehicle), open_clock(clock, name), tap)
    line = open_enable_line(vehicle.output.enable_line)
    try:
        return RegisterOutput(open_bus(port, name), pca9685_of(vehicle), line, tap)
    except DeviceError:
        line.close()
        raise
