"""Access rights: one role per node, from which the SROS2 policies are generated.

Nothing else is allowed. An enclave is the identity of one process. Only the operator's enclave may publish orders that
move the vehicle; only the allocator may publish pulses, and at the bench, with the stack down, the bench's enclave.
"""

import sys
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from hindrax_bringup.share_files import share_folder
from hindrax_core import topics as t
from hindrax_core.errors import HindraxError
from hindrax_core.sensor_table import SENSORS, Capability, row_of
from hindrax_core.topics import NAMESPACE, Topic, resolved
from hindrax_core.vehicle import Vehicle, load_vehicle

NO_SENSORS = Vehicle("any", 1.0, 1.0, (1.0, 1.0, 1.0))
KEYSTORE = "HINDRAX_KEYSTORE"
"""The one setting: the folder of a keystore, and every process enforces the policies."""
OVERRIDE = "ROS_SECURITY_ENCLAVE_OVERRIDE"
FROM_WHEELS = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"

ARM, FLY, RUN, ASSESS = "thrusters/arm", "maneuver/fly", "ident/run", "ident/assess"
RECENTRE = "maneuver/recentre"
SESSION, ANSWER = "session/run", "session/answer"
CANCEL = f"{FLY}/_action/cancel_goal"
ALLOCATOR_PARAMETERS = ("allocator/get_parameters", "allocator/set_parameters")
"""While yaw is weighed."""
FOREIGN = (f"{NAMESPACE}/odometry", f"{NAMESPACE}/wrench")
"""Third-party topics of the identifier, under other names when they are remapped."""
OF_EVERY_NODE = (
    *("describe_parameters", "get_parameter_types", "get_parameters", "list_parameters"),
    *("set_parameters", "set_parameters_atomically", "get_type_description"),
)
OF_A_LIFECYCLE = (
    *("change_state", "get_state", "get_available_states"),
    *("get_available_transitions", "get_transition_graph"),
)


@dataclass(frozen=True, slots=True)
class Role:
    """Permissions of one node. Topics are entries of the table or absolute names; services and actions are ours."""

    node: str
    enclave: str
    publishes: tuple[Topic | str, ...] = ()
    subscribes: tuple[Topic | str, ...] = ()
    serves: tuple[str, ...] = ()
    requests: tuple[str, ...] = ()
    executes: tuple[str, ...] = ()
    calls: tuple[str, ...] = ()
    lifecycle: bool = False
    measured: tuple[Capability, ...] = ()
    """It also reads the topics of the sensors that measure these."""


def _sensor(name: str, device: str) -> Role:
    own = t.sensor_topics(name, device)
    dvl = (f"{NAMESPACE}/{name}/dvl",) if "detail" in own else ()
    services = tuple(f"{name}/{one}" for one in row_of(device).services)
    published = (*own.values(), t.raw_topic(name), t.DIAGNOSTICS, *dvl)
    return Role(name, "sensors", publishes=published, serves=services, lifecycle=True)


_STATE = (
    *(t.NAVIGATION, t.THRUSTER_STATE, t.MANEUVER, t.PLACE, t.PLANS),
    *(t.ALLOCATION, t.HOLD_STATUS, t.THRUSTER_HEALTH, t.ESTIMATE, t.DIAGNOSTICS),
)
"""Topics that an operator watches: about a megabit a second over the tether; raw frames are not among it."""

