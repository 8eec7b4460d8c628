"""Page of the nodes, from their roles: what each takes, gives and serves, and its states."""

from collections.abc import Iterator, Mapping

from hindrax_bringup.network.security import ARM, ASSESS, CANCEL, FLY, RECENTRE, ROLES, RUN, Role
from hindrax_bringup.processes import EVERY
from hindrax_core.sensor_table import SENSORS
from hindrax_core.topics import NAMESPACE, Topic, resolved
from hindrax_drivers.lifecycle import State
from hindrax_drivers.output.output_guard import ArmingPhase
from hindrax_tools.reference.markdown import code, head, table

ABOUT = f"""What every node takes and gives, in the default namespace `{NAMESPACE}`. The access policies of SROS2 are
made of the same table and allow nothing else. [How to use one node](../how-to/use-one-node.md) without the others.

Besides, every node takes `/clock` in mock, gives `/rosout`, has the services of its [parameters](parameters.md), and
reports on `/diagnostics` once a second: OK, WARN or ERROR, with the reason in words. A node with a lifecycle has its
services (`ros2 lifecycle set {NAMESPACE}/ms5837 deactivate`). It keeps the state that was asked for; without its device
it is unconfigured, and returns to that state as soon as the device is found."""

TYPES: Mapping[str, str] = {
    ARM: "hindrax_msgs/srv/Arm",
    CANCEL: "action_msgs/srv/CancelGoal",
    FLY: "hindrax_msgs/action/FlyManeuver",
    RUN: "hindrax_msgs/action/RunExperiment",
    ASSESS: "std_srvs/srv/Trigger",
    RECENTRE: "hindrax_msgs/srv/Recentre",
    "request_profile": "std_srvs/srv/Trigger",
    "dvl": "marine_acoustic_msgs/msg/Dvl",
    "odometry": "nav_msgs/msg/Odometry",
    "wrench": "geometry_msgs/msg/WrenchStamped",
    "pulses": "mavros_msgs/msg/RCOut",
}
"""Types of services, actions and the topics that the table does not hold, by their name or the end of it."""
MEANINGS: Mapping[str, str] = {sensor.name: sensor.meaning for sensor in SENSORS} | {
    "sensors": "hosts the nodes of the sensors, which share their ports",
    "thrusters": "output guard: pulses out, armed by an operator only",
    "control": "hosts navigator, pilot and allocator",
    "navigator": "state of the vehicle from its sensors",
    "estimator_health": "disarms while the state is implausible",
    "pilot": "holds and maneuvers: wanted wrench from the state and the operator's orders",
    "allocator": "pulses that come closest to the wanted wrench",
    "identifier": "coefficients while the vehicle moves; runs the experiment that finds them",
    "recorder": "writes the bag",
    "safety_monitor": "watches the operator's link and the health of the nodes",
    "operator": "terminal, web page and monitor of the operator",
    "teleop": "wrench by joystick or keyboard",
    "thrust": "wrench that the pulses of another stack achieve, by the thrust curves",
}
STATES: Mapping[str, str] = {
    "thrusters": f"`thrusters/state`: {', '.join(ArmingPhase)}",
    "pilot": "`maneuver/status`: no motion; settle, hover, transit, transient, plateau, coast, excite, done, aborted. "
    "`holds/status`: each hold engaged or not, and why it does not act",
    "estimator_health": "ERROR while the state is implausible: then nothing arms",
    "allocator": "obeys one commander, or says in `/diagnostics` why none",
    "identifier": "waiting for a maneuver, learning, or holding for a reason",
    "safety_monitor": "link: OK, or WARN since the operator was lost",
}
ALONE = {name: f"ros2 run hindrax_control {name}" for name in ("teleop", "thrust")}
"""Nodes that no process of the stack hosts."""
LIFECYCLE = f"lifecycle: {', '.join(state.name.lower() for state in State)}"


def page() -> str:
    """Return the page."""
    nodes = (role for role in ROLES if role.enclave != "bench")
    return head("Nodes", ABOUT) + "".join(map(_node, nodes))


def _node(role: Role) -> str:
    states = [*[LIFECYCLE] * role.lifecycle, *filter(None, [STATES.get(role.node)])]
    facts = [f"- runs in: {_process(role)}", *(f"- states: {one}" for one in states)]
    rows = [(verb, code(name), code(kind)) for verb, name, kind in edges(role)]
    listed = f"\n{table(('', 'name', 'type'), rows)}" if rows else ""
    return f"\n## {role.node}\n\n{MEANINGS[role.node]}\n\n" + "\n".join(facts) + f"\n{listed}"


def _process(role: Role) -> str:
    hosts = {one.name: f"ros2 run {one.package} {one.name}" for one in EVERY}
    return code(ALONE.get(role.node) or hosts.get(role.enclave) or "./hindrax")


def edges(role: Role) -> Iterator[tuple[str, str, str]]:
    """What a node takes, gives, serves and asks: verb, full name, type."""
    for verb, topics in (("takes", role.subscribes), ("gives", role.publishes)):
        for topic in topics:
            yield verb, _name(topic), topic.type if isinstance(topic, Topic) else _type(topic)
    for verb, names in (("serves", (*role.serves, *role.executes)), ("asks", (*role.requests, *role.calls))):
        for name in names:
            yield verb, f"{NAMESPACE}/{name}", _type(name)


def _type(name: str) -> str:
    return TYPES.get(name) or TYPES[name.rpartition("/")[2]]


def _name(topic: Topic | str) -> str:
    return topic if isinstance(topic, str) else resolved(topic)
