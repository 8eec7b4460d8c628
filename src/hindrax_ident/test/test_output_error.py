"""Output error, part by part: the solution is where theory has it, and so are its covariance and what widens it."""

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from hindrax_ident.arrays import Array, Index, array
from hindrax_ident.fit import output_error as module
from hindrax_ident.fit.autoregression import fit_autoregression
from hindrax_ident.fit.output_error import (
    OutputErrorFit,
    _blocks,
    _descend,
    _feasible_start,
    _first_noise,
    _fit_of,
    _robust_sigma,
    _similar,
    _with_color,
    _without_outliers,
    refine,
    retrained,
    reweighted,
)
from hindrax_ident.fit.output_error_problem import LinearizedProblem, OutputErrorProblem, whitener_of
from hindrax_ident.fit.scatter import scatter_inflation
from hindrax_ident.fit.whitening import Noise
from hindrax_ident.model.model_parameters import Prior
from hindrax_ident.model.motion_model import Model
from hindrax_ident.records.axis_record import Record, Series, Stretch
from hindrax_ident.testing.synthetic_runs import back_and_forth, fly

SURGE, THETA = Model(0, 15.22), array(np.array([66.48, 1.25, 0.3, 27.3]))
PRIOR = Prior(array(np.array([50.0, 5.0, 0.0, 30.0])), array(np.array([30.0, 20.0, 2.0, 20.0])))
NOTHING = Series(array(np.zeros(0)), array(np.zeros(0)))
SIGMA_mps = 0.005
END_S = 20.0


@pytest.fixture(scope="module")
def record() -> Record:
    """Two stretches of surge, seen at 10 Hz."""
    flight = fly(SURGE, THETA, back_and_forth((4.0, 12.0), 4.0, END_S), 0.15)
    t, v = flight.grid.times_s[::20], flight.path.v[::20]
    noise = SIGMA_mps * np.random.default_rng(2).standard_normal(len(t))
    thrust = Series(flight.times_s, flight.commands)
    return Record(Series(t, array(v + noise)), thrust, (Stretch(0.0, 9.95), Stretch(10.1, 20.0)), lag_s=0.15)


@pytest.fixture(scope="module")
def fit(record: Record) -> OutputErrorFit:
    return refine(SURGE, record, PRIOR.values, PRIOR)


def test_positions_alone_lead_from_far_off_to_the_same_fit_as_from_the_prior() -> None:
    # A live estimate of a dive: seven times the mass, a fifth of the drag.
    flight = fly(SURGE, THETA, back_and_forth((4.0, 12.0), 4.0, END_S), 0.15)
    t, s = flight.grid.times_s[::20], flight.path.s[::20]
    noise = 0.012 * np.random.default_rng(3).standard_normal(len(t))
    thrust = Series(flight.times_s, flight.commands)
    record = Record(NOTHING, thrust, (Stretch(0.0, END_S),), position=Series(t, array(s + noise)), lag_s=0.15)
    near = refine(SURGE, record, PRIOR.values, PRIOR)
    far = refine(SURGE, record, array(np.array([15.0, 30.0, -0.3, 190.0])), PRIOR)
    assert near.converged
    assert far.converged
    assert far.theta == pytest.approx(near.theta, rel=1e-3, abs=1e-3)


def steepness(fit: OutputErrorFit, prior: Prior = PRIOR) -> float:
    """Largest slope of the cost, in units of the deviations: zero at the most likely parameters."""
    slope = fit.linear.gradient + (prior.values - fit.theta) / prior.sigmas**2
    return float(np.abs(slope * np.sqrt(np.diag(np.linalg.inv(fit.linear.information + prior.information)))).max())


