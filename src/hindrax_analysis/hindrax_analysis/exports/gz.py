"""Gazebo: a model for gz-sim 8 (Harmonic) and later, with the Hydrodynamics system and a Thruster system per thruster.

Signs. The system adds Fossen's derivatives as they stand: the force is `xU u + xUabsU |u| u`, so damping that resists
is negative. Added mass goes, positive, into `<inertial><fluid_added_mass>` (SDFormat 1.10), where the DART engine
solves it together with the mass and brings its Coriolis terms. The system's own `xDotU`, which is negative and uses the
acceleration of the previous step, diverges when the added mass is larger than the mass (gz-sim issue 1923); it is
written only when asked for. Both at once would count it twice.

Reference point. The system damps the velocity of the link's origin, and DART takes `fluid_added_mass` about that
origin. Both are known about the center of mass, so the link's origin is put there: its pose in the model is the center
of mass, and everything in it is placed from there. The model's own origin stays the body origin of the vehicle file.

Axes. Gazebo's body axes are x forward, y left, z up: SNAME turned half around x. A diagonal of drag is the same in
both; added mass off the diagonal changes sign where one of its two axes is turned. Up and down are exchanged: what
differs between them goes into `zWW w^2`. The linear part has one value for both: where the two differ, three
coefficients are fitted to both directions over the tested speeds, and the header states the misfit.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Literal
from xml.etree import ElementTree as ET

import numpy as np
import yaml

from hindrax_analysis.exports.export_model import (
    LOWEST_SHARE,
    ExportModel,
    add,
    buoyancy_box_m,
    commented,
    law_of,
    numbers,
    terminal_misfit,
    tested_speeds,
    thrust_range_N,
)
from hindrax_core.errors import HindraxError
from hindrax_core.messages.frames import frames_of
from hindrax_core.readings import Vec3
from hindrax_core.sensor_table import Capability
from hindrax_core.topics import ros_name
from hindrax_core.vehicle import AXES, Drag, Thruster, Vehicle
from hindrax_ident.arrays import Array

TURN = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
"""SNAME to Gazebo body axes, for velocities, forces, rates and moments alike."""

LINK = "base_link"
FORCES, VELOCITIES, MASS_LETTERS = "xyzkmn", "UVWPQR", "xyzpqr"
PROPELLER_kg, PROPELLER_kgm2 = 0.01, 1e-5
"""Of every propeller link; taken from the hull, so that the whole keeps its mass and its center."""
PROPELLER_m, PROPELLER_K_T = 0.076, 0.25
"""Only turn the drawn propeller: the system is commanded in newton, and these give the rate that it shows."""
ODOMETRY_Hz = 100.0
SENSORS: tuple[tuple[Capability, str], ...] = (("rates", "imu"), ("depth", "altimeter"))
"""What a sensor measures, and the sensor of gz-sim for it. Its DVL needs a floor that is rendered: left out."""
MESSAGES = {"imu": ("sensor_msgs/msg/Imu", "gz.msgs.IMU")}
"""Of ROS and of Gazebo, where the bridge knows both."""
NOTED = 1e-3
"""Misfit of a terminal speed from which the header states it."""
UNSTABLE, SLOW = 1.0, 0.5
"""Added mass over mass from which the plugin's explicit added mass diverges, and from which it answers late."""

CONVENTIONS = (
    "For gz-sim 8 (Harmonic) and later. Body axes x forward, y left, z up. The link's origin is the center of mass.",
    "Damping is negative (force = xU u + xUabsU |u| u); added mass is positive in fluid_added_mass.",
    "The world needs the Physics and Buoyancy systems; the collision box displaces the vehicle's volume.",
    "Thrusters take newton at /model/NAME/joint/THRUSTER_joint/cmd_thrust; their lag is yours to add.",
)


