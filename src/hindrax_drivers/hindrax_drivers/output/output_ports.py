"""The outputs behind the guard as ports: a PCA9685 on a register bus, an STM32 or an ArduSub on a line.

One thread owns an output and its clock, that of all decisions about safety; only `wake` may be called by others.
"""

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol, TypeAlias, TypeVar

from hindrax_core.bus_operations import DeviceError, Program, Transaction, pack_transaction, run
from hindrax_core.driver_interface import Output, SerialDevice
from hindrax_core.events import Stamp, Stamped, after
from hindrax_core.readings import AppliedPulses
from hindrax_core.vehicle import Vehicle
from hindrax_drivers.buses.clock import Clock, Meanwhile, RegisterBus, nothing, pause
from hindrax_drivers.buses.line import Line, Tap, open_line
from hindrax_drivers.buses.ports import open_bus, open_clock
from hindrax_drivers.devices.pca9685 import Pca9685, pca9685_of
from hindrax_drivers.devices.stm32 import Stm32
from hindrax_drivers.output.enable_line import EnableLine, open_enable_line
from hindrax_drivers.output.force_output import ForceOutput
from hindrax_drivers.output.output_guard import Pulses

ResultT = TypeVar("ResultT")

FOUND_WITHIN_S = 2.0
"""Well below the silence that the dead man takes for a hang."""
SERIAL_TURN_S = 0.02
MOST_REPORTS = 128
"""Of a computer that was held up; before that they are lost, as is every command of that time."""


class StillAnsweringError(DeviceError):
    """A device that has answered needs more time: it is late, and nothing is wrong with it."""


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

    def applied(self, pulses: Pulses) -> Sequence[Stamped[AppliedPulses]]:
        """Pulses of the thrusters as the counts make them [us]: from now on."""
        return (Stamped(self._bus.now(), AppliedPulses(self._chip.applied(pulses.thrusters))),)

    def serve(self) -> Sequence[Output]:
        """Return nothing: a register chip sends nothing unprompted."""
        return ()

    def check(self, pulses: Pulses) -> None:
        """Verify the registers that a supply loss changes, and the channels."""
        self._run(self._chip.check(pulses.all_us))

    def fault(self) -> str:
        """Return no fault: a register chip has no state of its own."""
        return ""

    def left_armed(self) -> bool:
        """Return False: a register chip has no arming state."""
        return False

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


class OutputDevice(Protocol):
    """What makes pulses at the far end of a line: a driver of a serial device, and a state of being armed."""

    @property
    def baud(self) -> int:
        """Line speed, always 8N1."""

    @property
    def ready(self) -> bool:
        """Whether it has identified itself, and speaks."""

    @property
    def settling(self) -> bool:
        """Whether it has answered, and needs more time to become ready on an open line."""

    @property
    def lack(self) -> str:
        """What is wrong with it, however long it is waited for; empty where time may help."""

    @property
    def trouble(self) -> str:
        """Why it is not ready."""

    @property
    def identity(self) -> str:
        """Who answers."""

    def start(self, stamp: Stamp) -> Iterable[Output]:
        """Return what to send after the line was opened."""

    def feed(self, data: bytes, stamp: Stamp) -> Iterable[Output]:
        """Decode bytes; applied pulses are readings."""

    def tick(self, stamp: Stamp) -> Iterable[Output]:
        """Handle time."""

    def drive(
        self, thrusters_us: tuple[float, ...], lights_us: tuple[float, ...], stamp: Stamp, *, armed: bool
    ) -> Iterable[Output]:
        """Pass on the wanted pulses.

        Parameters
        ----------
        thrusters_us, lights_us : [us]
            In the order of the vehicle file.
        stamp
            Now.
        armed
            Whether thrusters may be other than neutral.

        Returns
        -------
        Iterable[Output]
            Frames to send, and troubles.
        """

    def fault(self) -> str:
        """Why it does not follow although it should be armed; empty where it does."""

    @property
    def left_armed(self) -> bool:
        """Whether it was armed from here, should be so no more, and does not say that it is disarmed."""

    @property
    def owned(self) -> bool:
        """Whether it was armed from here, and was neither disarmed since nor taken over, as far as is known."""


