"""Offsets and distortion of accelerometer and magnetometer: how they are applied, and how they are found.

Calibrated = matrix (raw - offset), all in the axes of the inertial sensor. The numbers live in the vehicle file under
`sensors.<name>.calibration`, where `./hindrax imu calibrate` puts them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.readings import Vec3

Matrix3 = tuple[float, ...]
"""Rows of a 3 x 3 matrix, one after the other: nine numbers."""

IDENTITY: Matrix3 = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
FEWEST_POINTS = 50
FLATTEST = 0.02
"""Least variance of the directions along any axis (1/3 when all directions are alike): below, a turn is missing."""
LONGEST = 3.0
"""Largest ratio of two axes of a plausible ellipsoid: a small patch of a sphere fits a much flatter one."""
ROUGHEST = 0.1
"""Largest spread of the corrected lengths: above, the points lie on no ellipsoid at all."""
TURN_MORE = "calibration: the directions do not go round all three axes; turn the vehicle about each axis in turn"


@dataclass(frozen=True, slots=True)
class Correction:
    """One sensor's offset [its own unit] and dimensionless matrix."""

    offset: Vec3 = (0.0, 0.0, 0.0)
    matrix: Matrix3 = IDENTITY

    @property
    def idle(self) -> bool:
        """Whether the correction is the identity."""
        return self.offset == (0.0, 0.0, 0.0) and self.matrix == IDENTITY

    def apply(self, x: float, y: float, z: float) -> Vec3:
        """Correct one raw vector.

        Parameters
        ----------
        x, y, z
            In axes of the chip.

        Returns
        -------
        Vec3
            In the same unit.
        """
        ox, oy, oz = self.offset
        a, b, c, d, e, f, g, h, i = self.matrix
        x, y, z = x - ox, y - oy, z - oz
        return (a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)

    def then(self, second: "Correction") -> "Correction":
        """Composition: this correction, then the second."""
        if self.idle:
            return second
        first_matrix, second_matrix = (np.array(one.matrix).reshape(3, 3) for one in (self, second))
        offset = np.array(self.offset) + np.linalg.solve(first_matrix, np.array(second.offset))
        matrix = second_matrix @ first_matrix
        return Correction((float(offset[0]), float(offset[1]), float(offset[2])), tuple(matrix.ravel().tolist()))

    def entries(self, prefix: str, unit: str) -> dict[str, tuple[float, ...]]:
        """Lines for the vehicle file, as `correction` reads them back."""
        return {f"{prefix}_offset_{unit}": self.offset, f"{prefix}_matrix": self.matrix}


def correction(calibration: Mapping[str, tuple[float, ...]], prefix: str, unit: str) -> Correction:
    """Read a correction from a mount.

    Parameters
    ----------
    calibration
        Of the mount: `<prefix>_offset_<unit>` (3) and `<prefix>_matrix` (9) or `<prefix>_scale` (3).
    prefix, unit
        Of the keys.

    Returns
    -------
    Correction
        None of it set: of no effect. UsageError names the key when the number of values is wrong.
    """
    offset = _values(calibration, f"{prefix}_offset_{unit}", 3) or (0.0, 0.0, 0.0)
    x, y, z = _values(calibration, f"{prefix}_scale", 3) or (1.0, 1.0, 1.0)
    matrix = _values(calibration, f"{prefix}_matrix", 9) or (x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z)
    return Correction((offset[0], offset[1], offset[2]), matrix)


def fit_sphere(points: Sequence[Vec3], radius: float | None = None) -> Correction:
    """Fit the correction that maps raw vectors, taken in all directions, onto a sphere.

    Least squares fit of a general ellipsoid x'Ax + b'x = 1 (Li and Griffiths, "Least squares ellipsoid specific
    fitting", GMP 2004, without its constraint, which noise as small as a sensor's does not need); the matrix is the
    symmetric root of A: it stretches and does not turn.

    Parameters
    ----------
    points : (n, 3)
        Raw vectors.
    radius
        Of the sphere, in their unit; None: not known, and the matrix keeps the volume.

    Returns
    -------
    Correction
        Offset and matrix.

    Raises
    ------
    HindraxError
        When the points do not fix an ellipsoid.
    """
    raw = np.asarray(points, dtype=float)
    if raw.ndim != 2 or len(raw) < FEWEST_POINTS:
        raise HindraxError(f"calibration: found {len(raw)} points, wanted at least {FEWEST_POINTS}; record longer")
    middle, size = raw.mean(axis=0), float(np.abs(raw - raw.mean(axis=0)).max()) or 1.0
    A, b = _quadric((raw - middle) / size)
    center = -0.5 * np.linalg.solve(A, b)
    A /= 1.0 + center @ A @ center
    root = _root(A)
    directions = ((raw - middle) / size - center) @ root
    if np.linalg.eigvalsh(np.cov(directions.T)).min() < FLATTEST:
        raise HindraxError(TURN_MORE)
    root *= np.linalg.det(root) ** (-1.0 / 3.0) if radius is None else radius / size
    offset = middle + size * center
    found = Correction((float(offset[0]), float(offset[1]), float(offset[2])), tuple(root.ravel().tolist()))
    left = roundness(points, found)
    if left > ROUGHEST:
        raise HindraxError(
            f"calibration: corrected vectors still differ by {left:.0%} in length, wanted at most {ROUGHEST:.0%}; "
            "turn the vehicle about every axis, slowly, and away from iron and currents that do not turn with it"
        )
    return found


def roundness(points: Sequence[Vec3], fitted: Correction) -> float:
    """Spread of the lengths of the corrected points, as a share of their mean: 0 is a perfect sphere."""
    lengths = np.array([np.linalg.norm(fitted.apply(*point)) for point in points])
    return float(lengths.std() / lengths.mean())


def _root(A: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Symmetric root (3, 3) of a matrix (3, 3); HindraxError unless it is that of a plausible ellipsoid."""
    values, vectors = np.linalg.eigh(A)
    if values.min() * LONGEST**2 <= values.max():
        raise HindraxError(TURN_MORE)
    root: npt.NDArray[np.float64] = vectors @ np.diag(np.sqrt(values)) @ vectors.T
    return root


def _quadric(p: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Least squares of x'Ax + b'x = 1 over points (n, 3): A (3, 3) and b (3)."""
    x, y, z = p.T
    rows = np.column_stack((x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z, x, y, z))
    (a, b, c, d, e, f, g, h, i), _, rank, _ = np.linalg.lstsq(rows, np.ones(len(p)), rcond=1e-9)
    if rank < rows.shape[1]:
        raise HindraxError(TURN_MORE)
    return np.array([[a, d, e], [d, b, f], [e, f, c]]), np.array([g, h, i])


def _values(calibration: Mapping[str, tuple[float, ...]], key: str, count: int) -> tuple[float, ...] | None:
    found = calibration.get(key)
    if found is not None and len(found) != count:
        raise UsageError(f"calibration.{key}: found {len(found)} values, wanted {count}")
    return found