def test_the_solution_has_the_least_residuals_and_distance_from_the_prior(fit: OutputErrorFit) -> None:
    assert fit.converged
    assert steepness(fit) < 1e-3
    assert np.all(np.abs(fit.theta - THETA) < 4.0 * np.sqrt(np.diag(fit.covariance)))
    assert fit.noise.velocity == pytest.approx(SIGMA_mps**2, rel=0.3)
    assert fit.sigmas[0] == pytest.approx(SIGMA_mps, rel=0.1)
    assert math.isnan(fit.sigmas[1])
    assert fit.samples == len(fit.problem.t) == 200
    assert fit.effective_samples == pytest.approx(200.0, rel=0.3)
    assert fit.inflation.tolist() == [1.0] * 4
    assert fit.prior_information == pytest.approx(np.diag(1.0 / PRIOR.sigmas**2))
    assert fit.whitener.noise == fit.noise
    assert fit.model is SURGE
    # Of the residuals in their own noise, one degree of freedom each is 1.
    assert fit.linear.cost == pytest.approx(200.0 - 6.0, rel=0.15)


def test_a_narrow_prior_keeps_its_values(record: Record) -> None:
    narrow = Prior(array(np.array([70.0, 5.0, 0.0, 30.0])), array(np.array([1e-4, 1e-4, 1e-4, 1e-4])))
    found = refine(SURGE, record, THETA, narrow)
    assert found.theta == pytest.approx(narrow.values, abs=1e-3)
    assert steepness(found, narrow) < 1e-3


def test_a_fit_may_be_repeated_with_another_noise(fit: OutputErrorFit) -> None:
    same = reweighted(fit, fit.noise, PRIOR)
    assert same.theta == pytest.approx(fit.theta, rel=1e-6)
    assert same.covariance == pytest.approx(fit.covariance, rel=1e-6)
    assert same.converged
    other = Noise(1e-4, 1.0, 0.0, 1e-5)
    again = reweighted(fit, other, PRIOR)
    assert again.noise == again.whitener.noise == other
    assert steepness(again) < 1e-3
    assert again.problem is fit.problem


def test_another_record_is_fitted_with_the_noise_of_the_first_and_without_its_outliers(
    record: Record, fit: OutputErrorFit
) -> None:
    theta, _, sigmas = retrained(fit, record, PRIOR)
    assert theta == pytest.approx(fit.theta, rel=1e-3, abs=1e-3)
    assert sigmas[0] == pytest.approx(fit.sigmas[0], rel=1e-3)
    assert math.isnan(sigmas[1])
    v = record.velocity.y.copy()
    v[[20, 90, 150]] += np.array([0.2, -0.2, 0.3])
    spoiled, _, deviations = retrained(fit, replace(record, velocity=Series(record.velocity.t, array(v))), PRIOR)
    assert np.all(np.abs(spoiled - theta) < 0.5 * np.sqrt(np.diag(fit.covariance)))
    assert deviations[0] == pytest.approx(sigmas[0], rel=0.05)


def test_positions_have_deviations_of_their_own(record: Record, recwarn: pytest.WarningsRecorder) -> None:
    flight = fly(SURGE, THETA, back_and_forth((4.0, 12.0), 4.0, END_S), 0.15)
    t, s = flight.grid.times_s[::40], flight.path.s[::40]
    placed = Series(t, array(s + 0.02 * np.random.default_rng(7).standard_normal(len(t))))
    both = replace(record, position=placed)
    found = refine(SURGE, both, PRIOR.values, PRIOR)
    assert found.sigmas == pytest.approx((SIGMA_mps, 0.02), rel=0.15)
    assert found.noise.position == pytest.approx(4e-4, rel=0.5)
    _, _, sigmas = retrained(found, both, PRIOR)
    assert sigmas == pytest.approx(found.sigmas, rel=1e-3)
    alone = replace(record, velocity=NOTHING, position=placed)
    deviations = refine(SURGE, alone, PRIOR.values, PRIOR).sigmas
    assert math.isnan(deviations[0])
    assert deviations[1] == pytest.approx(0.02, rel=0.15)
    # Means of nothing are not taken.
    assert [str(one.message) for one in recwarn] == []


