"""One fit of all six axes: velocities and parameters together, with unknown forces and measurement noise between them.

Unknown are the velocities v of every step and the parameters theta. Wanted is the least of

    sum e' Q^-1 e + sum r^2 / R + (theta - prior)' P (theta - prior),
    w = M v' + C(M) v + ... - tau of each step,  e = what is new in w since the step before (autoregressive),
    r = measured - v of each measurement

(weak-constraint estimation; of the linearized model it is the Kalman smoother, and its theta the most likely one). For
given theta the normal equations of v are banded (`joint_problem`); those of theta are small. Where a mass acts, the
acceleration is the one that the model predicts, not the measured one: noise does not bend it down. Q and R of each axis
are those of the largest restricted likelihood, with traces by one random probe each (MacKay 1992; Hutchinson 1990).
Which cross terms exist is decided in the normal equations, by the evidence of each.

What the record may not judge (gain and exponent of the thrust, inflow, exponent of the drag) stays at its prior and
widens the result (Schmidt 1966), as in `assess.uncertainty_budget`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, Flags, array, largest
from hindrax_ident.fit.joint_problem import (
    DELAYS,
    JointProblem,
    Noise,
    Normal,
    first_noise,
    first_velocities,
    masses,
)
from hindrax_ident.fit.scatter import scatter_inflation
from hindrax_ident.model.model_parameters import bounded
from hindrax_ident.model.motion_model import LEAST_MASS, rigid_mass
from hindrax_ident.model.six_axes import CROSS, DOUBT, OWN, Scales, Term, terms_of
from hindrax_ident.records.six_axis_record import Grid, SixAxisRecord

ROUNDS, LAST_ROUNDS, FEW = 32, 6, 4
"""Most steps over a few stretches, and over all of them."""
BEGIN, STEADY, NOISY, SELECTED = 2, 3, 13, (3, 6, 9, 12, 16)
"""First steps without a predicted acceleration; with the delays at their prior; with the noise as it was; and those
before which cross terms are admitted or left out."""
HELD, MOST_PLATES = 0.7, 4.0
"""Share of the largest thrust that is drag at the highest speed, where a search begins; and the most, as a multiple of
the drag of a plate as large as the vehicle [-]."""
SETTLED, LEFT = 1e-3, 0.5
"""Largest step that ends the fit, of each parameter; and that of a fit that has converged, in its deviations."""
LEAST_DELAY_S = 0.005
"""Change of a delay that does not matter."""
LEAST_ODDS, HYSTERESIS = math.log(20.0), 0.5
"""Logarithm of how much likelier a record has to be with a term than without it (strong evidence, Kass and Raftery
1995), beyond one for each term that could have been chosen; and by how much more for a new one: else two take turns."""
LONGEST_DELAY_STEP_S, HALVINGS = 0.03, 5
"""Largest change of a delay in one step, and of how many halves a step is tried."""


@dataclass(frozen=True, slots=True)
class Delays:
    """Lag of the thrust, latency of velocities, and of rates: priors as values and deviations [s]."""

    means_s: tuple[float, float, float]
    sigmas_s: tuple[float, float, float]

    def terms(self) -> tuple[Term, ...]:
        """Parameters without a force: they move thrust and measurements in time."""
        names = ("thrust lag", "latency of the velocities", "latency of the rates")
        rows = zip(names, self.means_s, self.sigmas_s, (0.0, -math.inf, -math.inf), strict=True)
        return tuple(Term(name, OWN, mean, sigma, "s", lambda _: {}, least) for name, mean, sigma, least in rows)


@dataclass(frozen=True, slots=True)
class JointFit:
    """Parameters (p,) of the terms that are in, their covariance (p, p) by the noise, and what speaks for them.

    `shifts` (p, m): change of the parameters per unit of each of the `doubts`. `odds`: of each cross term, the
    logarithm of how much likelier the record is with it, given the others that are in. `force_sigma` and
    `velocity_sigma`: unknown force and measurement noise by axis.
    """

    axes: tuple[int, ...]
    terms: tuple[Term, ...]
    theta: Array
    covariance: Array
    shifts: Array
    doubts: tuple[Term, ...]
    odds: dict[str, float]
    M: Array
    scales: Scales
    inflation: Array
    force_sigma: Array
    velocity_sigma: Array
    samples: int
    converged: bool
    frequencies: Array
    """Of the thrust by axis, as `SixAxisRecord.frequencies`."""

    def index(self, name: str) -> int:
        """Place of a term; ValueError where it is not in."""
        return [one.name for one in self.terms].index(name)

    @property
    def by_doubt(self) -> Array:
        """Change of the parameters per deviation of each doubt: (p, m)."""
        return self.shifts * [one.sigma for one in self.doubts]


def fit_jointly(
    record: SixAxisRecord,
    vehicle: Vehicle,
    delays: Delays,
    gain_sigma: float,
    progress: Callable[[str], None] = lambda _: None,
) -> JointFit:
    """Fit all axes of a record, and decide by evidence which terms beyond each axis' own act.

    A long record is fitted over a few stretches first: the fit of all of it begins where those end.

    Parameters
    ----------
    record
        Velocities, depth, thrust and attitude of all axes.
    vehicle
        Mass, inertia and thrusters: scales and priors of the terms.
    delays
        Prior lag and latencies [s].
    gain_sigma : [-]
        Standard deviation of the gain of the wrench.
    progress
        Called with a sentence about what begins.

    Returns
    -------
    JointFit
        Terms that stay, their values and covariance, and the odds of each that might.

    Raises
    ------
    ValueError
        Where fewer than two axes were moved and measured.
    """
    if len(record.axes) < 2:
        raise ValueError("fewer than two axes were moved and measured: such a record is fitted axis by axis")
    search = _begun(record, vehicle, delays, gain_sigma)
    few = replace(record, grids=_spread(record.grids, FEW))
    velocities = [first_velocities(few, grid) for grid in few.grids]
    for index in range(ROUNDS):
        progress(f"all axes together, step {index + 1}")
        search, velocities = _advanced(few, search, velocities, index, selects=index in SELECTED)
        if index > max(SELECTED) and np.all(np.abs(search.step) <= SETTLED * np.abs(search.theta)):
            break
    if len(few.grids) < len(record.grids):
        velocities = [first_velocities(record, grid) for grid in record.grids]
        for index in range(LAST_ROUNDS):
            progress(f"all axes together, whole record, step {index + 1}")
            search, velocities = _advanced(record, search, velocities, ROUNDS, selects=index == 1)
    return _result(record, search, velocities)


@dataclass(frozen=True, slots=True)
class _Search:
    """Where the search of the parameters is: values (p,), which terms are in, and the noise."""

    vehicle: Vehicle
    delays: Delays
    gain_sigma: float
    scales: Scales
    terms: tuple[Term, ...]
    theta: Array
    kept: Flags
    noise: Noise
    odds: dict[str, float]
    step: Array
    """The last one: (p,)."""

    def column(self, name: str) -> Array:
        """A number of each term: (p,)."""
        return array([getattr(term, name) for term in self.terms])

    def of_kind(self, kind: str) -> Flags:
        """Which terms are of a kind: (p,)."""
        return np.array([term.kind == kind for term in self.terms])

    def problem(self, record: SixAxisRecord) -> JointProblem:
        """A record where the search is."""
        return JointProblem(record, self.terms, self.theta, self.kept, self.noise)


def _begun(record: SixAxisRecord, vehicle: Vehicle, delays: Delays, gain_sigma: float) -> _Search:
    """Everything at its prior, without cross terms."""
    pull = array([largest(one) for one in record.wrench.T])
    scales = Scales(pull, array([_highest(record, axis) for axis in range(6)]))
    terms = (*delays.terms(), *terms_of(vehicle, record.axes, scales, gain_sigma, np.zeros(6)))
    theta = array([term.mean for term in terms])
    for place, term in enumerate(terms):
        if term.drag_power == 2:
            # Drag begins near what holds the highest thrust at the highest speed: that of a plate may be far off.
            held = HELD * float(pull[term.drag_axis]) / max(1e-6, float(scales.speed[term.drag_axis])) ** 2
            theta[place] = min(held, MOST_PLATES * term.mean)
    kept = np.array([term.kind != CROSS for term in terms])
    return _Search(
        vehicle,
        delays,
        gain_sigma,
        scales,
        terms,
        theta,
        kept,
        first_noise(record, pull),
        {},
        np.full(len(terms), math.inf),
    )


def _highest(record: SixAxisRecord, axis: int) -> float:
    """Highest speed of an axis, by the depth where no velocity of heave was measured [m/s, rad/s]."""
    y, depth = record.velocities[axis].y, record.depth
    if not len(y) and axis == 2 and len(depth):
        times = np.arange(depth.t[0], depth.t[-1], 0.5)
        y = np.diff(np.interp(times, depth.t, depth.y)) / 0.5
    return largest(y)


def _spread(grids: tuple[Grid, ...], count: int) -> tuple[Grid, ...]:
    """A few stretches, evenly spread."""
    chosen = np.unique(np.linspace(0, len(grids) - 1, min(count, len(grids))).round().astype(int))
    return tuple(grids[index] for index in chosen.tolist())


def _advanced(
    record: SixAxisRecord, search: _Search, velocities: list[Array], index: int, *, selects: bool
) -> tuple[_Search, list[Array]]:
    """One Gauss-Newton step of parameters and velocities, shortened where it does not help, and one of the noise."""
    normal = search.problem(record).normal(velocities, all_terms=selects, as_measured=index < BEGIN)
    means, sigmas, least = (search.column(name) for name in ("mean", "sigma", "least"))
    if selects:
        kept, odds = _admitted(search, normal)
        search = replace(search, kept=kept, odds=odds, theta=array(np.where(kept, search.theta, means)))
    problem, theta, doubts = search.problem(record), search.theta, search.of_kind(DOUBT)
    own = np.flatnonzero(search.kept & ~doubts)
    # Delays stay until masses and drag are about right: before, they would explain what is wrong with those.
    own = own if index >= STEADY else own[own >= DELAYS]
    prior = 1.0 / sigmas[own] ** 2
    # Doubts are not among them: the record may not judge them, and they only widen what is found.
    C = array(np.linalg.inv(normal.S[np.ix_(own, own)] + np.diag(prior)))
    wanted = theta.copy()
    wanted[own] = bounded(
        array(theta[own] + C @ (normal.s[own] + prior * (means[own] - theta[own]))), C, least[own].tolist()
    )
    step = _within_masses(search, array(wanted - theta))
    step = array(step * min(1.0, LONGEST_DELAY_STEP_S / max(1e-9, float(np.abs(step[:DELAYS]).max()))))
    M = masses(search.terms, theta)
    before, trial, tried = problem.cost(velocities, M, (means, sigmas)), problem, velocities
    for halving in range(HALVINGS):
        # Half steps in the end: where a measurement is at a step, a delay has a kink, and whole ones would alternate.
        share = 0.5 ** (halving + (index > max(SELECTED)))
        trial = replace(problem, theta=array(theta + share * step))
        tried = [
            array(v + (share * (dv[:, 0] - dv[:, 1:] @ step)).reshape(v.shape))
            for v, dv in zip(velocities, normal.steps, strict=True)
        ]
        # The first steps may make it worse: the motion as measured has errors that no model reaches.
        if index < BEGIN or trial.cost(tried, M, (means, sigmas)) <= before:
            break
    noise = search.noise
    if index >= NOISY:
        # Not before the model explains something: else its lack would be taken for noise, and stay.
        noise = noise.updated(trial.squares(tried), normal.free, trial.memory(tried))
    terms = search.terms
    if selects or index < BEGIN:
        drags = _drags(terms, trial.theta, search.scales)
        fresh = terms_of(search.vehicle, record.axes, search.scales, search.gain_sigma, drags)
        terms = (*search.delays.terms(), *fresh)
    return replace(search, theta=trial.theta, noise=noise, step=array(trial.theta - theta), terms=terms), tried


def _drags(terms: Sequence[Term], theta: Array, scales: Scales) -> Array:
    """Drag of each axis at its highest speed, (6,) [N, N m]; in heave the mean of both directions."""
    out = np.zeros(6)
    for term, value in zip(terms, theta.tolist(), strict=True):
        if term.drag_power:
            part = 0.5 if term.drag_axis == 2 else 1.0
            out[term.drag_axis] += part * value * scales.speed[term.drag_axis] ** term.drag_power
    return out


def _within_masses(search: _Search, step: Array) -> Array:
    """The step, shortened until M less half of the body's is positive definite: no other motion is possible."""
    axes = sorted({term.mass[0] for term in search.terms if term.mass})
    block, rigid = np.ix_(axes, axes), np.diag([rigid_mass(search.vehicle, axis) for axis in range(6)])
    for _ in range(30):
        left = (masses(search.terms, search.theta + step) - LEAST_MASS * rigid)[block]
        if np.linalg.eigvalsh(left).min() > 0.0:
            return step
        step = array(0.5 * step)
    return array(np.zeros_like(step))


