"""Codes of refusals: every one has a word and, as a guard, a remedy; older records and messages are understood."""

import copy
import json
import pickle
from collections.abc import Callable

import pytest

from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.input_checks import untimely_goal
from hindrax_core.text.refusals import (
    CANCELLED,
    LEFT_ARMED,
    NOTHING,
    REMEDIES,
    SENTENCES,
    TAKEN_OVER,
    FarEnd,
    Reason,
    Refusal,
    far_end,
    found,
    from_sentence,
    received,
    refusal_of,
    refused,
    unreadable,
)


def test_a_goal_by_its_stamp_is_refused_as_one_that_may_be_sent_again() -> None:
    why = untimely_goal(Refusal(Reason.LATE, "3 s old"))
    assert (why.reason, str(why)) == (Reason.LATE, "late: the goal is 3 s old")


def test_what_a_guard_finds_begins_with_its_word_and_ends_with_the_remedy() -> None:
    leak = found(Reason.LEAK, "found water in the hull, wanted it dry")
    assert leak == "leak: found water in the hull, wanted it dry; surface, disarm and open the hull"
    assert (leak.reason, leak.word) == (Reason.LEAK, "leak")
    assert all(remedy and not remedy.endswith(".") for remedy in REMEDIES.values())


def test_nothing_is_refused_by_an_empty_sentence() -> None:
    assert not NOTHING
    assert (NOTHING.reason, NOTHING.word) == (Reason.NONE, None)
    assert NOTHING.meanwhile(["the sensors died"]) is NOTHING


def test_words_around_a_sentence_do_not_change_its_reason() -> None:
    start = CANCELLED.within("start: ")
    assert (start, start.reason) == ("start: cancelled: by the operator", Reason.CANCELLED)
    later = CANCELLED.meanwhile(["one", "the sensors died"])
    assert (later, later.reason) == ("cancelled: by the operator; meanwhile the sensors died", Reason.CANCELLED)
    assert CANCELLED.meanwhile([]) is CANCELLED


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
def test_a_copy_keeps_the_reason(again: Callable[[Refusal], Refusal]) -> None:
    assert (again(CANCELLED), again(CANCELLED).reason) == (CANCELLED, Reason.CANCELLED)
    assert json.dumps(CANCELLED) == '"cancelled: by the operator"'


def test_a_sentence_of_a_message_stands_once_and_has_its_numbers() -> None:
    why = refused(Reason.FOREIGN_FRAME, frame="rov2/base_link", wanted="rov1/base_link")
    assert why == "found frame 'rov2/base_link', of another vehicle; wanted rov1/base_link"
    assert why.reason is Reason.FOREIGN_FRAME
    with pytest.raises(KeyError):
        refused(Reason.FOREIGN_FRAME, frame="rov2/base_link")
    assert set(SENTENCES) == {one for one in Reason if one >= Reason.PUBLISHERS}


def test_what_a_message_is_unreadable_by_keeps_its_code_else_it_is_malformed() -> None:
    assert unreadable(ValueError(CANCELLED)) is CANCELLED
    why = unreadable(ValueError("found 3 pulses, wanted 8"))
    assert (why, why.reason) == ("found 3 pulses, wanted 8", Reason.MALFORMED)


def test_an_error_carries_the_refusal_that_it_was_raised_with() -> None:
    assert refusal_of(UsageError(CANCELLED)) is CANCELLED
    assert str(UsageError(CANCELLED)) == CANCELLED
    other = refusal_of(HindraxError("no room"))
    assert (other, other.reason) == ("no room", Reason.UNNAMED)


@pytest.mark.parametrize(
    ("sentence", "reason"),
    [
        ("", Reason.NONE),
        ("leak: found water in the hull", Reason.LEAK),
        ("start: pool_box: 0.1 m to the north wall", Reason.POOL_BOX),
        ("start: the vehicle is not armed", Reason.UNNAMED),
        ("none: a word that is no reason", Reason.UNNAMED),
        ("surge: no thruster serves it", Reason.UNNAMED),
    ],
)
def test_the_sentence_of_an_older_record_names_its_reason(sentence: str, reason: Reason) -> None:
    assert (from_sentence(sentence), from_sentence(sentence).reason) == (sentence, reason)


@pytest.mark.parametrize(
    ("code", "reason"), [(44, Reason.LEAK), (0, Reason.BATTERY), (60_000, Reason.BATTERY), (1, Reason.UNNAMED)]
)
def test_a_code_counts_more_than_the_sentence_and_an_unknown_one_less(code: int, reason: Reason) -> None:
    assert received(code, "battery: 11 V").reason is reason


@pytest.mark.parametrize(
    ("state", "aborted", "whose"),
    [
        ("the autopilot has fallen silent", "", FarEnd.DISARMED),
        (f"the autopilot has fallen silent; {LEFT_ARMED}", "", FarEnd.LEFT_ARMED),
        ("disarmed by request", f"disarmed: (another party, or a failsafe, {TAKEN_OVER}: ALT_HOLD)", FarEnd.TAKEN_OVER),
        (f"cannot connect; {LEFT_ARMED}", f"disarmed: another party {TAKEN_OVER}", FarEnd.TAKEN_OVER),
    ],
)
def test_who_has_the_vehicle_after_a_flight_is_a_code(state: str, aborted: str, whose: FarEnd) -> None:
    assert far_end(state, aborted) is whose
