"""A stack has a graph of its own making, a command that of its stack: nothing of the shell's is added or left."""

import os
import socket
from pathlib import Path
from types import SimpleNamespace

import pytest

from hindrax_bringup import ros_graph
from hindrax_bringup.ros_graph import (
    DOMAIN,
    OUR_RMW,
    PROFILE,
    RANGE,
    RMW,
    exported_domain,
    graph_settings,
    missing_rmw,
    set_aside,
    without_missing_rmw,
)
from hindrax_bringup.stack import (
    adopted,
    environment,
    environment_beside,
    own_domain,
    stack_environment,
)
from hindrax_bringup.stack_lock import CLONE, StackLock, require_meant
from hindrax_core.errors import UsageError
from hindrax_ros.free_domain import DOMAIN_ADDRESS

FOREIGN = {
    RMW: "rmw_cyclonedds_cpp",
    RANGE: "OFF",
    "ROS_DISCOVERY_SERVER": "127.0.0.1:11811",
    "ROS_STATIC_PEERS": "10.0.0.1",
    "ROS_LOCALHOST_ONLY": "1",
    "ROS_NAMESPACE": "/other",
    "ROS_SUPER_CLIENT": "1",
    "FASTDDS_BUILTIN_TRANSPORTS": "SHM",
    "FASTDDS_ENVIRONMENT_FILE": "/nowhere.json",
    "RMW_FASTRTPS_USE_QOS_FROM_XML": "1",
    "CYCLONEDDS_URI": "file:///nowhere.xml",
    "ZENOH_CONFIG_OVERRIDE": "mode=client",
}
"""What a .bashrc may hold for another robot."""
PROFILES = dict.fromkeys(ros_graph.PROFILES, "/nowhere.xml")


