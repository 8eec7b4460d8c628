"""The policies follow from the roles, and the roles from what the nodes do: nothing is missing, nothing is spare."""

import ast
import os
import subprocess
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import pytest

from hindrax_bag.run_folder import make_run_folder
from hindrax_bringup.network import security
from hindrax_bringup.network.security import (
    FROM_WHEELS,
    KEYSTORE,
    OVERRIDE,
    ROLES,
    Role,
    policies,
    settings,
    with_enclave,
)
from hindrax_bringup.processes import ONBOARD, RECORDER
from hindrax_bringup.share_files import default_vehicle, share_folder
from hindrax_bringup.stack import MockOptions, Stack, adopted, environment_beside, stack_environment
from hindrax_bringup.stack_lock import StackLock
from hindrax_bringup.supervisor import Supervisor
from hindrax_core import topics
from hindrax_core.errors import HindraxError
from hindrax_core.topics import (
    HOLD_SETPOINT,
    OPERATOR_WRENCH,
    THRUSTER_COMMAND,
    TOPICS,
    WRENCH,
    Topic,
    resolved,
)

SOURCES = Path(__file__).parents[2]
NODES_OF_FILE = {
    "hindrax_control/nodes/navigator_node.py": ("navigator",),
    "hindrax_control/nodes/estimator_health_node.py": ("estimator_health",),
    "hindrax_control/nodes/pilot_node.py": ("pilot",),
    "hindrax_control/nodes/allocator_node.py": ("allocator",),
    "hindrax_control/nodes/teleop_node.py": ("teleop",),
    "hindrax_drivers/nodes/thrusters_node.py": ("thrusters",),
    "hindrax_ident/nodes/identifier.py": ("identifier",),
    "hindrax_ident/nodes/measurement_messages.py": ("identifier",),
    "hindrax_bringup/nodes/safety_monitor.py": ("safety_monitor",),
    "hindrax_operator/nodes/operator_node.py": ("operator",),
    "hindrax_operator/nodes/orders.py": ("operator",),
    "hindrax_operator/commissioning_run.py": ("operator",),
    "hindrax_cli/health_checks/nodes.py": ("operator",),
}
"""Files that name a topic of the table and publish or subscribe it."""
SAY, HEAR = {"publisher", "sender"}, {"subscription"}
PEOPLE = {"operator", "teleop", "safety_monitor"}


def roles(node: str) -> list[Role]:
    return [role for role in ROLES if role.node == node]


def uses(source: Path, verbs: set[str]) -> set[Topic]:
    """Topics of the table that a file names as an argument of one of these functions."""
    found: set[Topic] = set()
    text = source.read_text(encoding="utf-8")
    if not any(verb in text for verb in verbs):
        return found
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in verbs:
            names = {getattr(one, "attr", getattr(one, "id", "")) for one in node.args}
            found |= {value for name in names if isinstance(value := getattr(topics, name, None), Topic)}
    return found


def files() -> list[Path]:
    """Sources that name topics; what simulates a vehicle never runs beside a real one."""
    above = ("bringup", "operator", "cli")
    found = [*SOURCES.glob("hindrax_*/hindrax_*/nodes/*.py")]
    found += [file for name in above for file in SOURCES.glob(f"hindrax_{name}/hindrax_{name}/**/*.py")]
    return [file for file in dict.fromkeys(found) if "hindrax_sim" not in file.parts and uses(file, SAY | HEAR)]


@pytest.mark.parametrize("file", files(), ids=lambda file: file.stem)
def test_what_a_node_does_it_may(file: Path) -> None:
    name = str(file.relative_to(SOURCES)).partition("/")[2]
    assert name in NODES_OF_FILE, (
        f"say here which node {name} is, and give it a role in hindrax_bringup/network/security.py"
    )
    for verbs, allowed in ((SAY, "publishes"), (HEAR, "subscribes")):
        granted = {topic for node in NODES_OF_FILE[name] for role in roles(node) for topic in getattr(role, allowed)}
        assert {topic.name for topic in uses(file, verbs)} <= {getattr(topic, "name", topic) for topic in granted}


