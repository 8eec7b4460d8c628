"""Two mock vehicles, /rov1 and /rov2, in one graph: each flies on its own clock, and each is recorded apart."""

import contextlib
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs", reason="needs the built workspace: run ./hindrax test")

from mcap.records import Channel

from hindrax_bag.read.bag_reader import bag_files, messages
from hindrax_bag.read.mcap_records import records
from hindrax_bag.run_folder import RunFolder, make_run_folder
from hindrax_bringup.node_options import ParameterOverrides
from hindrax_bringup.processes import CONTROL, RECORDER, SENSORS, THRUSTERS
from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import MockOptions, Stack, adopted, environment, own_domain
from hindrax_bringup.supervisor import Supervisor
from hindrax_core.topics import NAVIGATION, resolved
from hindrax_operator.nodes.operator_node import Operator
from hindrax_operator.nodes.orders import hold

pytestmark = pytest.mark.ros
PATIENT_S = 90.0
DEPTHS_m = {"/rov1": 0.5, "/rov2": 0.9}
NEAR_m = 0.1
RATE = 3.0
"""Times real time: faster, the first would leave no processor to the second."""


@contextlib.contextmanager
def flying(namespace: str, folder: RunFolder, made: dict[str, str]) -> Iterator[Supervisor]:
    prefix = f"{namespace.strip('/')}/"
    with Supervisor(folder.logs, made) as supervisor:
        stack = Stack(folder, supervisor, "two vehicles", ParameterOverrides(namespace, frame_prefix=prefix))
        stack.start(MockOptions(rate=RATE), record=True, onboard=(RECORDER, SENSORS, THRUSTERS, CONTROL))
        yield supervisor


def depth_m(operator: Operator) -> float:
    return operator.navigation.reading.depth_m if operator.navigation is not None else 0.0


def navigates(operator: Operator) -> bool:
    return operator.navigation is not None


def is_near(operator: Operator, depth: float) -> bool:
    return abs(depth_m(operator) - depth) < NEAR_m


def frames_of(message: Any) -> Iterator[str]:
    """Names of all frames of a message."""
    for one in getattr(message, "transforms", [message]):
        found = (getattr(getattr(one, "header", None), "frame_id", ""), getattr(one, "child_frame_id", ""))
        yield from filter(None, found)


def test_each_flies_by_itself_and_is_recorded_by_itself(tmp_path: Path) -> None:
    folders = {name: make_run_folder(str(tmp_path / name.strip("/")), default_vehicle()) for name in DEPTHS_m}
    with own_domain(mock=True) as domain, contextlib.ExitStack() as both:
        made = environment(mock=True, domain=domain)
        both.enter_context(adopted(made))
        for name, depth in DEPTHS_m.items():
            supervisor = both.enter_context(flying(name, folders[name], made))
            with Operator(mock=True, namespace=name, tick=supervisor.require) as operator:
                operator.wait(partial(navigates, operator), PATIENT_S, lambda: "navigation")
                operator.wait_for_time(PATIENT_S)
                assert "/hindrax" not in {space for _, space in operator.node.get_node_names_and_namespaces()}
                # Seen in the graph is not yet connected, on a busy machine for seconds.
                operator.wait(operator._arm.service_is_ready, PATIENT_S, lambda: "the thrusters")
                operator.arm(seconds=PATIENT_S)
                hold(operator, ["depth"], depth, engaged=True)
                operator.wait(partial(is_near, operator, depth), PATIENT_S, lambda: "the depth")
    for name, folder in folders.items():
        (file,) = bag_files(folder.bag)
        topics = {one.topic for one in records(file) if isinstance(one, Channel)}
        assert f"{name}/navigation/status" in topics
        assert f"{name}/diagnostics" in topics
        assert all(topic.startswith(f"{name}/") for topic in topics), topics
        frames = {frame for one in messages(folder.bag) for frame in frames_of(one.decoded())}
        assert {frame.rpartition("/")[2] for frame in frames} >= {"odom", "base_link", "dvl75_link", "icm20948_link"}
        assert all(frame.startswith(f"{name.strip('/')}/") for frame in frames), sorted(frames)
        # Read, it is a bag as any other: whatever identifies, replays and reports needs no namespace.
        # What the second did, the first did not.
        depths = [one.decoded().depth for one in messages(folder.bag, {resolved(NAVIGATION)})]
        assert depths[-1] == pytest.approx(DEPTHS_m[name], abs=NEAR_m)
