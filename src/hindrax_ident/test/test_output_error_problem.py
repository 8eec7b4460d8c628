"""The output-error problem of a record: its grid by hand, its sensitivities against finite differences."""

from dataclasses import replace

import numpy as np
import pytest

from hindrax_ident.arrays import Array, array
from hindrax_ident.fit.output_error_problem import (
    LinearizedProblem,
    OutputErrorProblem,
    _project,
    build_problem,
    error_dynamics_of,
    linearize,
    nearest_start,
    restarted,
    whitener_of,
)
from hindrax_ident.fit.whitening import Noise, Whitener
from hindrax_ident.model.motion_model import Model
from hindrax_ident.model.simulation import Trajectory, trajectory
from hindrax_ident.records.axis_record import Record, Series, Stretch

SURGE, SURGE_THETA = Model(0, 15.22), np.array([66.48, 1.25, 0.3, 27.3])
ROLL, ROLL_THETA = Model(3, 0.483, restores=True), np.array([1.29, 0.05, 0.02, 3.0, 0.733])
NOTHING = Series(array(np.zeros(0)), array(np.zeros(0)))
FORCE = Series(array(np.array([0.0, 0.43, 1.1, 2.3])), array(np.array([3.0, -2.0, 5.0, 1.0])))
TWO = (Stretch(0.0, 1.0), Stretch(2.0, 2.9))


def series(*times: float) -> Series:
    t = array(np.array(times))
    return Series(t, array(0.2 * np.sin(3.0 * t)))


def every(step_s: float, first_s: float, last_s: float) -> list[float]:
    return np.arange(first_s, last_s + 0.5 * step_s, step_s).tolist()


VELOCITIES = series(*every(0.1, 0.0, 1.0), *every(0.1, 2.0, 2.9))


def record_of(velocity: Series = VELOCITIES, position: Series = NOTHING, **more: object) -> Record:
    return replace(Record(velocity, FORCE, TWO, position=position), **more)  # type: ignore[arg-type]


def test_the_initial_velocities_of_all_stretches_are_projected_out_as_by_orthogonal_factors() -> None:
    problem = build_problem(SURGE, record_of())
    rng = np.random.default_rng(3)
    table = rng.standard_normal((21, 6))
    table[11:, 4] = 0.0  # nothing was measured of the second stretch
    expected, first = table[:, :4].copy(), slice(0, 11)
    Q, R = np.linalg.qr(table[first, 4:5])
    expected[first] -= Q @ (Q.T @ expected[first])
    along = Q.T @ table[first, :4] / R
    starts = _project(problem, table)
    assert table[:, :4] == pytest.approx(expected, abs=1e-12)
    assert starts[0, 0] == pytest.approx(along[0], abs=1e-12)
    assert np.all(starts[1] == 0.0)
    assert np.all(starts[:, 1] == 0.0)


def test_steps_are_short_and_stretches_begin_anew() -> None:
    problem = build_problem(SURGE, record_of(effort=Series(FORCE.t, array(np.array([9.0, 4.0, 25.0, 1.0])))))
    grid = problem.grid
    assert grid.times_s == pytest.approx([*every(0.05, 0.0, 1.0), *every(0.05, 2.0, 2.9)])
    assert np.flatnonzero(grid.starts).tolist() == [0, 21]
    assert problem.index.tolist() == [*range(0, 21, 2), *range(21, 40, 2)]
    assert problem.t.tolist() == VELOCITIES.t.tolist()
    assert problem.y.tolist() == VELOCITIES.y.tolist()
    assert problem.spans == (slice(0, 11), slice(11, 21))
    assert np.flatnonzero(problem.starts()).tolist() == [0, 11]
    assert (problem.samples, problem.nuisances, problem.main, problem.has_position) == (21, 2, 0, (False, False))
    # Without a lag: 3 N until 0.43 s, then -2 N, 5 N from 1.1 s, 1 N from 2.3 s.
    between = 3.0 * 0.03 - 2.0 * 0.02
    first = [0.0] + [3.0 * 0.05] * 8 + [between] + [-2.0 * 0.05] * 11
    assert grid.impulse == pytest.approx([*first, 0.0, *[5.0 * 0.05] * 6, *[1.0 * 0.05] * 12])
    squares = np.diff(problem.efforts)
    assert squares[:5] == pytest.approx([0.9, 0.9, 0.9, 0.9, 9.0 * 0.03 + 4.0 * 0.07])


