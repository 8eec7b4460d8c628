"""What `up` does before its processes start, and when the wall clock is set."""

import json
import shutil
from pathlib import Path

import pytest

from hindrax_bag.metadata import Channel, is_whole
from hindrax_bag.read.bag_reader import messages
from hindrax_bag.write.bag_writer import BagWriter
from hindrax_bag.write.limits import BagLimits
from hindrax_bringup.liveness import LATE_S, NODES, LivenessFile, reported_armed
from hindrax_bringup.processes import ONBOARD, REPLAYED
from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack_runner import SETTLED_S, ClockStep, awaited_nodes, complete_earlier
from hindrax_core.stack_time import StackTime, epoch_ns
from hindrax_core.vehicle import load_vehicle

WORD = Channel("/demo/word", "demo_msgs/msg/Word")


def test_bags_of_earlier_runs_are_completed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = BagWriter(tmp_path / "now" / "bag", lambda _package, _name: "uint8 one\n", BagLimits(keep_free_MB=0.0))
    bag.open()
    bag.write(WORD, b"\x00\x01\x00\x00\x07", 1, 1)
    bag.flush()
    # What a power cut leaves: the same bytes, and no recorder that has them open.
    cut = tmp_path / "before" / "bag"
    shutil.copytree(bag.folder, cut)
    working = complete_earlier(tmp_path)
    assert working is not None
    assert working.wait() == 0
    assert str(cut) in capsys.readouterr().err
    assert is_whole(cut / "bag_0.mcap")
    assert (cut / "metadata.yaml").exists()
    assert [one.decoded().one for one in messages(cut)] == [7]
    assert not is_whole(bag.path)
    bag.close()
    assert complete_earlier(tmp_path) is None


class SteppedTime(StackTime):
    """A stack's time with a wall clock that steps when told."""

    ahead_s = 0.0

    def step_s(self) -> float:
        return type(self).ahead_s


def test_a_stack_follows_the_wall_clock_once_it_is_disarmed_and_the_clock_stays(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now_s, armed = 100.0, True
    clock = ClockStep(SteppedTime(epoch_ns()), lambda: armed, lambda: now_s)
    assert not clock.followed()
    monkeypatch.setattr(SteppedTime, "ahead_s", -3600.0)
    assert not clock.followed()
    now_s += 10 * SETTLED_S
    assert not clock.followed(), "armed: what flies keeps its time"
    monkeypatch.setattr(SteppedTime, "ahead_s", 7.0)
    armed = False
    assert not clock.followed(), "the clock has just been set again"
    now_s += SETTLED_S
    assert clock.followed()
    assert "set forward by 7.0 s; the stack restarts" in capsys.readouterr().err


def test_whether_a_stack_is_armed_is_reported_by_its_safety_monitor(tmp_path: Path) -> None:
    assert not reported_armed(tmp_path, 7), "nobody has said so"
    for armed in (True, False):
        liveness = LivenessFile(tmp_path / f"7{NODES}")
        liveness.beat("nodes", {}, armed=armed)
        assert reported_armed(tmp_path, 7) is armed
        liveness.close()


def test_a_frozen_safety_monitor_receives_no_armed_thrusters(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # A step back of the clock freezes it in a wait of the middleware, with "armed" as its last word.
    file = tmp_path / f"7{NODES}"
    LivenessFile(file).beat("nodes", {}, armed=True)
    reported_s = json.loads(file.read_text(encoding="utf-8"))["at_s"]
    for age_s, armed in ((LATE_S - 0.1, True), (LATE_S + 0.1, False)):
        monkeypatch.setattr("hindrax_bringup.liveness.time.monotonic", lambda age_s=age_s: reported_s + age_s)
        assert reported_armed(tmp_path, 7) is armed


def test_a_stack_waits_for_the_report_of_each_of_its_devices_where_somebody_listens() -> None:
    vehicle = load_vehicle(default_vehicle())
    assert awaited_nodes([one.name for one in ONBOARD], vehicle) == (*vehicle.sensors, "thrusters")
    assert awaited_nodes([one.name for one in REPLAYED], vehicle) == (), "no safety monitor"
    assert awaited_nodes(["safety_monitor", "thrusters"], vehicle) == ("thrusters",)
