"""A time that steps back begins a record: trials pasted below each other, a clock that began again."""

from pathlib import Path

import numpy as np
import pytest

from hindrax_analysis.identification.record_identification import IdentificationTask, identify_sources, open_sources
from hindrax_analysis.records.csv.record import read_records
from hindrax_analysis.records.third_party_bag import TopicSelection
from hindrax_core.vehicle import Vehicle

DATA = Path(__file__).parent / "data"
VEHICLE = Vehicle("v", 11.5, 0.0115, (0.457, 0.338, 0.254))
TRUTH = {"k_q": 141.0, "k_l": 13.7, "added_mass": 6.36}


@pytest.mark.parametrize(
    ("name", "trials", "steps"), [("trials_from_zero.csv", 2, "once"), ("trials_from_zero_same.csv", 3, "2 times")]
)
def test_trials_from_zero_are_records_of_their_own_and_give_the_truth(name: str, trials: int, steps: str) -> None:
    """Sorted by time they gave 35 +- 7 N for 21, or "hardly moved"."""
    sources = open_sources([DATA / name], TopicSelection())
    assert len(sources) == trials
    assert f"time steps back {steps}: {trials} records" in sources[0].assumptions
    surge = identify_sources(sources, VEHICLE, IdentificationTask(axes=(0,))).results.motions["surge"]
    assert surge.identifiable
    for key, true in TRUTH.items():
        number = surge.coefficients[key]
        assert abs(number.value - true) < 3.0 * number.std_calibrated
    k_q, k_l = surge.value("k_q"), surge.value("k_l")
    assert k_q * 0.25 + k_l * 0.5 == pytest.approx(141.0 * 0.25 + 13.7 * 0.5, rel=0.05)


def rows(begin: float, count: int = 40) -> list[str]:
    return [f"{begin + 0.05 * i:.3f},{0.1 + 0.001 * i},{1.0 + 0.1 * i}" for i in range(count)]


def test_lines_out_of_order_are_sorted_and_a_wrap_is_not() -> None:
    shuffled = rows(0.0)
    shuffled[10], shuffled[11] = shuffled[11], shuffled[10]
    (one,) = read_records("\n".join(["t,u,X", *shuffled]), "x.csv")
    assert np.all(np.diff(one.velocity_t) > 0.0)
    wrapped = read_records("\n".join(["t,u,X", *rows(4290.0), *rows(0.0)]), "x.csv")
    assert [len(one.velocity_t) for one in wrapped] == [40, 40]
    assert [one.origin_s for one in wrapped] == [4290.0, 0.0]


def test_a_table_of_forces_below_one_of_velocities_is_the_same_record() -> None:
    speeds = [f"{0.05 * i:.3f},{0.1 + 0.001 * i}," for i in range(40)]
    forces = [f"{0.05 * i:.3f},,{1.0 + 0.1 * i}" for i in range(40)]
    (one,) = read_records("\n".join(["t,u,X", *speeds, *forces]), "x.csv")
    assert len(one.velocity_t) == len(one.wrench_t) == 40


def test_a_few_lines_are_no_record() -> None:
    (one,) = read_records("\n".join(["t,u,X", *rows(5.0, 5), *rows(0.0)]), "x.csv")
    assert len(one.velocity_t) == 45


def test_a_clock_that_begins_again_at_midnight_goes_on() -> None:
    (one,) = read_records("\n".join(["t,u,X", *rows(86_399.0), *rows(1.0)]), "x.csv")
    assert one.duration_s == pytest.approx(1.95 + 2.0)
    assert np.all(np.diff(one.velocity_t) > 0.0)
