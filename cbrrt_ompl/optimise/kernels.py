"""How the kernels of this wing are compiled."""

from __future__ import annotations

from functools import partial
from typing import Any

from numba import njit

kernel: Any = partial(njit, cache=True, error_model="numpy")
"""Decorator of a kernel that Python calls."""

inner_kernel: Any = partial(njit, cache=True, error_model="numpy", no_cpython_wrapper=True)
"""Decorator of a kernel that only kernels call: it compiles in four fifths of the time; a call from Python crashes."""