def test_a_slow_error_is_an_unknown_force(record: Record) -> None:
    """The noise that it takes for it is that of the residuals, again and again until it stays."""
    force = 0.4 * np.repeat(np.random.default_rng(1).standard_normal(100), 10)[: len(record.thrust.t)]
    pushed = fly(
        SURGE, THETA, back_and_forth((4.0, 12.0), 4.0, END_S), 0.15,
        array(force / np.maximum(1e-9, np.abs(record.thrust.y)) * np.sign(record.thrust.y)),
    )  # fmt: skip
    t, v = pushed.grid.times_s[::20], pushed.path.v[::20]
    noise = 0.001 * np.random.default_rng(2).standard_normal(len(t))
    found = refine(SURGE, replace(record, velocity=Series(t, array(v + noise))), PRIOR.values, PRIOR)
    assert found.noise.velocity == pytest.approx(1e-6, rel=0.6)
    density = found.whitener.noise.force + found.noise.thrust * 60.0 / THETA[3] ** 2
    assert 0.2 < density / (0.4**2 * 0.2 / THETA[3] ** 2) < 5.0
    assert np.all(np.abs(found.theta - THETA) < 4.0 * np.sqrt(np.diag(found.covariance)))


# ---- the search


def test_a_start_that_diverges_is_replaced_by_the_prior(fit: OutputErrorFit) -> None:
    problem, path = fit.problem, fit.linear.path
    white = whitener_of(problem, THETA, path, Noise(1e-4, 1.0))
    diverging, unknown = array(np.array([-1e9, 0.0, 0.0, 1e-9])), array(np.full(4, math.nan))
    assert _feasible_start(problem, THETA, path, white, PRIOR)[0] is THETA
    for start in (diverging, unknown):
        theta, linear = _feasible_start(problem, start, path, white, PRIOR)
        assert theta is PRIOR.values
        # Its initial conditions are fitted as well.
        assert np.abs(linear.start[:, :, 0]).max() < 1e-3
    with pytest.raises(ValueError, match="no motion follows from its forces with any usual drag"):
        _feasible_start(problem, unknown, path, white, Prior(diverging, PRIOR.sigmas))


def test_a_stretch_that_contradicts_the_others_is_named_and_not_the_units(fit: OutputErrorFit) -> None:
    """A force that overflows has no motion, whatever the drag; the other stretch has one."""
    grid, path = fit.problem.grid, fit.linear.path
    impulse = grid.impulse.copy()
    impulse[grid.times_s > 10.05] = 1e300
    broken = replace(fit.problem, grid=replace(grid, impulse=impulse))
    white, unknown = whitener_of(broken, THETA, path, Noise(1e-4, 1.0)), array(np.full(4, math.nan))
    with pytest.raises(
        ValueError, match=r"in 1 of the 2 stretches of the record, the first from 10\.1 to 20 s"
    ) as some:
        _feasible_start(broken, THETA, path, white, PRIOR)
    assert "units" not in str(some.value)
    with pytest.raises(ValueError, match="check their units and signs"):
        _feasible_start(broken, unknown, path, white, Prior(unknown, PRIOR.sigmas))


def test_a_search_ends_where_it_began_when_it_began_at_the_end(fit: OutputErrorFit) -> None:
    linear, theta, converged = _descend(fit.problem, fit.theta, fit.linear.path, fit.whitener, PRIOR)
    assert converged
    assert theta == pytest.approx(fit.theta, rel=1e-7)
    assert linear.cost == pytest.approx(fit.linear.cost, rel=1e-9)


def test_a_rough_search_is_nearly_as_good(fit: OutputErrorFit) -> None:
    far = array(np.array([20.0, 20.0, 1.0, 60.0]))
    rough = _descend(fit.problem, far, fit.problem.guess, fit.whitener, PRIOR, tolerance=1e-3)
    fine = _descend(fit.problem, far, fit.problem.guess, fit.whitener, PRIOR)
    sigmas = np.sqrt(np.diag(fit.covariance))
    off = [float(np.abs((theta - fit.theta) / sigmas).max()) for _, theta, _ in (rough, fine)]
    assert off[1] < 1e-3
    assert off[1] < off[0] < 0.1
    assert rough[2]
    assert fine[2]


