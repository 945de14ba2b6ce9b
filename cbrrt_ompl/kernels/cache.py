"""Keep compiled kernels from outliving their sources."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from numba.core import config
from numba.core.caching import _CacheLocator
from numba.misc.appdirs import AppDirs


def drop_stale_kernels(package: Path = Path(__file__).parents[1]) -> None:
    """Delete cached kernels that are older than any module of the package.

    numba compiles a kernel again when its own file has changed, but not when a kernel of another file has that it calls
    and holds a copy of: after an update, old and new code would run together.

    Args:
        package: folder of the modules; their caches are in the ``__pycache__`` folders beside them, in
            ``NUMBA_CACHE_DIR``, or where numba puts those of folders that cannot be written.
    """
    with suppress(OSError):  # a folder that cannot be read or written holds no cache of ours
        modules = list(package.rglob("*.py"))
        newest = max((path.stat().st_mtime_ns for path in modules), default=0)
        for cache in {cache for path in modules for cache in _caches_of(path)}:
            for index in cache.glob("*.nbi"):
                if index.stat().st_mtime_ns < newest:
                    index.unlink(missing_ok=True)


def _caches_of(module: Path) -> Iterator[Path]:
    """The folders in which numba may keep the kernels of a module."""
    yield module.parent / "__pycache__"
    subfolder = _CacheLocator.get_suitable_cache_subpath(str(module))
    for root in (str(vars(config)["CACHE_DIR"]), AppDirs(appname="numba", appauthor=False).user_cache_dir):
        if root:
            yield Path(root) / subfolder
