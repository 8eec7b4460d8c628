"""The devices of the virtual vehicle, run there in a service of their own, as a module.

The bus is the file that the vehicle file names, serial ports are ptys, what is on a network serves there, and GPIO
lines are those of a chip that the kernel simulates.

What is on the wires goes to the second serial line of the machine, ten times a second and whenever it changes between
neutral and thrust: the pulses as the emulated PCA9685 gives them, whatever was killed, with the times of both clocks.
The line ends in a file outside.
"""

import contextlib
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TextIO

from hindrax_bringup.share_files import usual_vehicle
from hindrax_core.events import Stamp
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.buses.line import TCP_PREFIX
from hindrax_i2c_file.fuse_i2c import FuseI2c
from hindrax_sim.buses.serial_ends import TcpEnd
from hindrax_sim.hardware import Hardware
from hindrax_sim.mock_vehicle import MockVehicle
from hindrax_tools.virtual_vehicle.gpio import Wiring, labels_of_chips

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


@dataclass(frozen=True, slots=True)
class Seen:
    """What was on the wires at one time."""

    wall_s: float
    monotonic_s: float
    thrust: bool


def seen_in(lines: Sequence[str]) -> list[Seen]:
    """What the devices wrote; the last line may be cut off."""
    words = [line.split() for line in lines]
    whole = [one for one in words if len(one) == 3 and one[2] in ("neutral", "thrust")]
    return [Seen(float(wall), float(monotonic), word == "thrust") for wall, monotonic, word in whole]


def thrust_after_s(seen: Sequence[Seen], since_s: float) -> float | None:
    """How long there was thrust after a time of the monotonic clock [s]; None when it never ended."""
    after = [one for one in seen if one.monotonic_s >= since_s]
    if not after or after[-1].thrust:
        return None
    ends = [now.monotonic_s for before, now in pairwise(after) if before.thrust and not now.thrust]
    return max(ends, default=since_s) - since_s


class Devices(MockVehicle):
    """The mock vehicle in longer steps: the machine has none to spare."""

    step_s = 0.02


def main() -> None:
    """Serve until the end."""
    file = load_vehicle(usual_vehicle())
    FOLDER.mkdir(parents=True, exist_ok=True)
    with (
        Devices(Hardware(file, 1), FOLDER, rate=1.0, waits=False) as vehicle,
        contextlib.closing(vehicle.offer_file(partial(FuseI2c, file.output.port))),
        LINE.open("w") as line,
    ):
        for name in file.sensors.keys() & vehicle.hardware.serial:
            _offer(vehicle, name, file.sensors[name].port)
        if labels_of_chips(file):
            vehicle.after_step.append(Wiring(vehicle.hardware, FOLDER).step)
        vehicle.after_step.append(Witness(vehicle, line).write)
        while True:
            vehicle.step()


def _offer(vehicle: Devices, name: str, port: str) -> None:
    """Put a serial device where the vehicle file looks for it: on the network, or as a pty that all users may open."""
    if port.startswith(TCP_PREFIX):
        vehicle.put_on_network(name, TcpEnd())
        return
    path = Path(port)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    path.symlink_to(FOLDER / name)
    (FOLDER / name).resolve().chmod(0o666)


if __name__ == "__main__":
    main()
