"""Simulated motion against closed forms and a fine Runge-Kutta integration; sensitivities against differences."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from hindrax_ident.arrays import Array, array
from hindrax_ident.model.motion_model import Model
from hindrax_ident.model.simulation import Grid, Trajectory, per_step, sensitivities, trajectory
from hindrax_ident.model.thrust_lag import LaggedThrust

SURGE = (Model(0, 15.22), np.array([66.48, 1.25, 0.1, 27.3]))
HEAVE = (Model(2, 15.22, split=True), np.array([93.52, 5.26, 56.57, 11.84, 0.7845, 37.7]))
CROSSED = (Model(2, 15.22, split=True, crossed=True), np.array([93.52, 5.26, 56.57, 11.84, 0.7845, 70.0, 37.7]))
ROLL = (Model(3, 0.483, restores=True), np.array([1.29, 0.05, 0.02, 3.0, 0.733]))


def grid_of(
    impulse_at: Callable[[Array], Array],
    end: float = 12.0,
    step: float = 0.02,
    starts: tuple[float, ...] = (0.0,),
) -> Grid:
    times = np.arange(0.0, end, step, dtype=np.float64)
    flags = np.isin(np.round(times, 9), np.round(starts, 9))
    impulse = np.where(flags, 0.0, np.diff(impulse_at(times), prepend=0.0))
    return Grid(times, flags, impulse)


def still(grid: Grid) -> Trajectory:
    return Trajectory(np.zeros(len(grid.times_s)), np.zeros(len(grid.times_s)))


def path_of(model: Model, theta: Array, grid: Grid, start: Trajectory) -> Trajectory:
    found = trajectory(model, theta, grid, start)
    assert found is not None
    return found


def thrust(scale: float) -> LaggedThrust:
    return LaggedThrust(np.array([0.0, 4.0, 8.0]), scale * np.array([1.0, -0.6, 0.3]), 0.15)


def test_quadratic_drag_alone_follows_the_hyperbolic_tangent() -> None:
    # M v' = F - k v^2 from rest: v = sqrt(F / k) tanh(t sqrt(F k) / M).
    model, F, k, M = Model(0, 10.0), 9.0, 60.0, 25.0
    grid = grid_of(lambda t: F * t)
    path = path_of(model, np.array([k, 0.0, 0.0, M]), grid, still(grid))
    t = grid.times_s
    v = math.sqrt(F / k) * np.tanh(t * math.sqrt(F * k) / M)
    assert path.v == pytest.approx(v, abs=1e-6)
    assert path.s == pytest.approx(M / k * np.log(np.cosh(t * math.sqrt(F * k) / M)), abs=1e-6)


@pytest.mark.parametrize(("model", "theta", "scale"), [(*SURGE, 12.0), (*HEAVE, 30.0), (*ROLL, 1.4)])
def test_motion_is_that_of_a_fine_runge_kutta_integration(model: Model, theta: Array, scale: float) -> None:
    lagged = thrust(scale)
    grid = grid_of(lagged.impulse)
    path = path_of(model, theta, grid, still(grid))
    fine = runge_kutta(model, theta, lagged, grid.times_s[-1], 0.01)
    assert np.abs(path.v - fine[::2, 0]).max() < 2e-4 * np.abs(fine[:, 0]).max()
    assert np.abs(path.s - fine[::2, 1]).max() < 2e-4 * np.abs(fine[:, 1]).max()


def runge_kutta(model: Model, theta: Array, lagged: LaggedThrust, end: float, h: float) -> Array:
    at = np.arange(0.0, end + 0.5 * h, 0.5 * h, dtype=np.float64)
    force = lagged.force(at)
    # The left and the right limit of the force are the same: the lag makes it continuous.
    state: Array = np.zeros(2)
    out = [state]

    def rate(x: Array, index: int) -> Array:
        resisting = float(model.force(theta, np.array([x[0]]), np.array([x[1]]))[0])
        return np.array([(force[index] - resisting) / theta[-1], x[0]])

    for k in range(0, len(at) - 2, 2):
        a = rate(state, k)
        b = rate(state + 0.5 * h * a, k + 1)
        c = rate(state + 0.5 * h * b, k + 1)
        d = rate(state + h * c, k + 2)
        state = state + h / 6.0 * (a + 2 * b + 2 * c + d)
        out.append(state)
    return np.array(out)


@pytest.mark.parametrize(("model", "theta", "scale"), [(*SURGE, 12.0), (*HEAVE, 30.0), (*CROSSED, 30.0), (*ROLL, 1.4)])
def test_sensitivities_are_the_differences_of_the_motion(model: Model, theta: Array, scale: float) -> None:
    grid = grid_of(thrust(scale).impulse, starts=(0.0, 6.0))
    grid = replace(grid, across=array(0.3 * np.abs(np.sin(grid.times_s))))
    start = Trajectory(np.where(grid.times_s < 6.0, 0.0, 0.1), np.where(grid.times_s < 6.0, 0.0, 0.05))
    path = path_of(model, theta, grid, start)
    S = sensitivities(model, theta, grid, path)
    p = len(theta)
    for index in range(p):
        moved = theta.copy()
        moved[index] += (h := 1e-5 * max(1.0, abs(theta[index])))
        other = path_of(model, moved, grid, path)
        same(S[:, 0, index], (other.v - path.v) / h)
        same(S[:, 1, index], (other.s - path.s) / h)
    for index, h in ((0, 1e-6), (1, 1e-6)):
        v, s = path.v.copy(), path.s.copy()
        (v, s)[index][grid.starts] += h
        other = path_of(model, theta, grid, Trajectory(v, s))
        same(S[:, 0, p + index], (other.v - path.v) / h)


def test_refined_sensitivities_are_exact_where_a_motion_settles_within_a_few_steps() -> None:
    model, _ = SURGE
    theta = np.array([120.0, 20.0, 0.3, 7.0])
    grid = grid_of(thrust(12.0).impulse)
    coarse = Grid(grid.times_s[::5], grid.starts[::5], per_step(np.cumsum(grid.impulse)[::5], grid.starts[::5]))
    path = path_of(model, array(theta), coarse, still(coarse))

    def error(refinements: int) -> float:
        """Largest error of the derivatives by the mass, as a share of the largest of these."""
        S = sensitivities(model, array(theta), coarse, path, refinements=refinements)
        h = 1e-5 * theta[-1]
        other = path_of(model, array(theta + h * np.array([0.0, 0.0, 0.0, 1.0])), coarse, path)
        differences = (other.v - path.v) / h
        return float(np.abs(S[:, 0, 3] - differences).max() / np.abs(differences).max())

    rough, once, thrice = error(0), error(1), error(3)
    assert rough > 0.01
    assert once < 0.3 * rough
    assert thrice < 0.03 * rough


def same(found: Array, expected: Array) -> None:
    assert np.abs(found - expected).max() < 5e-3 * max(1e-6, np.abs(expected).max())


def test_an_unknown_impulse_moves_the_vehicle_as_the_sensitivity_states() -> None:
    model, theta = SURGE
    grid = grid_of(thrust(12.0).impulse)
    path = path_of(model, theta, grid, still(grid))
    extra = 1e-5 * np.sin(grid.times_s)
    S = sensitivities(model, theta, grid, path, extra[:, None])
    pushed = Grid(grid.times_s, grid.starts, grid.impulse + np.where(grid.starts, 0.0, extra))
    other = path_of(model, theta, pushed, path)
    same(S[:, 0, -1], other.v - path.v)


def test_parameters_of_no_vehicle_give_no_motion() -> None:
    model, _ = SURGE
    grid = grid_of(thrust(12.0).impulse)
    assert trajectory(model, np.array([-500.0, -90.0, 0.0, 5.0]), grid, still(grid)) is None
