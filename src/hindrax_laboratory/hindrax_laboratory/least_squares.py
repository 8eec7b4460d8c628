"""Least squares with uncertainty, and propagation of uncertainty."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_core.errors import HindraxError
from hindrax_core.text.digits import Value
from hindrax_ident.arrays import Array, array

RANK_TOLERANCE = 1e-10
"""Smallest singular value of the scaled regressor, relative to its largest, that still counts as information."""

MOST_STEPS = 60
"""Most steps of a nonlinear fit; from a good start, ten are enough."""


def check_added_mass(found: Value, own_kg: float, source: str, inputs: str) -> None:
    """Refuse a clearly negative added mass: then an input is wrong, however good the fit.

    Clearly: beyond three standard deviations and 1 % of the body mass, the accuracy of weighing.

    Parameters
    ----------
    found : [kg]
        Added mass with its deviation.
    own_kg : [kg]
        Mass of the body.
    source, inputs
        Name of the record, and what is to be checked, for the error.

    Raises
    ------
    HindraxError
        If it is.
    """
    if found.value < -3.0 * found.std - 0.01 * own_kg:
        raise HindraxError(
            f"{source}: the added mass is {found:.3g} kg for a mass of {own_kg:g} kg, wanted at least 0; check {inputs}"
        )


@dataclass(frozen=True, slots=True)
class Fit:
    """Result of a regression: coefficients, (n,), in the order of `names`, and their covariance, (n, n)."""

    names: tuple[str, ...]
    values: Array
    covariance: Array
    residual_std: float
    samples: int

    def __getitem__(self, name: str) -> Value:
        index = self.names.index(name)
        return Value(float(self.values[index]), float(np.sqrt(max(0.0, self.covariance[index, index]))))


def least_squares(regressor: Array, measured: Array, names: Sequence[str]) -> Fit:
    """Ordinary least squares with standard deviations. COB-2023-1394 eq. 6, 7 and 8.

    The columns are scaled to unit length first, so that coefficients of very different size (cubic thrust curves) do
    not lose their digits.

    Parameters
    ----------
    regressor : (samples, coefficients)
        Columns in any units.
    measured : (samples,)
        What they are to explain.
    names
        Of the coefficients.

    Returns
    -------
    Fit
        Values, covariance, standard deviation of the residuals.

    Raises
    ------
    HindraxError
        When there are too few samples, or when the record cannot separate the coefficients.
    """
    samples, count = regressor.shape
    if samples <= count:
        raise HindraxError(f"fit of {', '.join(names)}: found {samples} samples, wanted more than {count}; record more")
    scale = np.linalg.norm(regressor, axis=0)
    if not np.all(scale > 0.0):
        silent = ", ".join(name for name, size in zip(names, scale, strict=True) if not size > 0.0)
        raise HindraxError(f"fit of {silent}: the record does not excite it; vary the input")
    left, singular, right = np.linalg.svd(regressor / scale, full_matrices=False)
    if singular[-1] < RANK_TOLERANCE * singular[0]:
        raise HindraxError(f"fit of {', '.join(names)}: the record cannot separate them; vary the input more")
    values = (right.T @ ((left.T @ measured) / singular)) / scale
    residual = measured - regressor @ values
    variance = float(residual @ residual) / (samples - count)
    spread = right.T / singular
    covariance = variance * (spread @ spread.T) / np.outer(scale, scale)
    return Fit(tuple(names), values, covariance, float(np.sqrt(variance)), samples)


def fit_curve(residual: Callable[[Array], Array], start: Array, scale: Array, names: Sequence[str]) -> Fit:
    """Nonlinear least squares of a residual vector by its parameters, with the covariance of the linearized problem.

    Parameters
    ----------
    residual
        Residuals (samples,) for parameters (p,).
    start : (p,)
        Where the search begins.
    scale : (p,)
        Size of a significant step of each parameter.
    names
        Of the parameters.

    Returns
    -------
    Fit
        As of `least_squares`.

    Raises
    ------
    HindraxError
        When the record cannot separate the parameters.
    """
    from scipy.optimize import least_squares as minimize  # noqa: PLC0415  # slow to import

    found = minimize(residual, start, x_scale=scale, diff_step=np.full(start.size, 1e-6), max_nfev=MOST_STEPS)
    jacobian, values = array(found.jac), array(found.x)
    size = np.linalg.norm(jacobian, axis=0)
    if not np.all(size > 0.0) or float(np.linalg.cond(jacobian / size)) > 1.0 / RANK_TOLERANCE:
        raise HindraxError(f"fit of {', '.join(names)}: the record cannot separate them; vary the input more")
    inverse = np.linalg.inv((jacobian / size).T @ (jacobian / size)) / np.outer(size, size)
    samples = jacobian.shape[0]
    variance = 2.0 * float(found.cost) / (samples - values.size)
    return Fit(tuple(names), values, variance * inverse, float(np.sqrt(variance)), samples)


def propagate(formula: Callable[[Array], float], values: Array, covariance: Array) -> Value:
    """First-order propagation of a covariance through a formula, by central differences.

    Parameters
    ----------
    formula
        Of n inputs.
    values : (n,)
        The inputs.
    covariance : (n, n)
        Of the inputs.

    Returns
    -------
    Value
        The formula's value and standard deviation. Steps are a hundredth of a deviation: small against the curvature
        that a first order neglects, large against rounding.
    """
    gradient = np.zeros(values.size)
    deviations = np.sqrt(np.clip(np.diag(covariance), 0.0, None))
    for index in range(values.size):
        step = max(0.01 * float(deviations[index]), 1e-7 * abs(float(values[index])), 1e-12)
        shift = np.zeros(values.size)
        shift[index] = step
        gradient[index] = (formula(values + shift) - formula(values - shift)) / (2.0 * step)
    return Value(float(formula(values)), float(np.sqrt(max(0.0, float(gradient @ covariance @ gradient)))))
