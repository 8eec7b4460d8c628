"""What the calibration of the thrusters does to a result, against fits to wrongly scaled thrust."""

from dataclasses import replace

import numpy as np
import pytest

from hindrax_core.thrust.curves import Branch, Curve
from hindrax_core.thrust.table import ThrustTable
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array
from hindrax_ident.assess.axis_fit import AxisFit
from hindrax_ident.assess.influences import INFLUENCES
from hindrax_ident.assess.thrust_calibration import (
    UNKNOWN_POWER,
    branch_covariance,
    modes,
    supply_power,
    thrust_shares,
)
from hindrax_ident.assess.uncertainty_budget import Budget, budget_of
from hindrax_ident.fit.output_error import OutputErrorFit, refine
from hindrax_ident.model.model_parameters import wide_prior
from hindrax_ident.model.motion_model import Model, model_of
from hindrax_ident.records.axis_record import Record, Series, Stretch
from hindrax_ident.testing.synthetic_runs import back_and_forth, fly
from hindrax_ident.tuning import Tuning

MIRROR = np.polynomial.Polynomial([3000.0, -1.0])
"""Pulse of the same thrust in the other direction [us]."""
SURGE = np.array([66.48, 1.25, 0.0, 27.3])
PLAN = back_and_forth((4.0, 8.0, 13.0), 8.0, 64.0)


def record_of(model: Model, theta: Array, lag_s: float = 0.15, sigma: float = 0.005) -> Record:
    flight = fly(model, theta, PLAN, 0.15)
    rng = np.random.default_rng(6)
    t, v = flight.grid.times_s[::10], flight.path.v[::10]
    measured = Series(t, v + sigma * rng.standard_normal(len(t)))
    thrust = Series(flight.times_s, flight.commands)
    return Record(measured, thrust, (Stretch(0.0, 63.9),), lag_s=lag_s)


def fitted(vehicle: Vehicle, record: Record, model: Model | None = None) -> OutputErrorFit:
    model = model or model_of(vehicle, 0)
    prior = wide_prior(vehicle, model)
    return refine(model, record, prior.values, prior)


def budget(vehicle: Vehicle, record: Record, fit: OutputErrorFit, *names: str, tuning: Tuning | None = None) -> Budget:
    """Budget of the rows of these names, or of all."""
    rows = [row for row in INFLUENCES if row.name in names or not names]
    return budget_of(AxisFit(vehicle, record, fit, tuning or Tuning()), rows)


def calibration(vehicle: Vehicle, record: Record, fit: OutputErrorFit) -> Array:
    return budget(vehicle, record, fit, "thrust calibration").band()


@pytest.fixture(scope="module")
def surge(vehicle: Vehicle) -> tuple[Record, OutputErrorFit]:
    record = record_of(Model(0, 15.22), SURGE)
    return record, fitted(vehicle, record)


def test_a_thrust_that_is_rounding_has_no_error(vehicle: Vehicle) -> None:
    """Thrusters of one axis cancel on another to 1e-16 of their forces, with a sign that depends on the computer."""
    force = np.array([10.0, 1e-15, -1e-15, 0.0, -10.0])
    curve = vehicle.curves["main"]
    cubic = replace(curve, negative=replace(curve.negative, sigma=(137.82, 0.3212, 2.5e-4, 6.4e-8)))
    pulses, forces = (1100.0, 1470.0, 1530.0, 1900.0), (-20.0, -1.0, 1.0, 20.0)
    table = Curve(table=ThrustTable(pulses, (14.8,), (forces,), sigma_N=0.2))
    for doubtful in (cubic, table):
        found = modes(replace(vehicle, curves={"main": doubtful}), 0)
        assert len(found) > 1
        for mode in found:
            error = mode.error(force)
            assert np.abs(error[1:4]).max() < 1e-12 * np.abs(error).max()


def test_a_gain_error_scales_every_coefficient(vehicle: Vehicle, surge: tuple[Record, OutputErrorFit]) -> None:
    record, fit = surge
    wide = calibration(vehicle, record, fit)
    expected = 0.02**2 * np.outer(fit.theta, fit.theta)
    assert wide == pytest.approx(expected, abs=0.02 * np.abs(expected).max())


def test_the_linearization_predicts_a_fit_to_scaled_thrust(
    vehicle: Vehicle, surge: tuple[Record, OutputErrorFit]
) -> None:
    record, fit = surge
    scaled = replace(record, thrust=Series(record.thrust.t, 1.02 * record.thrust.y))
    moved = fitted(vehicle, scaled).theta - fit.theta
    wide = np.sqrt(np.diag(calibration(vehicle, record, fit)))
    assert np.abs(moved[[0, 3]]) == pytest.approx(wide[[0, 3]], rel=0.03)


