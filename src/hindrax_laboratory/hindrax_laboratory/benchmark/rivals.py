"""Answers of others to the benchmark: plain least squares, plateaus as the papers fly them, a black box of sysidentpy.

Each sees one axis at a time: velocities v [m/s, rad/s] and thrust on a common time base, and no truth. Where a method
has no deviation of its own, its answer has none.
"""

from __future__ import annotations

import contextlib
import io
import math
import warnings
from collections.abc import Callable, Iterator
from typing import TypeAlias

import numpy as np

from hindrax_core.errors import UsageError
from hindrax_core.vehicle import AXES
from hindrax_ident.arrays import Array, array
from hindrax_laboratory.benchmark.answer import AxisAnswer, Pair
from hindrax_laboratory.benchmark.foreign_plants import ForeignRecord

STEP_S = 0.1
STEADY_S, STEADY = 1.0, 0.05
"""A plateau: thrust and velocity that change by less than a share of their largest for so long [-]."""
FEWEST_PLATEAUS = 4
"""Plateaus for a drag of two coefficients."""
LAGS, DEGREE, TERMS, SETTLES = 1, 3, 5, 600
"""Of the polynomial NARX model: delayed samples, degree, terms, and steps until it is called steady.

With two delays and eight terms it diverges at constant thrust, even over data without noise."""
OneAxis: TypeAlias = Callable[[Array, Array, Array, Array], AxisAnswer | None]
"""Velocity, thrust, further forces per unit (n, k), and the speeds asked (3,), to the answer; None: refused."""


def by_axis(record: ForeignRecord, method: OneAxis) -> dict[str, AxisAnswer]:
    """Answer of a method for every axis that it does not refuse; the added mass is the inertia less the body's."""
    out = {}
    for axis, (v, thrust, others) in enumerate(_axes(record)):
        found = method(v, thrust, others, record.speeds[axis])
        if found is None:
            continue
        if "inertia" in found:
            body = record.vehicle.mass_kg if axis < 3 else record.vehicle.inertia[axis - 3]
            value, std = found.pop("inertia")
            found["added_mass"] = value - body, std
        out[AXES[axis]] = found
    return out


def _axes(record: ForeignRecord) -> Iterator[tuple[Array, Array, Array]]:
    """Velocity and thrust of every axis, (n,) each; a column of ones, and what rights roll and pitch: (n, k)."""
    r = record.recording
    t = np.arange(r.velocity_t[0], r.velocity_t[-1], STEP_S)
    for axis in range(6):
        has = np.isfinite(r.velocity[:, axis])
        v = np.interp(t, r.velocity_t[has], r.velocity[has, axis])
        thrust = r.wrench[np.searchsorted(r.wrench_t, t, side="right") - 1, axis]
        others = [np.ones_like(v)]
        if axis in (3, 4):
            others.append(np.sin(np.interp(t, r.attitude_t, r.attitude[:, axis - 3])))
        yield array(v), array(thrust), array(np.stack(others, axis=1))


def _fitted(columns: Array, force: Array) -> tuple[Array, Array]:
    """Least squares: parameters (p,), and their covariance (p, p) as if the residuals were independent."""
    theta, *_ = np.linalg.lstsq(columns, force, rcond=None)
    scatter = float(np.sum((force - columns @ theta) ** 2)) / max(1, len(force) - len(theta))
    return array(theta), array(np.linalg.pinv(columns.T @ columns) * scatter)


def _drag(theta: Array, C: Array, quadratic: int, speeds: Array) -> list[Pair]:
    """Force and deviation at speeds; `quadratic`: place of k_q, before that of k_l."""
    out: list[Pair] = []
    for speed in speeds.tolist():
        g = np.zeros(len(theta))
        g[quadratic : quadratic + 2] = speed**2, speed
        out.append((float(g @ theta), math.sqrt(max(0.0, float(g @ C @ g)))))
    return out


