"""Page of the nodes, from their roles: what each takes, gives and serves, and its states."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from hindrax_bringup.processes import EVERY, Process
from hindrax_bringup.security import ARM, ASSESS, CANCEL, FLY, ROLES, Role
from hindrax_core.sensor_table import SENSORS
from hindrax_core.topics import DIAGNOSTICS, NAMESPACE, Topic, resolved
from hindrax_drivers.lifecycle import State
from hindrax_drivers.output.output_guard import Phase
from hindrax_tools.reference.markdown import code, head, table

ABOUT = f"""What every node takes and gives, in the namespace `{NAMESPACE}` unless a name begins with another slash. Nothing
else is allowed: the access policies of SROS2 are made of the same roles. Each of them runs alone with the line given
([use one node](../how-to/use-one-node.md)).

Every node besides takes `/clock` in mock, gives `/rosout` and has the services of its parameters
([their names](parameters.md)). Every status on `/diagnostics` is OK, WARN or ERROR, with the reason in words. A node
with a lifecycle has its services (`ros2 lifecycle set {NAMESPACE}/ms5837 deactivate`): it keeps a state that was asked
for, and an absent device is looked for again and again while the node is {State.INACTIVE.name.lower()} by itself."""

TYPES: Mapping[str, str] = {
    ARM: "hindrax_msgs/srv/Arm",
    CANCEL: "action_msgs/srv/CancelGoal",
    FLY: "hindrax_msgs/action/FlyManeuver",
    ASSESS: "std_srvs/srv/Trigger",
    "request_profile": "std_srvs/srv/Trigger",
}
MEANINGS: Mapping[str, str] = {sensor.name: sensor.meaning for sensor in SENSORS} | {
    "sensors": "hosts the nodes of the sensors, which share their ports",
    "thrusters": "output guard: pulses out, armed by an operator only",
    "control": "hosts navigator, pilot and allocator",
    "navigator": "state of the vehicle from its sensors",
    "estimator_health": "disarms while the state is implausible",
    "pilot": "holds and maneuvers: wanted wrench from the state and the operator's orders",
    "allocator": "pulses that come closest to the wanted wrench",
    "identifier": "coefficients while the vehicle moves",
    "recorder": "writes the bag",
    "safety_monitor": "watches the operator's link and the health of the nodes",
    "operator": "terminal, web page and monitor of the operator",
    "teleop": "wrench by joystick or keyboard",
}
STATES: Mapping[str, str] = {
    "thrusters": f"`thrusters/state`: {', '.join(Phase)}",
    "pilot": "`maneuver/status`: no motion; settle, hover, transit, transient, plateau or excite; done or aborted. "
    "`holds/status`: each hold engaged or not, and why it does not act",
    "estimator_health": "ERROR while the state is implausible: then nothing arms",
    "allocator": "obeys one commander, or says in `/diagnostics` why none",
    "identifier": "waiting for a maneuver, learning, or holding for a reason",
    "safety_monitor": "link: OK, or WARN since the operator was lost",
}
LIFECYCLE = f"lifecycle: {', '.join(state.name.lower() for state in State)}"


def page() -> str:
    """Return the page."""
    nodes = (role for role in ROLES if role.enclave != "bench")
    return head("Nodes", ABOUT) + "".join(map(_node, nodes))


def _node(role: Role) -> str:
    states = [LIFECYCLE] * role.lifecycle + [STATES[role.node]] * (role.node in STATES)
    facts = [f"- runs in: {_process(role)}", *(f"- states: {one}" for one in states)]
    rows = list(_rows(role))
    listed = f"\n{table(('', 'name', 'type'), rows)}" if rows else ""
    return f"\n## {role.node}\n\n{MEANINGS[role.node]}\n\n" + "\n".join(facts) + f"\n{listed}"


def _process(role: Role) -> str:
    found: Process | None = next((one for one in EVERY if one.name == role.enclave), None)
    return code(f"ros2 run {found.package} {found.executable}") if found else "the tool of the operator, `./hindrax`"


def _rows(role: Role) -> Iterator[tuple[str, str, str]]:
    for verb, topics in (("takes", role.subscribes), ("gives", role.publishes)):
        for topic in topics:
            if topic is not DIAGNOSTICS or verb == "takes":
                yield verb, code(_name(topic)), code(topic.type if isinstance(topic, Topic) else TYPES[topic])
    for verb, names in (("serves", (*role.serves, *role.executes)), ("asks", (*role.requests, *role.calls))):
        for name in names:
            yield verb, code(f"{NAMESPACE}/{name}"), code(TYPES.get(name) or TYPES[name.rpartition("/")[2]])


def _name(topic: Topic | str) -> str:
    return topic if isinstance(topic, str) else resolved(topic)