def test_standard_deviations_of_a_cubic_are_kept() -> None:
    branch = Branch((927.2, -2.2726, 0.001794, -4.61e-7), 1100.0, 1475.0, (137.82, 0.3212, 2.5e-4, 6.4e-8))
    C = branch_covariance(branch)
    sigma = np.array(branch.sigma, np.float64)
    assert np.sqrt(np.diag(C)) == pytest.approx(sigma)
    assert np.all(np.linalg.eigvalsh(C / np.outer(sigma, sigma)) > -1e-9)
    # Taken alone, 137.8 N on c1 would drown every force; with its correlations the cubic is known to about a newton.
    x = np.array([1.0, 1300.0, 1300.0**2, 1300.0**3])
    assert 0.0 < float(np.sqrt(x @ C @ x)) < 3.0


def test_branches_with_standard_deviations_add_modes(vehicle: Vehicle, surge: tuple[Record, OutputErrorFit]) -> None:
    record, fit = surge
    curve = vehicle.curves["main"]
    loose = replace(curve.negative, sigma=(137.82, 0.3212, 2.5e-4, 6.4e-8))
    doubtful = replace(vehicle, curves={"main": replace(curve, negative=loose)})
    assert len(modes(vehicle, 0)) == 1
    assert len(modes(doubtful, 0)) == 2
    assert modes(doubtful, 0)[1].error(np.array([5.0, -5.0])).shape == (2, 4)
    narrow, wide = (calibration(one, record, fit) for one in (vehicle, doubtful))
    assert wide[0, 0] > narrow[0, 0]


def test_a_table_adds_a_mode_for_the_zero_of_each_direction(vehicle: Vehicle) -> None:
    rows = ((-20.0, -1.0, 0.0, 1.0, 20.0),)
    table = ThrustTable((1100.0, 1470.0, 1500.0, 1530.0, 1900.0), (14.8,), rows, sigma_N=0.2)
    doubtful = replace(vehicle, curves={"main": Curve(table=table)})
    gain, back, forth = modes(doubtful, 0)
    assert gain.covariance.tolist() == [[0.02**2]]
    assert back.covariance.tolist() == forth.covariance.tolist() == [[0.2**2]]
    for mode, sign in ((back, -1.0), (forth, 1.0)):
        for force, error in zip((8.0, -8.0), mode.error(np.array([8.0, -8.0]))[:, 0], strict=True):
            pushing = [
                per_newton for per_newton, share in thrust_shares(vehicle, 0).values() if share * force * sign > 0.0
            ]
            assert error == pytest.approx(sum(pushing))
    exact = replace(vehicle, curves={"main": Curve(table=replace(table, sigma_N=0.0))})
    assert len(modes(exact, 0)) == 1


def test_a_doubtful_positive_branch_widens_the_band_by_the_forces_ahead(
    vehicle: Vehicle, surge: tuple[Record, OutputErrorFit]
) -> None:
    curve = vehicle.curves["main"]
    mirrored = replace(
        curve.negative,
        from_us=3000.0 - curve.negative.to_us,
        to_us=3000.0 - curve.negative.from_us,
        c=tuple((-np.polynomial.Polynomial(curve.negative.c)(MIRROR)).coef.tolist()),
    )
    exact = replace(vehicle, curves={"main": replace(curve, positive=mirrored)})
    loose = replace(mirrored, sigma=(137.82, 0.3212, 2.5e-4, 6.4e-8))
    doubtful = replace(vehicle, curves={"main": replace(curve, positive=loose)})
    *others, mode = modes(doubtful, 0)
    assert len(others) == len(modes(exact, 0))
    assert np.any(mode.error(np.array([5.0])))
    narrow, wide = (calibration(one, *surge) for one in (exact, doubtful))
    assert wide[0, 0] > narrow[0, 0]


def test_a_vehicle_without_thrusters_has_nothing_to_calibrate(
    vehicle: Vehicle, surge: tuple[Record, OutputErrorFit]
) -> None:
    record, fit = surge
    bare = replace(vehicle, thrusters=(), curves={})
    assert calibration(bare, record, fit) == pytest.approx(0.0)


def test_a_weighed_buoyancy_narrows_the_gain_and_with_it_the_drag(vehicle: Vehicle) -> None:
    theta = np.array([93.5, 5.3, vehicle.net_buoyancy_N, 37.7])
    record = record_of(Model(2, 15.22), theta)
    fit = fitted(vehicle, record, Model(2, 15.22))
    known, weighed = (
        budget(vehicle, record, fit, "thrust calibration", tuning=Tuning(buoyancy_sigma_N=sigma)).band()
        for sigma in (None, 0.005)
    )
    assert np.sqrt(known[0, 0]) == pytest.approx(0.02 * 93.5, rel=0.03)
    assert weighed[0, 0] < 0.8 * known[0, 0]