def test_a_descent_begins_where_the_motion_is_nearest_to_the_record() -> None:
    """A live estimate of half a minute was in another basin: noise of 8 % for 0.5 %, and no added mass."""
    problem = build_problem(SURGE, record_of())
    moved = trajectory(SURGE, SURGE_THETA, problem.grid, problem.guess)
    assert moved is not None
    record = record_of(Series(problem.t, array(moved.v[problem.index])))
    far, implausible = SURGE_THETA * 9.0, SURGE_THETA * np.array([1.0, 1.0, 1.0, -1e-9])
    assert nearest_start(SURGE, record, [far, SURGE_THETA]) is SURGE_THETA
    assert nearest_start(SURGE, record, [SURGE_THETA, far]) is SURGE_THETA
    assert nearest_start(SURGE, record, [implausible, far]) is far


def test_a_lag_of_the_record_is_that_of_the_problem() -> None:
    assert build_problem(SURGE, record_of(lag_s=0.15)).lag_s == 0.15


def test_no_step_is_longer_than_a_twentieth_of_a_second() -> None:
    times = [0.0, 0.05, 0.1, 0.22, 0.3201, 0.33, 0.34, 0.36, 0.38]
    grid = build_problem(SURGE, record_of(series(*times), stretches=(Stretch(0.0, 0.4),))).grid
    third, part = 0.12 / 3, 0.1001 / 3
    wanted = [0.0, 0.05, 0.1, 0.1 + third, 0.1 + 2 * third, 0.22, 0.22 + part, 0.22 + 2 * part, *times[4:]]
    assert grid.times_s == pytest.approx(wanted, abs=1e-12)


def test_what_comes_within_a_microsecond_comes_at_once() -> None:
    positions = series(0.0, 0.1 + 5e-7, 0.2 + 2e-6, 0.3 - 5e-7, 0.45)
    problem = build_problem(SURGE, record_of(series(*every(0.1, 0.0, 0.4)), positions, stretches=(Stretch(0.0, 1.0),)))
    times = problem.grid.times_s
    # From 0.3 s, half a microsecond early, to 0.4 s is more than two steps.
    wanted = [0.0, 0.05, 0.1, 0.15, 0.2, 0.2 + 2e-6, 0.25, 0.3, 1 / 3, 11 / 30, 0.4, 0.45]
    assert times == pytest.approx(wanted, abs=2e-6)
    assert problem.channel.tolist() == [0, 1, 0, 1, 0, 1, 1, 0, 0, 1]
    assert problem.index.tolist() == [0, 0, 2, 2, 4, 5, 7, 7, 10, 11]
    assert np.diff(problem.t).min() >= 0.0
    assert problem.y[problem.channel == 1].tolist() == positions.y.tolist()
    assert (problem.samples, problem.nuisances, problem.main, problem.has_position) == (10, 2, 0, (True,))


def test_positions_alone_are_the_main_channel() -> None:
    problem = build_problem(SURGE, record_of(NOTHING, VELOCITIES))
    assert (problem.main, problem.nuisances, problem.has_position) == (1, 4, (True, True))
    mixed = build_problem(SURGE, record_of(VELOCITIES, series(*every(0.1, 2.0, 2.9))))
    assert (mixed.main, mixed.nuisances, mixed.has_position) == (0, 3, (False, True))


