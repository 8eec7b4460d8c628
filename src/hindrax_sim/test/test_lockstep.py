"""The whole vehicle without ROS: both fidelities, determinism, faults, and what the identification finds."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from hindrax_control.maneuver.goal import Goal
from hindrax_control.maneuver.plan import PlanKnobs
from hindrax_control.pilot import PilotKnobs
from hindrax_core.errors import UsageError
from hindrax_core.events import to_s
from hindrax_core.readings import Vec6
from hindrax_core.signals import ZERO6, Allocation, Estimate, Navigation, Phase
from hindrax_core.vehicle import AXES, Mount, Vehicle, load_vehicle
from hindrax_ident.assess.results import MotionResult as Result
from hindrax_ident.assess.uncertainty_budget import Budget
from hindrax_ident.online.session import Session
from hindrax_sim.faults.fault_registry import parse_fault
from hindrax_sim.flights.lockstep import Lockstep, LockstepCommand
from hindrax_sim.flights.lockstep_rigs import BytesRig, ReadingsRig
from hindrax_sim.flights.pool_flight import GoalPilot
from hindrax_sim.world import Conditions

VEHICLE = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml")


class Idle:
    """Asks for a wrench and lets the rest be."""

    def __init__(self, wrench: Vec6 = ZERO6, armed: bool = True) -> None:
        self.order = LockstepCommand(wrench, Phase("", ""), armed)

    def step(self, navigation: object, became: object, *, armed: bool) -> LockstepCommand:
        del navigation, became, armed
        return self.order


def events(step: Lockstep, seconds: float, kind: type[Navigation | Allocation]) -> list[Any]:
    return [one for one in step.run(seconds) if isinstance(one.reading, kind)]


@pytest.mark.parametrize("by_bytes", [False, True])
def test_the_navigator_knows_the_truth_by_readings_and_by_bytes(by_bytes: bool) -> None:
    step = Lockstep(VEHICLE, Idle(armed=False), 5, by_bytes=by_bytes)
    found = events(step, 8.0, Navigation)
    state, world = found[-1].reading, step.world
    assert state.depth_m == pytest.approx(world.depth_m, abs=0.01)
    assert state.altitude_m == pytest.approx(world.vehicle.pool.depth_m - world.depth_m, abs=0.02)
    assert state.velocity_mps == pytest.approx((0.0, 0.0, 0.0), abs=0.03)
    assert state.attitude_rad == pytest.approx((0.0, 0.0, 0.0), abs=math.radians(6.0))
    assert state.dvl_locked
    gaps = [(b.stamp - a.stamp) * 1e-9 for a, b in pairwise(found)]
    assert max(gaps) < 0.03


@pytest.mark.parametrize("by_bytes", [False, True])
def test_nothing_turns_before_the_output_guard_is_armed(by_bytes: bool) -> None:
    step = Lockstep(VEHICLE, Idle((10.0, 0.0, 0.0, 0.0, 0.0, 0.0)), 5, by_bytes=by_bytes)
    early = events(step, 6.0, Allocation)
    assert all(one.reading.achieved == ZERO6 for one in early)
    assert step.world.plant.targets_N == (0.0,) * 8
    late = events(step, 8.0, Allocation)
    assert late[-1].reading.achieved[0] == pytest.approx(10.0, abs=1.0)
    assert sum(step.world.plant.targets_N[:2]) > 8.0


def test_disarming_stops_everything() -> None:
    pilot = Idle((10.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    step = Lockstep(VEHICLE, pilot, 5)
    list(step.run(12.0))
    assert any(step.world.plant.targets_N)
    pilot.order = LockstepCommand()
    list(step.run(0.2))
    assert not any(step.world.plant.targets_N)
    assert not step.onboard.armed


def test_the_same_seed_gives_the_same_run_to_the_last_bit() -> None:
    runs = []
    for seed in (1, 1, 2):
        step = Lockstep(VEHICLE, GoalPilot(VEHICLE, Goal(("yaw",))), seed)
        runs.append(list(map(repr, step.run(20.0))))
    assert runs[0] == runs[1]
    assert runs[0] != runs[2]


def test_faults_of_wires_are_refused_where_there_are_none() -> None:
    with pytest.raises(UsageError, match=r"fault garbage: is one of wires"):
        Lockstep(VEHICLE, Idle(), faults=[parse_fault("garbage:dvl75")])


def test_faults_of_the_world_come_and_go() -> None:
    step = Lockstep(VEHICLE, Idle(armed=False), faults=[parse_fault("lock_lost@4+2")])
    locked = {round((one.stamp - 10**10) * 1e-9, 1): one.reading.dvl_locked for one in events(step, 9.0, Navigation)}
    assert locked[3.5]
    assert not locked[5.5]
    assert locked[8.0]


def test_garbage_on_a_wire_is_survived() -> None:
    step = Lockstep(VEHICLE, Idle(armed=False), 2, by_bytes=True, faults=[parse_fault("garbage:ping1d@3+2")])
    state = events(step, 8.0, Navigation)[-1].reading
    assert state.altitude_m == pytest.approx(step.world.vehicle.pool.depth_m - step.world.depth_m, abs=0.03)
    assert state.ages_s["ping1d"] < 0.3


def test_both_rigs_say_the_same_kinds_of_things() -> None:
    def kinds(rig: ReadingsRig | BytesRig) -> set[Any]:
        end = rig.world.stamp + 4_000_000_000
        seen = set()
        while rig.world.stamp < end:
            seen |= {(name, type(one.reading).__name__) for name, one in rig.advance()}
        # What the navigator has no use for comes from emulators alone.
        return {one for one in seen if one[1] not in {"DeviceText", "Position", "SonarHealth"}}

    assert kinds(ReadingsRig(VEHICLE, 1)) == kinds(BytesRig(VEHICLE, 1))


def test_a_surge_run_finds_the_drag_and_never_touches_a_wall() -> None:
    few_levels = PilotKnobs(plan=PlanKnobs(levels=3, surge_mps=(0.2, 0.4), plateau_s=10.0))
    session = Session(VEHICLE)
    step = Lockstep(VEHICLE, GoalPilot(VEHICLE, Goal(("surge",)), few_levels), 1, session=session)
    estimates, errors = 0, []
    for one in step.run(400.0):
        estimates += isinstance(one.reading, Estimate)
        if isinstance(one.reading, Navigation):
            errors.append(abs(one.reading.depth_m - step.world.depth_m))
    surge = session.finalize().results.motions["surge"]
    hydro = VEHICLE.hydrodynamics
    assert hydro is not None
    drag = hydro.surge
    for speed in (0.2, 0.3, 0.4):
        truth = (drag.k_q * speed + drag.k_l) * speed
        assert surge.drag_force(speed)[0] == pytest.approx(truth, rel=0.03)
    for name, truth in (("k_q", drag.k_q), ("k_l", drag.k_l), ("added_mass", hydro.added_mass[0])):
        assert abs(surge.coefficients[name].value - truth) < 4.0 * surge.coefficients[name].std
    assert step.world.box.wall_hits == 0
    assert step.world.box.floor_hits == 0
    assert step.onboard.order.finished
    assert estimates > 300
    assert max(errors[500:]) < 0.05


def test_a_measured_battery_takes_its_sag_out_of_the_drag_and_out_of_the_budget() -> None:
    def surge(vehicle: Vehicle) -> tuple[Result, Budget]:
        few_levels = PilotKnobs(plan=PlanKnobs(levels=2, surge_mps=(0.3, 0.4), plateau_s=8.0))
        sagging = Conditions(sizes={"battery_sag": 0.5})
        pilot, session = GoalPilot(vehicle, Goal(("surge",)), few_levels), Session(vehicle, every_s=math.inf)
        for _ in Lockstep(vehicle, pilot, 1, conditions=sagging, session=session).run(400.0):
            pass
        outcome = session.finalize()
        return outcome.results.motions["surge"], outcome.assessments[0].budget

    battery = Mount("ina226", "/dev/i2c-1", address=0x41)
    measured, known = surge(replace(VEHICLE, sensors={**VEHICLE.sensors, "ina226": battery}))
    assumed, doubted = surge(VEHICLE)
    hydro = VEHICLE.hydrodynamics
    assert hydro is not None
    truth = (hydro.surge.k_q * 0.4 + hydro.surge.k_l) * 0.4
    assert abs(measured.drag_force(0.4)[0] / truth - 1.0) < 0.02
    assert assumed.drag_force(0.4)[0] / truth - 1.0 > 0.03, "the sag is there"
    # What is left of the rows afterwards depends on the flight: where the supply is not measured, legs may show it.
    for name in ("sag over the run", "sag under load"):
        assert 0.0 < known.prior(name) < 0.25 * doubted.prior(name)


def test_a_failed_thruster_is_ordered_to_the_allocator() -> None:
    step = Lockstep(VEHICLE, Idle((5.0, 0.0, 0.0, 0.0, 0.0, 0.0)), faults=[parse_fault("thruster_fails:T3@0+60")])
    step.onboard.cycle.disable(frozenset({"T3"}))
    last = events(step, 12.0, Allocation)[-1].reading
    assert last.forces_N[2] == 0.0
    assert last.disabled == ("T3",)
    assert step.world.plant.targets_N[2] == 0.0


def test_a_vehicle_without_sensors_states_nothing_and_time_still_passes() -> None:
    bare = replace(VEHICLE, sensors={})
    step = Lockstep(bare, Idle(), by_bytes=True)
    assert list(step.run(1.0)) == []
    assert step.elapsed_s == pytest.approx(1.0, abs=0.03)


def test_thrust_through_an_ardusub_has_the_time_at_which_it_was_made(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the link did: the forces of the mock's own thrusters change when the stack says they do."""
    vehicle = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup/vehicles/bluerov2-heavy.yaml")
    pilot = Idle()
    step = Lockstep(vehicle, pilot, 5, by_bytes=True)
    list(step.run(9.0))
    said: list[tuple[float, bool]] = []
    true: list[tuple[float, bool]] = []
    drive = step.world.drive

    def noted(pulses_us: Sequence[float]) -> None:
        drive(pulses_us)
        true.append((to_s(step.world.stamp), step.world.plant.targets_N[0] > 0.0))

    monkeypatch.setattr(step.world, "drive", noted)
    for turn in range(20):
        pilot.order = LockstepCommand(((1.0 if turn % 2 else -1.0) * 10.0, *ZERO6[1:]), Phase("", ""), armed=True)
        said += [(to_s(one.stamp), one.reading.forces_N[0] > 0.0) for one in events(step, 0.3, Allocation)]

    def changes(seen: list[tuple[float, bool]]) -> list[float]:
        return [at for (_, before), (at, now) in pairwise(seen) if before is not now]

    late_s = [at - truth for at, truth in zip(changes(said), changes(true), strict=True)]
    assert len(late_s) >= 19
    # It is sampled every 20 ms.
    assert 0.0 < sum(late_s) / len(late_s) < 0.02
    assert max(map(abs, late_s)) < 0.03