def least_squares(v: Array, thrust: Array, others: Array, speeds: Array) -> AxisAnswer:
    """Plain: m v' + k_q |v| v + k_l v + b = thrust, with accelerations from differences.

    Parameters
    ----------
    v, thrust : (n,) [m/s, rad/s], (n,) [N, N m]
        Of one axis, evenly sampled.
    others : (n, 5) [m/s, rad/s]
        Velocities of the other axes.
    speeds : (k,) [m/s, rad/s]
        At which the drag is asked.

    Returns
    -------
    AxisAnswer
        Drag and mass with their deviations.
    """
    columns = np.column_stack([np.gradient(v, STEP_S), np.abs(v) * v, v, others])
    theta, C = _fitted(array(columns), thrust)
    inertia = float(theta[0]), math.sqrt(float(C[0, 0]))
    return {"drag": _drag(theta, C, 1, speeds), "inertia": inertia}


def plateaus(v: Array, thrust: Array, others: Array, speeds: Array) -> AxisAnswer | None:
    """Thrust against speed where both are steady, one point a plateau (COB-2023-1394); no mass follows from that.

    Parameters
    ----------
    v, thrust, others, speeds
        As of `least_squares`.

    Returns
    -------
    AxisAnswer | None
        None where there are too few plateaus, or all at one speed.
    """
    width = round(STEADY_S / STEP_S)
    most_v, most_thrust = np.percentile(np.abs(v), 98.0), np.percentile(np.abs(thrust), 98.0)
    points, index = [], 0
    while index + width <= len(v):
        part = slice(index, index + width)
        if np.ptp(thrust[part]) < STEADY * most_thrust and np.ptp(v[part]) < STEADY * most_v:
            points.append([v[part].mean(), thrust[part].mean(), *others[part].mean(axis=0)])
            index += width
        else:
            index += 1
    table = np.array(points)
    if len(table) < FEWEST_PLATEAUS + others.shape[1] or np.ptp(np.abs(table[:, 0])) < 0.3 * most_v:
        return None
    columns = np.column_stack([np.abs(table[:, 0]) * table[:, 0], table[:, 0], table[:, 2:]])
    return {"drag": _drag(*_fitted(array(columns), array(table[:, 1])), 0, speeds)}


def black_box(v: Array, thrust: Array, _others: Array, speeds: Array) -> AxisAnswer | None:
    """Polynomial NARX model by sysidentpy (FROLS); its drag is the thrust that keeps a speed. No deviations.

    Parameters
    ----------
    v, thrust, speeds
        As of `least_squares`.
    _others
        It does not ask.

    Returns
    -------
    AxisAnswer | None
        None where it finds no model that keeps the speeds.

    Raises
    ------
    UsageError
        Where sysidentpy is not installed.
    """
    try:
        from sysidentpy.basis_function import Polynomial  # noqa: PLC0415  # an extra
        from sysidentpy.model_structure_selection import FROLS  # noqa: PLC0415
    except ImportError as error:
        raise UsageError(
            'needs the package `sysidentpy`, which is not installed here; pip install "hindrax[benchmark]"'
        ) from error
    most_v, most = float(np.abs(v).max()), float(np.abs(thrust).max())
    y, x = (v / most_v).reshape(-1, 1), (thrust / most).reshape(-1, 1)
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        lags = list(range(1, LAGS + 1))
        model = FROLS(
            n_terms=TERMS, order_selection=False, ylag=lags, xlag=lags, basis_function=Polynomial(degree=DEGREE)
        )
        model.fit(X=x, y=y)
        steady = []
        for level in np.linspace(0.02, 1.0, 25).tolist():
            u = np.full((SETTLES, 1), level)
            try:
                end = float(model.predict(X=u, y=np.zeros((LAGS, 1)))[-1, 0])
            except (ValueError, OverflowError):
                end = math.nan
            steady.append((end, level))
    known = np.array([one for one in steady if math.isfinite(one[0]) and abs(one[0]) < 2.0])
    wanted = speeds / most_v
    if len(known) < 3 or np.any(np.diff(known[:, 0]) <= 0.0) or wanted[-1] > known[-1, 0]:
        return None
    return {"drag": [(most * float(np.interp(one, *known.T)), None) for one in wanted.tolist()]}
