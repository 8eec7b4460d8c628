"""Allocation keeps its order for every demand: against linear programs over the forces themselves, one per priority.

The allocator works on facets and two parts; the reference knows neither. It hands HiGHS the forces as unknowns, and
the priorities as two programs, one after the other.
"""

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import block_diag

from hindrax_control.allocation.allocator import AllocationKnobs, Allocator
from hindrax_control.allocation.bounded_allocation import AttainableSet, facets
from hindrax_control.allocation.effectiveness import ThrusterLayout, effectiveness, served_axes
from hindrax_control.allocation.thrust_curve import thrust_curves
from hindrax_core.readings import Vec3
from hindrax_core.testing import THOROUGH
from hindrax_core.vehicle import Vehicle, load_vehicle

HINDRAX = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup" / "vehicles" / "hindrax.yaml")
TOP = 15.5283
# The slack of 1e-9 N, where one newton of the first priority costs 1e4 of the second; rounding a pulse costs 0.03 N.
EXACT_N = 1e-4
DEMANDS = 100_000 if THOROUGH else 3_000
AT_ONCE = 60  # demands in one program: HiGHS takes longer than in proportion for more
ORDERS = ((2, 2, 1, 1, 1, 1), (2, 2, 1, 1, 1, 1), (1, 1, 1, 1, 1, 1), (1, 2, 2, 1, 1, 2), (1, 1, 2, 2, 2, 2))


def vehicle_of(poses: list[tuple[Vec3, float, float]]) -> Vehicle:
    """A vehicle with thrusters at these positions, azimuths and elevations."""
    thrusters = [
        replace(HINDRAX.thrusters[index], position_m=position, azimuth_deg=azimuth, elevation_deg=elevation)
        for index, (position, azimuth, elevation) in enumerate(poses)
    ]
    return replace(HINDRAX, thrusters=tuple(thrusters), center_of_mass_m=(0.0, 0.0, 0.0))


# Eight thrusters at the corners of a box, askew: both patterns without wrench take all of them.
CUBE = [((0.3 * x, 0.2 * y, 0.15 * z), -45.0 * x * y, 35.0 * x * z) for x, y, z in product((-1, 1), repeat=3)]
# Four at 45 degrees and two vertical ones: no pitch.
SIX = [((0.15 * x, 0.1 * y, 0.0), -45.0 * x * y, 0.0) for x, y in product((-1, 1), repeat=2)]
SIX += [((0.0, 0.1, 0.0), 0.0, -90.0), ((0.0, -0.1, 0.0), 0.0, -90.0)]
# Eight as nobody would mount them: every thruster has another share in both patterns.
ASKEW = [
    ((0.3, 0.1, -0.1), 20.0, 35.0), ((-0.2, 0.25, 0.05), -75.0, 10.0), ((0.05, -0.3, 0.2), 140.0, -50.0),
    ((-0.3, -0.1, 0.1), 65.0, 70.0), ((0.2, 0.2, 0.15), -130.0, 25.0), ((0.1, -0.15, -0.2), 5.0, -80.0),
    ((-0.15, 0.3, -0.05), 170.0, -15.0), ((-0.05, -0.2, 0.3), -40.0, 60.0),
]  # fmt: skip
VEHICLES = {"hindrax": HINDRAX, "cube": vehicle_of(CUBE), "six": vehicle_of(SIX), "askew": vehicle_of(ASKEW)}


def split(
    wrenches: NDArray[np.float64], priority: tuple[int, int, int, int, int, int], served: tuple[int, ...]
) -> NDArray[np.float64]:
    """Both priorities of each wrench (2, n, 6), as the levels of the served axes say; lost axes are in none."""
    levels = sorted({priority[axis] for axis in served})
    mine = [[axis in served and priority[axis] == level for axis in range(6)] for level in (*levels, None)[:2]]
    return np.array([np.where(group, wrenches, 0.0) for group in mine])


