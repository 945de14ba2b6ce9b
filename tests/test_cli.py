"""The command line: exit codes, messages, and what it prints and writes."""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from cbrrt_ompl import __version__, figures, planning
from cbrrt_ompl.cli import build_parser, main, program
from cbrrt_ompl.cli import progress as lines
from cbrrt_ompl.cli.output_files import SUFFIXES
from cbrrt_ompl.errors import InputError, Problem
from cbrrt_ompl.planners.registry import PLANNERS
from cbrrt_ompl.reproduce import demo
from cbrrt_ompl.scenario.scenario import load_scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.verification import verify

COMMANDS = list(program.COMMANDS)

OPEN = """
name: open
bounds: {min: [-2, -2], max: [2, 2]}
start: {x: -1, y: 0}
goal: {x: 1, y: 0, tolerance: 0.4}
"""

WALLED = """
name: walled
bounds: {min: [-2, -2], max: [2, 2]}
obstacles:
  - {type: box, min: [-0.1, -2], max: [0.1, 2]}
start: {x: -1, y: 0}
goal: {x: 1, y: 0, tolerance: 0.4}
planning: {max_samples: 50}
"""


@pytest.fixture
def open_file(tmp_path: Path) -> Path:
    path = tmp_path / "open.yaml"
    path.write_text(OPEN, encoding="utf-8")
    return path


@pytest.fixture
def walled_file(tmp_path: Path) -> Path:
    path = tmp_path / "walled.yaml"
    path.write_text(WALLED, encoding="utf-8")
    return path