@dataclass(frozen=True, slots=True)
class Rider:
    """A sensor on the line of the output: its driver, and who takes its outputs and frames."""

    device: SerialDevice
    deliver: Callable[[Iterable[Output]], None]
    tap: Tap


class LineOutput:
    """An output with a mind of its own on a serial port, or in a network, and the sensors on the same line."""

    def __init__(self, path: str, device: OutputDevice, clock: Clock, tap: Tap, riders: Sequence[Rider] = ()) -> None:
        self._path, self._device, self._clock, self._tap = path, device, clock, tap
        self._riders = riders
        self._port: Line | None = None
        self._asked_on = False
        """Whether the line was left open for a device that has answered and was not ready yet."""
        self._outputs: list[Output] = []
        self._seen: deque[Stamped[AppliedPulses]] = deque(maxlen=MOST_REPORTS)
        """Reported pulses that nobody has asked for yet; of one time those that came last."""
        self._last: Stamped[AppliedPulses] | None = None
        self.now = clock.now
        self.wake = clock.wake

    def wait(self, until: Stamp, meanwhile: Meanwhile = nothing) -> None:
        """Sleep until bytes come, but no longer than wishes may stay away."""
        soon = min(until, after(self._clock.now(), SERIAL_TURN_S))
        if self._port is None:
            self._clock.sleep_until(soon, meanwhile=meanwhile)
        else:
            self._port.wait(soon, meanwhile)

    def set_up(self, *, patient: bool = False) -> str:
        """Open the line and wait for the device to answer; one that has answered is asked on, on the open line.

        Parameters
        ----------
        patient
            Whether to wait here until one that has answered is ready, or is known not to become so. Who serves the line
            and what else is on it does not: what sensors there have measured would be late by that.

        Returns
        -------
        str
            Its identity.

        Raises
        ------
        StillAnsweringError
            Where it has answered and is not ready yet; serve the line, and call again.
        DeviceError
            Where it does not answer in time, or lacks something.
        """
        asked_on, self._asked_on = self._asked_on and self._port is not None, False
        if not asked_on:
            self.close_port()
            self._port = open_line(self._path, self._device.baud, self._clock)
            now = self._clock.now()
            self._outputs = self._send(self._device.start(now))
            for rider in self._riders:
                rider.tap(now, True, b"")  # an empty frame marks a restart of the device
                self._ride(rider, rider.device.start(now))
        deadline = after(self._clock.now(), FOUND_WITHIN_S)
        while not self._device.ready:
            if self._device.lack:
                raise DeviceError(f"{self._path}: {self._device.trouble}")
            if self._device.settling and not patient:
                self._asked_on = True
                raise StillAnsweringError(f"{self._path}: {self._device.trouble}")
            # What an autopilot is asked is asked for a limited number of times: then it is ready, or lacks something.
            if self._clock.now() >= deadline and not self._device.settling:
                raise DeviceError(f"{self._path}: {self._device.trouble} (waited {FOUND_WITHIN_S:g} s)")
            try:
                self.wait(after(self._clock.now(), SERIAL_TURN_S))
                self._outputs = list(self.serve())
            except DeviceError:
                self.close_port()
                raise
        return self._device.identity

    def write(self, pulses: Pulses, *, armed: bool) -> None:
        """Hand over the wanted pulses, and whether they may be other than neutral."""
        outputs = self._device.drive(pulses.thrusters, pulses.lights, self._clock.now(), armed=armed)
        self._outputs += self._send(outputs)

    def applied(self, pulses: Pulses) -> Sequence[Stamped[AppliedPulses]]:
        """All that the board has reported since the last call, else the last; before a report, the wanted ones, now."""
        if self._last is None:
            return (Stamped(self._clock.now(), AppliedPulses(pulses.thrusters)),)
        made, count = list(self._seen) or [self._last], len(pulses.thrusters)
        self._seen.clear()
        return [Stamped(one.stamp, AppliedPulses(one.reading.pulses_us[:count])) for one in made]

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
        for rider in self._riders:
            if data:
                rider.tap(stamp, False, data)
            self._ride(rider, [*(rider.device.feed(data, stamp) if data else ()), *rider.device.tick(stamp)])
        for one in outputs:
            if isinstance(one, Stamped) and isinstance(one.reading, AppliedPulses):
                self._keep(Stamped(one.stamp, one.reading))
        return outputs

    def _keep(self, report: Stamped[AppliedPulses]) -> None:
        if self._seen and self._seen[-1].stamp == report.stamp:  # a board without a time has that of the arrival
            self._seen.pop()
        self._seen.append(report)
        self._last = report

    def check(self, pulses: Pulses) -> None:
        """Require that it speaks, DeviceError where it does not; it reports its pulses unprompted."""
        del pulses
        if not self._device.ready:
            raise DeviceError(f"{self._path}: {self._device.trouble}")

    def fault(self) -> str:
        """Why it does not follow."""
        return self._device.fault()

    def left_armed(self) -> bool:
        """Whether the far end may be armed although it should not be."""
        return self._device.left_armed or (self._port is None and self._device.owned)

    def shut_off(self) -> None:
        """Give up a line that failed before its device was ready; otherwise it goes neutral without commands."""
        if self._asked_on:  # what it was asked can be answered there no more
            self.close_port()

    def close(self) -> None:
        """Close port and clock."""
        self.close_port()
        self._clock.close()

    def close_port(self) -> None:
        """Close the port only."""
        if self._port is not None:
            self._port.close()
            self._port = None

    def _ride(self, rider: Rider, outputs: Iterable[Output]) -> None:
        """Send what a sensor asks for, and hand on what it has read."""
        if self._port is not None and (kept := self._port.send_all(outputs, rider.tap)):
            rider.deliver(kept)

    def _send(self, outputs: Iterable[Output]) -> list[Output]:
        return [] if self._port is None else self._port.send_all(outputs, self._tap)


