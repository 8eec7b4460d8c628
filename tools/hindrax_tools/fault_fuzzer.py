"""Fuzzer of faults: pairs and triples of device faults at random moments, in random modes, on every vehicle.

    python -m hindrax_tools.fault_fuzzer --minutes 120
    python -m hindrax_tools.fault_fuzzer --repeat "hindrax hold 7 depth_stuck:ms5837@15+9999"

Each case is flown in lock-step, by bytes, and judged by the truth: thrust on a wrong state, beyond a tilt, after it was
disarmed; contact with a wall, an end, or thrusters without power, of which the operator is told nothing; a maneuver
that a fault has ended and that ends with 0; a defect in the code. What is found is shrunk to fewer faults, and printed
as a line that repeats it. A finding that is mended stays as a line of `faults/kept_cases.txt`.
"""

import argparse
import math
import random
import sys
import time
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from hindrax_analysis.identification.executor import HERE, Workers, add_workers, workers_of
from hindrax_bringup.share_files import default_vehicle, share_folder, vehicle_file
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_sim.faults.fault_registry import FAULTS, FaultSpec, parse_fault
from hindrax_tools.faults.device_faults import ModePilot, unsaid, watched
from hindrax_tools.faults.fault_outcome import (
    ARMING,
    BRAKING,
    DISARMED,
    EVERY_MODE,
    HOLD,
    LONGEST_WRONG_S,
    MANEUVER,
    OPERATOR,
    RECENTRE,
    WEIGHING,
)

FROM_S = {
    **dict.fromkeys((HOLD, OPERATOR, WEIGHING), (12.0, 20.0)),
    MANEUVER: (16.0, 40.0),
    DISARMED: (5.0, 8.0),
    ARMING: (3.0, 12.0),
    BRAKING: (20.0, 30.0),
    RECENTRE: (22.0, 28.0),
}
"""Span in which the faults of a mode begin; the maneuver is cancelled, and dead reckoning restarted, at 26 s."""
KEPT_CASES = Path(__file__).parent / "faults" / "kept_cases.txt"
AFTER_S = 12.0
OUTPUT = "thrusters"
"""What checks and sets up the output again is no part of the lock-step: its faults are rows of `process_faults`. How a
vehicle is built never changes in flight: `commissioning_draws` has those faults."""
LONGEST_DISARMED_S = 0.2
"""Time that a failed write of neutral may take."""
ROUND = 32
"""Flights that several workers share out among them; the time is looked at between rounds."""
LASTING_S = (0.1, 1.0, 5.0, 9999.0)


@dataclass(frozen=True, slots=True)
class FaultCase:
    """One flight: the vehicle's file, the mode, the seed, and its faults."""

    vehicle: str
    mode: str
    seed: int
    faults: tuple[FaultSpec, ...]

    def __str__(self) -> str:
        """The line that repeats it."""
        faults = (f"{one.name}:{one.devices[0]}@{one.start_s:g}+{one.duration_s:g}" for one in self.faults)
        return " ".join((self.vehicle, self.mode, str(self.seed), *faults))

    @classmethod
    def parse(cls, line: str) -> "FaultCase":
        """Undo `str`; UsageError names what is wrong."""
        try:
            vehicle, mode, seed, *faults = line.split()
            number = int(seed)
        except ValueError as error:
            raise UsageError(f"found {line!r}, wanted VEHICLE MODE SEED FAULT...") from error
        if mode not in EVERY_MODE or not faults:
            raise UsageError(f"found {line!r}, wanted a mode of {', '.join(EVERY_MODE)}, and faults")
        aboard = flown_by_bytes(vehicle_file(vehicle))
        return cls(vehicle, mode, number, tuple(parse_fault(one, aboard) for one in faults))


def flown_by_bytes(file: Path) -> Vehicle:
    """Vehicle of a file; one behind an autopilot, which is no part of the lock-step, with the electronics of our own.

    Hull, thrusters and water are those of the file: what the guards have to master.
    """
    vehicle, own = load_vehicle(file), load_vehicle(default_vehicle())
    by_bytes = vehicle.output.device == own.output.device
    return vehicle if by_bytes else replace(vehicle, sensors=own.sensors, output=own.output)


