"""Make the reference bags anew: short flights of the mock vehicle, each with another motion and another fault.

    python test/replay/make_bags.py [NAME ...]

Run it in the environment of the clone, then `./hindrax replay --all --update-refs`: new bags want new references.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from hindrax_core.topics import DIAGNOSTICS, ODOMETRY, THRUSTER_COMMAND, TOPICS, WRENCH, resolved

BAGS = Path(__file__).parent / "bags"
SECONDS = 32
FLIGHTS = {
    # name: motion, fault (seconds since the mock began; the bag begins some seconds later)
    "heave_garbage": ("heave", "garbage:dvl75@22+4"),
    "yaw_replug": ("yaw", "unplug_replug:ping1d@22+4"),
    "sway_nack": ("sway", "nack:ms5837@22+4"),
    "roll_flips": ("roll", "bit_flips:dvl75@22+4"),
    "pitch_reset": ("pitch", "reset:icm20948@22+4"),
}
LEFT_OUT = {ODOMETRY, WRENCH, THRUSTER_COMMAND, DIAGNOSTICS}
"""Nothing is compared with them, and they are large."""


def main() -> None:
    """Fly the flights that are named, or all, and keep their beginning."""
    for name in sys.argv[1:] or FLIGHTS:
        motion, fault = FLIGHTS[name]
        with tempfile.TemporaryDirectory() as place:
            run = Path(place) / "run"
            hindrax("pool-test", "--mock", "--headless", "--dof", motion, "--fault", fault, "--out", str(run))
            topics = [resolved(topic) for topic in TOPICS if topic not in LEFT_OUT]
            words = ["--topics", *topics, "--to", str(SECONDS), "--out", str(BAGS / name)]
            hindrax("bag", "export", str(run / "bag"), *words)


def hindrax(*words: str) -> None:
    """Run the tool; a flight that a fault spoils is still a record."""
    subprocess.run([sys.executable, "-m", "hindrax_bringup.cli", *words], check=words[0] != "pool-test")


if __name__ == "__main__":
    main()
