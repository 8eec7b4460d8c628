"""The online estimate of one axis: bands as wide as it is off, and a reason for every velocity that teaches nothing."""

import math

import numpy as np
import pytest

from hindrax_ident.arrays import Array, array
from hindrax_ident.model.model_parameters import Prior
from hindrax_ident.model.motion_model import Model
from hindrax_ident.online.axis_estimator import AxisEstimator
from hindrax_ident.online.sample_verdict import SENTENCES, NotLearned, SampleVerdict, not_learned
from hindrax_ident.records.binning import DEPTH_S
from hindrax_ident.testing.synthetic_runs import STEP_S, Plan, back_and_forth, fly
from hindrax_ident.tuning import Tuning

MODEL, THETA = Model(0, 15.22), np.array([66.48, 1.25, 0.0, 27.3])
LAG_S, HELD_S, RUNS = 0.15, 0.1, 60


def deviations(seed: int, forgetting: float = 1.0) -> Array:
    """Errors in the deviations that are told, (p,): thrust is 6 % off, the DVL has 1 cm/s."""
    rng = np.random.default_rng(seed)
    plan = back_and_forth((14.0, 0.8, 5.4), 10.0, 60.0)
    held = round(HELD_S / 0.02)
    flight = fly(MODEL, THETA, plan, LAG_S, np.repeat(0.06 * rng.standard_normal(round(60.0 / HELD_S) + 1), held))
    prior = Prior(np.array([60.0, 2.0, 0.0, 30.0]), np.array([60.0, 60.0, 5.0, 30.0]))
    estimator = AxisEstimator(MODEL, LAG_S, prior, Tuning(forgetting=forgetting))
    for at_s, force in zip(flight.times_s.tolist(), flight.commands.tolist(), strict=True):
        estimator.thrust(at_s, force)
    step = round(0.1 / float(flight.grid.times_s[1]))
    for at_s, v in zip(flight.grid.times_s[::step].tolist(), flight.path.v[::step].tolist(), strict=True):
        estimator.velocity(at_s, v + 0.01 * float(rng.standard_normal()))
    found, covariance = estimator.estimate()
    return array((found - THETA) / np.sqrt(np.diag(covariance)))


def test_short_records_show_bands_that_hold() -> None:
    z = np.array([deviations(seed) for seed in range(RUNS)])
    assert np.sqrt(np.mean(z**2, axis=0)).max() < 1.25
    assert np.mean(np.abs(z) < 1.96) > 0.88


def test_with_forgetting_they_are_bands_too() -> None:
    z = np.array([deviations(seed, forgetting=0.99) for seed in range(5)])
    assert np.all(np.isfinite(z))
    assert np.abs(z).max() < 5.0


PRIOR = Prior(np.array([60.0, 2.0, 0.0, 30.0]), np.array([60.0, 60.0, 5.0, 30.0]))
NOISE_mps = 0.01


def taught(tuning: Tuning, seconds: float = 60.0, color: float = 0.0) -> tuple[AxisEstimator, list[SampleVerdict]]:
    """Estimator after a flight that it was told of at 10 Hz, and its verdicts; `color`: correlation of the noise."""
    rng, estimator = np.random.default_rng(4), AxisEstimator(MODEL, LAG_S, PRIOR, tuning)
    flight = fly(MODEL, THETA, back_and_forth((14.0, 0.8, 5.4), 10.0, seconds), LAG_S)
    for at_s, force in zip(flight.times_s.tolist(), flight.commands.tolist(), strict=True):
        estimator.thrust(at_s, force)
    step = round(0.1 / float(flight.grid.times_s[1]))
    moments = zip(flight.grid.times_s[::step].tolist(), flight.path.v[::step].tolist(), strict=True)
    verdicts, noise_mps = list[SampleVerdict](), 0.0
    for t_s, v in moments:
        noise_mps = color * noise_mps + math.sqrt(1.0 - color**2) * NOISE_mps * float(rng.standard_normal())
        verdicts.append(estimator.velocity(t_s, v + noise_mps))
    return estimator, verdicts


def still(
    estimator: AxisEstimator, begin_s: float, seconds: float, v: float = 0.0, every_s: float = 0.1
) -> list[SampleVerdict]:
    """Verdicts of velocities without thrust."""
    out = []
    for index in range(round(seconds / every_s)):
        t_s = begin_s + every_s * (index + 1)
        estimator.thrust(t_s, 0.0)
        out.append(estimator.velocity(t_s, v))
    return out