@pytest.mark.parametrize(("velocities", "positions", "used"), [(8, 0, True), (0, 8, True), (5, 3, True), (4, 3, False)])
def test_a_stretch_of_fewer_than_eight_measurements_is_left_out(velocities: int, positions: int, used: bool) -> None:
    v, s = (
        series(*every(0.1, 5.0, 5.0 + 0.1 * velocities - 0.05)),
        series(*every(0.1, 5.0, 5.0 + 0.1 * positions - 0.05)),
    )
    v = Series(v.t[:velocities], v.y[:velocities])
    s = Series(s.t[:positions], s.y[:positions])
    joined = Series(array(np.append(VELOCITIES.t, v.t)), array(np.append(VELOCITIES.y, v.y)))
    problem = build_problem(SURGE, record_of(joined, s, stretches=(*TWO, Stretch(5.0, 6.0))))
    assert len(problem.spans) == 2 + used
    alone = record_of(v, s, stretches=(Stretch(5.0, 6.0),))
    if used:
        assert build_problem(SURGE, alone).samples == 8
    else:
        with pytest.raises(ValueError, match="no stretch of the record has enough samples, wanted 8"):
            build_problem(SURGE, alone)


def test_the_first_guess_is_the_motion_as_measured() -> None:
    guess = build_problem(SURGE, record_of()).guess
    middle = 0.5 * (VELOCITIES.y[1:] + VELOCITIES.y[:-1])
    assert guess.v[0] == np.median(VELOCITIES.y[:5]), "whatever the very first is"
    assert guess.v[2:21:2] == pytest.approx(VELOCITIES.y[1:11])
    assert guess.v[1:21:2] == pytest.approx(middle[:10])
    assert guess.s[[0, 21]].tolist() == [0.0, 0.0]
    assert guess.s[2:21:2] == pytest.approx(np.cumsum(0.1 * middle[:10]))
    assert guess.s[23::2] == pytest.approx(np.cumsum(0.1 * middle[11:]))
    of_positions = build_problem(SURGE, record_of(NOTHING, VELOCITIES)).guess
    assert not of_positions.v.any()
    assert of_positions.s == pytest.approx(guess.v)


def plain(table: Array) -> Array:
    """No whitening."""
    return table.copy()


def roll_record() -> Record:
    return record_of(VELOCITIES, series(*every(0.13, 0.02, 1.0), *every(0.17, 2.0, 2.9)))


CASES = {
    "velocities": (SURGE, SURGE_THETA, record_of()),
    "both": (ROLL, ROLL_THETA, roll_record()),
    "positions in one stretch": (SURGE, SURGE_THETA, record_of(VELOCITIES, series(*every(0.1, 2.0, 2.9)))),
}


def linearized(
    problem: OutputErrorProblem,
    theta: Array,
    path: Trajectory | None = None,
    more: Array | None = None,
    readings: Array | None = None,
) -> LinearizedProblem:
    found = linearize(problem, theta, path or problem.guess, plain, more, readings=readings)
    assert found is not None
    return found


def nudged(problem: OutputErrorProblem, at: int, dv: float, ds: float) -> Trajectory:
    v, s = problem.guess.v.copy(), problem.guess.s.copy()
    v[at] += dv
    s[at] += ds
    return Trajectory(v, s)


def slopes(problem: OutputErrorProblem, theta: Array) -> tuple[Array, Array]:
    """Sensitivities of the measurements to the parameters, (n, p), and to the initial conditions, by differences."""
    h = 1e-6
    of_theta = [
        linearized(problem, theta - h * one).raw - linearized(problem, theta + h * one).raw
        for one in np.eye(len(theta))
    ]
    of_start = []
    for start, has_position in zip(np.flatnonzero(problem.grid.starts).tolist(), problem.has_position, strict=True):
        for dv, ds in ((h, 0.0), (0.0, h))[: 1 + has_position]:
            less, more = (linearized(problem, theta, nudged(problem, start, k * dv, k * ds)).raw for k in (-1, 1))
            of_start.append(less - more)
    return array(np.stack(of_theta, axis=1) / (2.0 * h)), array(np.stack(of_start, axis=1) / (2.0 * h))


