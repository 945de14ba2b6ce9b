"""Files are whole or not there: full disks, kills, devices, links and folders."""

from __future__ import annotations

import errno
import os
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from cbrrt_ompl import (
    Bounds,
    Box,
    Goal,
    InputError,
    PlanningSettings,
    Scenario,
    State,
    Trajectory,
    World,
    save_map,
    save_scenario,
)
from cbrrt_ompl.benchmark.report import _write_csv
from cbrrt_ompl.cli import main
from cbrrt_ompl.figures.saving import save_figure
from cbrrt_ompl.files import as_path, write_file, write_files

WORLD = World(Bounds((0.0, 0.0), (2.0, 2.0)), [Box((0.9, 0.0), (1.1, 1.0))])
SCENARIO = Scenario(name="small", world=WORLD, start=State(0.5, 0.5), goal=Goal(1.5, 0.5, tolerance=0.3))
ROW = np.array([0.0, 1.0])
TRAJECTORY = Trajectory(ROW, *(0.0 * ROW for _ in range(7)))

WRITERS: dict[str, Callable[[Path], Any]] = {
    "a.csv": TRAJECTORY.save,
    "a.npz": TRAJECTORY.save,
    "a.json": TRAJECTORY.save,
    "scenario.yaml": lambda path: save_scenario(SCENARIO, path),
    "map.yaml": lambda path: save_map(WORLD, path, 0.1),
    "figure.png": lambda path: save_figure(Figure(figsize=(1.0, 1.0)), path),
    "figure.svg": lambda path: save_figure(Figure(figsize=(1.0, 1.0)), path),
    "table.csv": lambda path: _write_csv(path, ("a",), [("b",)]),
    "report.md": lambda path: write_file(path, "text"),
}


def fill_the_disk(*_: object) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("name", WRITERS)
def test_a_full_disk_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    path = tmp_path / name
    WRITERS[name](path)
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    path.write_bytes(b"old")
    monkeypatch.setattr(os, "fsync", fill_the_disk)
    with pytest.raises(InputError) as caught:
        WRITERS[name](path)
    assert str(caught.value).startswith("cannot write ") and str(caught.value).endswith(": no space left on device")
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == {**before, name: b"old"}


