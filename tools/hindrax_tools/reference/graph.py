"""Pages of the graph: nodes from their roles; topics from their table; our own messages, services and actions.

The page of the nodes lists inputs, outputs, services and states of each.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

from hindrax_bringup.clone import clone_root
from hindrax_bringup.network.security import (
    ALLOCATOR_PARAMETERS,
    ANSWER,
    ARM,
    ASSESS,
    CANCEL,
    FLY,
    RECENTRE,
    ROLES,
    RUN,
    SESSION,
    Role,
)
from hindrax_bringup.processes import EVERY
from hindrax_core.sensor_table import SENSORS
from hindrax_core.topics import NAMESPACE, TOPICS, Quality, Topic, resolved
from hindrax_drivers.lifecycle import State
from hindrax_drivers.output.output_guard import ArmingPhase
from hindrax_tools.reference.markdown import code, head, number, table

NODES = f"""Inputs and outputs of every node, in the default namespace `{NAMESPACE}`. The access policies of SROS2 are
made of the same table and allow nothing else. [How to use one node](../how-to/use-one-node.md) without the others.

Every node also reads `/clock` in mock, publishes `/rosout`, has the services of its [parameters](parameters.md), and
reports on `/diagnostics` once a second: OK, WARN or ERROR, with the reason in words. A node with a lifecycle has its
services (`ros2 lifecycle set {NAMESPACE}/ms5837 deactivate`). It keeps the requested state; without its device
it is unconfigured, and returns to that state as soon as the device is found."""

TYPES: Mapping[str, str] = {
    ARM: "hindrax_msgs/srv/Arm",
    CANCEL: "action_msgs/srv/CancelGoal",
    FLY: "hindrax_msgs/action/FlyManeuver",
    RUN: "hindrax_msgs/action/RunExperiment",
    SESSION: "hindrax_msgs/action/RunSession",
    ANSWER: "hindrax_msgs/srv/AnswerQuestion",
    ASSESS: "std_srvs/srv/Trigger",
    RECENTRE: "hindrax_msgs/srv/Recentre",
    **{service: "std_srvs/srv/Trigger" for sensor in SENSORS for service in sensor.services},
    **dict(
        zip(ALLOCATOR_PARAMETERS, ("rcl_interfaces/srv/GetParameters", "rcl_interfaces/srv/SetParameters"), strict=True)
    ),
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
    "session": "guided session of a pool day, begun by a client (`pool-test --session --action`)",
    "teleop": "wrench by joystick or keyboard",
    "thrust": "wrench that the pulses of another stack achieve, by the thrust curves",
}
STATES: Mapping[str, str] = {
    "thrusters": f"`thrusters/state`: {', '.join(ArmingPhase)}",
    "pilot": "`maneuver/status`: no motion; settle, hover, transit, transient, plateau, coast, excite, done, aborted. "
    "`holds/status`: each hold engaged or not, and why it does not act",
    "estimator_health": "ERROR while the state is implausible: then nothing arms",
    "allocator": "obeys one commander, or reports in `/diagnostics` why none",
    "identifier": "waiting for a maneuver, learning, or holding for a reason",
    "safety_monitor": "link: OK, or WARN since the operator was lost",
}
ALONE = {name: f"ros2 run hindrax_control {name}" for name in ("teleop", "thrust")}
"""Nodes that no process of the stack hosts."""
LIFECYCLE = f"lifecycle: {', '.join(state.name.lower() for state in State)}"
TOPICS_ABOUT = """Every topic of the stack. Only the vehicle's own machine sees them unless a tether is named. Recorded
ones are in every bag. A rate of 0 means: on change."""
MESSAGES = """Interfaces of `hindrax_msgs`. Standard messages are used where they fit (see
[topics](topics.md)). Every field has its unit; `-` has none."""
FOLDERS = {"msg": ("",), "srv": ("request", "response"), "action": ("goal", "result", "feedback")}


def nodes_page() -> str:
    """Page of the nodes."""
    nodes = (role for role in ROLES if role.enclave != "bench")
    return head("Nodes", NODES) + "".join(map(_node, nodes))


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
    """Interfaces of a node: verb, full name, type."""
    for verb, topics in (("subscribes", role.subscribes), ("publishes", role.publishes)):
        for topic in topics:
            yield verb, _name(topic), topic.type if isinstance(topic, Topic) else _type(topic)
    for verb, names in (("serves", (*role.serves, *role.executes)), ("calls", (*role.requests, *role.calls))):
        for name in names:
            yield verb, f"{NAMESPACE}/{name}", _type(name)


def _type(name: str) -> str:
    return TYPES.get(name) or TYPES[name.rpartition("/")[2]]


def _name(topic: Topic | str) -> str:
    return topic if isinstance(topic, str) else resolved(topic)


def messages_page() -> str:
    """Page of the messages."""
    root = clone_root() / "src" / "hindrax_msgs"
    files = [file for folder in FOLDERS for file in sorted((root / folder).iterdir())]
    return head("Messages, services, actions", MESSAGES) + "".join(map(_interface, files))


def _interface(file: Path) -> str:
    about, parts = _read(file)
    tables = [
        (f"\n{title}:\n" if title else "") + "\n" + table(("type", "field", "unit", "meaning"), part)
        for title, part in zip(FOLDERS[file.parent.name], parts, strict=True)
    ]
    return f"\n## hindrax_msgs/{file.parent.name}/{file.stem}\n\n{about}\n" + "".join(tables)


def _read(file: Path) -> tuple[str, list[list[tuple[str, ...]]]]:
    """Comment at the top of a definition, and the fields of each of its parts."""
    about: list[str] = []
    parts: list[list[tuple[str, ...]]] = [[]]
    for line in file.read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            about.append(line.removeprefix("#").strip())
        elif line.startswith("---"):
            parts.append([])
        elif line.strip():
            parts[-1].append(_field(line))
    return " ".join(about), parts


def _field(line: str) -> tuple[str, ...]:
    """Type, name, unit and meaning of one line; constants have no unit."""
    declaration, _, comment = line.partition("#")
    kind, _, name = declaration.strip().partition(" ")
    meaning, unit = comment.strip(), ""
    if meaning.endswith("]"):
        meaning, _, unit = meaning[:-1].rpartition("[")
    return code(kind), code(name.strip()), unit, meaning.strip()


def topics_page() -> str:
    """Page of the topics."""
    columns = ("topic", "type", "rate [Hz]", "quality", "recorded", "meaning")
    return f"{head('Topics', TOPICS_ABOUT)}\n{table(columns, map(_topic, TOPICS))}"


def _topic(topic: Topic) -> tuple[str, ...]:
    name, kind, quality = code(resolved(topic)), code(topic.type), _quality(topic.quality)
    return name, kind, number(topic.rate_Hz), quality, "yes" if topic.recorded else "no", topic.meaning


def _quality(quality: Quality) -> str:
    words = ["reliable" if quality.reliable else "best effort", f"depth {quality.depth}"]
    words += ["latched"] if quality.latched else []
    words += [f"deadline {quality.deadline_s:g} s"] if quality.deadline_s else []
    words += [f"lifespan {quality.lifespan_s:g} s"] if quality.lifespan_s else []
    return ", ".join(words)