def test_velocity_gain_goes_with_its_powers(vehicle: Vehicle, surge: tuple[Record, OutputErrorFit]) -> None:
    record, fit = surge
    wide = budget(vehicle, record, fit, "gain of the velocity", tuning=Tuning(velocity_gain_sigma=0.01)).band()
    share = np.sqrt(np.diag(wide)) / np.abs(fit.theta)
    assert share[[0, 1, 3]] == pytest.approx([0.02, 0.01, 0.01], rel=0.02)


def test_a_tilt_that_nobody_knows_of_is_within_the_band_of_the_offset(
    vehicle: Vehicle, surge: tuple[Record, OutputErrorFit]
) -> None:
    roll = np.array([1.29, 0.0, 0.0, 3.0008, 0.733])
    flight = fly(model_of(vehicle, 3), roll, back_and_forth((0.5, 1.0, 1.3), 5.0, 60.0), 0.15)
    t = flight.grid.times_s[::4]
    rng = np.random.default_rng(1)
    record = Record(
        Series(t, flight.path.v[::4] + 0.003 * rng.standard_normal(len(t))),
        Series(flight.times_s, flight.commands),
        (Stretch(0.0, 59.9),),
        position=Series(t[::25], flight.path.s[::4][::25] + 0.02),
        lag_s=0.15,
    )
    fit = fitted(vehicle, record, model_of(vehicle, 3))
    b, plain = float(fit.theta[2]), float(np.sqrt(fit.covariance[2, 2]))
    tilted = budget(vehicle, record, fit, "tilt of the mount", tuning=Tuning(mount_sigma_rad=0.02)).band()
    wide = float(np.hypot(plain, np.sqrt(tilted[2, 2])))
    # The restoring moment of 3 N m makes an offset of up to 0.06 N m out of it.
    assert abs(b) > 5.0 * plain
    assert abs(b) < 3.0 * wide
    assert wide < 3.0 * 0.03
    narrow = np.sqrt(np.diag(budget(vehicle, *surge, "tilt of the mount", tuning=Tuning(mount_sigma_rad=0.02)).band()))
    assert narrow == pytest.approx([0.0, 0.0, 0.02 * vehicle.net_buoyancy_N, 0.0], abs=1e-6)


def test_the_right_law_raises_no_warning(vehicle: Vehicle, surge: tuple[Record, OutputErrorFit]) -> None:
    assert not budget(vehicle, *surge).warnings()


def test_a_wrong_lag_is_measured(vehicle: Vehicle) -> None:
    record = record_of(Model(0, 15.22), SURGE, lag_s=0.10)
    found, sigma = budget(vehicle, record, fitted(vehicle, record)).found("thrust lag")
    assert found == pytest.approx(0.05, abs=0.02)
    assert sigma < 0.015


def test_a_lopsided_hull_is_named(vehicle: Vehicle) -> None:
    lopsided = Model(0, 15.22, split=True)
    record = record_of(lopsided, np.array([66.48, 1.25, 45.0, 1.25, 0.0, 27.3]), sigma=0.002)
    reported = budget(vehicle, record, fitted(vehicle, record))
    assert any("asymmetry" in str(warning.numbers["influence"]) for warning in reported.warnings())
    assert reported.found("fore/aft asymmetry")[0] == pytest.approx(0.19, abs=0.05)


def test_thrust_grows_with_the_power_of_the_voltage_that_its_curves_have(vehicle: Vehicle) -> None:
    """It was 1.7 for all: half as much sag again was taken off the drag of a vehicle whose curve says 1.2."""

    def with_power(power: float) -> Vehicle:
        curves = {name: replace(one, supply_exponent=power) for name, one in vehicle.curves.items()}
        return replace(vehicle, curves=curves)

    assert supply_power(vehicle) == pytest.approx(vehicle.curves["main"].supply_exponent)
    assert supply_power(with_power(0.0)) == 0.0
    assert supply_power(with_power(2.5)) == pytest.approx(2.5)
    assert supply_power(replace(vehicle, thrusters=(), curves={})) == UNKNOWN_POWER


def test_of_a_table_the_power_is_that_between_its_voltages(vehicle: Vehicle) -> None:
    pulses = (1100.0, 1400.0, 1475.0, 1525.0, 1600.0, 1900.0)
    row = np.array([-40.0, -4.0, 0.0, 0.0, 5.0, 50.0])
    rows = tuple(tuple((row * (volts / 14.0) ** 1.4).tolist()) for volts in (12.0, 14.0, 16.0))
    table = Curve(table=ThrustTable(pulses, (12.0, 14.0, 16.0), rows), supply_exponent=1.2)
    flown = replace(vehicle, curves={"main": table}, supply_V=14.0)
    assert supply_power(flown) == pytest.approx(1.4, abs=0.02)
