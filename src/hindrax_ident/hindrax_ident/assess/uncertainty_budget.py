"""Uncertainty budget of one axis: intervals, warnings and remedies from one table of influence quantities.

GUM (JCGM 100) clause 5.2 for correlated quantities. What a record shows of an influence is estimated from the
residuals with its prior; what they cannot show keeps its prior and is considered (Schmidt 1966). The parameters stay
those of the fit: what the record shows of an influence is an error that they probably have, so it counts in their band.

Symbols. u (m,) influences in units of their prior deviations, so that the usual prior is N(0, 1) for each; S (p, m)
`shifts`: u makes the parameters wrong by S u. The residuals of the fit, linearized, have the log likelihood

    g . u - u' H u / 2        H (m, m) `information`, g (m,) `gradient`: `fit.scores`, parameters already fitted

so with a normal prior the posterior is C = (H + 1)^-1 and mean C g. Two things make it more than that:

- How near the water is to the model: in k waters, from one in which every influence is a small part of usual to the
  usual one, u has other deviations. Which water it is, all motions of a run say together (`in_water`).
- Great influences: where u may be far greater than usual, its prior is Student's, a normal one whose variance is
  unknown. The variances that make the evidence largest are found by iteration, from several starts, since a record
  often has several explanations; all of them count, by their evidence.

So the posterior is a mixture over waters and explanations. Its mean and covariance make the intervals; `posterior`
draws from the mixture itself, `explanations`. Two numbers come of it. The variance of a fitted parameter is the second
moment S (C + mean mean') S': a mean of u that is not zero is an error of that number. The corrected number has the mean
taken off, so its variance is S C S' alone.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import numpy as np

from hindrax_core.text.digits import measured
from hindrax_ident.arrays import Array, Flags, array
from hindrax_ident.assess.axis_fit import HEAVE, AxisFit
from hindrax_ident.assess.influences import (
    GAIN,
    INFLUENCES,
    LAG,
    LATENCY,
    LOOKS,
    MODEL,
    NEAR_MODEL,
    OTHER_AXES,
    RUN,
    STAMPS,
    Influence,
    acting,
)
from hindrax_ident.assess.objections import Code, Objection, objection
from hindrax_ident.assess.posterior import LOSSLESS, Draws, Explanations, drawn
from hindrax_ident.assess.results import Contribution
from hindrax_ident.fit.scores import ScoreTest, score
from hindrax_ident.remedies import Remedy

BudgetRow: TypeAlias = tuple[slice, Influence, float]
"""Columns of an influence, itself, and its prior standard deviation in its unit."""
ALL = (GAIN, RUN, MODEL)
FREEDOM = 1.0
"""Degrees of freedom of the priors: one, as of Cauchy's. With normal priors a tether of 2 N would be spread
over ten rows (ADR 31)."""
NEAR_ODDS = math.log(0.014)
"""Logarithm of the odds of water near the model, or near it but for one cause, against that of a usual pool. Assumed, 1
to 70 (ADR 31): a pool is the rule, and the evidence of all records of a run decides."""
ODD_RECORD = 0.02
"""Probability that a record contradicts the model by a cause of its own, which is not the water's (ADR 31)."""
LOSS_MEAN = 0.75**0.5
"""Mean over root mean square of what is anywhere between nothing and its greatest."""
ROUNDS = 20
GREAT_INFLUENCE = 10.0
"""Scale at which the search for one great influence begins, beyond which it explains nothing [prior deviations]."""
SAME_EXPLANATION = 0.1
"""Difference of two explanations, in prior deviations, below which they are one."""
MOST_INFORMATION, MOST_VARIANCE = 1e6, 1e4
"""Limits in prior units: beyond them the inverse would lose its digits."""
MOST_SHARE = 0.5
"""Share of a variance above which it is mostly that of its cause."""
NEEDED_LOG_ODDS = 1.6
"""Logarithm of the odds that a record has an influence, against all others, above which it is named: five to one."""
LEAST_SHOWN = 1e-6
"""Information about an unknown below which a record shows nothing of it, in units of its prior."""
SURPRISE_SIGMAS = 3.0
"""Standard deviations from zero beyond which an influence seen in a record is reported."""


