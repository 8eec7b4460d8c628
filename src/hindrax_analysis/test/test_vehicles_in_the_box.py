"""Vehicles that come with the stack, beside the Hindrax: each serves every axis, flies in mock, and is identified."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hindrax_analysis.identification.montecarlo import HullTruth, trial_of
from hindrax_bringup.share_files import default_vehicle
from hindrax_control.maneuver.servable import motions_to_fly
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_sim.pool_flight import fly

FILES = sorted(default_vehicle().parent.glob("*.yaml"))
OTHERS = [file for file in FILES if file != default_vehicle()]


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_each_has_the_name_of_its_file_and_can_fly_every_motion(file: Path) -> None:
    vehicle = load_vehicle(file)
    assert vehicle.name == file.stem
    assert motions_to_fly(("all",), vehicle).left_out == ()


def test_the_curve_of_the_t200_is_that_of_its_public_table() -> None:
    """Blue Robotics, T200 public performance data of September 2019, between the sheets of 14 and 16 V [N]."""
    curve = load_vehicle(default_vehicle().parent / "bluerov2-heavy.yaml").curves["main"]
    assert curve.positive is not None
    for branch, table in (
        (curve.negative, {1100: -36.7, 1200: -24.45, 1300: -12.93, 1400: -4.23, 1460: -0.53}),
        (curve.positive, {1540: 0.68, 1600: 5.30, 1700: 16.28, 1800: 31.03, 1900: 47.19}),
    ):
        assert [branch.force_N(pulse) for pulse in table] == pytest.approx(list(table.values()), abs=0.13)


@pytest.mark.parametrize("file", OTHERS, ids=lambda file: file.stem)
def test_each_flies_in_mock_and_its_drag_is_found_within_its_band(file: Path) -> None:
    vehicle: Vehicle = load_vehicle(file)
    flight = fly(("surge",), 3, vehicle=vehicle)
    assert flight.aborted == ""
    trial = trial_of(3, flight.outcome, HullTruth(flight.truth, flight.drag_N))
    assert [one.share for one in trial.drag] == [0.25, 0.25, 0.5, 0.5, 1.0, 1.0]
    assert max(abs(one.z) for one in trial.drag) < 3.0
    assert max(abs(one.error) for one in trial.drag) < 0.02
    assert not np.isnan(trial.drag[-1].z)
