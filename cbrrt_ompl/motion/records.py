"""Arrays of named records, as kernels take them from Python at the least cost."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numba import config
from numpy.typing import NDArray

_IS_PLAIN = bool(getattr(config, "DISABLE_JIT", False))
"""Whether kernels are plain Python: NUMBA_DISABLE_JIT=1."""

Record: TypeAlias = Any
"""One record: in kernels its fields are attributes."""

Records: TypeAlias = NDArray[Any]
"""An array of records; numba takes one from Python at a fraction of the cost of a named tuple."""


def record_array(count: int, dtype: np.dtype[Any]) -> Records:
    """Records of zeros, shape (count,).

    Where numba is switched off, their fields are attributes in Python as well, as they always are in kernels.
    """
    return as_records(np.zeros(count, dtype=dtype))


def as_records(array: Records) -> Records:
    """An array as :func:`record_array` makes it, without a copy."""
    return array.view(np.recarray) if _IS_PLAIN else array
