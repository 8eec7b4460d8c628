"""One rule for the stamps of orders: neither too old nor too far ahead, never without a stamp."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_core.events import Stamp, after, seconds_between, stamp_from_s
from hindrax_core.input_checks import (
    LAST,
    MOCK_ORDER,
    NAMED_S,
    ORDER,
    StampFault,
    StampWindow,
    TypedOrders,
    WrongStamp,
    impossible,
    order_window,
)
from hindrax_core.text.refusals import Reason

NOW = stamp_from_s(1.8e9)


def refused(window: StampWindow, stamp: Stamp, now: Stamp = NOW) -> WrongStamp:
    wrong_stamp = window.judge(stamp, now)
    assert wrong_stamp is not None
    return wrong_stamp


@pytest.mark.parametrize(
    ("ahead_s", "kind", "wanted"),
    [
        (-1.5, StampFault.EXPIRED, r"1\.5 s old, wanted at most 1\.0 s; try again, .*set the clocks.*"),
        (
            0.25,
            StampFault.FUTURE,
            r"stamped 0\.25 s in the future, wanted at most 0\.10 s ahead .* clock; set .*",
        ),
        (2e8, StampFault.FUTURE, r"stamped 200000000\.00 s in the future, .*; set the clocks of both machines"),
        (1.1e9, StampFault.FUTURE, r"stamped .* s in the future, .*; one of the two .*mock.*--sim-time.*"),
        (-1.7e9, StampFault.EXPIRED, r"1700000000\.0 s old, .*; one of the two .*mock.*--sim-time.*"),
    ],
)
def test_what_is_not_of_now_states_how_far_off_it_is_and_what_to_do(ahead_s: float, kind: str, wanted: str) -> None:
    wrong_stamp = refused(ORDER, after(NOW, ahead_s))
    assert wrong_stamp.kind == kind
    assert re.fullmatch(wanted, wrong_stamp.sentence)


@pytest.mark.parametrize("window", [ORDER, MOCK_ORDER, ORDER.of_lists])
@pytest.mark.parametrize("stamp", [0, -1, -1_000_000_000, -(2**31) * 1_000_000_000])
@pytest.mark.parametrize("now", [0, 1, 500_000_000, NOW])
def test_an_order_without_a_stamp_is_never_in_time(window: StampWindow, stamp: int, now: int) -> None:
    wrong_stamp = refused(window, Stamp(stamp), Stamp(now))
    assert wrong_stamp.kind is StampFault.UNSTAMPED
    assert wrong_stamp.sentence.endswith(
        "wanted the time at which it was made; stamp it with the time of the clock in use"
    )


def test_before_the_time_is_known_no_order_can_be_judged() -> None:
    wrong_stamp = refused(MOCK_ORDER, Stamp(1), Stamp(0))
    assert wrong_stamp.kind is StampFault.TIMELESS
    assert "clock is not known yet; wait for the clock" in wrong_stamp.sentence


def test_on_a_mock_s_clock_ten_seconds_either_way_are_in_time() -> None:
    assert order_window(mock=True).judge(after(NOW, 10.0), NOW) is None
    assert order_window(mock=True).judge(after(NOW, -10.0), NOW) is None
    assert refused(order_window(mock=True), after(NOW, 10.1)).kind is StampFault.FUTURE
    assert refused(order_window(mock=True), after(NOW, -10.1)).kind is StampFault.EXPIRED
    assert order_window(mock=False) == ORDER


def test_a_list_may_be_reported_again_long_after_it_was_made_but_not_before() -> None:
    assert ORDER.of_lists.judge(after(NOW, -1e6), NOW) is None
    assert refused(ORDER.of_lists, after(NOW, 0.2)).kind is StampFault.FUTURE


def named(orders: TypedOrders, now: Stamp = NOW) -> Stamp:
    """The stamp that an order without one is to be repeated with, as it stands in the line to type."""
    why = orders.refusal(Stamp(0), now)
    assert why.reason is Reason.REPEAT
    line = re.search(r"within 8 s with stamp: \{sec: (\d+), nanosec: (\d+)\}$", why)
    assert line, why
    return Stamp(int(line[1]) * 10**9 + int(line[2]))


def test_an_order_without_a_stamp_counts_once_it_is_repeated_with_the_one_named_to_it() -> None:
    orders = TypedOrders(ORDER)
    stamp = named(orders)
    assert orders.refusal(stamp, after(NOW, NAMED_S)) == ""
    assert orders.refusal(stamp, after(NOW, NAMED_S)).reason is Reason.LATE, "it counts once"
    assert orders.refusal(NOW, NOW) == "", "one that is stamped needs none"


@pytest.mark.parametrize("later_s", [NAMED_S + 0.001, 3600.0, -0.2])
def test_a_named_stamp_does_not_count_for_longer_nor_when_the_clock_was_set_back(later_s: float) -> None:
    orders = TypedOrders(ORDER)
    stamp = named(orders)
    assert orders.refusal(stamp, after(NOW, later_s)).reason in (Reason.LATE, Reason.CLOCK)


def test_what_waited_in_a_dead_link_has_no_stamp_that_was_named() -> None:
    orders = TypedOrders(ORDER)
    first = named(orders)
    assert orders.refusal(Stamp(first + 1), after(NOW, 3.0)).reason is Reason.LATE, "one that nobody named"
    named(orders, after(NOW, 4.0))
    assert orders.refusal(first, after(NOW, 5.0)).reason is Reason.LATE, "a newer one was named since"
    assert TypedOrders(ORDER).refusal(first, after(NOW, 3.0)).reason is Reason.LATE, "of another kind of order"
    assert TypedOrders(ORDER).refusal(Stamp(0), Stamp(0)).reason is Reason.CLOCK, "no time, no name"


@given(
    st.integers(-LAST, LAST),
    st.integers(1, LAST),
    st.floats(0.0, 1e3, allow_nan=False),
    st.floats(0.0, 1e3, allow_nan=False),
)
def test_it_lets_through_exactly_what_lies_within(stamp: int, now: int, oldest_s: float, lead_s: float) -> None:
    passed = StampWindow(oldest_s, lead_s).judge(Stamp(stamp), Stamp(now)) is None
    assert passed == (stamp > 0 and -lead_s <= seconds_between(Stamp(stamp), Stamp(now)) <= oldest_s)


@pytest.mark.parametrize(("stamp", "fits"), [(0, True), (LAST, True), (-1, False), (LAST + 1, False)])
def test_a_measurement_s_stamp_is_one_that_a_message_can_carry(stamp: int, fits: bool) -> None:
    assert (impossible(Stamp(stamp)) == "") is fits
    assert stamp_from_s(2_147_483_647) == LAST, "int32 of builtin_interfaces/Time"
