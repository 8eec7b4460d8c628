"""Rejects of devices: the sentence has what was found, the key what it is counted by."""

import copy

from hindrax_core.events import Rejected, Stamp
from hindrax_core.rejects import RejectCode, reject


def test_a_reject_is_its_part_and_the_word_of_its_code() -> None:
    assert reject(RejectCode.RANGE) == "range"
    assert reject(RejectCode.RANGE, "distance") == "distance: range"
    assert reject(RejectCode.FIELD, "velocity", field="vx") == "velocity: vx"


def test_what_was_found_is_told_and_not_counted() -> None:
    """A key with a number in it would be new each time, and /diagnostics would grow without end."""
    leaps = [reject(RejectCode.LEAP, "pressure", found=f"leap of {step} Pa") for step in (700, 800)]
    assert leaps == ["pressure: leap of 700 Pa", "pressure: leap of 800 Pa"]
    assert {Rejected(Stamp(1), one).key for one in leaps} == {"pressure: leap"}


def test_words_of_another_package_count_for_themselves() -> None:
    assert Rejected(Stamp(1), "no conversion").key == "no conversion"


def test_a_copy_keeps_code_and_key() -> None:
    made = copy.deepcopy(reject(RejectCode.LEAP, found="leap of 700 Pa"))
    assert (made, made.code, made.key) == ("leap of 700 Pa", RejectCode.LEAP, "leap")