@dataclass(frozen=True, slots=True)
class Budget:
    """Influences in units of their prior deviations, m columns: see `BudgetRow`.

    `shifts` (p, m): error of the parameters per unit; `mean` (m,) and `covariance` (m, m): what is known of them
    after the record. `evidence` (k,): log evidence of this record for each nearness of the water to the model.
    `likelihood`: what the residuals show of the influences that they may judge, and the prior; `whole`: of all.
    """

    case: AxisFit
    rows: tuple[BudgetRow, ...]
    shifts: Array
    mean: Array
    covariance: Array
    evidence: Array
    likelihood: _Likelihood
    whole: _Likelihood
    explanations: Explanations

    def in_water(self, water: Array) -> Budget:
        """The budget in the water of a run: (k,), the sum of the evidence of all its motions."""
        known = _posterior(self.likelihood, water)
        return replace(self, mean=known.mean, covariance=known.covariance, explanations=known.explanations)

    def told_by(self, others: Sequence[Budget]) -> Budget:
        """The budget with what other motions of the run show of what all share, before it is taken in their water.

        Parameters
        ----------
        others
            Of each the posterior without its prior, wider by what differs between motions, is a measurement of the row.

        Returns
        -------
        Budget
            With another likelihood; its posterior is that of before.
        """
        information, gradient = self.likelihood.information.copy(), self.likelihood.gradient.copy()
        for row, influence, sigma in self.rows:
            apart = (influence.common / sigma) ** 2
            found = [one.shown_of(influence.name) for one in others] if apart > 0.0 else []
            for known, along in filter(None, found):
                precision = np.linalg.inv(np.linalg.inv(known) + apart * np.eye(len(known)))
                information[row, row] += precision
                gradient[row] += precision @ np.linalg.solve(known, along)
        return replace(self, likelihood=self.likelihood._replace(information=information, gradient=gradient))

    def shown_of(self, name: str) -> tuple[Array, Array] | None:
        """What this record shows of an influence, without its prior.

        Parameters
        ----------
        name
            Of a row.

        Returns
        -------
        tuple[Array, Array] | None
            Information (k, k) and gradient (k,) of its k unknowns, in units of the prior; None where it does not act.
        """
        for row, influence, _ in self.rows:
            if influence.name == name:
                precision = np.linalg.inv(self.covariance[row, row])
                values, axes = np.linalg.eigh(precision - np.eye(len(precision)))
                return array(axes * np.maximum(values, LEAST_SHOWN) @ axes.T), array(precision @ self.mean[row])
        return None

    @property
    def vote(self) -> Array:
        """What this record tells the other motions about the water: log evidence for each nearness, (k,).

        Only this record may contradict the model, by a cause that is not of the water, such as a curve that is wrong
        where this motion works. Tails of a pool explain whatever does, so against water near the model one record
        alone says no more than how rare such a record is.
        """
        own = self.evidence[-1] + math.log(ODD_RECORD)
        return array(np.logaddexp(self.evidence + math.log1p(-ODD_RECORD), own))

    def draws(self, noise: Array) -> Draws:
        """Draws of the posterior of the influences, and of the noise of the parameters, of this covariance (p, p)."""
        vehicle = self.case.vehicle
        return drawn(self.explanations, noise, LOSSLESS if vehicle.losses and not vehicle.thrusters else 0.0)

    def prior(self, name: str) -> float:
        """Prior standard deviation of an influence in its unit; 0 where it cannot act."""
        return next((sigma for _, influence, sigma in self.rows if influence.name == name), 0.0)

    def band(self, scopes: Collection[str] = ALL) -> Array:
        """Second moment of the parameters' errors due to influences of these scopes: (p, p)."""
        return self._sandwich(self._moment, scopes)

    def band_of_run(self) -> Array:
        """Covariance of the parameters due to what differs in each run, and to what is seen beyond chance.

        What is seen counts from SURPRISE_SIGMAS deviations, and gradually, so that no interval jumps at the limit.

        Returns
        -------
        Array
            (p, p), in the units of the parameters.
        """
        excess = 1.0 - (SURPRISE_SIGMAS / np.maximum(self._surprise, SURPRISE_SIGMAS)) ** 2
        shown = self.shifts @ (self.mean * excess)
        return self._sandwich(self.covariance, (RUN,)) + np.outer(shown, shown)

    def prior_band(self, name: str) -> Array:
        """Covariance of the parameters due to one influence, before the record: (p, p)."""
        out = np.zeros((len(self.shifts),) * 2)
        for row, influence, _ in self.rows:
            if influence.name == name:
                out += self.shifts[:, row] @ self.shifts[:, row].T
        return out

    def drag_sensitivity(self, gradient: Array, v: Array) -> Array:
        """Error of the drag at velocities v (n,) per unit of each influence: (n, m); `gradient` (n, p) of the drag."""
        out = gradient @ self.shifts
        for row, influence, sigma in self.rows:
            if influence.drag is not None:
                out[:, row] -= sigma * np.sign(v)[:, None] * influence.drag(self.case, v)
        return out

    def variance(self, sensitivity: Array, scopes: Collection[str] = ALL) -> Array:
        """Second moment of quantities with these sensitivities, (n, m): (n,)."""
        kept = sensitivity * self._within(scopes)
        return array(np.sum(kept @ self._moment * kept, axis=1))

    def variance_without(self, sensitivity: Array) -> dict[Remedy, float]:
        """What is left of the variance of a corrected quantity if the influences behind one remedy were known.

        What is known of an influence is corrected, so only the covariance counts, not the mean.

        Parameters
        ----------
        sensitivity : (m,)
            Error of the quantity per unit of each influence.

        Returns
        -------
        dict[Remedy, float]
            Variance left, by remedy.
        """
        columns: dict[Remedy, list[int]] = {}
        for row, influence, _ in self.rows:
            columns.setdefault(influence.remedy, []).extend(range(row.start, row.stop))
        known = float(sensitivity @ self.covariance @ sensitivity)
        return {remedy: max(0.0, known - self._lost(at, sensitivity)) for remedy, at in columns.items()}

    def contributions(self, sensitivity: Array, scopes: Collection[str] = ALL) -> list[Contribution]:
        """Contribution of each influence to a quantity, largest first.

        Root of what the second moment of the quantity would lose if the influence were known, so never more than the
        band: for an independent one sensitivity times deviation (GUM, JCGM 100, eq. 11a).

        Parameters
        ----------
        sensitivity : (m,)
            Error of the quantity per unit of each influence.
        scopes
            Of GAIN, RUN and MODEL: those whose influences count.

        Returns
        -------
        list[Contribution]
            Name, standard deviation in the unit of the quantity, and remedy.
        """
        out = []
        sensitivity = sensitivity * self._within(scopes)
        error = float(self.mean @ sensitivity)
        for row, influence, _ in self.rows:
            if influence.scope not in scopes:
                continue
            lost = self._lost(range(row.start, row.stop), sensitivity)
            rest = error - float(self.mean[row] @ sensitivity[row])
            # What opposes the others is a gain: without it the error would be greater.
            gained = max(0.0, lost + error**2 - rest**2)
            out.append(Contribution(influence.name, math.sqrt(gained), str(influence.remedy)))
        return sorted(out, key=lambda one: -one.std)

    def _lost(self, at: Sequence[int], sensitivity: Array) -> float:
        """Variance that a quantity with this sensitivity (m,) would lose if these columns were known.

        Of a normal distribution, with s the sensitivity and an index a for these columns: (C s)_a is their covariance
        with the quantity, (C s)_a' C_aa^-1 (C s)_a what they explain of it. By least squares, since columns of one
        cause may depend on each other.
        """
        along = self.covariance[at] @ sensitivity
        return float(along @ np.linalg.lstsq(self.covariance[np.ix_(at, at)], along, rcond=None)[0])

    def found(self, name: str) -> tuple[float, float]:
        """Value of an influence with one unknown, in its unit, and its deviation after the record; NaN for no such."""
        for row, influence, sigma in self.rows:
            if influence.name == name:
                at = row.start
                return sigma * float(self.mean[at]), sigma * math.sqrt(self.covariance[at, at])
        return math.nan, math.nan

    def warnings(self) -> tuple[Objection, ...]:
        """Objections to influences that the record shows beyond chance.

        None where the record needs none of them: then what it may not judge, such as inflow, explains it as well.

        Returns
        -------
        tuple[Objection, ...]
            One for each influence, the clearest first.
        """
        surprise = self._surprise
        clear = []
        for row, influence, sigma in self.rows:
            if influence.name in (LAG, LATENCY) and self._comes_first:
                continue
            at = row.start + int(np.argmax(surprise[row]))
            if surprise[at] > SURPRISE_SIGMAS and abs(self.mean[at]) > 1.0:
                clear.append((float(surprise[at]), at, row, self._named(at, influence, sigma)))
        if not clear or not self._needs([row for _, _, row, _ in clear]):
            return ()
        return tuple(text for *_, text in sorted(clear, key=lambda one: one[:2], reverse=True))

    @property
    def _comes_first(self) -> bool:
        """Whether the record shows a thrust before its command.

        No lag is that. Nor is a latency found beside it one: the two move a record in opposite ways, and what is left
        bends it as other forces do.
        """
        error_s, sigma_s = self.found(LAG)
        return self.case.record.lag_s + error_s < -SURPRISE_SIGMAS * sigma_s

    def _named(self, at: int, influence: Influence, sigma: float) -> Objection:
        """Objection about an influence, by the value of one of its unknowns."""
        value, spread = sigma * float(self.mean[at]), sigma * math.sqrt(self.covariance[at, at])
        unit = "N m" if influence.unit == "N" and self.case.axis >= 3 else influence.unit
        times = abs(float(self.mean[at]))
        return objection(
            Code.UNEXPLAINED_RESIDUALS if times > GREAT_INFLUENCE else Code.EVIDENCE,
            influence=" or ".join(
                filter(None, (influence.name, influence.or_else(self.case), self._by_others(influence)))
            ),
            shown=measured(value, spread),
            unit=unit,
            times=times,
            remedy=influence.remedy,
        )

    def _by_others(self, influence: Influence) -> str:
        """What else may be it where the vehicle moves across: lift and turns have forces of any form."""
        return OTHER_AXES if self.case.fit.model.crossed and influence.name != OTHER_AXES else ""

    def unseen(self, quantities: Mapping[str, tuple[Array, float]]) -> tuple[Objection, ...]:
        """Objections to what no record shows and what makes most of the variance of a quantity.

        Parameters
        ----------
        quantities
            By name: sensitivity (m,), and variance by the noise of the record.

        Returns
        -------
        tuple[Objection, ...]
            One for each remedy without which more than MOST_SHARE of a variance would be gone.
        """
        hidden: dict[Remedy, list[str]] = {}
        for _, influence, _ in self.rows:
            if influence.considered and not influence.measured and not influence.shown(self.case):
                hidden.setdefault(influence.remedy, []).append(influence.name)
        left = {
            name: (self.variance_without(along), noise, noise + float(along @ self.covariance @ along))
            for name, (along, noise) in quantities.items()
        }
        out = []
        for remedy, names in hidden.items():
            wide = [
                name for name, (rest, noise, total) in left.items() if noise + rest[remedy] < (1.0 - MOST_SHARE) * total
            ]
            if wide:
                causes, widened = " and ".join(names), " and ".join(wide)
                out.append(objection(Code.UNSEEN, widened=widened, causes=causes, remedy=remedy))
        return tuple(out)

    def _needs(self, rows: Sequence[slice]) -> bool:
        """Whether the record needs any of these influences: without them the others explain it worse."""
        kept = np.ones(len(self.mean))
        for row in rows:
            kept[row] = 0.0
        return _evidence(self.whole) - _evidence(_only(self.whole, kept)) > NEEDED_LOG_ODDS

    @property
    def _surprise(self) -> Array:
        """Distance of what is known from zero, in its standard deviations: (m,)."""
        return array(np.abs(self.mean) / np.sqrt(np.diag(self.covariance)))

    @property
    def _moment(self) -> Array:
        return self.covariance + np.outer(self.mean, self.mean)

    def _within(self, scopes: Collection[str]) -> Array:
        """1 for the columns of influences of these scopes, otherwise 0: (m,)."""
        out = np.zeros(len(self.mean))
        for row, influence, _ in self.rows:
            out[row] = influence.scope in scopes
        return out

    def _sandwich(self, moment: Array, scopes: Collection[str]) -> Array:
        chosen = self.shifts * self._within(scopes)
        return chosen @ moment @ chosen.T


