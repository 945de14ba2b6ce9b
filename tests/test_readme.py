"""The README: its example runs, its scenario loads, its commands exist, its links lead somewhere."""

from __future__ import annotations

import io
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from PIL import Image

from cbrrt_ompl.cli import build_parser
from cbrrt_ompl.figures.animation import animate
from cbrrt_ompl.figures.film import frame_times
from cbrrt_ompl.figures.layout import DPI
from cbrrt_ompl.planning import plan
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


@pytest.mark.skipif(
    matplotlib.__version_info__ < (3, 11), reason="it was drawn by matplotlib 3.11, and older ones lay it out otherwise"
)
def test_the_picture_is_what_the_command_beside_it_makes(readme: str, repository: Path) -> None:
    """Its last frame, drawn again from the command's scenario, planner and seed."""
    picture, command = re.findall(r"!\[.*\]\((.*\.gif)\)", readme)[0], blocks(readme, "console")[0]
    arguments = build_parser().parse_args(shlex.split(command.removeprefix("$ cbrrt "), comments=True))
    scenario = load_scenario(arguments.scenario)
    result = plan(scenario, arguments.planner, arguments.seed)
    assert result.trajectory is not None
    animation = animate(result.trajectory, scenario, result.tree)
    frames = len(frame_times(result.trajectory))
    animation._func(frames - 1)
    buffer = io.BytesIO()
    animation._fig.savefig(buffer, format="png", dpi=DPI)
    with Image.open(repository / picture) as shown, Image.open(buffer) as drawn:
        shown.seek(shown.n_frames - 1)
        old, new = (np.asarray(image.convert("RGB"), dtype=float) for image in (shown, drawn))
    assert old.shape == new.shape
    others = np.abs(old - new).max(axis=2) > 80.0  # a GIF has few colours
    assert others.mean() < 2e-3, "make it again with the command"


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
    assert (repository / "docs" / "images" / "office.gif").stat().st_size < 1_000_000
