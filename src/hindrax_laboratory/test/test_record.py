"""A bench record is read by column name; a bad one is refused with line and column."""

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_core.errors import HindraxError
from hindrax_ident.arrays import array
from hindrax_laboratory.experiment_record import Column, evenly, read_columns
from hindrax_laboratory.least_squares import least_squares, propagate

COLUMNS = (Column("time_s", "time [s]"), Column("force_N", "force [N]"), Column("note_V", "supply [V]", required=False))


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_columns_come_by_name_in_any_order_and_separator(separator: str) -> None:
    lines = ["# bench 2", "\ufeffforce_N,other,time_s", "", "1.5,x,0", "2.5,y,1"]
    record = read_columns("\n".join(lines).replace(",", separator), COLUMNS, "a.csv")
    assert record["time_s"].tolist() == [0.0, 1.0]
    assert record["force_N"].tolist() == [1.5, 2.5]
    assert "note_V" not in record


def test_a_comma_that_does_not_separate_is_that_of_decimals() -> None:
    assert read_columns("time_s;force_N\n0,5;-1,25\n", COLUMNS, "a.csv")["force_N"].tolist() == [-1.25]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "a.csv: the file is empty"),
        ("time_s,force_N\n", "no data below it"),
        ("time_s,load\n0,1\n", r"no column force_N \(force \[N\]\); found time_s, load"),
        ("time_s,force_N\n0,1\n1,abc\n", "a.csv, line 3, column force_N: found 'abc', wanted a number"),
        ("time_s,force_N\n0,1\n1\n", "line 3, column force_N: the line has only 1 cells"),
        (
            "time_s,force_N\n0,1\n0,5,1,5\n",
            "line 3: found 4 cells, wanted 2 as in the header line; write decimals with",
        ),
        ("time_s,force_N\n0,nan\n", "line 2, column force_N: found 'nan', wanted a finite number"),
        ("time_s,force_N\n0,-2e200\n", "line 2, column force_N: found '-2e200', wanted a measurement"),
        ("time_s,force_N,force_N\n0,1,2\n", "column force_N occurs 2 times"),
    ],
)
def test_a_bad_file_is_refused_with_line_and_column(text: str, message: str) -> None:
    with pytest.raises(HindraxError, match=message):
        read_columns(text, COLUMNS, "a.csv")


@given(st.text(max_size=200))
def test_no_text_crashes_the_reader(text: str) -> None:
    with suppress(HindraxError):
        record = read_columns(text, COLUMNS, "a.csv")
        assert set(record) >= {"time_s", "force_N"}


def test_jitter_is_interpolated_and_gaps_and_standstill_are_refused() -> None:
    time = np.arange(100) / 10.0
    jittered = time + 0.002 * np.sin(np.arange(100))
    rate, (signal,) = evenly(jittered, [2.0 * jittered], "a.csv")
    assert rate == pytest.approx(10.0, rel=0.02)
    assert np.diff(signal) == pytest.approx(np.full(signal.size - 1, 2.0 / rate))
    with pytest.raises(HindraxError, match="does not increase at sample 51"):
        evenly(np.where(np.arange(100) == 50, time - 0.1, time), [time], "a.csv")
    with pytest.raises(HindraxError, match="missing after sample 50"):
        evenly(np.where(np.arange(100) >= 50, time + 5.0, time), [time], "a.csv")


def test_deviations_of_a_straight_line_are_those_of_the_textbook() -> None:
    x, y = np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.1, 0.9, 2.1, 2.9])
    fit = least_squares(np.column_stack((np.ones(4), x)), y, ("start", "slope"))
    expected, covariance = np.polyfit(x, y, 1, cov=True)
    assert (fit["slope"].value, fit["start"].value) == pytest.approx(tuple(expected))
    assert fit["slope"].std == pytest.approx(np.sqrt(covariance[0, 0]))
    assert fit["start"].std == pytest.approx(np.sqrt(covariance[1, 1]))


def test_a_fit_that_cannot_separate_its_coefficients_reports_it() -> None:
    x = array(np.linspace(0.0, 1.0, 10))
    with pytest.raises(HindraxError, match="cannot separate them"):
        least_squares(np.column_stack((x, 2.0 * x)), x, ("a", "b"))
    with pytest.raises(HindraxError, match="fit of b: the record does not excite it"):
        least_squares(np.column_stack((x, 0.0 * x)), x, ("a", "b"))


def test_uncertainty_travels_through_a_product() -> None:
    found = propagate(lambda v: float(v[0] * v[1]), np.array([2.0, 3.0]), np.diag([0.01, 0.04]))
    assert (found.value, found.std) == pytest.approx((6.0, (9.0 * 0.01 + 4.0 * 0.04) ** 0.5))