class Landscape:
    """In the place of the linearization: one unknown of each deviation `scale`, and costs one after the other."""

    def __init__(
        self, patch: pytest.MonkeyPatch, steps: float, costs: Iterable[float | None], scale: float = 1.0
    ) -> None:
        self.steps, self.scale, self.tried = steps, scale, list[Array]()
        self._costs = iter(costs)
        patch.setattr(module, "linearize", self.linearize)
        patch.setattr(module, "restarted", lambda *_: None)

    def linearize(self, _problem: object, theta: Array, *_: object, refinements: int) -> LinearizedProblem | None:
        """A step of `steps` deviations in all directions, wherever it is."""
        assert not refinements
        self.tried.append(theta)
        cost = next(self._costs)
        if cost is None:
            return None
        # The first four residuals make the gradient, the rest what is missing of the cost.
        r = np.array([self.steps, self.steps, self.steps, self.steps, 0.0])
        r[4] = math.sqrt(cost - 4.0 * self.steps**2)
        return linear_of(array(r), array(np.vstack([self.scale * np.eye(4), np.zeros(4)])))

    def searched(self, fit: OutputErrorFit, samples: int = 200, tolerance: float = 1e-10) -> tuple[int, bool]:
        """Number of trials, and whether it converged."""
        problem = replace(fit.problem, counts=np.arange(len(fit.problem.t)) < samples)
        assumed = Prior(THETA, array(np.full(4, 1e12)))
        self.tried.clear()
        _, _, converged = _descend(problem, THETA, fit.linear.path, fit.whitener, assumed, tolerance=tolerance)
        return len(self.tried) - 2, converged


@pytest.fixture
def patch() -> Iterator[pytest.MonkeyPatch]:
    with pytest.MonkeyPatch.context() as one:
        yield one


def test_a_search_without_an_end_ends_after_forty_steps(fit: OutputErrorFit, patch: pytest.MonkeyPatch) -> None:
    falling = Landscape(patch, 0.5, itertools.count(1000.0, -1.0))
    assert falling.searched(fit) == (40, False)
    # Steps of half a deviation each, damped by a thousandth and then less and less.
    steps = np.diff(np.array(falling.tried[1:]), axis=0)[:, 0]
    assert steps[:3] == pytest.approx([0.5 / (1.0 + 1e-3 * 0.02**k) for k in range(3)])


def test_what_is_left_decides_not_that_the_steps_are_over(fit: OutputErrorFit, patch: pytest.MonkeyPatch) -> None:
    falling = Landscape(patch, 0.003, itertools.count(1000.0, -1.0))
    assert falling.searched(fit) == (40, True)


@pytest.mark.parametrize(("nothing", "trials"), [(None, 13), (1000.0, 8), (1001.0, 8)])
def test_a_search_that_finds_nothing_lower_ends_unconverged(
    fit: OutputErrorFit, patch: pytest.MonkeyPatch, nothing: float | None, trials: int
) -> None:
    """Damped from 1e-3 ten times more each time: to 1e9 where nothing can be simulated, else to negligible steps."""
    stuck = Landscape(patch, 5.0, itertools.chain([1000.0] * 2, itertools.repeat(nothing)))
    assert stuck.searched(fit) == (trials, False)
    steps = np.array(stuck.tried[2:])[:, 0] - THETA[0]
    assert steps == pytest.approx([5.0 / (1.0 + 10.0 ** (k - 3)) for k in range(trials)], abs=1e-12)


@pytest.mark.parametrize(("gain", "tolerance", "trials"), [(2e-6, 1e-10, 40), (0.5e-6, 1e-10, 1), (0.09, 1e-4, 1)])
def test_a_search_ends_with_a_step_that_gains_nothing(
    fit: OutputErrorFit, patch: pytest.MonkeyPatch, gain: float, tolerance: float, trials: int
) -> None:
    """A thousandth of a deviation squared; while outliers and noise are not known, 1e-4 of the cost."""
    creeping = Landscape(patch, 0.5, itertools.chain([1000.0], itertools.count(1000.0, -gain)))
    assert creeping.searched(fit, tolerance=tolerance)[0] == trials


def test_after_good_steps_the_damping_begins_at_a_millionth(fit: OutputErrorFit, patch: pytest.MonkeyPatch) -> None:
    costs = [1000.0] * 2 + [999.0, 998.0, 997.0, 996.0, 995.0]
    late = Landscape(patch, 5.0, itertools.chain(costs, itertools.repeat(None)))
    trials, converged = late.searched(fit)
    assert not converged
    # Five good steps; then at what is left of the damping, and at 1e-5 to 1e9.
    assert trials == 5 + 1 + 15
    last = np.array(late.tried[-1])[0] - np.array(late.tried[6])[0]
    assert last == pytest.approx(5.0 / 1e9, rel=0.01)


