"""How unsteady the thrusters are, from all motions of a run together.

Gusts of the thrust are the same in every motion, because the thrusters are. A gyroscope shows them in a minute; a
Doppler log hardly does. So each motion says how likely it finds each density, and the most likely of all serves every
motion, but those that contradict it.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.stats import chi2

from hindrax_ident.arrays import Array, array
from hindrax_ident.likelihood import GustProfile, gust_profile
from hindrax_ident.problem import chain_of
from hindrax_ident.refine import Fit
from hindrax_ident.whitening import Noise

BEYOND = 3.0
"""Factor beyond the densities that were found up to which a common one is sought."""
POINTS = 24
CHANCE = 1e-4
"""Probability with which a motion that has the common density may be left out."""


def common_noise(fits: Mapping[int, Fit]) -> dict[int, Noise]:
    """Noise of each axis with the density that all have in common; axes that contradict it are left out."""
    found = [fit.noise.thrust for fit in fits.values() if fit.noise.thrust > 0.0]
    if len(fits) < 2 or not found:
        return {}
    tried = array(np.geomspace(min(found) / BEYOND, max(found) * BEYOND, POINTS))
    profiles = {axis: _profile(fit, tried) for axis, fit in fits.items()}
    limit = float(chi2.isf(CHANCE, 1))
    while len(profiles) > 1:
        total = np.sum([one.cost for one in profiles.values()], axis=0)
        best = int(np.argmin(total))
        excess = {axis: float(one.cost[best] - one.cost.min()) for axis, one in profiles.items()}
        worst = max(excess, key=lambda axis: excess[axis])
        if excess[worst] <= limit:
            thrust = _lowest(np.log(tried), total, best)
            return {axis: _with(fits[axis].noise, float(one.force[best]), thrust) for axis, one in profiles.items()}
        del profiles[worst]
    return {}


def _profile(fit: Fit, tried: Array) -> GustProfile:
    chain = chain_of(fit.problem, fit.theta, fit.linear.path)
    return gust_profile(chain, fit.linear.raw, fit.noise, tried)


def _lowest(x: Array, y: Array, at: int) -> float:
    """Exponential of where a parabola through the lowest point and its neighbors is lowest."""
    if not 0 < at < len(x) - 1:
        return float(np.exp(x[at]))
    step, (before, here, after) = float(x[1] - x[0]), y[at - 1 : at + 2].tolist()
    return float(np.exp(x[at] + 0.5 * step * (before - after) / (before - 2.0 * here + after)))


def _with(noise: Noise, force: float, thrust: float) -> Noise:
    return Noise(noise.velocity, noise.position, force, thrust)
