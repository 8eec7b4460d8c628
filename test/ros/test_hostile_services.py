"""The services that every node has, asked for nonsense: each answers, says what is wrong, and nobody dies of it.

A client in a process of its own, against every node of a stack in mock with recorder, and the node `teleop`.
"""

import contextlib
import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import psutil
import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import hostile
import rclpy
from builtin_interfaces.msg import Time
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import Trigger
from type_description_interfaces.srv import GetTypeDescription

from hindrax_bringup.network import security
from hindrax_bringup.network.security import ROLES
from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import adopted
from hindrax_bringup.stack_lock import FOLDER
from hindrax_core.topics import NAMESPACE, THRUSTER_STATE, TOPICS
from hindrax_core.vehicle import load_vehicle
from hindrax_msgs.srv import Arm, Recentre
from hindrax_ros.graph import publisher, subscription
from hindrax_ros.messages.convert import stamp_to_msg
from hindrax_ros.messages.serialization import message_class
from hindrax_tools.reference.graph import edges

pytestmark = pytest.mark.ros

PATIENT_S = 60.0
AT_ONCE = 8
NEUTRAL_us, TOLERANCE_us = 1500.0, 2.0
NODES = {
    *("sensors", "dvl75", "ping1d", "icm20948", "ms5837", "thrusters", "navigator", "pilot", "allocator"),
    *("identifier", "recorder", "safety_monitor", "teleop"),
}
DEVICES = set(load_vehicle(default_vehicle()).sensors) | {"thrusters"}
OF_EVERY_NODE = {"/rosout", "/parameter_events", "/clock"}
NAMES = ["", " ", "no.such.thing", "use_sim_time", "\u2620" * 5000, "start_type_description_service", "/", "a b\n"]
TYPES = (*range(12), 127, 255)


def values(kind: int) -> list[ParameterValue]:
    """Values that claim to be of a type: empty, and with something in every field."""
    full = ParameterValue(
        type=kind,
        bool_value=True,
        integer_value=-(2**63),
        double_value=float("nan"),
        string_value="\0\u2620",
        byte_array_value=[b"\xff"],
        bool_array_value=[True],
        integer_array_value=[2**63 - 1],
        double_array_value=[float("inf")],
        string_array_value=["", "\n"],
    )
    return [ParameterValue(type=kind), full]


def parameters(known: list[str]) -> list[Parameter]:
    """Parameters as a stranger would set them: unknown names and known ones, every type there is and is not.

    One known name of each node gets the empty values as well: the types are judged by what all parameters share.
    """
    full = [Parameter(name=name, value=values(kind)[-1]) for name in known for kind in TYPES]
    names = [*NAMES, known[-1]]
    return [*full, *(Parameter(name=name, value=value) for name in names for kind in TYPES for value in values(kind))]


class Client:
    """Asks nodes, one request at a time for each service."""

    def __init__(self) -> None:
        rclpy.init(args=[])
        self.node = rclpy.create_node("stranger", namespace=NAMESPACE)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._asked: dict[str, Any] = {}

    def until(self, done: Callable[[], Any], what: str) -> None:
        deadline = time.monotonic() + PATIENT_S
        while not done():
            assert time.monotonic() < deadline, f"waited for {what}"
            self._executor.spin_once(timeout_sec=0.05)

    def ask(self, kind: Any, name: str, *requests: Any) -> Any:
        """Answer of a service; of several requests the last one's."""
        return self.answers(kind, name, requests)[-1]

    def answers(self, kind: Any, name: str, requests: Sequence[Any]) -> list[Any]:
        """Answer of a service to each request; as many are under way as its queue holds."""
        client = self._asked.get(name)
        if client is None:
            client = self._asked[name] = self.node.create_client(kind, f"{NAMESPACE}/{name}")
            self.until(client.service_is_ready, name)
        found: list[Any] = []
        for first in range(0, len(requests), AT_ONCE):
            sent = [client.call_async(one) for one in requests[first : first + AT_ONCE]]
            self.until(lambda: all(one.done() for one in sent), f"answers of {name}")  # noqa: B023  # it waits here
            found += [one.result() for one in sent]
        return found

    def parameters_of(self, name: str) -> list[str]:
        return list(self.ask(ListParameters, f"{name}/list_parameters", ListParameters.Request()).result.names)

    def edges_of(self, name: str) -> set[tuple[str, ...]]:
        """Topics that a node subscribes to and publishes, and its services, but for those of every node."""
        of = {
            "subscribes": self.node.get_subscriber_names_and_types_by_node(name, NAMESPACE),
            "publishes": self.node.get_publisher_names_and_types_by_node(name, NAMESPACE),
            "serves": self.node.get_service_names_and_types_by_node(name, NAMESPACE),
        }
        own = f"{NAMESPACE}/{name}/"
        common = {*OF_EVERY_NODE, *(own + one for one in (*security.OF_EVERY_NODE, *security.OF_A_LIFECYCLE))}
        return {
            (verb, edge, *kinds)
            for verb, found in of.items()
            for edge, kinds in found
            if edge not in common and "/_action/" not in edge and edge != f"{own}transition_event"
        }

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown()


