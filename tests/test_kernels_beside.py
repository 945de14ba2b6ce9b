"""A second process that compiles."""

from __future__ import annotations

import importlib
import time
from pathlib import Path
from types import ModuleType

import pytest

from cbrrt_ompl.kernels import beside
from cbrrt_ompl.kernels.beside import compiled_beside

MODULE = """
import time
from numba import njit

@njit(cache=True)
def double(x):
    return 2 * x

def compile_it():
    double(1.0)

def fail():
    raise RuntimeError

def sleep():
    time.sleep(100.0)
"""


@pytest.fixture
def module(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """A module of its own for each test, which numba keeps the kernels of beside it."""
    monkeypatch.setattr(beside, "available_cores", lambda: 2)
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    name = f"module_of_{request.node.name}"
    (tmp_path / f"{name}.py").write_text(MODULE, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    return importlib.import_module(name)


def kept_kernels(module: ModuleType) -> list[Path]:
    return list(Path(str(module.__file__)).parent.rglob("*.nbi"))


def test_the_second_process_leaves_the_kernel_on_the_disk(module: ModuleType) -> None:
    with compiled_beside(module.__name__, "compile_it", module.double):
        assert not module.double.signatures
    assert len(kept_kernels(module)) == 1
    assert module.double(1.0) == 2.0
    assert sum(module.double.stats.cache_hits.values()) == 1
    assert not module.double.stats.cache_misses


@pytest.mark.parametrize("reason", ["one core", "in the second process", "embedded"])
def test_there_is_no_second_process_where_it_would_not_help(
    module: ModuleType, monkeypatch: pytest.MonkeyPatch, reason: str
) -> None:
    if reason == "one core":
        monkeypatch.setattr(beside, "available_cores", lambda: 1)
    elif reason == "embedded":
        monkeypatch.setattr("sys.executable", "/usr/bin/blender")
    else:
        monkeypatch.setenv("CBRRT_OMPL_COMPILES_BESIDE", "1")
    with compiled_beside(module.__name__, "compile_it", module.double):
        assert not beside._running
    assert not kept_kernels(module)


def test_what_is_compiled_already_starts_no_process(module: ModuleType) -> None:
    module.double(1.0)
    with compiled_beside(module.__name__, "sleep", module.double):
        assert not beside._running


def test_a_second_process_that_fails_leaves_the_work_to_the_first(
    module: ModuleType, capfd: pytest.CaptureFixture[str]
) -> None:
    with compiled_beside(module.__name__, "fail", module.double):
        pass
    assert module.double(1.0) == 2.0
    assert capfd.readouterr() == ("", "")


def test_an_interrupt_ends_the_second_process(module: ModuleType) -> None:
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt), compiled_beside(module.__name__, "sleep", module.double):
        (process,) = beside._running
        raise KeyboardInterrupt
    assert process.returncode == -9
    assert not beside._running
    assert time.monotonic() - began < 50.0
