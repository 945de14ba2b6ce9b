"""What a command reads is never written over by what it writes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cbrrt_ompl.cli import main

SCENARIO = """\
name: empty
bounds: {min: [0, 0], max: [4, 4]}
start: {x: 1, y: 1}
goal: {x: 3, y: 3}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A map with an image of the usual name, and a scenario in it and one without it."""
    Image.fromarray(np.full((80, 80), 254, dtype=np.uint8)).save(tmp_path / "depot.png")
    (tmp_path / "depot.yaml").write_text("image: depot.png\nresolution: 0.05\norigin: [0, 0, 0]\n")
    (tmp_path / "mask.yaml").write_text("image: mask.png\nresolution: 0.05\norigin: [0, 0, 0]\n")
    Image.fromarray(np.full((80, 80), 254, dtype=np.uint8)).save(tmp_path / "mask.png")
    (tmp_path / "empty.yaml").write_text(SCENARIO)
    keys = SCENARIO.replace("bounds: {min: [0, 0], max: [4, 4]}", "map: {file: depot.yaml, keepout: mask.yaml}")
    (tmp_path / "tour.yaml").write_text(keys)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("command", "lost"),
    [
        ("show depot.yaml --figure depot.png", "depot.png"),
        ("show tour.yaml --figure mask.png", "mask.png"),
        ("show tour.yaml --figure ./depot.png", "depot.png"),
        ("plan depot.yaml --robot jackal --start 1 1 0 --goal 3 3 --seed 1 --figure depot.png", "depot.png"),
        ("plan tour.yaml --planner cb-rrt-robust --trajectory depot.yaml", "depot.yaml"),
        ("plan empty.yaml --planner cb-rrt-robust --trajectory empty.yaml", "empty.yaml"),
        ("improve given.csv empty.yaml --output empty.yaml", "empty.yaml"),
        ("drive tour.yaml --seed 1 --figure mask.png", "mask.png"),
    ],
)
def test_a_file_that_is_read_is_not_written_over(
    folder: Path, capsys: pytest.CaptureFixture[str], command: str, lost: str
) -> None:
    """``cbrrt show depot.yaml --figure depot.png`` put a picture of the map in the place of the map's image."""
    before = (folder / lost).read_bytes()
    words = command.split()
    assert main(words) == 2
    expected = f"{words[-2]}: got {str(Path(words[-1]))!r}, expected another file: this one is read, and would be lost"
    assert capsys.readouterr().err == f"cbrrt: error: {expected}\n"
    assert (folder / lost).read_bytes() == before


def test_what_an_earlier_command_wrote_is_written_over(folder: Path) -> None:
    for _ in range(2):
        assert main("show depot.yaml --figure picture.png".split()) == 0
        assert main("plan empty.yaml --planner cb-rrt-robust --trajectory path.yaml".split()) == 0
        assert main("verify path.yaml empty.yaml --collisions-only".split()) == 0
