"""The identifier of a test is for people: no value fills more than a line of it."""

import pytest

LONG = "a" * 400_000


@pytest.mark.parametrize("value", ["short", LONG, LONG.encode(), b"\xff" * 4000, f"b{LONG}"])
def test_a_long_value_is_named_by_its_beginning_and_length(request: pytest.FixtureRequest, value: str | bytes) -> None:
    assert len(request.node.nodeid) < 250
    assert str(len(value)) in request.node.nodeid or value == "short"
