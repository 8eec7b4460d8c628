"""The rules of the online estimate one by one: what it does with a row, and how wide it says it is."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hindrax_ident.arrays import Array, Index, array
from hindrax_ident.model.model_parameters import Prior
from hindrax_ident.model.motion_model import Model
from hindrax_ident.online.axis_estimator import AxisEstimator
from hindrax_ident.online.filtered_regression import FilteredRegression, Sample, physical
from hindrax_ident.online.rls import Rls
from hindrax_ident.online.sample_verdict import NotLearned, SampleVerdict, not_learned
from hindrax_ident.tuning import Tuning

SURGE = Model(0, 15.22)
PRIOR = Prior(np.array([60.0, 2.0, 0.0, 30.0]), np.array([60.0, 60.0, 5.0, 30.0]))
ROW = Sample((0.2, -0.4, 0.1, 0.03), 0.5, (0.01, 0.02, 0.0, 0.0), 0.3, settled=True)
INNOVATION_mps, INFORMATION = 0.02, 0.44


def begun(model: Model = SURGE, prior: Prior = PRIOR, **knobs: Any) -> AxisEstimator:
    """An estimator that knows of no disturbance."""
    estimator = AxisEstimator(model, 0.15, prior, Tuning(**knobs), shapes=0)
    estimator._whitener._variance = 0.0, 0.0, 0.0
    return estimator


class Stand:
    """In the place of the least squares: so many samples, and what was taught last."""

    def __init__(self, samples: int, values: tuple[float, ...] = (2.0, 0.5, 0.0, 0.04), variance: float = 1e-4) -> None:
        self.n, self.samples, self.values, self.variance = len(values), samples, values, variance
        self.innovation, self.taught = INNOVATION_mps, list[tuple[tuple[float, ...], float]]()
        self.asked = list[tuple[tuple[float, ...], float]]()

    def evaluate(self, x: tuple[float, ...], y: float) -> tuple[float, float]:
        self.asked.append((x, y))
        return self.innovation, INFORMATION

    def update(self, x: tuple[float, ...], y: float) -> float:
        self.taught.append((x, y))
        return self.innovation


def standing(estimator: AxisEstimator, stand: Stand) -> Stand:
    estimator._rls = stand  # type: ignore[assignment]  # as far as it is used
    return stand


# ---- a row


@pytest.mark.parametrize(
    ("samples", "derived", "cleaned"), [(160, False, False), (161, False, True), (161, True, False)]
)
def test_what_is_unexpected_of_a_velocity_is_taken_off_its_row_once_it_is_known(
    samples: int, derived: bool, cleaned: bool
) -> None:
    estimator = begun()
    stand = standing(estimator, Stand(samples))
    assert estimator._learn(ROW, 1.0, derived=derived) == SampleVerdict(innovation=INNOVATION_mps)
    assert stand.asked == [(ROW.x, ROW.y)]
    ((x, y),) = stand.taught
    share = INNOVATION_mps if cleaned else 0.0
    assert x == pytest.approx([a - share * b for a, b in zip(ROW.x, ROW.slope, strict=True)])
    assert y == ROW.y
    assert estimator._rows == [(*x, y)]


@pytest.mark.parametrize(
    ("samples", "derived", "variance"), [(16, False, 1e-4), (17, False, 4e-6), (17, True, 8e-6), (500, True, 8e-6)]
)
def test_the_noise_of_a_velocity_is_that_of_the_rows_once_it_is_roughly_known(
    samples: int, derived: bool, variance: float
) -> None:
    """A difference of two depths has twice their variance; before that, 1 cm/s is assumed."""
    estimator = begun()
    assert estimator.regression.noise_variance == pytest.approx(1e-4)
    standing(estimator, Stand(samples, variance=4e-6)).innovation = 1e-4
    estimator._learn(ROW, 1.0, derived=derived)
    assert estimator.regression.noise_variance == pytest.approx(variance)


@pytest.mark.parametrize(("samples", "adapted"), [(160, False), (161, True)])
def test_the_filter_adapts_once_the_drag_is_known(samples: int, adapted: bool) -> None:
    estimator = begun()
    standing(estimator, Stand(samples))
    estimator._learn(ROW, 1.0, derived=False)
    slope = 2.0 * 2.0 * 0.3 + 0.5
    assert estimator.regression.rate == pytest.approx(math.hypot(slope, 1.0) if adapted else 1.0)


@pytest.mark.parametrize(
    ("values", "speed", "slope"),
    [
        ((2.0, 0.5, 3.0, 0.25, 0.0, 0.04), 0.3, 2.0 * 2.0 * 0.3 + 0.5),
        ((2.0, 0.5, 3.0, 0.25, 0.0, 0.04), -0.3, 2.0 * 3.0 * 0.3 + 0.25),
        ((-2.0, 0.5, 3.0, 0.25, 0.0, 0.04), 0.3, 0.0),
        ((9.0, 0.5, 3.0, 0.25, 0.0, 0.04), 0.9, 4.0),
    ],
)
def test_the_pole_is_the_slope_of_the_drag_with_a_margin_and_within_limits(
    values: tuple[float, ...], speed: float, slope: float
) -> None:
    prior = Prior(np.array([60.0, 2.0, 60.0, 2.0, 0.0, 30.0]), np.array([60.0] * 4 + [5.0, 30.0]))
    estimator = begun(Model(2, 15.22, split=True), prior, filter_slowest=0.7, filter_fastest=4.0)
    standing(estimator, Stand(9999, values))
    estimator._adapt_filter(replace(ROW, speed=speed))
    assert estimator.regression.rate == pytest.approx(min(4.0, math.hypot(slope, 0.7)))
    plain = begun()
    standing(plain, Stand(9999))
    plain._adapt_filter(replace(ROW, speed=-0.3))
    assert plain.regression.rate == pytest.approx(math.hypot(2.0 * 2.0 * 0.3 + 0.5, 1.0))


@pytest.mark.parametrize(
    ("deviations", "samples", "outlier"), [(4.9, 161, False), (5.1, 161, True), (-5.1, 161, True), (99.0, 160, False)]
)
def test_an_outlier_is_beyond_five_deviations_of_what_was_expected(
    deviations: float, samples: int, outlier: bool
) -> None:
    """Noise and what the estimate itself may be off: the root of the variance times one and the information."""
    estimator = begun()
    stand = standing(estimator, Stand(samples))
    stand.innovation = deviations * 0.01 * math.sqrt(1.0 + INFORMATION)
    undone: list[int] = []

    class Regression(FilteredRegression):
        def undo_last(self) -> None:
            undone.append(1)

    estimator.regression = Regression(SURGE, 0.15, 1.0)
    reported = estimator._learn(ROW, 1.0, derived=False)
    assert reported == SampleVerdict(not_learned(NotLearned.OUTLIER if outlier else NotLearned.NONE), stand.innovation)
    assert len(stand.taught) == (not outlier)
    assert len(undone) == outlier


def test_twenty_outliers_in_a_row_are_left_out_and_the_next_is_the_truth() -> None:
    estimator = begun()
    estimator.thrust(0.0, 0.0)
    estimator.velocity(0.0, 0.0)
    stand = standing(estimator, Stand(161))
    stand.innovation = 1.0
    assert [estimator._learn(ROW, 1.0, derived=False).learned for _ in range(22)] == [False] * 20 + [True] * 2
    stand.innovation = 0.0
    assert estimator._learn(ROW, 1.0, derived=False).learned
    stand.innovation = 1.0
    assert [estimator._learn(ROW, 1.0, derived=False).learned for _ in range(21)] == [False] * 20 + [True]


def test_samples_count_by_the_correlation_of_their_innovations() -> None:
    """Bartlett: of one and the same innovation twice, 1 + 2 (1 - 1 / 13) / 2 samples are one."""
    estimator = begun()
    standing(estimator, Stand(1))
    for _ in range(2):
        estimator._learn(ROW, 1.0, derived=False)
    assert estimator.correlator.factor == pytest.approx(1.0 + 2.0 * (12.0 / 13.0) * 0.5)
    assert estimator.correlator._sums[0] == pytest.approx(2.0 * (INNOVATION_mps / (1.0 + INFORMATION)) ** 2)


def test_with_a_fixed_mass_its_share_is_known() -> None:
    estimator = begun(plateaus_only=True)
    assert estimator._rls.n == 3
    stand = standing(estimator, Stand(1, (2.0, 0.5, 0.0)))
    estimator._learn(ROW, 1.0, derived=False)
    ((x, y),) = stand.asked
    assert x == ROW.x[:3]
    assert y == pytest.approx(0.5 - 0.03 / 30.0)
    assert stand.taught == stand.asked


# ---- derived velocities


def test_rows_of_differences_are_summed_and_leak() -> None:
    """What a row was leaves with a time constant of 0.7 s."""
    estimator = begun()
    first = estimator._summed(ROW, 0.1)
    assert (first.x, first.y) == (ROW.x, ROW.y)
    second = estimator._summed(replace(ROW, y=2.0), 0.35)
    kept = math.exp(-0.35 / 0.7)
    assert second.x == pytest.approx([(1.0 + kept) * one for one in ROW.x])
    assert second.y == pytest.approx(2.0 + kept * 0.5)
    assert (second.slope, second.speed, second.settled) == (ROW.slope, ROW.speed, ROW.settled)


class Regression(FilteredRegression):
    """Tells the spread of each velocity."""

    spreads: list[float]

    def velocity(self, t_s: float, v: float, spread_s2: float = 0.0) -> Sample | None:
        self.spreads.append(spread_s2)
        return super().velocity(t_s, v, spread_s2)


def test_a_derived_velocity_is_a_mean_over_two_spans() -> None:
    """Of 0.1 s each: a triangle of time, whose variance is 0.1^2 / 6; a gap begins the sum anew."""
    estimator, summed = begun(), []
    estimator.regression = regression = Regression(SURGE, 0.15, 1.0)
    regression.spreads = []
    estimator.thrust(0.0, 1.0)
    for at_s, derived in ((0.1, True), (0.2, True), (0.3, True), (0.4, False), (1.5, True), (1.6, True)):
        estimator.thrust(at_s, 1.0)
        estimator.velocity(at_s, 0.1, derived=derived)
        summed.append(bool(estimator._sum))
    assert regression.spreads == pytest.approx([0.01 / 6.0] * 3 + [0.0] + [0.01 / 6.0] * 2)
    assert summed == [False, True, True, True, False, True]


# ---- the joint filter


class Filter:
    """In the place of the joint filter: what it heard."""

    def __init__(self) -> None:
        self.received, self.started = list[tuple[Any, ...]](), False
        self.begun: tuple[float, list[float], Array, float] | None = None

    def thrust(self, t_s: float, value: float) -> None:
        self.received.append(("thrust", t_s, value))

    def known(self, t_s: float, value: float) -> None:
        self.received.append(("known", t_s, value))

    def position(self, t_s: float, value: float) -> None:
        self.received.append(("position", t_s, value))

    def velocity(self, t_s: float, value: float) -> None:
        self.received.append(("velocity", t_s, value))

    def start(self, t_s: float, theta: Array, covariance: Array, variance: float) -> None:
        self.started, self.begun = True, (t_s, theta.tolist(), covariance, variance)

    def estimate(self) -> tuple[Array, Array]:
        return array(np.full(4, 7.0)), array(np.eye(4))


def filtering(estimator: AxisEstimator) -> Filter:
    estimator._filter = one = Filter()  # type: ignore[assignment]  # as far as it is used
    return one


def test_the_joint_filter_receives_everything_in_time_but_derived_velocities() -> None:
    estimator = begun(estimator="ekf")
    joint = filtering(estimator)
    estimator.thrust(0.1, 1.0)
    estimator.known(0.2, 2.0)
    estimator.position(0.3, 3.0)
    estimator.thrust(0.6, 4.0)
    estimator.velocity(0.25, 0.5)
    estimator.velocity(0.3, 0.6, derived=True)
    estimator.velocity(0.4, 0.7)
    assert joint.received == [
        ("thrust", 0.1, 1.0),
        ("known", 0.2, 2.0),
        ("velocity", 0.25, 0.5),
        ("position", 0.3, 3.0),
        ("velocity", 0.4, 0.7),
    ]
    assert estimator.regression.thrust_time_s == 0.1
    estimator.velocity(0.6, 0.8)
    assert estimator.regression.thrust_time_s == 0.6


def test_the_joint_filter_is_for_those_who_ask_and_not_for_a_fixed_mass() -> None:
    assert begun()._filter is None
    assert begun(estimator="ekf", plateaus_only=True)._filter is None
    assert begun(estimator="ekf")._filter is not None


@pytest.mark.parametrize(("samples", "starts"), [(500, False), (501, True)])
def test_the_joint_filter_starts_from_a_good_estimate(samples: int, starts: bool) -> None:
    estimator = begun(estimator="ekf")
    joint = filtering(estimator)
    before = estimator.estimate()
    rls = estimator._rls
    stand = standing(estimator, Stand(samples))
    stand.values = rls.values
    stand.unit_covariance = rls.unit_covariance  # type: ignore[attr-defined]
    estimator._learn(ROW, 3.5, derived=False)
    assert joint.started is starts
    if joint.begun is not None:
        t_s, theta, covariance, variance = joint.begun
        assert (t_s, theta, variance) == (3.5, before[0].tolist(), 1e-4)
        assert covariance == pytest.approx(before[1])
        assert estimator.estimate()[0].tolist() == [7.0] * 4
        joint.begun = None
        estimator._learn(ROW, 4.5, derived=False)
        assert joint.begun is None


# ---- the covariance


def test_the_first_estimate_is_the_prior_in_the_noise_of_the_first_velocities() -> None:
    """1 cm/s, whatever the deviations of the prior are."""
    estimator = begun()
    q = np.array([60.0 / 30.0, 2.0 / 30.0, 0.0, 1.0 / 30.0])
    assert estimator._rls.values == pytest.approx(q.tolist())
    # To first order: of theta / M and of 1 / M.
    scaled = np.array([(60.0 / 30.0) ** 2 + (q[0] * 30.0 / 30.0) ** 2, 4.0 + q[1] ** 2, (5.0 / 30.0) ** 2, q[3] ** 2])
    assert np.diag(estimator._rls.unit_covariance) == pytest.approx(scaled / 0.01**2)
    assert estimator._noise_variance == 1e-4
    assert math.isnan(estimator.noise)


def test_blocks_are_merged_in_pairs_and_none_is_lost() -> None:
    estimator, rng = begun(), np.random.default_rng(1)
    rows = rng.standard_normal((25 * 40 + 75, 5))
    known = array(np.ones(1))
    for index, row in enumerate(rows.tolist()):
        estimator._widening = known
        estimator._add_to_block(tuple(row))
        done = index + 1
        blocks = done // 25 if done < 1000 else 20 + (done - 1000) // 50
        assert len(estimator._blocks) == blocks, done
        fresh = done % 25 == 0 if done <= 1000 else (done - 1000) % 50 == 0
        assert (estimator._widening is not known) is fresh
    assert estimator._blocks[0] == pytest.approx(rows[:50].T @ rows[:50])
    assert estimator._blocks[19] == pytest.approx(rows[950:1000].T @ rows[950:1000])
    assert sum(estimator._blocks) == pytest.approx(rows[:1050].T @ rows[:1050])


def taught(estimator: AxisEstimator, X: Array, y: Array) -> None:
    for row, value in zip(X.tolist(), y.tolist(), strict=True):
        estimator._rls.update(row, value)
        estimator._add_to_block((*row, value))


def jackknife(X: Array, y: Array, prior: Array, sigmas: Array, block: int) -> tuple[Array, Array, float]:
    """Scatter of the least squares without one block each, covariance for unit noise, and residual variance."""

    def solved(keep: Index) -> tuple[Array, Array]:
        A = np.vstack([np.diag(1.0 / sigmas), X[keep]])
        found, *_ = np.linalg.lstsq(A, np.concatenate([prior / sigmas, y[keep]]), rcond=None)
        return array(found), array(np.linalg.inv(A.T @ A))

    every = np.arange(len(y))
    whole, unit = solved(every)
    count = len(y) // block
    left = np.array([solved(every[every // block != one])[0] for one in range(count)])
    rest = np.concatenate([(prior - whole) / sigmas, y - X @ whole])
    variance = float(rest @ rest) / (len(y) - X.shape[1])
    return array(np.sum((left - whole) ** 2, axis=0) * (count - 1) / count), array(unit), variance


@pytest.mark.parametrize("size", [1.0, 0.02])
@pytest.mark.parametrize("disagreement", [0.0, 0.6])
def test_the_band_is_that_of_estimates_without_one_block_each(disagreement: float, size: float) -> None:
    """Bell and McCaffrey 2002: the jackknife over blocks, never less than what white noise would be."""
    estimator, rng = begun(), np.random.default_rng(3)
    prior = np.array(estimator._rls.values)
    sigmas = np.sqrt(np.diag(estimator._rls.unit_covariance))
    X = size * rng.standard_normal((250, 4))
    drift = np.repeat(rng.standard_normal((10, 4)), 25, axis=0) * np.array([disagreement, 0.0, 0.0, 0.0])
    y = np.sum(X * (np.array([2.0, 0.5, 0.1, 0.5]) + drift), axis=1) + 0.2 * size * rng.standard_normal(250)
    taught(estimator, array(X), array(y))
    scatter, unit, variance = jackknife(array(X), array(y), array(prior), array(sigmas), 25)
    assert estimator._noise_variance == pytest.approx(variance)
    ratio = np.maximum(1.0, scatter / (np.diag(unit) * variance))
    deviation = np.sqrt(np.maximum(ratio, ratio.mean()))
    assert deviation.max() > 1.5 or not disagreement
    widening = estimator._measured_widening()
    assert widening == pytest.approx(np.outer(deviation, deviation), rel=1e-6)
    theta, covariance = estimator.estimate()
    wanted, wide = physical(list(estimator._rls.values), array(unit * variance * widening))
    assert theta == pytest.approx(wanted)
    assert covariance == pytest.approx(wide, rel=1e-6)


@pytest.mark.parametrize(("blocks", "reported"), [(7, False), (8, True)])
def test_fewer_than_two_blocks_for_each_coefficient_show_nothing(blocks: int, reported: bool) -> None:
    estimator, rng = begun(), np.random.default_rng(3)
    X = rng.standard_normal((25 * blocks, 4))
    y = X @ np.ones(4) + np.repeat(rng.standard_normal(blocks), 25) * X[:, 0]
    taught(estimator, array(X), array(y))
    assert (estimator._measured_widening() != np.ones((4, 4))).any() == reported
    assert estimator._measured_widening().shape == (4, 4)


def test_where_less_is_remembered_than_a_block_had_residuals_are_taken_as_they_are() -> None:
    estimator, rng = begun(forgetting=0.9), np.random.default_rng(3)
    X = rng.standard_normal((250, 4))
    X[:25] *= 100.0
    y = X @ np.ones(4) + np.repeat(rng.standard_normal(10), 25) * X[:, 1]
    taught(estimator, array(X), array(y))
    unit, values = estimator._rls.unit_covariance, np.array(estimator._rls.values)
    gradients = np.array([X[at : at + 25].T @ (y[at : at + 25] - X[at : at + 25] @ values) for at in range(0, 250, 25)])
    scatter = np.sum((gradients @ unit) ** 2, axis=0) * 9.0 / 10.0
    ratio = np.maximum(1.0, scatter / (np.diag(unit) * estimator._rls.variance))
    deviation = np.sqrt(np.maximum(ratio, ratio.mean()))
    assert estimator._measured_widening() == pytest.approx(np.outer(deviation, deviation), rel=1e-6)


def test_a_covariance_is_asked_for_once_for_each_block() -> None:
    estimator, rng = begun(), np.random.default_rng(3)
    X = rng.standard_normal((250, 4))
    y = X @ np.ones(4) + np.repeat(rng.standard_normal(10), 25) * X[:, 0]
    taught(estimator, array(X), array(y))
    first = estimator.estimate()[1]
    kept = estimator._widening
    assert kept is not None
    assert estimator.estimate()[1] == pytest.approx(first)
    assert estimator._widening is kept


def test_a_fixed_mass_scales_and_has_no_variance() -> None:
    estimator = begun(plateaus_only=True)
    values, covariance = array(np.array([2.0, 0.5, 0.1])), array(np.diag([0.04, 0.01, 0.0025]) + 1e-3)
    theta, whole = estimator._with_fixed_mass(values, covariance)
    assert theta.tolist() == [60.0, 15.0, 3.0, 30.0]
    assert whole[:3, :3] == pytest.approx(900.0 * covariance)
    assert not whole[3].any()
    assert not whole[:, 3].any()
    assert estimator.estimate()[0] == pytest.approx(PRIOR.values)


def test_effective_samples_are_those_left_after_forgetting() -> None:
    estimator = begun(forgetting=0.9)
    rls = Rls([0.0], [1.0], 0.9)
    estimator._rls = rls
    for _ in range(3):
        rls.update((1.0,), 1.0)
    assert estimator.samples == 3
    assert estimator.effective_samples == pytest.approx(1.0 + 0.9 + 0.81)


# ---- pauses


def test_a_pause_of_more_than_a_second_begins_anew() -> None:
    estimator = begun()
    estimator.thrust(0.0, 0.0)
    for at_s in (0.1, 0.2):
        estimator.velocity(at_s, 0.1)
    estimator.correlator.add(1.0)
    assert estimator.velocity(1.2, 0.1).reason.code is NotLearned.SETTLING
    estimator.correlator.add(1.0)
    assert estimator.velocity(2.21, 0.1).reason == not_learned(NotLearned.OLD_THRUST, age_s=2.21)
    estimator.thrust(2.3, 0.0)
    assert estimator.velocity(3.22, 0.1).reason.code is NotLearned.GAP
    assert estimator.correlator._past == []


def test_innovations_across_a_refusal_are_not_neighbors() -> None:
    estimator = begun()
    estimator.thrust(0.0, 0.0)
    estimator.velocity(0.1, 0.1)
    estimator.correlator.add(1.0)
    turning = not_learned(NotLearned.PHASE, phase="turning")
    assert estimator.velocity(0.2, 0.1, turning).reason is turning
    assert estimator.correlator._past == []