def start(
    words: list[str], environment: dict[str, str], log: Path, running: contextlib.ExitStack, code: int = 0
) -> subprocess.Popen[bytes]:
    """Start a process that is ended with the stack of contexts, by Ctrl-C and with this code."""
    with log.open("w") as errors:
        made = subprocess.Popen([sys.executable, "-m", *words], env=environment, stdout=errors, stderr=errors)

    def end() -> None:
        made.send_signal(signal.SIGINT)
        assert made.wait(PATIENT_S) == code, log.read_text()

    running.callback(end)
    return made


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[psutil.Process]:
    """The tool that keeps a stack, with this process and the node `teleop` in its graph."""
    folder = tmp_path_factory.mktemp("hostile")
    runtime = folder / "runtime"
    made = {key: value for key, value in os.environ.items() if key != "ROS_DOMAIN_ID"} | {FOLDER: str(runtime)}
    up = ["hindrax_cli", "up", "--mock", "--record", "--out", str(folder / "run")]
    with contextlib.ExitStack() as running:
        child = start(up, made, folder / "up.log", running, 130)
        deadline = time.monotonic() + PATIENT_S
        while "thrusters: ok" not in (folder / "up.log").read_text():
            assert time.monotonic() < deadline, (folder / "up.log").read_text()
            assert child.poll() is None, (folder / "up.log").read_text()
            time.sleep(0.2)
        (file,) = runtime.glob("*.json")
        graph = made | json.loads(file.read_text())["graph"]
        words = ["hindrax_control.nodes.teleop_node", "--ros-args", "-p", f"vehicle:={default_vehicle()}"]
        teleop = start(words, graph, folder / "teleop.log", running)
        with adopted(graph):
            yield psutil.Process(child.pid)
        assert teleop.poll() is None, (folder / "teleop.log").read_text()


def family(process: psutil.Process) -> set[int]:
    return {one.pid for one in process.children(recursive=True)}


def test_nonsense_is_refused_and_ends_nobody(stack: psutil.Process) -> None:
    with contextlib.closing(Client()) as client:
        client.until(lambda: set(client.node.get_node_names()) >= NODES, f"all of {NODES}")
        before = family(stack)
        for name in sorted(NODES):
            known = client.parameters_of(name)
            assert known
            sweep_setting(client, name, parameters(known))
            sweep_reading(client, name, [*NAMES, *known])
            assert client.parameters_of(name) == known
        assert family(stack) == before


def test_nonsense_on_every_recorded_topic_ends_nobody_and_moves_nothing(stack: psutil.Process) -> None:
    """Thrusters, recorder and safety monitor too, in their own processes."""
    topics = [topic for topic in TOPICS if topic.recorded]
    states: list[Any] = []
    with contextlib.closing(Client()) as client:
        says = {topic: publisher(client.node, topic) for topic in topics}
        client.until(lambda: all(one.get_subscription_count() for one in says.values()), "readers of every topic")
        subscription(client.node, THRUSTER_STATE, states.append)
        before, now = family(stack), stamp_to_msg(time.time_ns())
        for topic, say in says.items():
            for message in hostile.floods(message_class(topic.type), now, every=31):
                say.publish(message)
                client._executor.spin_once(timeout_sec=0.0)
        states.clear()
        client.until(lambda: sum(one.output == "pca9685" for one in states) > 25, "states of the thrusters")
        reported = [one for one in states if one.output == "pca9685"]
        assert {one.state for one in reported} == {"disarmed"}
        assert all(abs(pulse - NEUTRAL_us) < TOLERANCE_us for one in reported for pulse in one.pulses)
        assert family(stack) == before


