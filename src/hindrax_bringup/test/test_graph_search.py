"""Which domains are free: by the sockets of this machine, and by the nodes of the graph."""

import socket
import subprocess
import sys
from pathlib import Path

import pytest

from hindrax_bringup.stack import environment, own_domain
from hindrax_core.errors import HindraxError
from hindrax_ros.free_domain import FIRST_PORT, PORTS_PER_DOMAIN, occupied_domains

NODE = """
import sys, rclpy
rclpy.init(args=[])
node = rclpy.create_node(sys.argv[1], namespace="/hindrax")
print("up", flush=True)
sys.stdin.read()
"""


def test_ports_show_the_domains(tmp_path: Path) -> None:
    heading = "  sl  local_address rem_address   st\n"
    table, table6 = tmp_path / "udp", tmp_path / "udp6"
    table.write_text(f"{heading}  1: 00000000:1CE8 00000000:0000 07\n  2: 0100007F:1DEC 00000000:0000 07\n")
    table6.write_text(f"{heading}  1: 00000000000000000000000000000000:0035 0:0 07\n 2: {'0' * 32}:2134 0:0 07\n")
    assert occupied_domains((table, table6, tmp_path / "none")) == {0, 1, 4}


def test_a_domain_in_which_somebody_receives_is_not_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    with own_domain(mock=True) as first:
        assert first is not None
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", FIRST_PORT + PORTS_PER_DOMAIN * first + 10))
        with own_domain(mock=True) as second:
            assert second != first


@pytest.mark.ros
@pytest.mark.parametrize(("name", "refused"), [("pilot", True), ("thrusters", True), ("viewer", False)])
def test_a_mock_does_not_join_the_domain_of_a_stack(
    ros_domain: int, monkeypatch: pytest.MonkeyPatch, name: str, refused: bool
) -> None:
    pytest.importorskip("rclpy", reason="needs the ROS environment")
    made = environment(mock=True, domain=ros_domain)
    words = [sys.executable, "-c", NODE, name]
    with subprocess.Popen(words, env=made, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as node:
        assert node.stdout is not None
        assert node.stdout.readline() == "up\n"
        monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
        if refused:
            wanted = rf"ROS domain {ros_domain}: found the nodes /hindrax/{name} of a stack, wanted none; end that"
            with pytest.raises(HindraxError, match=wanted), own_domain(mock=True):
                pass
        else:
            with own_domain(mock=True) as domain:
                assert domain is None
        node.communicate("")
