"""Identified with another vehicle file than flown with: the recorded pulses push as that file says."""

from dataclasses import replace
from pathlib import Path

import pytest

from hindrax_analysis.records.own_bag import bag_events, has_other_thrust
from hindrax_bag.read.bag_reader import attached_vehicle, attachments
from hindrax_core.signals import Thrust
from hindrax_core.vehicle import Vehicle

BAG = Path(__file__).parent / "bags/surge"


@pytest.fixture(scope="module")
def flown() -> Vehicle:
    """Vehicle file inside of the bag."""
    return attached_vehicle(BAG, attachments(BAG))


def thrusts(vehicle: Vehicle) -> list[Thrust]:
    return [one.reading for one in bag_events(BAG, vehicle) if isinstance(one.reading, Thrust)]


def test_the_pulses_push_backwards_for_a_file_that_has_every_thruster_reversed(flown: Vehicle) -> None:
    turned = replace(
        flown, thrusters=tuple(replace(one, azimuth_deg=one.azimuth_deg + 180.0) for one in flown.thrusters)
    )
    assert has_other_thrust(BAG, turned)
    before, after = thrusts(flown), thrusts(turned)
    assert max(abs(one.wrench[0]) for one in before) > 5.0
    for old, new in zip(before, after, strict=True):
        assert new.forces_N == pytest.approx(old.forces_N, abs=0.02), "by pulses that are written as 32 bits"
        assert new.wrench[:2] == pytest.approx((-old.wrench[0], -old.wrench[1]), abs=0.05)


def test_the_same_thrusters_and_curves_leave_the_thrust_as_it_was_recorded(flown: Vehicle) -> None:
    assert not has_other_thrust(BAG, replace(flown, mass_kg=flown.mass_kg + 1.0))