ThrusterOutput: TypeAlias = RegisterOutput | LineOutput | ForceOutput


def set_up_patiently(output: ThrusterOutput) -> str:
    """Set an output up, where nothing else is to be served: an autopilot that has answered is waited for.

    Parameters
    ----------
    output
        As it was opened.

    Returns
    -------
    str
        Its identity.

    Raises
    ------
    DeviceError
        Where it does not become ready.
    """
    return output.set_up(patient=True) if isinstance(output, LineOutput) else output.set_up()


def open_output(
    vehicle: Vehicle,
    port: str,
    clock: str,
    tap: Tap,
    name: str,
    *,
    neutral: Pulses,
    riders: Sequence[Rider] = (),
    left_armed: bool = False,
) -> ThrusterOutput:
    """Open the output of a vehicle file. DeviceError says what is missing.

    Parameters
    ----------
    vehicle
        Whose output it is.
    port, clock
        "mock:..." too.
    tap
        Gets every frame.
    name
        Of the client.
    neutral
        Of its guard: the output is set up to it.
    riders
        Sensors on its line.
    left_armed
        Whether the process that had it before has left it armed, as far as is known.

    Returns
    -------
    ThrusterOutput
        Ready to write.
    """
    if vehicle.output.device == "stm32":
        return LineOutput(port, Stm32(vehicle.output_channels()), open_clock(clock, name), tap)
    if vehicle.output.device == "ardusub":
        from hindrax_drivers.devices.ardupilot.output import ArduSub  # noqa: PLC0415  # 40 ms for whoever has none

        return LineOutput(port, ArduSub(vehicle, left_armed=left_armed), open_clock(clock, name), tap, riders)
    line = open_enable_line(vehicle.output, port)
    try:
        return RegisterOutput(open_bus(port, name), pca9685_of(vehicle, neutral.all_us), line, tap)
    except DeviceError:
        line.close()
        raise
