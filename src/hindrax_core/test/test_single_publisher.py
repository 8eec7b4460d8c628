"""Of several publishers none is obeyed, and the one who is stays while the thrusters are armed."""

from hindrax_core.input_checks import NAMELESS, Refusals, SinglePublisher, names_of_others
from hindrax_core.text.refusals import Reason, Refusal

ONE, OTHER = {"01": "/rov/controller"}, {"02": "/stranger"}
AGAIN = {"03": "/rov/controller"}
"""The same name in another process: restarted, or somebody who has taken it."""


def test_one_publisher_is_obeyed_and_named() -> None:
    source = SinglePublisher()
    assert source.judge(ONE, armed=False) == ""
    assert (source.gid, source.name) == ("01", "/rov/controller")


def test_of_two_or_none_nobody_is_obeyed() -> None:
    source = SinglePublisher()
    assert source.judge(OTHER | ONE, armed=False) == "found 2 publishers (/rov/controller, /stranger), wanted one"
    assert source.judge({}, armed=False).reason is Reason.PUBLISHERS
    assert source.name == ""


def test_two_of_one_name_are_two() -> None:
    source = SinglePublisher()
    assert source.judge(ONE | AGAIN, armed=False).reason is Reason.PUBLISHERS
    assert source.is_contested(ONE | AGAIN)


def test_a_publisher_whose_name_was_forgotten_is_the_same_one_and_keeps_its_name_in_sentences() -> None:
    source = SinglePublisher()
    for armed in (False, True):
        source.judge(ONE, armed=False)
        assert source.judge({"01": ""}, armed=armed) == ""
        assert not source.is_contested({"01": ""})
        assert source.name == "/rov/controller"


def test_a_name_is_not_needed_and_is_learned_later() -> None:
    source = SinglePublisher()
    assert source.judge({"01": ""}, armed=False) == ""
    assert source.name == NAMELESS
    assert source.judge(ONE, armed=True) == ""
    assert source.name == "/rov/controller"


def test_contested_is_what_another_one_ends() -> None:
    source = SinglePublisher()
    assert source.is_contested(ONE | OTHER)
    assert not source.is_contested(ONE), "there may be a first one"
    source.judge(ONE, armed=False)
    for others in (ONE | OTHER, OTHER, ONE | {"02": ""}, AGAIN):
        assert source.is_contested(others), others
    for fine in ({}, ONE, {"01": ""}):
        assert not source.is_contested(fine)


def test_another_one_takes_over_only_while_disarmed() -> None:
    source = SinglePublisher()
    source.judge(ONE, armed=False)
    ending = "wanted /rov/controller, as when the thrusters were armed; disarm first"
    assert source.judge(OTHER, armed=True).reason is Reason.OTHER_PUBLISHER
    assert source.judge(AGAIN, armed=True) == f"found another /rov/controller, {ending}"
    assert source.judge({"02": ""}, armed=True).reason is Reason.OTHER_PUBLISHER
    assert source.judge(ONE, armed=True) == ""
    assert source.judge(OTHER, armed=False) == ""
    assert source.name == "/stranger"


def test_others_are_all_but_the_one_with_our_name() -> None:
    assert names_of_others(ONE | OTHER | {"04": ""}, "/rov/controller") == f"/stranger, {NAMELESS}"
    assert names_of_others(ONE, "/rov/controller") == ""


def test_what_was_refused_is_counted_by_thing_and_the_last_sentence_is_kept() -> None:
    refusals = Refusals()
    assert (refusals.values(), refusals.new_refusals()) == ({}, [])
    for thing in ("wrench", "goal", "wrench"):
        sentence = refusals.add(thing, Refusal(Reason.LATE, "too old"))
        assert (sentence, sentence.reason) == (f"{thing}: too old", Reason.LATE)
    assert refusals.values() == {
        "refused: goal": "1",
        "refused: wrench": "2",
        "last refused": "wrench: too old",
        "last reason": Reason.LATE.word,
    }
    assert refusals.new_refusals() == ["refused: wrench: too old"]
    assert refusals.new_refusals() == [], "nothing new"
