"""Compile kernels in a second process: numba uses one core, and both find what the other has done on the disk."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cbrrt_ompl.processes import available_cores

_IS_BESIDE = "CBRRT_OMPL_COMPILES_BESIDE"
"""In the environment of the second process: it starts no third one."""

_running: list[subprocess.Popen[bytes]] = []
"""Processes that compile beside this one: no more than there are other cores."""

_CODE = """
import sys
sys.path[:] = {path!r}
from cbrrt_ompl.processes import die_with_parent
die_with_parent({parent})
from {module} import {function}
{function}()
"""


@contextmanager
def compiled_beside(module: str, function: str, kernel: Any) -> Iterator[None]:
    """Have a second process compile while the block runs, if there is anything to compile; then wait for it.

    Nothing depends on it but the time: what it leaves undone is compiled where it is called. There is none on a single
    core, where numba keeps no kernels on the disk, or where Python is a part of another program.

    Args:
        module: name of a module of this package.
        function: name of a function in it that makes kernels ready.
        kernel: one of them; where it has been compiled before, all have.
    """
    is_python = Path(sys.executable or "").name.startswith("python")
    is_of_use = is_python and _index_of(kernel) is not None and not is_kept(kernel)
    if os.environ.get(_IS_BESIDE) or not is_of_use or len(_running) + 1 >= available_cores():
        yield
        return
    try:
        process = _start(module, function)
    except OSError:  # the limit of processes
        yield
        return
    _running.append(process)
    try:
        yield
        process.wait()
    finally:
        process.kill()
        process.wait()
        _running.remove(process)


def _start(module: str, function: str) -> subprocess.Popen[bytes]:
    """Start the second process."""
    code = _CODE.format(path=sys.path, parent=os.getpid(), module=module, function=function)
    return subprocess.Popen(
        [sys.executable, "-c", code],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, _IS_BESIDE: "1"},
        start_new_session=True,  # Ctrl-C is for the first process
    )


def is_kept(kernel: Any) -> bool:
    """Whether a kernel has been compiled, by this process or into a file that it finds, or need not be."""
    index = _index_of(kernel)
    return bool(getattr(kernel, "signatures", True)) or (index is not None and index.exists())


def _index_of(kernel: Any) -> Path | None:
    """The file that says what of a kernel is on the disk; None where numba keeps nothing there."""
    cache = getattr(getattr(kernel, "_cache", None), "_cache_file", None)
    index = getattr(cache, "_index_path", None)
    return None if index is None else Path(index)