def _admitted(search: _Search, normal: Normal) -> tuple[Flags, dict[str, float]]:
    """Which terms stay, and the odds of each cross term: the best is added until none is needed, others then leave."""
    means, sigmas, least = (search.column(name) for name in ("mean", "sigma", "least"))
    cross, prior = search.of_kind(CROSS), 1.0 / sigmas**2
    # Right side of the normal equations about the prior means.
    b = normal.s + normal.S @ (search.theta - means)

    def odds(kept: Flags) -> tuple[Array, Array]:
        """Logarithm of the odds of each term, given the others that are in, and its value then: (p,) each.

        For one term more, or one less, the evidence of a linear model follows from its value and its deviation.
        """
        own, rest = np.flatnonzero(kept), np.flatnonzero(~kept)
        # One inverse serves all terms: one less is in its diagonal, one more is a rank-one step from it.
        V = np.linalg.inv(normal.S[np.ix_(own, own)] + np.diag(prior[own]))
        values, known = np.zeros(len(b)), np.ones(len(b))
        values[own], known[own] = V @ b[own], 1.0 / np.diag(V)
        across = normal.S[np.ix_(rest, own)]
        known[rest] = np.diag(normal.S)[rest] + prior[rest] - np.sum(across @ V * across, axis=1)
        values[rest] = (b[rest] - across @ values[own]) / known[rest]
        return 0.5 * values**2 * known - 0.5 * np.log(known / prior), values + means

    kept, least_odds = ~cross, LEAST_ODDS + math.log(max(1, int(cross.sum())))
    for _ in range(3 * int(cross.sum())):
        found, values = odds(kept)
        leaves = np.where(cross & kept, found, math.inf)
        # A term whose value would be beyond its bound does not enter: at the bound it would explain nothing.
        enters = np.where(cross & ~kept & (values >= least), found, -math.inf)
        if leaves.min() < least_odds:
            kept[int(leaves.argmin())] = False
        elif enters.max() > least_odds + HYSTERESIS:
            kept[int(enters.argmax())] = True
        else:
            break
    found, _ = odds(kept)
    return kept, {search.terms[place].name: float(found[place]) for place in np.flatnonzero(cross).tolist()}


