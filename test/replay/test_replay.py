"""The reference bags through today's code: nothing may differ, and what is changed on purpose is found and named."""

import dataclasses
import json
import os
import signal
import types
from collections.abc import Callable
from itertools import takewhile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from hindrax_bag.message_comparison import ComparisonReport, Rules, load_rules
from hindrax_bag.metadata import Channel
from hindrax_bag.read.bag_reader import BagMessage, attachments, messages
from hindrax_bag.read.recovery import recover
from hindrax_bag.write.bag_writer import BagWriter
from hindrax_bag.write.limits import BagLimits
from hindrax_bringup.clone import clone_root
from hindrax_bringup.share_files import default_vehicle
from hindrax_cli import command_line
from hindrax_cli.commands.data import replay as command
from hindrax_control.navigation.navigator import Navigator
from hindrax_core.errors import HindraxError
from hindrax_core.events import NS_PER_S, Stamp
from hindrax_core.knobs import build
from hindrax_core.readings import Pressure, Vec3
from hindrax_core.signals import Navigation
from hindrax_core.topics import ALLOCATION, DIAGNOSTICS, NAVIGATION, ODOMETRY, TOPICS, resolved
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.devices import ms5837
from hindrax_drivers.devices.imu import icm20948_registers
from hindrax_drivers.nodes import reading_messages
from hindrax_drivers.nodes.reading_messages import ReadingMessages
from hindrax_ident.records.feed import DROPPED
from hindrax_replay import state_stage
from hindrax_replay.bag_replay import Replayed, check_reference, reference_file, replay, write_reference
from hindrax_ros.messages import reading_fields
from hindrax_ros.messages.convert import estimate_to_msg
from hindrax_ros.messages.serialization import current_bytes, serialized
from hindrax_ros.messages.share import share_lookup
from hindrax_ros.testing.state_messages import navigation_from_msg, odometry_to_msg

BAGS = sorted((clone_root() / "test" / "replay" / "bags").iterdir())
SURGE = clone_root() / "test" / "replay" / "bags" / "surge"
ESTIMATES = SURGE.with_name("surge_estimates")
RAW = {resolved(topic) for topic in TOPICS if topic.name.startswith("raw/")}


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first seconds of a reference bag."""
    return recover(
        SURGE, tmp_path_factory.mktemp("short") / "short", keep=lambda _topic, after_s: after_s <= 6.0
    ).output


def test_every_reference_bag_gives_what_it_gave(capsys: pytest.CaptureFixture[str]) -> None:
    assert command_line.main(["replay", "--all", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert len(document["bags"]) == len(BAGS) > 0
    for one in document["bags"]:
        assert one["differences"] == []
        assert one["fields_compared"] > 100_000


def test_reference_bags_are_small() -> None:
    assert sum(file.stat().st_size for bag in BAGS for file in bag.iterdir()) < 10_000_000


def test_every_device_is_replayed_from_its_wire(short: Path) -> None:
    made = replay(short).ledger.messages
    wanted = {"dvl75/velocity", "ping1d/range", "icm20948/data_raw", "icm20948/mag", "ms5837/pressure"}
    assert wanted <= {topic.removeprefix("/hindrax/") for topic in made}


def test_messages_of_other_packages_are_no_part_of_a_replay(short: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where marine_acoustic_msgs is installed the DVL publishes a copy that no bag holds."""
    monkeypatch.setattr(reading_messages, "optional_class", lambda _: SimpleNamespace)
    made = ReadingMessages("dvl75", "dvl75", load_vehicle(default_vehicle())).topics
    assert "dvl75/dvl" in {topic.name for topic in made}
    replayed = replay(short).ledger
    assert replayed.differences() == []
    assert "/hindrax/dvl75/dvl" not in replayed.messages


