"""Of several publishers none is obeyed, and the one who is stays while the thrusters are armed."""

from hindrax_core.input_checks import UNKNOWN, SinglePublisher

ONE, OTHER = "/rov/controller", "/stranger"


def test_one_publisher_is_obeyed_and_named() -> None:
    source = SinglePublisher()
    assert source.judge({ONE}, armed=False) == ""
    assert source.name == ONE


def test_of_two_or_none_nobody_is_obeyed() -> None:
    source = SinglePublisher()
    assert source.judge({OTHER, ONE}, armed=False) == "found 2 publishers (/rov/controller, /stranger), wanted one"
    assert source.judge((), armed=False) == "found 0 publishers, wanted one"
    assert source.judge({f"/{UNKNOWN}"}, armed=False).startswith("found a publisher without a node")
    assert source.name == ""


def test_contested_is_what_only_somebody_can_end_and_not_a_graph_that_is_still_learning() -> None:
    source = SinglePublisher()
    assert source.is_contested({ONE, OTHER})
    assert not source.is_contested({ONE}), "there may be a first one"
    source.judge({ONE}, armed=False)
    assert source.is_contested({ONE, OTHER})
    assert source.is_contested({OTHER})
    for transient in ((), {ONE}, {ONE, f"/{UNKNOWN}"}, {f"/{UNKNOWN}"}):
        assert not source.is_contested(transient)


def test_another_one_takes_over_only_while_disarmed() -> None:
    source = SinglePublisher()
    source.judge({ONE}, armed=False)
    refused = source.judge({OTHER}, armed=True)
    assert refused == "found /stranger, wanted /rov/controller, as when the thrusters were armed; disarm first"
    assert source.judge({ONE}, armed=True) == ""
    assert source.judge({OTHER}, armed=False) == ""
    assert source.name == OTHER
