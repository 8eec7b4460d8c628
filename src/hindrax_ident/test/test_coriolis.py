"""Motions on other axes: the forces they make, and what becomes of an estimate that knows of them."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_core.events import Stamped, stamp_from_s
from hindrax_core.readings import Vec6
from hindrax_core.signals import NAN, Velocity
from hindrax_core.vehicle import Vehicle
from hindrax_ident.assess.assessment import DraftFit
from hindrax_ident.assess.results import truth_of
from hindrax_ident.model.coriolis import Masses, VelocityHistory, coriolis, coriolis_errors
from hindrax_ident.model.motion_model import MOTIONS, model_of
from hindrax_ident.model.thrust_lag import LaggedThrust
from hindrax_ident.online.session import Session
from hindrax_ident.testing.synthetic_runs import GYRO, back_and_forth, events, fly

six = st.tuples(*[st.floats(-3.0, 3.0)] * 6)
masses_six = st.tuples(*[st.floats(0.1, 60.0)] * 6)


@given(masses_six, six)
def test_they_take_and_give_no_power(masses: tuple[float, ...], nu: tuple[float, ...]) -> None:
    forces = [coriolis(axis, masses, nu) for axis in range(6)]
    powers = [force * x for force, x in zip(forces, nu, strict=True)]
    assert sum(powers) == pytest.approx(0.0, abs=1e-9 * (1.0 + sum(map(abs, powers))))


@pytest.mark.parametrize(
    ("axis", "nu", "wanted"),
    [
        (0, (0, 0.5, 0, 0, 0, 2.0), 20.0),  # turning to starboard while slipping to starboard: thrown ahead
        (1, (0.5, 0, 0, 0, 0, 2.0), -10.0),  # turning to starboard while going ahead: thrown to port
        (2, (0.5, 0, 0, 0, 2.0, 0), 10.0),  # nose rising while going ahead: thrown down
        (3, (0, 0.5, 2.0, 0, 0, 0), -10.0),  # Munk: a body that is lighter along y turns broadside to its motion
        (4, (0.5, 0, 2.0, 0, 0, 0), 20.0),
        (5, (0.5, 2.0, 0, 0, 0, 0), -10.0),
        (5, (0, 0, 0, 2.0, 3.0, 0), -6.0),
    ],
)
def test_each_term_has_its_sign(axis: int, nu: Vec6, wanted: float) -> None:
    assert coriolis(axis, (10.0, 20.0, 30.0, 1.0, 2.0, 4.0), nu) == pytest.approx(wanted)


def test_a_mass_nobody_knows_leaves_a_doubt() -> None:
    masses = Masses((10.0, 20.0, 30.0, 1.0, 2.0, 4.0), (0.1, 20.0, 6.0, 0.0, 0.0, 0.0))
    nu = [np.array([value]) for value in (0.5, 0.1, 2.0, 0.0, 0.0, 0.0)]
    assert np.array(coriolis_errors(4, masses, nu)) == pytest.approx([6.0])
    assert np.array(coriolis_errors(3, masses, nu)).ravel() == pytest.approx([20.0 * 0.2, -6.0 * 0.2])
    assert coriolis_errors(0, masses, nu) == []  # nothing turns


def test_an_old_velocity_is_not_used() -> None:
    motions = VelocityHistory(1.0)
    assert motions.at(0.0) == (0.0,) * 6
    assert motions.update(0.0, (0.3, NAN, NAN, NAN, NAN, NAN))
    assert motions.update(0.8, (NAN, NAN, 0.1, NAN, NAN, NAN))
    assert not motions.update(0.9, (NAN,) * 6)
    assert motions.at(1.0) == (0.3, 0.0, 0.1, 0.0, 0.0, 0.0)
    assert motions.at(1.1) == (0.0, 0.0, 0.1, 0.0, 0.0, 0.0)
    assert [axis for axis, value in enumerate(motions.measured_at(0.8)) if value == 0.1] == [2]
    assert not any(math.isfinite(value) for value in motions.measured_at(1.0))


SURGE_mps, HEAVE_PER_Nm, LAG_S = 0.1, 0.05, 0.15


@pytest.fixture(scope="module")
def drifting(vehicle: Vehicle) -> list[Any]:
    """Pitch while the vehicle goes ahead, and sinks and rises with the moment; the record knows the thrust only."""
    truth = truth_of(vehicle)
    reported, model = truth["pitch"], model_of(vehicle, 4)
    theta = np.array(
        [reported["k_q"], reported["k_l"], reported["b"], reported["k_r"], model.rigid + reported["added_mass"]]
    )
    plan = back_and_forth((0.6, 1.0, 1.4, 1.7), 5.0, 80.0)
    lead = truth["heave_down"]["added_mass"] - truth["surge"]["added_mass"]
    _, commands = plan.commands()
    flight = fly(model, theta, plan, LAG_S, np.full(len(commands), lead * SURGE_mps * HEAVE_PER_Nm))
    rng = np.random.default_rng(3)
    inputs = list(events(flight, 4, "pitch", dataclasses.replace(GYRO), rng, plateau_s=3.0))
    moments = LaggedThrust(flight.times_s, commands, LAG_S).force(flight.times_s)
    for t, moment in zip(flight.times_s[::2].tolist(), moments[::2].tolist(), strict=True):
        nu = (SURGE_mps, NAN, HEAVE_PER_Nm * moment, NAN, NAN, NAN)
        inputs.append(Stamped(stamp_from_s(t), Velocity(nu, "dvl75")))
    return sorted(inputs, key=lambda event: event.stamp)


class Told(Session):
    """Knows the total masses of some axes, each with its deviation."""

    known: Mapping[int, tuple[float, float]] = {}

    def _estimated_mass(self, axis: int, draft_of: DraftFit | None) -> tuple[float, float]:
        return self.known.get(axis) or super()._estimated_mass(axis, draft_of)


def off(vehicle: Vehicle, inputs: list[Any], known: Mapping[int, tuple[float, float]]) -> list[Any]:
    """Error of k_r [N m] and its standard deviation: refined and online."""
    session = Told(vehicle, every_s=math.inf)
    session.known = known
    for event in inputs:
        session.step(event)
    result, truth = session.finalize().results.motions["pitch"], truth_of(vehicle)["pitch"]["k_r"]
    both = result.coefficients["k_r"], result.methods["rls"]["k_r"]
    return [(number.value - truth, number.std) for number in both]


def test_a_drift_while_pitching_is_no_stiffness(vehicle: Vehicle, drifting: list[Any]) -> None:
    truth = truth_of(vehicle)
    known = {MOTIONS[one].axis: (vehicle.mass_kg + truth[one]["added_mass"], 0.1) for one in ("surge", "heave_down")}
    for (error, sigma), (error_without, sigma_without) in zip(
        off(vehicle, drifting, known), off(vehicle, drifting, {}), strict=True
    ):
        assert abs(error) < 3.5 * sigma
        assert 10.0 * sigma < abs(error_without) < 3.0 * sigma_without


@pytest.mark.parametrize("false", [(1.5, 0.0), (0.0, -2.0), (-1.0, 1.0)])
def test_a_velocity_that_jumps_once_makes_no_force(false: tuple[float, float]) -> None:
    motions = VelocityHistory(1.0)
    for tick in range(20):
        u, w = (0.3 + 0.02 * tick + x * (tick == 10) for x in (false[0], false[1]))
        motions.update(0.1 * tick, (u, NAN, w, NAN, NAN, NAN))
        found = motions.at(0.1 * tick)
        assert abs(found[0] - u) < 0.05 or tick == 10
        assert max(abs(found[0] - 0.3 - 0.02 * tick), abs(found[2] - 0.3 - 0.02 * tick)) < 0.05


def test_a_jump_that_the_next_velocity_confirms_is_accepted() -> None:
    motions = VelocityHistory(1.0)
    motions.update(0.0, (0.3, NAN, NAN, NAN, NAN, NAN))
    motions.update(0.1, (1.3, NAN, NAN, NAN, NAN, NAN))
    assert motions.at(0.1)[0] == 0.3
    motions.update(0.2, (1.4, NAN, NAN, NAN, NAN, NAN))
    assert motions.at(0.2)[0] == 1.4


def test_after_a_pause_a_velocity_may_be_any() -> None:
    motions = VelocityHistory(10.0)
    motions.update(0.0, (0.3, NAN, NAN, NAN, NAN, NAN))
    motions.update(2.0, (-1.3, NAN, NAN, NAN, NAN, NAN))
    assert motions.at(2.0)[0] == -1.3


def test_one_false_lock_while_pitching_changes_nothing(vehicle: Vehicle, drifting: list[Any]) -> None:
    known = {0: (vehicle.mass_kg + 12.0, 0.1), 2: (vehicle.mass_kg + 22.0, 0.1)}
    velocities = [index for index, event in enumerate(drifting) if isinstance(event.reading, Velocity)]
    at = next(index for index in velocities[len(velocities) // 2 :] if drifting[index].reading.source == "dvl75")
    false = dataclasses.replace(drifting[at].reading, nu=(4.0, NAN, 4.0, NAN, NAN, NAN))
    lied = [*drifting[:at], Stamped(drifting[at].stamp, false), *drifting[at + 1 :]]
    for (error, sigma), (error_lied, _) in zip(off(vehicle, drifting, known), off(vehicle, lied, known), strict=True):
        assert abs(error_lied - error) < 0.1 * sigma