STACK: tuple[Role, ...] = (
    Role("sensors", "sensors"),
    Role(
        "thrusters",
        "thrusters",
        publishes=(t.THRUSTER_STATE, t.BATTERY, t.THRUSTER_FRAMES, t.DIAGNOSTICS),
        subscribes=(t.THRUSTER_COMMAND, t.LIGHTS),
        serves=(ARM,),
        lifecycle=True,
    ),
    Role("control", "control"),
    Role(
        "navigator",
        "control",
        publishes=(t.NAVIGATION, t.ODOMETRY, t.DIAGNOSTICS, t.TF, t.TF_STATIC, t.ROBOT_DESCRIPTION),
        subscribes=(t.ALLOCATION,),
        measured=("field", "depth", "altitude", "range_ahead", "range_aside", "velocity", "attitude", "rates"),
    ),
    Role("estimator_health", "control", publishes=(t.DIAGNOSTICS,), requests=(ARM,)),
    Role(
        "pilot",
        "control",
        publishes=(t.WRENCH, t.HOLD_STATUS, t.MANEUVER, t.PLACE, t.PLANS, t.THRUSTER_HEALTH, t.DIAGNOSTICS),
        subscribes=(
            *(t.THRUSTER_STATE, t.THRUSTER_HEALTH_ORDER, t.HOLD_SETPOINT, t.OPERATOR_WRENCH, t.ESTIMATE),
            *(t.ODOMETRY, t.ALLOCATION, t.LEAK),
        ),
        measured=("altitude",),
        executes=(FLY,),
        serves=(RECENTRE,),
    ),
    Role(
        "allocator",
        "control",
        publishes=(t.THRUSTER_COMMAND, t.ALLOCATION, t.DIAGNOSTICS),
        subscribes=(t.WRENCH, t.THRUSTER_STATE, t.THRUSTER_HEALTH, t.BATTERY),
    ),
    Role(
        "identifier",
        "identifier",
        publishes=(t.ESTIMATE, t.DIAGNOSTICS),
        subscribes=(t.NAVIGATION, t.ALLOCATION, t.MANEUVER, *FOREIGN),
        measured=("velocity", "depth", "range_ahead", "range_aside"),
        serves=(ASSESS,),
        executes=(RUN,),
        calls=(FLY,),
    ),
    Role("recorder", "recorder", publishes=(t.DIAGNOSTICS,), subscribes=t.TOPICS),
    Role(
        "safety_monitor",
        "safety_monitor",
        publishes=(t.THRUSTER_HEALTH_ORDER, t.DIAGNOSTICS),
        subscribes=(t.THRUSTER_HEALTH, t.DIAGNOSTICS, t.HEARTBEAT, t.THRUSTER_STATE),
        requests=(ARM, CANCEL),
    ),
    Role(
        "operator",
        "operator",
        publishes=(t.HEARTBEAT, t.HOLD_SETPOINT, t.OPERATOR_WRENCH, t.THRUSTER_HEALTH_ORDER, t.LIGHTS),
        subscribes=(*_STATE, t.BATTERY),
        requests=(ARM, CANCEL, RECENTRE, ANSWER, *ALLOCATOR_PARAMETERS),
        calls=(FLY, RUN, SESSION),
    ),
    Role("session", "operator", serves=(ANSWER,), executes=(SESSION,)),
    Role("thrust", "thrust", publishes=(FOREIGN[1], t.DIAGNOSTICS), subscribes=(f"{NAMESPACE}/pulses",)),
    Role("teleop", "operator", publishes=(t.OPERATOR_WRENCH,), subscribes=(t.JOYSTICK, t.TWIST)),
    Role("operator", "bench", publishes=(t.HEARTBEAT, t.THRUSTER_COMMAND), subscribes=_STATE, requests=(ARM,)),
)
"""Nodes of every vehicle."""


def roles(vehicle: Vehicle | None = None) -> tuple[Role, ...]:
    """Roles of all nodes of a vehicle; without one, as if it had a sensor of each kind under the name of its kind."""
    named = {row.name: row.name for row in SENSORS}
    if vehicle is not None:
        named |= {name: mount.device for name, mount in vehicle.sensors.items()}
    sensors = (_sensor(name, device) for name, device in named.items())
    return (*sensors, *(_with_measured(role, vehicle) for role in STACK))


def _with_measured(role: Role, vehicle: Vehicle | None) -> Role:
    """A role with the topics of the sensors that it reads, or records, written out."""
    vehicle = vehicle or NO_SENSORS
    read = (one for capability in role.measured for one in t.carriers(vehicle, capability).values())
    recorded = t.topics_of(vehicle) if role.node == "recorder" else ()
    return replace(role, subscribes=(*read, *role.subscribes, *recorded))


ROLES: tuple[Role, ...] = roles()


