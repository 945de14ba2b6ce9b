"""Keep compiled kernels on the disk, and from outliving their sources."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba.core import config
from numba.core.caching import FunctionCache, _CacheLocator
from numba.core.runtime import rtsys
from numba.misc.appdirs import AppDirs


class KernelCache(FunctionCache):
    """numba's cache of a kernel, which costs little before the kernel is called.

    numba looks for the files of a kernel when it is defined, though most are parts of others and never called; and it
    loads all that a compiler needs before it reads the first file, a fifth of a start.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        """Look for nothing yet."""
        self._function = function

    def __getattr__(self, name: str) -> Any:
        """What numba's cache consists of, made when something of it is first asked for."""
        if "_enabled" in self.__dict__ or name.startswith("__"):
            raise AttributeError(name)
        try:
            super().__init__(self._function)
        except RuntimeError:  # there is nowhere to write
            self.__dict__.update(_cache_path=None, _cache_file=None, _enabled=False)
        return getattr(self, name)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The kernel for some types, None where it is not on the disk: numba prepares for a compilation itself."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)


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
        for cache in {cache for folder in {path.parent for path in modules} for cache in _caches_of(folder)}:
            for index in cache.glob("*.nbi"):
                if index.stat().st_mtime_ns < newest:
                    index.unlink(missing_ok=True)


def _caches_of(folder: Path) -> Iterator[Path]:
    """The folders in which numba may keep the kernels of a folder's modules."""
    yield folder / "__pycache__"
    subfolder = _CacheLocator.get_suitable_cache_subpath(str(folder / "any.py"))
    for root in (str(vars(config)["CACHE_DIR"]), AppDirs(appname="numba", appauthor=False).user_cache_dir):
        if root:
            yield Path(root) / subfolder
