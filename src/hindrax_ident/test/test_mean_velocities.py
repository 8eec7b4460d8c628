"""Velocities that are means over time: predicted from velocity and position on the grid of a fit."""

import numpy as np
import pytest

from hindrax_ident.arrays import array
from hindrax_ident.fit.mean_velocities import mean_velocities

T = array(np.linspace(0.0, 2.0, 21))
STATES = np.stack([1.0 + 2.0 * T, T + T**2], axis=1)
"""Velocity and position (n, 2) of an even acceleration."""
EDGES = np.array([[0, 0, 0], [20, 20, 20]])


@pytest.mark.parametrize("over_s", [0.04, 0.1, 0.37])
def test_the_mean_of_an_even_acceleration_is_its_middle(over_s: float) -> None:
    t = array(np.array([0.313, 1.0, 1.51]))
    assert mean_velocities(t, T, EDGES, over_s).of(STATES) == pytest.approx(1.0 + 2.0 * t)


def test_a_mean_ends_with_its_stretch() -> None:
    """A filter knows nothing of what was before the record: at its ends the mean is of what there is."""
    t = array(np.array([0.0, 1.0, 2.0]))
    assert mean_velocities(t, T, EDGES, 0.5).of(STATES) == pytest.approx([1.25, 3.0, 4.75])
    inner = np.array([[5, 5, 5], [15, 15, 15]])
    assert mean_velocities(array(np.array([0.5, 1.0, 1.5])), T, inner, 0.5).of(STATES) == pytest.approx(
        [2.25, 3.0, 3.75]
    )


def test_derivatives_are_means_as_the_velocity_is() -> None:
    means = mean_velocities(array(np.array([0.7, 1.1])), T, EDGES[:, :2], 0.3)
    table = np.stack([STATES, 3.0 * STATES], axis=2)
    assert means.of(table) == pytest.approx(np.outer(means.of(STATES), [1.0, 3.0]))