def write(model: ExportModel, added_mass: Literal["inertial", "plugin"] = "inertial") -> str:
    """SDF text of a complete model; HindraxError for an added mass that would explode in the plugin."""
    notes = _explicit_notes(model) if added_mass == "plugin" else _symmetric_notes(model)
    sdf = ET.Element("sdf", version="1.10")
    body = ET.SubElement(sdf, "model", name=model.vehicle.name, canonical_link=LINK)
    base = ET.SubElement(body, "link", name=LINK)
    add(base, "pose", _pose(model.vehicle.center_of_mass_m))
    _inertial(base, model, with_fluid=added_mass == "inertial")
    _hull(base, model)
    for name, kind, _ in sensors_of(model.vehicle):
        _sensor(base, model, name, kind)
    plugin = ET.SubElement(
        body, "plugin", filename="gz-sim-hydrodynamics-system", name="gz::sim::systems::Hydrodynamics"
    )
    add(plugin, "link_name", LINK)
    add(plugin, "water_density", numbers(model.vehicle.water.density_kgpm3))
    notes += _damping(plugin, model)
    if added_mass == "plugin":
        matrix = to_gazebo_axes(model.added_mass)
        for row, column in zip(*np.nonzero(matrix), strict=True):
            add(plugin, f"{FORCES[row]}Dot{VELOCITIES[column]}", numbers(-matrix[row, column]))
    for thruster in model.vehicle.thrusters:
        _thruster(body, model, thruster)
    _odometry(body, model.vehicle)
    return commented(sdf, model, CONVENTIONS + notes)


def folder(model: ExportModel) -> Mapping[str, str]:
    """Files of a folder that `gz sim world.sdf` opens: model, world of water, bridge to ROS, lines of help."""
    name = model.vehicle.name
    return {
        "model.sdf": write(model),
        "model.config": MODEL_CONFIG.format(name=name),
        "world.sdf": WORLD.format(name=name, density=numbers(model.vehicle.water.density_kgpm3)),
        "bridge.yaml": _bridge(model),
        "README.md": README.format(
            name=name, ros=ros_name(name), thruster=next((t.name for t in model.vehicle.thrusters), "T1")
        ),
    }


# ---- added mass


def _explicit_notes(model: ExportModel) -> tuple[str, ...]:
    """Refuse, or warn of, an added mass that acts one step late.

    The plugin's force of step k is -A a(k-1), so a(k) = (F - A a(k-1)) / M: an iteration that diverges as soon as an
    eigenvalue of A over M reaches one, whatever the step.
    """
    body = np.diag([model.vehicle.mass_kg] * 3 + list(model.vehicle.inertia))
    ratio = float(np.max(np.abs(np.linalg.eigvals(np.linalg.solve(body, model.added_mass)))))
    if ratio >= UNSTABLE:
        raise HindraxError(
            f"--to gz-plugin: added mass is up to {ratio:.2f} times the mass, wanted less than once: the plugin applies"
            " it one step late and the model would explode within a tenth of a second; use --to gz (DART engine)"
        )
    if ratio >= SLOW:
        return (
            f"Added mass is up to {ratio:.2f} times the mass: applied one step late, accelerations ring for a while.",
        )
    return ()


def _symmetric_notes(model: ExportModel) -> tuple[str, ...]:
    if np.allclose(model.added_mass, model.added_mass.T):
        return ()
    return ("fluid_added_mass is symmetric by definition: the mean of each pair of cross terms is written.",)


def to_gazebo_axes(matrix: Array) -> Array:
    """Added mass (6, 6) [kg, kg m, kg m^2] from SNAME to Gazebo axes; its own inverse."""
    return np.asarray(matrix * np.outer(TURN, TURN))


# ---- drag


def _damping(plugin: ET.Element, model: ExportModel) -> tuple[str, ...]:
    notes: tuple[str, ...] = ()
    for index, axis in enumerate(AXES):
        drag, top = model.hydrodynamics.drag(axis), model.top_speed[index]
        k_l, ahead, astern = two_sided(drag, top)
        force, velocity = FORCES[index], VELOCITIES[index]
        add(plugin, f"{force}{velocity}", numbers(-k_l))
        add(plugin, f"{force}{velocity}abs{velocity}", numbers(-0.5 * (ahead + astern)))
        if ahead != astern:
            # Gazebo's forward is SNAME's forward or backward: the half difference takes the sign of the turn.
            add(plugin, f"{force}{velocity}{velocity}", numbers(-0.5 * (ahead - astern) * TURN[index]))
        sides = ((drag.of(backward=False), ahead), (drag.of(backward=True), astern))
        misfit = max(terminal_misfit(law_of(*own), law_of(k_q, k_l), top) for own, k_q in sides)
        if misfit > NOTED:
            notes += (
                (
                    f"{axis}: one linear coefficient for both directions; terminal speeds within {100.0 * misfit:.1f} %"
                    f" from {LOWEST_SHARE * top:.2g} to {top:.2g}."
                ),
            )
    return notes


