"""Table of all topics: recorder, replay, diagnostics, launch, access policies and docs read it.

Names are relative to the vehicle's namespace (by default `/hindrax`), except those that begin with a slash.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from hindrax_core.sensor_table import CARRIERS, QUANTITIES, SENSORS, SHARED, Capability, row_of
from hindrax_core.vehicle import Mount, Vehicle, capabilities


@dataclass(frozen=True, slots=True)
class Quality:
    """Quality of service of a topic. Zero means: not set."""

    reliable: bool = True
    depth: int = 10
    latched: bool = False
    deadline_s: float = 0.0
    lifespan_s: float = 0.0


STATE = Quality(depth=20)
SENSOR = Quality(depth=100)
COMMAND = Quality(depth=1, lifespan_s=1.0)
LATCHED = Quality(depth=1, latched=True)
BY_HAND = Quality(reliable=False, depth=1)
"""Late messages are lost: after a loss of the tether nothing is sent again."""
RAW = Quality(depth=200)


@dataclass(frozen=True, slots=True)
class Topic:
    """One row: name, type as `package/msg/Type`, quality, usual rate, meaning, whether the recorder takes it."""

    name: str
    type: str
    quality: Quality
    rate_Hz: float
    meaning: str
    recorded: bool = True


def sensor_topics(name: str, device: str) -> Mapping[str, Topic]:
    """Topics of one sensor by quantity: its name in the vehicle file, and its kind. ValueError for an unknown kind."""
    return {quantity: _topic(name, quantity, rate_Hz) for quantity, rate_Hz in row_of(device).publishes.items()}


def _topic(name: str, quantity: str, rate_Hz: float) -> Topic:
    kind, meaning = QUANTITIES[quantity]
    if quantity in SHARED:
        return Topic(quantity, kind, STATE, 1, meaning)
    return Topic(f"{name}/{quantity}", kind, SENSOR, rate_Hz, meaning)


def raw_topic(source: str) -> Topic:
    """Topic of the wire frames of a sensor of the vehicle file, or of the thrusters."""
    return Topic(f"raw/{source}", "hindrax_msgs/msg/RawFrames", RAW, 10, f"wire frames of {source}")


def carriers(vehicle: Vehicle, capability: Capability) -> dict[str, Topic]:
    """Topic that each sensor which measures something publishes it on.

    Of the quantities that carry it (`sensor_table.CARRIERS`) the first that any of them publishes: the altitude is that
    of the sonars, and of a DVL only where there is none. Where the vehicle file names no sensor, those of this stack
    under the names of their kinds: one may run alone, and a bag may hold what a file lacks.

    Parameters
    ----------
    vehicle
        With the sensors of its file.
    capability
        What is measured, such as "depth".

    Returns
    -------
    dict[str, Topic]
        By the name of the sensor; empty where nothing measures it.
    """
    named = {name: vehicle.sensors[name] for name in vehicle.measuring(capability)}
    usual = {row.name: Mount(row.name) for row in SENSORS if capability in capabilities(Mount(row.name))}
    rows = {name: row_of(mount.device) for name, mount in (named or usual).items()}
    for quantity in CARRIERS.get(capability, ()):
        found = {name: row.publishes[quantity] for name, row in rows.items() if quantity in row.publishes}
        if found:
            return {name: _topic(name, quantity, rate_Hz) for name, rate_Hz in found.items()}
    return {}


def topics_of(vehicle: Vehicle) -> tuple[Topic, ...]:
    """All topics of a vehicle: those of its sensors by their names, and all others."""
    rows = [one for name, mount in vehicle.sensors.items() for one in sensor_topics(name, mount.device).values()]
    raw = [raw_topic(name) for name in vehicle.sensors]
    return tuple({topic.name: topic for topic in (*rows, *_rows, *raw)}.values())


TOPICS_OF: Mapping[str, Mapping[str, Topic]] = {row.name: sensor_topics(row.name, row.name) for row in SENSORS}
"""Topics of the sensors of this stack by kind and quantity, each under the name of its kind."""


def _usual(quantity: str) -> Topic:
    """Topic of the first sensor of the table that publishes a quantity."""
    return next(of[quantity] for of in TOPICS_OF.values() if quantity in of)


DVL_ATTITUDE, DVL_DETAIL = _usual("attitude"), _usual("detail")
IMU, MAGNETIC = _usual("data_raw"), _usual("mag")
PRESSURE, ALTITUDE = _usual("pressure"), _usual("range")
BATTERY, LEAK = _usual("battery"), _usual("leak")
_rows: list[Topic] = [BATTERY, LEAK]
"""All but those that carry the name of a sensor."""


def _row(name: str, kind: str, quality: Quality, rate_Hz: float, meaning: str) -> Topic:
    """Add a row to the table."""
    _rows.append(Topic(name, kind, quality, rate_Hz, meaning))
    return _rows[-1]


ODOMETRY = _row("navigation/odometry", "nav_msgs/msg/Odometry", STATE, 50, "pose and twist, REP-105; of one publisher")
NAVIGATION = _row(
    "navigation/status", "hindrax_msgs/msg/NavigationStatus", STATE, 50, "depth, altitude, attitude, ages, SNAME"
)
HOLD_SETPOINT = _row("holds/setpoint", "hindrax_msgs/msg/HoldSetpoint", COMMAND, 0, "setpoint of one hold")
HOLD_STATUS = _row("holds/status", "hindrax_msgs/msg/HoldStatus", STATE, 10, "holds, their setpoints and errors")
OPERATOR_WRENCH = _row(
    "operator/wrench", "geometry_msgs/msg/WrenchStamped", COMMAND, 0, "wrench of the operator, added to the holds"
)
JOYSTICK = _row("joy", "sensor_msgs/msg/Joy", BY_HAND, 0, "joystick of the operator, as `joy_node` publishes it")
TWIST = _row("cmd_vel", "geometry_msgs/msg/Twist", BY_HAND, 0, "manual velocity: keyboard, web page")
LIGHTS = _row("lights", "std_msgs/msg/Float32MultiArray", STATE, 0, "brightness of every lamp, 0 dark to 1")
WRENCH = _row(
    "control/wrench", "geometry_msgs/msg/WrenchStamped", COMMAND, 50, "wrench wanted of the allocator; of one publisher"
)
ALLOCATION = _row(
    "control/allocation", "hindrax_msgs/msg/AllocationStatus", STATE, 50, "wanted, achieved, shortfall, forces"
)
MANEUVER = _row("maneuver/status", "hindrax_msgs/msg/ManeuverStatus", STATE, 10, "motion, phase, progress")
PLACE = _row(
    "maneuver/place", "hindrax_msgs/msg/PoolPlace", STATE, 5, "position in the pool, and the walls of the guard"
)
PLANS = _row("maneuver/plans", "hindrax_msgs/msg/MotionPlans", LATCHED, 0, "plan of each motion as it would fly now")
THRUSTER_COMMAND = _row("thrusters/command", "hindrax_msgs/msg/ThrusterCommand", COMMAND, 50, "pulses wanted")
THRUSTER_STATE = _row("thrusters/state", "hindrax_msgs/msg/ThrusterState", STATE, 50, "armed, pulses applied")
THRUSTER_HEALTH = _row(
    "thrusters/health", "hindrax_msgs/msg/ThrusterHealth", LATCHED, 0, "disabled thrusters, as the pilot has them"
)
THRUSTER_HEALTH_ORDER = _row(
    "thrusters/health_order", "hindrax_msgs/msg/ThrusterHealth", LATCHED, 0, "the list that the pilot is to take"
)
ESTIMATE = _row("ident/estimate", "hindrax_msgs/msg/ModelEstimate", Quality(depth=100), 10, "coefficients")
HEARTBEAT = _row(
    "operator/heartbeat", "hindrax_msgs/msg/Heartbeat", Quality(depth=1, deadline_s=1.0), 2, "the operator's link"
)
DIAGNOSTICS = _row("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", STATE, 1, "health of every node")
ROSOUT = _row("/rosout", "rcl_interfaces/msg/Log", LATCHED, 0, "log of every node")
TF = _row("/tf", "tf2_msgs/msg/TFMessage", SENSOR, 10, "odom -> base_link")
TF_STATIC = _row(
    "/tf_static", "tf2_msgs/msg/TFMessage", LATCHED, 0, "base_link -> base_link_fsd, sensors and thrusters"
)
ROBOT_DESCRIPTION = _row("robot_description", "std_msgs/msg/String", LATCHED, 0, "the vehicle as URDF")

THRUSTER_FRAMES = raw_topic("thrusters")
_rows.append(THRUSTER_FRAMES)
TOPICS = tuple(
    {
        topic.name: topic
        for topic in (*(one for of in TOPICS_OF.values() for one in of.values()), *_rows, *map(raw_topic, TOPICS_OF))
    }.values()
)
"""All rows, as of a vehicle with one sensor of each kind under the name of its kind."""

NAMESPACE = "/hindrax"
"""Namespace of a vehicle unless another is named; bags of every vehicle are read as if recorded in it."""
OUTSIDE = ("/diagnostics", "/rosout", "/tf", "/tf_static")
"""Topics of ROS outside of any namespace. A vehicle with another namespace has them inside its own."""
CLOCK = "/clock"


def resolved(topic: Topic) -> str:
    """Full name of a topic of a vehicle in the default namespace."""
    return topic.name if topic.name.startswith("/") else f"{NAMESPACE}/{topic.name}"


def in_default_namespace(name: str, namespace: str) -> str:
    """Name that a topic of a vehicle in `namespace` has in the default namespace."""
    if namespace == NAMESPACE or not name.startswith(f"{namespace}/"):
        return name
    inside = name.removeprefix(namespace)
    return inside if inside in (*OUTSIDE, CLOCK) else NAMESPACE + inside


def namespace_fault(text: str) -> str:
    """Reason why a text is no namespace of a vehicle; empty when it is one."""
    if re.fullmatch(r"(/[A-Za-z_]\w*)+", text, re.ASCII) and "__" not in text:
        return ""
    return f"found {text!r}, wanted names of letters, digits and _, as /rov1"


def ros_name(name: str) -> str:
    """Name of a vehicle as part of a topic, where ROS allows letters, digits and underscores."""
    return re.sub(r"\W", "_", name, flags=re.ASCII)


def namespace_arguments(namespace: str, *, own_clock: bool) -> list[str]:
    """ROS arguments that put a process into a namespace.

    Parameters
    ----------
    namespace
        Of the vehicle.
    own_clock
        Whether the vehicle is a mock, whose /clock is its own.

    Returns
    -------
    list[str]
        Words for the command line; none for the default namespace.
    """
    if namespace == NAMESPACE:
        return []
    names = (*OUTSIDE, CLOCK) if own_clock else OUTSIDE
    remaps = [f"{name}:={name.removeprefix('/')}" for name in names]
    return [word for rule in (f"__ns:={namespace}", *remaps) for word in ("-r", rule)]
