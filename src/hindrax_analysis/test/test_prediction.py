"""Free-running prediction: exact for the model's own motion, and honest about the coefficients of another vehicle."""

from dataclasses import replace

import numpy as np
import pytest

from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.prediction import predict_record, with_delays_of
from hindrax_ident.assess.quality import held_out
from hindrax_ident.assess.results import Number
from hindrax_ident.model.model_parameters import parameters_of
from hindrax_ident.model.motion_model import model_of
from hindrax_ident.model.simulation import trajectory
from hindrax_ident.records.axis_record import Record, Series, Stretch
from hindrax_ident.testing.synthetic_runs import back_and_forth, fly

ROV = Vehicle("rov", mass_kg=20.0, volume_m3=0.0203, envelope_m=(0.6, 0.5, 0.4))
TRUE = {"k_q": 60.0, "k_l": 2.0, "b": 0.5, "added_mass": 12.0}
END_S = 60.0


def numbers(**changed: float) -> dict[str, dict[str, Number]]:
    return {"surge": {name: Number(value, 0.1) for name, value in (TRUE | changed).items()}}


def flown(noise_mps: float = 0.0) -> Record:
    """Surge back and forth, velocities at 10 Hz."""
    theta: Array = parameters_of(model_of(ROV, 0), {"surge": TRUE})
    flight = fly(model_of(ROV, 0), theta, back_and_forth((4.0, 8.0, 12.0), 5.0, END_S), 0.0)
    t, v = flight.grid.times_s[::20], flight.path.v[::20]
    v = array(v + noise_mps * np.random.default_rng(1).standard_normal(len(v)))
    thrust = Series(flight.times_s, flight.commands)
    return Record(Series(t, v), thrust, (Stretch(0.0, END_S),))


def test_the_motion_of_the_model_itself_is_predicted() -> None:
    found = predict_record(numbers(), ROV, 0, flown(), 10.0)
    assert found.rmse(found.predicted) < 1e-3 * found.rmse(found.still)
    assert found.windows == 6
    assert found.unit == "m/s"


def test_what_a_fit_knows_of_the_speed_across_its_prediction_knows_too() -> None:
    """A body with k_w = k_q that moves across at up to 0.4 m/s; without k_w the model is the one of before."""
    model = replace(model_of(ROV, 0), crossed=True)
    theta = parameters_of(model, {"surge": TRUE | {"k_w": 60.0}})
    flight = fly(model_of(ROV, 0), theta[[0, 1, 2, 4]], back_and_forth((4.0, 8.0, 12.0), 5.0, END_S), 0.0)
    across = array(0.4 * np.abs(np.sin(0.7 * flight.grid.times_s)))
    path = trajectory(model, theta, replace(flight.grid, across=across), flight.path)
    assert path is not None
    t, v = flight.grid.times_s[::20], path.v[::20]
    stretches = (Stretch(0.0, END_S),)
    record = Record(
        Series(t, v), Series(flight.times_s, flight.commands), stretches, across=Series(t, array(across[::20]))
    )
    whole, alone = (predict_record(one, ROV, 0, record, 10.0) for one in (numbers(k_w=60.0), numbers()))
    assert whole.rmse(whole.predicted) < 0.005
    assert alone.rmse(alone.predicted) > 5.0 * whole.rmse(whole.predicted)


def test_a_record_of_another_stack_has_the_delays_that_the_fit_found() -> None:
    flown_late = flown()
    late = replace(flown_late, velocity=Series(array(flown_late.velocity.t + 0.3), flown_late.velocity.y))
    found = with_delays_of(late, [{}, {"lag_s": 0.0, "latency_s": 0.3, "residual_std": 0.01}])
    assert (found.lag_s, found.latency_s) == (0.0, 0.3)
    assert with_delays_of(late, [{"residual_std": 0.01}]) is late
    right, wrong = (predict_record(numbers(), ROV, 0, one, 10.0) for one in (found, late))
    assert right.rmse(right.predicted) < 0.1 * wrong.rmse(wrong.predicted)


def test_noise_of_the_beginning_does_not_grow() -> None:
    found = predict_record(numbers(), ROV, 0, flown(noise_mps=0.01), 10.0)
    assert found.rmse(found.predicted) < 0.02


def test_coefficients_of_another_vehicle_are_found_out() -> None:
    own, other = (predict_record(numbers(k_q=k_q), ROV, 0, flown(), 10.0) for k_q in (60.0, 120.0))
    assert other.rmse(other.predicted) > 5.0 * own.rmse(own.predicted)


def test_depths_alone_are_predicted_as_depths() -> None:
    """Heave of a vehicle whose depth alone is measured."""
    heave = {name: numbers()["surge"] for name in ("heave_down", "heave_up")}
    surge = flown()
    depth = np.concatenate(([0.0], np.cumsum(0.05 * (surge.velocity.y[1:] + surge.velocity.y[:-1]))))
    record = replace(surge, velocity=Series(np.zeros(0), np.zeros(0)), position=Series(surge.velocity.t, array(depth)))
    found = predict_record(heave, ROV, 2, record, 10.0)
    assert found.unit == "m"
    assert found.rmse(found.predicted) < 0.01 * found.rmse(found.still)
    assert found.rmse(found.predicted) < 0.01 * found.rmse(found.steady)


def test_of_several_runs_the_last_is_held_out_and_of_one_its_last_quarter() -> None:
    legs = [Stretch(start, start + 20.0) for start in (0.0, 20.5, 1041.0, 1061.5)]
    assert held_out(tuple(legs)) == (tuple(legs[:2]), tuple(legs[2:]))
    first, last = held_out((*legs[:1], legs[2], legs[3], replace(legs[3], start_s=1082.0, end_s=1102.0)))
    assert sum(one.end_s - one.start_s for one in last) == pytest.approx(20.0), "the last run is most of all: a quarter"
    assert first[-1].end_s <= last[0].start_s
    (kept,), (left,) = held_out((replace(legs[0], end_s=80.0),))
    assert (kept.start_s, kept.end_s, left.start_s, left.end_s) == (0.0, 60.0, 60.0, 80.0)


def test_windows_longer_than_any_stretch_are_refused() -> None:
    with pytest.raises(HindraxError, match=r"no stretch of the record lasts 90 s, the longest 60 s"):
        predict_record(numbers(), ROV, 0, flown(), 90.0)


def test_what_was_not_identified_is_named() -> None:
    lacking = {"surge": {name: one for name, one in TRUE.items() if name != "added_mass"}}
    with pytest.raises(UsageError, match="surge: found no mass"):
        parameters_of(model_of(ROV, 0), lacking)
