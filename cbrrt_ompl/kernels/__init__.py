"""How kernels are compiled: kept on disk, never older than their sources, never interrupted half-way."""

from __future__ import annotations

from functools import partial
from typing import Any

from numba import njit

from cbrrt_ompl.kernels.cache import drop_stale_kernels
from cbrrt_ompl.kernels.interrupts import hold_interrupts

drop_stale_kernels()
hold_interrupts()

kernel: Any = partial(njit, cache=True, error_model="numpy")
"""Decorator of a kernel that Python calls, too; 1 / 0 is infinite in it, as in NumPy."""

inner_kernel: Any = partial(njit, cache=True, error_model="numpy", no_cpython_wrapper=True)
"""Decorator of a kernel that only kernels call: it compiles in four fifths of the time; a call from Python crashes."""