@pytest.fixture
def shell(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    for name in (DOMAIN, *ros_graph.PROFILES):
        monkeypatch.delenv(name, raising=False)
    for name, value in FOREIGN.items():
        monkeypatch.setenv(name, value)
    return monkeypatch


def test_a_stack_has_nothing_of_the_graph_of_a_shell(shell: pytest.MonkeyPatch) -> None:
    for mock in (True, False):
        made = graph_settings(environment(mock=mock, domain=7))
        assert set(made) == {DOMAIN, RMW, PROFILE, RANGE}
        assert (made[DOMAIN], made[RMW], made[RANGE]) == ("7", OUR_RMW, "SYSTEM_DEFAULT")
    for name, value in PROFILES.items():
        shell.setenv(name, value)
    assert set(graph_settings(environment(mock=True, domain=7))) == {DOMAIN, RMW, PROFILE, RANGE}


def test_a_profile_of_the_user_decides_on_the_graph_of_a_real_vehicle(shell: pytest.MonkeyPatch) -> None:
    shell.setenv(RMW, OUR_RMW)
    for name, value in PROFILES.items():
        with shell.context() as patch:
            patch.setenv(name, value)
            made = environment(mock=False, domain=None)
            assert made[name] == value
            assert {one: made[one] for one in FOREIGN if one != RMW} == {
                one: value for one, value in FOREIGN.items() if one != RMW
            }


def test_a_command_has_exactly_the_graph_of_its_stack(shell: pytest.MonkeyPatch) -> None:
    shell.setenv("ROS_SECURITY_ENABLE", "true")
    graph = graph_settings(stack_environment(mock=True, domain=9))
    stack = StackLock(5, mock=True, vehicle="v", folder="f", graph=graph)
    before = dict(os.environ)
    with adopted(environment_beside(stack)):
        assert graph_settings(os.environ) == stack.graph
        assert os.environ.get("ROS_DISTRO") == before.get("ROS_DISTRO"), "which ROS it is does not change"
    assert dict(os.environ) == before


@pytest.mark.parametrize("found", ["300", "233", "-1", "+5", "abc", " 5", "5 ", "010", "0x10", "1e1", "\u0665"])
def test_a_domain_that_does_not_exist_is_a_sentence(found: str, shell: pytest.MonkeyPatch) -> None:
    shell.setenv(DOMAIN, found)
    with pytest.raises(UsageError, match="wanted 0 to 232"):
        environment(mock=False, domain=None)
    with pytest.raises(UsageError, match="`unset ROS_DOMAIN_ID`"), own_domain(mock=True):
        pass


def test_domains_that_exist() -> None:
    assert [exported_domain({DOMAIN: text}) for text in ("", "0", "42", "232")] == [None, 0, 42, 232]
    assert exported_domain({}) is None


def test_a_middleware_that_is_not_installed_is_named_or_replaced(tmp_path: Path, shell: pytest.MonkeyPatch) -> None:
    folder = tmp_path / ros_graph.RMW_RESOURCES
    folder.mkdir(parents=True)
    (folder / OUR_RMW).touch()
    found = {"AMENT_PREFIX_PATH": f"/nowhere:{tmp_path}"}
    for one in (found, found | {RMW: OUR_RMW}, {RMW: "rmw_unknown"}):  # where nothing is known, the library decides
        assert missing_rmw(one) == ""
        kept = dict(one)
        without_missing_rmw(kept)
        assert kept == one
    replaced = found | {RMW: "rmw_zenoh_cpp"}
    assert missing_rmw(replaced) == f"found rmw_zenoh_cpp, installed is {OUR_RMW}"
    without_missing_rmw(replaced)
    assert replaced[RMW] == OUR_RMW
    shell.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    shell.setenv(PROFILE, "/mine.xml")
    with pytest.raises(UsageError, match=f"installed is {OUR_RMW}; `unset {RMW}`"):
        environment(mock=False, domain=None)


@pytest.mark.usefixtures("shell")
def test_what_a_ros_tool_has_to_unset_to_join() -> None:
    made = environment(mock=True, domain=3)
    assert set_aside(os.environ, made) == sorted(set(FOREIGN) - {RMW, RANGE})


def test_a_domain_in_use_is_reserved_without_a_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv(DOMAIN, raising=False)
    with own_domain(mock=True) as first, own_domain(mock=True) as second:
        assert first is not None
        assert second is not None
        assert first < second
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as other, pytest.raises(OSError, match="in use"):
            other.bind(DOMAIN_ADDRESS.format(first))
    assert list(tmp_path.iterdir()) == []


STACK = StackLock(5, mock=True, vehicle="v", folder="runs/a", graph={DOMAIN: "62"}, clone="/clones/a")


@pytest.mark.parametrize(
    ("terminal", "wrong"),
    [
        ({}, ""),
        ({DOMAIN: "62", CLONE: "/clones/a"}, ""),
        ({CLONE: "/clones/../clones/a/"}, ""),
        ({DOMAIN: "61"}, r"which is in ROS domain 62, and ROS_DOMAIN_ID=61 is set here; if you mean it, add --stack 5"),
        ({CLONE: "/clones/b"}, r"which is of the clone /clones/a; if you mean it, add --stack 5"),
        (
            {DOMAIN: "0", CLONE: "/clones/b"},
            r"which is in ROS domain 62, and ROS_DOMAIN_ID=0 is set here and is of the clone /clones/a",
        ),
    ],
)
def test_an_order_is_for_a_stack_that_its_terminal_can_mean(terminal: dict[str, str], wrong: str) -> None:
    if not wrong:
        require_meant(STACK, terminal)
        return
    with pytest.raises(UsageError, match=r"found v \(mock\), ROS domain 62, process 5, runs/a, " + wrong):
        require_meant(STACK, terminal)


@pytest.mark.parametrize(("free", "found"), [(0, "is full: 0 kB are free, 65 kB are wanted; remove"), (1 << 20, "")])
def test_shared_memory_without_room_is_named_with_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, free: int, found: str
) -> None:
    """`import rclpy` dies there of a bus error, without a word."""
    monkeypatch.setattr("hindrax_bringup.ros_graph.shutil.disk_usage", lambda _place: SimpleNamespace(free=free))
    why = ros_graph.full_shared_memory(tmp_path)
    assert found in why
    assert bool(why) == bool(found)


def test_where_there_is_no_shared_memory_none_is_full(tmp_path: Path) -> None:
    assert not ros_graph.full_shared_memory(tmp_path / "none")
