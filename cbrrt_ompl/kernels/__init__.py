"""How kernels are compiled: kept on disk, never older than their sources, never interrupted half-way."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from numba import config, njit
from numba.core.ccallback import CFunc
from numba.core.sigutils import normalize_signature

from cbrrt_ompl.kernels.cache import KernelCache, drop_stale_kernels
from cbrrt_ompl.kernels.interrupts import hold_interrupts

drop_stale_kernels()
hold_interrupts()


def kernel(function: Any = None, **options: Any) -> Any:
    """Decorator of a kernel that Python calls, too; 1 / 0 is infinite in it, as in NumPy.

    Args:
        function: to be compiled when it is first called; None where options are given.
        options: what else numba's ``njit`` is told.
    """
    if function is None:
        return partial(kernel, **options)
    dispatcher = njit(error_model="numpy", **options)(function)
    if hasattr(dispatcher, "enable_caching"):  # no plain function, as with NUMBA_DISABLE_JIT
        dispatcher._cache = KernelCache(function)  # what enable_caching() does with numba's own kind
    return dispatcher


inner_kernel = partial(kernel, no_cpython_wrapper=True)
"""Decorator of a kernel that only kernels call: it compiles in four fifths of the time; a call from Python crashes."""


def callback(signature: Any) -> Callable[[Callable[..., Any]], CFunc]:
    """Decorator of a C function that others call by its address, compiled or read from the disk at once.

    With ``NUMBA_DISABLE_JIT`` it has none: the kernels that it calls are plain Python then.

    Args:
        signature: its types, as for numba's ``cfunc``.
    """

    def compiled(function: Callable[..., Any]) -> CFunc:
        found: Any = CFunc(function, normalize_signature(signature), {}, {})
        found._cache = KernelCache(function)
        if not vars(config)["DISABLE_JIT"]:
            found.compile()
        return found

    return compiled