@pytest.mark.parametrize("scale", [1.0, 100.0])
@pytest.mark.parametrize(
    ("steps", "found"), [(0.9e-3, (1, True)), (1.1e-3, (4, True)), (0.249, (7, True)), (0.251, (7, False))]
)
def test_what_is_less_than_a_quarter_of_a_deviation_off_has_converged(
    fit: OutputErrorFit, patch: pytest.MonkeyPatch, scale: float, steps: float, found: tuple[int, bool]
) -> None:
    """Where nothing decreases the cost; a thousandth off, no other step is tried."""
    flat = Landscape(patch, steps, itertools.chain([1000.0] * 2, itertools.repeat(1000.0)), scale)
    assert flat.searched(fit, tolerance=1e-30) == found


@pytest.mark.parametrize("scale", [1.0, 100.0])
@pytest.mark.parametrize("samples", [0, 99])
@pytest.mark.parametrize("beyond", [0.99, 1.02])
def test_a_step_within_the_tolerance_ends_the_search(
    fit: OutputErrorFit, patch: pytest.MonkeyPatch, samples: int, beyond: float, scale: float
) -> None:
    """One of 1.02 tolerances does not, however small damping makes it."""
    limit = 0.01 * math.sqrt(1.0 + samples)
    near = Landscape(patch, beyond * limit, itertools.chain([1000.0] * 2, itertools.repeat(None)), scale)
    assert near.searched(fit, samples, 0.01) == ((0, True) if beyond < 1.0 else (13, beyond * limit < 0.25))


# ---- the noise at first


def problem_with(fit: OutputErrorFit, y: Array, channel: Index | None = None) -> OutputErrorProblem:
    own = np.zeros(len(fit.problem.t), np.intp) if channel is None else channel
    return replace(fit.problem, y=y, channel=own)


def variances(noise: Noise) -> list[float]:
    return [noise.velocity, noise.position, noise.force, noise.thrust]


