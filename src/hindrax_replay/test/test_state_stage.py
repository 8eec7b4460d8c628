"""Recorded navigation states against replayed ones: a state may be recorded before the samples that it was made of."""

from types import SimpleNamespace
from typing import Any

import pytest

from hindrax_bag.message_comparison import ComparisonReport, load_rules
from hindrax_bringup.share_files import hindrax_with
from hindrax_core.events import Stamped, stamp_from_s
from hindrax_core.signals import Navigation
from hindrax_core.topics import NAVIGATION, resolved
from hindrax_replay import state_stage
from hindrax_replay.state_stage import StateStage
from hindrax_replay.wire_stage import ReferenceSamples
from hindrax_ros.messages.fast_serialization import navigation_writer
from hindrax_ros.messages.serialization import deserialized, message_class

STATUS, SAMPLES = resolved(NAVIGATION), "/hindrax/icm20948/data_raw"
TICKS_S = [10.0 + 0.02 * tick for tick in range(100)]


def state(at_s: float) -> Stamped[Navigation]:
    still = (0.0, 0.0, 0.0)
    return Stamped(stamp_from_s(at_s), Navigation(still, still, still, 1.0, 1.0, (0.0, 0.0), dvl_locked=True))


def recorded(at_s: float) -> Any:
    data = navigation_writer()(state(at_s))
    kind = NAVIGATION.type
    return SimpleNamespace(topic=STATUS, type=kind, data=data, decoded=lambda: deserialized(data, message_class(kind)))


@pytest.fixture
def stage(monkeypatch: pytest.MonkeyPatch) -> Any:
    """One whose navigator makes a state of every sample, at the time that is the sample."""
    made: Any = StateStage(hindrax_with(), {}, ComparisonReport(load_rules()), ReferenceSamples())
    monkeypatch.setattr(state_stage, "current_bytes", lambda message: message.data)
    made._sensors = {SAMPLES: ("icm20948", float)}
    made._navigator = SimpleNamespace(step=lambda at_s, _source: state(at_s))
    return made


@pytest.mark.parametrize("ahead", [0, 1, 5])
def test_a_state_that_was_recorded_before_its_samples_is_compared_with_its_own(stage: Any, ahead: int) -> None:
    for index, at_s in enumerate(TICKS_S):
        if index >= ahead:
            sample = TICKS_S[index - ahead]
            stage.feed(SimpleNamespace(topic=SAMPLES, data=sample), sample)
        stage.feed(recorded(at_s), None)
    for sample in TICKS_S[len(TICKS_S) - ahead :]:
        stage.feed(SimpleNamespace(topic=SAMPLES, data=sample), sample)
    stage.finish()
    assert stage._ledger.differences() == []
    assert stage._ledger.messages[STATUS] >= 9


def test_a_state_that_no_replay_reaches_is_told(stage: Any) -> None:
    for at_s in TICKS_S[:50]:
        stage.feed(SimpleNamespace(topic=SAMPLES, data=at_s), at_s)
    for at_s in TICKS_S:
        stage.feed(recorded(at_s), None)
    stage.feed(recorded(TICKS_S[-1] + 1.0), None)
    stage.finish()
    assert [one.topic for one in stage._ledger.differences()] == [STATUS]
