"""Thrust at a supply that was read at rest: the curves of the same pulses at the other voltage."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hindrax_analysis.identification.supply_at_rest import RestVolts, at_rest_volts, gain_at_rest_volts
from hindrax_bringup.share_files import default_vehicle
from hindrax_control.allocation.thrust_curve import AppliedWrench
from hindrax_core.events import Stamped, stamp_from_s
from hindrax_core.signals import IdentEvent, Phase, Supply, Thrust
from hindrax_core.vehicle import AxisGain, Vehicle, load_vehicle

PULSES = (1300.0, 1420.0, 1500.0, 1531.0, 1560.0, 1600.0, 1700.0, 1490.0)
VOLTS = RestVolts(16.4, 14.0)


@pytest.fixture(scope="module", params=["hindrax", "bluerov2-heavy"])
def vehicle(request: pytest.FixtureRequest) -> Vehicle:
    """One with cubics, and one with a table of voltages."""
    return load_vehicle(default_vehicle().with_name(f"{request.param}.yaml"))


def flown(vehicle: Vehicle, times_s: tuple[float, ...], supply: Supply = Supply.ASSUMED) -> list[Stamped[IdentEvent]]:
    """The same pulses all the time, believed at the nominal voltage."""
    usual = AppliedWrench(vehicle)
    forces_N = usual.forces_N(PULSES[: len(vehicle.thrusters)])
    return [Stamped(stamp_from_s(t), Thrust(usual.wrench(forces_N), forces_N, supply)) for t in times_s]


def test_thrust_is_that_of_the_pulses_at_the_voltage_of_the_moment(vehicle: Vehicle) -> None:
    times_s = (100.0, 250.0, 400.0)
    events = [Stamped(stamp_from_s(99.0), Phase("surge", "excite")), *flown(vehicle, times_s)]
    events += [Stamped(stamp_from_s(401.0), Phase("", ""))]
    first, *thrusts, last = at_rest_volts(events, vehicle, VOLTS)
    assert [first, last] == [events[0], events[-1]]
    for t, one in zip(times_s, thrusts, strict=True):
        thrust = one.reading
        assert isinstance(thrust, Thrust)
        assert one.stamp == stamp_from_s(t)
        true = AppliedWrench(vehicle, 16.4 - 2.4 * (t - 99.0) / 302.0)
        wanted_N = true.forces_N(PULSES[: len(vehicle.thrusters)])
        # In steps of 0.02 V.
        assert thrust.forces_N == pytest.approx(wanted_N, rel=2e-3, abs=3e-3)
        assert thrust.wrench == pytest.approx(true.wrench(wanted_N), rel=5e-3, abs=0.05)
        assert thrust.supply is Supply.AT_REST


def test_what_a_sensor_measured_and_what_has_no_thrusters_stays(vehicle: Vehicle) -> None:
    measured = flown(vehicle, (1.0, 2.0), Supply.MEASURED)
    bare = [Stamped(stamp_from_s(3.0), Thrust((1.0,) * 6))]
    assert list(at_rest_volts([*measured, *bare], vehicle, VOLTS)) == [*measured, *bare]
    assert not list(at_rest_volts([], vehicle, VOLTS))
    assumed = flown(vehicle, (1.0, 2.0))
    assert list(at_rest_volts(assumed, vehicle, None)) == assumed, "nobody read it"


def test_a_single_thrust_is_at_the_first_voltage(vehicle: Vehicle) -> None:
    (one,) = at_rest_volts(flown(vehicle, (5.0,)), vehicle, VOLTS)
    assert isinstance(one.reading, Thrust)
    wanted_N = AppliedWrench(vehicle, VOLTS.before).forces_N(PULSES[: len(vehicle.thrusters)])
    assert one.reading.forces_N == pytest.approx(wanted_N, rel=2e-3, abs=1e-3)


def test_a_weighing_with_a_full_battery_is_not_counted_twice(vehicle: Vehicle) -> None:
    """What the higher voltage gave is in the thrust of the legs already; of a cubic exactly."""
    full = AxisGain(load=15.0, sigma=0.01, positive=1.08, negative=None)
    found = gain_at_rest_volts(full, vehicle, VOLTS)
    assert found.positive is not None
    assert found == replace(full, positive=found.positive)
    (curve, *_) = vehicle.curves.values()
    if curve.table is None:
        assert found.positive == pytest.approx(1.08 / (16.4 / vehicle.supply_V) ** curve.supply_exponent)
    else:
        forces_N = np.abs([AppliedWrench(vehicle, v).forces_N(PULSES) for v in (vehicle.supply_V, 16.4)])
        assert found.positive == pytest.approx(1.08 * forces_N[0].sum() / forces_N[1].sum(), rel=0.02)
    usual = RestVolts(vehicle.supply_V, math.nan)
    assert gain_at_rest_volts(full, vehicle, usual).positive == pytest.approx(1.08, rel=2e-3)