def largest(
    B_used: NDArray[np.float64], limits: NDArray[np.float64], parts: NDArray[np.float64], floor_N: float | None = None
) -> NDArray[np.float64]:
    """Largest size [N, N m] of the first part (n,), or of the second where the first has at least its floor."""
    n, m = parts.shape[1], B_used.shape[1]
    lengths = np.linalg.norm(parts, axis=2)
    units = np.divide(parts, lengths[:, :, None], where=lengths[:, :, None] > 0.0, out=np.zeros_like(parts))
    blocks = [np.column_stack([B_used, -units[0, i], -units[1, i]]) for i in range(n)]
    own = np.column_stack([limits, limits])[:, :2]
    bounds = np.array([[*own, (0.0, lengths[0, i]), (0.0, lengths[1, i])] for i in range(n)])
    wanted = m if floor_N is None else m + 1
    if floor_N is not None:
        bounds[:, m, 0] = np.clip(floor_N, 0.0, lengths[0])
    cost = np.zeros((n, m + 2))
    cost[:, wanted] = -1.0
    matrix: Any = block_diag(blocks)  # the stubs know no sparse one
    found = linprog(
        cost.ravel(),
        A_eq=matrix,
        b_eq=np.zeros(6 * n),
        bounds=[(low, high) for low, high in bounds.reshape(-1, 2).tolist()],
        method="highs-ds",
        options={"presolve": False, "primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    assert found.status == 0, found.message
    assert found.x is not None
    return found.x.reshape(n, m + 2)[:, wanted]


def inexact(
    B_used: NDArray[np.float64],
    limits: NDArray[np.float64],
    priority: tuple[int, int, int, int, int, int],
    wrenches: NDArray[np.float64],
    forces: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Which allocations (n, m) of wrenches (n, 6) leave their limits, bend a direction, or could have more."""
    served = served_axes(B_used)
    mine = np.where(np.isin(np.arange(6), served)[:, None], B_used, 0.0)
    parts = split(wrenches, priority, served)
    lengths = np.linalg.norm(parts, axis=2)
    units = np.divide(parts, lengths[:, :, None], where=lengths[:, :, None] > 0.0, out=np.zeros_like(parts))
    had = forces @ mine.T
    sizes = np.einsum("gni,ni->gn", units, had)
    bent = np.max(np.abs(had - np.einsum("gn,gni->ni", sizes, units)), axis=1)
    outside = np.max(np.maximum(limits[:, 0] - forces, forces - limits[:, 1]), axis=1, initial=0.0)
    too_much = np.max(np.maximum(-sizes, sizes - lengths * (1.0 + 1e-12)), axis=0)
    first = largest(mine, limits, parts)
    second = largest(mine, limits, parts, np.minimum(sizes[0], first) - 1e-10)
    missing = np.maximum(first - sizes[0], second - sizes[1])
    worst: NDArray[np.float64] = np.max([bent, outside, too_much, missing], axis=0)
    return worst > EXACT_N


def structured(
    rng: np.random.Generator, B_used: NDArray[np.float64], limits: NDArray[np.float64], count: int
) -> NDArray[np.float64]:
    """Demands with axes zero, equal, on the limits of an axis, on faces and corners, tiny, and far too large."""
    reach = np.abs(B_used) @ np.max(np.abs(limits), axis=1)
    sizes = rng.uniform(0.1, 3.0, (count, 1))
    random = rng.normal(size=(count, 6)) * reach
    kinds = (0.0, 10.0 * sizes, sizes * reach, reach, random, 1e-11, 500.0 * sizes)
    per_axis = np.array([np.broadcast_to(kind, (count, 6)) for kind in kinds])
    chosen = rng.choice(len(per_axis), p=[0.4, 0.15, 0.1, 0.1, 0.15, 0.05, 0.05], size=(count, 6))
    axes = np.take_along_axis(per_axis, chosen[None], axis=0)[0] * rng.choice([-1.0, 1.0], (count, 6))
    ends = np.stack([limits[:, 0], limits[:, 1], np.zeros(len(limits)), 0.5 * limits[:, 1]])
    corners = np.take_along_axis(ends, rng.choice(4, p=[0.4, 0.4, 0.1, 0.1], size=(count, len(limits))), axis=0)
    near = rng.choice([0.5, 1.0 - 1e-12, 1.0, 1.0 + 1e-12, 1.0 + 1e-7, 1.5, 40.0, 1e9], (count, 1))
    return np.where(rng.random((count, 1)) < 0.6, axes, corners @ B_used.T * near)


def some_out(rng: np.random.Generator, thrusters: int) -> list[Any]:
    """Indices of those in use: usually all, sometimes with up to five out."""
    out = rng.choice([0, 0, 1, 2, 3, 5])
    return sorted(rng.permutation(thrusters)[: max(1, thrusters - out)].tolist())


def test_facets_are_the_sums_of_as_few_thrusters_as_can_be_that_no_pattern_changes() -> None:
    patterns = np.random.default_rng(2).standard_normal((6, 2))
    rows = facets(patterns)
    assert len(rows) == 20, "each three of six"
    assert rows @ patterns == pytest.approx(np.zeros((20, 2)), abs=1e-9)
    assert np.count_nonzero(rows, axis=1).tolist() == [3] * 20
    assert np.max(rows, axis=1) == pytest.approx(np.ones(20))
    assert np.max(np.abs(rows), axis=1) == pytest.approx(np.ones(20))
    # The third is in no pattern: it alone, found twice, and the first two together.
    assert facets(np.array([[1.0], [-1.0], [0.0]])) == pytest.approx(np.array([[0.0, 0.0, 1.0], [1.0, 1.0, 0.0]]))
    assert facets(np.zeros((2, 0))) == pytest.approx(np.eye(2))


@pytest.mark.parametrize("name", VEHICLES)
def test_every_demand_gets_the_largest_part_in_order(name: str) -> None:
    rng = np.random.default_rng(sum(map(ord, name)))
    vehicle = VEHICLES[name]
    B_all, names = effectiveness(vehicle), [thruster.name for thruster in vehicle.thrusters]
    allocators = {order: Allocator(vehicle, AllocationKnobs(priority=order)) for order in ORDERS}
    limits_N = np.array([curve.range_N for curve in thrust_curves(vehicle)])
    wrong = []
    for turn in range(DEMANDS // len(VEHICLES) // AT_ONCE):
        order = ORDERS[turn % len(ORDERS)]
        used = some_out(rng, len(names))
        out = frozenset(names) - {names[index] for index in used}
        wrenches = structured(rng, B_all[:, used], limits_N[used], AT_ONCE)
        forces = np.array([allocators[order].forces(tuple(wrench), out) for wrench in wrenches.tolist()])
        assert not forces[:, [index for index in range(len(names)) if index not in used]].any()
        missed = inexact(B_all[:, used], limits_N[used], order, wrenches, forces[:, used])
        wrong += [(order, sorted(out), tuple(wrench)) for wrench in wrenches[missed].tolist()]
    assert wrong == []


@pytest.mark.parametrize("name", VEHICLES)
def test_limits_may_differ_and_be_zero(name: str) -> None:
    rng = np.random.default_rng(len(name))
    B_all = effectiveness(VEHICLES[name])
    wrong = []
    for turn in range(DEMANDS // len(VEHICLES) // AT_ONCE):
        order = ORDERS[turn % len(ORDERS)]
        used = some_out(rng, B_all.shape[1])
        limits = rng.choice([0.5, 4.0, 20.0, TOP], (len(used), 2)) * [-1.0, 1.0]
        limits[rng.random(limits.shape) < 0.1] = 0.0
        mine = ThrusterLayout(B_all, used, order)
        attainable = AttainableSet(mine, limits.tolist())
        wrenches = structured(rng, B_all[:, used], limits, AT_ONCE)
        found = [attainable.fitted(attainable.forces(wrench)) for wrench in wrenches]
        assert [wrench for wrench, (_, exact) in zip(wrenches.tolist(), found, strict=True) if not exact] == []
        missed = inexact(B_all[:, used], limits, order, wrenches, np.array([forces for forces, _ in found]))
        wrong += [(order, used, limits.tolist(), tuple(wrench)) for wrench in wrenches[missed].tolist()]
    assert wrong == []


@pytest.mark.parametrize("name", VEHICLES)
def test_forces_within_limits_stay_and_those_that_no_pattern_brings_there_are_reported(name: str) -> None:
    rng = np.random.default_rng(3)
    B_all = effectiveness(VEHICLES[name])
    limits = np.array([(-4.0, 5.0)] * B_all.shape[1])
    attainable = AttainableSet(ThrusterLayout(B_all, range(len(limits)), ORDERS[0]), limits.tolist())
    for _ in range(50):
        inside = rng.uniform(*limits.T)
        forces, exact = attainable.fitted(inside.tolist())
        assert exact
        assert forces == pytest.approx(inside)
        beyond = np.linalg.pinv(B_all) @ B_all @ np.where(inside > 0.0, 5.0, -4.0)
        beyond *= 1.02 / np.max(beyond / np.where(beyond > 0.0, 5.0, -4.0))
        forces, exact = attainable.fitted(beyond.tolist())
        reached = bool(np.max(np.abs(B_all @ np.array(forces) - B_all @ beyond)) < 1e-5)
        assert exact is reached
