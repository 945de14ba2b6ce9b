"""The pages: they build without a warning, hold every key and name, and show what can be run."""

from __future__ import annotations

import math
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml
from test_package import tomllib
from test_readme import blocks

import cbrrt_ompl
from cbrrt_ompl.cli.program import COMMANDS
from cbrrt_ompl.planners.registry import PLANNERS
from cbrrt_ompl.problem.robot import Gains, Limits
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario import footprints, map_layers, scenario_file
from cbrrt_ompl.scenario.scenario import load_scenario
from cbrrt_ompl.scenario.sections import Key

SECTIONS: dict[str, Mapping[str, Key]] = {
    "Top level": scenario_file.SCENARIO,
    **scenario_file.OBSTACLES,
    "map": map_layers.MAP,
    "robot": scenario_file.ROBOT,
    "robot.footprint": {name: key for row in footprints.FOOTPRINTS.values() for name, key in row.keys.items()},
    "robot.limits": scenario_file.LIMITS,
    "robot.gains": scenario_file.GAINS,
    "start": scenario_file.START,
    "goal": scenario_file.GOAL,
    "planning": scenario_file.PLANNING,
}
"""The headings of the page on scenario files, and the keys that belong there."""

LIMITS = Limits()
DEFAULTS: dict[str, Mapping[str, Any]] = {
    "robot.limits": {
        "v": [LIMITS.v_min, LIMITS.v_max],
        "omega": [LIMITS.omega_min, LIMITS.omega_max],
        **LIMITS._asdict(),
    },
    "robot.gains": Gains()._asdict(),
    "start": State(0.0, 0.0)._asdict(),
    "goal": vars(Goal(0.0, 0.0)),
    "planning": vars(PlanningSettings().filled()),
}
"""What the code takes for a key that is left out."""


@pytest.fixture(scope="module")
def docs(repository: Path) -> Path:
    return repository / "docs"


def rows(page: str, heading: str) -> dict[str, tuple[str, str]]:
    """The table under a heading: what stands behind the key, and the default, by the key."""
    section = re.split(rf"^#+ {re.escape(heading)}$", page, flags=re.MULTILINE)[1].partition("\n#")[0]
    found = re.findall(r"^\| `(\w+)`([^|]*)\|([^|]*)\|", section, flags=re.MULTILINE)
    return {key: (mark.strip(), default.strip()) for key, mark, default in found}


@pytest.mark.parametrize("heading", SECTIONS)
def test_the_scenario_page_has_every_key_and_no_other(docs: Path, heading: str) -> None:
    page = (docs / "scenario.md").read_text(encoding="utf-8")
    found = rows(page, heading)
    assert list(found) == list(SECTIONS[heading])
    for name, key in SECTIONS[heading].items():
        mark, default = found[name]
        assert (mark == "°") == key.is_angle, name
        assert (default == "**required**") == bool(key.required), name


@pytest.mark.parametrize("heading", DEFAULTS)
def test_the_defaults_on_the_scenario_page_are_those_of_the_code(docs: Path, heading: str) -> None:
    page = (docs / "scenario.md").read_text(encoding="utf-8")
    for name, (_, default) in rows(page, heading).items():
        if default == "**required**":
            continue
        value = DEFAULTS[heading][name]
        stated = re.fullmatch(r"`(.*)`( deg)?", default)
        assert (stated is None) == (value in (None, math.inf)), name
        if stated is not None:
            plain = yaml.safe_load(stated[1])
            assert plain == value or numbers_agree(plain, value, math.radians(1.0) if stated[2] else 1.0), name


def test_the_scenario_page_has_the_defaults_of_the_planners_for_maps(docs: Path) -> None:
    page = (docs / "scenario.md").read_text(encoding="utf-8")
    section = page.partition("\n## planning\n")[2]
    found = re.findall(r"^\| `(\w+)`[^|]*\|[^|]*\| (?:`([^|]*)`|the same) \|", section, flags=re.MULTILINE)
    usual, stated = vars(PlanningSettings().filled()), {name: yaml.safe_load(own) for name, own in found if own}
    for row in (PLANNERS["cb-rrt-robust"], PLANNERS["cb-rrt-anytime"], PLANNERS["cb-rrt-ao"]):
        own = vars(row.settings(PlanningSettings()))
        assert stated == {name: value for name, value in own.items() if value != usual[name]}


def numbers_agree(stated: Any, value: Any, unit: float) -> bool:
    """Whether numbers are equal but for their unit."""
    pairs = zip(stated, value, strict=True) if isinstance(stated, list) else [(stated, value)]
    return all(one * unit == pytest.approx(other) for one, other in pairs)


def documented(docs: Path) -> dict[str, list[str]]:
    """What each page on Python documents, by the name of the page."""
    pages = {path.name: path.read_text(encoding="utf-8") for path in docs.glob("api/*.md")}
    return {name: re.findall(r"^::: (\S+)$", text, flags=re.MULTILINE) for name, text in pages.items()}


def test_every_public_name_is_on_one_page_on_python(docs: Path) -> None:
    entries = sorted(entry.rpartition(".")[2] for page in documented(docs).values() for entry in page)
    assert len(entries) == len(set(entries))
    assert set(cbrrt_ompl.__all__) - {"__version__"} <= set(entries)


