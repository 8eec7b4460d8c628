"""The table of a BlueROV2's fits: what is flown, and how errors are summed."""

import math

import pytest

from hindrax_analysis.identification.montecarlo import DragError, Trial
from hindrax_control.maneuver.goal import motions_to_fly
from hindrax_tools.bluerov2_fits import FITS, MOTIONS, rows_of, vehicle_with


@pytest.mark.parametrize("fit", FITS)
def test_every_fit_can_fly_its_motions(fit: str) -> None:
    vehicle = vehicle_with(fit)
    assert vehicle.output.device == "ardusub"
    assert motions_to_fly(MOTIONS[fit], vehicle).flown == MOTIONS[fit]


def test_a_row_counts_flights_and_errors_in_deviations() -> None:
    """Two flights: one within its interval both ways, one three deviations off; a third found nothing."""
    trials = [
        Trial(1, (), (DragError("surge", 1.0, 0.1, 0.1), DragError("surge", 1.0, -0.1, 0.1))),
        Trial(2, (), (DragError("surge", 1.0, 0.3, 0.1), DragError("surge", 0.5, 9.0, 0.1))),
        Trial(3, (), (DragError("surge", 1.0, 5.0, math.nan),)),
    ]
    (row,) = rows_of("sonar", trials)
    assert (row.flights, row.found) == (3, 2)
    assert row.worst_z == pytest.approx(3.0)
    assert row.rms_z == pytest.approx(math.sqrt(11.0 / 3.0))
    assert row.rms_percent == pytest.approx(100.0 * math.sqrt(0.11 / 3.0))
    assert row.held == pytest.approx(2.0 / 3.0)