def enclaves() -> tuple[str, ...]:
    """Paths of all enclaves, in the order of the roles."""
    return tuple(dict.fromkeys(path(role.enclave) for role in ROLES))


def path(process: str, namespace: str = NAMESPACE) -> str:
    """Path of the enclave of a process."""
    return f"{namespace}/{process}"


def arguments(process: str, namespace: str = NAMESPACE) -> list[str]:
    """Words that give a process its identity; without security they have no effect."""
    return ["--enclave", path(process, namespace)]


def settings(keystore: str, environment: Mapping[str, str]) -> dict[str, str]:
    """Environment that enforces the policies; empty without a keystore. HindraxError where they cannot be enforced."""
    if not keystore:
        return {}
    if FROM_WHEELS in environment:
        raise HindraxError(f"{KEYSTORE}: ROS from wheels has no DDS security; use a ROS installation, or unset it")
    if not (Path(keystore) / "enclaves").is_dir():
        raise HindraxError(
            f"{KEYSTORE}: found no keystore at {keystore}; make one with {share_folder('security') / 'keystore.sh'}"
        )
    return {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "Enforce", "ROS_SECURITY_KEYSTORE": keystore}


def unenforced(keystore: str) -> str:
    """Note where a mock starts beside a keystore."""
    return f"{KEYSTORE}: {keystore} is not enforced in mock; anyone in its graph may command the mock vehicle"


def with_enclave(environment: Mapping[str, str], process: str) -> dict[str, str]:
    """Environment of a node that is made in this process; an identity that the user chose stays, as at the bench."""
    secured = environment.get("ROS_SECURITY_ENABLE") == "true"
    return {OVERRIDE: path(process), **environment} if secured else dict(environment)


def policies(vehicle: Vehicle | None = None) -> str:
    """Policies of all enclaves as SROS2 reads them (ROS 2 Access Control Policies, version 0.2.0)."""
    document = ET.Element("policy", version="0.2.0")
    listed = ET.SubElement(document, "enclaves")
    for enclave in enclaves():
        profiles = ET.SubElement(ET.SubElement(listed, "enclave", path=enclave), "profiles")
        for role in roles(vehicle):
            if path(role.enclave) == enclave:
                _profile(profiles, role)
    ET.indent(document)
    head = "<!-- Made from the roles of hindrax_bringup.network.security. -->"
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{head}\n{ET.tostring(document, encoding="unicode")}\n'


def _profile(profiles: ET.Element, role: Role) -> None:
    profile = ET.SubElement(profiles, "profile", ns=NAMESPACE, node=role.node)
    own = [f"{NAMESPACE}/{role.node}/{one}" for one in OF_EVERY_NODE]
    own += [f"{NAMESPACE}/{role.node}/{one}" for one in OF_A_LIFECYCLE if role.lifecycle]
    events = [f"{NAMESPACE}/{role.node}/transition_event"] if role.lifecycle else []
    _allow(profile, "topic", "publish", [*map(_name, role.publishes), *events, "/rosout", "/parameter_events"])
    _allow(profile, "topic", "subscribe", [*map(_name, role.subscribes), "/clock", "/parameter_events"])
    _allow(profile, "service", "reply", [*own, *(f"{NAMESPACE}/{one}" for one in role.serves)])
    _allow(profile, "service", "request", [f"{NAMESPACE}/{one}" for one in role.requests])
    _allow(profile, "action", "execute", [f"{NAMESPACE}/{one}" for one in role.executes])
    _allow(profile, "action", "call", [f"{NAMESPACE}/{one}" for one in role.calls])


def _name(topic: Topic | str) -> str:
    return topic if isinstance(topic, str) else resolved(topic)


def _allow(profile: ET.Element, kind: str, verb: str, names: list[str]) -> None:
    if names:
        group = ET.SubElement(profile, f"{kind}s", {verb: "ALLOW"})
        for name in dict.fromkeys(names):
            ET.SubElement(group, kind).text = name


if __name__ == "__main__":
    # For keystore.sh: the policies of a vehicle whose sensors have names of their own.
    print(policies(load_vehicle(sys.argv[1])), end="")  # noqa: T201  # into the file of policies