def test_the_index_of_python_leads_to_every_documented_name(docs: Path) -> None:
    rows = re.findall(
        r"^\| \[.*\]\((\S+)\) \| (.*) \|$", (docs / "api" / "index.md").read_text("utf-8"), flags=re.MULTILINE
    )
    links = {page: re.findall(r"\]\[(\S+?)\]", names) for page, names in rows}
    entries = {
        name: [entry for entry in page if entry != "cbrrt_ompl.figures"] for name, page in documented(docs).items()
    }
    assert links == {name: page for name, page in entries.items() if page}


def test_the_command_line_page_lists_every_command(docs: Path) -> None:
    page = (docs / "cli.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `cbrrt (\w+)` \|", page, flags=re.MULTILINE) == list(COMMANDS)


@pytest.fixture(scope="module")
def site(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pages, built without a warning: all links lead somewhere, and every page is in the navigation."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(
        command, cwd=repository, env=environment, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    return folder


def test_the_pages_on_python_show_signatures_and_no_markup(site: Path) -> None:
    assert 'id="cbrrt_ompl.planning.plan"' in (site / "api" / "planning.html").read_text(encoding="utf-8")
    for page in site.glob("api/*.html"):
        assert not re.search(r":(?:func|class|data|meth|mod):", page.read_text(encoding="utf-8")), page


def test_a_result_that_is_told_in_two_lines_is_one_result(site: Path) -> None:
    """A second line of text under *Returns* used to become a second value."""
    page = (site / "api" / "trajectories.html").read_text(encoding="utf-8")
    method = page.partition('id="cbrrt_ompl.trajectory.trajectory.Trajectory.resampled"')[2]
    returns = re.search(r"Returns:.*?<ul>(.*?)</ul>", method, flags=re.DOTALL)
    assert returns is not None and returns[1].count("<li ") + returns[1].count("<li>") == 1
    assert "none is where it comes to rest" in returns[1]


def test_the_pages_request_nothing_from_elsewhere(site: Path) -> None:
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        sources = re.findall(r"<(?:script|img|iframe)\b[^>]*\bsrc=[\"']?([^\"' >]+)", text)
        sources += re.findall(r"<link\b[^>]*\brel=[\"']?stylesheet[^>]*\bhref=[\"']?([^\"' >]+)", text)
        assert sources and not [source for source in sources if "//" in source], page


def test_a_search_from_disk_finds_its_index_and_what_stands_for_a_worker(site: Path) -> None:
    """Browsers start no worker and read no JSON for a page from disk."""
    assert (site / "search" / "search_index.js").read_text(encoding="utf-8").startswith("var __index = {")
    assert 'src="../iframe-worker.js"' in (site / "api" / "errors.html").read_text(encoding="utf-8")
    assert (site / "iframe-worker.js").is_file()


def test_every_picture_is_written_by_a_command_above_it(docs: Path) -> None:
    page = (docs / "gallery.md").read_text(encoding="utf-8")
    pictures = list(re.finditer(r"\]\(images/(\S+?)\)", page))
    for picture in pictures:
        name, above = picture[1], page[: picture.start()].rpartition("\n## ")[2]
        chart = re.fullmatch(r"(?:success|boxes)_(\w+)\.png", name)
        expected = (
            rf"cbrrt bench {chart[1]} .*\n.*cbrrt report"
            if chart
            else rf"(?:--figure |--animation |savefig\(\")\b{name}"
        )
        assert re.search(expected, above), name
    assert {picture[1] for picture in pictures} == {path.name for path in docs.glob("images/*")} - {"office.gif"}


def test_pictures_are_small_enough_to_keep(docs: Path) -> None:
    sizes = {path.name: path.stat().st_size for path in docs.glob("images/*")}
    assert {name: size for name, size in sizes.items() if name.endswith(".png") and size > 150_000} == {}
    assert sum(sizes.values()) < 2_000_000


def test_the_scenario_on_the_scenario_page_can_be_loaded(docs: Path, tmp_path: Path) -> None:
    (text,) = blocks((docs / "scenario.md").read_text(encoding="utf-8"), "yaml")
    path = tmp_path / "scenario.yaml"
    path.write_text(text, encoding="utf-8")
    assert len(load_scenario(path).world.obstacles) == 4


@pytest.mark.needs_ompl
def test_the_set_up_and_the_law_on_the_page_on_ompl_run(repository: Path, docs: Path, tmp_path: Path) -> None:
    whole = [
        block
        for block in blocks((docs / "ompl.md").read_text(encoding="utf-8"), "python")
        if "verify(" in block or "register_law(" in block
    ]
    environment = {**os.environ, "PYTHONPATH": str(repository)}
    for code, expected in zip(whole, ("True", "solved"), strict=True):
        done = subprocess.run(
            [sys.executable, "-c", code], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120
        )
        assert (done.returncode, done.stdout.split()[-1]) == (0, expected), done.stderr


def test_the_citation_has_the_version_of_the_project(repository: Path) -> None:
    with (repository / "pyproject.toml").open("rb") as file:
        project = tomllib.load(file)["project"]
    citation = yaml.safe_load((repository / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == project["version"]
    assert re.fullmatch(r"\d+\.\d+\.\d+((a|b|rc)\d+)?", project["version"])
