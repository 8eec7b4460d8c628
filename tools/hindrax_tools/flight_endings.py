"""How flights end where sensors lie: lock-step flights with faults drawn at random, and a table of their endings.

`python -m hindrax_tools.flight_endings --flights 100` flies each vehicle file in the world *pool*, with one more fault.
"""

import argparse
import math
import random
import sys
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from hindrax_bringup.share_files import default_vehicle
from hindrax_control.maneuver.goal import PLATEAUS, Goal, motions_to_fly
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_ident.online.session import Session
from hindrax_sim.conditions.world_table import POOL, sizes_of
from hindrax_sim.faults.fault_registry import FaultSpec
from hindrax_sim.flights.lockstep import Lockstep
from hindrax_sim.flights.pool_flight import GoalPilot, calibrated
from hindrax_sim.world import Conditions, World

LONGEST_S = 1800.0
REFUSED = "never armed"
DONE = "done"


@dataclass(frozen=True, slots=True)
class Fault:
    """What one flight has beside the world: its name, conditions by size, faults in time, and what begins with it."""

    name: str
    sizes: tuple[tuple[str, float], ...] = ()
    faults: tuple[FaultSpec, ...] = ()
    rocking_deg: tuple[float, float] = (0.0, 0.0)
    weak: tuple[str, float] = ("", 1.0)

    def begin(self, world: World) -> None:
        """Let go of a vehicle that leans, or weaken a thruster."""
        if any(self.rocking_deg):
            roll, pitch = map(math.radians, self.rocking_deg)
            world.plant.place((world.plant.x, world.plant.y, world.plant.z), (roll, pitch, 0.0))
        if self.weak[0]:
            world.fail_thruster(*self.weak)


@dataclass(frozen=True, slots=True)
class Ending:
    """How one flight ended: the guard's reason, DONE or REFUSED; and how often the hull met a wall."""

    vehicle: str
    motion: str
    fault: Fault
    seed: int
    how: str
    wall_hits: int

    @property
    def unsafe(self) -> bool:
        """Whether a wall was touched without a report of a guard."""
        return self.wall_hits > 0 and self.how in (DONE, REFUSED)


def drawn(seed: int, vehicle: Vehicle) -> Fault:
    """The fault of a seed; every kind comes as often as any other."""
    rng = random.Random(seed)  # noqa: S311  # a draw of test cases, not a secret
    start_s = rng.uniform(20.0, 120.0)
    thrusters, dvls = [one.name for one in vehicle.thrusters], vehicle.measuring("velocity")
    kinds = (
        lambda: Fault("DVL bias", sizes=(("dvl_bias", rng.uniform(0.002, 0.01)),)),
        lambda: Fault("rocking start", rocking_deg=(rng.uniform(-10.0, 10.0), rng.uniform(-10.0, 10.0))),
        lambda: Fault("current", sizes=(("current", rng.uniform(0.02, 0.15)),)),
        lambda: Fault("thruster dead", weak=(rng.choice(thrusters), 0.0)),
        lambda: Fault("thruster weak", weak=(rng.choice(thrusters), 0.7)),
        lambda: Fault("lock lost", faults=(FaultSpec("lock_lost", dvls, start_s, rng.uniform(2.0, 60.0)),)),
        lambda: Fault("DVL late", sizes=(("dvl_latency", rng.uniform(0.05, 0.3)),)),
    )
    return kinds[seed % len(kinds)]()


def ending(seed: int, files: Sequence[Path]) -> Ending:
    """Fly one motion of one vehicle, or all that it can fly, with the fault of this seed."""
    vehicle = calibrated(load_vehicle(files[seed // 7 % len(files)]))
    motions = motions_to_fly(("all",), vehicle).flown
    chosen = motions if seed % 2 else (random.Random(seed).choice(motions),)  # noqa: S311
    fault = drawn(seed, vehicle)
    pilot = GoalPilot(vehicle, Goal(chosen, PLATEAUS, seed))
    sizes = sizes_of(POOL, seed) | dict(fault.sizes)
    conditions = Conditions(sizes=sizes)
    # Identified too: an exception there would end a flight as well.
    flight = Lockstep(vehicle, pilot, seed, conditions=conditions, faults=fault.faults, session=Session(vehicle))
    fault.begin(flight.world)
    for _ in flight.run(LONGEST_S):
        pass
    how = REFUSED if pilot.output is None else pilot.output.aborted or DONE
    return Ending(vehicle.name, "all" if seed % 2 else chosen[0], fault, seed, how, flight.world.box.wall_hits)


def table(endings: Sequence[Ending]) -> str:
    """Markdown: for each fault how many flights, how they ended, and how many touched a wall."""
    lines = ["| fault | flights | done | ended by a guard | walls touched |", "|---|---|---|---|---|"]
    for name in dict.fromkeys(one.fault.name for one in endings):
        mine = [one for one in endings if one.fault.name == name]
        guards = Counter(one.how.partition(":")[0] for one in mine if one.how != DONE)
        counts = ", ".join(f"{guard} {count}" for guard, count in guards.most_common())
        touched = sum(one.wall_hits > 0 for one in mine)
        lines.append(f"| {name} | {len(mine)} | {len(mine) - sum(guards.values())} | {counts} | {touched} |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Fly, print the table, and name every flight that touched a wall unnoticed."""
    parser = argparse.ArgumentParser(description="endings of lock-step flights with faults drawn at random")
    parser.add_argument("--flights", type=int, default=100, metavar="N", help="how many")
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="seed of the first")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes")
    asked = parser.parse_args(arguments)
    files = sorted(default_vehicle().parent.glob("*.yaml"))
    seeds = range(asked.first, asked.first + asked.flights)
    endings: list[Ending] = []
    with ProcessPoolExecutor(asked.jobs) as pool:
        for one in pool.map(ending, seeds, [files] * len(seeds)):
            endings.append(one)
            flight = f"{one.vehicle} {one.motion}, {one.fault.name}: {one.how}"
            walls = f"; {one.wall_hits} wall contacts" if one.wall_hits else ""
            print(f"{len(endings)}/{len(seeds)} seed {one.seed}: {flight}{walls}", file=sys.stderr)
    print(table(endings))
    return int(any(one.unsafe for one in endings))


if __name__ == "__main__":
    sys.exit(main())
