"""Lag and latency: what they do to a record in closed form, and the search for both."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hindrax_ident.arrays import Array, Index, array
from hindrax_ident.fit import delay as module
from hindrax_ident.fit.delay import (
    SEARCHED_S,
    STARTS,
    DelayEstimate,
    _Search,
    _spread,
    delay_impulses,
    fit_with_delays,
    lag_impulse,
    latency_impulse,
    prior_delays,
    search_delay,
)
from hindrax_ident.fit.output_error import OutputErrorFit
from hindrax_ident.fit.output_error import refine as module_refine
from hindrax_ident.fit.output_error_problem import LinearizedProblem, build_problem, linearize
from hindrax_ident.fit.scores import score
from hindrax_ident.model.model_parameters import Prior
from hindrax_ident.model.motion_model import Model
from hindrax_ident.model.simulation import Grid, per_step
from hindrax_ident.records.axis_record import Record, Series, Stretch
from hindrax_ident.testing.synthetic_runs import back_and_forth, fly

SURGE, THETA = Model(0, 15.22), array(np.array([66.48, 1.25, 0.0, 27.3]))
PRIOR = Prior(array(np.array([60.0, 2.0, 0.0, 25.0])), array(np.array([60.0, 30.0, 5.0, 30.0])))
LAG_S, LATENCY_S = 0.25, 0.08
FORCE_N = 6.0


def test_a_long_record_is_searched_in_parts_of_all_its_time() -> None:
    stretches = tuple(Stretch(60.0 * at, 60.0 * at + 50.0) for at in range(40))
    parts = _spread(stretches)
    assert parts == stretches[::4]
    assert sum(one.end_s - one.start_s for one in parts) <= SEARCHED_S
    assert _spread(stretches[:12]) == stretches[:12]


def test_a_fit_over_parts_at_first_ends_where_that_over_all_does(monkeypatch: pytest.MonkeyPatch) -> None:
    flight = fly(SURGE, THETA, back_and_forth((4.0, 9.0, 13.0), 5.0, 80.0), LAG_S)
    t = flight.grid.times_s[::20]
    v = flight.path.v[::20] + 0.003 * np.random.default_rng(2).standard_normal(len(t))
    stretches = tuple(Stretch(10.0 * at, 10.0 * at + 9.9) for at in range(8))
    record = Record(Series(t, array(v)), Series(flight.times_s, flight.commands), stretches)
    found, whole = fit_with_delays(record, PRIOR.values, SURGE, PRIOR, 0.1)
    fitted = list[int]()

    def refine(model: Model, part: Record, *given: Any, **more: Any) -> OutputErrorFit:
        fitted.append(len(part.stretches))
        return module_refine(model, part, *given, **more)

    monkeypatch.setattr(module, "SEARCHED_S", 20.0)
    monkeypatch.setattr(module, "refine", refine)
    assert len(_spread(stretches)) == 2
    again, parts = fit_with_delays(record, PRIOR.values, SURGE, PRIOR, 0.1)
    assert fitted[0] == 2
    assert fitted[-1] == 8
    assert fitted.count(8) <= 2
    assert (again.lag_s, again.latency_s) == pytest.approx((found.lag_s, found.latency_s), abs=1e-3)
    off = np.abs(parts.theta - whole.theta) / np.sqrt(np.diag(whole.covariance))
    assert off.max() < 0.1


@pytest.mark.parametrize(("moved_s", "fits"), [(0.019, 2), (0.021, 3)])
def test_delays_have_settled_that_change_by_little_of_what_is_not_known_of_them(
    late: Record, moved_s: float, fits: int
) -> None:
    """A tenth of 0.2 s; the record is fitted once more with what was found roughly at first."""
    with pytest.MonkeyPatch.context() as patch:
        one = Rounds(patch, (0.3, 0.1), (0.3 + moved_s, 0.1), (0.3 + moved_s, 0.1), sigma_s=0.2)
        fit_with_delays(late, THETA, SURGE, PRIOR, 0.1)
    assert len(one.fitted) == fits


def grid_of(times: Array, *starts: int) -> Grid:
    return Grid(times, np.isin(np.arange(len(times)), (0, *starts)), array(np.zeros(len(times))))


def stepped(lag_s: float, latency_s: float = 0.0) -> Record:
    """Thrust from nothing to a force at one second."""
    thrust = Series(array(np.array([0.0, 1.0])), array(np.array([0.0, FORCE_N])))
    nothing = Series(array(np.zeros(0)), array(np.zeros(0)))
    return Record(nothing, thrust, (), lag_s=lag_s, latency_s=latency_s)


def test_what_is_up_to_each_time_becomes_what_is_over_each_step() -> None:
    totals = array(np.array([[5.0, 1.0], [6.0, 3.0], [9.0, 2.0], [7.0, 4.0]]))
    found = per_step(totals, grid_of(array(np.arange(4.0)), 2).starts)
    assert found.tolist() == [[0.0, 0.0], [1.0, 2.0], [0.0, 0.0], [-2.0, 2.0]]


@pytest.mark.parametrize("latency_s", [0.0, 0.3])
def test_more_lag_takes_what_the_transient_takes(latency_s: float) -> None:
    """The impulse F (s - T (1 - exp(-s / T))) of a step, differentiated by T."""
    times = array(np.linspace(0.0, 3.0, 31))
    s = np.maximum(0.0, times - 1.0 - latency_s)
    total = -FORCE_N * (1.0 - np.exp(-s / 0.2) * (1.0 + s / 0.2))
    found = lag_impulse(stepped(0.2, latency_s), grid_of(times))
    assert found.shape == (31, 1)
    assert found[:, 0] == pytest.approx(np.diff(total, prepend=0.0), abs=2e-3)
    assert total[-1] == pytest.approx(-FORCE_N, rel=0.01)


@pytest.mark.parametrize("lag_s", [0.0, 0.2])
def test_more_latency_is_less_of_the_force_at_the_end(lag_s: float) -> None:
    times = array(np.linspace(0.0, 3.0, 31))
    s = times - 1.0 - 0.32
    force = np.where(s > 0.0, FORCE_N * (1.0 - (np.exp(-s / lag_s) if lag_s else 0.0)), 0.0)
    record = stepped(lag_s, 0.32)
    found = latency_impulse(record, grid_of(times))
    assert found[:, 0] == pytest.approx(-np.diff(force, prepend=0.0))
    assert np.array_equal(
        delay_impulses(record, grid_of(times), record.lagged()), np.hstack([lag_impulse(record, grid_of(times)), found])
    )


def test_a_record_without_delays_has_those_of_a_usual_vehicle_and_a_given_zero_stays_zero() -> None:
    assert prior_delays(stepped(0.0)).tolist() == [0.15, 0.05]
    assert prior_delays(replace(stepped(0.0), prior_delays_s=(0.0, 0.0))).tolist() == [0.0, 0.0]


@pytest.fixture(scope="module")
def late() -> Record:
    """Thrust that lags by more than is usual, and velocities that come late; nobody tells either."""
    flight = fly(SURGE, THETA, back_and_forth((4.0, 12.0), 2.0, 16.0), LAG_S)
    t, v = flight.grid.times_s[::20], flight.path.v[::20]
    noise = 0.002 * np.random.default_rng(2).standard_normal(len(t))
    thrust = Series(flight.times_s, flight.commands)
    return Record(Series(array(t + LATENCY_S), array(v + noise)), thrust, (Stretch(0.5, 15.9),))


def search_of(record: Record, prior: Prior = PRIOR, sigma_s: float = 0.3) -> _Search:
    return _Search(build_problem(SURGE, record), record, prior, sigma_s)


AT = array(np.array([60.0, 3.0, 0.2, 30.0, 0.2, 0.06]))


def linear_at(search: _Search, x: Array) -> LinearizedProblem:
    found = search._at(x, search._problem.guess, lambda table: table)
    assert found is not None
    return found


def test_residuals_follow_the_delays_as_their_columns_say(late: Record) -> None:
    search = search_of(late)
    found, h = linear_at(search, AT), 1e-4
    assert found.J.shape == (len(search._problem.t), 6)
    # Without the initial conditions: what one of them explains is left out of the differences as well.
    for column in range(4, 6):
        more, less = (linear_at(search, array(AT + sign * h * np.eye(6)[column])).raw for sign in (1.0, -1.0))
        slope = (less - more) / (2.0 * h)
        start = (linear_at(search, AT).raw - _nudged(search)) / h
        slope -= start * float(start @ slope) / float(start @ start)
        assert np.abs(found.J[:, column] - slope).max() < 0.03 * np.abs(slope).max()


def _nudged(search: _Search, h: float = 1e-4) -> Array:
    """Residuals with another initial velocity."""
    v = search._problem.guess.v.copy()
    v[0] += h
    found = search._at(AT, replace(search._problem.guess, v=v), lambda table: table)
    assert found is not None
    return found.raw


def test_delays_of_the_unknowns_are_those_of_the_record(late: Record) -> None:
    search = search_of(late)
    record = replace(late, lag_s=0.2, latency_s=0.06)
    problem = build_problem(SURGE, record)
    direct = linearize(
        problem, AT[:4], problem.guess, lambda table: table, delay_impulses(record, problem.grid, record.lagged())
    )
    assert direct is not None
    found = linear_at(search, AT)
    assert found.raw == pytest.approx(direct.raw, abs=1e-12)
    assert pytest.approx(direct.J, abs=1e-12) == found.J
    for mass in (0.0, -1.0):
        assert (
            search._at(array(np.array([60.0, 3.0, 0.2, mass, 0.2, 0.06])), search._problem.guess, lambda t: t) is None
        )


def test_a_step_without_damping_solves_the_normal_equations(late: Record) -> None:
    search = search_of(late)
    linear = linear_at(search, AT)
    mean = np.array([*PRIOR.values, 0.15, 0.05])
    weight = np.array([*PRIOR.sigmas**-2.0, 0.3**-2.0, 0.3**-2.0])
    normal = linear.J.T @ linear.J + np.diag(weight)
    wanted = AT + np.linalg.solve(normal, linear.J.T @ linear.r + weight * (mean - AT))
    assert 0.0 < wanted[-2] < 1.0
    assert abs(wanted[-1]) < 1.0
    assert search._step(linear, AT, 0.0) == pytest.approx(wanted, rel=1e-6)
    # Damped by so much of the diagonal.
    damped = AT + np.linalg.solve(normal + 0.5 * np.diag(np.diag(normal)), linear.J.T @ linear.r + weight * (mean - AT))
    assert search._step(linear, AT, 0.5) == pytest.approx(damped, rel=1e-6)
    assert search._cost(linear, AT) == pytest.approx(float(linear.r @ linear.r) + float(weight @ (AT - mean) ** 2))
    assert search._error(linear) == pytest.approx(float(np.mean(np.abs(linear.raw))))
    assert search._error(None) == math.inf


def test_delays_are_limited(late: Record) -> None:
    search = search_of(late)
    for lag_s, latency_s, wanted in ((-0.1, -1.5, [0.0, -1.0]), (2.0, 2.0, [1.0, 1.0]), (0.3, -0.4, [0.3, -0.4])):
        x = array(np.array([-5.0, 2.0, 3.0, 4.0, lag_s, latency_s]))
        assert search._bounded(x).tolist() == [-5.0, 2.0, 3.0, 4.0, *wanted]


def test_what_is_far_off_weighs_less_but_never_nothing(late: Record) -> None:
    search = search_of(late)
    n = len(search._problem.t)
    channel = (np.arange(n) % 2).astype(np.intp)
    raw = np.where(channel == 0, 1.645, 0.01645) * np.where(np.arange(n) % 4 < 2, 1.0, -1.0)
    raw[[8, 9]] = [-12.0, 0.27]
    table = array(np.ones((n, 2)))

    def weighed(channels: Index, values: Array) -> Array:
        own = _Search(replace(search._problem, channel=channels), late, PRIOR, 0.3)
        found = own._weights(replace(linear_at(search, AT), raw=values))(table)
        assert np.array_equal(found[:, 0], found[:, 1])
        return found[:, 0]

    # In units of what nine of ten are within; beyond three of them with the root of the excess.
    wanted = np.where(channel == 0, 1.0, 100.0)
    wanted[8] /= math.sqrt(12.0 / 3.0)
    wanted[9] /= math.sqrt(27.0 / 3.0)
    assert weighed(channel, array(raw)) == pytest.approx(wanted)
    assert weighed(np.ones(n, np.intp), array(np.full(n, -1.645))) == pytest.approx(np.ones(n))
    assert weighed(np.zeros(n, np.intp), array(np.zeros(n))) == pytest.approx(np.full(n, 1e9))
    usual = 0.9 * (n - 1) / 1.645
    ladder = np.arange(n, dtype=float)
    wanted = 1.0 / (usual * np.sqrt(np.maximum(1.0, ladder / (3.0 * usual))))
    assert weighed(np.zeros(n, np.intp), array(ladder)) == pytest.approx(wanted)
    assert search._weights(None)(table) is table


def test_a_search_begins_at_the_prior_where_its_start_diverges(late: Record) -> None:
    search, delays = search_of(late), array(np.array([0.1, 0.2]))
    diverging, unknown = array(np.array([-1e9, 0.0, 0.0, 1e-9])), array(np.full(4, math.nan))
    for start in (diverging, unknown):
        x, found = search._begin(start, delays)
        assert x.tolist() == [*PRIOR.values, 0.1, 0.2]
        assert found is not None
    x, found = search._begin(THETA, delays)
    assert x.tolist() == [*THETA, 0.1, 0.2]
    assert found is not None
    hopeless = search_of(late, Prior(diverging, PRIOR.sigmas))
    assert hopeless._begin(unknown, delays)[1] is None
    nothing = hopeless.run(unknown, delays)
    assert nothing.error == math.inf
    assert nothing.delays_s.tolist() == [0.1, 0.2]
    assert nothing.theta.tolist() == diverging.tolist()


class Trials(_Search):
    """A search whose steps are good or bad as the test says, and their dampings."""

    def of(self, outcomes: Iterable[bool | None], moves_s: float = 0.1) -> list[float]:
        self.dampings, self._outcomes, self._moves_s = list[float](), iter(outcomes), moves_s
        self._costs, self._tried, self._fails = 1000.0, array(np.zeros(0)), False
        self.run(THETA, array(np.array([0.3, 0.1])))
        return self.dampings

    def _step(self, linear: LinearizedProblem, x: Array, damping: float) -> Array:  # noqa: ARG002  # as it is asked
        self.dampings.append(damping)
        outcome = next(self._outcomes)
        self._fails, self._costs = outcome is None, self._costs + (0.0 if outcome is False else -1.0)
        self._tried = array(x + self._moves_s * np.eye(6)[5] * (-1.0) ** len(self.dampings))
        return self._tried

    def _at(self, x: Array, *rest: Any) -> LinearizedProblem | None:
        return None if self._fails and x is self._tried else super()._at(x, *rest)

    def _cost(self, linear: LinearizedProblem, x: Array) -> float:  # noqa: ARG002  # as it is asked
        return self._costs if x is self._tried else self._before

    @property
    def _before(self) -> float:
        return self._costs + (0.0 if self._costs == 1000.0 else 1.0)


def trials_of(record: Record) -> Trials:
    return Trials(build_problem(SURGE, record), record, PRIOR, 0.3)


@pytest.mark.parametrize("bad", [None, False])
def test_a_search_that_finds_nothing_better_damps_ten_times_more_and_ends(late: Record, bad: bool | None) -> None:
    """From a hundredth to a million."""
    dampings = trials_of(late).of(itertools.repeat(bad))
    assert dampings == pytest.approx([10.0 ** (k - 2) for k in range(9)])


def test_a_search_that_always_finds_better_damps_ten_times_less_and_ends_after_25_steps(late: Record) -> None:
    dampings = trials_of(late).of(itertools.repeat(True))
    assert dampings == pytest.approx([10.0 ** (-2 - k) for k in range(25)], rel=1e-9, abs=0.0)


@pytest.mark.parametrize(("moves_s", "steps"), [(0.9e-3, 1), (1.1e-3, 25)])
def test_a_search_ends_when_the_delays_move_by_less_than_a_millisecond(
    late: Record, moves_s: float, steps: int
) -> None:
    assert len(trials_of(late).of(itertools.repeat(True), moves_s)) == steps


def test_the_mass_has_to_be_positive_and_nothing_else(late: Record) -> None:
    model = Model(2, 15.22, split=True)
    prior = Prior(array(np.ones(6)), array(np.ones(6)))
    search = _Search(build_problem(model, late), late, prior, 0.3)
    light = array(np.array([1.0, 0.1, 1.0, -0.1, 0.0, 0.5, 0.2, 0.1]))
    assert search._at(light, search._problem.guess, lambda table: table) is not None


@pytest.mark.parametrize("start", STARTS)
def test_lag_and_latency_are_found_from_every_start(late: Record, start: tuple[float, float]) -> None:
    found = search_of(late).run(PRIOR.values, array(np.array(start)))
    assert found.delays_s == pytest.approx([LAG_S, LATENCY_S], abs=0.02)
    assert found.theta == pytest.approx(THETA, rel=0.06, abs=0.6)
    # Mean absolute value of noise of 2 mm/s.
    assert found.error == pytest.approx(0.002 * math.sqrt(2.0 / math.pi), rel=0.1)


def test_the_best_of_the_starts_counts(late: Record) -> None:
    found = search_delay(SURGE, late, PRIOR.values, PRIOR, 0.3)
    runs = [search_of(late).run(PRIOR.values, array(np.array(start))) for start in STARTS]
    assert found.error == min(one.error for one in runs)
    assert STARTS == ((0.1, 0.0), (0.3, 0.0), (0.0, 0.2))


def test_delays_that_are_accepted_stay(late: Record) -> None:
    found = search_delay(SURGE, replace(late, prior_delays_s=(0.4, -0.1)), PRIOR.values, PRIOR, 1e-6)
    assert found.delays_s == pytest.approx([0.4, -0.1], abs=1e-3)


@pytest.mark.parametrize("sigma_s", [0.3, 0.01, 1e-5])
def test_the_delays_of_a_fit_are_between_what_it_shows_and_what_is_accepted(late: Record, sigma_s: float) -> None:
    record, fit = fit_with_delays(late, PRIOR.values, SURGE, PRIOR, sigma_s)
    delays = np.array([record.lag_s, record.latency_s])
    reported = score(fit, delay_impulses(record, fit.problem.grid, record.lagged()))
    # Where the slope of both together is nothing, nothing more is to be gained.
    precision = reported.information + np.eye(2) / sigma_s**2
    further = np.linalg.solve(
        precision, reported.information @ reported.values + (np.array([0.15, 0.05]) - delays) / sigma_s**2
    )
    assert np.abs(further).max() < 2e-3
    if sigma_s == 0.3:
        assert delays == pytest.approx([LAG_S, LATENCY_S], abs=0.02)
        assert fit.theta == pytest.approx(THETA, rel=0.06, abs=0.6)
    if sigma_s == 1e-5:
        assert delays == pytest.approx([0.15, 0.05], abs=1e-3)
    assert fit.problem.lag_s == record.lag_s


class Rounds:
    """In the place of searches and fit: delays that whitened searches find, one round after the other."""

    def __init__(self, patch: pytest.MonkeyPatch, *found: tuple[float, float], sigma_s: float = 0.0) -> None:
        self.fitted, self._found, self._sigma_s = list[tuple[float, float]](), iter(found), sigma_s
        self.problem = self.whitener = None
        self.model, self.theta = SURGE, THETA
        patch.setattr(
            module, "search_delay", lambda *_: DelayEstimate(0.0, THETA, array([0.5, -0.2]), array([0.0, 0.0]))
        )
        patch.setattr(module, "refine", self.refine)
        patch.setattr(module, "_Search", lambda *_, **__: self)

    def refine(
        self, _model: Model, record: Record, _start: Array, _belief: Prior, like: Rounds | None = None, **rough: bool
    ) -> Rounds:
        assert (like is self) is bool(self.fitted)
        assert bool(rough) is not bool(self.fitted)
        self.fitted.append((record.lag_s, record.latency_s))
        return self

    def run(self, _theta: Array, delays: Array) -> DelayEstimate:
        assert tuple(delays) == self.fitted[-1]
        lag_s, latency_s = next(self._found)
        error = 0.0 if math.isfinite(lag_s) else math.inf
        return DelayEstimate(error, THETA, array([lag_s, latency_s]), array(np.full(2, self._sigma_s)))


@pytest.mark.parametrize(
    ("found", "rounds"),
    [
        ([(0.5004, -0.1996)], [(0.5, -0.2)]),
        ([(0.25, 0.25), (0.2504, 0.25)], [(0.25, 0.25)]),
        ([(0.25, 0.25), (0.25, 0.26), (0.25, 0.26)], [(0.25, 0.25), (0.25, 0.26)]),
        ([(0.35, 0.25), (0.25, 0.25)] * 3, [(0.35, 0.25), (0.25, 0.25)] * 2),
        ([(0.25, 0.25), (math.nan, math.nan)], [(0.25, 0.25)]),
    ],
)
def test_delays_are_searched_until_they_stay_but_four_times_at_most(
    late: Record, found: list[tuple[float, float]], rounds: list[tuple[float, float]]
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        one = Rounds(patch, *found)
        record, _ = fit_with_delays(late, THETA, SURGE, PRIOR, 0.1)
    assert one.fitted == [(0.5, -0.2), *rounds]
    assert (record.lag_s, record.latency_s) == one.fitted[-1]
