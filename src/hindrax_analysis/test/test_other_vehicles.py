"""What records of other vehicles do not say: lag and latency, dead bands, tethers, motions along other axes."""

import functools
import math
from typing import Any

import numpy as np
import pytest

from hindrax_analysis.records.recording import Recording, events, tuned
from hindrax_core.events import to_s
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array
from hindrax_ident.assess import assessment as assessment_module
from hindrax_ident.assess.objections import CAUSES, Code
from hindrax_ident.assess.results import MotionResult
from hindrax_ident.fit.scores import slow_force_ratio
from hindrax_ident.model.motion_model import Model
from hindrax_ident.online import session as session_module
from hindrax_ident.online.session import Outcome, Session
from hindrax_ident.testing.synthetic_runs import Flight, Plan, back_and_forth, fly
from hindrax_ident.tuning import Tuning

OTHER = Vehicle("other", 11.5, 0.0117, (0.457, 0.338, 0.254))
TRUTH = {"k_q": 18.2, "k_l": 4.0, "added_mass": 5.5}
THETA = np.array([18.2, 4.0, 0.0, 17.0])
EMPTY = np.zeros(0), np.zeros((0, 3))


def wave(*, beat_radps: float = 0.0, overtone: float = 0.0, rate_radps: float = 0.7, end_s: float = 60.0) -> Plan:
    """Smooth commands of 100 Hz; with a beat of all sizes, with an overtone of no plain symmetry."""
    times = np.arange(0.0, end_s, 0.01, dtype=np.float64)
    shape = np.sin(rate_radps * times) * np.cos(beat_radps * times) + overtone * np.sin(2.3 * rate_radps * times + 1.0)
    return Plan(times, 40.0 * shape, end_s)


PLANS = {
    "steps": back_and_forth((4.0, 25.0, 45.0), 5.0, 60.0),
    "two": back_and_forth((8.0, 40.0), 5.0, 60.0),
    "smooth": wave(beat_radps=0.2, overtone=0.3, rate_radps=1.2),
    "sine": wave(),
}


@functools.cache
def flight(kind: str = "steps", lag_s: float = 0.2) -> Flight:
    return fly(Model(0, OTHER.mass_kg), THETA, PLANS[kind], lag_s)


def only(axis: int, values: Array) -> Array:
    table = np.full((len(values), 6), np.nan)
    table[:, axis] = values
    return table


def recorded(flown: Flight, latency_s: float = 0.0, noise: float = 0.01, wrench: Array | None = None) -> Recording:
    """Velocities at 20 Hz whose stamps are late, and commands that are taken for forces."""
    rng = np.random.default_rng(1)
    v = flown.path.v[::10]
    velocity = only(0, v + noise * rng.standard_normal(len(v)))
    reported = flown.commands if wrench is None else wrench
    return Recording("x", flown.grid.times_s[::10] + latency_s, velocity, flown.times_s, only(0, reported), *EMPTY)


def finalized(recording: Recording, **knobs: Any) -> tuple[Outcome, float]:
    session = Session(OTHER, tuned([recording], Tuning(**knobs)), every_s=math.inf)
    for event in events(recording, 0):
        session.step(event)
    return session.finalize(), to_s(next(iter(events(recording, 0))).stamp)


def surge(recording: Recording, **knobs: float) -> MotionResult:
    return finalized(recording, **knobs)[0].results.motions["surge"]


def off(result: MotionResult, name: str, truth: dict[str, float] = TRUTH) -> float:
    """Distance from the truth in calibrated standard deviations."""
    number = result.coefficients[name]
    return abs(number.value - truth[name]) / number.std_calibrated


@pytest.mark.parametrize(("lag_s", "latency_s"), [(0.0, 0.0), (0.25, 0.0), (0.1, 0.2), (0.3, 0.1)])
def test_lag_and_latency_that_nobody_given_are_found_together(lag_s: float, latency_s: float) -> None:
    found = surge(recorded(flight(lag_s=lag_s), latency_s))
    assert found.quality["lag_s"] + found.quality["latency_s"] == pytest.approx(lag_s + latency_s, abs=0.03)
    assert max(off(found, name) for name in TRUTH) < 3.0
    # Without them the added mass would be wrong by 5 kg and more.
    assert found.coefficients["added_mass"].std_calibrated < 2.0


@pytest.mark.parametrize(
    ("lag_s", "latency_s"), [(0.0, 0.0), (0.05, 0.0), (0.12, 0.0), (0.25, 0.0), (0.1, 0.1), (0.1, 0.2)]
)
def test_the_live_estimate_does_not_take_a_delay_for_mass_or_drag(lag_s: float, latency_s: float) -> None:
    """Of the live deviations alone; without the delay among its unknowns it was up to 17 of them off."""
    recording = recorded(flight(lag_s=lag_s), latency_s)
    session = Session(OTHER, tuned([recording]))
    last = [one for event in events(recording, 0) for one in session.step(event)][-1].reading
    for name, value, sigma in zip(last.names, last.values, last.sigmas, strict=True):
        assert abs(value - TRUTH.get(name, 0.0)) < 3.0 * sigma, name


