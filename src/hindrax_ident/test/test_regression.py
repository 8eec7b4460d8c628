"""The regression without derivatives: exact identity without noise, whatever the filter does."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from hindrax_ident.arrays import Array, array
from hindrax_ident.model.motion_model import Model
from hindrax_ident.online.filtered_regression import DIRECTION_S, FilteredRegression, Sample, physical, scaled
from hindrax_ident.online.rls import Rls
from hindrax_ident.online.thrust_cascade import two_poles
from hindrax_ident.testing.synthetic_runs import STEP_S, Flight, back_and_forth, fly

THETA = np.array([66.48, 1.25, 0.3, 27.3])
ROLL = np.array([1.29, 0.05, 0.02, 3.0, 0.733])
HEAVE = np.array([93.52, 5.26, 56.57, 11.84, 0.7845, 37.7])


def rows(
    model: Model, flight: Flight, lag: float, *, rate: float = 1.0, wander: bool = False, every: int = 4
) -> list[Sample]:
    """Every row of the regression over a flight seen without noise, every 20 ms or so."""
    regression = FilteredRegression(model, lag, rate)
    commands = list(zip(flight.times_s.tolist(), flight.commands.tolist(), strict=True))
    out = []
    for k in range(0, len(flight.path.v), every):
        t = float(flight.grid.times_s[k])
        while commands and commands[0][0] <= t:
            regression.thrust(*commands.pop(0))
        if model.restores:
            regression.position(t, float(flight.path.s[k]))
        sample = regression.velocity(t, float(flight.path.v[k]))
        if sample is not None:
            out.append(sample)
        if wander:
            regression.rate = 1.0 + 0.8 * np.sin(0.7 * t)
    return out


@pytest.mark.parametrize("wander", [False, True], ids=["fixed pole", "moving pole"])
@pytest.mark.parametrize(
    ("model", "theta", "levels"),
    [
        (Model(0, 15.22), THETA, (4.0, 12.0)),
        (Model(2, 15.22, split=True), HEAVE, (10.0, 30.0)),
        (Model(3, 0.483, restores=True), ROLL, (0.5, 1.2)),
    ],
    ids=["surge", "heave", "roll"],
)
def test_identity_holds_without_noise(model: Model, theta: Array, levels: tuple[float, float], wander: bool) -> None:
    flight = fly(model, theta, back_and_forth(levels, 4.0, 40.0), 0.15)
    q = scaled(theta.tolist(), np.eye(len(theta)))[0]
    samples = rows(model, flight, 0.15, wander=wander)
    errors = [sample.y - float(np.dot(sample.x, q)) for sample in samples]
    size = np.std([sample.y for sample in samples])
    assert np.abs(errors).max() < 2e-3 * size


def test_least_squares_on_it_gives_the_parameters_back() -> None:
    model = Model(0, 15.22)
    flight = fly(model, THETA, back_and_forth((4.0, 12.0), 6.0, 60.0), 0.15)
    rls = Rls([0.0] * 4, [1e6] * 4)
    for sample in rows(model, flight, 0.15):
        rls.update(sample.x, sample.y)
    theta, _ = physical(rls.values, rls.unit_covariance * rls.variance)
    assert theta == pytest.approx(THETA, rel=2e-3, abs=2e-3)


def test_a_neglected_lag_shows_in_the_mass() -> None:
    model = Model(0, 15.22)
    flight = fly(model, THETA, back_and_forth((4.0, 12.0), 6.0, 60.0), 0.15)
    rls = Rls([0.0] * 4, [1e6] * 4)
    for sample in rows(model, flight, 0.0):
        rls.update(sample.x, sample.y)
    assert physical(rls.values, rls.unit_covariance * rls.variance)[0][-1] > 29.0


def test_samples_say_when_the_start_is_forgotten() -> None:
    model = Model(0, 15.22)
    flight = fly(model, THETA, back_and_forth((4.0,), 6.0, 12.0), 0.15)
    samples = rows(model, flight, 0.15, rate=2.0)
    settled = [sample.settled for sample in samples]
    # exp(-2 t) falls below 0.05 after 1.5 s, which is sample 75 at 50 Hz.
    assert settled == sorted(settled)
    assert settled.index(True) == pytest.approx(75, abs=1)


def test_asynchronous_thrust_and_velocity_make_no_difference() -> None:
    model = Model(0, 15.22)
    plan = back_and_forth((4.0, 12.0), 5.0, 30.0)
    flight = fly(model, THETA, plan, 0.15)
    q = scaled(THETA.tolist(), np.eye(4))[0]
    rng = np.random.default_rng(2)
    index = np.flatnonzero(rng.random(len(flight.path.v)) < 0.15)
    regression = FilteredRegression(model, 0.15, 1.0)
    commands = list(zip(flight.times_s.tolist(), flight.commands.tolist(), strict=True))
    errors = []
    for k in index.tolist():
        t = float(flight.grid.times_s[k])
        while commands and commands[0][0] <= t:
            regression.thrust(*commands.pop(0))
        sample = regression.velocity(t, float(flight.path.v[k]))
        if sample is not None:
            errors.append(sample.y - float(np.dot(sample.x, q)))
    assert np.abs(errors).max() < 3e-3


def test_scaling_and_back_changes_nothing() -> None:
    C = np.diag([4.0, 0.1, 0.01, 0.2]) + 0.01
    q, Q = scaled(THETA.tolist(), C)
    theta, covariance = physical(q.tolist(), Q)
    assert theta == pytest.approx(THETA)
    assert covariance == pytest.approx(C)


def white(rng: np.random.Generator) -> Array:
    """Noise of an instrument of velocity: (600,) [m/s]."""
    return array(0.01 * rng.standard_normal(600))


def derived(rng: np.random.Generator) -> Array:
    """Noise of differences of positions, 0.1 s apart, of the same variance: (600,) [m/s]."""
    return array(np.diff(0.001 / math.sqrt(2.0) * rng.standard_normal(601)) / 0.1)


@pytest.mark.parametrize("noise", [white, derived])
def test_at_rest_the_sign_of_the_noise_gives_neither_direction_a_speed(
    noise: Callable[[np.random.Generator], Array],
) -> None:
    model, rng = Model(2, 15.22, split=True), np.random.default_rng(6)
    regression = FilteredRegression(model, 0.15, 1.0)
    regression.noise_variance = 1e-4
    regression.thrust(0.0, HEAVE[4])
    samples = [regression.velocity(0.1 * k, v) for k, v in enumerate(noise(rng).tolist())]
    late = [sample.x[:4] for sample in samples[100:] if sample is not None]
    assert len(late) == 500
    speeds = np.mean(late, axis=0)
    # By its own sign each direction would be at 0.01 / sqrt(2 pi) = 0.004 m/s.
    assert np.abs(speeds[[1, 3]]).max() < 0.0015
    assert np.abs(speeds[[0, 2]]).max() < 2e-5


def test_means_over_a_span_are_compared_with_means_of_the_thrust() -> None:
    model, span_s = Model(0, 15.22), 0.2
    flight = fly(model, THETA, back_and_forth((4.0, 12.0), 2.0, 60.0), 0.15)
    means = np.diff(flight.path.s[:: round(span_s / STEP_S)]) / span_s

    def mass(spread_s2: float) -> float:
        regression, rls = FilteredRegression(model, 0.15, 1.0), Rls([0.0] * 4, [1e6] * 4)
        commands = list(zip(flight.times_s.tolist(), flight.commands.tolist(), strict=True))
        for k, v in enumerate(means.tolist()):
            t = (k + 0.5) * span_s
            while commands and commands[0][0] <= t:
                regression.thrust(*commands.pop(0))
            sample = regression.velocity(t, v, spread_s2)
            if sample is not None and sample.settled:
                rls.update(sample.x, sample.y)
        return float(physical(rls.values, rls.unit_covariance * rls.variance)[0][-1])

    assert abs(mass(span_s**2 / 12.0) - THETA[3]) < 0.4 * abs(mass(0.0) - THETA[3])


def fed(
    regression: FilteredRegression, velocities: list[float], each: Callable[[int], None] = lambda _index: None
) -> list[Sample | None]:
    """Samples of velocities at 10 Hz; `each` may say more before each."""
    out = []
    for index, v in enumerate(velocities):
        each(index)
        out.append(regression.velocity(0.1 * index, v))
    return out


SWINGS = [0.4 * math.sin(0.3 * index) for index in range(60)]


def assert_alike(some: list[Sample | None], others: list[Sample | None], rel: float = 1e-9) -> None:
    for one, other in zip(some, others, strict=True):
        assert (one is None) is (other is None)
        if one is not None and other is not None:
            assert (*one.x, one.y, one.speed) == pytest.approx((*other.x, other.y, other.speed), rel=rel, abs=rel)


@pytest.mark.parametrize(
    ("model", "v"),
    [
        (Model(0, 15.22), 0.4),
        (Model(0, 15.22), -0.4),
        (Model(2, 15.22, split=True), 0.3),
        (Model(2, 15.22, split=True), -0.3),
        (Model(3, 0.483, restores=True), 0.5),
    ],
)
def test_the_slope_of_a_row_is_its_derivative_by_the_last_velocity(model: Model, v: float) -> None:
    def row(more: float) -> Sample:
        regression = FilteredRegression(model, 0.15, 1.3)
        regression.thrust(0.0, 5.0)
        regression.position(0.2, 0.1)
        sample = fed(regression, [0.1, 0.2, v + more])[-1]
        assert sample is not None
        return sample

    tiny = 1e-6
    wanted = (np.array(row(tiny).x) - np.array(row(-tiny).x)) / (2.0 * tiny)
    assert row(0.0).slope == pytest.approx(wanted.tolist(), rel=1e-5, abs=1e-6)


def test_an_undone_velocity_leaves_no_trace() -> None:
    one, other = (FilteredRegression(Model(0, 15.22), 0.15, 1.0) for _ in range(2))
    for regression in (one, other):
        regression.thrust(0.0, 5.0)

    def spoil(index: int) -> None:
        if index in (20, 21):
            one.velocity(0.1 * index - 0.05, 3.0)
            one.undo_last()

    assert_alike(fed(one, SWINGS, spoil), fed(other, SWINGS))


def test_a_known_force_acts_like_thrust_without_a_lag() -> None:
    one, other = (FilteredRegression(Model(0, 15.22), 0.0, 1.0) for _ in range(2))

    def thrust(index: int) -> None:
        one.thrust(0.1 * index, 5.0 + index)

    def both(index: int) -> None:
        other.known(0.1 * index, float(index))
        other.thrust(0.1 * index, 5.0)

    assert_alike(fed(one, SWINGS, thrust), fed(other, SWINGS, both))


@pytest.mark.parametrize(
    ("lag_s", "rate", "nearly_lag_s", "nearly_rate"), [(0.0, 1.0, 1e-7, 1.0), (0.5, 2.0, 0.5, 2.0005)]
)
def test_no_lag_and_poles_that_coincide_are_no_exception(
    lag_s: float, rate: float, nearly_lag_s: float, nearly_rate: float
) -> None:
    one = FilteredRegression(Model(0, 15.22), lag_s, rate)
    other = FilteredRegression(Model(0, 15.22), nearly_lag_s, nearly_rate)

    for index, v in enumerate(SWINGS):
        for regression in (one, other):
            regression.thrust(0.1 * index, 10.0 * math.sin(0.5 * index))
        some, others = (regression.velocity(0.1 * index + 0.05, v, 0.003) for regression in (one, other))
        assert_alike([some], [others], rel=2e-3)


def test_an_angle_is_carried_on_to_the_time_of_the_velocity() -> None:
    one, other, unknown = (FilteredRegression(Model(3, 0.483, restores=True), 0.15, 1.0) for _ in range(3))
    for regression in (one, other, unknown):
        regression.thrust(0.0, 1.0)

    some = fed(one, SWINGS, lambda index: one.position(0.1 * index - 0.04, 0.02 * index))
    others = fed(other, SWINGS, lambda index: other.position(0.1 * index, 0.02 * index + 0.04 * SWINGS[index]))
    assert_alike(some, others)
    last, blind = some[-1], fed(unknown, SWINGS)[-1]
    assert last is not None
    assert blind is not None
    assert last.x[3] != 0.0
    assert blind.x[3] == 0.0


def test_after_a_restart_the_filters_begin_as_at_first() -> None:
    used, fresh = (FilteredRegression(Model(0, 15.22), 0.15, 1.0) for _ in range(2))
    assert all(math.isnan(time_s) for time_s in (fresh.velocity_time_s, fresh.thrust_time_s))
    used.thrust(0.0, 5.0)
    fed(used, SWINGS)
    assert (used.velocity_time_s, used.thrust_time_s) == pytest.approx((5.9, 0.0))
    used.restart()
    assert math.isnan(used.velocity_time_s)
    fresh.thrust(0.0, 5.0)
    later = [[one.velocity(20.0 + 0.1 * index, v) for index, v in enumerate(SWINGS)] for one in (used, fresh)]
    assert later[0][0] is None
    assert_alike(later[0], later[1])
    assert [one.settled for one in later[0][1:] if one] == [one.settled for one in later[1][1:] if one]


def test_the_noise_of_a_velocity_adds_nothing_to_its_square() -> None:
    squares = []
    for noise_mps in (0.0, 0.01):
        regression = FilteredRegression(Model(0, 15.22), 0.15, 1.0)
        regression.noise_variance = noise_mps**2
        regression.thrust(0.0, 0.0)
        last = fed(regression, [0.05 + noise_mps * (-1.0) ** index for index in range(100)])[-1]
        assert last is not None
        squares.append(last.x[0])
    assert squares[1] == pytest.approx(squares[0], rel=0.015)


@pytest.mark.parametrize("v", [0.02, -0.02])
def test_a_velocity_that_is_lost_in_its_noise_has_the_sign_of_its_mean(v: float) -> None:
    regression = FilteredRegression(Model(0, 15.22), 0.15, 1.0)
    regression.noise_variance = 0.01**2
    regression.thrust(0.0, 0.0)
    last = fed(regression, [v] * 100)[-1]
    assert last is not None
    assert last.x[0] == pytest.approx(-math.copysign(0.02**2 - 0.01**2, v), rel=0.1)


@pytest.mark.parametrize(("split", "v"), [(False, 0.4), (False, -0.4), (True, 0.3), (True, -0.3)])
def test_a_steady_velocity_is_its_own_mean(split: bool, v: float) -> None:
    regression = FilteredRegression(Model(2, 15.22, split=split), 0.15, 2.0)
    regression.thrust(0.0, 5.0)
    last = fed(regression, [v] * 60)[-1]
    assert last is not None
    assert last.speed == pytest.approx(v, rel=1e-4)


@pytest.mark.parametrize("deviations", [2.9, 3.1])
def test_a_velocity_beyond_three_deviations_of_its_noise_has_its_own_sign(deviations: float) -> None:
    regression = FilteredRegression(Model(2, 15.22, split=True), 0.15, 1.0)
    regression.noise_variance = 0.01**2
    regression.thrust(0.0, 0.0)
    *_, last = fed(regression, [-0.2] * 20 + [0.01 * deviations])
    assert last is not None
    assert [slope != 0.0 for slope in last.slope[:4]] == ([True] * 2 + [False] * 2)[:: 1 if deviations > 3.0 else -1]


def turns(velocities: list[float], step_s: float) -> list[int]:
    """Indices of samples from which a velocity that is lost in its noise has the other direction."""
    regression = FilteredRegression(Model(2, 15.22, split=True), 0.15, 1.0)
    regression.noise_variance = 1.0
    regression.thrust(0.0, 0.0)
    samples = [regression.velocity(step_s * index, v) for index, v in enumerate(velocities)]
    ahead = [sample is not None and sample.slope[1] != 0.0 for sample in samples]
    return [index for index in range(1, len(ahead)) if ahead[index] is not ahead[index - 1]]


def test_a_velocity_that_is_lost_in_its_noise_has_the_sign_of_its_mean_with_its_trend() -> None:
    """At rest it goes backward. After a turn the mean e^-a, its trend a e^-a: they are zero at (1 - a) e^-a = 1 / 2."""
    step_s = 0.01
    begins, turned = turns([0.0] * 3 + [0.1] * 300 + [-0.1] * 60, step_s)
    # The mean is without the newest velocity, which has noise in common with the one before.
    assert begins == pytest.approx(3 + 1, abs=1)
    assert (turned - 303) * step_s == pytest.approx(0.315 * DIRECTION_S + step_s, abs=1.5 * step_s)


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("rate", [0.02, 0.3])
def test_a_velocity_that_goes_through_zero_is_not_long_taken_for_the_other_direction(way: float, rate: float) -> None:
    """A mean of the past is late by its time constant: a twentieth of heave's buoyancy was drag of the other way."""
    step_s = 0.1
    ramp = [way * rate * step_s * (index - 40.5) for index in range(81)]
    assert turns(ramp, step_s)[-1] == pytest.approx(41, abs=1)