def budget_of(case: AxisFit, influences: Sequence[Influence] = INFLUENCES) -> Budget:
    """Budget of a single case: the effect of every row, and the joint estimate of all rows from the residuals.

    With the fit's sensitivities J and the effects E of the influences, whitened, g = E'r and H = E'E less what J
    explains are the score and the information of the influences (`scores`). What may not be judged by the residuals,
    because another cause would leave the same (considered and not shown), has its rows and columns of H and g set to
    zero: it keeps its prior, independent of all others. `whole` judges all, to ask whether a record needs an influence
    that would be named.

    Parameters
    ----------
    case
        Fit of one axis, with its vehicle, record and doubts.
    influences
        Rows that may act.

    Returns
    -------
    Budget
        In units of the prior deviations, in the water of this record alone.
    """
    rows_acting = sorted(acting(case, influences), key=lambda pair: pair[0].of_readings)
    columns = [sigma * row.effect(case) for row, sigma in rows_acting]
    on_body = sum(not row.of_readings for row, _ in rows_acting)
    impulses = np.hstack([np.zeros((len(case.v), 0)), *columns[:on_body]])
    readings = np.hstack([np.zeros((len(case.fit.problem.t), 0)), *columns[on_body:]])
    found = score(case.fit, impulses, readings)
    ends = np.cumsum([0, *(column.shape[1] for column in columns)]).tolist()
    rows = tuple((slice(a, b), *one) for (a, b), one in zip(itertools.pairwise(ends), rows_acting, strict=True))
    judged = np.ones(ends[-1])
    for row, influence, _ in rows:
        judged[row] = not influence.considered or influence.shown(case)
    shifts = _through_delays(found, rows, judged) if case.delays_fitted else found.shifts
    weighed = _weighed(case, shifts)
    prior = _prior(rows)
    likelihood = _Likelihood(
        found.information * np.outer(judged, judged) + weighed[0],
        found.gradient * judged + weighed[1],
        prior,
    )
    whole = _Likelihood(found.information + weighed[0], found.gradient + weighed[1], prior)
    known = _posterior(likelihood)
    return Budget(
        case=case,
        rows=rows,
        shifts=shifts,
        mean=known.mean,
        covariance=known.covariance,
        evidence=known.evidence,
        likelihood=likelihood,
        whole=whole,
        explanations=known.explanations,
    )


