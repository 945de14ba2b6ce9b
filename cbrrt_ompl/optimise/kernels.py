"""How the kernels of this wing are compiled, and what they call a record."""

from __future__ import annotations

from functools import partial
from typing import Any, TypeAlias

from numba import njit

kernel: Any = partial(njit, cache=True, error_model="numpy")
"""Decorator of a kernel that Python calls."""

inner_kernel: Any = partial(njit, cache=True, error_model="numpy", no_cpython_wrapper=True)
"""Decorator of a kernel that only kernels call: it compiles in four fifths of the time; a call from Python crashes."""

Record: TypeAlias = Any
"""One element of a structured array: kernels read its fields as attributes, which no type of NumPy's has."""
