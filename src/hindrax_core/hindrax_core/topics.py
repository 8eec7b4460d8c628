"""Table of all topics: recorder, replay, diagnostics, launch, access policies and docs read it.

Names are relative to the vehicle's namespace (by default `/hindrax`), except those that begin with a slash.
"""

from __future__ import annotations

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


STATE = Quality()
SENSOR = Quality(depth=50)
COMMAND = Quality(depth=1, lifespan_s=1.0)
LATCHED = Quality(depth=1, latched=True)
BY_HAND = Quality(reliable=False, depth=1)
"""Late messages are lost: after a loss of the tether nothing is sent again."""
RAW = Quality(depth=200)


@dataclass(frozen=True, slots=True)
class Topic:
    """One row: name, type as `package/msg/Type`, quality, usual rate, whether the recorder takes it, meaning."""

    name: str
    type: str
    quality: Quality
    rate_Hz: float
    recorded: bool
    meaning: str


QUANTITIES: Mapping[str, tuple[str, str]] = {
    "velocity": ("geometry_msgs/msg/TwistWithCovarianceStamped", "velocity over ground"),
    "attitude": ("sensor_msgs/msg/Imu", "attitude of the DVL's own IMU"),
    "detail": ("hindrax_msgs/msg/Dvl", "lock, beams, confidence, device time"),
    "altitude": ("sensor_msgs/msg/Range", "distance along the DVL axis"),
    "position": ("sensor_msgs/msg/NavSatFix", "place by the DVL's own dead reckoning, and whether a GPS gives it"),
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
"""What a sensor can publish: type and meaning."""


def _topic(sensor: Sensor, quantity: str, rate_Hz: float) -> Topic:
    kind, meaning = QUANTITIES[quantity]
    if quantity in SHARED:
        return Topic(quantity, kind, STATE, 1, True, meaning)
    return Topic(f"{sensor.name}/{quantity}", kind, SENSOR, rate_Hz, True, meaning)


TOPICS_OF: Mapping[str, Mapping[str, Topic]] = {
    sensor.name: {quantity: _topic(sensor, quantity, rate_Hz) for quantity, rate_Hz in sensor.publishes.items()}
    for sensor in SENSORS
}
"""Topics by sensor and quantity, in the order of the table."""
MEASURED: Mapping[str, Topic] = {topic.name: topic for of in TOPICS_OF.values() for topic in of.values()}
"""Topics of the sensors by name."""

DVL_VELOCITY, DVL_ATTITUDE = MEASURED["dvl75/velocity"], MEASURED["dvl75/attitude"]
DVL_DETAIL, DVL_ALTITUDE = MEASURED["dvl75/detail"], MEASURED["dvl75/altitude"]
IMU, MAGNETIC = MEASURED["icm20948/data_raw"], MEASURED["icm20948/mag"]
PRESSURE, WATER_TEMPERATURE = MEASURED["ms5837/pressure"], MEASURED["ms5837/temperature"]
ALTITUDE, PING_PROFILE = MEASURED["ping1d/range"], MEASURED["ping1d/profile"]
BATTERY, LEAK = MEASURED["battery"], MEASURED["leak"]
ODOMETRY = Topic(
    "navigation/odometry", "nav_msgs/msg/Odometry", STATE, 50, True, "pose and twist, REP-105; of one publisher"
)
NAVIGATION = Topic(
    "navigation/status", "hindrax_msgs/msg/NavigationStatus", STATE, 50, True, "depth, altitude, attitude, ages, SNAME"
)
HOLD_SETPOINT = Topic("holds/setpoint", "hindrax_msgs/msg/HoldSetpoint", COMMAND, 0, True, "setpoint of one hold")
HOLD_STATUS = Topic("holds/status", "hindrax_msgs/msg/HoldStatus", STATE, 10, True, "holds, their setpoints and errors")
OPERATOR_WRENCH = Topic(
    "operator/wrench", "geometry_msgs/msg/WrenchStamped", COMMAND, 0, True, "wrench by hand, added to the holds"
)
JOYSTICK = Topic("joy", "sensor_msgs/msg/Joy", BY_HAND, 0, True, "joystick of the operator, as `joy_node` tells it")
TWIST = Topic("cmd_vel", "geometry_msgs/msg/Twist", BY_HAND, 0, True, "velocity by hand: keyboard, web page")
LIGHTS = Topic("lights", "std_msgs/msg/Float32MultiArray", STATE, 0, True, "brightness of every lamp, 0 dark to 1")
WRENCH = Topic(
    "control/wrench",
    "geometry_msgs/msg/WrenchStamped",
    COMMAND,
    50,
    True,
    "wrench wanted of the allocator; of one publisher",
)
ALLOCATION = Topic(
    "control/allocation",
    "hindrax_msgs/msg/AllocationStatus",
    STATE,
    50,
    True,
    "wanted, achieved, shortfall, forces",
)
MANEUVER = Topic("maneuver/status", "hindrax_msgs/msg/ManeuverStatus", STATE, 10, True, "motion, phase, progress")
PLANS = Topic("maneuver/plans", "hindrax_msgs/msg/MotionPlans", LATCHED, 0, True, "what each motion would fly now")
THRUSTER_COMMAND = Topic("thrusters/command", "hindrax_msgs/msg/ThrusterCommand", COMMAND, 50, True, "pulses wanted")
THRUSTER_STATE = Topic("thrusters/state", "hindrax_msgs/msg/ThrusterState", STATE, 50, True, "armed, pulses applied")
THRUSTER_HEALTH = Topic(
    "thrusters/health", "hindrax_msgs/msg/ThrusterHealth", LATCHED, 0, True, "disabled thrusters, as the pilot has them"
)
THRUSTER_HEALTH_ORDER = Topic(
    "thrusters/health_order", "hindrax_msgs/msg/ThrusterHealth", LATCHED, 0, True, "the list that the pilot is to take"
)
ESTIMATE = Topic("ident/estimate", "hindrax_msgs/msg/ModelEstimate", Quality(depth=100), 10, True, "coefficients")
RAW_FRAMES = tuple(
    Topic(f"raw/{source}", "hindrax_msgs/msg/RawFrames", RAW, 10, True, f"wire frames of {source}")
    for source in (*(sensor.name for sensor in SENSORS), "thrusters")
)
HEARTBEAT = Topic(
    "operator/heartbeat", "hindrax_msgs/msg/Heartbeat", Quality(depth=1, deadline_s=1.0), 2, True, "the operator's link"
)
DIAGNOSTICS = Topic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", STATE, 1, True, "health of every node")
ROSOUT = Topic("/rosout", "rcl_interfaces/msg/Log", LATCHED, 0, True, "log of every node")
TF = Topic("/tf", "tf2_msgs/msg/TFMessage", SENSOR, 10, True, "odom -> base_link")
TF_STATIC = Topic(
    "/tf_static", "tf2_msgs/msg/TFMessage", LATCHED, 0, True, "base_link -> base_link_fsd, sensors and thrusters"
)
ROBOT_DESCRIPTION = Topic("robot_description", "std_msgs/msg/String", LATCHED, 0, True, "the vehicle as URDF")

TOPICS: tuple[Topic, ...] = (
    *MEASURED.values(),
    ODOMETRY,
    NAVIGATION,
    HOLD_SETPOINT,
    HOLD_STATUS,
    OPERATOR_WRENCH,
    JOYSTICK,
    TWIST,
    LIGHTS,
    WRENCH,
    ALLOCATION,
    MANEUVER,
    PLANS,
    THRUSTER_COMMAND,
    THRUSTER_STATE,
    THRUSTER_HEALTH,
    THRUSTER_HEALTH_ORDER,
    ESTIMATE,
    *RAW_FRAMES,
    HEARTBEAT,
    DIAGNOSTICS,
    ROSOUT,
    TF,
    TF_STATIC,
    ROBOT_DESCRIPTION,
)

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
