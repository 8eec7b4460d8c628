"""The example data: a pool test of the mock, and the log of a BlueROV2 on ArduSub, with their truth beside them.

`./hindrax reference --example-data --out DIR` makes them.
"""

import math
import random
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from hindrax_core.errors import HindraxError
from hindrax_core.text.text_file import replace_text
from hindrax_core.vehicle import load_vehicle
from hindrax_tools.ardusub import HEAVY, STEP_S, flight

LOG_S = 240.0
SEED = 1
FORMATS = {
    "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns", "<BB4s16s64s"),
    "PARM": (1, "QNf", "TimeUS,Name,Value", "<Q16sf"),
    "ATT": (2, "Qccc", "TimeUS,Roll,Pitch,Yaw", "<Qhhh"),
    "XKF1": (3, "QBfff", "TimeUS,C,VN,VE,VD", "<QBfff"),
    "XKF4": (4, "QBI", "TimeUS,C,SS", "<QBI"),
    "IMU": (5, "QBfff", "TimeUS,I,GyrX,GyrY,GyrZ", "<QBfff"),
    "RCOU": (6, "Q" + "H" * 8, "TimeUS," + ",".join(f"C{n}" for n in range(1, 9)), "<Q8H"),
    "BAT": (7, "QBf", "TimeUS,Inst,Volt", "<QBf"),
}
"""Messages of a DataFlash log: number, format, columns as the log describes them; format of Python."""
PARAMETERS = {"FRAME_CONFIG": 2.0} | {f"SERVO{n}_FUNCTION": 32.0 + n for n in range(1, 9)}
VELOCITY_NOISE_mps, RATE_NOISE_radps, ANGLE_NOISE_deg, VOLTAGE_NOISE = 0.01, 0.003, 0.3, 0.02
HEALTHY = 0x1F
"""Of XKF4.SS: attitude, horizontal and vertical velocity, positions are claimed."""
PAGE = """# Example data of hindrax

`pool-test/`: the mock of the Hindrax flew `./hindrax pool-test --mock --dof surge --seed {seed}` in its world *pool*.
Its truth, with the losses of that world, stands in `coefficients.yaml` with each value.

`bluerov2.bin`: a simulated heavy BlueROV2 on ArduSub, flown by hand for {seconds:.0f} s, a motion after the other, with
noise of its estimator and gyroscope. Its truth:

| motion | k_q [N s^2/m^2, N m s^2] | k_l [N s/m, N m s] | added mass [kg, kg m^2] |
|---|---|---|---|
{rows}

    ./hindrax report pool-test
    ./hindrax identify bluerov2.bin --dof surge sway heave yaw
"""


def make(folder: Path) -> None:
    """Write the example data into a folder; HindraxError where the pool test fails."""
    folder.mkdir(parents=True, exist_ok=True)
    words = [
        "pool-test",
        "--mock",
        "--dof",
        "surge",
        "--seed",
        str(SEED),
        "--headless",
        "--out",
        str(folder / "pool-test"),
    ]
    done = subprocess.run([sys.executable, "-m", "hindrax_cli", *words], check=False)  # noqa: S603  # our own
    if done.returncode:
        raise HindraxError(f"{folder}: the pool test ended with {done.returncode}; its last lines are above")
    (folder / "bluerov2.bin").write_bytes(b"".join(dataflash(LOG_S, SEED)))
    replace_text(folder / "README.md", PAGE.format(seed=SEED, seconds=LOG_S, rows="\n".join(_truth())))


def dataflash(seconds: float, seed: int) -> Iterator[bytes]:
    """Bytes of a DataFlash log of the flight of `hindrax_tools.ardusub`."""
    for name, (number, kinds, columns, layout) in FORMATS.items():
        yield _packed("FMT", number, 3 + struct.calcsize(layout), name.encode(), kinds.encode(), columns.encode())
    for name, value in PARAMETERS.items():
        yield _packed("PARM", 1_000_000, name.encode(), value)
    chance, volts = random.Random(seed), load_vehicle(HEAVY).supply_V  # noqa: S311  # noise of a simulation
    heading = 0.0
    for step, (pulses, speeds) in enumerate(flight(seconds)):
        at_us = 1_000_000 + round(1e6 * STEP_S * step)
        heading += STEP_S * speeds["yaw"]
        angles = (chance.gauss(0.0, ANGLE_NOISE_deg), chance.gauss(0.0, ANGLE_NOISE_deg), math.degrees(heading))
        surge, sway, heave = (
            speeds[axis] + chance.gauss(0.0, VELOCITY_NOISE_mps) for axis in ("surge", "sway", "heave")
        )
        north = math.cos(heading) * surge - math.sin(heading) * sway
        east = math.sin(heading) * surge + math.cos(heading) * sway
        noise = [chance.gauss(0.0, RATE_NOISE_radps) for _ in range(3)]
        yield _packed("ATT", at_us, *(round(1e2 * ((angle + 180.0) % 360.0 - 180.0)) for angle in angles))
        yield _packed("XKF4", at_us, 0, HEALTHY)
        yield _packed("XKF1", at_us, 0, north, east, heave)
        yield _packed("IMU", at_us, 0, noise[0], noise[1], speeds["yaw"] + noise[2])
        yield _packed("RCOU", at_us, *pulses)
        yield _packed("BAT", at_us, 0, volts + chance.gauss(0.0, VOLTAGE_NOISE))


def _packed(name: str, *values: float | bytes) -> bytes:
    number, _, _, layout = FORMATS[name]
    return b"\xa3\x95" + bytes([number]) + struct.pack(layout, *values)


def _truth() -> Iterator[str]:
    water = load_vehicle(HEAVY).hydrodynamics
    assert water is not None
    for index, axis in ((0, "surge"), (1, "sway"), (2, "heave"), (5, "yaw")):
        drag = water.drag(axis)
        yield f"| {axis} | {drag.k_q:g} | {drag.k_l:g} | {water.added_mass[index]:g} |"