def test_every_topic_of_the_table_has_somebody_who_may_say_it() -> None:
    printed = {topic for role in ROLES for topic in role.publishes}
    outside = {"joy", "cmd_vel", "/rosout"}
    assert {topic.name for topic in TOPICS if topic not in printed} == outside


def test_only_the_operator_commands_and_only_the_allocator_makes_pulses() -> None:
    def who(topic: Topic) -> set[tuple[str, str]]:
        return {(role.enclave, role.node) for role in ROLES if topic in role.publishes}

    assert who(HOLD_SETPOINT) == {("operator", "operator")}
    assert who(OPERATOR_WRENCH) == {("operator", "operator"), ("operator", "teleop")}
    assert who(WRENCH) == {("control", "pilot")}
    assert who(THRUSTER_COMMAND) == {("control", "allocator"), ("bench", "operator")}
    # The identifier has the pilot fly an experiment, which only the operator begins; it can arm nothing.
    assert {role.enclave for role in ROLES if security.FLY in role.calls} == {"operator", "identifier"}
    assert {role.enclave for role in ROLES if security.RUN in role.calls} == {"operator"}
    assert {role.enclave for role in ROLES if security.SESSION in role.calls} == {"operator"}
    # Control asks only to disarm, on a state that is wrong; a policy cannot tell one request from the other.
    assert {role.enclave for role in ROLES if security.ARM in role.requests} == {
        "operator",
        "safety_monitor",
        "bench",
        "control",
    }


def test_nobody_at_the_far_end_receives_raw_frames() -> None:
    far = [role for role in ROLES if role.enclave in ("operator", "bench")]
    assert not {topic for role in far for topic in role.subscribes} & {
        one for one in TOPICS if one.name.startswith("raw/")
    }


def test_every_process_has_an_enclave_with_every_node_of_it() -> None:
    for process in (*ONBOARD, RECORDER):
        assert set(process.nodes) <= {role.node for role in ROLES if role.enclave == process.name}


def test_the_policies_are_up_to_date() -> None:
    written = (share_folder("security") / "policies.xml").read_text(encoding="utf-8")
    assert written == policies(), "run: ./hindrax reference --write"


def test_the_policies_allow_by_full_name_and_deny_nothing() -> None:
    document = ET.fromstring(policies())
    assert [one.get("path") for one in document.iter("enclave")] == list(security.enclaves())
    names = [one.text for kind in ("topic", "service", "action") for one in document.iter(kind)]
    assert all(name and name.startswith("/") for name in names)
    assert "DENY" not in policies()
    (pilot,) = document.findall(".//profile[@node='pilot']")
    printed = {one.text for one in pilot.findall("./topics[@publish='ALLOW']/topic")}
    assert resolved(WRENCH) in printed
    assert resolved(THRUSTER_COMMAND) not in printed
    assert [one.text for one in pilot.findall("./actions[@execute='ALLOW']/action")] == ["/hindrax/maneuver/fly"]


def test_one_setting_enforces_them(tmp_path: Path) -> None:
    assert settings("", {}) == {}
    with pytest.raises(HindraxError, match="ROS from wheels has no DDS security"):
        settings(str(tmp_path), {FROM_WHEELS: "1"})
    with pytest.raises(HindraxError, match=r"found no keystore at .*make one with .*keystore\.sh"):
        settings(str(tmp_path), {})
    (tmp_path / "enclaves").mkdir()
    made = settings(str(tmp_path), {})
    assert made == {
        "ROS_SECURITY_ENABLE": "true",
        "ROS_SECURITY_STRATEGY": "Enforce",
        "ROS_SECURITY_KEYSTORE": str(tmp_path),
    }
    assert with_enclave(made, "safety_monitor")[OVERRIDE] == "/hindrax/safety_monitor"
    assert with_enclave(made | {OVERRIDE: "/hindrax/bench"}, "operator")[OVERRIDE] == "/hindrax/bench"
    assert OVERRIDE not in with_enclave({}, "safety_monitor")


def settings_of(keystore: Path) -> dict[str, str]:
    return settings(str(keystore), {})


