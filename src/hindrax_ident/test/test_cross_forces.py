"""What motion along the other axes does to one, in the live estimate."""

import math
from collections.abc import Iterator

import numpy as np
import pytest

from hindrax_core.events import Stamp, Stamped, after
from hindrax_core.signals import IdentEvent, Thrust, Velocity
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.model.coriolis import USUAL_MASS_RATIO_SIGMA
from hindrax_ident.model.motion_model import model_of, rigid_mass
from hindrax_ident.model.six_axes import State, cross_terms, inertial_force, symmetric, whole_speed
from hindrax_ident.online.cross_forces import CrossForces
from hindrax_ident.online.record_session import RecordSession

BOX = Vehicle("box", mass_kg=20.0, volume_m3=0.0203, envelope_m=(0.6, 0.5, 0.4), inertia_kgm2=(0.6, 0.8, 1.0))
STEP_S = 0.05


def impulses(axis: int, begin: Array, end: Array) -> tuple[Array, Array]:
    """Filtered columns over a second in which all velocities change evenly, and the terms of the six axes, summed."""
    model = model_of(BOX, axis)
    path = array(np.linspace(begin, end, 4001))
    state = State(path, np.tile(end - begin, (len(path), 1)), np.zeros_like(path), np.zeros((len(path), 2)))
    forces = [
        term.sigma * term.force(state).get(axis, np.zeros(len(path)))
        for term in (*cross_terms(BOX, axis), whole_speed(BOX, axis))
    ]
    for other in {0, 1, 2, 3, 4, 5} - {axis}:
        mass = USUAL_MASS_RATIO_SIGMA * rigid_mass(BOX, other) * symmetric((other, other))
        forces.append(inertial_force(array(mass), path, np.zeros_like(path))[:, axis])
    kept = np.exp(np.linspace(-1.0, 0.0, len(path)))
    cross, steps = CrossForces(BOX, model), 200
    cross.nu = tuple(begin.tolist())
    cross.restart(float(begin[axis]))
    gone = -math.expm1(-1.0 / steps)
    last = 1.0 - gone * steps
    for part in np.linspace(0.0, 1.0, steps + 1)[1:]:
        nu = begin + part * (end - begin)
        cross.nu = tuple(nu.tolist())
        cross.advance(1.0 / steps, (1.0 - gone, gone - last, last), float(nu[axis]))
    return array(cross.filtered), array([np.trapezoid(kept * one, dx=1.0 / (len(path) - 1)) for one in forces])


@pytest.mark.parametrize("axis", range(6))
def test_columns_have_the_prior_of_the_terms_of_the_six_axes_behind_the_filter(axis: int) -> None:
    """Rotated, so their products over different motions are compared; the filter takes a second."""
    ways = np.random.default_rng(axis).normal(0.0, 0.4, (4, 2, 6))
    found, wanted = (np.stack(one) for one in zip(*(impulses(axis, *map(array, way)) for way in ways), strict=True))
    assert found @ found.T == pytest.approx(wanted @ wanted.T, rel=1e-3, abs=1e-4 * np.abs(wanted @ wanted.T).max())
    assert found.shape[1] <= wanted.shape[1]


def test_an_outlier_leaves_no_trace() -> None:
    used, fresh = (CrossForces(BOX, model_of(BOX, 4)) for _ in range(2))
    for cross in (used, fresh):
        cross.nu = (0.3, 0.1, -0.2, 0.1, 0.0, 0.2)
        cross.restart(0.1)
        cross.advance(0.1, (0.9, 0.05, 0.05), 0.2)
    used.advance(0.1, (0.9, 0.05, 0.05), 9.0)
    used.undo_last()
    for cross in (used, fresh):
        cross.advance(0.1, (0.9, 0.05, 0.05), 0.15)
    assert used.filtered == fresh.filtered


M = np.diag([34.0, 44.0, 50.0, 1.1, 1.4, 1.6]) + 2.4 * symmetric((0, 4)) - 2.0 * symmetric((1, 3))
DRAG = np.array([40.0, 60.0, 70.0, 2.0, 2.5, 3.0])


def whirled() -> Iterator[Stamped[IdentEvent]]:
    """All axes at once; off-diagonal masses of a sixth to a third of the own."""
    rng, nu = np.random.default_rng(3), array(np.zeros(6))
    rates, phases = rng.uniform(0.1, 0.45, (6, 2)), rng.uniform(0.0, 6.0, (6, 2))
    for index in range(2400):
        t_s = STEP_S * index
        stamp = after(Stamp(1), t_s)
        tau = np.array([14.0, 14.0, 16.0, 2.0, 2.0, 2.0]) * np.sin(6.28 * rates * t_s + phases).mean(axis=1)
        yield Stamped(stamp, Thrust(tuple(tau.tolist())))
        yield Stamped(stamp, Velocity(tuple((nu + rng.normal(0.0, 0.003, 6)).tolist()), "record"))
        for _ in range(10):
            still = inertial_force(array(M), array(nu[None]), np.zeros((1, 6)))[0]
            nu = array(nu + 0.1 * STEP_S * np.linalg.solve(M, tau - still - DRAG * np.abs(nu) * nu))


def test_live_estimates_hold_where_all_axes_move_at_once() -> None:
    """Taken for noise, what the others did made mass and drag of pitch and roll ten deviations wrong, and wide."""
    session, last = RecordSession(BOX), {}
    for estimate in session.step(*whirled()):
        last[estimate.reading.motion] = estimate.reading
    for motion, axis in (("surge", 0), ("sway", 1), ("pitch", 4), ("yaw", 5)):
        one = last[motion]
        mass, sigma = one.values[one.names.index("added_mass")], one.sigmas[one.names.index("added_mass")]
        rigid = BOX.mass_kg if axis < 3 else BOX.inertia[axis - 3]
        assert mass + rigid == pytest.approx(M[axis, axis], abs=3.0 * sigma), motion
        assert sigma < 0.3 * M[axis, axis], motion
        k_q, sigma = one.values[one.names.index("k_q")], one.sigmas[one.names.index("k_q")]
        assert k_q == pytest.approx(DRAG[axis], abs=3.0 * sigma), motion
        assert sigma < 0.35 * DRAG[axis], motion
