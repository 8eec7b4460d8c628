"""A Python file that needs numpy alone: the identified vehicle as a function and as a small simulation.

The file stands on its own: it is written, not imported. Its signs are those of Fossen's equation
M v' + C(v) v + D(v) v + g(eta) = tau with M = M_RB + M_A, everything on the left positive when it resists, SNAME axes,
about the center of mass: there the mass of the body is diagonal, and the identified numbers stand as they are.

Every function is free of side effects and of branches on values, so with `jax.numpy` in the place of numpy it can be
traced, differentiated and mapped over many vehicles.
"""

import numpy as np

from hindrax_analysis.exports.export_model import ExportModel, header, thrust_range_N
from hindrax_control.allocation.effectiveness import effectiveness
from hindrax_core.vehicle import AXES
from hindrax_ident.arrays import Array
from hindrax_ident.model.motion_model import weights_across

CONVENTIONS = (
    "SNAME body axes: x forward, y starboard, z down; velocity u v w p q r of the center of mass, wrench X Y Z K M N.",
    "M v' + C(v) v + D(v) v + g(attitude) = tau. Drag and added mass are positive: they resist.",
    "Needs numpy (or jax: replace the import). `python THIS_FILE` prints a step response.",
)

BODY = '''
import numpy as np

MASS_kg = {mass}
WEIGHT_N = {weight}
BUOYANCY_N = {buoyancy}
CENTER_OF_BUOYANCY_m = np.array({center_of_buoyancy})  # from the center of mass
INERTIA_kgm2 = np.diag(np.array({inertia}))

THRUSTERS = {thrusters}
THRUST_RANGE_N = np.array({thrust_range})  # weakest, strongest
THRUST_LAG_s = np.array({lag})
EFFECTIVENESS = np.array({effectiveness})  # wrench of one newton of each thruster, one column each

ADDED_MASS = np.array({added_mass})
QUADRATIC = np.array({quadratic})  # rows: motion forward, motion backward
LINEAR = np.array({linear})
ACROSS = np.array({across})  # drag by the speed across each axis, k_w
OTHERS = np.array({others})  # what the velocities of all axes count in that speed, a row for each axis


def skew(vector):
    """Matrix of the cross product with a vector."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


RIGID_BODY_MASS = np.block([[MASS_kg * np.eye(3), np.zeros((3, 3))], [np.zeros((3, 3)), INERTIA_kgm2]])
MASS = RIGID_BODY_MASS + ADDED_MASS
INVERSE_MASS = np.linalg.inv(MASS)


def drag(velocity):
    """D(v) v: six forces and moments that resist the velocity."""
    velocity = np.asarray(velocity, dtype=float)
    backward = (velocity < 0.0).astype(int)
    axis, speed = np.arange(6), np.abs(velocity)
    whole = np.sqrt(velocity**2 + OTHERS**2 @ velocity**2 + 1e-18)  # a slope at rest, too
    return (QUADRATIC[backward, axis] * speed + LINEAR[backward, axis] + ACROSS * (whole - speed)) * velocity


def coriolis(velocity):
    """C(v) (6, 6) of the whole mass matrix, skew-symmetric: it does no work."""
    momentum = 0.5 * (MASS + MASS.T) @ velocity
    force, moment = -skew(momentum[:3]), -skew(momentum[3:])
    return np.block([[np.zeros((3, 3)), force], [force, moment]])


def restoring(roll, pitch):
    """g: what weight and buoyancy ask of the thrusters at this attitude."""
    down = np.array([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])
    moment = np.cross(CENTER_OF_BUOYANCY_m, BUOYANCY_N * down)
    return np.concatenate(((BUOYANCY_N - WEIGHT_N) * down, moment))


def acceleration(velocity, attitude, wrench):
    """v' for a velocity (6), an attitude (roll, pitch, yaw) and a wrench (6)."""
    velocity = np.asarray(velocity, dtype=float)
    resistance = coriolis(velocity) @ velocity + drag(velocity) + restoring(attitude[0], attitude[1])
    return INVERSE_MASS @ (np.asarray(wrench, dtype=float) - resistance)


def attitude_rate(attitude, velocity):
    """Rate of roll, pitch, yaw; not defined at a pitch of 90 degrees."""
    roll, pitch, _ = attitude
    p, q, r = velocity[3:]
    turn = q * np.sin(roll) + r * np.cos(roll)
    return np.array([p + turn * np.tan(pitch), q * np.cos(roll) - r * np.sin(roll), turn / np.cos(pitch)])


def step(velocity, attitude, wrench, dt):
    """Velocity and attitude after a time step, Heun's method."""
    velocity, attitude = np.asarray(velocity, dtype=float), np.asarray(attitude, dtype=float)
    v1, a1 = acceleration(velocity, attitude, wrench), attitude_rate(attitude, velocity)
    ahead_v, ahead_a = velocity + dt * v1, attitude + dt * a1
    v2, a2 = acceleration(ahead_v, ahead_a, wrench), attitude_rate(ahead_a, ahead_v)
    return velocity + 0.5 * dt * (v1 + v2), attitude + 0.5 * dt * (a1 + a2)


if __name__ == "__main__":
    velocity, attitude = np.zeros(6), np.zeros(3)
    hold = restoring(0.0, 0.0)
    print("10 N of surge from rest: time s, surge m/s")
    for tick in range(1001):
        if tick % 100 == 0:
            print(f"{{tick / 100:6.1f}} {{velocity[0]:8.4f}}")
        velocity, attitude = step(velocity, attitude, hold + np.array([10.0, 0, 0, 0, 0, 0]), 0.01)
'''


def write(model: ExportModel) -> str:
    """Text of the Python file."""
    vehicle = model.vehicle
    sides = [[model.hydrodynamics.drag(axis).of(backward=back) for axis in AXES] for back in (False, True)]
    body = BODY.format(
        mass=vehicle.mass_kg,
        weight=vehicle.weight_N,
        buoyancy=vehicle.buoyancy_N,
        center_of_buoyancy=[round(value, 9) for value in model.buoyancy_arm_m],
        thrusters=[thruster.name for thruster in vehicle.thrusters],
        thrust_range=[[round(value, 6) for value in thrust_range_N(vehicle, one)] for one in vehicle.thrusters],
        lag=[thruster.lag_s for thruster in vehicle.thrusters],
        effectiveness=_rows(effectiveness(vehicle)),
        inertia=list(vehicle.inertia),
        added_mass=_rows(model.added_mass),
        quadratic=_rows(np.array(sides)[:, :, 0]),
        linear=_rows(np.array(sides)[:, :, 1]),
        across=list(model.across),
        others=_rows(np.stack([weights_across(vehicle, axis) for axis in range(6)])),
    )
    # A docstring must not end early, whatever a note quotes.
    lines = "\n".join(header(model, CONVENTIONS)).replace("\\", "/").replace('"""', "'''")
    return f'"""{lines}\n"""\n{body}'


def _rows(matrix: Array) -> str:
    rows = ",\n    ".join(str([float(value) for value in row]) for row in matrix)
    return f"[\n    {rows},\n]"