def test_every_velocity_that_teaches_nothing_states_why() -> None:
    estimator = AxisEstimator(MODEL, LAG_S, PRIOR, Tuning())
    estimator.thrust(0.2, 0.0)
    assert estimator.velocity(0.1, 0.0).reason.code is NotLearned.NO_THRUST
    assert estimator.velocity(0.1, 0.0).reason.code is NotLearned.NOT_LATER
    late = estimator.velocity(0.05, 0.0)
    assert (late.learned, late.reason.code) == (False, NotLearned.NOT_LATER)
    assert estimator.velocity(0.2, 0.0).reason.code is NotLearned.SETTLING
    turning = not_learned(NotLearned.PHASE, phase="turning")
    assert estimator.velocity(0.3, 0.0, turning).reason is turning
    settling = still(estimator, 0.3, 6.0)
    assert {one.reason.code for one in settling} == {NotLearned.SETTLING, NotLearned.NONE}
    assert [one.learned for one in settling] == sorted(one.learned for one in settling)
    assert math.isfinite(settling[-1].innovation)
    reasons = [estimator.velocity(6.3 + 0.48 * index, 0.0).reason for index in range(1, 6)]
    assert reasons == ["", "", "", "", not_learned(NotLearned.OLD_THRUST, age_s=2.4)]
    estimator.thrust(10.0, 0.0)
    assert estimator.velocity(10.0, 0.0).reason == not_learned(NotLearned.GAP, pause_s=1.3)
    assert still(estimator, 10.0, 0.1)[0].reason.code is NotLearned.SETTLING
    fresh = AxisEstimator(MODEL, LAG_S, PRIOR, Tuning())
    fresh.thrust(0.0, 0.0)
    assert fresh.velocity(0.1, 0.0).reason.code is NotLearned.FIRST_VELOCITY


def test_a_reason_is_its_sentence_for_whoever_watches() -> None:
    assert set(SENTENCES) == set(NotLearned)
    assert not_learned(NotLearned.OLD_THRUST, age_s=2.4) == "the last thrust is 2.4 s old"
    assert not_learned(NotLearned.PHASE, phase="settle") == "phase settle"


def test_before_the_first_velocity_the_estimate_is_the_prior_and_no_narrower() -> None:
    found, covariance = AxisEstimator(MODEL, LAG_S, PRIOR, Tuning()).estimate()
    wider = np.sqrt(np.diag(covariance)) / PRIOR.sigmas
    assert found == pytest.approx(PRIOR.values)
    assert np.all((wider > 0.999) & (wider < 2.0))


def test_samples_and_noise_are_those_that_it_was_taught() -> None:
    estimator, verdicts = taught(Tuning())
    learned = [one for one in verdicts if one.learned]
    assert estimator.samples == len(learned)
    assert len(learned) > 0.9 * len(verdicts)
    assert estimator.noise == pytest.approx(NOISE_mps, rel=0.1)
    assert estimator.regression.noise_variance == pytest.approx(NOISE_mps**2, rel=0.2)
    assert np.std([one.innovation for one in learned[100:]]) == pytest.approx(NOISE_mps, rel=0.15)
    assert estimator.effective_samples == pytest.approx(len(learned), rel=0.2)
    colored, _ = taught(Tuning(), color=0.8)
    assert colored.effective_samples < 0.7 * colored.samples
    forgetful, _ = taught(Tuning(forgetting=0.99))
    assert forgetful.effective_samples < 120.0
    assert math.isnan(AxisEstimator(MODEL, LAG_S, PRIOR, Tuning()).noise)


def test_a_wild_velocity_teaches_nothing_and_leaves_no_trace() -> None:
    estimator, _ = taught(Tuning())
    still(estimator, 60.0, 10.0)
    before, samples = estimator.estimate()[0].tolist(), estimator.samples
    for sign in (1.0, -1.0):
        reported = estimator.velocity(70.0 + 0.05 * (2.0 + sign), 0.3 * sign)
        assert (reported.learned, reported.reason.code) == (False, NotLearned.OUTLIER)
        assert reported.innovation == pytest.approx(0.3 * sign, abs=0.05)
    assert estimator.estimate()[0].tolist() == before
    assert estimator.samples == samples
    assert all(one.learned for one in still(estimator, 70.2, 3.0))
    # One in two is wild: none of them ever counts as the truth.
    for index in range(60):
        wild = index % 2 == 0
        assert still(estimator, 73.2 + 0.1 * index, 0.1, 0.3 if wild else 0.0)[0].learned is not wild


def test_when_every_velocity_is_wild_the_estimate_is_wrong_not_they() -> None:
    estimator, _ = taught(Tuning())
    still(estimator, 60.0, 10.0)
    verdicts = still(estimator, 70.0, 3.0, 0.3, every_s=0.04)
    rejected = [one.reason.code for one in verdicts if not one.learned]
    assert set(rejected) == {NotLearned.OUTLIER}
    assert 10 <= len(rejected) <= 30
    assert not any(one.learned for one in verdicts[: len(rejected)])


def test_before_it_knows_the_vehicle_nothing_is_wild() -> None:
    estimator, _ = taught(Tuning(), 10.0)
    assert estimator.velocity(10.1, 1.0).learned


@pytest.mark.parametrize("force_N", [14.0, -14.0])
def test_the_pole_of_the_filter_is_that_of_the_drag_at_the_present_speed(force_N: float) -> None:
    estimator, _ = taught(Tuning())
    speed_mps = math.copysign(0.45, force_N)
    for index in range(100):
        estimator.thrust(60.0 + 0.1 * index, 66.48 * abs(speed_mps) * speed_mps + 1.25 * speed_mps)
        estimator.velocity(60.1 + 0.1 * index, speed_mps)
    slope_radps = (2.0 * 66.48 * 0.45 + 1.25) / 27.3
    assert estimator.regression.rate == pytest.approx(math.hypot(slope_radps, Tuning().filter_slowest), rel=0.1)
    assert taught(Tuning(filter_fastest=1.01))[0].regression.rate <= 1.01


