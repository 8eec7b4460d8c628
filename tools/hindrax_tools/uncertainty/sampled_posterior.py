"""The linearized uncertainty budget against a posterior sampled over the nonlinear model, record by record.

    pip install emcee
    python -m hindrax_tools.uncertainty.sampled_posterior --records 10 [--world pool] [--json]

A record is a flight of one motion in lock-step, in a world that the model does not have. Sampled are parameters and
influences together, by affine-invariant walkers (Goodman and Weare 2010; emcee 3), where the budget has a linearization
and a mixture of normal distributions:

- the motion is simulated anew for each draw, with the effects of all influences along its own path, lag and latency as
  delays, and initial conditions that fit best;
- priors are as they are: Student's, losses anywhere between nothing and their greatest, and one unknown water for all;
- what the residuals may not judge is drawn from its prior, and the parameters fitted again with it, by the model.

Noise and whitening are those of the fit, in both.
"""

import argparse
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property

import numpy as np

from hindrax_analysis.terminal import print_table
from hindrax_bringup.share_files import share_folder
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import load_vehicle
from hindrax_ident.arrays import Array, Flags, array
from hindrax_ident.assess.assessment import Assessment
from hindrax_ident.assess.axis_fit import AxisFit
from hindrax_ident.assess.influences import LAG, LATENCY, OTHER_AXES
from hindrax_ident.assess.posterior import NORMAL_SHARE
from hindrax_ident.assess.uncertainty_budget import FREEDOM, NEAR_ODDS
from hindrax_ident.fit.output_error_problem import LinearizedProblem, linearize
from hindrax_ident.fit.scores import noise_ratio
from hindrax_ident.model.simulation import per_step, trajectory
from hindrax_sim.conditions.world_table import POOL
from hindrax_sim.flights.pool_flight import fly

MOTIONS = ("surge", "sway", "heave", "roll", "yaw")
"""Flown in turn, one per record."""
WALKERS_PER_UNKNOWN, STEPS, BURN_SHARE = 3, 150, 0.4
FULL_DRAWS, REFITS = 300, 3
"""Draws in which what the record may not judge is added, and Gauss-Newton steps of each."""
DELAYS = (LAG, LATENCY)


