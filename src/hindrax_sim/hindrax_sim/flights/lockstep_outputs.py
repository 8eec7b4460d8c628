"""The outputs of a vehicle in lock-step and by bytes: the real driver, and the emulated chip or autopilot behind it."""

from collections.abc import Callable, Iterable, Mapping, Sequence

from hindrax_core.bus_operations import DeviceError, Program, Transaction, run, wire_error
from hindrax_core.driver_interface import Output, Send, SerialDevice, Trouble
from hindrax_core.events import Stamp, Stamped, after, seconds_between, to_s
from hindrax_core.readings import AppliedPulses, Reading
from hindrax_core.vehicle import Vehicle
from hindrax_drivers.devices.ardupilot.output import ArduSub
from hindrax_drivers.devices.pca9685 import pca9685_of
from hindrax_drivers.output.output_guard import guard_of
from hindrax_drivers.output.output_ports import FOUND_WITHIN_S
from hindrax_sim.hardware import THRUSTERS, Hardware


def transfer(hardware: Hardware, now: Stamp, transaction: Transaction) -> bytes:
    """Transfer on the virtual bus; DeviceError as on a real one.

    Parameters
    ----------
    hardware
        With the bus.
    now
        Time of the mock.
    transaction
        To run.

    Returns
    -------
    bytes
        What was read.
    """
    try:
        return hardware.i2c.transfer(transaction, now)
    except OSError as error:
        raise wire_error("i2c", transaction.address, error.errno or 0) from error


class ChipOutput:
    """A PCA9685: what it makes is known when it is written."""

    def __init__(self, vehicle: Vehicle, hardware: Hardware, log: list[tuple[str, Output]]) -> None:
        """`log` gets what the driver has to say."""
        self._hardware, self._log = hardware, log
        neutral = guard_of(vehicle).neutral
        self._pca = pca9685_of(vehicle, neutral.all_us)
        self._made_us = self._pca.applied(neutral.thrusters)
        self._lights = neutral.lights
        self._run(self._pca.configure())

    def arrived(self, _data: bytes) -> list[tuple[str, Stamped[Reading]]]:
        """Return nothing: it has no line."""
        return []

    def tick(self) -> list[tuple[str, Stamped[Reading]]]:
        """Return nothing: it has no timers."""
        return []

    def drive(self, pulses_us: Sequence[float], *, armed: bool) -> Stamped[AppliedPulses]:
        """Write pulses, which the chip rounds to its counts. A failed write is logged: the previous pulses stay."""
        del armed
        if self._run(self._pca.write([*pulses_us, *self._lights])):
            self._made_us = self._pca.applied(pulses_us)
        return Stamped(self._hardware.stamp, AppliedPulses(self._made_us))

    def fault(self) -> str:
        """Return no fault: a chip has no state of its own."""
        return ""

    def _run(self, program: Program[object]) -> bool:
        """Run a program; its pauses take no time of the world. False when it failed, which is logged."""
        now = self._hardware.stamp

        def pause(seconds: float) -> None:
            nonlocal now
            now = after(now, seconds)

        try:
            run(program, lambda transaction: transfer(self._hardware, now, transaction), pause)
        except DeviceError as error:
            self._log.append((THRUSTERS, Trouble(now, str(error))))
            return False
        return True


class AutopilotOutput:
    """An ArduSub, and the sensors on its line; what it makes is known when it says so."""

    def __init__(
        self,
        vehicle: Vehicle,
        hardware: Hardware,
        riders: Mapping[str, SerialDevice],
        log: list[tuple[str, Output]],
    ) -> None:
        """`riders`: drivers of the sensors on its line, by name; `log` gets what the drivers have to say."""
        self._hardware, self._riders, self._log = hardware, riders, log
        guard = guard_of(vehicle)
        self._lights = guard.neutral.lights
        self._made = Stamped(hardware.stamp, AppliedPulses(guard.neutral.thrusters))
        self._device = ArduSub(vehicle)
        self._answer = b""
        self._start()

    @property
    def ready(self) -> bool:
        """Whether it is as wanted, and speaks."""
        return self._device.ready

    @property
    def trouble(self) -> str:
        """Why it is not ready."""
        return self._device.trouble

    def arrived(self, data: bytes) -> list[tuple[str, Stamped[Reading]]]:
        """Read what came over the line; return readings of the sensors on it, and of the supply."""
        data, self._answer = self._answer + data, b""
        return self._of_all(lambda device: device.feed(data, self._hardware.stamp)) if data else []

    def tick(self) -> list[tuple[str, Stamped[Reading]]]:
        """Let time pass; an autopilot that restarted, or came back, is asked anew."""
        lost = not self._device.ready and not self._device.settling
        if lost and seconds_between(self._started_at, self._hardware.stamp) >= FOUND_WITHIN_S:
            self._start()
        return self._of_all(lambda device: device.tick(self._hardware.stamp))

    def drive(self, pulses_us: Sequence[float], *, armed: bool) -> Stamped[AppliedPulses]:
        """Hand over the wanted pulses; return the pulses that it reported last, of when they were."""
        outputs = self._device.drive(tuple(pulses_us), self._lights, self._hardware.stamp, armed=armed)
        self._sort(THRUSTERS, outputs)
        return self._made

    def fault(self) -> str:
        """Why it does not follow; empty where it does."""
        return self._device.fault() or ("" if self._device.ready else self._device.trouble)

    def _start(self) -> None:
        self._started_at = self._hardware.stamp
        self._of_all(lambda device: device.start(self._hardware.stamp))

    def _of_all(self, of: Callable[[ArduSub | SerialDevice], Iterable[Output]]) -> list[tuple[str, Stamped[Reading]]]:
        readings = self._sort(THRUSTERS, of(self._device))
        for name, rider in self._riders.items():
            readings += self._sort(name, of(rider))
        return readings

    def _sort(self, name: str, outputs: Iterable[Output]) -> list[tuple[str, Stamped[Reading]]]:
        """Bytes to the autopilot, reported pulses kept, readings returned, the rest into the log."""
        readings: list[tuple[str, Stamped[Reading]]] = []
        for output in outputs:
            if isinstance(output, Send):
                self._answer += self._hardware.serial[THRUSTERS].receive(output.data, to_s(self._hardware.stamp))
            elif not isinstance(output, Stamped):
                self._log.append((name, output))
            elif isinstance(output.reading, AppliedPulses):
                self._made = Stamped(output.stamp, output.reading)
            else:
                readings.append((name, output))
        return readings
