"""Numbers with the digits that mean something: a deviation, or a limit, says how many."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_core.text.digits import above, below, measured, unlike


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (2.3379, 0.0471, "2.338 +- 0.047"),
        (66.4801, 10.2049, "66 +- 10"),
        (1234.5, 321.0, "1234 +- 321"),
        (0.12345, 0.000996, "0.1235 +- 0.0010"),
        (-2.3, 0.0004, "-2.30000 +- 0.00040"),
        (1.0, 0.0, "1 +- 0"),
        (66.48012, float("inf"), "66.48 +- inf"),
        (float("nan"), float("nan"), "nan +- nan"),
    ],
)
def test_a_number_has_the_digits_that_its_deviation_leaves_it(value: float, std: float, text: str) -> None:
    assert measured(value, std) == text


@pytest.mark.parametrize(
    ("found", "most", "text"),
    [
        (5.02, 5.0, "5.02 s, wanted at most 5.00 s"),
        (5.4, 5.0, "5.4 s, wanted at most 5.0 s"),
        (5.0, 5.0, ""),
        (math.nan, 5.0, ""),
        (math.inf, 5.0, "inf s, wanted at most 5.0 s"),
    ],
)
def test_what_is_above_a_limit_does_not_look_like_it(found: float, most: float, text: str) -> None:
    assert above("{} s, wanted at most {} s", found, most, 1) == text
    negated = below("{} s, wanted at most {} s", -found, -most, 1)
    assert negated.replace("-", "") == text


@given(st.floats(-1e6, 1e6), st.floats(0.002, 10.0), st.integers(0, 3))
def test_two_numbers_are_distinguished(limit: float, more: float, places: int) -> None:
    found, wanted = unlike(limit + more, limit, places)
    assert float(found) > float(wanted)
    assert len(wanted.partition(".")[2]) >= places
    assert unlike(limit, limit, places)[0] == f"{limit:z.{places}f}"
