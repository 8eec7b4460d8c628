"""The size of a pattern without wrench, against a search over all sizes."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from hindrax_control.allocation.deadband_bias import DeadbandBias
from hindrax_control.allocation.effectiveness import NullPattern, patterns

SHARES = (1.0, -0.5, 0.8)
PATTERN = NullPattern(tuple(zip((0, 2, 3), SHARES, strict=True)))
LIMITS_N = [(-8.0, 10.0), (0.0, 0.0), (-12.0, 9.0), (-7.0, 11.0)]
GAPS_N = [(-1.2, 1.5), (0.0, 0.0), (-1.0, 1.0), (-0.8, 1.3)]
PREFERRED_N, HOP_N = 2.0, 1.0
SIZES_N = np.linspace(-40.0, 40.0, 8001)
FINE_N = 1e-2
"""Step of the search."""

forces = st.tuples(*[st.floats(-9.0, 9.0)] * 4)


def biases(hop_N: float = HOP_N) -> DeadbandBias:
    return DeadbandBias(PATTERN, LIMITS_N, GAPS_N, PREFERRED_N, hop_N)


def distances(forces_N: tuple[float, ...]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """By how much each size leaves the limits, and by how much it falls into a gap; at most zero: not at all."""
    outside, inside = np.full(SIZES_N.shape, -math.inf), np.full(SIZES_N.shape, -math.inf)
    for index, share in PATTERN.shares:
        force = forces_N[index] + share * SIZES_N
        (least, most), (back, forth) = LIMITS_N[index], GAPS_N[index]
        outside = np.maximum(outside, np.maximum(least - force, force - most))
        inside = np.maximum(inside, np.minimum(force - back, forth - force))
    return outside, inside


def size_of(before: tuple[float, ...], after: list[float]) -> float:
    """The size that was added; all thrusters must agree on it, and the others stay."""
    assert after[1] == before[1]
    sizes = [(after[index] - before[index]) / share for index, share in PATTERN.shares]
    assert sizes == pytest.approx([sizes[0]] * 3, abs=1e-9)
    return sizes[0]


@given(forces)
def test_the_preferred_size_is_taken_exactly_where_it_works(forces_N: tuple[float, ...]) -> None:
    outside, inside = distances(forces_N)
    at = int(np.argmin(np.abs(SIZES_N - PREFERRED_N)))
    assume(abs(outside[at]) > 1e-9 and abs(inside[at]) > 1e-9)
    changed = list(forces_N)
    works = biases().add_preferred(changed)
    assert works is bool(outside[at] < 0.0 and inside[at] < 0.0)
    assert size_of(forces_N, changed) == pytest.approx(PREFERRED_N if works else 0.0)


def least_distance(sizes_N: NDArray[np.floating[Any]]) -> float:
    """Of the preferred size to the nearest of these; infinite to none."""
    return float(np.min(np.abs(sizes_N - PREFERRED_N), initial=math.inf))


@given(forces)
@example((0.0, 0.0, 0.0, -2.375))  # two gaps overlap by 0.03 N: to a search of 0.01 N there is room between them
def test_without_a_hop_the_nearest_size_that_works_is_taken(forces_N: tuple[float, ...]) -> None:
    outside, inside = distances(forces_N)
    changed = list(forces_N)
    if biases(hop_N=0.0).add_nearest(changed, PREFERRED_N):
        size = size_of(forces_N, changed)
        strict = SIZES_N[(outside <= 0.0) & (inside <= 0.0)]
        loose = SIZES_N[(outside <= FINE_N) & (inside <= FINE_N)]
        within = SIZES_N[outside <= FINE_N]
        least, most = (least_distance(one if len(one) else within) for one in (loose, strict))
        if len(strict) or not len(loose):
            assert abs(size - PREFERRED_N) < most + 5 * FINE_N
        assert abs(size - PREFERRED_N) > least - 5 * FINE_N
        at = int(np.argmin(np.abs(SIZES_N - size)))
        assert outside[at] < 2 * FINE_N
        assert not len(strict) or inside[at] < 2 * FINE_N
    else:
        assert np.min(outside) > -FINE_N
        assert changed == list(forces_N)


@given(forces, st.floats(-12.0, 12.0))
def test_a_size_is_left_only_for_a_gain_of_more_than_a_hop(forces_N: tuple[float, ...], previous_N: float) -> None:
    nearest, kept, again = (list(forces_N) for _ in range(3))
    assume(biases(hop_N=0.0).add_nearest(nearest, PREFERRED_N))
    biases().add_nearest(kept, previous_N)
    chosen = size_of(forces_N, kept)
    assert abs(chosen - PREFERRED_N) <= abs(size_of(forces_N, nearest) - PREFERRED_N) + HOP_N + 1e-6
    biases().add_nearest(again, chosen)
    assert size_of(forces_N, again) == pytest.approx(chosen, abs=1e-6), "where it is, it stays"


@pytest.mark.parametrize(
    ("forces_N", "previous_N", "wanted"),
    [
        # Blocked between -0.1 and 4.5 by two thrusters: the lower end is nearer, but by less than a hop.
        ((-1.1, -3.3), 1.0, -0.1), ((-1.1, -3.3), 2.0, -0.1), ((-1.1, -3.3), 3.0, 4.5),
        # Between -0.5 and 4.1: the upper end is.
        ((-0.7, -2.9), 1.0, -0.5), ((-0.7, -2.9), 2.0, 4.1), ((-0.7, -2.9), 3.0, 4.1),
    ],
)  # fmt: skip
def test_it_stays_on_the_side_on_which_it_was(forces_N: tuple[float, float], previous_N: float, wanted: float) -> None:
    bias = DeadbandBias(
        NullPattern(((0, 1.0), (1, 1.0))), [(-9.0, 9.0)] * 2, [(-1.2, 1.2)] * 2, preferred_N=2.0, hop_N=1.0
    )
    changed = list(forces_N)
    assert bias.add_nearest(changed, previous_N)
    assert changed[0] - forces_N[0] == pytest.approx(wanted)


@pytest.mark.parametrize(("previous_N", "wanted"), [(0.0, 4.0), (4.5, 4.0), (7.0, 7.0), (8.0, 7.0)])
def test_it_stays_in_its_stretch_where_limits_keep_it_from_the_preferred_size(previous_N: float, wanted: float) -> None:
    # The one thruster wants 4 to 12 N, and the other is in its gap between 5 and 7 N.
    bias = DeadbandBias(
        NullPattern(((0, 1.0), (1, 1.0))), [(4.0, 12.0), (-20.0, 20.0)], [(0.0, 0.0), (-1.0, 1.0)], 2.0, hop_N=4.0
    )
    changed = [0.0, -6.0]
    assert bias.add_nearest(changed, previous_N)
    assert changed == pytest.approx([wanted, wanted - 6.0])


@pytest.mark.parametrize(("previous_N", "wanted"), [(-3.0, -3.0), (-1.0, 0.0), (0.0, 0.0)])
def test_a_stretch_that_is_held_at_its_very_end_is_held(previous_N: float, wanted: float) -> None:
    # All below the preferred size: -8 to -3, and -1 to 0.
    bias = DeadbandBias(
        NullPattern(((0, 1.0), (1, 1.0))), [(-8.0, 0.0), (-20.0, 20.0)], [(0.0, 0.0), (-1.0, 1.0)], 2.0, hop_N=4.0
    )
    changed = [0.0, 2.0]
    assert bias.add_nearest(changed, previous_N)
    assert changed == pytest.approx([wanted, 2.0 + wanted])


def test_one_size_alone_within_limits_is_taken() -> None:
    bias = DeadbandBias(NullPattern(((0, 1.0), (1, -1.0))), [(-3.0, 5.0), (-4.0, 4.0)], [(0.0, 0.0)] * 2, 0.0, 0.0)
    changed = [8.0, 1.0]  # 3 less of the one, and 3 more of the other
    assert bias.add_nearest(changed, 0.0)
    assert changed == pytest.approx([5.0, 4.0])
    changed = [8.0, 1.001]
    assert not bias.add_nearest(changed, 0.0)
    assert changed == [8.0, 1.001]


def test_the_size_of_a_pattern_in_forces_is_their_projection() -> None:
    given_N = [3.0, 7.0, -1.5, 2.4]
    assert PATTERN.size_in(given_N) == pytest.approx(3.0)
    across = [0.5, -9.0, 1.0, 0.0]
    assert PATTERN.size_in([a + b for a, b in zip(given_N, across, strict=True)]) == pytest.approx(3.0)


def test_patterns_are_all_that_has_no_wrench() -> None:
    rng = np.random.default_rng(8)
    for rows, columns in ((6, 8), (3, 8), (6, 4), (1, 2)):
        B = rng.standard_normal((rows, columns))
        found = patterns(B)
        assert len(found) == max(0, columns - rows)
        for one in found:
            vector = np.zeros(columns)
            for index, share in one.shares:
                vector[index] = share
            assert B @ vector == pytest.approx(np.zeros(rows), abs=1e-9)
            assert np.max(np.abs(vector)) == pytest.approx(1.0)
            assert np.max(vector) == pytest.approx(1.0)
    assert patterns(np.zeros((6, 0))) == ()
    assert len(patterns(np.zeros((6, 3)))) == 3


def test_patterns_take_few_thrusters() -> None:
    # Two pairs of twins and a fifth one: each pair against each other, and nobody else.
    B = np.array([[1.0, 2.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0, 0.0], [0.0, 0.0, 0.0, 0.0, 1.0]])
    shares = sorted(tuple(sorted(one.shares)) for one in patterns(B))
    assert [[index for index, _ in one] for one in shares] == [[0, 1], [2, 3]]
    assert shares[0][0][1] / shares[0][1][1] == pytest.approx(-2.0)
    assert [share for _, share in shares[1]] == pytest.approx([1.0, 1.0])


def test_a_preferred_size_beyond_the_limits_gives_the_nearest_one_within_them() -> None:
    one = DeadbandBias(NullPattern(((0, 1.0),)), [(-10.0, 1.5)], [(-1.0, 1.0)], 2.0, 0.0)
    forces_N = [0.0]
    assert one.add_nearest(forces_N, 2.0)
    assert forces_N == [1.5]