def two_sided(drag: Drag, top: float) -> tuple[float, float, float]:
    """One k_l and a k_q for each direction that come closest to a drag whose directions differ, in relative force."""
    (q_ahead, l_ahead), (q_astern, l_astern) = drag.of(backward=False), drag.of(backward=True)
    if l_ahead == l_astern:
        return l_ahead, q_ahead, q_astern
    speed = tested_speeds(top)
    none = np.zeros_like(speed)
    ahead, astern = (q_ahead * speed + l_ahead) * speed, (q_astern * speed + l_astern) * speed
    rows = [np.column_stack((speed, speed**2, none)) / ahead[:, None]]
    rows.append(np.column_stack((speed, none, speed**2)) / astern[:, None])
    from scipy.optimize import nnls  # noqa: PLC0415  # slow to import

    found, _ = nnls(np.vstack(rows), np.ones(2 * len(speed)))
    k_l, ahead_q, astern_q = (float(value) for value in found)
    return k_l, ahead_q, astern_q


# ---- bodies


def _inertial(link: ET.Element, model: ExportModel, *, with_fluid: bool) -> None:
    """Hull without its propellers: with them, mass, center and moments are those of the vehicle."""
    vehicle = model.vehicle
    arms = [np.array(model.arm_m(thruster.position_m)) for thruster in vehicle.thrusters]
    hull_kg = vehicle.mass_kg - PROPELLER_kg * len(arms)
    center = -PROPELLER_kg * sum(arms, np.zeros(3)) / hull_kg
    moment = np.diag(vehicle.inertia) - sum((_about(PROPELLER_kg, arm) for arm in arms), np.zeros((3, 3)))
    moment = moment - np.eye(3) * PROPELLER_kgm2 * len(arms) - _about(hull_kg, center)
    moment = moment * np.outer(TURN[:3], TURN[:3])
    inertial = ET.SubElement(link, "inertial")
    add(inertial, "pose", _pose((float(center[0]), float(center[1]), float(center[2]))))
    add(inertial, "mass", numbers(hull_kg))
    inertia = ET.SubElement(inertial, "inertia")
    for row, column in zip(*np.triu_indices(3), strict=True):
        add(inertia, f"i{'xyz'[row]}{'xyz'[column]}", numbers(round(float(moment[row, column]), 12)))
    if with_fluid:
        fluid = ET.SubElement(inertial, "fluid_added_mass")
        matrix = to_gazebo_axes(0.5 * (model.added_mass + model.added_mass.T))
        for row, column in zip(*np.triu_indices(6), strict=True):
            add(fluid, f"{MASS_LETTERS[row]}{MASS_LETTERS[column]}", numbers(matrix[row, column]))


def _about(mass_kg: float, arm: Array) -> Array:
    """Moments of inertia (3, 3) of a point mass at an arm [kg m^2]."""
    return np.asarray(mass_kg * (arm @ arm * np.eye(3) - np.outer(arm, arm)))


def _hull(link: ET.Element, model: ExportModel) -> None:
    collision = ET.SubElement(link, "collision", name="displaced_volume")
    add(collision, "pose", _pose(model.buoyancy_arm_m))
    _box(collision, buoyancy_box_m(model.vehicle))
    visual = ET.SubElement(link, "visual", name="envelope")
    add(visual, "pose", _pose(model.arm_m((0.0, 0.0, 0.0))))
    _box(visual, model.vehicle.envelope_m)
    add(visual, "transparency", "0.3")