class Target:
    """Logarithm of the density of parameters and influences, (p + j,), of one assessed axis.

    Influences are the j that the residuals may judge, in their prior deviations; the others are zero.
    """

    def __init__(self, assessment: Assessment) -> None:
        self.fit, self.budget = assessment.fit, assessment.budget
        self.case: AxisFit = replace(self.budget.case, fit=self.fit)
        self.p, m = len(self.fit.theta), self.budget.shifts.shape[1]
        self.judged: Flags = np.zeros(m, bool)
        for row, influence, _ in self.budget.rows:
            self.judged[row] = not influence.considered or influence.shown(self.case)
        self.size = noise_ratio(self.fit)
        self._information = self.fit.prior_information
        # Where the fit ends, the pull of the prior of the parameters is that of the residuals.
        self._pull = self.fit.linear.gradient

    @cached_property
    def prior(self) -> tuple[Array, Array, Flags]:
        """Prior means and deviations (k, m) in each water, and where it has tails."""
        prior = self.budget.likelihood.prior
        return prior.mean, prior.sigma, prior.tails

    def waters(self, u: Array, within: Flags) -> Array:
        """Logarithms of the prior density of influences (m,) in each water, of those `within`, with its odds: (k,)."""
        mean, sigma, tails = self.prior
        loss = mean[-1] > 0.0
        z = (u - mean) / sigma
        normal = -0.5 * z**2 - np.log(sigma)
        # Anywhere between nothing and its greatest, and a share that is normal: `posterior`.
        even = np.where(np.abs(z) <= math.sqrt(3.0), -np.log(sigma * math.sqrt(12.0 / math.tau)), -np.inf)
        mixed = np.logaddexp(math.log(1.0 - NORMAL_SHARE) + even, math.log(NORMAL_SHARE) + normal)
        student = -0.5 * (FREEDOM + 1.0) * np.log1p(z**2 / FREEDOM) - np.log(sigma)
        log = np.where(loss, mixed, np.where(tails, student, normal))
        odds = np.array([*[NEAR_ODDS] * (len(mean) - 1), 0.0])
        return array(np.sum(log[:, within], axis=1) + odds)

    def moved(self, theta: Array, u: Array) -> LinearizedProblem | None:
        """The record with these parameters (p,) and influences (m,): effects along the motion that they make."""
        problem, record, rows = self.fit.problem, self.case.record, self.budget.rows
        grid = problem.grid
        delays = {one.name: sigma * float(u[row.start]) for row, one, sigma in rows if one.name in DELAYS}
        late = replace(
            record,
            lag_s=max(0.0, record.lag_s + delays.get(LAG, 0.0)),
            latency_s=record.latency_s + delays.get(LATENCY, 0.0),
        )
        impulse = per_step(late.impulse(grid.times_s), grid.starts) if delays else grid.impulse
        # First along the motion of the fit, then along the one that this makes.
        rough = replace(grid, impulse=array(impulse + self._impulses @ u))
        path = trajectory(self.fit.model, theta, rough, self.fit.linear.path)
        if path is None:
            return None
        linear = replace(self.fit.linear, path=path)
        case = replace(self.case, record=late, fit=replace(self.fit, theta=theta, linear=linear))
        unmodeled, readings = np.zeros(len(grid.times_s)), np.zeros(len(problem.t))
        for row, one, sigma in rows:
            if one.name in DELAYS or not np.any(u[row]):
                continue
            if one.of_readings:
                readings += one.effect(case) @ u[row] * sigma
            elif one.name == OTHER_AXES:  # its columns are combinations, and would be others
                unmodeled += self._impulses[:, row] @ u[row]
            else:
                unmodeled += one.effect(case) @ u[row] * sigma
        unmodeled[grid.starts] = 0.0
        y, pushed = array(problem.y - readings), array(impulse + unmodeled)
        changed = replace(problem, y=y, grid=replace(grid, impulse=pushed))
        return linearize(changed, theta, path, self.fit.whitener)

    @cached_property
    def _impulses(self) -> Array:
        """Effects along the motion of the fit, without those of delays and readings: (n, m)."""
        out = np.zeros((len(self.case.v), len(self.judged)))
        for row, one, sigma in self.budget.rows:
            if not one.of_readings and one.name not in DELAYS:
                out[:, row] = sigma * one.effect(self.case)
        return out

    def log_likelihood(self, theta: Array, u: Array) -> float:
        """Of parameters (p,) and influences (m,), with the prior of the parameters."""
        if not theta[-1] > self.fit.model.least_mass:
            return -math.inf
        linear = self.moved(theta, u)
        return -math.inf if linear is None else -0.5 * (linear.cost + self._away(theta)) / self.size

    def _away(self, theta: Array) -> float:
        """What the prior of the parameters adds to the squared residuals, less than at the fit."""
        off = theta - self.fit.theta
        return float(off @ self._information @ off + 2.0 * self._pull @ off)

    def __call__(self, x: Array) -> float:
        """Logarithm of the posterior density of (theta, judged influences), but for a constant."""
        u = np.zeros(len(self.judged))
        u[self.judged] = x[self.p :]
        prior = float(np.logaddexp.reduce(self.waters(u, self.judged)))
        value = self.log_likelihood(array(x[: self.p]), u)
        return prior + value if math.isfinite(value) else -math.inf

    def refitted(self, theta: Array, u: Array) -> Array:
        """Parameters (p,) that fit best with these influences (m,), by Gauss-Newton from there."""
        for _ in range(REFITS):
            linear = self.moved(theta, u)
            if linear is None:
                break
            downhill = linear.gradient - self._information @ (theta - self.fit.theta) - self._pull
            step = np.linalg.solve(linear.information + self._information, downhill)
            theta = array(theta + step)
            if theta[-1] <= self.fit.model.least_mass:
                break
        return theta


@dataclass(frozen=True, slots=True)
class Shape:
    """Mean, deviation and skewness of a quantity."""

    center: float
    width: float
    skew: float


