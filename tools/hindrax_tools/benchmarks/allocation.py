"""Speed of allocation and curve inverse, compared with general solvers."""

from collections.abc import Callable
from typing import Any

import daqp
import numpy as np
import quadprog
from scipy.linalg import null_space
from scipy.optimize import brentq, linprog, lsq_linear

from hindrax_bringup.share_files import default_vehicle
from hindrax_control.allocation.allocator import Allocator
from hindrax_control.allocation.effectiveness import Matrix
from hindrax_control.allocation.thrust_curve import thrust_curves
from hindrax_core.errors import HindraxError
from hindrax_core.readings import Vec6
from hindrax_core.vehicle import AXES, Vehicle, load_vehicle
from hindrax_tools.benchmarks import median_us, row

WRENCHES = 200
REPEATS = 25
SEED = 1
EXACT_N = 0.01
"""Further off than this [N, N m] is not exact: what the grading of a quadratic program leaves is below."""

GRADING = (3e-3, 1e-4, 3e-6)
"""Weight of the first part, of the second, and of forces without wrench, against one of the direction."""


def rows() -> list[dict[str, object]]:
    """One row per figure and peer: name, ours_us, peer, peer_us, ratio. Medians over repeats."""
    vehicle = load_vehicle(default_vehicle())
    return [*_allocation(vehicle), *_inverse(vehicle)]


def _allocation(vehicle: Vehicle) -> list[dict[str, object]]:
    """Wrench to forces; with each the count of demands whose wrench is not the best in order of priority."""
    allocator = Allocator(vehicle)
    wrenches = _wrenches(allocator)
    peers = _Peers(allocator.B, np.array([curve.range_N for curve in thrust_curves(vehicle)]))
    best = [peers.best(wrench) for wrench in wrenches]

    def figures(call: Callable[[Vec6], object]) -> tuple[float, int]:
        off = [np.max(np.abs(allocator.B @ np.array(call(w)) - it)) for w, it in zip(wrenches, best, strict=True)]
        return _pass_us(call, wrenches), sum(not one <= EXACT_N for one in off)

    ours_us, ours_inexact = figures(allocator.forces)
    found = []
    for name, call in (
        ("numpy pinv + clip", peers.clipped),
        ("DAQP", peers.by_daqp),
        ("quadprog", peers.by_quadprog),
        ("scipy lsq_linear bvls", peers.by_lsq_linear),
    ):
        peer_us, inexact = figures(call)
        ours_name = f"allocation, 8 thrusters ({ours_inexact} of {WRENCHES} not exact)"
        compared = row(ours_name, ours_us, f"{name} ({inexact} of {WRENCHES} not exact)", peer_us)
        found.append(compared | {"demands": WRENCHES, "inexact": ours_inexact, "peer_inexact": inexact})
    return found


def _wrenches(allocator: Allocator) -> list[Vec6]:
    """Demands of a flight: one axis driven, one in four out of reach, the others at zero or corrected a little."""
    rng = np.random.default_rng(SEED)
    reach = np.array([allocator.reach(axis, 1.0) for axis in AXES])
    found = []
    for _ in range(WRENCHES):
        wanted = 0.02 * reach * rng.normal(size=6) * rng.integers(2)
        driven = rng.integers(6)
        wanted[driven] = reach[driven] * rng.uniform(-4.0, 4.0) / 3.0
        X, Y, Z, K, M, N = wanted.tolist()
        found.append((X, Y, Z, K, M, N))
    return found


