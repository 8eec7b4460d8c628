"""Whole flights in lock-step, judged by the truth: what is held is held, and no mishap drives the vehicle into a wall.

Short flights by default, of one level each; HINDRAX_THOROUGH=1 flies what a pool test flies, and more often.
"""

import math
import random
import re
from dataclasses import dataclass, field, replace

import pytest
from vehicles_beside import vehicle_beside

from hindrax_control.allocation.allocator import Allocator
from hindrax_control.maneuver.goal import ENDINGS, Goal, motions_to_fly
from hindrax_control.maneuver.maneuver import Maneuver
from hindrax_control.maneuver.plan import PlanKnobs, Planner
from hindrax_control.pilot import PilotKnobs
from hindrax_control.pool_bounds import PoolBounds
from hindrax_core.events import after
from hindrax_core.signals import ZERO6, Navigation, Phase
from hindrax_core.testing import THOROUGH
from hindrax_core.vehicle import AXES, Vehicle
from hindrax_sim.faults.fault_registry import parse_fault
from hindrax_sim.flights.lockstep import Lockstep
from hindrax_sim.flights.pool_flight import GoalPilot
from hindrax_sim.world import World

pytestmark = pytest.mark.long
VEHICLE = vehicle_beside()
SHORT = PlanKnobs(
    levels=1, turning_levels=1, repeats=(1,) * 6, surge_mps=(0.3, 0.4), sway_mps=(0.25, 0.3), plateau_s=4.0
)
KNOBS = PilotKnobs() if THOROUGH else PilotKnobs(plan=SHORT)
ALTITUDE_m = PlanKnobs().altitude_m
HELD_m, HELD_deg = 0.10, 5.0
SEEDS = range(1, 11) if THOROUGH else range(1, 3)


@dataclass
class Flown:
    """What the truth says of a flight: its length, and the worst errors on the plateaus of each motion.

    `told_s`: every remaining time that was told, with the time at which it was.
    """

    pilot: GoalPilot
    world: World
    altitude_m: dict[str, float] = field(default_factory=dict)
    heading_deg: dict[str, float] = field(default_factory=dict)
    seconds: float = 0.0
    told_s: list[tuple[float, float]] = field(default_factory=list)

    @property
    def aborted(self) -> str:
        assert self.pilot.output is not None
        return self.pilot.output.aborted


def heading_deg(world: World) -> float:
    w, x, y, z = world.plant.quaternion
    return math.degrees(math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


def fly(motions: tuple[str, ...], *faults: str, seed: int = 1, vehicle: Vehicle = VEHICLE) -> Flown:
    pilot = GoalPilot(vehicle, Goal(motions), KNOBS)
    step = Lockstep(vehicle, pilot, seed, faults=[parse_fault(fault) for fault in faults])
    flown, phase = Flown(pilot, step.world), Phase("", "")
    for event in step.run(3000.0):
        if isinstance(event.reading, Phase):
            phase = event.reading
        if not isinstance(event.reading, Navigation) or pilot.output is None:
            continue
        flown.told_s.append((step.elapsed_s, pilot.output.remaining_s))
        if phase.phase == "plateau":
            motion, world = phase.motion, step.world
            off_m = abs(world.vehicle.pool.depth_m - world.depth_m - ALTITUDE_m)
            off_deg = abs(math.remainder(heading_deg(world), 90.0))
            flown.altitude_m[motion] = max(flown.altitude_m.get(motion, 0.0), off_m)
            flown.heading_deg[motion] = max(flown.heading_deg.get(motion, 0.0), off_deg)
    assert step.onboard.order.finished
    assert (step.world.box.wall_hits, step.world.box.floor_hits) == (0, 0)
    flown.seconds = step.elapsed_s
    return flown


@pytest.fixture(scope="module")
def whole() -> Flown:
    """All seven motions in one go."""
    return fly(("surge", "sway", "heave", "roll", "pitch", "yaw"))


def test_what_is_not_flown_is_held_in_all_seven_motions(whole: Flown) -> None:
    assert whole.aborted == ""
    assert set(whole.altitude_m) == {"surge", "sway", "heave_down", "heave_up", "roll", "pitch", "yaw"}
    held_m = {motion: off for motion, off in whole.altitude_m.items() if not motion.startswith("heave")}
    held_deg = {motion: off for motion, off in whole.heading_deg.items() if motion != "yaw"}
    assert max(held_m.values()) < HELD_m, held_m
    assert max(held_deg.values()) < HELD_deg, held_deg


def test_the_remaining_time_that_is_reported_is_that_which_remains(whole: Flown) -> None:
    """Within a fifth; near the end within three seconds, which a settling takes longer or shorter."""
    for at_s, told_s in whole.told_s:
        true_s = whole.seconds - at_s
        assert abs(told_s - true_s) <= max(0.2 * true_s, 3.0), f"{told_s:.1f} s told, {true_s:.1f} s true"


def six_thrusters() -> Vehicle:
    """The Hindrax with level thrusters in the plane of its center of mass, and two vertical ones amidships."""
    x_m, _, z_m = VEHICLE.center_of_mass_m
    level = [replace(one, position_m=(*one.position_m[:2], z_m)) for one in VEHICLE.thrusters[:4]]
    vertical = [replace(one, position_m=(x_m, one.position_m[1], z_m)) for one in VEHICLE.thrusters[4:6]]
    return replace(VEHICLE, thrusters=(*level, *vertical))


def test_six_thrusters_fly_all_that_they_serve_to_the_end() -> None:
    six = six_thrusters()
    found = motions_to_fly(["all"], six)
    assert found.left_out == (("pitch", "no thruster serves it"),)
    flown = fly(found.flown, vehicle=six)
    assert flown.aborted == ""
    assert {"surge", "sway", "heave_down", "heave_up", "roll", "yaw"} == set(flown.altitude_m)


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


@pytest.mark.parametrize("motion", AXES)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_cancel_at_any_moment_ends_neutral_or_in_the_hold_as_asked(motion: str, seed: int) -> None:
    """Two seeds of one motion are its two endings."""
    ending = ENDINGS[(AXES.index(motion) + seed) % 2]
    goal = Goal((motion,), on_cancel=ending)
    planner = Planner(VEHICLE, Allocator(VEHICLE), KNOBS.plan)
    planned = Maneuver(planner, goal, PoolBounds(VEHICLE, 0.0))
    at_s = random.Random(f"{motion} {seed}").uniform(0.0, 0.8 * planned.seconds)
    pilot = GoalPilot(VEHICLE, goal, KNOBS, cancel_at_s=at_s)
    step = Lockstep(VEHICLE, pilot, seed)
    states = [one for one in step.run(planned.seconds + 60.0) if isinstance(one.reading, Navigation)]
    assert pilot.output is not None
    assert (pilot.output.phase.phase, pilot.output.aborted) == ("aborted", "cancelled: by the operator")
    assert (step.world.box.wall_hits, step.world.box.floor_hits) == (0, 0)
    assert math.hypot(*step.world.plant.velocity_over_ground) < 0.15
    last = states[-1]
    flight = pilot.pilot.step(last.reading, after(last.stamp, 0.02), armed=True)
    engaged = {hold.axis for hold in flight.holds if hold.engaged}
    assert engaged == (set() if ending == "neutral" else {"heading", "roll", "pitch", "depth"})
    assert (flight.wrench == ZERO6) == (ending == "neutral")
