"""Masses that the axes of one record take from each other, where each axis is fitted in a session of its own.

Coriolis forces couple the axes by their total masses (`model.coriolis`). The session of a maneuver fits all axes, and
has them. A session of one axis has the usual ratio to the body's instead, which is enough where one axis moves after
the other. Where a pilot moves several at once, that makes forces wrong by as much as the drag, which is then fitted to
them: so the axes are fitted again with the masses that the others found, until these stay.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

from hindrax_core.vehicle import Vehicle
from hindrax_ident.assess.assessment import Assessment
from hindrax_ident.model.coriolis import USUAL_MASS_RATIO, USUAL_MASS_RATIO_SIGMA
from hindrax_ident.model.motion_model import rigid_mass
from hindrax_ident.online.session import Outcome
from hindrax_ident.records.axis_record import LEAST_COUPLING

STAYS = 0.05
"""Change of a mass, as a share of it, that is none [-]."""
WITHIN = 0.5
"""The same as a share of its standard deviation, which the uncertainty of the other axes' drag contains [-]."""
MOST_PASSES = 4
FoundMasses: TypeAlias = Mapping[int, tuple[float, float]]
"""Axis -> its total mass and the standard deviation of it [kg, kg m^2]."""


def with_found_masses(vehicle: Vehicle, fit_all: Callable[[FoundMasses], Sequence[Outcome]]) -> Sequence[Outcome]:
    """Fit the axes of a record, each by itself, and again with each other's masses where they move together.

    Parameters
    ----------
    vehicle
        Whose body no total mass is below.
    fit_all
        Fits all axes with the masses of some of them, and with the usual ratio for the others.

    Returns
    -------
    Sequence[Outcome]
        Of the last fit, which is the first where the axes hardly moved together.
    """
    outcomes, masses = fit_all({}), dict[int, tuple[float, float]]()
    if not any(one.record.coupling > LEAST_COUPLING for one in _assessed(outcomes).values()):
        return outcomes
    for _ in range(MOST_PASSES):
        # What one pass knew and the next does not is known still.
        found = masses | _found(vehicle, _assessed(outcomes))
        used = {axis: USUAL_MASS_RATIO * rigid_mass(vehicle, axis) for axis in found}
        used |= {axis: mass for axis, (mass, _) in masses.items()}
        if all(_stays(used[axis], *one) for axis, one in found.items()):
            break
        masses, outcomes = found, fit_all(found)
    return outcomes


def _stays(used: float, mass: float, sigma: float) -> bool:
    """Whether a mass is that which was used, as far as it counts and as far as it is known."""
    return abs(mass - used) <= max(STAYS * used, WITHIN * sigma)


def _assessed(outcomes: Sequence[Outcome]) -> dict[int, Assessment]:
    return {axis: one for outcome in outcomes for axis, one in outcome.assessments.items()}


def _found(vehicle: Vehicle, assessments: Mapping[int, Assessment]) -> dict[int, tuple[float, float]]:
    """Masses that a record knows better than the usual ratio does; none is below that of the body."""
    found = {}
    for axis, one in assessments.items():
        rigid = rigid_mass(vehicle, axis)
        mass = max(rigid, float(one.fit.theta[-1]))
        sigma = math.sqrt(max(0.0, float(one.calibrated[-1, -1])))
        if one.fit.converged and sigma < USUAL_MASS_RATIO_SIGMA * rigid:
            found[axis] = mass, sigma
    return found
