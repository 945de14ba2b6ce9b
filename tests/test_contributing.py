"""What the page on contributing says is enough, is: its recipes, done in a copy of the package."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from cbrrt_ompl import load_scenario, plan
from cbrrt_ompl.planners.registry import PLANNERS

NEW = re.compile(
    r"^New, `(\S+)`:\n\n<!-- not run: a module of the package -->\n```python\n(.*?)^```$", re.MULTILINE | re.DOTALL
)
ROW = re.compile(
    r"^A row of `(\w+)` in `(\S+)`:\n\n<!-- not run: a row of a table -->\n```\w+\n(.*?)^```$", re.MULTILINE | re.DOTALL
)


@pytest.fixture(scope="module")
def page(repository: Path) -> str:
    return (repository / "docs" / "contributing.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def extended(repository: Path, page: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a copy of the package to which all that the page shows was added."""
    root = tmp_path_factory.mktemp("extended")
    for folder in ("cbrrt_ompl", "scenarios"):
        shutil.copytree(repository / folder, root / folder, ignore=shutil.ignore_patterns("__pycache__"))
    for file, code in NEW.findall(page):
        assert not (root / file).exists()
        (root / file).write_text(code, encoding="utf-8")
    for table, file, code in ROW.findall(page):
        add_row(root / file, table, code)
    return root


def add_row(file: Path, table: str, code: str) -> None:
    """Add a row at the end of a table of a module, and the imports before it at the module's beginning."""
    imports = "".join(re.findall(r"^from .*\n", code, flags=re.MULTILINE))
    row = code.removeprefix(imports)
    text = file.read_text(encoding="utf-8").replace("\nfrom cbrrt_ompl", f"\n{imports}from cbrrt_ompl", 1)
    text, count = re.subn(
        rf"^({table}\b.*[({{]\n(?:[ #].*\n)*)", lambda found: found[1] + row, text, flags=re.MULTILINE
    )
    assert count == 1, (file, table)
    file.write_text(text, encoding="utf-8")


def run(extended: Path, *arguments: str) -> str:
    """What Python prints with the copy of the package, in an empty folder."""
    environment = {**os.environ, "PYTHONPATH": str(extended)}
    folder = extended / "empty"
    folder.mkdir(exist_ok=True)
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_page_adds_one_file_and_one_row_for_each(page: str) -> None:
    recipes = re.split(
        r"^### ", page.partition("\n## Add something\n")[2].partition("\n### What takes more")[0], flags=re.MULTILINE
    )
    assert [(len(NEW.findall(recipe)), len(ROW.findall(recipe))) for recipe in recipes[1:]] == [(1, 1)] * 5


@pytest.mark.slow
def test_a_law_of_the_page_is_known_and_compiled(extended: Path) -> None:
    code = """
from cbrrt_ompl.motion.laws import known_laws, law_named
from cbrrt_ompl.problem.robot import Gains, Limits
law = law_named("pure-pursuit")
print("pure-pursuit" in known_laws(), law.is_compiled, law.function((1.0, 1.0, 0.0), Limits(), Gains())[1])"""
    assert run(extended, "-c", code).split() == ["True", "True", "1.0"]


def test_a_footprint_of_the_page_is_read_by_its_type_or_its_keys(extended: Path) -> None:
    code = """
from cbrrt_ompl.scenario.footprints import footprint
from cbrrt_ompl.scenario.sections import Report
report = Report()
typed = footprint({"type": "rectangle", "length": 0.5, "width": 0.4}, "robot.footprint", report)
untyped = footprint({"length": 0.5, "width": 0.4}, "robot.footprint", report)
footprint({"type": "rectangle", "length": 0.5}, "robot.footprint", report)
print(typed == untyped, typed.vertices.max(axis=0), *report.problems)"""
    assert run(extended, "-c", code) == "True [0.25 0.2 ] robot.footprint.width: missing, expected the width [m]\n"


def test_a_map_of_the_page_is_read(extended: Path) -> None:
    header = "ncols 3\nnrows 2\nxllcorner 1\nyllcorner 2\ncellsize 0.5\n"
    (extended / "grid.asc").write_text(header + "0 0 1\n0 0 0\n", encoding="ascii")
    (extended / "torn.asc").write_text(header + "0 0 1\n0 0\n", encoding="ascii")
    code = """
from cbrrt_ompl import load_map
from cbrrt_ompl.errors import MapError
from cbrrt_ompl.scenario.sources import has_no_scale, is_map
from pathlib import Path
found = load_map("../grid.asc")
print(found.cells.tolist(), found.resolution, found.origin, is_map(Path("grid.asc")), has_no_scale(Path("grid.asc")))
try:
    load_map("../torn.asc")
except MapError as error:
    print(error)"""
    told = run(extended, "-c", code).splitlines()
    assert told[0] == "[[0, 0, 0], [0, 0, 100]] 0.5 (1.0, 2.0, 0.0) True False"
    assert len(told) == 2 and told[1].startswith("../torn.asc: ") and told[1].endswith("expected an ASCII grid")


def test_a_command_of_the_page_runs_and_is_in_the_help(extended: Path) -> None:
    assert run(extended, "-m", "cbrrt_ompl", "laws").split() == ["kanayama", "posq", "pure-pursuit"]
    assert "list the control laws" in run(extended, "-m", "cbrrt_ompl", "--help")


@pytest.mark.needs_ompl
def test_a_planner_of_the_page_is_listed_and_can_be_made(extended: Path) -> None:
    assert "greedy-rrt " in run(extended, "-m", "cbrrt_ompl", "planners")
    code = """
from importlib import import_module
from cbrrt_ompl.ompl_plugin.binding import ob, oc
from cbrrt_ompl.planners.registry import planner_named
module, _, name = planner_named("greedy-rrt").ompl_class.rpartition(".")
space = ob.SE2StateSpace()
si = oc.SpaceInformation(space, oc.RealVectorControlSpace(space, 2))
print(getattr(import_module(module), name)(si).getGoalBias())"""
    assert run(extended, "-c", code).split() == ["0.5"]


@pytest.mark.slow
@pytest.mark.needs_ompl
def test_a_class_of_another_module_plans_under_the_name_of_its_row(monkeypatch: pytest.MonkeyPatch) -> None:
    from cbrrt_ompl.ompl_plugin.binding import oc

    made = []

    class OwnRRT(oc.RRT):  # type: ignore[misc]
        def __init__(self, si: object) -> None:
            super().__init__(si)
            made.append(self)

    monkeypatch.setattr(sys.modules[__name__], "OwnRRT", OwnRRT, raising=False)
    monkeypatch.setitem(PLANNERS, "own-rrt", replace(PLANNERS["rrt"], ompl_class=f"{__name__}.OwnRRT"))
    result = plan(load_scenario("paper_case1"), "own-rrt", seed=1)
    assert (result.status, result.planner, len(made)) == ("solved", "own-rrt", 1)
    assert made[0].getName() == "own-rrt"
