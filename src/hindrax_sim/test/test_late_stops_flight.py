"""Thrusters that stop later than they start: the inertia of a turn is right, though nobody has told the fit."""

from vehicles_beside import vehicle_beside

from hindrax_sim.flights.pool_flight import calibrated, fly


def test_an_inertia_of_thrusters_that_stop_late_is_right() -> None:
    """It was 31 % too small, and its interval did not cover; on the axis alone some go while others come."""
    flight = fly(("yaw",), 11, "late_stops=0.1", vehicle=calibrated(vehicle_beside()))
    result, hydrodynamics = flight.outcome.results.motions["yaw"], vehicle_beside().hydrodynamics
    assert hydrodynamics is not None
    truth = hydrodynamics.added_mass[5]
    assert result.quality["goes_later_s"] > 0.05
    number = result.coefficients["added_mass"]
    assert abs(number.value - truth) < 0.1 * truth
    assert number.corrected is not None
    low, high = number.corrected.interval95
    assert min(low, high) < truth < max(low, high)
    assert result.drag is not None
    speed = float(result.drag.speed[-1])
    assert abs(float(result.drag.force[-1]) - abs(flight.drag_N("yaw", speed))) < 0.05 * float(result.drag.force[-1])