def _result(record: SixAxisRecord, search: _Search, velocities: list[Array]) -> JointFit:
    """Covariance, shifts by what the record may not judge, and convergence of a search that has ended.

    With S the information of the record and C the inverse of S plus that of the prior, C S C is the part of C that is
    noise: it is widened where blocks scatter more. A doubt that is one deviation off moves the parameters by -C S_d
    times that, S_d being its columns of S (Schmidt: considered, not estimated).
    """
    normal = search.problem(record).normal(velocities)
    sigmas, doubts = search.column("sigma"), search.of_kind(DOUBT)
    own, doubted = np.flatnonzero(search.kept & ~doubts), np.flatnonzero(doubts)
    S = normal.S[np.ix_(own, own)]
    C = array(np.linalg.inv(S + np.diag(1.0 / sigmas[own] ** 2)))
    noise_of, shares = array(C @ S @ C), [array(one[np.ix_(own, own)]) for one in normal.shares]
    inflation = scatter_inflation(array(normal.scores[:, own]), shares, C, noise_of)
    covariance = array(C - noise_of + noise_of * np.outer(inflation, inflation))
    shifts = array(-C @ normal.S[np.ix_(own, doubted)])
    left = LEFT * np.sqrt(np.diag(covariance) + np.sum((shifts * sigmas[doubted]) ** 2, axis=1))
    left[:DELAYS] = np.maximum(left[:DELAYS], LEAST_DELAY_S)
    noise, axes = search.noise, len(record.axes)
    return JointFit(
        axes=record.axes,
        terms=tuple(search.terms[place] for place in own),
        theta=array(search.theta[own]),
        covariance=covariance,
        shifts=shifts,
        doubts=tuple(search.terms[place] for place in doubted),
        odds=search.odds,
        M=masses(search.terms, array(np.where(search.kept, search.theta, 0.0))),
        scales=search.scales,
        inflation=inflation,
        force_sigma=array(np.sqrt(noise.force / (1.0 - noise.kept**2))[:axes]),
        velocity_sigma=array(np.sqrt(noise.velocity)[:axes]),
        samples=sum(len(record.velocities[axis]) for axis in record.axes),
        converged=bool(np.all(np.abs(search.step[own]) < left)),
        frequencies=array([record.frequencies(axis) for axis in record.axes]),
    )