def _through_delays(found: ScoreTest, rows: Sequence[BudgetRow], judged: Array) -> Array:
    """Errors of the parameters (p, m) where lag and latency were fitted too: what is not judged moved both.

    A force c u that the residuals may not judge changes the delays found by (H_dd + 1)^-1 H_dc u, and these the
    parameters: forces that go with turn rate and speed across can look like a delay of -0.14 s, which looks like half
    of the mass. Stamps and looks are a delay themselves, and stand for what the residuals cannot correct.
    """
    delays = [row.start for row, influence, _ in rows if influence.name in (LAG, LATENCY)]
    hidden = judged == 0.0
    for row, influence, _ in rows:
        hidden[row] &= influence.name not in (STAMPS, LOOKS)
    if not delays or not hidden.any():
        return found.shifts
    information = found.information[np.ix_(delays, delays)] + np.eye(len(delays))
    moved = np.linalg.solve(information, found.information[delays][:, hidden])
    shifts = found.shifts.copy()
    shifts[:, hidden] -= found.shifts[:, delays] @ moved
    return array(shifts)


def _prior(rows: Sequence[BudgetRow]) -> _Prior:
    """Prior of the influences in each water: near the model, near it but for one cause each, usual.

    What only takes away (a loss) is anywhere between nothing and its greatest. The prior deviation of its row is its
    root mean square; so its mean is LOSS_MEAN = sqrt(3) / 2 of that, and its deviation about the mean 1 / 2.
    """
    m = rows[-1][0].stop if rows else 0
    near, cause, loss = np.ones(m), np.zeros(m, object), np.zeros(m)
    for row, influence, _ in rows:
        near[row], cause[row], loss[row] = influence.near, influence.usual_cause, influence.loss
    # The waters of all motions are the same, whichever rows act on one.
    causes = dict.fromkeys(one.usual_cause for one in INFLUENCES if one.usual_cause)
    size = np.stack([near, *(np.where(cause == one, 1.0, near) for one in causes), np.ones(m)])
    usual, spread = LOSS_MEAN * loss * size, np.sqrt(1.0 - loss * LOSS_MEAN**2) * size
    # What acts one way only cannot take more than there is: no tails.
    both_ways = loss == 0.0
    in_near = both_ways & (near > NEAR_MODEL)
    return _Prior(usual, spread, np.stack([*[in_near] * (len(size) - 1), both_ways]))