def _box(parent: ET.Element, edges_m: Vec3) -> None:
    add(ET.SubElement(ET.SubElement(parent, "geometry"), "box"), "size", numbers(*edges_m))


def sensors_of(vehicle: Vehicle) -> Iterator[tuple[str, str, str]]:
    """Name, kind in gz-sim and unique name of what the sensors on board measure and gz-sim shows without rendering."""
    for name in vehicle.sensors:
        for capability, kind in SENSORS:
            if name in vehicle.measuring(capability):
                yield name, kind, f"{name}/{kind}"


def _sensor(link: ET.Element, model: ExportModel, name: str, kind: str) -> None:
    """A sensor at its mount, with the axes of its messages; its topic is that of `sensors_of` below the model."""
    frame = next(one for one in frames_of(model.vehicle) if one.name == f"{name}_link")
    x, y, z = (one - other for one, other in zip(frame.position_m, _up(model.vehicle.center_of_mass_m), strict=True))
    sensor = ET.SubElement(link, "sensor", name=f"{name}_{kind}", type=kind)
    add(sensor, "pose", numbers(x, y, z, *(frame.rpy_rad if kind == "imu" else (0.0, 0.0, 0.0))))
    add(sensor, "always_on", "true")
    add(sensor, "update_rate", numbers(ODOMETRY_Hz))
    add(sensor, "topic", f"/model/{model.vehicle.name}/{name}/{kind}")


def _up(vector_m: Vec3) -> Vec3:
    """From forward, starboard, down to forward, left, up."""
    return vector_m[0], -vector_m[1], -vector_m[2]


def _thruster(body: ET.Element, model: ExportModel, thruster: Thruster) -> None:
    """Propeller link, its joint along the thrust, and the Thruster system that pushes along it."""
    vehicle, name = model.vehicle, f"{thruster.name}_joint"
    link = ET.SubElement(body, "link", name=f"{thruster.name}_link")
    # Positive yaw is to the left and positive pitch is down in Gazebo's axes.
    turn = (0.0, -math.radians(thruster.elevation_deg), -math.radians(thruster.azimuth_deg))
    add(link, "pose", _pose(thruster.position_m, turn))
    inertial = ET.SubElement(link, "inertial")
    add(inertial, "mass", numbers(PROPELLER_kg))
    inertia = ET.SubElement(inertial, "inertia")
    for moment in ("ixx", "iyy", "izz"):
        add(inertia, moment, numbers(PROPELLER_kgm2))
    visual = ET.SubElement(link, "visual", name="duct")
    add(visual, "pose", numbers(0.0, 0.0, 0.0, 0.0, 0.5 * math.pi, 0.0))
    duct = ET.SubElement(ET.SubElement(visual, "geometry"), "cylinder")
    add(duct, "radius", numbers(0.5 * PROPELLER_m))
    add(duct, "length", numbers(PROPELLER_m))
    joint = ET.SubElement(body, "joint", name=name, type="revolute")
    add(joint, "parent", LINK)
    add(joint, "child", f"{thruster.name}_link")
    add(ET.SubElement(joint, "axis"), "xyz", "1 0 0")
    low, high = thrust_range_N(vehicle, thruster)
    plugin = ET.SubElement(body, "plugin", filename="gz-sim-thruster-system", name="gz::sim::systems::Thruster")
    for key, value in (
        ("namespace", vehicle.name),
        ("joint_name", name),
        ("thrust_coefficient", numbers(PROPELLER_K_T)),
        ("fluid_density", numbers(vehicle.water.density_kgpm3)),
        ("propeller_diameter", numbers(PROPELLER_m)),
        ("velocity_control", "true"),
        ("max_thrust_cmd", numbers(high)),
        ("min_thrust_cmd", numbers(low)),
    ):
        add(plugin, key, value)


