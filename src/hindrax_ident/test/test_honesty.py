"""Poor excitation, wrong signs, strange records: wide bands or a refusal with its reason."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hindrax_core.events import Stamped
from hindrax_core.readings import Vec3, Vec6
from hindrax_core.signals import Thrust, Velocity
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.objections import CAUSES, Code
from hindrax_ident.assess.quality import Evidence, Excitation, reasons_against
from hindrax_ident.assess.results import Contribution, MotionResult, truth_of
from hindrax_ident.model.motion_model import model_of
from hindrax_ident.online.session import Session
from hindrax_ident.records.feed import Feed
from hindrax_ident.testing.synthetic_runs import DVL, Plan, Sensors, back_and_forth, events, fly, sensors_of
from hindrax_ident.tuning import Tuning, for_foreign_records

SURGE = np.array([66.48, 1.25, 0.0, 27.3])


def identify(vehicle: Vehicle, inputs: list[Stamped[Thrust]]) -> MotionResult:
    session = Session(vehicle, every_s=math.inf)
    for event in inputs:
        session.step(event)
    return session.finalize().results.motions["surge"]


def flown(vehicle: Vehicle, plan: Plan, seed: int = 1, sensors: Sensors = DVL, theta: Array = SURGE) -> list[Any]:
    flight = fly(model_of(vehicle, 0), theta, plan, 0.15)
    return list(events(flight, 0, "surge", sensors, np.random.default_rng(seed)))


def honest(result: MotionResult) -> bool:
    """Either the truth is within the bands, or the result says that it is none."""
    within = all(
        abs(result.coefficients[name].value - truth) < 4.0 * result.coefficients[name].std
        for name, truth in (("k_q", 66.48), ("k_l", 1.25), ("b", 0.0))
        if name in result.coefficients
    )
    return within or not result.identifiable


def test_fewer_than_ten_samples_are_no_evidence() -> None:
    def codes(samples: float) -> list[Code]:
        evidence = Evidence(
            k=SURGE[:2],
            covariance=0.01 * np.eye(2),
            excitation=Excitation(0.1, 0.5),
            effective_samples=samples,
            noise=0.01,
            added_mass_sigmas=5.0,
            converged=True,
            validation=None,
            drag_std=0.1,
            largest=Contribution("noise of the record", 0.1, "fly longer"),
        )
        return [one.code for one in reasons_against(evidence)]

    assert codes(9.6) == [Code.FEW_SAMPLES]
    assert codes(10.0) == []


@pytest.mark.parametrize("seed", range(3))
def test_a_parked_vehicle_is_not_identifiable(vehicle: Vehicle, seed: int) -> None:
    result = identify(vehicle, flown(vehicle, Plan(np.zeros(1), np.zeros(1), 60.0), seed))
    assert not result.identifiable
    codes = {one.code for one in result.reasons}
    assert codes & {Code.HARDLY_MOVED, Code.POORLY_KNOWN_DRAG}
    assert Code.UNEXPLAINED_MOTION not in codes


def test_a_motion_that_no_thrust_explains_is_reported_with_its_own_speed(vehicle: Vehicle) -> None:
    towed = [
        Stamped(event.stamp, Thrust((0.0,) * 6)) if isinstance(event.reading, Thrust) else event
        for event in flown(vehicle, back_and_forth((4.0, 9.0), 10.0, 80.0))
    ]
    result = identify(vehicle, towed)
    assert not result.identifiable
    (reason,) = (one for one in result.reasons if one.code is Code.UNEXPLAINED_MOTION)
    assert reason.numbers["speed"] == pytest.approx(0.36, abs=0.005)


@pytest.mark.parametrize("force", [0.6, 3.0, 12.0])
def test_one_speed_does_not_separate_quadratic_from_linear(vehicle: Vehicle, force: float) -> None:
    plan = Plan(np.zeros(1), np.array([force]), 60.0)
    result = identify(vehicle, flown(vehicle, plan))
    assert not result.identifiable
    assert honest(result)


def test_transients_alone_do_not_separate_quadratic_from_linear(vehicle: Vehicle) -> None:
    # Both directions and hardly any noise: the fit is sure of itself, by the milliseconds of how the speed was reached.
    result = identify(vehicle, flown(vehicle, back_and_forth((8.0,), 15.0, 180.0)))
    assert not result.identifiable
    assert Code.ONE_SPEED in {one.code for one in result.reasons}
    assert identify(vehicle, flown(vehicle, back_and_forth((4.0, 12.0), 15.0, 180.0))).identifiable


def test_slow_runs_give_the_force_band_instead(vehicle: Vehicle) -> None:
    result = identify(vehicle, flown(vehicle, back_and_forth((0.1, 0.15), 20.0, 60.0)))
    assert not result.identifiable
    assert honest(result)
    assert result.drag is not None
    truth = 66.48 * result.drag.speed**2 + 1.25 * result.drag.speed
    assert np.all(np.abs(result.drag.force - truth) < 4.0 * result.drag.std)


def test_the_wrong_sign_of_the_wrench_is_named(vehicle: Vehicle) -> None:
    def turned(wrench: Vec6) -> Vec6:
        X, Y, Z, K, M, N = wrench
        return -X, -Y, -Z, -K, -M, -N

    inputs = [
        Stamped(event.stamp, Thrust(turned(event.reading.wrench))) if isinstance(event.reading, Thrust) else event
        for event in flown(vehicle, back_and_forth((4.0, 9.0, 13.0), 10.0, 80.0))
    ]
    result = identify(vehicle, inputs)
    assert not result.identifiable
    assert result.reasons


def test_a_wrench_that_has_nothing_to_do_with_the_motion_is_found_out(vehicle: Vehicle) -> None:
    inputs = flown(vehicle, back_and_forth((4.0, 9.0, 13.0), 10.0, 80.0))
    rng = np.random.default_rng(0)
    other = {round(k * 0.7, 6): float(rng.uniform(-13.0, 13.0)) for k in range(200)}
    wrong = []
    for event in inputs:
        if isinstance(event.reading, Thrust):
            key = max(t for t in other if t <= event.stamp / 1e9 + 1e-9)
            wrong.append(Stamped(event.stamp, Thrust((other[key], *event.reading.wrench[1:]))))
        else:
            wrong.append(event)
    result = identify(vehicle, wrong)
    assert not result.identifiable


def drifting(inputs: list[Any], current_mps: float) -> list[Any]:
    """Velocity over ground in water that moves: the drag is no longer that of the measured velocity."""
    return [
        Stamped(
            event.stamp,
            Velocity((event.reading.nu[0] + current_mps, *event.reading.nu[1:]), "dvl75"),
        )
        if isinstance(event.reading, Velocity)
        else event
        for event in inputs
    ]


@pytest.mark.parametrize(
    ("levels", "current_mps"),
    [
        *(((4.0, 9.0, 13.0), current) for current in (-0.3, 0.02)),
        *(((1.1, 1.4, 1.8), current) for current in (-0.05, 0.15)),
        *(((0.24, 0.26, 0.33), current) for current in (-0.3, 0.02)),
    ],
)
def test_an_unknown_current_is_not_taken_for_drag_with_confidence(
    vehicle: Vehicle, levels: Vec3, current_mps: float
) -> None:
    inputs = drifting(flown(vehicle, back_and_forth(levels, 10.0, 80.0)), current_mps)
    assert honest(identify(vehicle, inputs))


def test_a_current_is_measured_and_still_water_is_not_suspected(vehicle: Vehicle) -> None:
    inputs = flown(vehicle, back_and_forth((2.0, 6.0, 13.0), 10.0, 120.0))
    still, moved = (identify(vehicle, drifting(inputs, current)) for current in (0.0, 0.02))
    assert abs(still.quality["current_mps"]) < 3.0 * still.quality["current_sigma_mps"]
    assert moved.quality["current_mps"] == pytest.approx(0.02, abs=0.01)
    assert moved.quality["current_mps"] > 3.0 * moved.quality["current_sigma_mps"]
    assert moved.coefficients["b"].std > 3.0 * still.coefficients["b"].std


@settings(max_examples=12, deadline=None, derandomize=True)
@given(
    top=st.floats(0.05, 1.5),
    span_s=st.floats(5.0, 15.0),
    rate_Hz=st.sampled_from([5.0, 10.0, 20.0]),
    sigma=st.sampled_from([0.003, 0.01, 0.03]),
)
def test_slow_runs_are_never_confidently_wrong(
    vehicle: Vehicle, top: float, span_s: float, rate_Hz: float, sigma: float
) -> None:
    sensors, seed = Sensors(velocity_Hz=rate_Hz, velocity_sigma=sigma), round(1e4 * top)
    plan = back_and_forth((0.6 * top, top), span_s, 60.0)
    assert honest(identify(vehicle, flown(vehicle, plan, seed, sensors)))


def test_a_noisy_velocity_gives_wide_bands(vehicle: Vehicle) -> None:
    noisy = Sensors(velocity_sigma=0.2)
    result = identify(vehicle, flown(vehicle, back_and_forth((4.0, 13.0), 10.0, 60.0), sensors=noisy))
    assert honest(result)
    assert result.coefficients["k_q"].std > 5.0


def test_weight_that_the_file_does_not_have_is_no_tether(vehicle: Vehicle) -> None:
    """Heave that sinks by four metres with 5 N of buoyancy more than in the file: all of it is the model's b.

    The depths tell a pull that grows with them to a thousandth of what is usual.
    """
    down, up = (truth_of(vehicle)[name] for name in ("heave_down", "heave_up"))
    model = model_of(vehicle, 2)
    drags = [down["k_q"], down["k_l"], up["k_q"], up["k_l"]]
    theta = np.array([*drags, down["b"] + 5.0, model.rigid + down["added_mass"]])
    plan = back_and_forth((5.0, 12.0, 30.0), 4.0, 100.0)
    flight = fly(model, theta, replace(plan, forces=array(plan.forces + down["b"] + 4.0)), 0.12)
    assert np.ptp(flight.path.s) > 4.0
    session = Session(replace(vehicle, thrusters=()), for_foreign_records(Tuning()), every_s=math.inf)
    rng = np.random.default_rng(1)
    for event in Feed(session.vehicle, session.tuning).all(events(flight, 2, "heave_down", sensors_of(2), rng)):
        session.step(event)
    for result in session.finalize().results.motions.values():
        assert result.identifiable
        assert not [one for one in result.warnings if one.code in CAUSES]
        assert result.coefficients["b"].value == pytest.approx(theta[4], abs=0.3)
        assert result.coefficients["k_l"].std_calibrated < 8.0