class _Prior(NamedTuple):
    """Mean and deviation of the influences for each nearness, (k, m); `tails`: which may be far greater than that."""

    mean: Array
    sigma: Array
    tails: Flags


class _Likelihood(NamedTuple):
    """Information (m, m) and gradient (m,) of a record about the influences, and their prior."""

    information: Array
    gradient: Array
    prior: _Prior


def _only(data: _Likelihood, kept: Array) -> _Likelihood:
    """The likelihood of a record without the influences whose place in `kept`, (m,), is zero."""
    return _Likelihood(data.information * np.outer(kept, kept), data.gradient * kept, data.prior)


def _evidence(data: _Likelihood) -> float:
    """Logarithm of the evidence of a record in whatever water."""
    evidence = _posterior(data).evidence
    odds = np.array([*[NEAR_ODDS] * (len(evidence) - 1), 0.0])
    return float(np.logaddexp.reduce(evidence + odds))


class _Posterior(NamedTuple):
    """Mean (m,) and covariance (m, m) of the influences; logarithm of the evidence of each nearness, (k,)."""

    mean: Array
    covariance: Array
    evidence: Array
    explanations: Explanations


class _Explained(NamedTuple):
    """Mean (e, m), covariance (e, m, m) and logarithm of the evidence (e,) of explanations of a record."""

    mean: Array
    covariance: Array
    evidence: Array


