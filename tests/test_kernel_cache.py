"""Compiled kernels must not outlive what they were compiled from."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from numba import config
from numba.core.caching import FunctionCache, _CacheLocator
from numba.misc.appdirs import AppDirs

from cbrrt_ompl.kernels import kernel
from cbrrt_ompl.kernels.cache import drop_stale_kernels

PLAN = """
import sys
from cbrrt_ompl import load_scenario, plan
assert plan(load_scenario("paper_case1"), "{planner}", seed=1, max_iterations={iterations}).solved
print(*(name for name in ("numba.np.arraymath", "scipy.linalg", "cbrrt_ompl.optimise") if name in sys.modules))
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """Two modules, the second with a cached kernel that is younger than both."""
    (tmp_path / "__pycache__").mkdir()
    for age, name in ((300, "callee.py"), (300, "caller.py"), (200, "__pycache__/caller.kernel-1.py311.nbi")):
        (tmp_path / name).touch()
        os.utime(tmp_path / name, (1e9 - age, 1e9 - age))
    return tmp_path


def test_a_kernel_younger_than_all_modules_is_kept(package: Path) -> None:
    drop_stale_kernels(package)
    assert len(list(package.rglob("*.nbi"))) == 1


def test_a_kernel_is_dropped_when_a_module_that_it_may_call_has_changed(package: Path) -> None:
    """Numba looks at caller.py alone, and would go on with callee.py as it was."""
    os.utime(package / "callee.py", (1e9 - 100, 1e9 - 100))
    drop_stale_kernels(package)
    assert list(package.rglob("*.nbi")) == []


@pytest.mark.parametrize("root", ["given", "of the user"])
def test_caches_elsewhere_are_looked_through_too(
    package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, root: str
) -> None:
    """With NUMBA_CACHE_DIR, and where the package's folder cannot be written."""
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "given"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "of the user"))
    roots = {"given": tmp_path / "given", "of the user": Path(AppDirs("numba", appauthor=False).user_cache_dir)}
    index = roots[root] / _CacheLocator.get_suitable_cache_subpath(str(package / "caller.py")) / "caller.nbi"
    index.parent.mkdir(parents=True)
    index.touch()
    drop_stale_kernels(package)
    assert index.exists()
    os.utime(index, (1e9 - 400, 1e9 - 400))
    drop_stale_kernels(package)
    assert not index.exists()


def test_a_folder_that_is_not_there_is_no_error(tmp_path: Path) -> None:
    drop_stale_kernels(tmp_path / "missing" / "package.zip")


@pytest.mark.skipif(bool(vars(config)["DISABLE_JIT"]), reason="kernels are plain Python here")
@pytest.mark.parametrize(
    ("planner", "iterations", "loaded"),
    [
        ("cb-rrt-compiled", None, ""),
        pytest.param("cb-rrt", None, "", marks=pytest.mark.needs_ompl),
        ("cb-rrt-anytime", 50, "cbrrt_ompl.optimise"),
    ],
)
def test_a_start_from_the_disk_loads_no_compiler(planner: str, iterations: int | None, loaded: str) -> None:
    """What numba prepares for a compilation, SciPy's linear algebra with it, took a third of each start."""
    command = [sys.executable, "-c", PLAN.format(planner=planner, iterations=iterations)]
    subprocess.run(command, check=True, capture_output=True)  # leaves all kernels on the disk
    found = subprocess.run(command, check=True, capture_output=True, text=True)
    assert found.stdout.strip() == loaded


@pytest.mark.skipif(bool(vars(config)["DISABLE_JIT"]), reason="kernels are plain Python here")
def test_kernels_run_where_nothing_can_be_written(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any) -> None:
        raise RuntimeError("cannot cache function 'double': no locator available")  # as numba says

    def double(x: float) -> float:
        return 2.0 * x

    monkeypatch.setattr(FunctionCache, "__init__", refuse)
    assert kernel(double)(1.5) == 3.0


def test_only_kernels_call_a_kernel_without_a_way_in_from_python(repository: Path) -> None:
    """`candidate` had none, and a figure of an extension called it: the process died of a segmentation fault."""
    trees = {path: ast.parse(path.read_text(encoding="utf-8")) for path in (repository / "cbrrt_ompl").rglob("*.py")}
    functions = [
        (path, node) for path, tree in trees.items() for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)
    ]
    marks = {id(node): " ".join(map(ast.unparse, node.decorator_list)) for _, node in functions}
    inner = {node.name for _, node in functions if "inner_kernel" in marks[id(node)]}
    assert inner
    wrong = [
        f"{path.name}: {node.name} calls {call.func.id}"
        for path, node in functions
        if not re.search("kernel|njit|jitable|overload|cfunc", marks[id(node)])
        for call in ast.walk(node)
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id in inner
    ]
    assert wrong == []