def test_before_the_first_fit_the_noise_is_that_of_changes_of_changes(fit: OutputErrorFit) -> None:
    """The second difference of white noise has six times its variance, and a steady rise has none."""
    n = len(fit.problem.t)
    jagged = array(0.01 * np.arange(n) + 0.1 * (np.arange(n) % 2))
    channel = (np.arange(n) >= n // 2).astype(np.intp)
    noise = _first_noise(problem_with(fit, jagged))
    assert variances(noise) == pytest.approx([0.2**2 / 6.0, 1.0, 0.0, 0.0])
    of_both = array(np.where(channel == 0, jagged, 3.0 * jagged))
    halves = replace(problem_with(fit, of_both, channel), spans=(slice(0, 40), slice(40, n)))
    assert variances(_first_noise(halves)) == pytest.approx([0.2**2 / 6.0, 0.6**2 / 6.0, 0.0, 0.0])
    assert _first_noise(problem_with(fit, array(np.zeros(n)))).velocity == 1e-12
    restoring = replace(problem_with(fit, jagged), model=Model(3, 0.483, restores=True))
    assert variances(_first_noise(restoring)) == pytest.approx([0.2**2 / 6.0, 1e-4, 0.0, 0.0])


@pytest.mark.parametrize("name", ["velocity", "position", "force", "thrust"])
def test_noises_within_a_fifth_are_similar(name: str) -> None:
    noise = Noise(1e-4, 2e-4, 3e-4, 4e-5)
    size = getattr(noise, name)
    for factor, similar in ((1.0, True), (1.2, True), (1.25, False), (1.0 / 1.2, True), (1.0 / 1.25, False)):
        assert _similar(replace(noise, **{name: factor * size}), noise) is similar
    nothing = replace(noise, **{name: 0.0})
    assert _similar(nothing, nothing)
    assert _similar(replace(noise, **{name: 1e-13}), nothing)
    assert not _similar(noise, nothing)


# ---- outliers


def test_a_deviation_of_which_outliers_say_nothing() -> None:
    """Nine of ten of a normal quantity are within 1.645 deviations."""
    assert _robust_sigma(array(np.array([0.0, -1.0, 2.0, -3.0, 4.0, -5.0, 6.0, -7.0, 8.0, 9.0, -1e9]))) == (
        pytest.approx(9.0 / 1.645)
    )
    assert _robust_sigma(array(np.zeros(0))) == math.inf


def test_beyond_five_deviations_is_an_outlier_in_each_channel_for_itself(fit: OutputErrorFit) -> None:
    n = len(fit.problem.t)
    channel = (np.arange(n) % 2).astype(np.intp)
    size = np.where(channel == 0, 1.0, 0.01)
    raw = 1.645 * size * np.where(np.arange(n) % 4 < 2, 1.0, -1.0)
    raw[[10, 12, 21, 23]] = [4.99, -5.01, -0.0499, 0.0501]
    problem = problem_with(fit, fit.problem.y, channel)
    counts = _without_outliers(problem, replace(fit.linear, raw=array(raw))).counts
    assert np.flatnonzero(~counts).tolist() == [12, 23]
    alone = replace(problem, channel=np.zeros(n, np.intp))
    assert np.all(_without_outliers(alone, replace(fit.linear, raw=array(np.full(n, -1.0)))).counts)


# ---- covariance


def linear_of(r: Array, J: Array) -> LinearizedProblem:
    nothing = array(np.zeros((1, 2, 5)))
    return LinearizedProblem(r, J, nothing, array(0.1 * r), None, float(r @ r))  # type: ignore[arg-type]


def drawn(n: int, rng: np.random.Generator, a: float = 0.0) -> Array:
    """Autoregression of first order with innovations of variance one."""
    out, value = [], 0.0
    for fresh in rng.standard_normal(n).tolist():
        value = a * value + fresh
        out.append(value)
    return array(np.array(out))


def blank(fit: OutputErrorFit, lengths: tuple[int, ...], step_s: float = 0.1) -> OutputErrorProblem:
    """A problem of so many measurements in each stretch."""
    edges = np.cumsum([0, *lengths]).tolist()
    n = edges[-1]
    return replace(
        fit.problem,
        t=array(step_s * np.arange(n)), y=array(np.zeros(n)), channel=np.zeros(n, np.intp),
        counts=np.ones(n, bool), spans=tuple(slice(a, b) for a, b in itertools.pairwise(edges)),
    )  # fmt: skip


def test_the_covariance_of_white_residuals_is_that_of_least_squares(fit: OutputErrorFit) -> None:
    rng = np.random.default_rng(4)
    problem, J, r = blank(fit, (50, 40)), array(rng.standard_normal((90, 4))), drawn(90, rng)
    channel = (np.arange(90) % 3 == 0).astype(np.intp)
    problem = replace(problem, channel=channel, counts=np.arange(90) != 7)
    found = _fit_of(problem, linear_of(r, J), THETA, fit.whitener, PRIOR, converged=False)
    # 89 measurements that count, two initial conditions of each stretch and four parameters.
    inverse = np.linalg.inv(J.T @ J + np.diag(1.0 / PRIOR.sigmas**2))
    assert found.covariance == pytest.approx(inverse * float(r @ r) / (89 - 4 - 4))
    assert not found.converged
    assert found.samples == 89
    own = [channel == one for one in (0, 1)]
    own[0][7] = own[1][7] = False
    assert found.sigmas == pytest.approx([0.1 * math.sqrt(float(np.mean(r[one] ** 2))) for one in own])
    few = replace(problem, counts=np.arange(90) < 5)
    found = _fit_of(few, linear_of(r, J), THETA, fit.whitener, PRIOR, converged=True)
    assert found.covariance == pytest.approx(inverse * float(r @ r))


def test_the_covariance_of_colored_residuals_is_the_sandwich(fit: OutputErrorFit) -> None:
    """Freedman 2006: H^-1 (J' Omega J + B) H^-1, Omega that of the autoregression of each channel and stretch."""
    rng = np.random.default_rng(5)
    problem, J = blank(fit, (300, 360)), array(rng.standard_normal((660, 4)))
    channel = (np.arange(660) % 3 == 0).astype(np.intp)
    problem, r = replace(problem, channel=channel), array(np.zeros(660))
    wanted = np.diag(1.0 / PRIOR.sigmas**2)
    for one, a in ((0, 0.7), (1, -0.4)):
        rows = [np.flatnonzero(channel[span] == one) + span.start for span in problem.spans]
        for own in rows:
            r[own] = drawn(len(own), rng, a)
        color = fit_autoregression([r[own] for own in rows])
        assert color[0] == pytest.approx(a, abs=0.15)
        innovations = []
        for own in rows:
            past = np.eye(len(own)) - sum(c * np.eye(len(own), k=-lag) for lag, c in enumerate(color, 1))
            innovations.append((past @ r[own])[len(color) :])
        size = float(np.mean(np.concatenate(innovations) ** 2))
        for own in rows:
            past = np.eye(len(own)) - sum(c * np.eye(len(own), k=-lag) for lag, c in enumerate(color, 1))
            L = np.linalg.inv(past)
            wanted = wanted + size * J[own].T @ L @ L.T @ J[own]
    inverse = array(np.linalg.inv(J.T @ J + np.diag(1.0 / PRIOR.sigmas**2)))
    plain = array(np.eye(4))
    assert _with_color(problem, linear_of(r, J), PRIOR, inverse, plain) == pytest.approx(inverse @ wanted @ inverse)
    # One channel with color is enough.
    for white in (0, 1):
        bare = array(np.where(channel == white, drawn(660, rng), r))
        assert _with_color(problem, linear_of(bare, J), PRIOR, inverse, plain)[0, 0] < 0.1
    white_r = drawn(660, np.random.default_rng(8))
    assert _with_color(problem, linear_of(white_r, J), PRIOR, inverse, plain) is plain


def test_a_stretch_too_short_for_its_color_has_no_innovations(fit: OutputErrorFit) -> None:
    rng = np.random.default_rng(5)
    problem, J = blank(fit, (300, 1)), array(rng.standard_normal((301, 4)))
    r = drawn(301, rng, 0.8)
    inverse, plain = array(np.eye(4)), array(np.eye(4))
    (a, *_) = fit_autoregression([r[:300]])
    size = float(np.mean((r[1:300] - a * r[:299]) ** 2))
    L = np.linalg.inv(np.eye(300) - a * np.eye(300, k=-1))
    middle = size * (J[:300].T @ L @ L.T @ J[:300] + np.outer(J[300], J[300])) + np.diag(1.0 / PRIOR.sigmas**2)
    assert len(fit_autoregression([r[:300]])) == 1
    assert _with_color(problem, linear_of(r, J), PRIOR, inverse, plain) == pytest.approx(middle)


def test_effective_samples_are_those_of_the_main_channel_that_count(fit: OutputErrorFit) -> None:
    rng = np.random.default_rng(5)
    problem, J, r = blank(fit, (300, 300)), array(rng.standard_normal((600, 4))), drawn(600, rng, 0.8)
    plain = _fit_of(problem, linear_of(r, J), THETA, fit.whitener, PRIOR, converged=True).effective_samples
    assert plain == pytest.approx(600.0 * 0.2 / 1.8, rel=0.4)
    # The same again, with positions and with what does not count in between.
    twice = array(np.repeat(r, 3))
    twice[1::3], twice[2::3] = 30.0, -50.0
    between = replace(
        blank(fit, (900, 900)),
        channel=np.tile([0, 1, 0], 600).astype(np.intp), counts=np.tile([True, True, False], 600),
    )  # fmt: skip
    found = _fit_of(
        between, linear_of(twice, array(np.repeat(J, 3, axis=0))), THETA, fit.whitener, PRIOR, converged=True
    )
    assert found.effective_samples == pytest.approx(plain)


# ---- blocks


@pytest.mark.parametrize(("seconds", "blocks"), [(22.4, 1), (22.6, 2), (37.4, 2), (37.6, 3), (75.0, 5), (0.0, 1)])
def test_a_block_has_about_a_quarter_of_a_minute(fit: OutputErrorFit, seconds: float, blocks: int) -> None:
    n = 101
    problem = replace(blank(fit, (n,)), t=array(7.0 + np.linspace(0.0, seconds, n)))
    J, r = array(np.ones((n, 1))), array(np.ones(n))
    gradients, informations = _blocks(linear_of(r, J), problem)
    sizes = [float(one[0]) for one in gradients]
    assert sizes == [float(one[0, 0]) for one in informations]
    assert len(sizes) == blocks
    assert sum(sizes) == n
    assert max(sizes) - min(sizes) <= 1.0
    assert sizes[-1] >= sizes[0]


def test_blocks_end_with_their_stretch(fit: OutputErrorFit) -> None:
    rng = np.random.default_rng(1)
    problem, J, r = blank(fit, (300, 160)), array(rng.standard_normal((460, 2))), drawn(460, rng)
    gradients, informations = _blocks(linear_of(r, J), problem)
    parts = [slice(0, 150), slice(150, 300), slice(300, 460)]
    assert gradients == pytest.approx(np.array([J[part].T @ r[part] for part in parts]))
    assert np.array(informations) == pytest.approx(np.array([J[part].T @ J[part] for part in parts]))


def scattered(
    fit: OutputErrorFit, means: list[float], weights: list[float]
) -> tuple[LinearizedProblem, OutputErrorProblem]:
    """One parameter; a stretch of one block each with residuals of this mean and sensitivities of this size."""
    problem = blank(fit, (100,) * len(means), 0.15)
    J = array(np.repeat(weights, 100)[:, None])
    return linear_of(array(np.repeat(means, 100)), J), problem


@pytest.mark.parametrize("weights", [[1.0] * 6, [1.0, 1.0, 1.0, 1.0, 2.0, 2.0], [1.0, 1.0, 1.0, 1.0, 1.0, 30.0]])
@pytest.mark.parametrize("beyond", [0.98, 1.02])
def test_blocks_that_disagree_beyond_chance_widen_the_band(
    fit: OutputErrorFit, weights: list[float], beyond: float
) -> None:
    means = [0.3, -0.2, 0.1, -0.4, 0.35, -0.01]
    linear, problem = scattered(fit, means, weights)
    power = 100.0 * np.array(weights) ** 2
    inverse = array(np.array([[1.0 / power.sum()]]))
    errors = 100.0 * np.array(weights) * means / power.sum()
    scatter = float(np.sum(errors**2)) * 6.0 / 5.0
    freedom = max(1.0, float(power.sum() ** 2 / np.sum(power**2)) - 1.0)
    limit = float(chi2.ppf(0.999, freedom)) / freedom
    covariance = array(np.array([[scatter / (beyond * limit)]]))
    wanted = math.sqrt(beyond * limit) if beyond > 1.0 else 1.0
    assert scatter_inflation(*_blocks(linear, problem), inverse, covariance).tolist() == pytest.approx([wanted])


def test_three_blocks_show_nothing(fit: OutputErrorFit) -> None:
    linear, problem = scattered(fit, [1.0, -1.0, 1.0], [1.0] * 3)
    tiny = array(np.array([[1e-9]]))
    assert scatter_inflation(*_blocks(linear, problem), tiny, tiny).tolist() == [1.0]
    linear, problem = scattered(fit, [1.0, -1.0, 1.0, -1.0], [1.0] * 4)
    assert scatter_inflation(*_blocks(linear, problem), array(np.array([[1e-3]])), tiny)[0] > 10.0


def test_a_band_is_widened_by_its_inflation(fit: OutputErrorFit) -> None:
    problem = blank(fit, (100,) * 6, 0.15)
    rng = np.random.default_rng(3)
    J = array(rng.standard_normal((600, 4)))
    r = array(rng.standard_normal(600) + np.repeat([1.0, -1.0, 1.0, -1.0, 1.0, -1.0], 100) * J[:, 0])
    found = _fit_of(problem, linear_of(r, J), THETA, fit.whitener, PRIOR, converged=True)
    assert found.inflation[0] > 2.0
    narrow = found.covariance / np.outer(found.inflation, found.inflation)
    inverse = np.linalg.inv(J.T @ J + np.diag(1.0 / PRIOR.sigmas**2))
    assert narrow == pytest.approx(inverse * float(r @ r) / (600 - 6 - 4))
