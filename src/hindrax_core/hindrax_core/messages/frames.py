"""The fixed frames of a vehicle, in `base_link` (REP-103: x forward, y left, z up), and its description as URDF.

Pure. `base_link_fsd` is turned half way about x. A sensor's `NAME_link` has the axes of its messages: those of the chip
for an inertial sensor (REP-145), the beam along x for a range (sensor_msgs/Range), else x forward, y left, z up of the
sensor. A thruster's `NAME_link` has its positive thrust along x. Names have no prefix: where several vehicles share a
graph, each has `tf` and `tf_static` in its own namespace.
"""

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass

from hindrax_core.readings import Vec3
from hindrax_core.rotation import FLU, FSD, matrix, rotate
from hindrax_core.sensor_table import row_of
from hindrax_core.vehicle import Mount, Thruster, Vehicle

LEFT_UP = ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))
CHIP = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
BEAM = ((0.0, 0.0, 1.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0))
"""Axes x, y, z of a frame in those of its sensor (x forward, y starboard, z down as mounted)."""
AXES = {"data_raw": CHIP, "range": BEAM}
"""By what a sensor publishes; other sensors have `LEFT_UP`."""
THRUSTER_SIZE_m = (0.05, 0.04)
"""Length and radius of the cylinder that shows a thruster."""


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame fixed to `base_link`: position [m], and roll, pitch, yaw (yaw first) [rad]."""

    name: str
    position_m: Vec3
    rpy_rad: Vec3


def frames_of(vehicle: Vehicle) -> tuple[Frame, ...]:
    """`base_link_fsd`, and the frames of the sensors and thrusters of a vehicle."""
    sensors = (_sensor(name, mount) for name, mount in vehicle.sensors.items())
    return (Frame(FSD, (0.0, 0.0, 0.0), (math.pi, 0.0, 0.0)), *sensors, *map(_thruster, vehicle.thrusters))


def _sensor(name: str, mount: Mount) -> Frame:
    roll, pitch, yaw = (math.radians(angle) for angle in mount.rotation_deg)
    turn = matrix((roll, pitch, yaw))
    published = row_of(mount.device).publishes
    axes = next((axes for quantity, axes in AXES.items() if quantity in published), LEFT_UP)
    x, y, z = (_up(rotate(turn, axis)) for axis in axes)
    return Frame(f"{name}_link", _up(mount.position_m), _angles(x, y, z))


def _thruster(thruster: Thruster) -> Frame:
    yaw, pitch = -math.radians(thruster.azimuth_deg), -math.radians(thruster.elevation_deg)
    return Frame(f"{thruster.name}_link", _up(thruster.position_m), (0.0, pitch, yaw))


def _up(vector: Vec3) -> Vec3:
    """From forward, starboard, down to forward, left, up."""
    return (vector[0], 0.0 - vector[1], 0.0 - vector[2])


def _angles(x: Vec3, y: Vec3, z: Vec3) -> Vec3:
    """Roll, pitch, yaw of a frame with these axes; straight up or down, the yaw is zero."""
    if abs(x[2]) > 1.0 - 1e-12:
        return (math.atan2(-x[2] * y[0], y[1]), -math.copysign(math.pi / 2.0, x[2]), 0.0)
    return (math.atan2(y[2], z[2]), -math.asin(x[2]), math.atan2(x[1], x[0]))


# ---- URDF


def urdf_of(vehicle: Vehicle) -> str:
    """Description of a vehicle: `base_link` with its mass and a box of its envelope, and a link for every frame."""
    return urdf_text(robot_of(vehicle))


def urdf_text(robot: ET.Element) -> str:
    """Text of a description."""
    ET.indent(robot)
    return f'<?xml version="1.0"?>\n{ET.tostring(robot, encoding="unicode")}\n'


def robot_of(vehicle: Vehicle) -> ET.Element:
    """Element of the description of a vehicle, for whoever adds to it."""
    robot = ET.Element("robot", name=vehicle.name)
    base = ET.SubElement(robot, "link", name=FLU)
    inertial = ET.SubElement(base, "inertial")
    ET.SubElement(inertial, "origin", xyz=_text(_up(vehicle.center_of_mass_m)), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=_text((vehicle.mass_kg,)))
    ixx, iyy, izz = (_text((moment,)) for moment in vehicle.inertia)
    ET.SubElement(inertial, "inertia", ixx=ixx, iyy=iyy, izz=izz, ixy="0", ixz="0", iyz="0")
    geometry = ET.SubElement(ET.SubElement(base, "visual"), "geometry")
    ET.SubElement(geometry, "box", size=_text(vehicle.envelope_m))
    thrusters = {f"{thruster.name}_link" for thruster in vehicle.thrusters}
    for frame in frames_of(vehicle):
        _link(robot, frame, is_thruster=frame.name in thrusters)
    return robot


def _link(robot: ET.Element, frame: Frame, *, is_thruster: bool) -> None:
    link = ET.SubElement(robot, "link", name=frame.name)
    if is_thruster:
        visual = ET.SubElement(link, "visual")
        ET.SubElement(visual, "origin", xyz="0 0 0", rpy=_text((0.0, math.pi / 2.0, 0.0)))
        length, radius = (_text((size,)) for size in THRUSTER_SIZE_m)
        ET.SubElement(ET.SubElement(visual, "geometry"), "cylinder", length=length, radius=radius)
    joint = ET.SubElement(robot, "joint", name=f"{frame.name}_joint", type="fixed")
    ET.SubElement(joint, "parent", link=FLU)
    ET.SubElement(joint, "child", link=frame.name)
    ET.SubElement(joint, "origin", xyz=_text(frame.position_m), rpy=_text(frame.rpy_rad))


def _text(values: tuple[float, ...]) -> str:
    """Shortest text with nine significant digits, and never -0."""
    return " ".join(f"{value + 0.0:.9g}" for value in values)
