"""Commissionings of vehicles that are built otherwise than their files say, and whether every fault is named.

    python -m hindrax_tools.commissioning_draws --draws 100 --seed 1
    python -m hindrax_tools.commissioning_draws --draws 100 --seed 1 --keep draws.jsonl    # goes on where it was ended

Draws are evenly spread over the vehicles in the box and over the faults: each thruster reversed, dead, with the cable
of another, or in a ring of three; each sensor that measures along an axis turned by 90 and 180 degrees about each axis
that matters to it. Each flies in its own pool. A fault is named when what mends the file makes it the vehicle as it was
built, or, where no line of YAML can, when the part is called wrong; and when nothing else is. Where gravity shows that
the inertial sensor is turned, nothing is armed: the file is mended and commissioned again, as the command says. A
vehicle that lists too far is trimmed first.
"""

import argparse
import json
import random
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hindrax_analysis.terminal import print_table
from hindrax_control.commissioning.findings import TRIM, mended
from hindrax_control.commissioning.hypotheses import turn_of
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_sim.conditions.world_table import POOL
from hindrax_sim.faults.fault_registry import FAULTS, FaultSpec, as_built
from hindrax_sim.flights.commissioning_flight import CommissioningFlight, fly_commissioning

VEHICLES = ("hindrax", "bluerov2-heavy", "bluerov2", "lbv")
ALWAYS_S = 1e9
ROUNDS = 4
MOST_TILT_deg = 30.0
TRIMMED = "center_of_mass=0.001"
"""What a vehicle that is told to be trimmed still lists by."""


@dataclass(frozen=True, slots=True)
class Draw:
    """A vehicle, the faults of its building, and the seed of its pool."""

    vehicle: str
    kind: str
    faults: tuple[FaultSpec, ...]
    seed: int

    @property
    def text(self) -> str:
        """The faults, as `--fault` takes them."""
        return ", ".join(f"{one.name}:{one.devices[0]}" for one in self.faults)


@dataclass(frozen=True, slots=True)
class Judged:
    """A draw, whether its fault was named, and what was said."""

    draw: Draw
    named: bool
    tilt_deg: float
    seconds: float
    said: str


def cases(vehicle: Vehicle) -> Iterator[tuple[str, tuple[FaultSpec, ...]]]:
    """Kind and faults of everything that can be wrong with one vehicle, one at a time."""
    names = [one.name for one in vehicle.thrusters]
    for at, name in enumerate(names):
        second, third = names[(at + 1) % len(names)], names[(at + 2) % len(names)]
        yield "reversed", (_fault("thruster_reversed", name),)
        yield "dead", (_fault("thruster_fails", name),)
        yield "swapped", (_fault("thrusters_swapped", f"{name}-{second}"),)
        yield (
            "ring",
            (_fault("thrusters_swapped", f"{name}-{second}"), _fault("thrusters_swapped", f"{second}-{third}")),
        )
    for source in FAULTS["turned_yaw_90"].devices(vehicle):
        beam = source in vehicle.measuring("altitude") and source not in vehicle.measuring("velocity")
        # About its own axis, a beam measures the same.
        for axis in ("roll", "pitch") if beam else ("roll", "pitch", "yaw"):
            for angle in (90, 180):
                yield f"turned {angle}", (_fault(f"turned_{axis}_{angle}", source),)


def _fault(name: str, target: str) -> FaultSpec:
    return FaultSpec(name, (target,), 0.0, ALWAYS_S)


def vehicle_of(name: str) -> Vehicle:
    """A vehicle file in the box."""
    return load_vehicle(Path(str(files("hindrax_bringup"))).parent / "vehicles" / f"{name}.yaml")