def test_a_vehicle_with_far_less_drag_than_its_file_says_is_flown_to_the_end() -> None:
    """Neither stopped by its speed, nor taken for one that no thruster moves; a file of 0.4 m/s leaves little room."""
    vehicle = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup/vehicles/bluerov2.yaml")
    hull = vehicle.hydrodynamics
    assert hull is not None
    both = {axis: hull.drag(axis) for axis in AXES}
    less: dict[str, Any] = {axis: replace(one, k_q=0.4 * one.k_q, k_l=0.4 * one.k_l) for axis, one in both.items()}
    pilot = GoalPilot(vehicle, Goal(("sway",)))
    step = Lockstep(vehicle, pilot, 1, built=replace(vehicle, hydrodynamics=replace(hull, **less)))
    list(step.run(400.0))
    assert pilot.output is not None
    assert pilot.output.done
    assert not pilot.output.aborted
    assert not pilot.suspected


def test_by_bytes_an_ardusub_arms_pushes_and_says_who_has_taken_over() -> None:
    vehicle = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup/vehicles/bluerov2-heavy.yaml")
    pilot = Idle((10.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    step = Lockstep(vehicle, pilot, 5, by_bytes=True, faults=[parse_fault("second_station:thrusters@14+9")])
    flown = events(step, 11.0, Allocation)
    assert flown[-1].reading.achieved[0] == pytest.approx(10.0, abs=2.0)
    assert not step.onboard.output_fault
    list(step.run(4.0))
    assert step.onboard.output_fault.startswith("another party has taken over: stick")
    assert not step.onboard.armed
