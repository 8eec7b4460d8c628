"""GPIO lines of the virtual vehicle: a chip that the kernel simulates (gpio-sim), wired to the emulated devices.

Whoever asks the kernel for a line finds a chip as on a board: driver, device file and group are real, and so are the
edges that the kernel counts and stamps. What the lines carry comes from the emulators, at the end of each of their
steps. Source: Linux, Documentation/admin-guide/gpio/gpio-sim.rst, include/trace/events/gpio.h.
"""

import contextlib
import os
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

from hindrax_core.bus_operations import Read
from hindrax_core.events import Stamp, to_s
from hindrax_core.sensor_table import row_of
from hindrax_core.vehicle import Vehicle, chip_and_line
from hindrax_drivers.buses.gpio import GPIO_PREFIX
from hindrax_sim.devices.icm20948 import Icm20948
from hindrax_sim.devices.pca9685 import Pca9685
from hindrax_sim.hardware import Hardware, emulator_of

SIMULATED, PLATFORM = Path("/sys/kernel/config/gpio-sim"), Path("/sys/devices/platform")
LINES = 54
"""Lines of a BCM2711."""
TRACING = Path("/sys/kernel/tracing")
LOW = re.compile(rb"gpio_value: \d+ set 0")
MONOSTABLE_S = 0.3
"""How long the timer of docs/explanation/safety.md keeps the outputs enabled after a pulse."""
LEAK, CUT_READY, CUT_ENABLE = "leak", "cut-data-ready", "cut-enable-line"
"""Files that harm: water in the hull, and a wire that is cut."""


class SimulatedChip:
    """A chip with this label, of the kernel; one that is there already stays, with whoever uses it."""

    def __init__(self, label: str) -> None:
        chip = SIMULATED / "vehicle"
        if not chip.exists():
            (chip / "bank").mkdir(parents=True)
            (chip / "bank/num_lines").write_text(str(LINES))
            (chip / "bank/label").write_text(label)
            (chip / "live").write_text("1")
        self._folder = PLATFORM / _line(chip / "dev_name") / _line(chip / "bank/chip_name")

    def drive(self, line: int, *, high: bool) -> None:
        """Pull an input, as whatever is wired to it does: stronger than the bias that its user asked for."""
        (self._folder / f"sim_gpio{line}/pull").write_text("pull-up" if high else "pull-down")

    def is_high(self, line: int) -> bool:
        """Level of an output, or of its pull while nobody holds it."""
        return _line(self._folder / f"sim_gpio{line}/value") == "1"


class Monostable:
    """The retriggerable timer behind an enable line. Its pulses are too short to poll, but the kernel traces them."""

    def __init__(self) -> None:
        (TRACING / "events/gpio/gpio_value/enable").write_text("1")
        self._trace = os.open(TRACING / "trace_pipe", os.O_RDONLY | os.O_NONBLOCK)
        self._until_s = 0.0

    def enables(self, now_s: float) -> bool:
        """Whether a pulse came lately."""
        with contextlib.suppress(BlockingIOError):
            while traced := os.read(self._trace, 65536):
                if LOW.search(traced):
                    self._until_s = now_s + MONOSTABLE_S
        return now_s < self._until_s


class Wiring:
    """Lines that a vehicle file names. `step` belongs after every step of the hardware."""

    def __init__(self, hardware: Hardware, folder: Path) -> None:
        self._hardware, self._folder = hardware, folder
        vehicle = hardware.vehicle
        (label,) = labels_of_chips(vehicle)
        self._chip = SimulatedChip(label)
        self._probes = [
            emulator_of(mount.device).address if mount.address is None else mount.address
            for mount in vehicle.sensors.values()
            if row_of(mount.device).wire == "gpio"
        ]
        self._timed = [part for part in hardware.registers.values() if isinstance(part, Icm20948)]
        for name, mount in vehicle.sensors.items():
            part = hardware.registers.get(name)
            if mount.data_ready and isinstance(part, Icm20948):
                part.data_ready.wired_to = partial(self._pulse, chip_and_line(mount.data_ready, "data_ready")[1])
        self._enable = self._enabling(vehicle)

    def step(self, now: Stamp) -> None:
        """Put the levels of now on the lines, and take those of the outputs."""
        now_s = to_s(now)
        self._hardware.world.water_in_hull = (self._folder / LEAK).exists()
        for line in self._probes:
            self._chip.drive(line, high=self._hardware.i2c.transfer(Read(line, 1), now) == b"\x01")
        for part in self._timed:
            part.data_ready.cut = (self._folder / CUT_READY).exists()
            part.read(0, now_s)  # its samples up to now raise the line
        if isinstance(self._hardware.output, Pca9685) and self._enable is not None:
            self._hardware.output.enable(now_s, low=self._enable(now_s) and not (self._folder / CUT_ENABLE).exists())

    def _pulse(self, line: int, _taken_s: float) -> None:
        self._chip.drive(line, high=True)
        self._chip.drive(line, high=False)

    def _enabling(self, vehicle: Vehicle) -> Callable[[float], bool] | None:
        """Whether OE is low, as it is wired: by a timer, or by the line with a resistor that pulls it up."""
        if not vehicle.output.enable_line:
            return None
        line = chip_and_line(vehicle.output.enable_line, "output.enable_line")[1]
        self._chip.drive(line, high=True)
        return Monostable().enables if vehicle.output.enable_timer else lambda _now_s: not self._chip.is_high(line)


def labels_of_chips(vehicle: Vehicle) -> set[str]:
    """Labels of the chips whose lines the vehicle file names."""
    lines = [vehicle.output.enable_line, *(mount.data_ready for mount in vehicle.sensors.values())]
    ports = [mount.port for mount in vehicle.sensors.values() if mount.port.startswith(GPIO_PREFIX)]
    return {chip_and_line(line, "line")[0] for line in lines if line} | {
        port.removeprefix(GPIO_PREFIX) for port in ports
    }


def _line(file: Path) -> str:
    return file.read_text(encoding="ascii").strip()
