"""Keep compiled kernels from outliving their sources."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path


def drop_stale_kernels(package: Path = Path(__file__).parent) -> None:
    """Delete cached kernels that are older than any module of the package.

    numba compiles a kernel again when its own file has changed, but not when a kernel of another file has that it calls
    and holds a copy of: after an update, old and new code would run together.

    Args:
        package: folder of the modules; their caches are in the ``__pycache__`` folders beside them.
    """
    with suppress(OSError):  # a folder that cannot be read or written holds no cache of ours
        newest = max((path.stat().st_mtime_ns for path in package.rglob("*.py")), default=0)
        for index in package.rglob("__pycache__/*.nbi"):
            if index.stat().st_mtime_ns < newest:
                index.unlink(missing_ok=True)
