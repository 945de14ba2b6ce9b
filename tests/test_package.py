"""The package as a whole: its public names, its imports and how a process that uses it ends."""

from __future__ import annotations

import ast
import json
import pickle
import re
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import cbrrt_ompl
from cbrrt_ompl.errors import MISSING, InputError, Problem, ScenarioError, UnknownPlannerError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


DISTRIBUTIONS = {"fcl": "python-fcl", "yaml": "pyyaml", "PIL": "pillow"}
"""Distributions whose name is not that of the module."""


@pytest.fixture(scope="module")
def project(repository: Path) -> dict[str, Any]:
    """The table of the project in pyproject.toml."""
    with (repository / "pyproject.toml").open("rb") as file:
        table: dict[str, Any] = tomllib.load(file)["project"]
    return table


@pytest.fixture(scope="module")
def locked(repository: Path) -> list[Requirement]:
    """The lines of the lock."""
    lines = (repository / "requirements.lock").read_text(encoding="utf-8").splitlines()
    return [Requirement(line) for line in lines if not line.startswith("#")]


def same_name(first: Requirement, second: Requirement) -> bool:
    return canonicalize_name(first.name) == canonicalize_name(second.name)


def run_python(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.needs_ompl
@pytest.mark.parametrize(
    ("ending", "exit_code"),
    [("pass", 0), ("sys.exit(0)", 0), ("sys.exit(3)", 3), ("raise RuntimeError('on purpose')", 1)],
    ids=["import alone", "exit 0", "exit 3", "uncaught exception"],
)
def test_a_process_that_imported_ompl_ends_with_its_own_exit_code(ending: str, exit_code: int) -> None:
    """OMPL's wheel loads libompl twice, and every process that imported it ended in "double free"."""
    done = run_python(f"import sys\nimport cbrrt_ompl.ompl_plugin.binding\n{ending}")
    assert done.returncode == exit_code, done.stderr
    assert ("on purpose" in done.stderr) == (exit_code == 1)


@pytest.mark.needs_ompl
def test_a_process_that_planned_ends_with_its_own_exit_code(scenarios: Path) -> None:
    code = f"""import sys, cbrrt_ompl
result = cbrrt_ompl.plan(cbrrt_ompl.load_scenario({str(scenarios / "paper_case1.yaml")!r}), time_limit=0.05)
sys.exit(7)"""
    done = run_python(code)
    assert done.returncode == 7, done.stderr


@pytest.mark.needs_ompl
@pytest.mark.parametrize("module", ["util", "base", "control", "geometric", "tools"])
@pytest.mark.parametrize("first", ["import cbrrt_ompl", "import ompl\nimport cbrrt_ompl", ""])
def test_ompl_may_be_imported_before_the_first_plan_and_before_the_package(first: str, module: str) -> None:
    """OMPL's modules loaded a second libompl unless our binding came first, and the process died at its end."""
    code = f"""import os
os.environ["CBRRT_OMPL_COMPILED_METHODS"] = "1"
{first}
from ompl import {module}
import sys, cbrrt_ompl
setup = cbrrt_ompl.make_setup(cbrrt_ompl.load_scenario("paper_case1"), "rrt")
assert {module}.__name__ == "ompl.{module}"
print("made a set-up")
sys.exit(5)"""
    done = run_python(code)
    assert (done.returncode, done.stdout) == (5, "made a set-up\n")
    if first:
        assert done.stderr == ""
    else:
        assert done.stderr.count("\n") == 1
        assert "import cbrrt_ompl before OMPL's modules" in done.stderr


@pytest.mark.needs_ompl
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere the wheel is loaded as it is")
def test_one_libompl_is_loaded_where_the_package_comes_first() -> None:
    code = """import cbrrt_ompl
from ompl import base
print(len({line.split()[-1] for line in open("/proc/self/maps") if "/libompl" in line}))"""
    assert run_python(code).stdout == "1\n"


def test_importing_the_package_imports_nothing_heavy() -> None:
    done = run_python("import sys, json, cbrrt_ompl; print(json.dumps([m.split('.')[0] for m in sys.modules]))")
    assert done.returncode == 0, done.stderr
    assert not {"ompl", "numba", "matplotlib", "numpy", "shapely", "fcl"} & set(json.loads(done.stdout))


def test_public_names_are_sorted_and_resolve() -> None:
    assert cbrrt_ompl.__all__ == sorted(cbrrt_ompl.__all__)
    for name in cbrrt_ompl.__all__:
        assert getattr(cbrrt_ompl, name) is not None
    assert set(cbrrt_ompl.__all__) <= set(dir(cbrrt_ompl))


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'plam'"):
        _ = cbrrt_ompl.plam


def test_the_version_is_that_of_the_project(project: dict[str, Any]) -> None:
    try:
        version("cbrrt-ompl")
    except PackageNotFoundError:
        pytest.skip("a checkout that is not installed has no version")
    assert cbrrt_ompl.__version__ == project["version"]


def test_every_third_party_import_is_a_declared_dependency(repository: Path, project: dict[str, Any]) -> None:
    imported = set()
    for path in (repository / "cbrrt_ompl").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                imported |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                imported.add(node.module.split(".")[0])
    third_party = imported - sys.stdlib_module_names - {"cbrrt_ompl"}
    lines = [*project["dependencies"], *project["optional-dependencies"]["notebooks"]]
    declared = {Requirement(line).name.lower() for line in lines}
    in_every_notebook = {"IPython"}
    assert {DISTRIBUTIONS.get(name, name) for name in third_party - in_every_notebook} <= declared


def test_no_dependency_is_declared_twice(project: dict[str, Any]) -> None:
    for lines in (project["dependencies"], *project["optional-dependencies"].values()):
        names = [(Requirement(line).name, *Requirement(line).extras) for line in lines]
        assert len(names) == len(set(names))


def test_the_lock_holds_one_version_of_everything_for_every_python(locked: list[Requirement]) -> None:
    """Names and versions alone: a line that named a registry would be no requirement, or one with an address."""
    assert all(re.fullmatch(r"==[\w.+!]+", str(line.specifier)) and line.url is None for line in locked)
    for minor in range(10, 15):
        here = {"python_version": f"3.{minor}", "python_full_version": f"3.{minor}.9"}
        names = [line.name for line in locked if line.marker is None or line.marker.evaluate(here)]
        assert len(names) == len(set(names))
        assert ("ompl" in names) == (minor <= 12)


def test_the_lock_keeps_to_the_ranges_of_the_project(project: dict[str, Any], locked: list[Requirement]) -> None:
    """Where it does not: make lock."""
    extras = project["optional-dependencies"]
    for wanted in map(Requirement, project["dependencies"] + extras["test"] + extras["docs"] + extras["distributed"]):
        versions = [next(iter(line.specifier)).version for line in locked if same_name(line, wanted)]
        assert versions or wanted.name == "cbrrt-ompl", wanted.name
        if wanted.marker is None:
            assert all(wanted.specifier.contains(version) for version in versions), wanted.name


@pytest.mark.parametrize(
    "error",
    [
        ScenarioError([Problem("goal", MISSING, "the goal"), Problem("start.x", "a", "a number")], "x.yaml"),
        UnknownPlannerError("rtt", ["rrt"]),
    ],
    ids=lambda error: type(error).__name__,
)
def test_errors_come_out_of_another_process_as_they_are(error: InputError) -> None:
    """One was told as a crash of its process, since it could not be made again."""
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)