def _posterior(data: _Likelihood, water: Array | None = None) -> _Posterior:
    """How near the water is to the model is unknown: a record that shows influences informs of those it cannot show.

    Explanations that it cannot distinguish all count, by their evidence (global and local scales: Carvalho, Polson,
    Scott 2010). `water`: evidence of all motions of the run; None: of this one alone.
    """
    found = [_explained(data.information, data.gradient, *one) for one in zip(*data.prior, strict=True)]
    own = array([np.logaddexp.reduce(one.evidence) for one in found])
    odds = np.array([*[NEAR_ODDS] * (len(found) - 1), 0.0])
    others = odds if water is None else odds + (water - own)
    evidence = np.concatenate([one.evidence + other for one, other in zip(found, others, strict=True)])
    mean, covariance = (np.concatenate(parts) for parts in ([x.mean for x in found], [x.covariance for x in found]))
    weight = np.exp(evidence - evidence.max())
    weight /= weight.sum()
    middle = weight @ mean
    apart = mean - middle
    total = np.tensordot(weight, covariance, 1) + (weight[:, None] * apart).T @ apart
    of = np.repeat(np.arange(len(found)), [len(one.evidence) for one in found])
    usual, spread, loss = data.prior.mean[of], data.prior.sigma[of], array(data.prior.mean[-1] > 0.0)
    explanations = Explanations(weight, mean, covariance, usual, spread, loss)
    return _Posterior(middle, total, own, explanations)


