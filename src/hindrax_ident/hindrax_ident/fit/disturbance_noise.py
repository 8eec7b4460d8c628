"""Thrust noise density common to all motions of a run.

Thrust noise is the same in every motion, because the thrusters are. A gyroscope shows it within a minute, a Doppler
log hardly. So the likelihoods of all motions are combined, and the most likely density is used for every motion that
does not contradict it.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.fit.noise_likelihood import disturbance_profile
from hindrax_ident.fit.output_error import OutputErrorFit
from hindrax_ident.fit.output_error_problem import error_dynamics_of
from hindrax_ident.fit.whitening import Noise

SEARCH_FACTOR = 3.0
"""Factor beyond the individual densities up to which a common one is sought."""
POINTS = 24
CHANCE_OF_EXCLUSION = 1e-4
"""Probability of excluding a motion that has the common density."""


def common_noise(fits: Mapping[int, OutputErrorFit]) -> dict[int, Noise]:
    """Noise of each axis with the common thrust noise density; axes that contradict it are omitted."""
    found = [fit.noise.thrust for fit in fits.values() if fit.noise.thrust > 0.0]
    if len(fits) < 2 or not found:
        return {}
    tried = array(np.geomspace(min(found) / SEARCH_FACTOR, max(found) * SEARCH_FACTOR, POINTS))
    chains = {axis: error_dynamics_of(fit.problem, fit.theta, fit.linear.path) for axis, fit in fits.items()}
    profiles = {axis: disturbance_profile(chains[axis], fit.linear.raw, fit.noise, tried) for axis, fit in fits.items()}
    from scipy.special import chdtri  # noqa: PLC0415  # slow, and the live estimate does without

    limit = float(chdtri(1, CHANCE_OF_EXCLUSION))
    while len(profiles) > 1:
        total = np.sum([cost for cost, _ in profiles.values()], axis=0)
        best = int(np.argmin(total))
        excess = {axis: float(cost[best] - cost.min()) for axis, (cost, _) in profiles.items()}
        worst = max(excess, key=lambda axis: excess[axis])
        if excess[worst] <= limit:
            thrust = _parabola_minimum(np.log(tried), total, best)
            return {
                axis: replace(fits[axis].noise, force=float(force[best]), thrust=thrust)
                for axis, (_, force) in profiles.items()
            }
        del profiles[worst]
    return {}


def _parabola_minimum(x: Array, y: Array, at: int) -> float:
    """Exponential of the minimum of a parabola through the lowest point and its neighbors."""
    if not 0 < at < len(x) - 1:
        return float(np.exp(x[at]))
    step, (before, here, after) = float(x[1] - x[0]), y[at - 1 : at + 2].tolist()
    return float(np.exp(x[at] + 0.5 * step * (before - after) / (before - 2.0 * here + after)))