def test_nonsense_in_every_other_request_is_refused(stack: psutil.Process) -> None:
    """Nobody arms, no state changes, and each answer is an answer."""
    with contextlib.closing(Client()) as client:
        before, states = family(stack), {}
        arming = list(hostile.floods(Arm.Request, Time(), every=31))
        for request in arming:
            request.arm = True
        for answer in client.answers(Arm, "thrusters/arm", arming):
            assert not answer.accepted
            assert answer.reason
        places = list(hostile.floods(Recentre.Request, Time(), every=3))
        for asked, answer in zip(places, client.answers(Recentre, "maneuver/recentre", places), strict=True):
            assert answer.reason or (answer.accepted and math.isnan(asked.x) and math.isnan(asked.y)), asked
        for name in sorted(DEVICES):
            states[name] = client.ask(GetState, f"{name}/get_state", GetState.Request()).current_state.id
            changes = list(hostile.floods(ChangeState.Request, Time(), every=61))
            assert not any(one.success for one in client.answers(ChangeState, f"{name}/change_state", changes))
        for name, kind in states.items():
            assert client.ask(GetState, f"{name}/get_state", GetState.Request()).current_state.id == kind, name
        for name in ("ident/assess", "ping1d/request_profile"):
            assert client.ask(Trigger, name, Trigger.Request()) is not None
        assert family(stack) == before


@pytest.mark.usefixtures("stack")
def test_no_node_subscribes_publishes_or_serves_what_the_reference_does_not_list() -> None:
    with contextlib.closing(Client()) as client:
        client.until(lambda: set(client.node.get_node_names()) >= NODES, f"all of {NODES}")
        for name in sorted(NODES - {"sensors", "teleop"}):
            (role,) = (one for one in ROLES if one.node == name and one.enclave != "bench")
            client.until(partial(client.edges_of, name), f"the edges of {name}")
            assert client.edges_of(name) <= set(edges(role)), name


def sweep_setting(client: Client, name: str, wanted: list[Parameter]) -> None:
    """All at once, atomically too: what is refused has a reason, and a type that is none is refused."""
    service = f"{name}/set_parameters"
    results = client.ask(SetParameters, service, SetParameters.Request(parameters=wanted)).results
    assert len(results) == len(wanted)
    for one, result in zip(wanted, results, strict=True):
        # Zero, false and an empty text (not set) fit some parameters of a running node, which lives on with them.
        fits = one.value.type == ParameterType.PARAMETER_BOOL or one.value == ParameterValue(type=one.value.type)
        fits = fits or (
            one.value.type == ParameterType.PARAMETER_STRING and not one.value.string_value.strip("\0\u2620")
        )
        assert result.reason or (result.successful and fits), f"{name}: {one}"
        strange = one.value.type not in range(1, ParameterType.PARAMETER_STRING_ARRAY + 1)
        unset = one.value.type == ParameterType.PARAMETER_NOT_SET and result.successful  # as it was
        if one.name not in NAMES and strange and not unset:
            assert f"found the type {one.value.type}, wanted" in result.reason
    request = SetParametersAtomically.Request(parameters=wanted)
    result = client.ask(SetParametersAtomically, f"{service}_atomically", request).result
    assert not result.successful
    assert result.reason


def sweep_reading(client: Client, name: str, names: list[str]) -> None:
    """What only reads answers too, whatever it is asked for."""
    lists = ([], names, *([one] for one in NAMES))
    client.ask(GetParameters, f"{name}/get_parameters", *(GetParameters.Request(names=one) for one in lists))
    client.ask(
        GetParameterTypes, f"{name}/get_parameter_types", *(GetParameterTypes.Request(names=one) for one in lists)
    )
    client.ask(
        DescribeParameters, f"{name}/describe_parameters", *(DescribeParameters.Request(names=one) for one in lists)
    )
    deep = [ListParameters.Request(prefixes=one, depth=depth) for one in lists for depth in (0, 1, 2**64 - 1)]
    client.ask(ListParameters, f"{name}/list_parameters", *deep)
    kinds = (("", False), ("no/such/Type", True), ("std_msgs/msg/String", True), ("\u2620", True))
    described = [
        GetTypeDescription.Request(type_name=kind, type_hash="RIHS01_0", include_type_sources=sources)
        for kind, sources in kinds
    ]
    client.ask(GetTypeDescription, f"{name}/get_type_description", *described)
