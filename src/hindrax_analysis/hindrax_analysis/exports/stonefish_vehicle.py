"""Stonefish: the folder of a whole vehicle, a robot with thrusters and sensors in a scenario that opens.

A thruster of Stonefish is a rotor and a curve (its public documentation, "Actuators"). Here the speed of the rotor *is*
the thrust in newtons: set point and speed are held to the range of the thruster, the rotor follows with the time
constant of the vehicle file, and the curve is the straight line from the least to the largest thrust. So thrusts go in
as newtons, in the order of the vehicle file, and come with their lag; a pulse becomes a thrust outside, by the curves.
The interface to ROS (`stonefish_ros2`) adds its topics to the same tags.
"""

import math
from collections.abc import Iterator, Mapping
from xml.etree import ElementTree as ET

from hindrax_analysis.exports.export_model import ExportModel, commented, numbers, thrust_range_N
from hindrax_analysis.exports.stonefish import Law, drag_boxes, notes_of, parts, whole_from_m
from hindrax_core.sensor_table import Capability
from hindrax_core.topics import ros_name
from hindrax_core.vehicle import Mount, Thruster, Vehicle

LINK = "base_link"
ODOMETRY_Hz, SENSOR_Hz = 100.0, 10.0
PROPELLER_m = 0.076
DENSITY_kgpm3 = 1000.0
LEAST_LAG_S = 0.01
"""Shorter than this the rotor has no dynamics: at Stonefish's usual step of 10 ms it would overshoot."""
CLEAR_m = 0.3
"""Depth of the highest point of its parts at the start."""
FILES = "vehicle.scn", "world.scn", "thruster.obj", "README.md"

CONVENTIONS = (
    "A robot for a Stonefish scenario; body axes x forward, y right, z down, origin as in the vehicle file.",
    "Thrusters take newtons, in the order of the vehicle file; the speed of a rotor stands for its thrust.",
    "Odometry belongs to the center of mass. Sensors stand where the vehicle file puts them, without noise.",
)
KINDS: tuple[tuple[Capability, str], ...] = (("velocity", "dvl"), ("rates", "imu"), ("depth", "pressure"))
"""What a sensor measures, by capability, and the sensor of Stonefish that measures it."""


def folder(model: ExportModel, law: Law = "cubic") -> Mapping[str, str]:
    """Files of a folder that Stonefish opens: vehicle, world of water, mesh of its thrusters, lines of help."""
    name = model.vehicle.name
    density = numbers(model.vehicle.water.density_kgpm3)
    texts = (
        _robot(model, law),
        WORLD.format(density=density, hull=numbers(DENSITY_kgpm3)),
        MESH,
        README.format(ros=ros_name(name), thrusters=len(model.vehicle.thrusters), rate=numbers(ODOMETRY_Hz)),
    )
    return dict(zip(FILES, texts, strict=True))


def _robot(model: ExportModel, law: Law) -> str:
    vehicle, boxes = model.vehicle, drag_boxes(model, law)
    scenario = ET.Element("scenario")
    robot = ET.SubElement(scenario, "robot", name=ros_name(vehicle.name), fixed="false", self_collisions="false")
    base = ET.SubElement(robot, "base_link", name=LINK, type="compound", physics="submerged", buoyant="true")
    parts(base, model, boxes)
    for thruster in vehicle.thrusters:
        _thruster(robot, vehicle, thruster)
    place = f"/{ros_name(vehicle.name)}"
    _sensor(robot, ("odometry", "odometry"), Mount("", position_m=vehicle.center_of_mass_m), place)
    for name, kind, mount in _sensors(vehicle):
        _sensor(robot, (name, kind), mount, place)
    ET.SubElement(robot, "ros_subscriber", thrusters=f"{place}/thruster_setpoints")
    ET.SubElement(robot, "world_transform", xyz=numbers(0.0, 0.0, CLEAR_m + whole_from_m(vehicle, boxes)), rpy="0 0 0")
    return commented(scenario, model, CONVENTIONS + notes_of(model, law, boxes))


def _sensors(vehicle: Vehicle) -> Iterator[tuple[str, str, Mount]]:
    """Name, Stonefish's kind, and mount of what the sensors on board measure and Stonefish has."""
    for name, mount in vehicle.sensors.items():
        kinds = [kind for capability, kind in KINDS if name in vehicle.measuring(capability)]
        yield from ((name if kind == kinds[0] else f"{name}_{kind}", kind, mount) for kind in kinds)