class _Peers:
    """The same problem for general solvers: the priorities graded into one quadratic over x = (eight forces, s).

    s holds the sizes [N, N m] of both parts of the wrench along their directions.
    """

    def __init__(self, B: Matrix, limits_N: Matrix) -> None:
        self._B, self._limits_N = B, limits_N
        self._pseudo_inverse = np.linalg.pinv(B)
        free = null_space(B).T
        self._rows = np.zeros((8 + len(free), 10))
        self._rows[:6, :8] = B
        self._rows[6:8, 8:] = np.diag(GRADING[:2])
        self._rows[8:, :8] = GRADING[2] * free

    def best(self, wrench: Vec6) -> Matrix:
        """Wrench (6,) [N, N m] that is best in order of priority, by two linear programs in sequence."""
        directions, sizes = _parts(wrench)
        bounds = [*self._limits_N.tolist(), (0.0, sizes[0]), (0.0, sizes[1])]
        balance = np.hstack([self._B, -directions])
        for size in (8, 9):
            program = linprog(-np.eye(10)[size], A_eq=balance, b_eq=np.zeros(6), bounds=bounds)
            if program.x is None:
                raise HindraxError(f"reference for {wrench}: {program.message}")
            bounds[size] = (max(0.0, program.x[size] - 1e-9), sizes[size - 8])
            found: Matrix = directions @ program.x[8:]
        return found

    def clipped(self, wrench: Vec6) -> Matrix:
        """Least forces (8,) [N], clipped at the limits."""
        return np.asarray(np.clip(self._pseudo_inverse @ np.array(wrench), *self._limits_N.T))

    def by_daqp(self, wrench: Vec6) -> Matrix:
        """Forces (8,) [N] by DAQP; the count of demands checks its flag."""
        rows, wanted, bounds = self._problem(wrench)
        none, senses = np.zeros((0, 10)), np.zeros(10, dtype=np.int32)
        return np.asarray(daqp.solve(rows.T @ rows, -rows.T @ wanted, none, *bounds[::-1], senses)[0][:8])

    def by_quadprog(self, wrench: Vec6) -> Matrix:
        """Forces (8,) [N] by the method of Goldfarb and Idnani."""
        rows, wanted, bounds = self._problem(wrench)
        walls = np.hstack([np.eye(10), -np.eye(10)])
        ends = np.concatenate([bounds[0], -bounds[1]])
        return np.asarray(quadprog.solve_qp(rows.T @ rows, rows.T @ wanted, walls, ends)[0][:8])

    def by_lsq_linear(self, wrench: Vec6) -> Matrix:
        """Forces (8,) [N] by the method of Stark and Parker."""
        rows, wanted, bounds = self._problem(wrench)
        return np.asarray(lsq_linear(rows, wanted, (bounds[0], bounds[1] + 1e-12), method="bvls").x[:8])

    def _problem(self, wrench: Vec6) -> tuple[Matrix, Matrix, Matrix]:
        """Weighted rows (r, 10), right side (r,) and bounds (2, 10) [N, N m] of the least-squares problem in x."""
        directions, sizes = _parts(wrench)
        rows, wanted = self._rows, np.zeros(len(self._rows))
        rows[:6, 8:] = -directions
        wanted[6:8] = np.multiply(GRADING[:2], sizes)
        bounds = np.zeros((2, 10))
        bounds[:, :8], bounds[1, 8:] = self._limits_N.T, sizes
        return rows, wanted, bounds


def _parts(wrench: Vec6) -> tuple[Matrix, Matrix]:
    """Directions (6, 2) and sizes (2,) [N, N m] of both priorities of a wrench."""
    parts = np.zeros((6, 2))
    parts[2:, 0], parts[:2, 1] = wrench[2:], wrench[:2]
    sizes = np.linalg.norm(parts, axis=0)
    return parts / np.maximum(sizes, 1e-300), sizes


def _inverse(vehicle: Vehicle) -> list[dict[str, object]]:
    """Force to pulse for eight thrusters."""
    curves = thrust_curves(vehicle)
    rng = np.random.default_rng(SEED)
    sets = [
        tuple(float(force) for force in rng.uniform(1.3, 15.0, 8) * rng.choice([-1.0, 1.0], 8)) for _ in range(WRENCHES)
    ]
    pairs = [tuple(zip([curve.pulse for curve in curves], forces, strict=True)) for forces in sets]
    branch = vehicle.curves[vehicle.thrusters[0].curve].negative
    c1, c2, c3, c4 = branch.c

    def by_roots(forces: tuple[float, ...]) -> list[float]:
        found = [np.roots([c4, c3, c2, c1 + abs(force)]) for force in forces]
        return [next(float(r.real) for r in roots if branch.from_us <= r.real <= branch.to_us) for roots in found]

    def by_brentq(forces: tuple[float, ...]) -> list[float]:
        ends = branch.from_us, branch.to_us
        return [brentq(lambda pulse, force=force: branch.force_N(pulse) + abs(force), *ends) for force in forces]

    ours = _pass_us(lambda eight: [pulse(force) for pulse, force in eight], pairs)
    name = "curve inverse, 8 thrusters"
    return [
        row(name, ours, "scipy brentq", _pass_us(by_brentq, sets)),
        row(name, ours, "numpy roots", _pass_us(by_roots, sets)),
    ]


def _pass_us(call: Callable[[Any], Any], arguments: list[Any]) -> float:
    """Median over repeats of the mean time of one call over all arguments [us]."""

    def one_pass() -> None:
        for argument in arguments:
            call(argument)

    return median_us(one_pass, 1, REPEATS) / len(arguments)