def test_smooth_commands_show_the_lag_too() -> None:
    found = surge(recorded(flight("smooth", 0.12)))
    assert found.quality["lag_s"] + found.quality["latency_s"] == pytest.approx(0.12, abs=0.02)
    assert found.coefficients["k_q"].value == pytest.approx(TRUTH["k_q"], rel=0.003)


def test_where_the_record_cannot_show_the_lag_the_mass_is_in_doubt() -> None:
    # One frequency has one phase: that of the mass and that of the lag are the same.
    recording = recorded(flight("sine", 0.2))
    found, wider = surge(recording), surge(recording, lag_doubt_s=0.5)
    assert off(found, "added_mass") < 3.0
    assert wider.coefficients["added_mass"].std > found.coefficients["added_mass"].std > 0.5


def test_a_dead_band_that_nobody_given_is_within_the_band() -> None:
    flown = flight("two", 0.1)
    recording = recorded(flown, wrench=flown.commands + 1.2 * np.sign(flown.commands))
    wide = surge(recording)
    assert max(off(wide, name) for name in TRUTH) < 3.0
    assert wide.budget["k_l"][0].influence == "dead band of the thrust"


@pytest.mark.parametrize("exponent", [1.0, 1.3, 2.0])
def test_a_thrust_of_another_law_is_suspected(exponent: float) -> None:
    """The record tells a thrust of another power than the true one; the same at the largest command."""
    flown = flight(lag_s=0.1)
    reported = 45.0 * np.sign(flown.commands) * np.abs(flown.commands / 45.0) ** (1.0 / exponent)
    found = surge(recorded(flown, wrench=reported))
    assert max(off(found, name) for name in TRUTH) < 3.0
    suspected = any(
        one.numbers["influence"] == "exponent of the thrust" for one in found.warnings if one.code in CAUSES
    )
    assert (suspected, found.identifiable) == (exponent > 1.0, exponent == 1.0)


def test_forces_that_wander_slowly_are_noticed() -> None:
    rng = np.random.default_rng(3)
    flown = flight(lag_s=0.1)
    push = np.interp(flown.times_s, np.arange(0.0, 61.0, 2.0), 3.0 * rng.standard_normal(31))
    calm = finalized(recorded(flown))[0].assessments[0].fit
    pushed = finalized(recorded(flown, wrench=flown.commands + push))[0].assessments[0].fit
    assert slow_force_ratio(calm) < 1.3
    assert np.all(np.diag(pushed.covariance)[:2] > 4.0 * np.diag(calm.covariance)[:2])


def test_a_vehicle_that_turns_while_it_goes_ahead_is_corrected_by_what_the_record_states() -> None:
    flown = flight(lag_s=0.1)
    plain = recorded(flown)
    sway, yaw = 0.6 * flown.path.v, 0.5
    # What the water makes of it acts like thrust, through no lag.
    pushed = np.interp(flown.times_s, flown.grid.times_s, 1.8 * OTHER.mass_kg * sway * yaw)
    moving = plain.velocity.copy()
    moving[:, 1], moving[:, 5] = sway[::10], yaw
    reported, silent = (
        surge(Recording("x", plain.velocity_t, v, plain.wrench_t, only(0, flown.commands - pushed), *EMPTY))
        for v in (moving, plain.velocity)
    )
    assert max(off(reported, name) for name in TRUTH) < 3.0
    assert abs(reported.coefficients["k_l"].value - 4.0) < 1.0
    assert abs(silent.coefficients["k_l"].value - 4.0) > 4.0


def test_linear_drag_that_pushes_is_no_drag() -> None:
    flown = flight(lag_s=0.1)
    # Thrust that grows with the speed, as nobody would build it.
    speeds = np.interp(flown.times_s, flown.grid.times_s, flown.path.v)
    found = surge(recorded(flown, wrench=flown.commands - 18.0 * speeds, noise=0.003))
    assert not found.identifiable
    assert any(one.numbers["name"] == "k_l" for one in found.reasons if one.code is Code.NEGATIVE_DRAG)


def test_thrusters_that_nobody_described_may_be_unsteady_all_the_same() -> None:
    fit = finalized(recorded(flight(lag_s=0.1)))[0].assessments[0].fit
    assert np.any(fit.problem.efforts > 0.0)


@pytest.mark.parametrize("step", ["result_of", "combine_drafts"])
def test_what_no_algebra_solves_is_a_sentence(monkeypatch: pytest.MonkeyPatch, step: str) -> None:
    """As flipped bits of a log may be; a common noise that cannot be had is none."""

    def singular(*_: object, **__: object) -> None:
        raise np.linalg.LinAlgError("Singular matrix")

    if step == "result_of":
        monkeypatch.setattr(session_module, step, singular)
        found = surge(recorded(flight()))
        assert (found.identifiable, [one.code for one in found.reasons]) == (False, [Code.NO_FIT])
    else:
        monkeypatch.setattr(assessment_module, "common_noise", singular)
        assert surge(recorded(flight())).identifiable