def assert_near(found: Array, wanted: Array) -> None:
    """Equal but for the end terms of the steps, which sensitivities leave out."""
    assert found.shape == wanted.shape
    assert np.abs(found - wanted).max() < 0.02 * np.abs(wanted).max()


@pytest.mark.parametrize("case", CASES)
def test_residuals_and_sensitivities_are_those_of_the_best_initial_conditions(case: str) -> None:
    model, theta, record = CASES[case]
    problem = build_problem(model, record)
    found = linearized(problem, theta)
    moved = np.stack([found.path.v, found.path.s], axis=1)[problem.index, problem.channel]
    assert found.raw == pytest.approx(problem.y - moved, abs=1e-12)
    J, Psi = slopes(problem, theta)
    Q, _ = np.linalg.qr(Psi)
    rest = np.eye(len(Q)) - Q @ Q.T
    assert_near(found.r, array(rest @ found.raw))
    assert_near(found.J, array(rest @ J))
    # What each initial condition would have to change by, for the residuals and per unit of each parameter.
    best, *_ = np.linalg.lstsq(Psi, np.column_stack([found.raw, J]), rcond=None)
    rows = [found.start[at, : 1 + has_position] for at, has_position in enumerate(problem.has_position)]
    for column, wanted in zip(np.concatenate(rows).T, best.T, strict=True):
        assert_near(array(column), array(wanted))
    assert all(not found.start[at, 1:].any() for at, one in enumerate(problem.has_position) if not one)
    assert found.cost == pytest.approx(float(np.sum(found.r**2)))
    assert found.information == pytest.approx(np.array([[a @ b for b in found.J.T] for a in found.J.T]))
    assert found.gradient == pytest.approx(np.array([a @ found.r for a in found.J.T]))


def test_further_columns_are_those_of_impulses_and_of_readings() -> None:
    problem = build_problem(ROLL, roll_record())
    p, t = len(ROLL_THETA), problem.grid.times_s
    impulses = array(np.where(problem.grid.starts, 0.0, [np.sin(2.0 * t), np.cos(5.0 * t)]).T)
    readings = array(np.random.default_rng(1).standard_normal((len(problem.t), 3)))
    found = linearized(problem, ROLL_THETA, None, impulses, readings=readings)
    alone = linearized(problem, ROLL_THETA)
    assert found.J.shape == (len(problem.t), p + 5)
    assert found.start.shape == (2, 2, 1 + p + 5)
    assert found.J[:, :p] == pytest.approx(alone.J)
    _, Psi = slopes(problem, ROLL_THETA)
    Q, _ = np.linalg.qr(Psi)
    rest = np.eye(len(Q)) - Q @ Q.T
    h = 1e-6
    for column in range(2):
        pushed = replace(problem, grid=replace(problem.grid, impulse=problem.grid.impulse + h * impulses[:, column]))
        change = (alone.raw - linearized(pushed, ROLL_THETA).raw) / h
        assert_near(found.J[:, p + column], array(rest @ change))
    assert_near(found.J[:, p + 2 :], array(rest @ readings))
    assert pytest.approx(found.J[:, : p + 2]) == linearized(problem, ROLL_THETA, None, impulses).J


def test_residuals_are_whitened() -> None:
    problem = build_problem(SURGE, record_of())
    weights = array(np.linspace(1.0, 3.0, len(problem.t))[:, None])
    found = linearize(problem, SURGE_THETA, problem.guess, lambda table: array(table * weights))
    assert found is not None
    J, Psi = slopes(problem, SURGE_THETA)
    Q, _ = np.linalg.qr(weights * Psi)
    rest = np.eye(len(Q)) - Q @ Q.T
    assert_near(found.r, array(rest @ (weights[:, 0] * found.raw)))
    assert_near(found.J, array(rest @ (weights * J)))


def test_a_simulation_that_diverges_has_no_linearization() -> None:
    problem = build_problem(SURGE, record_of())
    assert linearize(problem, array(np.array([-1e9, 0.0, 0.0, 1e-9])), problem.guess, plain) is None


