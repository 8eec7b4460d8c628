"""Vehicles drawn from the uncertainty of a result: for domain randomization and for intervals of a simulation.

A result is a normal distribution over its coefficients. Within a motion their covariance is in the file, noise and
calibration together: quadratic and linear drag go against each other, and all of them with the gain of the thrust.
Between motions the gains that all share (thrust curve, velocity sensor) make them go together: row i of the budget of
one motion and of another are the same unknown, so their covariance is the product of the two deviations.
"""

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from hindrax_analysis.coefficients_file import SavedCoefficients
from hindrax_analysis.exports.export_model import ExportModel, export_model, identified, unit_of
from hindrax_core.errors import HindraxError
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.results import MotionResult

SHARED = ("thrust calibration", "gain of the velocity")
"""Rows of the budget that are one unknown for all motions, and act on all coefficients in proportion."""
MOST_TRIES = 1000
DRAWN = ("k_q", "k_l", "b", "k_r", "added_mass", "k_w")


class Posterior:
    """Normal distribution over the coefficients of all identified motions of a result: names, mean, covariance.

    `names` are pairs of motion and coefficient (n,), `mean` (n,), `covariance` (n, n), SI units.
    """

    def __init__(self, saved: SavedCoefficients) -> None:
        self._saved = saved
        motions = identified(saved)
        if not motions:
            raise HindraxError(
                f"{saved.label or 'results'}: no motion is identifiable, so there is nothing to draw from"
            )
        self.names = [(name, key) for name, motion in motions.items() for key in DRAWN if key in motion.coefficients]
        self.mean = array([motions[name].coefficients[key].quoted[0] for name, key in self.names])
        self.covariance = _joint(motions, self.names)

    def draw(self, count: int, seed: int) -> Array:
        """Draw vehicles; one that would be driven by its own water is drawn again.

        Parameters
        ----------
        count
            Number of vehicles.
        seed
            The same one gives the same vehicles.

        Returns
        -------
        Array
            (count, n), in the order of `names` and their units.

        Raises
        ------
        HindraxError
            Where hardly any vehicle within the intervals is physical.
        """
        rng = np.random.default_rng(seed)
        power, axes = np.linalg.eigh(self.covariance)
        root = axes * np.sqrt(np.clip(power, 0.0, None))
        # Rows of a budget are rounded views of the whole: where they do not fit together, the deviations are kept.
        size = np.linalg.norm(root, axis=1)
        root *= (np.sqrt(np.diag(self.covariance)) / np.where(size > 0.0, size, 1.0))[:, None]
        drawn = self.mean + rng.standard_normal((count, len(self.mean))) @ root.T
        for _ in range(MOST_TRIES):
            lost = ~self._physical(drawn)
            if not lost.any():
                return array(drawn)
            drawn[lost] = self.mean + rng.standard_normal((int(lost.sum()), len(self.mean))) @ root.T
        raise HindraxError(
            f"{self._saved.label or 'results'}: hardly any vehicle within the intervals has drag that resists and"
            " a positive mass; identify it again with more speed, or leave --samples out"
        )

    def saved(self, row: Array) -> SavedCoefficients:
        """Result of one vehicle drawn."""
        motions = dict(self._saved.motions)
        for (name, key), value in zip(self.names, row.tolist(), strict=True):
            motion = motions[name]
            number = replace(motion.coefficients[key], value=value, corrected=None)
            motions[name] = replace(motion, coefficients={**motion.coefficients, key: number})
        return replace(self._saved, motions=motions)

    def _physical(self, drawn: Array) -> "np.typing.NDArray[np.bool_]":
        """Which rows have added mass above zero, and drag that resists at the speeds that were tested."""
        good = np.ones(len(drawn), bool)
        column = {name: drawn[:, index] for index, name in enumerate(self.names)}
        for motion, key in self.names:
            if key == "added_mass":
                good &= column[motion, key] >= 0.0
            if key == "k_q":
                low, high = self._saved.motions[motion].speeds
                for speed in (low, high):
                    good &= column[motion, "k_q"] * abs(speed) + column[motion, "k_l"] >= 0.0
        return good


def _joint(motions: Mapping[str, MotionResult], names: Sequence[tuple[str, str]]) -> Array:
    """Covariance (n, n) of all coefficients: blocks of the motions, coupled by the shared gains."""
    covariance = np.zeros((len(names), len(names)))
    for name, motion in motions.items():
        at = [index for index, (owner, _) in enumerate(names) if owner == name]
        covariance[np.ix_(at, at)] = _block(motion, [names[index][1] for index in at])
    for row in SHARED:
        shared = np.array([_signed(motions[name], key, row) for name, key in names])
        apart = np.array([[one[0] != other[0] for other in names] for one in names])
        covariance += apart * np.outer(shared, shared)
    return array(covariance)


def _block(motion: MotionResult, keys: Sequence[str]) -> Array:
    """Covariance of the coefficients of one motion, as quoted; of older files with the correlations of noise."""
    sigma = np.array([motion.coefficients[key].quoted[1] for key in keys])
    known = (motion.covariance_corrected, motion.covariance_calibrated, motion.covariance)
    full = next((one for one in known if one.size), motion.covariance)
    correlation = np.eye(len(keys))
    for i, one in enumerate(keys):
        for j, other in enumerate(keys):
            if i != j and one in motion.names and other in motion.names and full.size:
                a, b = motion.names.index(one), motion.names.index(other)
                size = float(np.sqrt(full[a, a] * full[b, b]))
                correlation[i, j] = full[a, b] / size if size > 0.0 else 0.0
    return array(correlation * np.outer(sigma, sigma))


def _signed(motion: MotionResult, key: str, row: str) -> float:
    """Change of a coefficient by one deviation of a shared gain."""
    std = sum(one.std for one in motion.budget.get(key, ()) if one.influence == row)
    return float(np.copysign(std, motion.quoted(key)))


def sampled_models(
    saved: SavedCoefficients, vehicle: Vehicle, source: str, count: int, *, seed: int, complete: bool
) -> Iterator[ExportModel]:
    """Export models of vehicles drawn from a result.

    Parameters
    ----------
    saved, vehicle, source, complete
        As of `export_model`.
    count, seed
        As of `Posterior.draw`.

    Yields
    ------
    ExportModel
        One by one, each with a note of its number.
    """
    posterior = Posterior(saved)
    for index, row in enumerate(posterior.draw(count, seed), start=1):
        model = export_model(posterior.saved(row), vehicle, source, complete=complete)
        note = f"sample {index} of {count} drawn from the uncertainty of the results, seed {seed}"
        yield replace(model, notes=(note, *model.notes))


def sample_table(saved: SavedCoefficients, count: int, *, seed: int) -> str:
    """Table of vehicles drawn from a result.

    Parameters
    ----------
    saved
        Results.
    count, seed
        As of `Posterior.draw`.

    Returns
    -------
    str
        CSV with one line per vehicle and one column per coefficient, its unit in the heading.
    """
    posterior = Posterior(saved)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([f"{motion}.{key} [{unit_of(motion, key)}]" for motion, key in posterior.names])
    writer.writerows([[f"{value:.9g}" for value in row] for row in posterior.draw(count, seed).tolist()])
    return text.getvalue()