def test_a_changed_driver_constant_is_found_and_named(short: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = ms5837.reading_of

    def twisted(prom: ms5837.Prom, d1: int, d2: int) -> Pressure:
        reading = real(prom, d1, d2)
        return dataclasses.replace(reading, pressure_Pa=reading.pressure_Pa * 1.0001)

    monkeypatch.setattr(ms5837, "reading_of", twisted)
    found = replay(short).ledger.differences()
    assert ("/hindrax/ms5837/pressure", "fluid_pressure") in {(one.topic, one.field) for one in found}
    assert not any("icm20948" in one.topic or "dvl75" in one.topic for one in found)
    sentence = found[0].sentence(0)
    assert "/hindrax/ms5837/pressure fluid_pressure" in sentence


@pytest.mark.parametrize(
    ("changed", "field"),
    [
        ((icm20948_registers, "MAG_T_PER_LSB", 0.1506e-6), "/hindrax/icm20948/mag magnetic_field.x"),
        ((reading_fields, "PING_LIMITS_m", (0.5, 100.0)), "/hindrax/ping1d/range min_range"),
    ],
)
def test_a_changed_constant_fails_the_command_and_is_pointed_at(
    short: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    changed: tuple[types.ModuleType, str, float | tuple[float, float]],
    field: str,
) -> None:
    monkeypatch.setattr(*changed)
    assert command_line.main(["replay", str(short)]) == 1
    assert f"  {field}: " in capsys.readouterr().out


def test_a_driver_that_asks_for_something_else_is_found(short: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ms5837, "PROM_READ", 0xB0)
    found = replay(short).ledger.differences()
    assert any(one.topic == "raw/ms5837" and "the record has" in one.field for one in found)


def test_a_changed_navigator_is_found_by_the_command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(Navigator, "_navigation", _deeper(Navigator._navigation))
    assert command_line.main(["replay", str(SURGE), "--json"]) == 1
    (one,) = json.loads(capsys.readouterr().out)["bags"]
    assert {(found["topic"], found["field"]) for found in one["differences"]} == {
        ("/hindrax/navigation/status", "depth")
    }


def test_a_mistake_in_the_second_stage_is_raised_in_the_first(short: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(state_stage.StateStage, "_identify", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError) as caught:
        replay(short)
    assert any("state_stage.py" in note for note in caught.value.__notes__)


def test_a_second_stage_that_is_killed_is_missed(short: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(state_stage.StateStage, "_identify", lambda *_: os.kill(os.getpid(), signal.SIGKILL))
    with pytest.raises(HindraxError, match="second stage"):
        replay(short)


def test_wrong_use_is_distinguished(short: Path) -> None:
    assert command_line.main(["replay"]) == 2
    assert command_line.main(["replay", str(short), "--all"]) == 2
    assert command_line.main(["replay", str(short / "nothing")]) == 2


def _deeper(real: Callable[[Navigator, Stamp, Vec3], Navigation]) -> Callable[[Navigator, Stamp, Vec3], Navigation]:
    def navigation(self: Navigator, stamp: Stamp, rate: Vec3) -> Navigation:
        return dataclasses.replace(real(self, stamp, rate), depth_m=3.0)

    return navigation


def test_messages_alone_are_replayed_from_their_topics(tmp_path: Path) -> None:
    bag = recover(SURGE, tmp_path / "messages", keep=lambda topic, after_s: topic not in RAW and after_s < 15.0).output
    done = replay(bag)
    assert set(done.ledger.messages) == {"/hindrax/navigation/status", "/hindrax/control/allocation"}
    assert done.ledger.differences() == []


def test_bursts_that_were_recorded_topic_by_topic_are_matched(tmp_path: Path) -> None:
    """Where bytes come a quarter of a second at a time, so do navigation states, and odometry lies before status."""
    bag = BagWriter(tmp_path / "bursts", share_lookup, limits=BagLimits(keep_free_MB=0.0))
    bag.open()
    for name, data in attachments(SURGE).items():
        bag.attach(name, "application/yaml", data, 0)
    bursts: list[tuple[int, str, BagMessage]] = []
    begin = next(messages(SURGE)).received
    for one in takewhile(lambda one: one.received < begin + 14 * NS_PER_S, messages(SURGE)):
        burst = one.received * 4 // NS_PER_S
        if one.topic != resolved(NAVIGATION):
            bursts.append((burst, "", one))
            continue
        odometry = serialized(odometry_to_msg(navigation_from_msg(one.decoded())))
        twin = one._replace(topic=resolved(ODOMETRY), type=ODOMETRY.type, data=odometry)
        bursts += [(burst, twin.topic, twin), (burst, one.topic, one)]
    for _, _, one in sorted(bursts, key=lambda entry: entry[:2]):
        bag.write(Channel(one.topic, one.type), current_bytes(one), one.received, one.sent)
    bag.close()
    replayed = replay(bag.folder).ledger
    assert replayed.messages[resolved(NAVIGATION)] == replayed.messages[resolved(ODOMETRY)] > 15
    assert replayed.differences() == []


def test_an_unfinished_bag_is_replayed_up_to_its_cut(short: Path, tmp_path: Path) -> None:
    whole = next(short.glob("*.mcap")).read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) * 2 // 3])
    done = replay(cut, vehicle=None)
    assert done.ledger.differences() == []
    assert done.ledger.fields_compared > 10_000


def test_an_unfinished_bag_is_identified_up_to_its_cut(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = next(SURGE.glob("*.mcap")).read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) * 9 // 10])
    vehicle = tmp_path / "vehicle.yaml"
    vehicle.write_bytes(attachments(SURGE)["vehicle.yaml"])
    code = command_line.main(["identify", str(cut), "--vehicle", str(vehicle), "--json"])
    assert code in {0, 1}
    assert json.loads(capsys.readouterr().out)["motions"]["surge"]["samples"] > 100


def test_two_replays_give_the_same_to_the_last_bit_and_a_reference_keeps_it(short: Path, tmp_path: Path) -> None:
    first, second = replay(short), replay(short)
    assert repr(first.samples) == repr(second.samples)
    file = reference_file(short, tmp_path)
    write_reference(first, file)
    check_reference(second, file)
    assert second.ledger.differences() == []
    topic = "/hindrax/ms5837/pressure"
    stamp = next(iter(second.samples[topic]))
    second.samples[topic][stamp]["fluid_pressure"] *= 1.0 + 1e-6
    check_reference(second, file)
    (found,) = second.ledger.differences()
    assert (found.topic, found.field) == (f"reference {topic}", "fluid_pressure")


def test_update_belongs_to_the_reference_bags_only(short: Path) -> None:
    assert command_line.main(["replay", str(short), "--update-refs"]) == 2
    assert command.references().is_dir()


@pytest.mark.parametrize("late", [0, 3])
def test_estimates_that_lack_late_measurements_are_explained_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], late: int
) -> None:
    """The live identifier says in /diagnostics how many measurements came too late for it; no bag can repeat that."""
    copy = BagWriter(tmp_path / "late", share_lookup, limits=BagLimits(keep_free_MB=0.0))
    copy.open()
    for name, data in attachments(ESTIMATES).items():
        copy.attach(name, "application/yaml", data, 0)
    for one in messages(ESTIMATES):
        copy.write(Channel(one.topic, one.type), current_bytes(one), one.received, one.sent)
    status = DiagnosticStatus(name="hindrax: identifier", values=[KeyValue(key=DROPPED, value=str(late))])
    report = serialized(DiagnosticArray(status=[status]))
    copy.write(Channel(resolved(DIAGNOSTICS), DIAGNOSTICS.type), report, one.received, one.sent)
    copy.close()
    monkeypatch.setattr(state_stage, "estimate_to_msg", _surer(estimate_to_msg))
    assert command_line.main(["replay", str(copy.folder)]) == (0 if late else 1)
    printed = capsys.readouterr().out
    assert ("fields differ, for 3 measurements came too late" in printed) is bool(late)
    assert ("worst: recorded" in printed) is not bool(late)