def drawn(vehicles: dict[str, Vehicle], random_: random.Random) -> FaultCase:
    """A random case of two or three faults."""
    name, mode = random_.choice(sorted(vehicles)), random_.choice(EVERY_MODE)
    targets = [(kind.name, device) for kind in FAULTS.values() for device in kind.devices(vehicles[name])]
    targets = [one for one in targets if one[1] != OUTPUT and FAULTS[one[0]].on_vehicle is None]
    faults = tuple(
        FaultSpec(kind, (device,), round(random_.uniform(*FROM_S[mode]), 1), random_.choice(LASTING_S))
        for kind, device in random_.sample(targets, random_.choice((2, 2, 3)))
    )
    return FaultCase(name, mode, random_.randrange(1000), faults)


def violations(case: FaultCase) -> tuple[str, ...]:
    """Fly one case; what must not have happened, empty when nothing."""
    pilot = ModePilot(case.mode, case.seed, flown_by_bytes(vehicle_file(case.vehicle)))
    until_s = max(one.start_s for one in case.faults) + AFTER_S
    try:
        found = watched(pilot, case.faults, case.seed, until_s)
    except Exception:  # noqa: BLE001  # a defect in the code, whatever it is, is a finding
        return (f"defect: {traceback.format_exc().splitlines()[-1]}",)
    mode = MANEUVER if case.mode == BRAKING else case.mode
    # The state of a vehicle built otherwise than its file says is wrong from the start, and until it turns faster than
    # an outer moment makes it nothing shows that (ADR 71): judged is that thrust ends before 45 degrees.
    built = any(FAULTS[one.name].on_vehicle is not None for one in case.faults)
    longest_s = math.inf if built else LONGEST_WRONG_S
    cell = found.judge.cell(case.vehicle, "", mode, case.seed, found.reason, worst_deg=180.0, longest_wrong_s=longest_s)
    disarmed_s = found.disarmed_thrust_s
    return (
        *cell.violated,
        *unsaid(found, mode, case.faults),
        *((f"thrust for {disarmed_s:.2f} s after it was disarmed",) if disarmed_s > LONGEST_DISARMED_S else ()),
    )


def kinds(violated: Sequence[str]) -> frozenset[str]:
    """Violations without their numbers."""
    return frozenset("".join(letter for letter in one if not letter.isdigit()) for one in violated)


def shrunk(case: FaultCase) -> FaultCase:
    """The case with as few faults as still violate the same, and with plain numbers where they do too."""
    wanted = kinds(violations(case))

    def same(one: FaultCase) -> bool:
        return bool(kinds(violations(one)) & wanted)

    for fault in case.faults:
        smaller = replace(case, faults=tuple(one for one in case.faults if one is not fault))
        if smaller.faults and same(smaller):
            case = smaller
    plain = replace(case, seed=0, faults=tuple(replace(one, start_s=float(round(one.start_s))) for one in case.faults))
    return plain if plain != case and same(plain) else case


def fuzzed(minutes: float, seed: int, workers: Workers = HERE) -> Iterator[tuple[FaultCase, tuple[str, ...]]]:
    """Draw and fly cases for so long; yields each with what it violates. The draws do not depend on the workers."""
    random_ = random.Random(seed)  # noqa: S311  # no secret
    vehicles = {file.stem: flown_by_bytes(file) for file in sorted(share_folder("vehicles").glob("*.yaml"))}
    deadline_s = time.monotonic() + 60.0 * minutes
    while time.monotonic() < deadline_s:
        cases = [drawn(vehicles, random_) for _ in range(1 if workers.here else ROUND)]
        yield from zip(cases, workers.run([partial(violations, one) for one in cases]), strict=True)


def main(words: Sequence[str] | None = None) -> int:
    """Print each finding, shrunk; 1 when there is one."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0, help="default 10")
    parser.add_argument("--seed", type=int, default=0, help="of the draws; default 0")
    parser.add_argument("--repeat", metavar="LINE", help="fly this case, as it was printed, and nothing else")
    add_workers(parser)
    arguments = parser.parse_args(words)
    try:
        return _printed(arguments)
    except UsageError as error:
        parser.error(str(error))
    except HindraxError as error:
        print(f"{parser.prog}: {error}", file=sys.stderr)
        return error.exit_code


def _printed(arguments: argparse.Namespace) -> int:
    if arguments.repeat is not None:
        violated = violations(FaultCase.parse(arguments.repeat))
        print("\n".join(violated) or "nothing is violated")
        return int(bool(violated))
    flown = bad = 0
    for case, violated in fuzzed(arguments.minutes, arguments.seed, workers_of(arguments)):
        flown += 1
        print(f"{flown} flights, {bad} findings: {case}", file=sys.stderr, flush=True)
        if violated:
            bad += 1
            print(f"{shrunk(case)}\n  {'; '.join(violated)}", flush=True)
    print(f"{flown} flights, {bad} findings")
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main())