@pytest.mark.parametrize("case", CASES)
def test_initial_conditions_follow_a_change_of_the_parameters(case: str) -> None:
    """The residuals of what is linear in them get smallest: a second time there is nothing left to change."""
    model, theta, record = CASES[case]
    problem = build_problem(model, record)
    found, change = linearized(problem, theta), array(1e-4 * theta)
    path = restarted(problem, found, change)
    at = np.flatnonzero(problem.grid.starts)
    elsewhere = ~problem.grid.starts
    assert path.v[elsewhere].tolist() == found.path.v[elsewhere].tolist()
    again = linearized(problem, array(theta + change), path)
    best = np.stack([path.v[at], path.s[at]], axis=1)
    left = again.start[:, :, 0]
    before = found.start[:, :, 0]
    assert np.abs(left).max() < 0.2 * np.abs(before).max()
    wanted = np.stack([found.path.v[at], found.path.s[at]], axis=1) + before - found.start[:, :, 1:] @ change
    assert best == pytest.approx(wanted)
    # The path that it came from stays as it is.
    assert found.path.v.tolist() == linearized(problem, theta).path.v.tolist()


def test_errors_decay_with_the_drag_and_swing_with_the_stiffness() -> None:
    problem = build_problem(ROLL, replace(roll_record(), lag_s=0.2))
    path = linearized(problem, ROLL_THETA).path
    chain = error_dynamics_of(problem, ROLL_THETA, path)
    v, s = path.v[problem.index], path.s[problem.index]
    assert chain.damping == pytest.approx((2.0 * 1.29 * np.abs(v) + 0.05) / 0.733)
    assert chain.stiffness == pytest.approx(3.0 * np.cos(s) / 0.733)
    assert chain.memory_s == 0.2
    assert chain.channel.tolist() == problem.channel.tolist()
    assert chain.starts.tolist() == problem.starts().tolist()
    for span in problem.spans:
        assert chain.step_s[span] == pytest.approx([0.0, *np.diff(problem.t[span])])
    plain_chain = error_dynamics_of(
        build_problem(SURGE, record_of()), SURGE_THETA, build_problem(SURGE, record_of()).guess
    )
    assert not plain_chain.stiffness.any()
    noise = Noise(1e-4, 1e-4, 1e-3, 1e-3)
    table = array(np.eye(len(problem.t)))
    assert np.array_equal(whitener_of(problem, ROLL_THETA, path, noise)(table), Whitener(chain, noise)(table))


def test_the_thrust_over_a_step_is_its_mean_square_and_over_none_that_of_the_next() -> None:
    positions = series(0.2, 0.4, *every(0.1, 2.0, 2.2))
    velocities = series(*every(0.1, 0.0, 1.0), *every(0.1, 2.0, 2.9))
    problem = build_problem(SURGE, record_of(velocities, positions))
    n = len(problem.t)
    efforts = array(np.cumsum(np.arange(n, dtype=float)))
    chain = error_dynamics_of(replace(problem, efforts=efforts), SURGE_THETA, problem.guess)
    gained = np.arange(n, dtype=float)
    steps = chain.step_s
    long = np.flatnonzero(steps > 1e-6)
    wanted = []
    for at in range(n):
        own = next(one for one in long if one >= at)
        wanted.append(gained[own] / steps[own] / 27.3**2)
    assert chain.thrust == pytest.approx(wanted)
    assert len(long) < n - 2


def test_a_record_that_ends_with_two_measurements_at_once_has_a_thrust_to_its_end() -> None:
    problem = build_problem(SURGE, record_of(VELOCITIES, series(2.5, 2.9)))
    assert problem.t[-2:].tolist() == pytest.approx([2.9, 2.9])
    gained = array(np.concatenate([np.arange(len(problem.t) - 1.0), [len(problem.t) - 2.0]]))
    chain = error_dynamics_of(replace(problem, efforts=gained), SURGE_THETA, problem.guess)
    assert chain.thrust[-1] == 0.0
    assert chain.thrust[-2] == pytest.approx(1.0 / 0.1 / 27.3**2, rel=1e-6)
