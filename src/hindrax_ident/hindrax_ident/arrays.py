"""The one kind of array used here: double precision, shape told in each docstring."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]
Index: TypeAlias = NDArray[np.intp]


def array(values: Any) -> Array:
    """Any numbers as an array of double precision; what is one already is not copied."""
    return np.asarray(values, dtype=np.float64)
