"""How a verdict comes about: digits, tolerances, slips."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_laboratory.papers.cells import Claim, Printed, Row, slip_of_result, slips


@pytest.mark.parametrize(
    ("text", "half", "digits"), [("0.8289", 5e-5, 4), ("16.2536", 5e-5, 6), ("-3.52e-7", 5e-10, 3), ("12", 0.5, 2)]
)
def test_half_unit_of_the_last_digit(text: str, half: float, digits: int) -> None:
    assert Printed(text).half_unit == pytest.approx(half)
    assert Printed(text).digits == digits


def product(inputs: dict[str, str], printed: str) -> Row:
    claims = (
        Claim("a b", Printed(printed), lambda v: v["a"] * v["b"]),
        Claim("a", Printed(inputs["a"]), lambda v: v["a"]),
    )
    return Row("T", "1", "row", {name: Printed(text) for name, text in inputs.items()}, claims)


def test_agreement_allows_what_the_digits_of_the_inputs_allow() -> None:
    # 2.0 x 3.0: each factor is known to 0.05, so the product to about 0.25.
    assert product({"a": "2.0", "b": "3.0"}, "6.20").judge()[0].verdict == "agrees"
    assert product({"a": "2.0", "b": "3.0"}, "6.40").judge()[0].verdict == "does not follow"
    assert product({"a": "2.000", "b": "3.000"}, "6.02").judge()[0].verdict == "does not follow"


def test_a_wrong_digit_in_a_result_is_a_misprint_and_shows_its_correction() -> None:
    cell = product({"a": "2.0000", "b": "3.1250"}, "7.8500").judge()[0]
    assert cell.verdict == "does not follow"
    cell = product({"a": "2.00000", "b": "3.12500"}, "8.2500").judge()[0]
    assert (cell.verdict, cell.note) == ("misprint", "6.2500 printed as 8.2500 (one digit wrong)")


def test_a_wrong_last_digit_or_too_few_digits_are_no_slip() -> None:
    assert slip_of_result(Printed("6.2503"), 6.2508)[0] == "does not follow"
    assert slip_of_result(Printed("8.2"), 6.2)[0] == "does not follow"


def test_an_input_is_blamed_only_when_it_brings_several_cells_back() -> None:
    inputs = {"a": Printed("5.1234"), "b": Printed("2.0000")}
    claims = [Claim("product", Printed("6.2468"), lambda v: v["a"] * v["b"])]
    one = Row("T", "1", "row", inputs, claims).judge()
    assert one[0].verdict == "does not follow"
    claims.append(Claim("sum", Printed("5.1234"), lambda v: v["a"] + v["b"]))
    two = Row("T", "1", "row", inputs, claims).judge()
    assert [cell.verdict for cell in two] == ["misprint", "misprint"]
    assert "a = 3.1234 printed as 5.1234" in two[0].note


@given(st.decimals(min_value=1, max_value=999, places=3), st.integers(0, 30), st.integers(1, 9))
def test_every_single_wrong_digit_is_among_the_slips(number: object, place: int, change: int) -> None:
    text = str(number)
    digits = [i for i, letter in enumerate(text) if letter.isdigit()]
    at = digits[place % len(digits)]
    wrong = text[:at] + str((int(text[at]) + change) % 10) + text[at + 1 :]
    assert ("one digit wrong", text) in set(slips(wrong))
