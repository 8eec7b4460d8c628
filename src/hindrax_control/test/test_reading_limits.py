"""Readings that no sensor produces are told apart from merely odd ones."""

import math

import pytest

from hindrax_control.sensors import why_impossible
from hindrax_core.events import Stamp, Stamped, stamp_from_s
from hindrax_core.readings import BottomTrack, BottomVelocity, Echo, Inertial, Magnetic, Pressure, Reading
from hindrax_core.text.refusals import Reason

REST = (0.0, 0.0, -9.81)
ZERO = (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("reading", "part"),
    [
        (Inertial((math.nan, 0.0, 0.0), ZERO, 20.0), "force"),
        (Inertial((1e200, 0.0, 0.0), ZERO, 20.0), "force"),
        (Inertial(REST, (0.0, -math.inf, 0.0), 20.0), "rate"),
        (Magnetic((0.0, 0.0, math.inf)), "field"),
        (Pressure(-math.inf, 20.0), "pressure"),
        (Pressure(12_000.0, 20.0), "pressure"),  # without the air above the water
        (Pressure(101.325, 20.0), "pressure"),  # kPa
        (Echo(math.nan, 1.0), "range"),
        (BottomVelocity((0.0, math.nan, 0.0), 0.01, 1.0, 0.1, 1), "speed"),
        (BottomVelocity(ZERO, math.nan, 1.0, 0.1, 1), "deviation"),
        (BottomVelocity(None, 0.01, 1.0, math.inf, 1), "interval"),
        (BottomTrack(True, 0.0, 0.0, 0.0, math.nan, (0.0, 0.0), (), "", 0), "altitude"),
    ],
)
def test_what_cannot_be_measured_is_named(reading: Reading, part: str) -> None:
    why = why_impossible(Stamped(stamp_from_s(5.0), reading))
    assert why.reason is Reason.IMPOSSIBLE
    assert part in why


def test_the_sentence_has_what_was_found_and_what_is_possible() -> None:
    why = why_impossible(Stamped(stamp_from_s(5.0), Pressure(1013.25, math.nan)))
    assert why == "found pressure [Pa] 1013.25, wanted 50000 to 2e+08"


@pytest.mark.parametrize(
    "reading",
    [
        Inertial(REST, ZERO, math.nan),
        Magnetic((2e-5, 0.0, 4e-5)),
        Magnetic((0.2, 0.0, 0.4)),  # gauss
        Magnetic((20.0, 0.0, 40.0)),  # microtesla
        Pressure(1e5, math.nan),
        Echo(0.0, 0.0),
        BottomVelocity(None, 0.01, 0.0, 0.1, 1),
        BottomTrack(False, math.nan, math.nan, math.nan, None, (math.nan, math.nan), (), "", 0),
    ],
)
def test_what_is_merely_unknown_or_poor_is_left_to_the_filters(reading: Reading) -> None:
    assert why_impossible(Stamped(stamp_from_s(5.0), reading)) == ""


def test_a_stamp_outside_of_time_is_named() -> None:
    assert why_impossible(Stamped(Stamp(-1_000_000_000), Magnetic(ZERO))).reason is Reason.NO_TIME