def draws(count: int, seed: int, vehicles: Sequence[str] = VEHICLES) -> list[Draw]:
    """So many draws, in turn of the vehicles and of the kinds of fault."""
    rng = random.Random(seed)  # noqa: S311  # no secret
    kinds: dict[str, dict[str, list[tuple[FaultSpec, ...]]]] = {}
    for name in vehicles:
        for kind, faults in cases(vehicle_of(name)):
            kinds.setdefault(name, {}).setdefault(kind, []).append(faults)
    made = []
    for number in range(count):
        name = vehicles[number % len(vehicles)]
        own = kinds[name]
        kind = list(own)[number // len(vehicles) % len(own)]
        made.append(Draw(name, kind, rng.choice(own[kind]), seed * 1000 + number))
    return made


def every(seed: int, vehicles: Sequence[str] = VEHICLES) -> list[Draw]:
    """Every fault of these vehicles once, each in its own pool."""
    found = [(name, kind, faults) for name in vehicles for kind, faults in cases(vehicle_of(name))]
    return [Draw(*one, seed * 1000 + number) for number, one in enumerate(found)]


def kept(made: Sequence[Draw], file: Path | None, world: str, fly: Callable[[Draw, str], Judged]) -> Iterator[Judged]:
    """Verdict on every draw; one that stands in the file is not flown again, and others are appended to it."""
    known = _read(file, world) if file and file.exists() else {}
    for draw in made:
        if (line := known.get(_name(draw, world))) is not None:
            yield Judged(draw, line["named"], line["tilt_deg"], line["seconds"], line["said"])
            continue
        one = fly(draw, world)
        if file:
            line = _name(draw, world)._asdict() | {
                "named": one.named,
                "tilt_deg": one.tilt_deg,
                "seconds": one.seconds,
                "said": one.said,
            }
            with file.open("a", encoding="utf-8") as stream:
                stream.write(f"{json.dumps(line)}\n")
        yield one


class Name(NamedTuple):
    """What makes a draw the same."""

    vehicle: str
    text: str
    seed: int
    world: str


def _name(draw: Draw, world: str) -> Name:
    return Name(draw.vehicle, draw.text, draw.seed, world)


def _read(file: Path, world: str) -> dict[Name, dict[str, Any]]:
    """Lines of a file by their draws; the last may be half of one, where its run was ended."""
    text = file.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        file.write_text(whole, encoding="utf-8")
    lines = [json.loads(line) for line in whole.splitlines()]
    return {Name(*(line[key] for key in Name._fields)): line for line in lines if line["world"] == world}


def judge(draw: Draw, world: str = POOL) -> Judged:
    """Commission, mend and commission again until there is nothing to mend, as an operator would."""
    file = vehicle_of(draw.vehicle)
    turns_and_cables = tuple(one for one in draw.faults if one.name != "thruster_fails")
    broken = tuple(one for one in draw.faults if one.name == "thruster_fails")
    built = as_built(file, turns_and_cables)
    claimed, tilt_deg, seconds, said = file, 0.0, 0.0, []
    for _ in range(ROUNDS):
        flight = fly_commissioning(claimed, draw.seed, world, broken, built=built)
        tilt_deg, seconds = max(tilt_deg, flight.tilt_deg), seconds + flight.seconds
        said += [f"{row.claim}: {row.found}" for row in flight.findings.wrong]
        lists = any(row.claim == TRIM for row in flight.findings.wrong)
        if lists and TRIMMED not in world:
            world = f"{world},{TRIMMED}"
        elif not flight.findings.mends:
            break
        claimed = mended(claimed, flight.findings.mends)
    named = _is_built(claimed, built, draw, flight) and _nothing_else(draw, flight)
    return Judged(draw, named, tilt_deg, seconds, "; ".join(said) or f"nothing wrong; {flight.findings.ended}")


def _is_built(claimed: Vehicle, built: Vehicle, draw: Draw, flight: CommissioningFlight) -> bool:
    """Whether the mended file drives and reads the vehicle as it was built, but for what no line of YAML mends."""
    by_channel = [
        {one.channel: (one.position_m, one.direction, one.reversed) for one in vehicle.thrusters}
        for vehicle in (claimed, built)
    ]
    blamed = {row.claim for row in flight.findings.wrong}
    turned = all(
        np.allclose(turn_of(claimed.sensors[name].rotation_deg), turn_of(mount.rotation_deg), atol=1e-6)
        or f"{name} mount" in blamed
        for name, mount in built.sensors.items()
    )
    dead = {one.devices[0] for one in draw.faults if one.name == "thruster_fails"}
    return by_channel[0] == by_channel[1] and turned and dead <= blamed


def _nothing_else(draw: Draw, flight: CommissioningFlight) -> bool:
    """Whether nothing is called wrong at the end but what no line of YAML mends."""
    targets = {one.devices[0] for one in draw.faults}
    return all(row.claim in targets or row.claim.removesuffix(" mount") in targets for row in flight.findings.wrong)


def show(judged: Sequence[Judged]) -> None:
    """Print every draw, then the count by kind."""
    rows = [
        (one.draw.vehicle, one.draw.text, one.draw.seed, "named" if one.named else "MISSED", f"{one.tilt_deg:.0f}",
         f"{one.seconds:.0f}", one.said[:110])
        for one in judged
    ]  # fmt: skip
    print_table("Commissionings", ["vehicle", "fault"], ["seed", "verdict", "tilt [deg]", "time [s]", "said"], rows)
    kinds = sorted({one.draw.kind for one in judged})
    of_kind = [[one for one in judged if one.draw.kind == kind] for kind in kinds]
    counts = [
        (kind, f"{sum(one.named for one in mine)} of {len(mine)}", f"{max(one.tilt_deg for one in mine):.0f}")
        for kind, mine in zip(kinds, of_kind, strict=True)
    ]
    total = (f"{sum(one.named for one in judged)} of {len(judged)}", f"{max(one.tilt_deg for one in judged):.0f}")
    print_table("Named", ["fault"], ["named", "largest tilt [deg]"], [*counts, ("all", *total)])


def main() -> int:
    """Print the table; 1 when less than 95 of 100 are named or one tilts too far."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--draws", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--world", default=POOL)
    parser.add_argument("--vehicle", nargs="+", default=VEHICLES, choices=VEHICLES)
    parser.add_argument("--keep", type=Path, metavar="FILE", help="verdicts, by line; those in it are not flown again")
    parser.add_argument("--every", action="store_true", help="every fault of every vehicle once, instead of draws")
    arguments = parser.parse_args()
    made = draws(arguments.draws, arguments.seed, arguments.vehicle)
    if arguments.every:
        made = every(arguments.seed, arguments.vehicle)
    judged = []
    for one in kept(made, arguments.keep, arguments.world, judge):
        draw = one.draw
        judged.append(one)
        verdict = "named " if one.named else "MISSED"
        print(f"{verdict} {draw.vehicle} {draw.text} {draw.seed} {one.tilt_deg:.0f} deg: {one.said}", file=sys.stderr)
    show(judged)
    named = sum(one.named for one in judged) >= 0.95 * len(judged)
    return 0 if named and all(one.tilt_deg < MOST_TILT_deg for one in judged) else 1


if __name__ == "__main__":
    sys.exit(main())