@dataclass(frozen=True, slots=True)
class Compared:
    """One quantity of one record: by the linearized budget and as sampled, with and without what no record judges."""

    record: str
    quantity: str
    linear: Shape
    sampled: Shape
    judged_linear: Shape
    judged_sampled: Shape

    @property
    def off(self) -> float:
        """Difference of the centers, in sampled deviations [-]."""
        return (self.linear.center - self.sampled.center) / self.sampled.width


@dataclass(frozen=True, slots=True)
class RecordRow:
    """One record: its quantities, the largest difference of a correlation, and how good the sample is."""

    quantities: tuple[Compared, ...]
    correlation_off: float
    effective: float
    accepted: float


def shape_of(values: Array, weight: Array) -> Shape:
    """Moments of values (n,) with weights (n,) of sum one."""
    mean = float(weight @ values)
    apart = values - mean
    variance = float(weight @ apart**2)
    return Shape(mean, math.sqrt(variance), float(weight @ apart**3) / max(1e-300, variance**1.5))


def _quantities(target: Target, theta: Array, u: Array) -> Array:
    """Parameters, and the drag at the highest speed with what influences add to it: (n, p + 1)."""
    v = array([target.case.speed])
    drag = []
    for one, influences in zip(theta, u, strict=True):
        case = replace(target.case, fit=replace(target.fit, theta=array(one)))
        more = sum(
            float(sigma * influence.drag(case, v)[0] @ influences[row])
            for row, influence, sigma in target.budget.rows
            if influence.drag is not None and np.any(influences[row])
        )
        drag.append(float(case.drag(v)[0]) + more)
    return np.column_stack([theta, drag])


def compared(name: str, assessment: Assessment, steps: int, seed: int = 1) -> RecordRow:
    """Sample the posterior of one assessed axis and compare it with its budget.

    Parameters
    ----------
    name
        Of the record.
    assessment
        Of one axis.
    steps
        Of each walker.
    seed
        Of the draws.

    Returns
    -------
    RecordRow
        Parameters and the drag at the highest speed.

    Raises
    ------
    UsageError
        Without emcee.
    """
    try:
        import emcee  # noqa: PLC0415  # of the desk only
    except ImportError as error:
        raise UsageError("the sampler emcee is not installed: pip install emcee") from error
    target, rng = Target(assessment), np.random.default_rng(seed)
    draws, S, p = assessment.draws, assessment.budget.shifts, len(assessment.fit.theta)
    kept = draws.influences * target.judged
    sized = p + int(target.judged.sum())
    walkers = WALKERS_PER_UNKNOWN * sized
    chosen = rng.choice(len(kept), 4 * walkers, p=draws.weight, replace=False)
    starts = np.column_stack([assessment.fit.theta - kept @ S.T - draws.noise, kept[:, target.judged]])[chosen]
    starts = np.array([one for one in starts if math.isfinite(target(array(one)))][:walkers])
    moves = [(emcee.moves.DEMove(), 0.7), (emcee.moves.DESnookerMove(), 0.1), (emcee.moves.StretchMove(), 0.2)]
    sampler = emcee.EnsembleSampler(len(starts), sized, target, moves=moves)
    sampler.random_state = np.random.RandomState(seed).get_state()  # what emcee takes
    sampler.run_mcmc(starts, steps)
    chain = sampler.get_chain(discard=int(BURN_SHARE * steps))
    moved = chain[:, np.ptp(chain, axis=0).min(axis=1) > 0.0]
    correlated = emcee.autocorr.integrated_time(moved, quiet=True)
    x = chain.reshape(-1, sized)
    x = x[rng.choice(len(x), min(len(x), FULL_DRAWS), replace=False)]
    u = np.zeros((len(x), len(target.judged)))
    u[:, target.judged] = x[:, p:]
    theta = array(x[:, :p])
    whole_u = u + np.array([_unjudged(target, one, rng) for one in u])
    both = zip(theta, u, whole_u, strict=True)
    whole = array([one + target.refitted(one, all_) - target.refitted(one, few) for one, few, all_ in both])
    sampled, judged_sampled = _quantities(target, whole, whole_u), _quantities(target, theta, u)
    linear, judged_linear = (
        np.column_stack([assessment.fit.theta - v @ S.T - draws.noise, _linear_drag(target, v, draws.noise)])
        for v in (draws.influences, kept)
    )
    alike = np.full(len(whole), 1.0 / len(whole))
    names = (*assessment.fit.model.names, "drag at the highest speed")
    rows = tuple(
        Compared(name, quantity, *(shape_of(values[:, at], weight) for values, weight in pairs))
        for at, quantity in enumerate(names)
        for pairs in [
            ((linear, draws.weight), (sampled, alike), (judged_linear, draws.weight), (judged_sampled, alike))
        ]
    )
    off = _correlations(linear[:, :p], draws.weight) - _correlations(sampled[:, :p], alike)
    effective = chain.shape[0] * chain.shape[1] / float(np.max(correlated))
    return RecordRow(rows, float(np.abs(off).max()), effective, float(np.mean(sampler.acceptance_fraction)))


