"""Readings that no sensor produces are told apart from merely odd ones."""

import math

import pytest

from hindrax_control.sensors import why_impossible
from hindrax_core.events import Stamp, Stamped, stamp_from_s
from hindrax_core.readings import BottomTrack, BottomVelocity, Echo, Inertial, Magnetic, Pressure, Reading

REST = (0.0, 0.0, -9.81)
ZERO = (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("reading", "why"),
    [
        (Inertial((math.nan, 0.0, 0.0), ZERO, 20.0), "found force [m/s^2] nan, wanted 0 to 1000"),
        (Inertial((1e200, 0.0, 0.0), ZERO, 20.0), "found force [m/s^2] 1e+200, wanted 0 to 1000"),
        (Inertial(REST, (0.0, -math.inf, 0.0), 20.0), "found rate [rad/s] inf, wanted 0 to 100"),
        (Magnetic((0.0, 0.0, 1.0)), "found field [T] 1, wanted 0 to 0.1"),
        (Pressure(-math.inf, 20.0), "found pressure [Pa] -inf, wanted 0 to 2e+08"),
        (Echo(math.nan, 1.0), "found range [m] nan, wanted 0 to 10000"),
        (BottomVelocity((0.0, math.nan, 0.0), 0.01, 1.0, 0.1, 1), "found speed [m/s] nan, wanted 0 to 1000"),
        (BottomVelocity(ZERO, math.nan, 1.0, 0.1, 1), "found deviation [m/s] nan, wanted 0 to 1000"),
        (BottomVelocity(None, 0.01, 1.0, math.inf, 1), "found interval [s] inf, wanted 0 to 60"),
        (
            BottomTrack(True, 0.0, 0.0, 0.0, math.nan, (0.0, 0.0), (), "", 0),
            "found altitude [m] nan, wanted 0 to 10000",
        ),
    ],
)
def test_what_cannot_be_measured_is_named(reading: Reading, why: str) -> None:
    assert why_impossible(Stamped(stamp_from_s(5.0), reading)) == why


@pytest.mark.parametrize(
    "reading",
    [
        Inertial(REST, ZERO, math.nan),
        Magnetic((2e-5, 0.0, 4e-5)),
        Pressure(1e5, math.nan),
        Echo(0.0, 0.0),
        BottomVelocity(None, 0.01, 0.0, 0.1, 1),
        BottomTrack(False, math.nan, math.nan, math.nan, None, (math.nan, math.nan), (), "", 0),
    ],
)
def test_what_is_merely_unknown_or_poor_is_left_to_the_filters(reading: Reading) -> None:
    assert why_impossible(Stamped(stamp_from_s(5.0), reading)) == ""


def test_a_stamp_outside_of_time_is_named() -> None:
    assert why_impossible(Stamped(Stamp(-1_000_000_000), Magnetic(ZERO))) == "stamped -1 s, wanted 0 to 2.14748e+09 s"
