"""What was refused is counted by thing, and is news once."""

from hindrax_core.input_checks import LONGEST, Refusals


def test_refusals_are_counted_by_thing_and_are_news_once() -> None:
    refusals = Refusals()
    assert (refusals.values(), refusals.new_refusals()) == ({}, [])
    assert refusals.add("joy", "found 3 axes, wanted 6") == "joy: found 3 axes, wanted 6"
    refusals.add("joy", "found 2 axes, wanted 6")
    refusals.add("battery", "found -1 V, wanted 3 V or more")
    assert refusals.values() == {
        "refused: battery": "1",
        "refused: joy": "2",
        "last refused": "battery: found -1 V, wanted 3 V or more",
    }
    assert refusals.new_refusals() == ["refused: battery: found -1 V, wanted 3 V or more"]
    assert refusals.new_refusals() == []


def test_a_flood_of_text_is_cut() -> None:
    refusals = Refusals()
    assert len(refusals.add("joy", "x" * 10_000)) == LONGEST
