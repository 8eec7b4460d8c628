"""Array types: double precision; each docstring gives the shape."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]
Index: TypeAlias = NDArray[np.intp]


def array(values: object) -> Array:
    """Numbers as a double-precision array of the same shape (...,); an array of that type is not copied."""
    return np.asarray(values, dtype=np.float64)
