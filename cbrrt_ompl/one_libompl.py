"""Let a process load one copy of libompl, whoever imports OMPL first, without importing it.

The wheel of OMPL 1.7.0 brings libompl twice: its modules link the copy in ``ompl.libs``, and ``ompl.dll_loader`` loads
another one from site-packages for all to see. A process with both frees some globals twice at its end and dies by a
signal (exit code 134 or 139). Without the second copy, the modules find their own, and all is well.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any


def load_one_libompl() -> None:
    """Arrange that OMPL's modules load one copy of libompl, or end well if both copies are there already.

    Costs nothing where OMPL is not installed or never imported. Elsewhere than on Linux nothing is changed.
    """
    if sys.platform != "linux":
        return
    if "ompl.util" in sys.modules:  # the first module that all the others import, and that loads the second copy
        _exit_without_destructors()
    elif not any(isinstance(finder, _BeforeOmpl) for finder in sys.meta_path):
        sys.meta_path.insert(0, _BeforeOmpl())


class _BeforeOmpl:
    """Finds nothing; disarms ``ompl.dll_loader`` just before the first of OMPL's modules is looked for."""

    def find_spec(self, name: str, path: Sequence[str] | None = None, target: Any = None) -> None:
        """Called by Python's import with the full name of every module that is not imported yet."""
        if name.startswith("ompl.") and "ompl" in sys.modules:
            sys.modules["ompl"].dll_loader = lambda *_: None  # type: ignore[attr-defined]
            sys.meta_path.remove(self)


def _exit_without_destructors() -> None:
    """End the process, when Python has shut down, before the destructors of the two copies of libompl.

    glibc calls what is registered last first, so this comes after everything of Python and before the destructors of
    libraries that were loaded earlier. The exit code stays what it is.
    """
    import atexit
    import ctypes

    libc = ctypes.CDLL(None)
    if not _BOTH_COPIES and has_two_copies():
        _BOTH_COPIES.append(libc)
        libc.on_exit(libc._exit, None)
        atexit.register(libc.fflush, None)


_BOTH_COPIES: list[Any] = []
"""The C library, once its ``on_exit`` has been told what to do."""


def has_two_copies() -> bool:
    """Whether two files called libompl are mapped into this process."""
    try:
        with open("/proc/self/maps", encoding="utf-8", errors="replace") as maps:
            files = {line.split(maxsplit=5)[-1].strip() for line in maps if "/libompl" in line}
    except OSError:
        return True
    return len(files) > 1