def _explained(information: Array, gradient: Array, usual: Array, sigma: Array, tails: Flags) -> _Explained:
    """Explanations by unknowns with these means and deviations: Student priors where `tails`, otherwise normal.

    Tails allow an influence far greater than usual, instead of spreading it over all. Expectation
    maximization over the scale of each (Tipping 2001, section 3), begun once for each as the great one, and once for
    none: m + 1 starts side by side. With u = usual + sigma z, z has unit priors and H, g become sigma H sigma and
    sigma (g - H usual); `known` is what the shift by `usual` alone adds to the evidence. A Student prior of FREEDOM
    degrees is a normal one whose variance w has an inverse gamma prior; the step for it sets it to where the expected
    likelihood is largest, w = (FREEDOM + E z^2) / (FREEDOM + 1), which no z of usual size moves far from one.
    The evidence of an explanation is the largest over w, not the integral: with the prior as a density of log w, each
    influence adds -FREEDOM (log w + 1 / w) / 2 to its logarithm.
    """
    m, known = len(gradient), float(gradient @ usual - 0.5 * usual @ information @ usual)
    gradient = sigma * (gradient - information @ usual)
    power, axes = np.linalg.eigh(sigma[:, None] * information * sigma)
    # What is known beyond all digits is g / H and explains g^2 / H, whatever its prior: H is limited, g with it, and
    # what that takes from the evidence is the same for every explanation.
    beyond, along = np.maximum(1.0, power / MOST_INFORMATION), axes.T @ gradient
    known += 0.5 * float(np.sum(along**2 * (1.0 - 1.0 / beyond) / np.maximum(power, 1.0) - np.log(beyond)))
    gradient = axes @ (along / beyond)
    root = axes * np.sqrt(np.clip(power, 0.0, MOST_INFORMATION))
    # An influence without a tail begins as none of them does, and goes the same way: those starts are computed once.
    begin = 1.0 + tails * (GREAT_INFLUENCE**2 - 1.0) * np.eye(m + 1, m)
    distinct, start = np.append(np.flatnonzero(tails), m), np.append(np.where(tails, np.cumsum(tails), 0) - 1, -1)
    variance = begin[distinct]
    covariance, learned = _given(variance, root)
    for _ in range(ROUNDS - 1):
        mean, spread = covariance @ gradient, np.diagonal(covariance, axis1=1, axis2=2)
        scale = np.minimum(MOST_VARIANCE, (FREEDOM + mean**2 + spread) / (FREEDOM + 1.0))
        variance = np.where(tails, scale, 1.0)
        covariance, learned = _given(variance, root)
    log_size = np.linalg.slogdet(learned)[1][start]
    variance, covariance = variance[start], covariance[start]
    mean = covariance @ gradient
    evidence = 0.5 * (mean @ gradient - log_size - FREEDOM * np.sum(np.log(variance) + 1.0 / variance, axis=1))
    same = np.abs(mean[:, None] - mean[None]).max(axis=2, initial=0.0) < SAME_EXPLANATION
    # One that is found from many starts counts once.
    evidence += known - np.log(same.sum(axis=1))
    return _Explained(usual + sigma * mean, sigma[:, None] * covariance * sigma, evidence)


def _given(variance: Array, root: Array) -> tuple[Array, Array]:
    """Covariances (k, m, m) for prior variances (k, m), and what was learned (k, m, m): prior over posterior precision.

    With H = `root` root' and W the prior variances: (H + W^-1)^-1 = sqrt(W) (1 + sqrt(W) H sqrt(W))^-1 sqrt(W), in
    which nothing is divided by a small W and the inverse is always that of a matrix of at least one.
    """
    scale = np.sqrt(variance)
    scaled = scale[:, :, None] * root
    learned = np.eye(len(root)) + scaled @ np.swapaxes(scaled, 1, 2)
    return np.linalg.inv(learned) * scale[:, :, None] * scale[:, None, :], learned


def _weighed(case: AxisFit, shifts: Array) -> tuple[Array, Array]:
    """Information (m, m) and gradient (m,) of a weighed net buoyancy: heave then shows the gain of the thrust.

    The fit gives net buoyancy in units of a thrust that is scaled wrongly. Its difference to the weighed one is one
    measurement of the influences, S_b u = difference, with the variances of both.
    """
    m, sigma = shifts.shape[1], case.tuning.buoyancy_sigma_N
    if case.axis != HEAVE or sigma is None:
        return np.zeros((m, m)), np.zeros(m)
    at = case.fit.model.names.index("b")
    variance = sigma**2 + float(case.fit.covariance[at, at])
    missing = float(case.fit.theta[at]) - case.vehicle.net_buoyancy_N
    return np.outer(shifts[at], shifts[at]) / variance, shifts[at] * missing / variance