def test_files_that_belong_together_are_all_new_or_all_old(tmp_path: Path) -> None:
    image, folder = tmp_path / "map.pgm", tmp_path / "map.yaml"
    image.write_bytes(b"old")
    folder.mkdir()
    with pytest.raises(InputError, match=r"cannot write .*map.yaml: is a directory"):
        write_files({image: b"new", folder: "text"})
    assert image.read_bytes() == b"old"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["map.pgm", "map.yaml"]


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("none/a.md", "no such folder to write in: "),
        ("file/a.md", ": not a directory"),
        ("a" * 300, ": file name too long"),
        ("a\0b", ": no name of a file"),
    ],
)
def test_a_place_where_nothing_can_be_is_one_line(tmp_path: Path, name: str, reason: str) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match=reason):
        write_file(tmp_path / name, "text")
    assert [file.name for file in tmp_path.iterdir()] == ["file"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_device_takes_what_is_written_and_stays_a_device(tmp_path: Path) -> None:
    full, null = tmp_path / "full.csv", tmp_path / "null.csv"
    full.symlink_to("/dev/full")
    null.symlink_to("/dev/null")
    with pytest.raises(InputError, match="full.csv: no space left on device"):
        TRAJECTORY.save(full)
    TRAJECTORY.save(null)
    assert all(stat.S_ISCHR(path.stat().st_mode) for path in (full, null))


def test_links_and_modes_are_kept(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    target, link = tmp_path / "folder" / "target.md", tmp_path / "link.md"
    target.write_text("old")
    target.chmod(0o640)
    link.symlink_to(target)
    write_file(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"
    assert stat.S_IMODE(target.stat().st_mode) == 0o640


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write what is read-only")
def test_a_read_only_file_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.md"
    path.write_text("old")
    path.chmod(0o444)
    with pytest.raises(InputError, match=os.strerror(errno.EACCES)):
        write_file(path, "new")
    assert path.read_text() == "old"


def test_only_names_are_paths() -> None:
    assert as_path("a", InputError) == as_path(Path("a"), InputError) == Path("a")
    for wrong in (None, 3, b"a", ["a"]):
        with pytest.raises(InputError, match="path: got .*, expected the name of a file"):
            as_path(wrong, InputError)


def test_a_kill_while_writing_leaves_a_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    code = (
        "import sys; from pathlib import Path; from cbrrt_ompl.files import write_file\n"
        "print(flush=True)\n"
        "while True:\n    for c in 'ab': write_file(Path(sys.argv[1]), c * 5_000_000)"
    )
    for _ in range(3):
        with subprocess.Popen([sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE) as process:
            assert process.stdout is not None
            process.stdout.readline()
            time.sleep(0.2)
            process.kill()
        content = path.read_text()
        assert len(content) == 5_000_000
        assert len(set(content)) == 1


@pytest.mark.needs_ompl
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, -signal.SIGTERM)])
def test_signals_end_a_plan_and_leave_the_old_files(tmp_path: Path, number: int, code: int) -> None:
    closed = World(WORLD.bounds, [Box((0.9, 0.0), (1.1, 2.0))])
    endless = PlanningSettings(max_samples=10**9)
    scenario = Scenario(name="closed", world=closed, start=State(0.5, 0.5), goal=SCENARIO.goal, planning=endless)
    save_scenario(scenario, tmp_path / "s.yaml")
    outputs = [tmp_path / "a.csv", tmp_path / "a.png"]
    for path in outputs:
        path.write_text("old")
    command = [sys.executable, "-m", "cbrrt_ompl", "plan", "s.yaml", "--planner", "cb-rrt", "--time-limit", "60"]
    command += ["--trajectory", "a.csv", "--figure", "a.png"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, env=_environment()) as process:
        time.sleep(2.0)
        process.send_signal(number)
        _, errors = process.communicate(timeout=30.0)
    assert process.returncode in (code, -number)  # Python dies by the signal where it came while it ran an exec()
    assert "Traceback" not in errors
    assert [path.read_text() for path in outputs] == ["old", "old"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "a.png", "s.yaml"]


def _environment() -> dict[str, str]:
    """That of this process, with the package where it is now."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent.parent), *sys.path])}


def run(arguments: list[str], **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "cbrrt_ompl", *arguments]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=60, env={**_environment(), **environment}, check=False
    )


def test_a_wrong_backend_of_matplotlib_is_one_line(tmp_path: Path) -> None:
    save_scenario(SCENARIO, tmp_path / "s.yaml")
    done = run(["show", str(tmp_path / "s.yaml"), "--figure", str(tmp_path / "a.png")], MPLBACKEND="nonsense")
    assert done.returncode == 2
    assert done.stderr == "cbrrt: error: MPLBACKEND: got 'nonsense', expected a backend of matplotlib\n"


def test_a_name_that_the_terminal_has_no_letters_for_is_printed(tmp_path: Path) -> None:
    save_scenario(Scenario(name="Tür", world=WORLD, start=State(0.5, 0.5), goal=Goal(0.5, 0.5)), tmp_path / "s.yaml")
    done = run(["plan", str(tmp_path / "s.yaml"), "--planner", "cb-rrt-compiled"], PYTHONIOENCODING="ascii")
    assert (done.returncode, done.stderr) == (0, "")
    assert "T\\xfcr" in done.stdout


def test_dollars_in_a_name_are_no_formula(tmp_path: Path) -> None:
    """``$x_$`` used to be parsed as mathematics, with a traceback where it was none."""
    save_scenario(
        Scenario(name=r"a $x_$ \frac", world=WORLD, start=State(0.5, 0.5), goal=SCENARIO.goal), tmp_path / "s.yaml"
    )
    assert main(["show", str(tmp_path / "s.yaml"), "--figure", str(tmp_path / "a.png")]) == 0
    assert (tmp_path / "a.png").stat().st_size > 0


def test_show_takes_a_csv_file_as_kinematic(tmp_path: Path) -> None:
    save_scenario(SCENARIO, tmp_path / "s.yaml")
    TRAJECTORY.save(tmp_path / "a.csv")
    figure = tmp_path / "a.png"
    arguments = ["show", str(tmp_path / "s.yaml"), "--trajectory", str(tmp_path / "a.csv"), "--figure", str(figure)]
    assert main([*arguments, "--kinematic"]) == 0
    assert figure.stat().st_size > 0
