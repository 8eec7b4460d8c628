"""The thruster fault detector in a motion with all couplings: how weak a thruster is, and when that is told."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from hindrax_control.allocation.effectiveness import effectiveness
from hindrax_control.allocation.thruster_fault_detector import (
    FaultDetectorKnobs,
    SuspectedFault,
    ThrusterFaultDetector,
)
from hindrax_control.prior_dynamics import prior_dynamics
from hindrax_core.events import stamp_from_s
from hindrax_core.signals import Navigation
from hindrax_core.vehicle import AXES, Vehicle

STEP_S = 0.02
SHARP = FaultDetectorKnobs(missing=0.3, surprise=1.0)


class CoupledVehicle:
    """Rigid body and added mass on the diagonal with Coriolis forces (Fossen 2011 eq. 6.43), drag, righting moments."""

    def __init__(self, vehicle: Vehicle) -> None:
        found = prior_dynamics(vehicle)
        self.freedoms = [found[axis] for axis in AXES]
        self.M = np.array([one.inertia for one in self.freedoms])
        self.B, self.lag_s = effectiveness(vehicle), np.array([one.lag_s for one in vehicle.thrusters])
        self.rates, self.thrust = np.zeros(6), np.zeros(len(vehicle.thrusters))
        self.askew: NDArray[np.float64] = np.zeros(6)
        """Wrench of ballast and trim that differ from the vehicle file."""
        self.roll = self.pitch = self.heading = self.time_s = 0.0

    def step(self, forces: NDArray[np.float64]) -> None:
        fine = 2
        for _ in range(fine):
            dt = STEP_S / fine
            self.thrust += (forces - self.thrust) * -np.expm1(-dt / self.lag_s)
            v, w = self.rates[:3], self.rates[3:]
            coriolis = np.concatenate([-np.cross(w, self.M[:3] * v), -np.cross(v, self.M[:3] * v)])
            down = np.array([
                -math.sin(self.pitch),
                math.cos(self.pitch) * math.sin(self.roll),
                math.cos(self.pitch) * math.cos(self.roll),
            ])  # fmt: skip
            lift, righting = self.freedoms[2].bias, self.freedoms[3].restoring
            statics = np.concatenate([-lift * down, righting * np.cross(down, (0.0, 0.0, -1.0))])
            drag = np.array([one.drag_force(float(x)) for one, x in zip(self.freedoms, self.rates, strict=True)])
            self.rates = self.rates + dt * (self.B @ self.thrust + coriolis + statics + self.askew - drag) / self.M
            p, q, r = self.rates[3:]
            sin, cos = math.sin(self.roll), math.cos(self.roll)
            across = q * sin + r * cos
            self.roll += dt * (p + across * math.tan(self.pitch))
            self.pitch += dt * (q * cos - r * sin)
            self.heading += dt * across / math.cos(self.pitch)
            self.time_s += dt

    def navigation(self) -> Navigation:
        u, v, w, p, q, r = self.rates.tolist()
        attitude = (self.roll, self.pitch, math.remainder(self.heading, math.tau))
        return Navigation(attitude, (p, q, r), (u, v, w), 0.9, 0.9, (0.0, 0.0), dvl_locked=True)


def wild(t: float) -> NDArray[np.float64]:
    """Surge, sway, heave and all turns at once, and every thruster at work."""
    return np.array([
        5.0 + 3.0 * math.sin(0.9 * t), 4.0 + 3.0 * math.sin(0.5 * t), 3.0 * math.cos(0.6 * t) - 3.0,
        -4.0 + 2.0 * math.sin(1.1 * t), 4.0 + 3.0 * math.sin(0.7 * t), -4.0 + 3.0 * math.cos(0.8 * t),
        -4.0 + 2.0 * math.sin(0.4 * t), 4.0 + 3.0 * math.cos(0.5 * t),
    ])  # fmt: skip


def flown(
    vehicle: Vehicle,
    weak: int,
    share: float,
    *,
    knobs: FaultDetectorKnobs = SHARP,
    seconds: float = 8.0,
    disturb: Callable[[float, Navigation], Navigation | None] = lambda _, state: state,
    stood_s: float = 0.0,
) -> Iterator[tuple[float, SuspectedFault]]:
    """Whom it suspects and when, while one thruster gives so much of its force; before, somebody held it askew."""
    rig, detector = CoupledVehicle(vehicle), ThrusterFaultDetector(vehicle, knobs)
    held, idle = replace(rig.navigation(), attitude_rad=(0.3, -0.2, 0.0)), [0.0] * len(vehicle.thrusters)
    for step in range(round(stood_s / STEP_S)):
        assert detector.step(held, stamp_from_s(step * STEP_S - stood_s - 1.0), idle) is None
    left = np.ones(len(vehicle.thrusters))
    left[weak] = share
    while rig.time_s < seconds:
        forces = wild(rig.time_s)
        state = disturb(rig.time_s, rig.navigation())
        found = detector.step(state, stamp_from_s(rig.time_s), forces.tolist()) if state else None
        if found is not None:
            yield rig.time_s, found
        rig.step(forces * left)


@pytest.mark.parametrize("weak", [0, 3, 5, 6])
def test_the_missing_share_is_reported_as_it_is(hindrax: Vehicle, weak: int) -> None:
    faults = [found for t, found in flown(hindrax, weak, 0.3, seconds=20.0) if t > 5.0]
    assert faults
    assert {one.name for one in faults} == {hindrax.thrusters[weak].name}
    assert [one.missing for one in faults] == pytest.approx([0.7] * len(faults), abs=0.02)
    assert faults[-1].sentence == f"{faults[-1].name}: {100 * faults[-1].missing:.0f} % of its thrust is missing"


def test_one_that_pushes_the_wrong_way_misses_more_than_all_of_its_thrust(hindrax: Vehicle) -> None:
    """Half of its thrust the wrong way round: one and a half times what was commanded is missing."""
    missing = [found.missing for _, found in flown(hindrax, 0, -0.5)]
    assert missing == pytest.approx([1.5] * len(missing), abs=0.02)


def test_thrust_that_is_weak_against_the_errors_of_the_model_may_be_missing_twice_over(hindrax: Vehicle) -> None:
    """One that pushes the wrong way leaves four variances of the model where it should give less than one."""
    weak = replace(SHARP, sigma=(9.0, 9.0, 9.0, 9.0, 9.0, 9.0), sigma_drag=0.0, sigma_thrust=0.0, memory_s=1.0)
    assert {found.name for _, found in flown(hindrax, 0, -1.0, knobs=weak)} == {hindrax.thrusters[0].name}


def test_nobody_is_suspected_before_the_evidence_has_held_as_long_as_it_must(hindrax: Vehicle) -> None:
    first_s = [
        next(t for t, _ in flown(hindrax, 0, 0.0, knobs=replace(SHARP, patience_s=patience_s)))
        for patience_s in (1.5, 3.0)
    ]
    assert first_s[0] > 1.5
    assert first_s[1] - first_s[0] == pytest.approx(1.5, abs=0.11)


def unlocked(t: float, state: Navigation) -> Navigation | None:
    return replace(state, dvl_locked=not 4.0 < t < 4.03)


def silent(t: float, state: Navigation) -> Navigation | None:
    return None if 4.0 < t < 4.3 else state


def unknown(t: float, state: Navigation) -> Navigation | None:
    return replace(state, velocity_mps=(math.nan, 0.0, 0.0)) if 4.0 < t < 4.03 else state


@pytest.mark.parametrize("disturb", [unlocked, silent, unknown])
def test_after_a_moment_without_a_velocity_it_begins_anew(
    hindrax: Vehicle, disturb: Callable[[float, Navigation], Navigation | None]
) -> None:
    found_s = [t for t, _ in flown(hindrax, 0, 0.0, disturb=disturb)]
    assert any(t < 4.0 for t in found_s)
    assert not any(4.0 < t < 4.0 + SHARP.patience_s for t in found_s)
    assert any(t > 4.0 + SHARP.patience_s for t in found_s)


def test_a_short_gap_is_bridged(hindrax: Vehicle) -> None:
    found_s = [t for t, _ in flown(hindrax, 0, 0.0, disturb=lambda t, one: None if 4.0 < t < 4.15 else one)]
    assert any(4.2 < t < 4.5 for t in found_s)


def test_of_a_vehicle_that_stands_no_trim_is_learned(hindrax: Vehicle) -> None:
    fresh = list(flown(hindrax, 5, 0.0))
    assert list(flown(hindrax, 5, 0.0, stood_s=20.0)) == fresh
    assert fresh


ALONE = 4
"""The vertical thruster that holds up a corner that is too heavy, and what holds the net buoyancy beside it."""


def held_up(vehicle: Vehicle, dies_s: float, *, seconds: float = 60.0) -> list[tuple[float, SuspectedFault]]:
    """Whom it suspects and when, of a vehicle at rest, askew, of which the holding thruster dies."""
    rig, detector = CoupledVehicle(vehicle), ThrusterFaultDetector(vehicle)
    forces = np.linalg.pinv(rig.B) @ np.array([0.0, 0.0, rig.freedoms[2].bias, 0.0, 0.0, 0.0])
    forces[ALONE] += 8.0
    rig.thrust = forces.copy()
    rig.askew = -8.0 * rig.B[:, ALONE]
    found = []
    while rig.time_s < seconds and abs(rig.pitch) < 1.0:
        reported = detector.step(rig.navigation(), stamp_from_s(rig.time_s), forces.tolist())
        if reported is not None:
            found.append((rig.time_s, reported))
        alive = np.ones(len(forces))
        alive[ALONE] = float(rig.time_s < dies_s)
        rig.step(forces * alive)
    return found


def test_a_thruster_that_holds_a_vehicle_upright_is_not_dead_because_nothing_moves(hindrax: Vehicle) -> None:
    """Seen in the world pool, the center of mass 5 mm aside: two healthy ones were no longer used, and it tumbled."""
    assert held_up(hindrax, math.inf) == []


@pytest.mark.parametrize("dies_s", [10.0, 40.0])
def test_of_a_vehicle_askew_the_one_that_dies_is_found(hindrax: Vehicle, dies_s: float) -> None:
    found = held_up(hindrax, dies_s)
    assert found
    assert {one.name for _, one in found} == {hindrax.thrusters[ALONE].name}
    assert min(t for t, _ in found) < dies_s + 8.0