def test_plateaus_alone_show_no_mass_which_stays_as_assumed() -> None:
    estimator, _ = taught(Tuning(plateaus_only=True))
    found, covariance = estimator.estimate()
    assert found[-1] == 30.0
    assert not covariance[-1].any()
    assert not covariance[:, -1].any()
    drag_N = found[:3] @ np.array([0.45**2, 0.45, 1.0])
    assert drag_N == pytest.approx(66.48 * 0.45**2 + 1.25 * 0.45, rel=0.05)
    assert 0.0 < math.sqrt(covariance[0, 0]) < 10.0


def test_the_joint_filter_takes_over_when_the_first_estimate_is_good() -> None:
    early, late = (taught(Tuning(estimator="ekf"), seconds)[0].estimate() for seconds in (40.0, 120.0))
    plain_early, plain_late = (taught(Tuning(), seconds)[0].estimate() for seconds in (40.0, 120.0))
    assert early[0].tolist() == plain_early[0].tolist()
    assert late[0].tolist() != plain_late[0].tolist()
    assert late[0] == pytest.approx(THETA, rel=0.1, abs=1.0)


def mean_depths_m(depth_m: Array, rng: np.random.Generator) -> Array:
    """Means over DEPTH_S, each with the noise of a pressure sensor: (n,)."""
    per_mean = round(DEPTH_S / STEP_S)
    means = depth_m[: len(depth_m) // per_mean * per_mean].reshape(-1, per_mean).mean(axis=1)
    return array(means + 0.001 * rng.standard_normal(len(means)))


HEAVE, HEAVE_THETA = Model(2, 15.22, split=True), np.array([93.52, 5.26, 56.57, 11.84, 0.7845, 37.7])
HEAVE_PRIOR = Prior(np.array([80.0, 8.0, 80.0, 8.0, 0.0, 35.0]), np.array([80.0, 60.0, 80.0, 60.0, 5.0, 20.0]))


def test_hovering_shows_the_net_buoyancy_although_the_drags_of_both_directions_differ() -> None:
    legs = back_and_forth((12.0, 1.5, 5.4), 6.0, 36.0)
    plan = Plan(np.append(0.0, legs.times_s + 8.0), np.append(0.0, legs.forces) + HEAVE_THETA[4], 44.0)
    flight, errors = fly(HEAVE, HEAVE_THETA, plan, LAG_S), []
    for seed in range(20):
        rng, estimator = np.random.default_rng(seed), AxisEstimator(HEAVE, LAG_S, HEAVE_PRIOR, Tuning(), shapes=0)
        for at_s, force in zip(flight.times_s.tolist(), flight.commands.tolist(), strict=True):
            estimator.thrust(at_s, force)
        for index, v in enumerate((np.diff(mean_depths_m(flight.path.s, rng)) / DEPTH_S).tolist()):
            estimator.velocity(DEPTH_S * (index + 1), v, derived=True)
        errors.append(estimator.estimate()[0] - HEAVE_THETA)
    bias = dict(zip(HEAVE.names, np.mean(errors, axis=0).tolist(), strict=True))
    # A sign that is that of the noise, or that of a second ago, moves them by 0.01 to 0.025 N and 0.15 to 0.27 N s/m.
    assert abs(bias["b"]) < 0.008
    assert abs(bias["k_l_negative"]) < 0.12


def test_velocities_derived_from_positions_are_weighed_as_differences() -> None:
    """A pressure sensor: velocities of mean depths, whose noise is that of the depths at both ends."""
    rng = np.random.default_rng(8)
    flight = fly(MODEL, THETA, back_and_forth((14.0, 5.4), 4.0, 120.0), LAG_S)
    depths_m = mean_depths_m(flight.path.s, rng)
    sigmas = []
    for derived in (True, False):
        estimator = AxisEstimator(MODEL, LAG_S, PRIOR, Tuning())
        for at_s, force in zip(flight.times_s.tolist(), flight.commands.tolist(), strict=True):
            estimator.thrust(at_s, force)
        for index, v in enumerate((np.diff(depths_m) / DEPTH_S).tolist()):
            estimator.velocity(DEPTH_S * (index + 1), v, derived=derived)
        found, covariance = estimator.estimate()
        sigmas.append(math.sqrt(covariance[0, 0]))
        if derived:
            assert (found[0], found[-1]) == pytest.approx((THETA[0], THETA[-1]), rel=0.01)
            # A difference has twice the variance of a position.
            assert math.sqrt(estimator.regression.noise_variance / 2.0) == pytest.approx(estimator.noise, rel=0.05)
    # Neither knows whether the thrust goes later than it comes.
    assert sigmas[0] < 0.6 * sigmas[1]
