"""What is true of the coefficients in a world, for a reader to hold results against."""

from hindrax_ident.assess.results import truth_of
from hindrax_sim.conditions.realization import Realization

UNPULLED = ("heave_up", "heave_down")
"""Motions along which a horizontal tether does not pull."""


def known_coefficients(world: Realization) -> dict[str, dict[str, float]]:
    """True coefficients by motion, without those that have no true value.

    The constant force `b` is zero of a horizontal axis, and that of the trim in roll and pitch; but a tether pulls
    with a force that changes with the place, and no one number is true of both.

    Parameters
    ----------
    world
        With all its conditions.

    Returns
    -------
    dict[str, dict[str, float]]
        By motion and name, as k_q of surge; SI units.
    """
    return {
        motion: {
            name: value for name, value in coefficients.items() if name != "b" or motion in UNPULLED or not world.pulled
        }
        for motion, coefficients in truth_of(world.described()).items()
    }