def _linear_drag(target: Target, u: Array, noise: Array) -> Array:
    """Drag at the highest speed by the budget, for draws of influences (n, m) and noise (n, p): (n,)."""
    v = target.case.speed
    gradient = np.zeros((1, target.p))
    gradient[0, :2] = v**2, v
    sensitivity = target.budget.drag_sensitivity(array(gradient), array([v]))
    return array(float(gradient[0] @ target.fit.theta) - u @ sensitivity[0] - noise @ gradient[0])


def _unjudged(target: Target, u: Array, rng: np.random.Generator) -> Array:
    """Influences (m,) that the record may not judge, from their prior in the water of those that it judges."""
    log = target.waters(u, target.judged)
    weight = np.exp(log - np.logaddexp.reduce(log))
    mean, sigma, _ = (one[rng.choice(len(weight), p=weight)] for one in target.prior)
    even = (mean > 0.0) & (rng.random(len(u)) > NORMAL_SHARE)
    z = np.where(even, math.sqrt(3.0) * rng.uniform(-1.0, 1.0, len(u)), rng.standard_normal(len(u)))
    return array((mean + sigma * z) * ~target.judged)


def _correlations(values: Array, weight: Array) -> Array:
    apart = values - weight @ values
    covariance = (weight[:, None] * apart).T @ apart
    sigma = np.sqrt(np.diag(covariance))
    return array(covariance / np.outer(sigma, sigma))


def main(arguments: Sequence[str] | None = None) -> int:
    """Fly, sample and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--records", type=int, default=10, metavar="N")
    parser.add_argument("--first", type=int, default=1, metavar="SEED", help="of the first record")
    parser.add_argument("--world", default=POOL)
    parser.add_argument("--steps", type=int, default=STEPS, help="of each walker")
    parser.add_argument("--json", action="store_true", help="a line for each record")
    asked = parser.parse_args(arguments)
    vehicle = load_vehicle(share_folder("vehicles") / "hindrax.yaml")
    found: list[RecordRow] = []
    for seed in range(asked.first, asked.first + asked.records):
        motion = MOTIONS[(seed - 1) % len(MOTIONS)]
        assessments = fly([motion], seed, asked.world, vehicle=vehicle).outcome.assessments
        for assessment in assessments.values():
            found.append(compared(f"{motion} {seed}", assessment, asked.steps))
            print(_line(found[-1]), file=sys.stderr, flush=True)
            if asked.json:
                print(json.dumps(asdict(found[-1])), flush=True)
    if asked.json:
        return 0
    headings = ("center off [std]", "width, linear / sampled", "skew, linear", "skew, sampled")
    cells = [
        (
            one.record,
            one.quantity,
            f"{one.off:+.2f}",
            f"{one.linear.width / one.sampled.width:.2f}",
            f"{one.linear.skew:+.1f}",
            f"{one.sampled.skew:+.1f}",
        )
        for record in found
        for one in record.quantities
    ]
    print_table("Linearized budget against the sampled posterior", ("record", "quantity"), headings, cells)
    return 0


def _line(row: RecordRow) -> str:
    drag = row.quantities[-1]
    return (
        f"{drag.record}: drag {drag.linear.center:.3g} +- {drag.linear.width:.2g}, sampled "
        f"{drag.sampled.center:.3g} +- {drag.sampled.width:.2g}; correlations within {row.correlation_off:.2f}; "
        f"{row.effective:.0f} independent draws, {row.accepted:.0%} accepted"
    )


if __name__ == "__main__":
    sys.exit(main())
