"""The devices of the virtual vehicle, run there in a service of their own: `python hardware.py`.

The bus is the file that the vehicle file names, the serial ports are ptys. What is on the wires goes to the second
serial line of the machine, ten times a second and whenever it changes between neutral and thrust: the pulses as the
emulated PCA9685 gives them, whatever was killed, with the times of both clocks. The line ends in a file outside.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import TextIO

from hindrax_bringup.share_files import default_vehicle
from hindrax_core.events import Stamp, stamp_from_s
from hindrax_core.vehicle import load_vehicle
from hindrax_sim.mock_vehicle import MockVehicle

FOLDER, LINE = Path("/run/virtual-devices"), Path("/dev/ttyS1")
PERIOD_S = 0.1


class Witness:
    """Writes what is on the wires: wall clock, monotonic clock [s], thrust or neutral."""

    def __init__(self, vehicle: MockVehicle, line: TextIO) -> None:
        self._vehicle, self._line = vehicle, line
        self._neutral, self._next_s = False, 0.0

    def write(self, _now: Stamp) -> None:
        """Write a line if one is due."""
        now_s, neutral = time.monotonic(), self._vehicle.hardware.true_state().neutral
        if neutral is self._neutral and now_s < self._next_s:
            return
        self._neutral, self._next_s = neutral, now_s + PERIOD_S
        self._line.write(f"{time.time():.3f} {now_s:.3f} {'neutral' if neutral else 'thrust'}\n")
        self._line.flush()


class Devices(MockVehicle):
    """The mock vehicle in longer steps: the machine has none to spare."""

    step_s = 0.02

    def _next_stamp(self) -> Stamp:
        return Stamp(self.hardware.stamp + stamp_from_s(self.step_s))


def main() -> None:
    """Serve until the end."""
    file = load_vehicle(default_vehicle())
    FOLDER.mkdir(parents=True, exist_ok=True)
    with (
        Devices(file, FOLDER, seed=1, rate=1.0) as vehicle,
        vehicle.offer_file(file.output.port),
        LINE.open("w") as line,
    ):
        for name, mount in file.sensors.items():
            if name in vehicle.hardware.serial:
                _link(Path(mount.port), FOLDER / name)
        vehicle.after_step.append(Witness(vehicle, line).write)
        while True:
            vehicle.step()


def _link(port: Path, pty: Path) -> None:
    """Put a pty where the vehicle file looks for a port; all users may open it."""
    port.parent.mkdir(parents=True, exist_ok=True)
    port.unlink(missing_ok=True)
    port.symlink_to(pty)
    pty.resolve().chmod(0o666)


if __name__ == "__main__":
    main()