def test_a_mock_beside_a_keystore_is_operated_without_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "enclaves").mkdir()
    monkeypatch.setenv(KEYSTORE, str(tmp_path))
    graph = {"ROS_DOMAIN_ID": "7"}
    mock = StackLock(11, mock=True, vehicle="v.yaml", folder="runs/a", graph=graph)
    assert "ROS_SECURITY_ENABLE" not in environment_beside(mock)
    assert environment_beside(mock)["ROS_DOMAIN_ID"] == "7"
    monkeypatch.setenv(OVERRIDE, "/hindrax/bench")
    secured = replace(mock, mock=False, graph=graph | settings_of(tmp_path))
    assert environment_beside(secured)["ROS_SECURITY_KEYSTORE"] == str(tmp_path)
    assert environment_beside(secured)[OVERRIDE] == "/hindrax/bench", "an identity that the user chose"
    assert OVERRIDE not in environment_beside(mock)


def test_a_mock_that_starts_beside_a_keystore_states_that_it_is_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(Supervisor, "start", lambda *_, **__: None)
    monkeypatch.setattr("hindrax_bringup.stack.first_line", lambda *_: {})
    folder, printed = make_run_folder(str(tmp_path / "run"), default_vehicle(), wanted_bytes=0), []
    for keystore in ("", str(tmp_path)):
        monkeypatch.setenv(KEYSTORE, keystore)
        supervisor = Supervisor(folder.logs, stack_environment(mock=True, domain=None))
        Stack(folder, supervisor).start_mock(MockOptions())
        printed.append(capsys.readouterr().err)
    assert printed == ["", f"{security.unenforced(str(tmp_path))}\n"]
    assert printed[1].startswith(f"{KEYSTORE}: {tmp_path} is not enforced in mock")


def test_a_node_in_the_tool_is_the_operator() -> None:
    secured = {"ROS_SECURITY_ENABLE": "true"}
    with adopted(secured):
        assert os.environ[OVERRIDE] == "/hindrax/operator"
    with adopted({}):
        assert OVERRIDE not in os.environ


ROS2 = """#!/bin/bash
# Stands in for `ros2 security VERB ...`: writes down what it is told, and makes the files that it would.
echo "$*" >>"$CALLS"
case $2 in
  create_keystore) mkdir -p "$3/enclaves" "$3/public" "$3/private" && touch "$3/enclaves/governance.p7s" ;;
  create_enclave) mkdir -p "$3/enclaves$4" && touch "$3/enclaves$4/key.pem" ;;
esac
"""


def test_the_keystore_has_every_enclave_and_the_topside_only_its_own(tmp_path: Path) -> None:
    tool, folder = tmp_path / "bin/ros2", tmp_path / "keys"
    tool.parent.mkdir()
    tool.write_text(ROS2)
    tool.chmod(0o755)
    environment = {"PATH": f"{tool.parent}:/usr/bin:/bin", "CALLS": str(tmp_path / "calls")}
    command = [share_folder("security") / "keystore.sh", folder]
    for _ in range(2):  # again: only the permissions are signed anew
        subprocess.run(command, env=environment, check=True, capture_output=True)
    calls = (tmp_path / "calls").read_text().splitlines()
    assert calls.count(f"security create_keystore {folder}") == 1
    for enclave in security.enclaves():
        assert calls.count(f"security create_enclave {folder} {enclave}") == 1
        permission = f"security create_permission {folder} {enclave} {share_folder('security') / 'policies.xml'}"
        assert calls.count(permission) == 2
    (folder / "enclaves/governance.p7s").unlink()  # as after a first call that ended half way
    subprocess.run(command, env=environment, check=True, capture_output=True)
    assert (tmp_path / "calls").read_text().count("create_keystore") == 2
    topside = tmp_path / "keys-topside"
    assert [path.name for path in (topside / "enclaves/hindrax").iterdir()] == ["operator"]
    assert not (topside / "private").exists()
    assert (folder.stat().st_mode & 0o077, topside.stat().st_mode & 0o077) == (0, 0)


def test_without_ros_the_keystore_states_what_to_install(tmp_path: Path) -> None:
    command = [share_folder("security") / "keystore.sh", tmp_path / "keys"]
    done = subprocess.run(
        command, env={"PATH": "/usr/bin:/bin"}, check=False, capture_output=True, text=True, cwd=tmp_path
    )
    assert done.returncode == 1
    assert "sudo apt install ros-jazzy-sros2" in done.stderr
    assert list(tmp_path.iterdir()) == []
