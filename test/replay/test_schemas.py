"""Bags of every version of our messages: they open, come in today's form, and are replayed."""

import math

import pytest
from rosbags.typesys import get_types_from_msg

from hindrax_bag.definitions import VERSION, definition, steps_of
from hindrax_bag.read.bag_reader import messages
from hindrax_bag.read.mcap_records import records
from hindrax_bringup.clone import clone_root
from hindrax_replay.bag_replay import replay
from hindrax_ros.messages.serialization import message_class
from hindrax_ros.messages.share import share_lookup

FOLDER = clone_root() / "test" / "replay" / "schemas"
VERSIONS = sorted(int(one.name) for one in FOLDER.iterdir())
NAVIGATION, STATE = "/hindrax/navigation/status", "/hindrax/thrusters/state"


def test_there_is_a_bag_of_every_version() -> None:
    assert list(range(1, VERSION + 1)) == VERSIONS


@pytest.mark.parametrize("version", VERSIONS)
def test_every_message_comes_in_the_form_of_today(version: int) -> None:
    seen = set()
    for message in messages(FOLDER / str(version)):
        if message.type in seen:
            continue
        seen.add(message.type)
        decoded, today = message.decoded(), message_class(message.type)()
        assert [name for name in today.get_fields_and_field_types() if not hasattr(decoded, name)] == []
    assert len(seen) >= 10


@pytest.mark.parametrize("version", VERSIONS)
def test_a_bag_of_every_version_is_replayed(version: int) -> None:
    done = replay(FOLDER / str(version))
    assert done.ledger.differences() == []
    assert done.ledger.messages[NAVIGATION] > 20


def test_what_an_old_message_lacks_is_unknown_and_what_it_has_is_kept() -> None:
    old = list(messages(FOLDER / "1", {NAVIGATION, STATE}))
    new = list(messages(FOLDER / str(VERSION), {NAVIGATION, STATE}))
    assert len(old) == len(new)
    assert {one.form.old for one in old} == {True}
    assert {one.form.old for one in new} == {False}
    for one, other in zip(old, new, strict=True):
        before, after = one.decoded(), other.decoded()
        if one.topic == NAVIGATION:
            assert before.depth == after.depth
            assert math.isnan(before.yaw_rate)
            assert math.isfinite(after.yaw_rate)
        else:
            assert before.pulses == [float(round(value)) for value in after.pulses]
            assert all(isinstance(value, float) for value in before.pulses)


def test_the_newest_bag_has_the_messages_of_today() -> None:
    """Fails when a message was changed without a step that brings earlier bags to its new form."""
    for record in records(next((FOLDER / str(VERSION)).glob("*.mcap"))):
        if type(record).__name__ == "Schema" and record.name.startswith("hindrax_msgs/"):
            today = get_types_from_msg(definition(record.name, share_lookup), record.name)
            then = get_types_from_msg(record.data.decode(), record.name)
            assert then == today, f"{record.name} has changed: see test/replay/make_schema_bags.py"
            assert steps_of(record.name, record.data.decode()) == ()
