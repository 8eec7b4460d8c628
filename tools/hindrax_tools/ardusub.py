"""A heavy BlueROV2 on ArduSub, flown by hand: its outputs and its motion, with the axes decoupled."""

import math
from collections.abc import Iterator

import numpy as np

from hindrax_bringup.share_files import share_folder
from hindrax_control.allocation.thrust_curve import thrust_curves
from hindrax_core.vehicle import AXES, load_vehicle

HEAVY = share_folder("vehicles") / "bluerov2-heavy.yaml"
MOTORS = np.array([
    (0, 0, 1, 0, -1, 1), (0, 0, -1, 0, -1, -1), (0, 0, -1, 0, 1, 1), (0, 0, 1, 0, 1, -1),
    (1, -1, 0, -1, 0, 0), (-1, -1, 0, -1, 0, 0), (1, 1, 0, -1, 0, 0), (-1, 1, 0, -1, 0, 0),
])  # fmt: skip
"""Roll, pitch, yaw, throttle (up), forward, lateral of motors 1 to 8: AP_Motors6DOF.cpp, SUB_FRAME_VECTORED_6DOF."""
COLUMNS = {"surge": 4, "sway": 5, "heave": 3, "yaw": 2}
"""Column of `MOTORS` of each axis that is flown, round after round."""
GAINS = {"surge": math.sqrt(0.5), "sway": math.sqrt(0.5), "heave": -1.0, "yaw": math.sqrt(0.5) * (0.156 + 0.111)}
"""Force or moment of a newton of each motor, SNAME."""
STEP_S, PHYSICS_S, PUSH_S = 0.05, 0.005, 3.0
STICKS = (0.5, -0.5, 0.25, -0.25, -0.4, 0.4)


def outputs(axis: str, stick: float) -> list[int]:
    """Pulses of the eight motors [us] for a stick of -1 to 1; the stick of heave is positive upward."""
    return [round(1500.0 + 400.0 * stick * motor) for motor in MOTORS[:, COLUMNS[axis]]]


def flight(seconds: float) -> Iterator[tuple[list[int], dict[str, float]]]:
    """Pulses of the motors [us], and the velocity of each axis in SNAME [m/s, rad/s], every `STEP_S`."""
    vehicle = load_vehicle(HEAVY)
    curve, water = thrust_curves(vehicle)[0], vehicle.hydrodynamics
    assert water is not None
    added = dict(zip(AXES, water.added_mass, strict=True))
    inertia = {name: added[name] + (vehicle.inertia[2] if name == "yaw" else vehicle.mass_kg) for name in COLUMNS}
    speeds = dict.fromkeys(COLUMNS, 0.0)
    for step in range(round(seconds / STEP_S)):
        axes, push = divmod(int(step * STEP_S / PUSH_S), len(STICKS))
        pulses = outputs(list(COLUMNS)[axes % len(COLUMNS)], STICKS[push])
        yield pulses, dict(speeds)
        forces = np.array([curve.force(pulse) for pulse in pulses])
        for name, column in COLUMNS.items():
            force = GAINS[name] * float(forces @ MOTORS[:, column]) - (
                vehicle.net_buoyancy_N if name == "heave" else 0.0
            )
            drag = getattr(water, name)
            for _ in range(round(STEP_S / PHYSICS_S)):
                v = speeds[name]
                speeds[name] += PHYSICS_S * (force - drag.k_q * abs(v) * v - drag.k_l * v) / inertia[name]
