"""The likelihood of a noise, against that of normal residuals with their full covariance; the search for the best."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from hindrax_ident.arrays import Array, Flags, array
from hindrax_ident.fit.noise_likelihood import (
    _best,
    _Candidate,
    _piece_rows,
    _Pieces,
    _ratio_and_part,
    disturbance_profile,
    fit_noise,
)
from hindrax_ident.fit.whitening import ErrorDynamics, Noise, transitions
from hindrax_ident.testing.error_covariance import MEMORY_S, covariance_of, error_dynamics_of

WIDE = 1e3
"""Variance of the motion at the start of a piece, in measurement variances."""


def starts_of(n: int, *starts: int) -> Flags:
    flags = np.zeros(n, bool)
    flags[list(starts)] = True
    return flags


def likelihood(chain: ErrorDynamics, residual: Array, noise: Noise, wide: float) -> tuple[float, float]:
    """Square of the normalized residuals, and logarithm of the determinant of their covariance."""
    C = covariance_of(chain, noise, wide)[np.ix_(chain.counts, chain.counts)]
    r = residual[chain.counts]
    return float(r @ np.linalg.solve(C, r)), float(np.linalg.slogdet(C)[1])


def measured(channels: tuple[int, ...], n: int = 60, seed: int = 5) -> tuple[ErrorDynamics, Array]:
    """Two stretches of unequal length, in which three measurements do not count, and residuals of some size."""
    rng = np.random.default_rng(seed)
    chain = error_dynamics_of(n, rng, channels, stiffness=4.0, starts=(0, n // 3))
    counts = chain.counts.copy()
    counts[[4, 30, 31]] = False
    return replace(chain, counts=counts, thrust=array(rng.uniform(0.0, 0.4, n))), array(0.1 * rng.standard_normal(n))


CANDIDATES = ((0.0, 0.0, 0.0), (0.3, 0.5, -1.4), (2.0, 0.02, 0.7), (0.0, 0.8, -0.3))
"""Densities of force and of thrust, and decades of the variance of the other channel."""


@pytest.mark.parametrize(
    ("channels", "main"), [((0,), 0), ((1,), 1), ((0, 1), 0)], ids=["velocity", "position", "both"]
)
def test_pieces_side_by_side_have_the_likelihood_of_all(channels: tuple[int, ...], main: int) -> None:
    chain, residual = measured(channels)
    force, thrust, other = (array(np.array(column)) for column in zip(*CANDIDATES, strict=True))
    squares, logs, n = _Pieces(chain, residual, main).filtered(force, thrust, other)
    assert n == 57
    for index, (of_force, of_thrust, decades) in enumerate(CANDIDATES):
        velocity, position = (1.0, 10.0**decades) if main == 0 else (10.0**decades, 1.0)
        wanted = likelihood(
            chain, residual, Noise(velocity, position, of_force, of_thrust), WIDE * max(velocity, position)
        )
        assert (squares[index], logs[index]) == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("memory_s", [0.0, 0.01])
def test_an_unknown_force_has_some_memory_at_least(memory_s: float) -> None:
    chain, residual = measured((0, 1))
    one = array(np.ones(1))
    least, short = (_Pieces(replace(chain, memory_s=memory), residual, 0).filtered(one, one, 0.0 * one)
                    for memory in (0.02, memory_s))  # fmt: skip
    assert short == least


def test_the_score_is_that_of_the_best_scale() -> None:
    chain, residual = measured((0, 1))
    mean_thrust = float(np.concatenate([chain.thrust[:20], [chain.thrust[19]] * 20, chain.thrust[20:]]).mean())
    candidates = [(-7.0, 0.4, 0.3), (0.5, 0.0, -1.0), (0.5, 0.25, -1.0), (-1.5, 1.0, 0.0)]
    pieces = _Pieces(chain, residual, 0)
    scores, sizes = pieces.scores(*(array(one) for one in zip(*candidates, strict=True)))
    for index, (ratio, part, other) in enumerate(candidates):
        total = 0.0 if ratio == -7.0 else 10.0**ratio
        unit = Noise(1.0, 10.0**other, total * (1.0 - part), total * part / mean_thrust)
        square, log = likelihood(chain, residual, unit, WIDE * max(1.0, 10.0**other))
        assert sizes[index] == pytest.approx(square / 57, rel=1e-6)
        assert scores[index] == pytest.approx(math.log(square / 57) + log / 57, rel=1e-6)
        size = float(sizes[index])
        found = pieces.noise(_Candidate(ratio, part, other, size))
        wanted = [size * one for one in (1.0, 10.0**other, unit.force, unit.thrust)]
        assert [found.velocity, found.position, found.force, found.thrust] == pytest.approx(wanted)
    of_positions, residual = measured((1,))
    alone = _Pieces(of_positions, residual, 1)
    found = alone.noise(_best(alone, [0.0], [0.5], [0.0]))
    assert found.position == found.velocity > 0.0


def test_pieces_end_with_their_stretch() -> None:
    rows, present = _piece_rows(starts_of(450, 0, 120))
    assert rows.shape == present.shape == (200, 3)
    pieces = [rows[present[:, at], at].tolist() for at in range(3)]
    assert pieces == [list(range(120)), list(range(120, 320)), list(range(320, 450))]
    # What is missing repeats the last of the piece.
    assert set(rows[~present].tolist()) == {119, 449}


@pytest.mark.parametrize(("n", "every"), [(7499, 1), (7501, 2), (12501, 3)])
def test_of_a_long_record_some_pieces_do(n: int, every: int) -> None:
    rows, _ = _piece_rows(starts_of(n, 0))
    assert rows[0].tolist() == list(range(0, n, 200 * every))


class Bowl:
    """In the place of pieces: scores with one minimum, and the candidates that were tried, call by call."""

    def __init__(self, ratio: float, part: float) -> None:
        self.ratio, self.part, self.tried = ratio, part, list[tuple[list[float], list[float], set[float]]]()

    def scores(self, ratio: Array, part: Array, other: Array) -> tuple[Array, Array]:
        ratios, parts = (sorted(set(one.round(6).tolist())) for one in (ratio, part))
        assert len(ratio) == len(ratios) * len(parts), "a candidate was tried twice"
        self.tried.append((ratios, parts, set(other.tolist())))
        cost = (ratio - self.ratio) ** 2 + (part - self.part) ** 2
        return array(cost), cost


def steps(first: float, last: float, count: int) -> list[float]:
    return [round(first + (last - first) * at / (count - 1), 6) for at in range(count)]


def test_the_search_goes_through_all_decades_and_then_closer_twice() -> None:
    bowl = Bowl(0.3, 0.44)
    found = _ratio_and_part(bowl, -0.2)  # type: ignore[arg-type]
    assert bowl.tried == [
        (steps(-7.0, 3.0, 11), [0.0, 0.5, 1.0], {-0.2}),
        (steps(-1.0, 1.0, 7), steps(0.1, 0.9, 5), {-0.2}),
        (steps(1 / 3 - 0.25, 1 / 3 + 0.25, 5), steps(0.35, 0.65, 5), {-0.2}),
    ]
    assert found[:2] == pytest.approx((1 / 3, 0.425))


@pytest.mark.parametrize(("ratio", "part"), [(-7.0, 0.0), (3.0, 1.0)])
def test_the_search_stays_within_its_range(ratio: float, part: float) -> None:
    bowl = Bowl(ratio, part)
    assert _ratio_and_part(bowl, 0.0)[:2] == (ratio, part)  # type: ignore[arg-type]
    assert all(-7.0 <= min(ratios) <= max(ratios) <= 3.0 for ratios, _, _ in bowl.tried)
    assert all(0.0 <= min(parts) <= max(parts) <= 1.0 for _, parts, _ in bowl.tried)


def unknowns(found: Noise, mean_thrust: float) -> tuple[float, float]:
    """Ratio, in decades, and share of the thrust of a noise whose velocity is the main channel."""
    total = found.force + found.thrust * mean_thrust
    return math.log10(total / found.velocity), found.thrust * mean_thrust / total


def drawn(noise: Noise, channels: tuple[int, ...], n: int = 150) -> tuple[ErrorDynamics, Array]:
    """Residuals drawn with their full covariance."""
    rng = np.random.default_rng(3)
    chain = error_dynamics_of(n, rng, channels, stiffness=1.0)
    return chain, array(np.linalg.cholesky(covariance_of(chain, noise)) @ rng.standard_normal(n))


@pytest.mark.parametrize("decades", [-1.4, 0.8])
def test_both_channels_have_their_own_noise(decades: float) -> None:
    chain, residual = drawn(Noise(1e-4, 1e-4 * 10.0**decades, 1e-3, 0.0), (0, 1))
    found = fit_noise(chain, residual, Noise(2.0, 2.0))
    # Sought in steps of a fifth of a decade.
    assert math.log10(found.position / found.velocity) == pytest.approx(decades, abs=0.41)
    assert round(5.0 * math.log10(found.position / found.velocity), 6).is_integer()
    ratio, part = unknowns(found, float(chain.thrust.mean()))
    assert ratio == pytest.approx(1.0, abs=0.6)
    pieces = _Pieces(chain, residual, 0)
    here = _of(pieces, [(ratio, part, math.log10(found.position / found.velocity))])[0]
    others = _of(pieces, [(r, p, d) for r in steps(-7.0, 3.0, 21) for p in (0.0, 0.5, 1.0) for d in (-2.0, 0.0, 2.0)])
    assert here < others.min()


def _of(pieces: _Pieces, candidates: Sequence[tuple[float, float, float]]) -> Array:
    return pieces.scores(*(array(one) for one in zip(*candidates, strict=True)))[0]


@pytest.mark.parametrize("decades", [3.0, 5.6])
def test_the_other_channel_moves_by_two_decades_at_most_in_each_of_two_rounds(decades: float) -> None:
    chain, residual = drawn(Noise(1e-4, 1e-4, 0.0, 0.0), (0, 1))
    found = fit_noise(chain, residual, Noise(1.0, 10.0**-decades))
    wanted = 0.0 if decades < 4.0 else 4.0 - decades
    assert math.log10(found.position / found.velocity) == pytest.approx(wanted, abs=0.41 if decades < 4.0 else 1e-9)


def test_velocities_alone_show_nothing_of_positions() -> None:
    chain, residual = drawn(Noise(1e-4, 1.0, 1e-4, 0.0), (0,))
    found = fit_noise(chain, residual, Noise(3.0, 0.6))
    assert found.position / found.velocity == pytest.approx(0.2)


def test_positions_alone_have_one_noise() -> None:
    chain, residual = drawn(Noise(1.0, 4e-6, 0.0, 0.0), (1,), 300)
    found = fit_noise(chain, residual, Noise(1.0, 1e-3))
    assert found.position == pytest.approx(4e-6, rel=0.2)
    assert found.velocity == found.position
    assert found.force + found.thrust * 2.0 < 0.1 * found.position


def test_a_position_whose_noise_is_given_keeps_it() -> None:
    chain, residual = drawn(Noise(1e-4, 4e-6, 1e-3, 0.0), (0, 1))
    before = Noise(3e-4, 6e-6, 1.0, 1.0)
    found = fit_noise(chain, residual, before, given_position=True)
    assert found.position == 6e-6
    ratio, part = unknowns(found, float(chain.thrust.mean()))
    total = 10.0**ratio
    unit = Noise(1.0, 0.02, total * (1.0 - part), total * part / float(chain.thrust.mean()))
    assert found.velocity == pytest.approx(likelihood(chain, residual, unit, WIDE)[0] / len(residual), rel=1e-6)
    alone, residual = drawn(Noise(1.0, 4e-6, 0.0, 0.0), (1,))
    assert fit_noise(alone, residual, before, given_position=True).position == pytest.approx(4e-6, rel=0.4)


FLOORS = (0.0, 0.03, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0)
"""Shares of the force found before, of which the best is taken for each density of the thrust."""


@pytest.mark.parametrize("channels", [(0,), (1,), (0, 1)], ids=["velocity", "position", "both"])
def test_a_profile_is_the_likelihood_of_the_best_force_beside_each_thrust(channels: tuple[int, ...]) -> None:
    noise = Noise(1e-4, 4e-5, 2e-4, 1e-3)
    chain, residual = drawn(noise, channels, 60)
    thrusts = array(np.array([1e-6, 1e-4, 1e-2]))
    costs, forces = disturbance_profile(chain, residual, noise, thrusts)
    total = 2e-4 + 1e-3 * float(chain.thrust.mean())
    main = 1e-4 if 0 in channels else 4e-5
    wide = WIDE * max(main, 4e-5)
    for at, thrust in enumerate(thrusts.tolist()):
        # A force that is there at all has to be worth four.
        tried = [
            sum(likelihood(chain, residual, replace(noise, force=share * total, thrust=thrust), wide))
            + (4.0 if share else 0.0)
            for share in FLOORS
        ]
        assert costs[at] == pytest.approx(min(tried), rel=1e-6)
        assert forces[at] == pytest.approx(FLOORS[int(np.argmin(tried))] * total)


@pytest.mark.parametrize("share", FLOORS)
def test_the_share_of_the_force_that_is_there_is_the_best(share: float) -> None:
    chain, residual = drawn(Noise(1e-6, 1e-6, 2e-3 * share, 0.0), (0,))
    _, forces = disturbance_profile(chain, residual, Noise(1e-6, 1e-6, 2e-3, 0.0), array(np.array([1e-15])))
    assert forces[0] == pytest.approx(2e-3 * share)


def test_the_profile_of_a_long_record_is_that_of_its_pieces_times_their_number() -> None:
    rng = np.random.default_rng(2)
    n = 10_000
    chain = error_dynamics_of(n, rng)
    residual = 0.01 * rng.standard_normal(n)
    used = np.arange(n) % 400 < 200
    own = replace(
        chain, channel=chain.channel[used], starts=starts_of(n, *range(0, n, 400))[used], step_s=chain.step_s[used],
        damping=chain.damping[used], stiffness=chain.stiffness[used], counts=chain.counts[used],
        thrust=chain.thrust[used],
    )  # fmt: skip
    noise, thrusts = Noise(1e-4, 1.0, 1e-4, 1e-4), array(np.array([1e-4, 1e-3]))
    whole, _ = disturbance_profile(chain, array(np.where(used, residual, 1e3)), noise, thrusts)
    parts, _ = disturbance_profile(own, array(residual[used]), noise, thrusts)
    assert whole - 8.0 == pytest.approx(2.0 * parts - 8.0, rel=1e-6)


@pytest.mark.parametrize(("force", "thrust"), [(0.0, 0.0), (1e-4, 0.0), (1e-2, 0.0), (0.0, 1e-2), (1e-3, 1e-3)])
def test_noise_is_found_again(force: float, thrust: float) -> None:
    rng = np.random.default_rng(8)
    n = 4000
    chain = error_dynamics_of(n, rng)
    A, Q = transitions(chain)
    density = force + thrust * chain.thrust
    state = np.array([0.0, 0.0, np.sqrt(density[0] / (2.0 * MEMORY_S)) * rng.standard_normal()])
    residual = np.zeros(n)
    for k in range(n):
        gained = np.linalg.cholesky(Q[k] * density[k] + 1e-18 * np.eye(3))
        state = A[k] @ state + gained @ rng.standard_normal(3)
        residual[k] = state[0] + 0.01 * rng.standard_normal()
    found = fit_noise(chain, residual, Noise(1e-3, 1e-3, 1e-3))
    assert found.velocity == pytest.approx(1e-4, rel=0.1)
    total = float(chain.density(found).mean())
    assert total == pytest.approx(float(density.mean()), rel=0.35, abs=4e-6)
    part = found.thrust * float(chain.thrust.mean()) / max(total, 1e-9)
    if force + thrust > 1e-3:
        assert part == pytest.approx(thrust * float(chain.thrust.mean()) / float(density.mean()), abs=0.3)


def test_a_candidate_whose_filter_diverges_is_never_the_most_likely() -> None:
    rng = np.random.default_rng(1)
    chain = error_dynamics_of(400, rng, damping=-1000.0)
    found = fit_noise(chain, rng.normal(size=400), Noise())
    assert math.isfinite(found.velocity)
    assert found.velocity > 0.1, "no confidence from a sum that is not a number"
