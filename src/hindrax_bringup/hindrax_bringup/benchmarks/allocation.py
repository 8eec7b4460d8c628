"""Speed of allocation and curve inverse, beside what others use for the same."""

from __future__ import annotations

import statistics
import timeit
from collections.abc import Callable
from typing import Any

import numpy as np
import quadprog
from scipy.optimize import brentq, lsq_linear

from hindrax_bringup.vehicles import default_vehicle
from hindrax_control.allocation import Allocator
from hindrax_control.curve import thrust_curves
from hindrax_core.readings import Vec6
from hindrax_core.vehicle import Vehicle, load_vehicle

WRENCHES = 200
REPEATS = 25
SEED = 1
EFFORT = 1e-6


def rows() -> list[dict[str, Any]]:
    """One row per figure and peer: name, ours_us, peer, peer_us, ratio. Medians over repeats."""
    vehicle = load_vehicle(default_vehicle())
    return [*_allocation(vehicle), *_inverse(vehicle)]


def _allocation(vehicle: Vehicle) -> list[dict[str, Any]]:
    """Wrench to forces, feasible and infeasible ones mixed as in flight with heavy demands (one in four too large)."""
    allocator = Allocator(vehicle)
    wrenches = _wrenches(allocator)
    B = allocator.B
    limit = np.array([curve.range_N for curve in thrust_curves(vehicle)])
    inverse = np.linalg.pinv(B)
    stacked = np.vstack([B, EFFORT * np.eye(B.shape[1])])
    hessian = B.T @ B + EFFORT**2 * np.eye(B.shape[1])
    walls = np.hstack([np.eye(B.shape[1]), -np.eye(B.shape[1])])
    bounds = np.concatenate([limit[:, 0], -limit[:, 1]])
    padding = np.zeros(B.shape[1])
    ours = _median_us(allocator.forces, wrenches)
    peers: dict[str, Callable[[Vec6], Any]] = {
        "numpy pinv + clip (not exact)": lambda wrench: np.clip(inverse @ np.array(wrench), limit[:, 0], limit[:, 1]),
        "quadprog": lambda wrench: quadprog.solve_qp(hessian, B.T @ np.array(wrench), walls, bounds),
        "scipy lsq_linear bvls": lambda wrench: lsq_linear(
            stacked, np.concatenate([wrench, padding]), (limit[:, 0], limit[:, 1]), method="bvls"
        ),
    }
    return [_row("allocation, 8 thrusters", ours, name, _median_us(call, wrenches)) for name, call in peers.items()]


def _wrenches(allocator: Allocator) -> list[Vec6]:
    rng = np.random.default_rng(SEED)
    spread = np.array([allocator.reach(axis, 1.0) for axis in ("surge", "sway", "heave", "roll", "pitch", "yaw")])
    found = []
    for _ in range(WRENCHES):
        X, Y, Z, K, M, N = (float(value) for value in rng.normal(size=6) * spread * 0.16)
        found.append((X, Y, Z, K, M, N))
    return found


def _inverse(vehicle: Vehicle) -> list[dict[str, Any]]:
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
        found = []
        for force in forces:
            roots = np.roots([c4, c3, c2, c1 + abs(force)])
            found.append(next(float(r.real) for r in roots if branch.from_us <= r.real <= branch.to_us))
        return found

    def by_brentq(forces: tuple[float, ...]) -> list[float]:
        ends = branch.from_us, branch.to_us
        return [brentq(lambda pulse, force=force: branch.force_N(pulse) + abs(force), *ends) for force in forces]

    ours = _median_us(lambda eight: [pulse(force) for pulse, force in eight], pairs)
    name = "curve inverse, 8 thrusters"
    return [
        _row(name, ours, "scipy brentq", _median_us(by_brentq, sets)),
        _row(name, ours, "numpy roots", _median_us(by_roots, sets)),
    ]


def _median_us(call: Callable[[Any], Any], arguments: list[Any]) -> float:
    """Median over repeats of the mean time of one call over all arguments [us]."""

    def one_pass() -> None:
        for argument in arguments:
            call(argument)

    return statistics.median(timeit.repeat(one_pass, number=1, repeat=REPEATS)) / len(arguments) * 1e6


def _row(name: str, ours_us: float, peer: str, peer_us: float) -> dict[str, Any]:
    return {"name": name, "ours_us": ours_us, "peer": peer, "peer_us": peer_us, "ratio": peer_us / ours_us}
