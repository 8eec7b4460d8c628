"""Table of all topics: recorder, replay, diagnostics, launch, access policies and docs read it.

Names are relative to the vehicle's namespace (by default `/hindrax`), except those that begin with a slash.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from hindrax_core.sensor_table import SENSORS, SHARED, Sensor


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


QUANTITIES: Mapping[str, tuple[str, str]] = {
    "velocity": ("geometry_msgs/msg/TwistWithCovarianceStamped", "velocity over ground"),
    "attitude": ("sensor_msgs/msg/Imu", "attitude of the DVL's own IMU"),
    "detail": ("hindrax_msgs/msg/Dvl", "lock, beams, confidence, device time"),
    "altitude": ("sensor_msgs/msg/Range", "distance along the DVL axis"),
    "position": ("sensor_msgs/msg/NavSatFix", "position by the DVL's own dead reckoning, and whether a GPS gives it"),
    "range": ("sensor_msgs/msg/Range", "distance to the bottom, sonar"),
    "profile": ("hindrax_msgs/msg/PingProfile", "echo profile, on request"),
    "die_temperature": ("sensor_msgs/msg/Temperature", "temperature of the die"),
    "supply": ("sensor_msgs/msg/BatteryState", "supply voltage of the device"),
    "processor_temperature": ("sensor_msgs/msg/Temperature", "temperature of the device's processor"),
    "board_temperature": ("sensor_msgs/msg/Temperature", "temperature of the device's board"),
    "data_raw": ("sensor_msgs/msg/Imu", "specific force and angular rate"),
    "mag": ("sensor_msgs/msg/MagneticField", "magnetic field"),
    "pressure": ("sensor_msgs/msg/FluidPressure", "absolute pressure"),
    "temperature": ("sensor_msgs/msg/Temperature", "temperature at the sensor"),
    "humidity": ("sensor_msgs/msg/RelativeHumidity", "relative humidity, 0 to 1"),
    "battery": ("sensor_msgs/msg/BatteryState", "supply voltage and current, when measured"),
    "leak": ("std_msgs/msg/Bool", "whether there is water in a dry hull, when measured"),
}
"""Quantity that a sensor can publish: type and meaning."""


def _topic(sensor: Sensor, quantity: str, rate_Hz: float) -> Topic:
    kind, meaning = QUANTITIES[quantity]
    if quantity in SHARED:
        return Topic(quantity, kind, STATE, 1, meaning)
    return Topic(f"{sensor.name}/{quantity}", kind, SENSOR, rate_Hz, meaning)


TOPICS_OF: Mapping[str, Mapping[str, Topic]] = {
    sensor.name: {quantity: _topic(sensor, quantity, rate_Hz) for quantity, rate_Hz in sensor.publishes.items()}
    for sensor in SENSORS
}
"""Topics by sensor and quantity, in the order of the table."""
MEASURED: Mapping[str, Topic] = {topic.name: topic for of in TOPICS_OF.values() for topic in of.values()}
"""Topics of the sensors by name."""

DVL_ATTITUDE, DVL_DETAIL = MEASURED["dvl75/attitude"], MEASURED["dvl75/detail"]
IMU, MAGNETIC = MEASURED["icm20948/data_raw"], MEASURED["icm20948/mag"]
PRESSURE, WATER_TEMPERATURE = MEASURED["ms5837/pressure"], MEASURED["ms5837/temperature"]
ALTITUDE = MEASURED["ping1d/range"]
BATTERY, LEAK = MEASURED["battery"], MEASURED["leak"]
_rows = list(MEASURED.values())


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
PLANS = _row("maneuver/plans", "hindrax_msgs/msg/MotionPlans", LATCHED, 0, "what each motion would fly now")
THRUSTER_COMMAND = _row("thrusters/command", "hindrax_msgs/msg/ThrusterCommand", COMMAND, 50, "pulses wanted")
THRUSTER_STATE = _row("thrusters/state", "hindrax_msgs/msg/ThrusterState", STATE, 50, "armed, pulses applied")
THRUSTER_HEALTH = _row(
    "thrusters/health", "hindrax_msgs/msg/ThrusterHealth", LATCHED, 0, "disabled thrusters, as the pilot has them"
)
THRUSTER_HEALTH_ORDER = _row(
    "thrusters/health_order", "hindrax_msgs/msg/ThrusterHealth", LATCHED, 0, "the list that the pilot is to take"
)
ESTIMATE = _row("ident/estimate", "hindrax_msgs/msg/ModelEstimate", Quality(depth=100), 10, "coefficients")
RAW_FRAMES = {
    source: _row(f"raw/{source}", "hindrax_msgs/msg/RawFrames", RAW, 10, f"wire frames of {source}")
    for source in (*(sensor.name for sensor in SENSORS), "thrusters")
}
"""By the source of the frames."""
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

TOPICS = tuple(_rows)
"""All rows, in the order of this file."""

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


def namespace_arguments(namespace: str, *, own_clock: bool) -> list[str]:
    """ROS arguments that put a process into a namespace; none for the default one.

    `own_clock`: the vehicle is a mock, whose /clock is its own.
    """
    if namespace == NAMESPACE:
        return []
    names = (*OUTSIDE, CLOCK) if own_clock else OUTSIDE
    remaps = [f"{name}:={name.removeprefix('/')}" for name in names]
    return [word for rule in (f"__ns:={namespace}", *remaps) for word in ("-r", rule)]
