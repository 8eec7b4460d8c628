"""The tether: how it is named, when it is there, how the middleware uses it, and who is at its other end."""

import argparse
import json
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from hindrax_bringup import stack_runner
from hindrax_bringup.liveness import NOBODY, stacks_well, tool_liveness
from hindrax_bringup.network import tether
from hindrax_bringup.network.tether import (
    GROUP,
    SETTING,
    SPACE,
    Tether,
    add_tether,
    address_of,
    available_tether,
    loopback_profile,
    parse_tether,
    profile_file,
    tether_profile,
    tether_setting,
    wait_for_address,
)
from hindrax_bringup.ros_graph import PROFILE
from hindrax_bringup.stack import environment
from hindrax_bringup.stack_lock import FOLDER
from hindrax_bringup.stack_runner import _require_same, awaited
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.signals import Navigation
from hindrax_ros.standstill import LONGEST_STANDSTILL_S

NAMES = {"d": SPACE}


@pytest.fixture(autouse=True)
def own_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path / "runtime"))
    monkeypatch.setenv(SETTING, "")


def test_names() -> None:
    assert parse_tether("") is None
    assert parse_tether("eth0") == Tether("eth0")
    assert parse_tether("enp3s0:192.168.2.1,192.168.2.3") == Tether("enp3s0", ("192.168.2.1", "192.168.2.3"))


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        ("lo", "lo leads to no other machine"),
        ("eth0; rm", "wanted one as `ip link` names them"),
        (":192.168.2.1", "wanted one as `ip link` names them"),
        ("averylonginterface", "wanted one as `ip link` names them"),
        ("eth0:topside", "found peer 'topside', wanted an IPv4 address"),
        ("eth0:192.168.2.1,", "found peer '', wanted an IPv4 address"),
    ],
)
def test_what_is_no_tether_is_refused(words: str, wanted: str) -> None:
    with pytest.raises(UsageError, match=wanted):
        parse_tether(words)


def test_the_option_is_the_setting(capsys: pytest.CaptureFixture[str]) -> None:
    parser = argparse.ArgumentParser()
    add_tether(parser)
    assert tether_setting() is None
    parser.parse_args(["--tether", "eth0:192.168.2.1"])
    assert tether_setting() == Tether("eth0", ("192.168.2.1",))
    with pytest.raises(SystemExit):
        parser.parse_args(["--tether", "eth0:nobody"])
    assert "wanted an IPv4 address" in capsys.readouterr().err


def test_an_interface_that_is_not_ready_states_why(tmp_path: Path) -> None:
    with pytest.raises(HindraxError, match="eth7: no such interface"):
        address_of("eth7", tmp_path)
    (tmp_path / "eth7").mkdir()
    with pytest.raises(HindraxError, match="eth7: is down; `sudo ip link set eth7 up`"):
        address_of("eth7", tmp_path)
    (tmp_path / "eth7" / "carrier").write_text("0\n")
    with pytest.raises(HindraxError, match="eth7: no carrier"):
        address_of("eth7", tmp_path)
    (tmp_path / "eth7" / "carrier").write_text("1\n")
    with pytest.raises(HindraxError, match="eth7: no IPv4 address"):
        address_of("eth7", tmp_path)


def test_an_interface_with_an_address() -> None:
    assert address_of("lo") == "127.0.0.1"


def test_work_that_does_not_wait_goes_without_a_tether_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    printed: list[str] = []
    assert available_tether(printed.append) is None
    monkeypatch.setenv(SETTING, "nowhere0:192.168.2.1")
    assert available_tether(printed.append) is None
    assert printed == ["without the tether: nowhere0: no such interface; `ip link` lists them"]
    monkeypatch.setattr(tether, "address_of", lambda _interface: "192.168.2.2")
    assert available_tether(printed.append) == Tether("nowhere0", ("192.168.2.1",))


def test_waiting_states_each_reason_once_and_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = iter(["no carrier", "no carrier", "no address", ""])

    def look(_name: Navigation) -> str:
        reason = next(answers)
        if reason:
            raise HindraxError(reason)
        return "192.168.2.2"

    monkeypatch.setattr(tether, "address_of", look)
    monkeypatch.setattr(tether, "LOOK_S", 0.0)
    printed: list[str] = []
    assert wait_for_address(Tether("eth0"), 10.0, lambda: False, printed.append) == "192.168.2.2"
    assert printed == ["waiting for the tether; no carrier", "waiting for the tether; no address"]
    assert wait_for_address(Tether("eth0"), 10.0, lambda: True, printed.append) == ""