@pytest.mark.parametrize("lag_s", [0.0, 0.15])
def test_a_mean_over_a_span_has_the_curvature_of_the_filtered_thrust(lag_s: float) -> None:
    def filtered(at_s: float, spread_s2: float = 0.0) -> float:
        regression = FilteredRegression(Model(0, 15.22), lag_s, 1.3)
        regression.thrust(0.0, 2.0)
        regression.known(0.0, 3.0)
        regression.velocity(0.0, 0.1)
        regression.thrust(0.5, 7.0)
        sample = regression.velocity(at_s, 0.2, spread_s2)
        assert sample is not None
        return sample.x[-1]

    h, at_s = 1e-3, 0.6
    curvature = (filtered(at_s + h) - 2.0 * filtered(at_s) + filtered(at_s - h)) / h**2
    assert filtered(at_s, 0.01) - filtered(at_s) == pytest.approx(0.5 * 0.01 * curvature, rel=1e-4)


@pytest.mark.parametrize("apart", [0.0, 1e-7, -1e-7, 1e-3, 1.7, -1.7])
def test_two_poles_in_a_row_have_an_integral_in_closed_form(apart: float) -> None:
    b, step = 2.0, 0.02
    a = b + apart
    wanted = step if apart == 0.0 else math.expm1(apart * step) / apart
    found = two_poles(a, b, step, math.exp(-a * step), math.exp(-b * step))
    assert found == pytest.approx(wanted * math.exp(-a * step), rel=1e-8)


def test_thrust_before_the_first_velocity_does_not_count() -> None:
    regression = FilteredRegression(Model(0, 15.22), 0.0, 1.3)
    regression.thrust(-5.0, 7.0)
    assert regression.velocity(0.0, 0.1) is None
    sample = regression.velocity(0.4, 0.1)
    assert sample is not None
    assert sample.x[-1] == pytest.approx(7.0 * (1.0 - math.exp(-1.3 * 0.4)) / 1.3)