def _odometry(body: ET.Element, vehicle: Vehicle) -> None:
    """Pose of the center of mass in the world, and velocities in body axes: the model's own origin is another point."""
    system = "gz-sim-odometry-publisher-system", "gz::sim::systems::OdometryPublisher"
    plugin = ET.SubElement(body, "plugin", filename=system[0], name=system[1])
    for key, value in (
        ("odom_frame", "odom"),
        ("robot_base_frame", LINK),
        ("odom_topic", f"/model/{vehicle.name}/odometry"),
        ("odom_publish_frequency", numbers(ODOMETRY_Hz)),
        ("dimensions", "3"),
        ("xyz_offset", _pose(vehicle.center_of_mass_m).rsplit(" ", 3)[0]),
    ):
        add(plugin, key, value)


def _bridge(model: ExportModel) -> str:
    """Topics for ros_gz_bridge; ROS names have no hyphen."""
    name, ros = model.vehicle.name, ros_name(model.vehicle.name)
    rows = [
        (f"/model/{name}/odometry", f"/model/{ros}/odometry", "nav_msgs/msg/Odometry", "gz.msgs.Odometry", "GZ_TO_ROS")
    ]
    rows += [
        (f"/model/{name}/{topic}", f"/model/{ros}/{topic}", "std_msgs/msg/Float64", "gz.msgs.Double", "ROS_TO_GZ")
        for topic in (f"joint/{one.name}_joint/cmd_thrust" for one in model.vehicle.thrusters)
    ]
    rows += [
        (f"/model/{name}/{topic}", f"/model/{ros}/{topic}", *MESSAGES[kind], "GZ_TO_ROS")
        for _, kind, topic in sensors_of(model.vehicle)
        if kind in MESSAGES
    ]
    keys = ("gz_topic_name", "ros_topic_name", "ros_type_name", "gz_type_name", "direction")
    return yaml.safe_dump([dict(zip(keys, row, strict=True)) for row in rows], sort_keys=False)


def _pose(position_m: Vec3, rpy_rad: Vec3 = (0.0, 0.0, 0.0)) -> str:
    return numbers(*_up(position_m), *rpy_rad)


# ---- the folder

MODEL_CONFIG = """<?xml version="1.0"?>
<model>
  <name>{name}</name>
  <version>1.0</version>
  <sdf version="1.10">model.sdf</sdf>
  <description>Hydrodynamics identified by hindrax; see the comment in model.sdf.</description>
</model>
"""

WORLD = """<?xml version="1.0"?>
<sdf version="1.10">
  <world name="pool">
    <physics name="1ms" type="dart">
      <max_step_size>0.001</max_step_size>
      <real_time_factor>1.0</real_time_factor>
    </physics>
    <plugin filename="gz-sim-physics-system" name="gz::sim::systems::Physics"/>
    <plugin filename="gz-sim-user-commands-system" name="gz::sim::systems::UserCommands"/>
    <plugin filename="gz-sim-scene-broadcaster-system" name="gz::sim::systems::SceneBroadcaster"/>
    <plugin filename="gz-sim-buoyancy-system" name="gz::sim::systems::Buoyancy">
      <uniform_fluid_density>{density}</uniform_fluid_density>
    </plugin>
    <plugin filename="gz-sim-imu-system" name="gz::sim::systems::Imu"/>
    <plugin filename="gz-sim-altimeter-system" name="gz::sim::systems::Altimeter"/>
    <light name="sun" type="directional">
      <pose>0 0 10 0 0 0</pose>
      <direction>-0.3 0.2 -0.9</direction>
    </light>
    <include>
      <pose>0 0 -1 0 0 0</pose>
      <uri>model.sdf</uri>
      <name>{name}</name>
    </include>
  </world>
</sdf>
"""

README = """Open: `gz sim world.sdf` in this folder (gz-sim 8 or later, DART engine), then start the clock.
Drive: `gz topic -t /model/{name}/joint/{thruster}_joint/cmd_thrust -m gz.msgs.Double -p 'data: 5'` pushes with 5 N.
With hindrax: `ros2 run ros_gz_bridge parameter_bridge --ros-args -p config_file:=$PWD/bridge.yaml`, and in another
terminal `./hindrax pool-test --mock --simulator gz:/model/{ros} --vehicle FILE` flies and identifies it.
Numbers, signs, reference point and their uncertainty: the comment on top of `model.sdf`.
"""