def _surer(real: Callable[..., Any]) -> Callable[..., Any]:
    def message(*given: Any) -> Any:
        made = real(*given)
        made.samples += 1
        return made

    return message


def test_rules_name_ignored_fields_and_tolerances() -> None:
    topic = {"ignore": ["ages"], "fields": {"x*": {"absolute": 0.1}}, "unmatched": 0.5}
    rules = build(Rules, {"default": {"relative": 1e-9}, "topics": {"/a": topic}}, "rules:")
    ledger = ComparisonReport(rules)
    ledger.compare_values("/a", 1, {"x1": 1.0, "ages[0]": 1.0, "y": 2.0}, {"x1": 1.05, "ages[0]": 9.0, "y": 2.1})
    ledger.unmatched("/a", 2, "recorded, not replayed", "a message", "none")
    assert [one.field for one in ledger.differences()] == ["y", "(message) recorded, not replayed"]
    assert ledger.fields_compared == 2


def test_our_rules_are_sharp_for_what_devices_measure() -> None:
    tolerance = load_rules().of("/hindrax/dvl75/velocity").tolerance("twist.twist.linear.x")
    assert tolerance is not None
    assert tolerance.absolute <= 1e-9


def test_padding_is_reported_from_fields() -> None:
    message = next(iter(messages(SURGE, {"/hindrax/icm20948/data_raw"})))
    text = message.data.index(b"icm20948_link\x00") + len("icm20948_link") + 1
    padded, changed = bytearray(message.data), bytearray(message.data)
    padded[text] ^= 0x55
    changed[-9] ^= 0x55
    ledger = ComparisonReport(load_rules())
    ledger.compare_bytes(message.topic, 1, message.data, bytes(padded), message.form.decode)
    assert ledger.differences() == []
    ledger.compare_bytes(message.topic, 1, message.data, bytes(changed), message.form.decode)
    assert len(ledger.differences()) == 1


def test_a_message_that_has_traveled_ends_with_padding() -> None:
    """Its bytes are compared like those of any other: to decode both takes twenty times as long."""
    message = next(iter(messages(SURGE, {resolved(ALLOCATION)})))
    ledger, made = ComparisonReport(load_rules()), message.data[:-3]
    assert message.form.decode(made).supply_measured == message.decoded().supply_measured
    assert ledger.compare_bytes(message.topic, 1, message.data, made, message.form.decode)
    changed = made[:-1] + bytes([made[-1] ^ 1])
    assert not ledger.compare_bytes(message.topic, 1, message.data, changed, message.form.decode)
    (found,) = ledger.differences()
    assert found.field == "supply_measured"


def test_a_reference_that_is_met_keeps_its_digits(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Another processor rounds otherwise: an update on purpose would touch every file."""
    file = tmp_path / "bag.json"
    file.write_text("as it was", encoding="utf-8")
    replayed = Replayed(tmp_path, ComparisonReport(load_rules(section="reference")))
    monkeypatch.setattr(command, "check_reference", lambda _replayed, _file: None)
    command._update(replayed, file)
    assert file.read_text(encoding="utf-8") == "as it was"
    command._update(replayed, tmp_path / "new.json")
    assert (tmp_path / "new.json").exists()
