"""Whole flights in lock-step, judged by the truth: what is held is held, and no mishap drives the vehicle into a wall.

Short flights by default, of one level each; HINDRAX_THOROUGH=1 flies what a pool test flies, and more often.
"""

import math
import os
import random
import re
from dataclasses import dataclass, field

import pytest

from hindrax_bringup.vehicles import default_vehicle
from hindrax_control.maneuvers import Goal
from hindrax_control.pilot import PilotKnobs
from hindrax_control.plan import PlanKnobs
from hindrax_core.state import Navigation, Phase
from hindrax_core.vehicle import load_vehicle
from hindrax_sim.faults import parse_fault
from hindrax_sim.goal_pilot import GoalPilot
from hindrax_sim.lockstep import Lockstep
from hindrax_sim.world import World

THOROUGH = bool(os.environ.get("HINDRAX_THOROUGH"))
VEHICLE = load_vehicle(default_vehicle())
SHORT = PlanKnobs(
    levels=1, turning_levels=1, repeats=(1,) * 6, surge_mps=(0.3, 0.4), sway_mps=(0.25, 0.3), plateau_s=4.0
)
KNOBS = PilotKnobs() if THOROUGH else PilotKnobs(plan=SHORT)
ALTITUDE_m = PlanKnobs().altitude_m
HELD_m, HELD_deg = 0.10, 5.0
SEEDS = range(1, 11) if THOROUGH else range(1, 4)


@dataclass
class Flown:
    """What the truth says of a flight: its length, and the worst errors on the plateaus of each motion."""

    pilot: GoalPilot
    world: World
    altitude_m: dict[str, float] = field(default_factory=dict)
    heading_deg: dict[str, float] = field(default_factory=dict)
    seconds: float = 0.0

    @property
    def aborted(self) -> str:
        assert self.pilot.output is not None
        return self.pilot.output.aborted


def heading_deg(world: World) -> float:
    w, x, y, z = world.plant.quaternion
    return math.degrees(math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


def fly(motions: tuple[str, ...], *faults: str, seed: int = 1) -> Flown:
    pilot = GoalPilot(VEHICLE, Goal(motions), KNOBS)
    step = Lockstep(VEHICLE, pilot, seed, faults=[parse_fault(fault) for fault in faults])
    flown, phase = Flown(pilot, step.world), Phase("", "")
    for event in step.run(3000.0):
        if isinstance(event.reading, Phase):
            phase = event.reading
        elif isinstance(event.reading, Navigation) and phase.phase == "plateau":
            motion, world = phase.motion, step.world
            off_m = abs(world.altitude_m - ALTITUDE_m)
            off_deg = abs(math.remainder(heading_deg(world), 90.0))
            flown.altitude_m[motion] = max(flown.altitude_m.get(motion, 0.0), off_m)
            flown.heading_deg[motion] = max(flown.heading_deg.get(motion, 0.0), off_deg)
    assert step.onboard.order.finished
    assert (step.world.box.wall_hits, step.world.box.floor_hits) == (0, 0)
    flown.seconds = step.elapsed_s
    return flown


def test_what_is_not_flown_is_held_in_all_seven_motions() -> None:
    flown = fly(("surge", "sway", "heave", "roll", "pitch", "yaw"))
    assert flown.aborted == ""
    assert set(flown.altitude_m) == {"surge", "sway", "heave_down", "heave_up", "roll", "pitch", "yaw"}
    held_m = {motion: off for motion, off in flown.altitude_m.items() if not motion.startswith("heave")}
    held_deg = {motion: off for motion, off in flown.heading_deg.items() if motion != "yaw"}
    assert max(held_m.values()) < HELD_m, held_m
    assert max(held_deg.values()) < HELD_deg, held_deg


def ended_well(flown: Flown) -> bool:
    """Flown to the end, or ended by a guard that gives its name."""
    return flown.aborted == "" or re.match(r"[a-z_]+: \S", flown.aborted) is not None


@pytest.mark.parametrize("seed", SEEDS)
def test_a_thruster_that_fails_at_any_time_is_found_or_a_guard_ends_the_flight(seed: int) -> None:
    at_s = random.Random(seed).uniform(10.0, 40.0)
    flown = fly(("surge", "sway"), f"thruster_fails:T3@{at_s:.2f}+9999", seed=seed)
    assert flown.seconds > at_s
    assert ended_well(flown), flown.aborted
    assert flown.aborted or any("T3" in sentence for sentence in flown.pilot.suspected), (
        f"T3 from {at_s:.1f} s unnoticed"
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_three_seconds_without_bottom_lock_are_flown_through(seed: int) -> None:
    at_s = random.Random(seed).uniform(12.0, 26.0)
    flown = fly(("surge",), f"lock_lost@{at_s:.2f}+3", seed=seed)
    assert flown.aborted == ""
    assert flown.seconds > at_s + 3.0
    assert flown.altitude_m["surge"] < HELD_m


@pytest.mark.parametrize("seed", SEEDS)
def test_a_current_that_begins_to_run_is_held_against(seed: int) -> None:
    at_s = random.Random(seed).uniform(10.0, 28.0)
    flown = fly(("surge",), f"current@{at_s:.2f}+9999", seed=seed)
    assert flown.seconds > at_s
    assert ended_well(flown), flown.aborted
