"""Vehicle and topside on one graph over the tether, and nobody else: in network namespaces, with the mock vehicle."""

import importlib.util
import json
import threading
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from deployment.machines import ROOT, TOPSIDE, VEHICLE, Machines, ip, three_machines

from hindrax_bringup.network.security import policies

HERE = ROOT / "test/deployment"
CUT_S, SILENT_S = 10.0, 3.0
PATIENT_S = 120.0
STRANGER_S = 4.0
TETHER_bps = 10e6

pytestmark = [
    pytest.mark.ros,
    pytest.mark.root,
    pytest.mark.skipif(
        importlib.util.find_spec("hindrax_msgs") is None, reason="needs the built workspace: run ./hindrax test"
    ),
]
UP = ("-m", "hindrax_cli", "up", "--mock", "--set", "thrusters.arming_s:=1.0")


@pytest.fixture(scope="module")
def machines(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Machines]:
    with three_machines(tmp_path_factory.mktemp("machines")) as made:
        yield made


def wait_for_words(path: Path, words: str) -> None:
    deadline = time.monotonic() + PATIENT_S
    while words not in path.read_text():
        assert time.monotonic() < deadline, path.read_text()
        time.sleep(0.2)


@pytest.fixture(scope="module")
def vehicle(machines: Machines) -> Machines:
    """The vehicle is started before its tether has carrier, and waits for it."""
    machines.tether("down")
    machines.start(machines.vehicle, [*UP, "--tether", f"tether:{TOPSIDE}", "--out", str(machines.folder / "run")])
    wait_for_words(machines.errors(machines.vehicle), "waiting for the tether; tether: no carrier")
    machines.tether("up")
    wait_for_words(machines.errors(machines.vehicle), "thrusters: ok")
    return machines


def report_of_a_stranger(machines: Machines, machine: str, *asked: str) -> dict[str, object]:
    child = machines.start_stranger(machine, asked, STRANGER_S)
    out, _ = child.communicate(timeout=PATIENT_S)
    assert child.returncode == 0, machines.errors(machine).read_text()
    found: dict[str, object] = json.loads(out)
    return found


def test_without_a_tether_nobody_outside_the_machine_is_answered(machines: Machines) -> None:
    child = machines.start(machines.vehicle, [str(HERE / "stand_in_vehicle.py")])
    nothing = {"nodes": [], "heard": 0, "readers": 0, "arm": False}
    assert report_of_a_stranger(machines, machines.vehicle, "127.0.0.1")["heard"], "he knows how"
    assert report_of_a_stranger(machines, machines.elsewhere, VEHICLE, "10.77.0.2") == nothing
    assert report_of_a_stranger(machines, machines.topside, VEHICLE) == nothing
    child.terminate()
    child.wait(PATIENT_S)


def test_the_doctor_at_the_far_end_sees_tether_and_clocks(machines: Machines) -> None:
    child = machines.start(machines.vehicle, [str(HERE / "stand_in_vehicle.py")], HINDRAX_TETHER=f"tether:{TOPSIDE}")
    words = ["-m", "hindrax_cli", "doctor", "--topside", "--json", "--tether", f"tether:{VEHICLE}"]
    out, _ = machines.start(machines.topside, words).communicate(timeout=PATIENT_S)
    checks = {one["name"]: one for one in json.loads(out)["checks"]}
    assert checks["tether"]["found"] == f"tether is {TOPSIDE}; at its other end {VEHICLE}"
    assert checks["clocks"]["ok"], checks["clocks"]
    assert checks["clocks"]["found"].startswith("the vehicle's stamps arrive ")
    child.terminate()
    child.wait(PATIENT_S)


def test_a_stranger_elsewhere_sees_nobody_and_moves_nothing(vehicle: Machines) -> None:
    ip("-n", vehicle.elsewhere, "addr", "add", "192.168.77.50/32", "dev", "harbor")
    found = report_of_a_stranger(vehicle, vehicle.elsewhere, VEHICLE, "10.77.0.2")
    assert found == {"nodes": [], "heard": 0, "readers": 0, "arm": False}
    # The same stranger at the tether would: what keeps him out is where he is, not that he does not know how.
    found = report_of_a_stranger(vehicle, vehicle.topside, VEHICLE)
    assert found["heard"]
    assert found["readers"]
    assert found["arm"]


def test_a_cut_in_mid_maneuver_ends_in_holds_and_full_recovery(
    vehicle: Machines, record_property: Callable[[str, object], None]
) -> None:
    child = vehicle.start(vehicle.topside, [str(HERE / "topside.py")], HINDRAX_TETHER=f"tether:{VEHICLE}")
    alarm = threading.Timer(PATIENT_S, child.kill)
    alarm.start()
    events = {}
    assert child.stdout is not None
    for line in child.stdout:
        reported = json.loads(line)
        events[reported["event"]] = reported
        if reported["event"] == "flying":
            rate_bps = 8.0 * sent_per_second(vehicle)
            vehicle.tether("down")
        elif reported["event"] == "cut":
            time.sleep(CUT_S - SILENT_S)
            vehicle.tether("up")
    alarm.cancel()
    assert child.wait() == 0, vehicle.errors(vehicle.topside).read_text()
    record_property("tether_Mbps", rate_bps / 1e6)
    record_property("cut_s", events["back"]["cut_s"])
    assert rate_bps < TETHER_bps / 4
    assert events["found"]["armed"]
    assert {"depth", "altitude"} & set(events["found"]["held"])
    assert events["back"]["cut_s"] > CUT_S - 1.0
    assert events["found"]["depth_m"] > 0.3
    assert "disarmed" in events
    assert_allowed(events["flying"]["graph"])
    printed = vehicle.errors(vehicle.vehicle).read_text()
    assert "link: no operator for 2 s; maneuvers end, holds stay" in printed
    assert "link: the operator is back after" in printed


def sent_per_second(machines: Machines, seconds: float = 3.0) -> float:
    before, begin = machines.sent_bytes(), time.monotonic()
    time.sleep(seconds)
    return (machines.sent_bytes() - before) / (time.monotonic() - begin)


def assert_allowed(graph: dict[str, dict[str, list[str]]]) -> None:
    """Everything that the running nodes do is in their roles: with the policies enforced they would still run."""
    assert {"dvl75", "thrusters", "pilot", "allocator", "navigator", "identifier", "safety_monitor"} <= set(graph)
    document = ET.fromstring(policies())
    paths = {
        "says": "topics[@publish]/topic",
        "hears": "topics[@subscribe]/topic",
        "answers": "services[@reply]/service",
    }
    del graph["mock"]  # a real vehicle has none
    for node, found in graph.items():
        profiles = document.findall(f".//profile[@node='{node}']")
        for verb, path in paths.items():
            allowed = {one.text for profile in profiles for one in profile.findall(path)}
            actual = {name for name in found[verb] if "/_action/" not in name}
            assert actual <= allowed, f"{node} {verb} what its role has not: hindrax_bringup/network/security.py"
