"""Make the reference bags anew: short flights of the mock vehicle, each with another motion and another fault.

One is flown by hand, beyond the limits of the vehicle and with a thruster out of use: for guard and allocation.

    python test/replay/make_bags.py [NAME ...]

Run it in the environment of the clone, then `./hindrax replay --all --update-refs`: new bags want new references.
"""

import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path

from hindrax_core.topics import (
    ALLOCATION,
    BATTERY,
    DIAGNOSTICS,
    ODOMETRY,
    THRUSTER_COMMAND,
    THRUSTER_HEALTH,
    THRUSTER_STATE,
    TOPICS,
    WRENCH,
    Topic,
    resolved,
)

TOOL = (sys.executable, "-m", "hindrax_cli")
BAGS = Path(__file__).parent / "bags"
SECONDS = 32
SHORT = 15
"""Of the flight without a fault, which the real nodes replay."""
FLIGHTS = {
    # name: motion, fault (seconds since the mock began; the bag begins some seconds later)
    "surge_estimates": ("surge", ""),
    "heave_garbage": ("heave", "garbage:dvl75@22+4"),
    "yaw_replug": ("yaw", "unplug_replug:ping1d@22+4"),
    "sway_nack": ("sway", "nack:ms5837@22+4"),
    "roll_flips": ("roll", "bit_flips:dvl75@22+4"),
    "pitch_reset": ("pitch", "reset:icm20948@22+4"),
}
LEFT_OUT = {ODOMETRY, WRENCH, THRUSTER_COMMAND, DIAGNOSTICS}
"""Those of the allocation have a bag of their own; with the others nothing is compared, and they are large."""
BY_HAND = "by_hand_at_limits"
STEPS = (
    "hold depth 1.4",
    "wrench 0 0 80 0 0 0 --for 0.5",  # on top of the hold: more than the vehicle's limit
    "wrench 60 60 0 0 0 12 --for 2",  # more than the thrusters give
    "thruster disable T3",
    "wrench 40 0 0 0 0 5 --for 1.5",
    "thruster enable T3",
    "hold all off",
    "wrench 30 20 0 0 0 5 --for 1",
    "disarm",
)
ALLOCATED = (WRENCH, THRUSTER_COMMAND, THRUSTER_STATE, THRUSTER_HEALTH, BATTERY, ALLOCATION)
STARTING_S = 60.0


def main() -> None:
    """Fly the flights that are named, or all, and keep their beginning."""
    for name in sys.argv[1:] or (*FLIGHTS, BY_HAND):
        with tempfile.TemporaryDirectory() as place:
            run = Path(place) / "run"
            if name == BY_HAND:
                fly_by_hand(run)
                keep(run, name, ALLOCATED)
                continue
            motion, fault = FLIGHTS[name]
            faults = ("--fault", fault) if fault else ()
            hindrax("pool-test", "--mock", "--headless", "--dof", motion, *faults, "--out", str(run))
            seconds = SECONDS if fault else SHORT
            keep(run, name, (topic for topic in TOPICS if topic not in LEFT_OUT), "--to", str(seconds))


def fly_by_hand(run: Path) -> None:
    """Take the steps with a mock vehicle that is up."""
    up = subprocess.Popen([*TOOL, "up", "--mock", "--record", "--out", str(run)])
    try:
        deadline = time.monotonic() + STARTING_S
        while subprocess.run([*TOOL, "arm"], check=False).returncode and time.monotonic() < deadline:
            time.sleep(1.0)
        for step in STEPS:
            hindrax(*step.split())
    finally:
        up.send_signal(signal.SIGINT)
        up.wait()


def keep(run: Path, name: str, topics: Iterable[Topic], *words: str) -> None:
    """Export some topics of a run as a reference bag."""
    hindrax("bag", "export", str(run / "bag"), "--topics", *map(resolved, topics), *words, "--out", str(BAGS / name))


def hindrax(*words: str) -> None:
    """Run the tool; a flight that a fault spoils is still a record."""
    subprocess.run([*TOOL, *words], check=words[0] != "pool-test")


if __name__ == "__main__":
    main()
