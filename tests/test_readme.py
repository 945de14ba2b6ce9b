"""The README: its example runs, its scenario loads, its commands exist, its links lead somewhere."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from cbrrt_ompl.cli import build_parser
from cbrrt_ompl.scenario.scenario import load_scenario


@pytest.fixture(scope="module")
def readme(repository: Path) -> str:
    return (repository / "README.md").read_text(encoding="utf-8")


def blocks(text: str, language: str) -> list[str]:
    """The code blocks of a language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL)


@pytest.mark.needs_ompl
def test_the_example_runs_and_finds_a_valid_trajectory(
    readme: str, repository: Path, scenarios: Path, tmp_path: Path
) -> None:
    (example,) = blocks(readme, "python")
    shutil.copytree(scenarios, tmp_path / "scenarios")
    command, environment = [sys.executable, "-c", example], {**os.environ, "PYTHONPATH": str(repository)}
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("solved: ")
    assert ": valid\n" in done.stdout
    assert (tmp_path / "case1.csv").is_file()


def test_the_example_has_ten_lines_of_code(readme: str) -> None:
    (example,) = blocks(readme, "python")
    assert len([line for line in example.splitlines() if line.strip()]) <= 10


def test_the_scenario_can_be_loaded(readme: str, tmp_path: Path) -> None:
    text, _ = blocks(readme, "yaml")
    path = tmp_path / "scenario.yaml"
    path.write_text(text, encoding="utf-8")
    scenario = load_scenario(path)
    assert scenario.name == "two-gaps"
    assert len(scenario.world.obstacles) == 3


def test_the_commands_exist(readme: str, repository: Path) -> None:
    lines = [line.removeprefix("$ ") for block in blocks(readme, "console") for line in block.splitlines()]
    commands = [shlex.split(line, comments=True) for line in lines]
    assert {words[0] for words in commands} == {"make", "cbrrt"}
    makefile = (repository / "Makefile").read_text(encoding="utf-8")
    for program, *arguments in commands:
        if program == "make":
            assert re.search(rf"^{arguments[0]}:", makefile, flags=re.MULTILINE)
        else:
            assert callable(build_parser().parse_args(arguments).run)


@pytest.mark.parametrize("page", ["README.md", "docs/architecture.md", "docs/reproduction.md"])
def test_local_links_lead_to_files(repository: Path, page: str) -> None:
    text = (repository / page).read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#]+)\)", text):
        if "://" not in target:
            assert (repository / page).parent.joinpath(target).is_file(), target


def test_architecture_names_every_module(repository: Path) -> None:
    text = (repository / "docs" / "architecture.md").read_text(encoding="utf-8")
    modules = {path.name for path in (repository / "cbrrt_ompl").glob("*.py")} - {"__init__.py", "__main__.py"}
    assert {name for name in modules if name not in text} == set()


def test_the_picture_is_small(repository: Path) -> None:
    assert (repository / "docs" / "images" / "paper_case1.gif").stat().st_size < 400_000
