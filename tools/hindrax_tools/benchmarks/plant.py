"""Speed of the mock's plant, beside the same law written with numpy as simulators usually write it."""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hindrax_bringup.share_files import default_vehicle
from hindrax_core.vehicle import AXES, Vehicle, load_vehicle
from hindrax_sim.physics.plant import Plant
from hindrax_sim.physics.thruster import wrench_per_newton
from hindrax_tools.benchmarks import median_us, row

DT_S = 0.004
PULSES = (1600.0, 1600.0, 1450.0, 1450.0, 1550.0, 1530.0, 1550.0, 1530.0)
STEPS, REPEATS = 500, 15

Array = NDArray[np.float64]


def rows() -> list[dict[str, object]]:
    """One row: name, ours_us, peer, peer_us, ratio. Medians over repeats, both in the same run."""
    vehicle = load_vehicle(default_vehicle())
    ours, peer = (median_us(partial(step, DT_S), STEPS, REPEATS) for step in (_scalar(vehicle), _arrays(vehicle)))
    return [row("6-DOF plant step, Euler", ours, "numpy 6-DOF Euler", peer)]


def _scalar(vehicle: Vehicle) -> Callable[[float], None]:
    plant = Plant(vehicle)
    plant.place((0.0, 0.0, 5.0), (0.0, 0.0, 0.0))
    plant.drive(PULSES)
    return plant.step


def _arrays(vehicle: Vehicle) -> Callable[[float], None]:
    """Fossen's equations in matrices and vectors, with thrusters, lag, restoring and z-y-x angles."""
    hydrodynamics = vehicle.hydrodynamics
    assert hydrodynamics is not None
    mass = np.diag([vehicle.mass_kg] * 3 + list(vehicle.inertia)) + np.diag(hydrodynamics.added_mass)
    inverse = np.linalg.inv(mass)
    B = np.array([wrench_per_newton(vehicle, thruster) for thruster in vehicle.thrusters]).T
    quadratic = np.array([hydrodynamics.drag(axis).k_q for axis in AXES])
    linear = np.array([hydrodynamics.drag(axis).k_l for axis in AXES])
    level = np.array(vehicle.center_of_buoyancy_m) - np.array(vehicle.center_of_mass_m)
    wanted = np.array([4.0, 4.0, -3.0, -3.0, 2.0, 1.0, 2.0, 1.0])
    lag_s = vehicle.thrusters[0].lag_s
    state: dict[str, Array] = {"eta": np.zeros(6), "nu": np.zeros(6), "force": np.zeros(8)}

    def step(dt: float) -> None:
        eta, nu = state["eta"], state["nu"]
        force = state["force"] + dt / lag_s * (wanted - state["force"])
        turn = _rotation(eta[3:])
        momentum = mass @ nu
        swirl = np.cross(nu[3:], momentum[3:]) + np.cross(nu[:3], momentum[:3])
        coriolis = np.concatenate([np.cross(nu[3:], momentum[:3]), swirl])
        sink = (vehicle.weight_N - vehicle.buoyancy_N) * turn[2]
        restoring = np.concatenate([sink, -vehicle.buoyancy_N * np.cross(level, turn[2])])
        drag = (quadratic * np.abs(nu) + linear) * nu
        nu = nu + dt * (inverse @ (B @ force - coriolis - drag + restoring))
        rates = np.linalg.solve(_angle_rates(eta[3:]), nu[3:])
        state["eta"] = eta + dt * np.concatenate([turn @ nu[:3], rates])
        state["nu"], state["force"] = nu, force

    return step


def _rotation(angles: Array) -> Array:
    """Rotation body to north-east-down: (3, 3) [-]. Fossen 2011, eq. 2.18."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles), np.sin(angles)
    surge = [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr]
    sway = [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr]
    return np.array([surge, sway, [-sp, cp * sr, cp * cr]])


def _angle_rates(angles: Array) -> Array:
    """Body rates per rate of roll, pitch, yaw: (3, 3) [-]. Fossen 2011, eq. 2.27."""
    (cr, cp, _), (sr, sp, _) = np.cos(angles), np.sin(angles)
    return np.array([[1.0, 0.0, -sp], [0.0, cr, cp * sr], [0.0, -sr, cp * cr]])
