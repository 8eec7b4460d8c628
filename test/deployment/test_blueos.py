"""The extension of BlueOS: its labels are what BlueOS reads, and its two processes live and end together.

Labels as in the README of Blue Robotics' repository of extensions; `permissions` is the body of Docker's "create a
container" (Engine API 1.43, ContainerCreate).
"""

import json
import os
import re
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest

from hindrax_bringup.share_files import default_vehicle
from hindrax_cli.command_line import main
from hindrax_cli.commands.operate.view import PORT
from hindrax_core.vehicle import load_vehicle
from hindrax_operator.web.http_server import SERVICE

ROOT = Path(__file__).parents[2]
BLUEOS = ROOT / "docker/blueos"
DOCKERFILE = (BLUEOS / "Dockerfile").read_text()
VERSION = (ROOT / "VERSION").read_text().strip()
ONE_LINE = DOCKERFILE.replace("\\\n", "")
LABELS = dict(re.findall(r"""^LABEL (\w+)=["'](.*)["']$""", ONE_LINE, re.MULTILINE))
PAGE_FILE = ROOT / "docs/how-to/blueos-extension.md"
OF_BLUEOS = {14000, 14001, 14550, 14551, 14552, 14553, 14554, 14660}
"""Ports at which the router of BlueOS and its programs listen by default: 14660 is the heading for a Ping360."""
TYPES = {"device-integration", "example", "theme", "other", "tool"}


def test_it_has_the_labels_that_blueos_reads() -> None:
    assert set(LABELS) == {
        "version",
        "permissions",
        "authors",
        "company",
        "type",
        "tags",
        "readme",
        "links",
        "requirements",
    }
    parsed = {name: json.loads(LABELS[name]) for name in ("permissions", "authors", "company", "tags", "links")}
    assert all(set(one) == {"name", "email"} for one in parsed["authors"])
    assert {"about", "name", "email"} == set(parsed["company"])
    assert all(isinstance(one, str) for one in parsed["tags"])
    assert len(parsed["tags"]) <= 10
    assert LABELS["type"] in TYPES
    assert LABELS["requirements"] == "core >= 1.4", "the first that forwards /extensionv2/NAME/ to a page"
    assert (ROOT / LABELS["readme"]).is_file()
    bake = json.loads((BLUEOS / "bake.json").read_text())["target"]
    assert bake["extension"]["tags"] == [f"hindrax-blueos:{VERSION}"]
    assert LABELS["version"] == SERVICE["version"] == VERSION
    for target in bake.values():
        assert (ROOT / target["context"] / target["dockerfile"]).is_file()
        assert target["platforms"] == ["linux/arm64", "linux/amd64"]


def test_the_folder_of_running_stacks_belongs_to_who_runs_them() -> None:
    """A folder of another user is refused, so in the first image that was built nothing could have come up."""
    below = (ROOT / "docker/Dockerfile").read_text()
    (folder,) = re.findall(r"HINDRAX_RUNTIME_DIR=(\S+)", below)
    assert "USER 1100" in below
    assert re.search(r"^USER 0\n", DOCKERFILE, re.MULTILINE)
    assert f"\nRUN chown root:root {folder}\n" in DOCKERFILE


def test_it_may_do_no_more_than_serve_its_page_hear_mavlink_and_keep_its_data() -> None:
    permissions: dict[str, Any] = json.loads(LABELS["permissions"])
    host = permissions["HostConfig"]
    assert not set(host) & {"Privileged", "NetworkMode", "Devices", "CapAdd"}
    ports = host["PortBindings"]
    assert set(permissions["ExposedPorts"]) == set(ports) == {f"{PORT}/tcp", "14550/udp"}
    # BlueOS looks for the page at every port.
    page, autopilot = (one[0]["HostPort"] for one in ports.values())
    assert page == ""
    assert int(autopilot) not in OF_BLUEOS, "Docker starts no container whose port is taken"
    assert f"127.0.0.1, port {autopilot}." in PAGE_FILE.read_text(encoding="utf-8")
    heavy = load_vehicle(default_vehicle().parent / "bluerov2-heavy.yaml")
    assert heavy.output.port == "udpin:0.0.0.0:14550"
    (bind,) = host["Binds"]
    assert bind.partition(":")[0].startswith("/usr/blueos/extensions/")
    folder = bind.partition(":")[2]
    assert f"WORKDIR {folder}\n" in DOCKERFILE, "runs are written to the working folder"
    assert f"HINDRAX_VEHICLE={folder}/" in DOCKERFILE


FAKE = """#!/bin/sh
if [ "$1" = status ]; then
  [ -f up ] && echo '{"stack": 1}'
  exit 0
fi
echo "$$ $*" >>calls
case $1 in
  vehicle) touch "$HINDRAX_VEHICLE" ;;
  up) sleep 0.1; touch up; exec sleep 30 ;;
  web) [ -f up ] || exit 3; exec sleep 30 ;;
esac
"""
"""Stand-in for the tool; its page finds no vehicle unless a stack is up."""


def started(folder: Path) -> "subprocess.Popen[bytes]":
    fake = folder / "fake"
    fake.write_text(FAKE)
    fake.chmod(0o755)
    words = {"HINDRAX": str(fake), "HINDRAX_VEHICLE": str(folder / "vehicle.yaml"), "HINDRAX_HOSTS": "a.local 10.0.0.2"}
    return subprocess.Popen([BLUEOS / "start.sh"], cwd=folder, env={**os.environ, **words}, start_new_session=True)


def calls(folder: Path, wanted: int) -> dict[str, int]:
    """Commands that were called, once there are as many as wanted: command -> process."""
    for _ in range(500):
        lines = (folder / "calls").read_text().splitlines() if (folder / "calls").exists() else []
        if len(lines) >= wanted:
            return {words: int(process) for process, _, words in (line.partition(" ") for line in lines)}
        time.sleep(0.01)
    raise AssertionError(lines)


@pytest.mark.parametrize("ended", ["", "up --record", "web"])
def test_stack_and_page_live_and_end_together(tmp_path: Path, ended: str) -> None:
    script = started(tmp_path)
    try:
        found = calls(tmp_path, 3)
        new, *both = found
        assert new == f"vehicle new rov --from udpin:0.0.0.0:14550 --out {tmp_path}/vehicle.yaml"
        assert sorted(both) == ["up --record", "web --address 0.0.0.0 --host a.local --host 10.0.0.2"]
        process = next((pid for words, pid in found.items() if ended and words.startswith(ended)), script.pid)
        os.kill(process, signal.SIGTERM)
        assert script.wait(10) not in (0, 3)
        for words in both:
            with pytest.raises(ProcessLookupError):
                os.kill(found[words], 0)
    finally:
        script.kill()
        script.wait()


def test_its_commands_are_taken(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["vehicle", "new"], ["up"], ["web"]):
        with pytest.raises(SystemExit) as ended:
            main([*words, "--help"])
        assert ended.value.code == 0
        text = capsys.readouterr().out
        for option in {"vehicle": ("--from", "--out"), "up": ("--record",), "web": ("--address", "--host")}[words[0]]:
            assert option in text
