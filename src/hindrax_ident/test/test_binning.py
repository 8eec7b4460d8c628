"""Means over short spans, and one source for each quantity."""

import pytest

from hindrax_ident.records.binning import Bin, SourceSelector, mean


def test_a_bin_is_complete_with_the_first_sample_a_span_after_its_first() -> None:
    samples = Bin(0.1)
    first = [(5.0, 1.0), (5.04, 20.0), (5.099, 3.0)]
    assert [samples.add(*one) for one in first] == [[], [], []]
    assert samples.add(5.1, 4.0) == first
    assert samples.add(5.15, 5.0) == []
    # Stamps are rounded: a microsecond early is in time, two are not.
    assert samples.add(5.199998, 6.0) == []
    assert samples.add(5.1999995, 7.0) == [(5.1, 4.0), (5.15, 5.0), (5.199998, 6.0)]
    assert samples.points == [(5.1999995, 7.0)]


def test_without_a_span_every_sample_is_a_bin() -> None:
    samples = Bin(0.0)
    assert [samples.add(1.0, 2.0), samples.add(1.02, 3.0)] == [[], [(1.0, 2.0)]]


def test_a_mean_has_the_mean_time() -> None:
    assert mean([(1.0, 5.0)]) == (1.0, 5.0)
    assert mean([(1.0, 5.0), (1.5, -2.0), (3.5, 3.0)]) == pytest.approx((2.0, 2.0))


@pytest.mark.parametrize(
    ("names", "accepted"),
    [
        (["dvl75", "dvl75"], [True, True]),
        (["dvl75", "other_log", "dvl75"], [True, False, True]),
        (["dvl75", "navigation", "navigator", "odometry"], [True, False, False, False]),
        (["navigation", "navigation", "dvl75", "navigation", "dvl75"], [True, True, True, False, True]),
        (["odometry", "navigator", "odometry"], [True, False, True]),
        (["navigator", "other_log", "dvl75"], [True, True, False]),
    ],
)
def test_the_first_source_stays_but_an_instrument_replaces_a_navigator(names: list[str], accepted: list[bool]) -> None:
    selector = SourceSelector()
    assert selector.name == ""
    assert [selector.accepts(name) for name in names] == accepted
