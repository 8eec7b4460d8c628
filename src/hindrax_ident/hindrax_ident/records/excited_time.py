"""The time in which an axis is excited by thrust of its own, in a record that is not divided into maneuvers.

Such a record belongs to all axes. While others are flown, this one is moved by their cross drag, lift and off-diagonal
added mass, and its own small thrust answers them: it is a controller that holds. Minutes of that say little about the
coefficients, and what they say is wrong (closed-loop identification, Ljung 1999 section 13.4).
"""

from collections.abc import Sequence

import numpy as np

from hindrax_ident.arrays import Array, Flags, array, largest
from hindrax_ident.model.thrust_lag import LaggedThrust
from hindrax_ident.records.axis_record import Stretch

STRONG, WEAK = 0.2, 0.05
"""Smallest mean thrust that excites, as a share of the largest: whatever the others do, and where they do less [-]."""
IDLE_AXIS = 0.1
"""An axis whose largest thrust is less than this, of that of its kind, was never flown [-]."""
GRID_S, MEAN_S = 0.1, 0.5
"""Steps and time constant of the mean: holding has spikes, and a maneuver passes zero."""
AROUND_S = 0.5
"""What belongs to an excitation, before it and after the mean has decayed."""
PAUSE_S = 7.0
"""Longest pause within a maneuver: another axis is not flown in so short a time."""
WHOLE = 0.8
"""Share of a record above which all of it belongs to the axis."""
SHORTEST_EXCITATION_S = 5.0
"""An excitation shorter than this, with what belongs to it, is a disturbance that was held."""


def excited_stretches(spans: Sequence[Stretch], t: Array, wrenches: Array, axis: int) -> list[Stretch]:
    """Cut spans to the parts in which the thrust on the axis excites it.

    The thrust at rest is that of the longest time: it holds the net buoyancy.

    Parameters
    ----------
    spans
        In time order.
    t, wrenches : (n,) [s], (n, 6) [N, N m]
        Thrust on all axes, each from its time on.
    axis
        0 to 5.

    Returns
    -------
    list[Stretch]
        All of the spans where the parts are nearly all of their time (WHOLE), or where there are none.
    """
    if not len(t) or not spans:
        return list(spans)
    own = _excitations(t, wrenches, axis, spans)
    parts = [
        Stretch(max(span.start_s, one.start_s), min(span.end_s, one.end_s))
        for span in spans
        for one in own
        if min(span.end_s, one.end_s) - max(span.start_s, one.start_s) > SHORTEST_EXCITATION_S
    ]
    return parts if 0.0 < _duration(parts) < WHOLE * _duration(spans) else list(spans)


def _duration(spans: Sequence[Stretch]) -> float:
    return sum(one.end_s - one.start_s for one in spans)


def _excitations(t: Array, wrenches: Array, axis: int, spans: Sequence[Stretch]) -> list[Stretch]:
    """Times with thrust beyond that at rest, with what belongs to them; how large it is, the spans say alone."""
    times = np.arange(t[0], max(spans[-1].end_s, t[-1]) + GRID_S, GRID_S)
    means = np.stack([_mean_thrust(t, one, times) for one in wrenches.T], axis=1)
    inside = np.any([(times >= one.start_s) & (times <= one.end_s) for one in spans], axis=0)
    most = array([_largest(one) for one in means[inside].T])
    of_kind = np.repeat([most[:3].max(), most[3:].max()], 3)
    shares = np.divide(means, most, out=np.zeros_like(means), where=most > IDLE_AXIS * of_kind)
    own = means[:, axis] / max(1e-12, float(most[axis]))
    others = np.delete(shares, axis, axis=1).max(axis=1)
    acts: Flags = (own > STRONG) | ((own > WEAK) & (own > others))
    runs = np.split(times[acts], np.flatnonzero(np.diff(times[acts]) > PAUSE_S) + 1)
    return [Stretch(float(run[0]) - AROUND_S, float(run[-1]) + AROUND_S) for run in runs if len(run)]


def _largest(mean: Array) -> float:
    """Largest of mean thrusts (n,) that lasts as long as an excitation must: in a day, one may be a hundredth of it."""
    lasts = round(SHORTEST_EXCITATION_S / GRID_S)
    return max(largest(mean), float(np.partition(mean, -lasts)[-lasts]) if len(mean) > lasts else 0.0)


def _mean_thrust(t: Array, thrust: Array, at_s: Array) -> Array:
    """Mean of a thrust beyond that at rest, without its sign: (n,)."""
    order = np.argsort(thrust)
    held = np.cumsum(np.diff(np.append(t, at_s[-1]))[order])
    at_rest = thrust[order][min(len(thrust) - 1, int(np.searchsorted(held, 0.5 * held[-1])))]
    return LaggedThrust(t, np.abs(thrust - at_rest), MEAN_S).force(at_s)