def test_waiting_in_vain_names_what_was_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tether, "LOOK_S", 0.0)
    with pytest.raises(HindraxError, match="waited 0 s for the tether; nowhere0: no such interface"):
        wait_for_address(Tether("nowhere0"), 0.0, lambda: False, lambda _sentence: None)


def test_the_profile_allows_loopback_and_the_tether_and_asks_the_peers() -> None:
    text = tether_profile(Tether("eth0", ("192.168.2.1",)), loopback_profile().read_text())
    profile = ET.fromstring(text)
    allowed = profile.findall(".//d:allowlist/d:interface", NAMES)
    assert [(one.get("name"), one.get("netmask_filter")) for one in allowed] == [("lo", "ON"), ("eth0", "ON")]
    assert profile.find(".//d:interfaceWhiteList", NAMES) is None
    peers = [one.text for one in profile.findall(".//d:initialPeersList//d:address", NAMES)]
    assert peers == [GROUP, "192.168.2.1"]
    assert profile.findtext(".//d:useBuiltinTransports", None, NAMES) == "false"
    (often,) = profile.findall(".//d:leaseAnnouncement", NAMES)
    assert [(one.tag.rpartition("}")[2], one.text) for one in often] == [("sec", "1")], "each goes to 32 ports"


@pytest.mark.parametrize("tether", [False, True])
def test_nobody_is_forgotten_before_it_would_begin_anew(*, tether: bool) -> None:
    """A lease ends so long after the last announcement; a process that stood still for less goes on (ADR 13)."""
    text = loopback_profile().read_text()
    profile = ET.fromstring(tether_profile(Tether("eth0"), text) if tether else text)

    def seconds(name: str) -> float:
        (found,) = profile.findall(f".//d:{name}", NAMES)
        units = {"sec": 1.0, "nanosec": 1e-9}
        return sum(float(one.text or "nan") * units[one.tag.rpartition("}")[2]] for one in found)

    assert seconds("leaseDuration") - seconds("leaseAnnouncement") >= LONGEST_STANDSTILL_S


def test_without_peers_they_are_found_by_multicast() -> None:
    profile = ET.fromstring(tether_profile(Tether("eth0"), loopback_profile().read_text()))
    assert profile.find(".//d:initialPeersList", NAMES) is None


def test_the_environment_reaches_over_the_tether_only_when_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(PROFILE, raising=False)
    assert environment(mock=True, domain=3)[PROFILE] == str(loopback_profile())
    made = environment(mock=False, domain=None, tether=Tether("eth0"))
    assert 'name="eth0"' in Path(made[PROFILE]).read_text()
    assert made["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SYSTEM_DEFAULT"
    assert made[PROFILE] == str(profile_file(Tether("eth0")))


def test_a_tether_with_another_address_ends_the_stack_and_a_cut_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    _require_same(None, "")
    now = iter(["192.168.2.2", HindraxError("eth0: no carrier"), "10.0.0.7"])

    def look(_name: Navigation) -> object:
        found = next(now)
        if isinstance(found, HindraxError):
            raise found
        return found

    monkeypatch.setattr(stack_runner, "address_of", look)
    _require_same(Tether("eth0"), "192.168.2.2")
    _require_same(Tether("eth0"), "192.168.2.2")
    with pytest.raises(HindraxError, match=r"eth0: its address was 192\.168\.2\.2 and is 10\.0\.0\.7"):
        _require_same(Tether("eth0"), "192.168.2.2")


def test_who_waits_for_the_tether_has_a_pulse_and_can_be_ended(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(tether, "LOOK_S", 0.0)
    turns = iter([False, False, True])
    with tool_liveness() as beating:
        assert awaited(Tether("nowhere0"), lambda: next(turns), beating) == ""
        (path,) = (tmp_path / "runtime").glob("*.pulse")
        beat = json.loads(path.read_text())
    assert stacks_well(path.parent, beat["at_s"]) == (False, NOBODY)
    assert beat["troubles"] == {"tether": "waiting for the tether nowhere0"}
