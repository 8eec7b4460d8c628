"""Motion predicted by a model for recorded thrust, with its sensitivity to every parameter.

Trapezoidal collocation: on a grid of times t_k with velocities v_k and positions s_k,

    M (v_k+1 - v_k) + h/2 (f_k + f_k+1) = impulse of the thrust over the step,    s_k+1 - s_k = h/2 (v_k + v_k+1)

with f = drag + b + restoring, and the end terms of Euler and Maclaurin (h^2/12 times the change of the rates of f and v
over the step), which make the rule of fourth order. All steps together are one banded system: Newton's method on it
gives the whole trajectory in a few solves, and the sensitivities are further right-hand sides of the same matrix
(implicit function theorem). Stretches of a record are solved side by side.

The matrix leaves out the end terms: they are small, so a few steps more converge, and without them no row looks ahead
of its time: a solve is one forward substitution.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hindrax_ident.arrays import Array, Flags, Index, array
from hindrax_ident.model.motion_model import Model

NEWTON_STEPS = 30
CONVERGED = 1e-11


@dataclass(frozen=True)
class Grid:
    """Times of all stretches one after the other, (n,) [s]; `starts` (n,) marks the first of each stretch.

    `impulse` (n,): impulse of thrust and known forces over the step that ends at each time [N s, N m s]; zero at a
    start. `across` (n,): speed across the axis [m/s], of a model with k_w.
    """

    times_s: Array
    starts: Flags
    impulse: Array
    across: Array | float = 0.0

    @cached_property
    def steps_s(self) -> Array:
        """Length of the step that ends at each time: (n,) [s]; zero at a start."""
        return per_step(self.times_s, self.starts)

    @cached_property
    def bounds(self) -> Index:
        """First and last point in the stretch of each: (2, n)."""
        first = np.flatnonzero(self.starts)
        last = np.append(first[1:], len(self.starts)) - 1
        return np.stack([first, last])[:, np.cumsum(self.starts) - 1]

    @cached_property
    def quadrature(self) -> Array:
        """Weights of x_k-2, x_k-1, x_k, x_k+1 in the integral of x over the step that ends at t_k: (4, n) [s].

        Trapezoid with end terms: h/2 (x_k-1 + x_k) - h^2/12 (r_k - r_k-1). The rate r_k is the parabola's through both
        neighbors, or the difference quotient of the only one at the ends of a stretch: a x_k-1 - (a + c) x_k + c x_k+1.
        """
        h = self.steps_s
        # The grid is uneven: stamps of two sensors are merged, so the parabola has unequal arms.
        after = np.append(h[1:], 0.0)  # zero where a stretch ends
        both = np.where((h > 0.0) & (after > 0.0), h + after, 1.0)
        a = -_ratio(np.where(after > 0.0, after, 1.0), h * both)
        c = _ratio(np.where(h > 0.0, h, 1.0), after * both)
        end = h**2 / 12.0
        before_a, before_c = np.append(0.0, a[:-1]), np.append(0.0, c[:-1])
        return np.stack(
            [end * before_a, 0.5 * h - end * (a + before_a + before_c), 0.5 * h + end * (a + c + before_c), -end * c]
        )

    def integral(self, x: Array) -> Array:
        """Integral of x, (n,) or (n, m), over the step that ends at each time: like x [x s]; zero at a start."""
        far, before, here, ahead = self.quadrature.reshape(4, -1, *[1] * (x.ndim - 1))
        out = here * x
        out[1:] += before[1:] * x[:-1]
        out[2:] += far[2:] * x[:-2]
        out[:-1] += ahead[:-1] * x[1:]
        return array(out)


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Velocity and position on the grid, (n,) each [m/s, m] or [rad/s, rad]."""

    v: Array
    s: Array


def _ratio(over: Array, under: Array) -> Array:
    """Quotient, (n,); zero where the divisor is."""
    return np.divide(over, under, out=np.zeros_like(under), where=under > 0.0)


def per_step(totals: Array, starts: Flags) -> Array:
    """Increase of totals, (n,) or (n, m), over the step that ends at each time; zero at the start of a stretch."""
    steps = np.diff(totals, axis=0, prepend=totals[:1])
    steps[starts] = 0.0
    return steps


def trajectory(model: Model, theta: Array, grid: Grid, start: Trajectory) -> Trajectory | None:
    """Motion of all stretches by Newton's method on the collocation equations of the head of this module.

    Parameters
    ----------
    model
        Columns of the resisting force.
    theta : (p,)
        Its parameters; the last is the mass.
    grid
        Times, stretches and impulses (n,).
    start
        First velocity and position of each stretch; the rest of it is the first guess.

    Returns
    -------
    Trajectory or None
        Velocity and position (n,); None where the iteration does not converge: the parameters are implausible.
    """
    v, s = start.v.copy(), start.s.copy()
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(NEWTON_STEPS):
            residual = _residual(model, theta, grid, v, s)
            # Parameters of a trial step may let the motion run away; that is an answer, not an error.
            if not np.all(np.isfinite(residual)):
                return None
            try:
                change = _solve(_jacobian(model, theta, grid, v, s), residual)
            except np.linalg.LinAlgError:
                return None
            v, s = v - change[:, 0], s - change[:, 1]
            if np.abs(change).max(initial=0.0) < CONVERGED * (1.0 + np.abs(v).max(initial=0.0)):
                return Trajectory(v, s)
    return None