@pytest.fixture
def saved(open_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    path = tmp_path / "saved.csv"
    arguments = ["--planner", "cb-rrt-compiled", "--seed", "1", "--trajectory", str(path)]
    assert main(["plan", str(open_file), *arguments]) == 0
    capsys.readouterr()
    return path


def error_lines(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """The lines on stderr without their prefix; fails where stdout is not empty or a line has another prefix."""
    captured = capsys.readouterr()
    assert captured.out == ""
    lines = captured.err.splitlines()
    assert all(line.startswith("cbrrt: error: ") for line in lines)
    return [line.removeprefix("cbrrt: error: ") for line in lines]


def argument_error(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The one line of an error in the arguments themselves."""
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    (line,) = error_lines(capsys)
    return line


@pytest.mark.needs_ompl
def test_a_solved_plan_exits_0_and_prints_aligned_figures(open_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", str(open_file), "--seed", "1"]) == 0
    captured = capsys.readouterr()
    lines = captured.out.splitlines()
    names = [line[:13].rstrip() for line in lines]
    assert names == [
        "scenario", "planner", "status", "seed", "nodes", "samples",
        "planning time", "duration", "length", "point turns",
    ]  # fmt: skip
    assert all(line[13:15] == "  " and line[15:].strip() == line[15:] != "" for line in lines)
    assert captured.err == ""


@pytest.mark.needs_ompl
def test_an_unsolved_plan_exits_1_and_writes_no_trajectory(
    walled_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trajectory, figure = tmp_path / "none.csv", tmp_path / "tree.png"
    arguments = ["plan", str(walled_file), "--seed", "1", "--trajectory", str(trajectory), "--figure", str(figure)]
    assert main(arguments) == 1
    out = capsys.readouterr().out
    assert "sample limit" in out
    assert f"no trajectory, {trajectory} not written" in out
    assert not trajectory.exists()
    assert figure.exists()


@pytest.mark.needs_ompl
def test_the_written_trajectory_is_the_planned_one_and_valid(
    open_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "path.csv"
    assert main(["plan", str(open_file), "--seed", "1", "--trajectory", str(path), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    trajectory = Trajectory.load(path)
    assert verify(trajectory, load_scenario(open_file)).ok
    assert printed["solved"] is True
    assert printed["status"] == "solved"
    assert printed["duration"] == trajectory.duration
    assert printed["length"] == trajectory.length
    assert printed["trajectory"] == str(path)
    assert printed["figure"] is None


@pytest.mark.needs_ompl
def test_json_of_an_unsolved_plan_has_no_trajectory(walled_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", str(walled_file), "--json"]) == 1
    printed = json.loads(capsys.readouterr().out)
    assert printed["solved"] is False
    assert printed["samples"] == 50
    assert printed["trajectory"] is printed["duration"] is printed["length"] is printed["point_turns"] is None


@pytest.mark.needs_ompl
def test_files_of_an_unsolved_plan_are_said_not_to_be_written(
    walled_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An animation that was asked for in vain was passed over in silence."""
    files = {"trajectory": tmp_path / "a.csv", "figure": tmp_path / "a.png", "animation": tmp_path / "a.gif"}
    arguments = ["plan", str(walled_file), "--seed", "1"]
    arguments += [text for name, path in files.items() for text in (f"--{name}", str(path))]
    assert main(arguments) == 1
    lines = [f"no trajectory, {files[name]} not written" for name in ("trajectory", "animation")]
    assert capsys.readouterr().out.splitlines()[-2:] == lines
    assert main([*arguments, "--json"]) == 1
    printed = json.loads(capsys.readouterr().out)
    assert {name: printed[name] for name in files} == {
        "trajectory": None, "figure": str(files["figure"]), "animation": None,
    }  # fmt: skip
    assert sorted(tmp_path.glob("a.*")) == [files["figure"]]


@pytest.mark.parametrize("suffix", [".png", ".pdf", ".svg"])
def test_figures_are_written_in_every_format(open_file: Path, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"figure{suffix}"
    assert main(["show", str(open_file), "--figure", str(path)]) == 0
    start = {".png": b"\x89PNG", ".pdf": b"%PDF", ".svg": b"<?xml"}[suffix]
    assert path.read_bytes().startswith(start)


@pytest.mark.parametrize(
    ("option", "name", "expected"),
    [
        ("--trajectory", "path.txt", "a file name that ends in .csv, .npz, .json"),
        ("--figure", "figure", "a file name that ends in .png, .pdf, .svg"),
        ("--trajectory", "missing/path.csv", "no such folder: "),
        ("--figure", "folder.png", "a file that may be written"),
    ],
)
def test_outputs_that_cannot_be_written_are_reported_before_planning(
    open_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    option: str, name: str, expected: str,
) -> None:  # fmt: skip
    (tmp_path / "folder.png").mkdir()
    monkeypatch.setattr(planning, "plan", lambda *_, **__: pytest.fail("planned all the same"))
    assert main(["plan", str(open_file), option, str(tmp_path / name)]) == 2
    (line,) = error_lines(capsys)
    assert line.startswith(f"{option}: ")
    assert expected in line


def test_both_outputs_are_reported_together(open_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", str(open_file), "--trajectory", "a.txt", "--figure", "a.gif"]) == 2
    assert [line.split(":")[0] for line in error_lines(capsys)] == ["--trajectory", "--figure"]


@pytest.mark.parametrize("value", ["-1", "0", "nan", "inf", "soon"])
def test_a_time_limit_that_is_none_is_refused(open_file: Path, capsys: pytest.CaptureFixture[str], value: str) -> None:
    line = argument_error(capsys, "plan", str(open_file), f"--time-limit={value}")
    assert line.startswith(f"--time-limit: got '{value}', expected a number of seconds above 0")


@pytest.mark.parametrize("value", ["-1", "1.5", "x", "²"])
def test_a_seed_that_is_none_is_refused(open_file: Path, capsys: pytest.CaptureFixture[str], value: str) -> None:
    line = argument_error(capsys, "plan", str(open_file), f"--seed={value}")
    assert line.startswith(f"--seed: got '{value}', expected a whole number")


def test_a_number_of_thousands_of_digits_is_refused_in_one_short_line(capsys: pytest.CaptureFixture[str]) -> None:
    """Python does not convert it, and the line told the name of a function and all digits."""
    line = argument_error(capsys, "demo", "--seed", "9" * 5000)
    assert line.startswith("--seed: got '999")
    assert line.endswith("9..., expected a whole number of 0 or more (see 'cbrrt demo --help')")


@pytest.mark.parametrize(
    ("arguments", "field", "known"),
    [(["plna"], "COMMAND", COMMANDS), (["completion", "ksh"], "SHELL", ["bash", "zsh", "tcsh", "fish"])],
)
def test_an_unknown_word_is_told_the_known_ones(
    capsys: pytest.CaptureFixture[str], arguments: list[str], field: str, known: list[str]
) -> None:
    line = argument_error(capsys, *arguments)
    assert line.startswith(f"{field}: got '{arguments[-1]}', expected one of {', '.join(known)} (see ")


@pytest.mark.parametrize("arguments", [[], ["plna"], ["plan"], ["plan", "a.yaml", "--color"]])
def test_a_wrong_command_line_is_one_line(capsys: pytest.CaptureFixture[str], arguments: list[str]) -> None:
    assert "--help'" in argument_error(capsys, *arguments)


def test_an_unknown_planner_is_told_the_known_ones(open_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", str(open_file), "--planner", "rtt"]) == 2
    (line,) = error_lines(capsys)
    assert "'rtt'" in line
    assert "cb-rrt" in line


def test_missing_files_are_bad_input(open_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    missing = str(tmp_path / "missing.yaml")
    for arguments in (["plan", missing], ["show", missing], ["verify", str(tmp_path / "missing.csv"), str(open_file)]):
        assert main(arguments) == 2
        (line,) = error_lines(capsys)
        assert "missing." in line


def test_several_problems_take_a_line_each(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(OPEN + "planning: {horizon: -1, goal_bias: 2}\n", encoding="utf-8")
    assert main(["plan", str(path)]) == 2
    lines = error_lines(capsys)
    assert len(lines) == 2
    assert all(str(path) in line for line in lines)


def test_a_valid_trajectory_exits_0(saved: Path, open_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", str(saved), str(open_file)]) == 0
    expected = verify(Trajectory.load(saved), load_scenario(open_file)).summary()
    assert capsys.readouterr().out == expected + "\n"


def test_a_trajectory_through_a_wall_exits_1(
    saved: Path, walled_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["verify", str(saved), str(walled_file)]) == 1
    assert "collision" in capsys.readouterr().out


@pytest.mark.needs_ompl
def test_jumping_velocities_need_the_kinematic_option(open_file: Path, tmp_path: Path) -> None:
    path = tmp_path / "jumps.csv"
    assert main(["plan", str(open_file), "--planner", "s-rrt", "--seed", "1", "--trajectory", str(path)]) == 0
    assert main(["verify", str(path), str(open_file)]) == 1
    assert main(["verify", str(path), str(open_file), "--kinematic"]) == 0


def test_show_without_a_display_says_what_to_do(
    open_file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("MPLBACKEND", "agg")
    assert main(["show", str(open_file)]) == 2
    assert error_lines(capsys) == ["no display to open a window on, write a file with --figure FILE"]


def test_show_draws_the_trajectory(
    saved: Path, open_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = []
    monkeypatch.setattr(figures, "draw_trajectory", lambda ax, trajectory, footprint: drawn.append(trajectory))
    assert main(["show", str(open_file), "--trajectory", str(saved), "--figure", str(tmp_path / "a.png")]) == 0
    assert drawn == [Trajectory.load(saved)]


def test_improve_writes_a_shorter_trajectory_and_a_figure(
    saved: Path, open_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    better, figure = tmp_path / "better.csv", tmp_path / "better.png"
    files = ["--output", str(better), "--figure", str(figure)]
    assert main(["improve", str(saved), str(open_file), "--max-iterations", "200", "--json", *files]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["duration"] < told["given"]
    assert told["duration"] == pytest.approx(Trajectory.load(better).duration)
    assert told["history"][-1]["duration"] == told["duration"]
    assert figure.stat().st_size > 1000
    assert main(["verify", str(better), str(open_file)]) == 0


def test_plan_improves_on_request(open_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plain = ["plan", str(open_file), "--planner", "cb-rrt-compiled", "--seed", "1", "--json"]
    assert main(plain) == 0
    first = json.loads(capsys.readouterr().out)
    assert main([*plain, "--max-iterations", "200"]) == 0
    improved = json.loads(capsys.readouterr().out)
    assert first["history"] == []
    assert improved["history"][0]["duration"] == first["duration"]
    assert improved["duration"] < first["duration"]


def test_planners_lists_every_planner(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["planners"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(PLANNERS)
    assert all(len(line.split()) > 2 for line in lines)


def test_help_of_every_command_has_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    for command in COMMANDS:
        with pytest.raises(SystemExit) as caught:
            main([command, "--help"])
        assert caught.value.code == 0
        example = capsys.readouterr().out.partition("example:\n  cbrrt ")[2].replace("\\\n", "").split()
        assert build_parser().parse_args(example).run.__doc__ == f"``cbrrt {command}``."


def test_the_examples_of_the_whole_command_exist(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--help"])
    lines = capsys.readouterr().out.partition("examples:\n")[2].partition("\n\n")[0].splitlines()
    examples = [line.strip().partition("   ")[0].split() for line in lines]
    assert len(examples) >= 4
    for name, *arguments in examples:
        assert name == "cbrrt"
        assert callable(build_parser().parse_args(arguments).run)


def commands_of(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """The parsers of all commands by their names."""
    (commands,) = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    return commands.choices


def test_help_of_every_option_tells_its_default() -> None:
    actions = [action for command in commands_of(build_parser()).values() for action in command._actions]
    options = [action for action in actions if action.default not in (None, False, argparse.SUPPRESS)]
    assert {"--planner", "--output", "--cycle"} <= {option.option_strings[0] for option in options}
    for option in options:
        default = f"{option.default:g}" if isinstance(option.default, float) else f"{option.default}"
        assert f"(default: {default})" in str(option.help), option.option_strings


@pytest.mark.parametrize(
    ("command", "name"),
    [("plan", "trajectory"), ("drive", "animation"), ("show", "figure"), ("bench", "database")],
)
def test_help_of_a_file_to_write_tells_all_its_suffixes(command: str, name: str) -> None:
    (option,) = [action for action in commands_of(build_parser())[command]._actions if action.dest == name]
    *others, last = SUFFIXES[name]
    assert f"{', '.join(others)} or {last}" in str(option.help)


def test_help_fits_80_columns(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    for command in ([], *([command] for command in COMMANDS)):
        with pytest.raises(SystemExit):
            main([*command, "--help"])
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 80


@pytest.mark.needs_ompl
@pytest.mark.parametrize(
    ("terminal", "no_color", "colored"), [(True, "", True), (True, "1", False), (False, "", False)]
)
def test_colors_are_for_terminals_without_no_color(
    open_file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    terminal: bool, no_color: str, colored: bool,
) -> None:  # fmt: skip
    monkeypatch.setenv("NO_COLOR", no_color)
    monkeypatch.setenv("TERM", "xterm")
    for stream in (sys.stdout, sys.stderr):
        monkeypatch.setattr(stream, "isatty", lambda: terminal)
    assert main(["plan", str(open_file), "--seed", "1"]) == 0
    assert main(["plan", str(open_file.with_name("none.yaml"))]) == 2
    with pytest.raises(SystemExit):
        main(["plan"])
    captured = capsys.readouterr()
    assert ("\033[32msolved\033[0m" in captured.out) == ("\033" in captured.out) == colored
    assert captured.err.count("\033[31mcbrrt: error:\033[0m") == captured.err.count("\033[31m") == (2 if colored else 0)


def test_planners_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["planners", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {name: text.partition(" [not available")[0] for name, text in found.items()} == {
        name: planner.description for name, planner in PLANNERS.items()
    }


def test_verification_as_json(
    saved: Path, open_file: Path, walled_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["verify", str(saved), str(open_file), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["ok"] is True and found["violations"] == [] and found["smallest_clearance"] > 0.0
    assert main(["verify", str(saved), str(walled_file), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["ok"] is False
    assert "collision" in {violation["kind"] for violation in found["violations"]}


def test_a_scenario_that_comes_along_is_found_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["plan", "paper_case1", "--planner", "cb-rrt-compiled", "--seed", "1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["scenario"] == "Case 1"
    assert main(["plan", "paper_case9"]) == 2
    (line,) = error_lines(capsys)
    assert line.startswith("paper_case9: ") and "paper_case1, paper_case2" in line


def test_completion_knows_commands_planners_and_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The script is run by bash, as it would be on the Tab key."""
    assert main(["completion", "bash"]) == 0
    script = tmp_path / "cbrrt.bash"
    script.write_text(capsys.readouterr().out, encoding="utf-8")
    (tmp_path / "mine.yaml").touch()
    for line, wanted in (
        ("cbrrt pla", {"plan", "planners"}),
        ("cbrrt plan --planner cb-rrt-r", {"cb-rrt-robust"}),
        ("cbrrt plan m", {"mine.yaml", "maze"}),
        ("cbrrt plan --robot jac", {"jackal"}),
        ("cbrrt new mi", {"mine.yaml"}),
    ):
        words = line.split()
        code = f"""source {script}; COMP_WORDS=({line}); COMP_CWORD={len(words) - 1}
                   [[ $(complete -p cbrrt) =~ -F\\ ([^\\ ]+) ]] && ${{BASH_REMATCH[1]}} cbrrt {words[-1]} {words[-2]}
                   printf '%s\\n' "${{COMPREPLY[@]}}" """
        done = subprocess.run(
            ["bash", "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=True
        )
        assert set(done.stdout.split()) == wanted, done.stderr


@pytest.mark.parametrize("shell", ["zsh", "fish", "tcsh"])
def test_completion_of_other_shells_knows_the_new_names(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert "scenarios" in script and "resolution" in script
    if shell != "tcsh":
        assert "jackal" in script and "paper_case1" in script


def test_help_imports_nothing_heavy() -> None:
    code = "import sys; from cbrrt_ompl.cli import main\ntry: main(['--help'])\nexcept SystemExit: print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    modules = {name.split(".")[0] for name in done.stdout.split()}
    assert "cbrrt_ompl" in modules
    assert not {"ompl", "numpy", "numba", "matplotlib", "shapely", "fcl", "yaml"} & modules


def test_version_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["--version"])
    assert caught.value.code == 0
    assert capsys.readouterr().out == f"cbrrt {__version__}\n"


@pytest.mark.needs_ompl
@pytest.mark.parametrize(("terminal", "reports"), [(True, True), (False, False)])
def test_progress_is_reported_on_a_terminal_only(
    open_file: Path, monkeypatch: pytest.MonkeyPatch, terminal: bool, reports: bool
) -> None:
    seen: list[Callable[[int, float], None] | None] = []

    def stop(*_: object, progress: Callable[[int, float], None] | None, **__: object) -> None:
        seen.append(progress)
        raise InputError(Problem("test", 1, "no plan"))

    monkeypatch.setattr(planning, "plan", stop)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    assert main(["plan", str(open_file)]) == 2
    assert [progress is not None for progress in seen] == [reports]


def test_a_campaign_that_nobody_watches_tells_once_how_far_it_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    clock = iter((0.0, 10.0, 60.0, 90.0, 300.0))
    monkeypatch.setattr(lines, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    with lines.run_progress(100) as report:
        for done in (20, 21, 30, 40, 100):
            report(done)
    assert capsys.readouterr().err == "cbrrt: 30 of 100 runs, about 7 min left\n"


def test_progress_counts_samples(
    open_file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop(*_: object, progress: Callable[[int, float], None], **__: object) -> None:
        progress(100, 0.5)
        assert "100/50000" not in capsys.readouterr().err
        time.sleep(1.1)
        progress(1234, 1.6)
        assert "1234/50000" in capsys.readouterr().err
        raise InputError(Problem("test", 1, "no plan"))

    monkeypatch.setattr(planning, "plan", stop)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    assert main(["plan", str(open_file)]) == 2


@pytest.mark.parametrize("terminal", [True, False])
def test_compilation_is_told_of_on_a_terminal_only(
    open_file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], terminal: bool
) -> None:
    """It was told of in a pipe as well, before the one line of an error."""

    def stop(*_: object, **__: object) -> None:
        raise InputError(Problem("test", 1, "no plan"))

    said: list[str] = []

    def compile_slowly(_: str) -> None:
        end = time.monotonic() + (60.0 if terminal else 1.3)
        while not any(said) and time.monotonic() < end:
            time.sleep(0.05)
            said.append(capsys.readouterr().err)

    monkeypatch.setattr("cbrrt_ompl.planning.warm_up_planner", compile_slowly)
    monkeypatch.setattr(planning, "plan", stop)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    assert main(["plan", str(open_file)]) == 2
    told = re.search(r"compiling the planners, once after installation: about \d+ s", "".join(said))
    assert (told is not None) == terminal


@pytest.mark.needs_ompl
def test_an_interrupt_is_one_line_and_exit_code_130(
    open_file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(planning, "plan", interrupt)
    assert main(["plan", str(open_file)]) == 130
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", "cbrrt: interrupted\n")


def test_a_reader_that_leaves_is_no_error(repository: Path) -> None:
    read, write = os.pipe()
    os.close(read)
    process = subprocess.Popen([sys.executable, "-m", "cbrrt_ompl", "planners"], stdout=write, stderr=subprocess.PIPE)
    os.close(write)
    _, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (141, b"")


@pytest.mark.needs_ompl
def test_errors_on_files_are_one_line(
    open_file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device", "path.csv")

    monkeypatch.setattr(planning, "plan", full)
    assert main(["plan", str(open_file)]) == 2
    assert error_lines(capsys) == ["path.csv: No space left on device"]


@pytest.mark.needs_ompl
def test_the_demo_writes_figures_trajectories_and_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(demo, "PAPER", {key: demo.PAPER[key] for key in demo.PAPER if key != ("paper_case2", "s-rrt")})
    monkeypatch.setattr(demo, "REPRODUCTION_RUNS", 1)
    output = tmp_path / "new" / "demo"
    assert main(["demo", "--output", str(output)]) == 0
    out = capsys.readouterr().out
    assert out.count(" valid ") == 6
    assert all(len(line) <= 80 for line in out.replace(str(output), "demo").splitlines())
    assert out.splitlines()[-1].endswith(f"runs: {output / 'report.html'}")
    in_ompl = ["paper_case1_cb-rrt", "paper_case1_s-rrt", "paper_case2_cb-rrt"]
    stems = [stem + suffix for stem in in_ompl for suffix in ("", "-compiled")]
    names = {f"{stem}{suffix}" for stem in stems for suffix in (".csv", ".png")}
    names |= {"paper_case1.yaml", "paper_case2.yaml", "results.md"}
    names |= {"paper_case2_cb-rrt_velocities.png", "paper_case2_cb-rrt-compiled_velocities.png"}
    names |= {"report.html", "report.md", "runs.jsonl", "figures", ".lock"}
    assert {path.name for path in output.iterdir()} == names
    assert (output / "results.md").read_text(encoding="utf-8").count("| paper_case") == 6


@pytest.mark.needs_ompl
def test_the_demo_expects_s_rrt_to_fail_in_case_2(scenarios: Path) -> None:
    scenario = load_scenario(scenarios / "paper_case2.yaml")
    unsolved = planning.plan(scenario, "s-rrt", seed=1, time_limit=0.1)
    assert not unsolved.solved
    run = demo.DemoRun("paper_case2", scenario, unsolved, None)
    assert run.as_published
    assert run.cells()[2] == "not solved (as in the paper)"


@pytest.mark.needs_ompl
def test_control_c_ends_a_running_plan(tmp_path: Path) -> None:
    path = tmp_path / "endless.yaml"
    path.write_text(WALLED.replace("max_samples: 50", "max_samples: 100000000"), encoding="utf-8")
    code = f"""import contextlib, signal, sys
from cbrrt_ompl.cli import main, plan
plan.plan_progress = lambda *_: contextlib.nullcontext(lambda samples, elapsed: signal.raise_signal(signal.SIGINT))
sys.exit(main(["plan", {str(path)!r}, "--time-limit", "30"]))"""
    started = time.monotonic()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout, done.stderr.splitlines()[-1]) == (130, "", "cbrrt: interrupted")
    assert time.monotonic() - started < 25.0
