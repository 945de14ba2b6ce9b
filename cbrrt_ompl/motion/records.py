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


def put_records(target: Records, source: Records) -> None:
    """Write records over the first ones of an array, byte by byte: NumPy takes ten times as long, field by field.

    Args:
        target: shape (n,), contiguous.
        source: of the same type, shape (m,) of at most n, contiguous.
    """
    np.asarray(target).view(np.uint8)[: source.nbytes] = np.asarray(source).view(np.uint8)


def copied_records(source: Records) -> Records:
    """A copy of records, see :func:`put_records`; shape (n,), contiguous."""
    target = as_records(np.empty(len(source), dtype=source.dtype))
    put_records(target, source)
    return target