def sensitivities(
    model: Model,
    theta: Array,
    grid: Grid,
    path: Trajectory,
    impulses: Array | None = None,
    *,
    refinements: int = 0,
) -> Array:
    """Derivatives of the trajectory: the equations F(x, theta) = 0 give dx/dtheta = -(dF/dx)^-1 dF/dtheta.

    dF/dx is the matrix of the last Newton step, so each column costs one more right-hand side. That matrix leaves out
    the end terms: of a motion that settles within a few steps the derivatives are wrong by some hundredths. Each
    refinement solves for what the whole equations leave, and makes them right by as much again.

    Parameters
    ----------
    model, theta, grid
        As `trajectory` took them.
    path
        What it returned.
    impulses : (n, m) [N s, N m s]
        Additional impulses over each step, to which the derivative is wanted too.
    refinements
        How often the derivatives are refined.

    Returns
    -------
    Array
        (n, 2, p + 2 + m): of velocity and position, by the p parameters, the initial velocity and the initial position
        of the same stretch, then one per column of `impulses`.
    """
    n, p = len(path.v), len(theta)
    extra = 0 if impulses is None else impulses.shape[1]
    right = np.zeros((n, 2, p + 2 + extra))
    half = 0.5 * grid.steps_s[:, None]
    # dF/dtheta: the columns of the force over each step; the last parameter, the mass, multiplies the change of v.
    columns = model.columns(path.v, path.s, grid.across)
    right[1:, 0, : p - 1] = -half[1:] * (columns[1:] + columns[:-1])
    right[1:, 0, p - 1] = -np.diff(path.v) * ~grid.starts[1:]
    # The rows of a start say v = v_0 and s = s_0.
    right[grid.starts, 0, p] = 1.0
    right[grid.starts, 1, p + 1] = 1.0
    if impulses is not None:
        right[:, 0, p + 2 :] = impulses
    jacobian = _jacobian(model, theta, grid, path.v, path.s)
    found = _solve(jacobian, right)
    if refinements:
        # From here on with the end terms, which the matrix leaves out and the equations have.
        right[:, 0, : p - 1] = -grid.integral(columns) * ~grid.starts[:, None]
    for _ in range(refinements):
        found = found + _solve(jacobian, right - _changed(model, theta, grid, path, found))
    return found


def _changed(model: Model, theta: Array, grid: Grid, path: Trajectory, x: Array) -> Array:
    """Change of `_residual` with changes x of velocity and position, (n, 2, m): of first order, with all terms."""
    slope = model.slope(theta, path.v, grid.across)[:, None]
    stiffness = theta[-2] * np.cos(path.s)[:, None] if model.restores else 0.0
    out = np.empty_like(x)
    out[1:, 0] = theta[-1] * (x[1:, 0] - x[:-1, 0])
    out[1:, 1] = x[1:, 1] - x[:-1, 1]
    out[:, 0] += grid.integral(slope * x[:, 0] + stiffness * x[:, 1])
    out[:, 1] -= grid.integral(x[:, 0])
    # The rows of a start have no step before them: they hold the initial conditions.
    out[grid.starts] = x[grid.starts]
    return out


def _residual(model: Model, theta: Array, grid: Grid, v: Array, s: Array) -> Array:
    """Residuals of momentum and kinematics: (n, 2) [N s, m] or [N m s, rad]; zero at the start of a stretch."""
    out = np.empty((len(v), 2))
    out[1:, 0] = theta[-1] * (v[1:] - v[:-1])
    out[1:, 1] = s[1:] - s[:-1]
    out[:, 0] += grid.integral(model.force(theta, v, s, grid.across)) - grid.impulse
    out[:, 1] -= grid.integral(v)
    out[grid.starts] = 0.0
    return out


def _jacobian(model: Model, theta: Array, grid: Grid, v: Array, s: Array) -> tuple[Array, Array]:
    """Jacobian of the residual as a triangle, and the shares (n,) by which it became one.

    Over (v_0, s_0, v_1, s_1, ...), with the diagonal and three bands below it: (4, 2 n). Only the stiffness, at s_k in
    the row of momentum k, is above the diagonal; that row less the share h/2 stiffness of the row of kinematics
    s_k - h/2 v_k - s_k-1 - h/2 v_k-1 has none. So a solve is one forward substitution, with or without an attitude.
    """
    n, half, inside = len(v), 0.5 * grid.steps_s, ~grid.starts
    slope = model.slope(theta, v, grid.across)
    stiffness = theta[-2] * np.cos(s) if model.restores else np.zeros(n)
    share, later = half * stiffness, inside[1:]
    bands = np.zeros((4, 2 * n))
    bands[0, 0::2] = np.where(inside, theta[-1] + half * slope, 1.0) + share * half
    bands[0, 1::2] = 1.0
    bands[1, 0::2] = -half
    before = -theta[-1] + half[1:] * slope[:-1]
    bands[2, 0 : 2 * n - 2 : 2] = np.where(later, before, 0.0) + share[1:] * half[1:]
    bands[1, 1 : 2 * n - 2 : 2] = half[1:] * stiffness[:-1] + share[1:]
    bands[3, 0 : 2 * n - 2 : 2] = -half[1:]
    bands[2, 1 : 2 * n - 2 : 2] = np.where(later, -1.0, 0.0)
    return bands, share


def _solve(jacobian: tuple[Array, Array], right: Array) -> Array:
    """Solution of the triangle: (n, 2, m) or (n, 2), shaped as the right-hand sides; LinAlgError if singular."""
    bands, share = jacobian
    moved = right.copy()
    moved[:, 0] -= share.reshape(-1, *[1] * (right.ndim - 2)) * right[:, 1]
    from scipy.linalg.lapack import dtbtrs  # noqa: PLC0415  # slow, and the live estimate does without

    solved, zero_at = dtbtrs(bands, moved.reshape(2 * len(right), -1), uplo="L")
    if zero_at:
        raise np.linalg.LinAlgError("singular")
    return np.asarray(solved).reshape(right.shape)