def _thruster(robot: ET.Element, vehicle: Vehicle, thruster: Thruster) -> None:
    low, high = thrust_range_N(vehicle, thruster)
    most = max(-low, high)
    actuator = ET.SubElement(robot, "actuator", name=thruster.name, type="thruster")
    ET.SubElement(actuator, "link", name=LINK)
    turn = numbers(0.0, math.radians(thruster.elevation_deg), math.radians(thruster.azimuth_deg))
    ET.SubElement(actuator, "origin", xyz=numbers(*thruster.position_m), rpy=turn)
    limits = {"max_setpoint": numbers(most), "inverted_setpoint": "false", "normalized_setpoint": "false"}
    ET.SubElement(actuator, "specs", limits)
    propeller = ET.SubElement(actuator, "propeller", diameter=numbers(PROPELLER_m), right="true")
    ET.SubElement(propeller, "mesh", filename="thruster.obj", scale="1.0")
    ET.SubElement(propeller, "material", name="Hull")
    ET.SubElement(propeller, "look", name="Thruster")
    lag_s = thruster.lag_s
    rotor = ET.SubElement(actuator, "rotor_dynamics", type="zero_order" if lag_s < LEAST_LAG_S else "first_order")
    if lag_s >= LEAST_LAG_S:
        ET.SubElement(rotor, "time_constant", value=numbers(lag_s))
    curve = ET.SubElement(actuator, "thrust_model", type="linear_interpolation")
    ET.SubElement(curve, "input", value=numbers(low, high))
    ET.SubElement(curve, "output", value=numbers(low, high))
    ET.SubElement(actuator, "watchdog", timeout="1.0")


def _sensor(robot: ET.Element, what: tuple[str, str], mount: Mount, place: str) -> None:
    """Sensor of a name and a kind at its mount, with its topic below the place."""
    name, kind = what
    rate_Hz = SENSOR_Hz if kind in ("dvl", "pressure") else ODOMETRY_Hz
    sensor = ET.SubElement(robot, "sensor", name=name, type=kind, rate=numbers(rate_Hz))
    ET.SubElement(sensor, "link", name=LINK)
    turn = (math.radians(angle) for angle in mount.rotation_deg)
    ET.SubElement(sensor, "origin", xyz=numbers(*mount.position_m), rpy=numbers(*turn))
    if kind == "dvl":
        ET.SubElement(sensor, "specs", beam_angle="30", beam_positive_z="true")
        ET.SubElement(sensor, "range", velocity="9 9 9", altitude_min="0.1", altitude_max="50")
    ET.SubElement(sensor, "ros_publisher", topic=f"{place}/{name}")


WORLD = """<?xml version="1.0"?>
<scenario>
  <environment>
    <ned latitude="0.0" longitude="0.0"/>
    <ocean>
      <water density="{density}" jerlov="0.2"/>
      <waves height="0.0"/>
    </ocean>
    <atmosphere>
      <sun azimuth="20.0" elevation="50.0"/>
    </atmosphere>
  </environment>
  <materials>
    <material name="Hull" density="{hull}" restitution="0.3"/>
    <material name="Water" density="{density}" restitution="0.3"/>
    <friction_table>
      <friction material1="Hull" material2="Hull" static="0.5" dynamic="0.3"/>
      <friction material1="Hull" material2="Water" static="0.0" dynamic="0.0"/>
      <friction material1="Water" material2="Water" static="0.0" dynamic="0.0"/>
    </friction_table>
  </materials>
  <looks>
    <look name="Hull" rgb="0.2 0.4 0.8" roughness="0.4"/>
    <look name="Thruster" gray="0.2" roughness="0.4"/>
    <look name="Water" gray="1.0" roughness="1.0"/>
    <look name="Floor" gray="0.6" roughness="0.9"/>
  </looks>
  <static name="floor" type="plane">
    <material name="Hull"/>
    <look name="Floor"/>
    <world_transform xyz="0.0 0.0 10.0" rpy="0.0 0.0 0.0"/>
  </static>
  <include file="vehicle.scn"/>
</scenario>
"""
MESH = """o thruster
v 0.02 0.0 0.0
v -0.02 0.0 0.0
v 0.0 0.038 0.0
v 0.0 -0.038 0.0
v 0.0 0.0 0.038
v 0.0 0.0 -0.038
f 1 3 5
f 1 5 4
f 1 4 6
f 1 6 3
f 2 5 3
f 2 4 5
f 2 6 4
f 2 3 6
"""
"""A double pyramid: what is seen of a thruster; it has no part in the physics."""
README = """Open, on one line, in this folder, with Stonefish 1.4 or later: `ros2 launch stonefish_ros2
stonefish_simulator.launch.py simulation_data:=$PWD/ scenario_desc:=$PWD/world.scn simulation_rate:={rate}`
Drive: publish {thrusters} newtons, in the order of the vehicle file, as `std_msgs/Float64MultiArray` at
`/{ros}/thruster_setpoints`. With hindrax: `./hindrax pool-test --mock --simulator stonefish:/{ros} --vehicle FILE`.
Numbers, signs, reference point, their uncertainty and what Stonefish errs by: the comment on top of `vehicle.scn`.
"""
