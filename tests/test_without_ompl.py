"""Where there is no OMPL: what does not need it works, and what does says so in one line."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from cbrrt_ompl import CbrrtError, OmplMissingError, load_scenario, plan, verify
from cbrrt_ompl.benchmark.campaign import Campaign, run_campaign
from cbrrt_ompl.cli import main
from cbrrt_ompl.ompl_plugin import availability
from cbrrt_ompl.ompl_plugin.availability import has_ompl
from cbrrt_ompl.planners.registry import PLANNERS, is_compiled
from cbrrt_ompl.reproduce import demo
from cbrrt_ompl.reproduce.reproduction import reproduce

COMPILED_PLANNERS = [name for name in PLANNERS if is_compiled(name)]
HERE = ".".join(map(str, sys.version_info[:3]))
WHERE = f"needs OMPL 1.7.0, which has wheels for Python 3.10 to 3.12 (this is {HERE})"


@pytest.fixture(autouse=True)
def _no_ompl(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hide OMPL from imports to come."""
    monkeypatch.setitem(sys.modules, "ompl", None)  # type: ignore[arg-type]


def run_python(code: str) -> None:
    """Run code in a process that cannot import OMPL."""
    hidden = f"import sys\nsys.modules['ompl'] = None\n{code}"
    done = subprocess.run([sys.executable, "-c", hidden], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr


def test_an_ompl_of_another_generation_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cbrrt_ompl.ompl_plugin.availability.find_spec", lambda _: object())
    for version, known in (("2.0.1", False), ("1.7.0", True)):
        availability._is_first_generation.cache_clear()
        monkeypatch.setattr("cbrrt_ompl.ompl_plugin.availability.version", lambda _, version=version: version)
        assert has_ompl() == known
    availability._is_first_generation.cache_clear()


def test_all_public_names_are_imported_and_those_of_ompl_refused_when_used() -> None:
    run_python(f"""from cbrrt_ompl import *
assert {WHERE!r} in repr(make_setup)
for use in ("make_setup(load_scenario('paper_case1'))", "class Mine(make_setup): pass"):
    try: exec(use)
    except OmplMissingError as error: assert str(error) == {"make_setup " + WHERE!r}
    else: raise AssertionError(use)""")


def test_the_plugin_says_what_it_needs_at_its_import() -> None:
    run_python(f"""try: import cbrrt_ompl.ompl_plugin.binding
except ImportError as error: assert str(error) == {"cbrrt_ompl.ompl_plugin " + WHERE!r}
else: raise AssertionError""")


@pytest.mark.parametrize("planner", COMPILED_PLANNERS)
def test_the_compiled_planners_plan(planner: str) -> None:
    scenario = load_scenario("paper_case1")
    result = plan(scenario, planner, seed=1, time_limit=30.0)
    assert result.status == "solved"
    assert result.trajectory is not None
    assert verify(result.trajectory, scenario).ok


@pytest.mark.parametrize("planner", sorted(PLANNERS.keys() - set(COMPILED_PLANNERS)))
def test_other_planners_name_one_that_plans_without_ompl(planner: str) -> None:
    with pytest.raises(OmplMissingError) as caught:
        plan(load_scenario("paper_case1"), planner)
    instead = "s-rrt-compiled" if planner == "s-rrt" else "cb-rrt-compiled"
    assert str(caught.value) == f"planner {planner!r} {WHERE}; without it: {instead}"
    assert isinstance(caught.value, CbrrtError) and isinstance(caught.value, ImportError)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_the_benchmark_and_the_reproduction_begin_nothing(tmp_path: Path) -> None:
    campaign = Campaign({"a": load_scenario("paper_case1")}, ["cb-rrt-compiled"], 1, 1.0)
    with pytest.raises(OmplMissingError, match="^the benchmark needs OMPL"):
        run_campaign(campaign, tmp_path / "a.db", tmp_path / "logs")
    with pytest.raises(OmplMissingError, match="^the reproduction needs OMPL"):
        reproduce(tmp_path / "report", runs=1)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("command", "what"),
    [
        ("plan paper_case1", "planner 'cb-rrt'"),
        ("drive office --planner rrt", "planner 'rrt'"),
        ("bench maze --database a.db --log-dir logs", "the benchmark"),
        ("reproduce --output report", "the reproduction"),
    ],
)
def test_commands_that_need_ompl_end_with_one_line_and_exit_code_2(
    command: str, what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(command.split()) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith(f"cbrrt: error: {what} {WHERE}")
    assert captured.err.count("\n") == 1


def test_the_list_of_planners_tells_which_are_not_available(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["planners"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines if "[not available: no OMPL]" not in line] == COMPILED_PLANNERS


def test_the_demonstration_runs_the_compiled_planners_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(demo, "PAPER", {key: value for key, value in demo.PAPER.items() if key[0] == "paper_case1"})
    assert main(["demo", "--output", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert out.count("-compiled") == out.count(" valid ") == 2
    assert "OMPL 1.7.0" in " ".join(out.split())
