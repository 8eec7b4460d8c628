"""What the maneuver of a bag came to, out of the status messages of the pilot."""

import types
from types import SimpleNamespace
from typing import Any

import pytest

from hindrax_analysis.records.own_bag import ManeuverRecord, left_out_of, record_of

BOUNDS = "pool_bounds: 0.4 m to the wall; give it room"


def status(at_s: float, phase: str, motion: str = "surge", aborted: str = "") -> types.SimpleNamespace:
    stamp = SimpleNamespace(sec=int(at_s), nanosec=round(at_s % 1 * 1e9))
    return SimpleNamespace(header=SimpleNamespace(stamp=stamp), motion=motion, phase=phase, aborted=aborted)


def flight(begin_s: float, seconds: float, motion: str = "surge") -> list[Any]:
    return [status(begin_s + 0.1 * step, "plateau", motion) for step in range(round(10 * seconds))]


def test_an_abort_is_reported_with_what_was_flown_until_then() -> None:
    found = record_of([status(0.0, "settle"), *flight(5.0, 20.0), status(25.0, "aborted", "", BOUNDS)])
    assert found.aborted == BOUNDS
    assert found.flown_s == {"surge": pytest.approx(20.0)}


def test_a_record_that_ends_in_flight_is_that_of_an_aborted_run() -> None:
    """The tool was killed, or the power went: no pilot told of the end."""
    found = record_of([status(0.0, "done", ""), status(1.0, "settle"), *flight(5.0, 20.0)])
    assert found.aborted == "record: it ends within the maneuver (surge, plateau)"
    assert found.flown_s == {"surge": pytest.approx(19.9)}


def test_thrust_without_motion_is_counted_apart() -> None:
    wall = [status(3.0 + 0.1 * step, "blocked") for step in range(20)]
    found = record_of([*flight(0.0, 3.0), *wall, status(5.0, "settle"), *flight(6.0, 1.0, "sway")])
    assert found.blocked_s == {"surge": pytest.approx(2.0)}
    assert found.flown_s == {"surge": pytest.approx(3.0), "sway": pytest.approx(0.9)}


def test_a_flight_to_its_end_is_not_aborted() -> None:
    found = record_of([*flight(0.0, 3.0), *flight(3.0, 2.0, "yaw"), status(5.0, "done", "")])
    assert found.aborted == ""
    assert found.flown_s == {"surge": pytest.approx(3.0), "yaw": pytest.approx(2.0)}


def test_the_last_maneuver_counts() -> None:
    again = [*flight(10.0, 1.0), status(11.0, "done", "")]
    assert record_of([status(0.0, "aborted", "", "late: 3 s old"), *again]).aborted == ""


def test_the_pause_between_two_flights_is_not_flown() -> None:
    assert record_of([*flight(0.0, 1.0), *flight(60.0, 1.0)]).flown_s["surge"] == pytest.approx(1.8)


@pytest.mark.parametrize("statuses", [[], [status(0.0, "settle"), status(0.1, "aborted", "")]])
def test_what_only_settles_flies_nothing(statuses: list[types.SimpleNamespace]) -> None:
    assert record_of(statuses) == ManeuverRecord()


def health(at_s: float, **reasons: str) -> types.SimpleNamespace:
    stamp = SimpleNamespace(sec=int(at_s), nanosec=0)
    return SimpleNamespace(header=SimpleNamespace(stamp=stamp), disabled=list(reasons), reasons=list(reasons.values()))


def test_a_thruster_that_was_left_out_is_in_the_record_with_its_reason_and_the_time_of_the_first_time() -> None:
    missing = "T3: 82 % of its thrust is missing"
    lists = [health(0.0), *flight(10.0, 1.0), health(28.0, T3=missing), health(30.0, T3=missing, T5="broken", T6="")]
    assert left_out_of([*lists, health(40.0)]) == (
        f"{missing}, left out from 18 s on",
        "T5: broken, left out from 20 s on",
        "T6: disabled, left out from 20 s on",
    )
    assert left_out_of([health(0.0), *flight(0.0, 1.0)]) == ()
