"""Every code block of the README and the pages: run from an empty folder, or marked with the reason why not.

A comment above a block says what cannot be seen in it: ``<!-- not run: why -->``, ``<!-- file: tour.yaml -->`` for what
a reader saves under a name, and ``<!-- given: depot.yaml plan.png -->`` for what the text says that a reader has.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import yaml
from PIL import Image

from cbrrt_ompl import OccupancyMap
from cbrrt_ompl.cli import build_parser, main
from cbrrt_ompl.figures import film

REPOSITORY = Path(__file__).resolve().parent.parent
_FILES = (REPOSITORY / "README.md", *REPOSITORY.glob("docs/**/*.md"))
PAGES = sorted(str(path.relative_to(REPOSITORY)) for path in _FILES)

BLOCK = re.compile(
    r"(?:^ *<!-- (?P<mark>[^>]*) -->\s*)?^(?P<in> *)```(?P<kind>\w+)\n(?P<code>.*?)^(?P=in)```$",
    re.MULTILINE | re.DOTALL,
)


class CodeBlock(NamedTuple):
    """A block, what it is written in, and what its comment says."""

    mark: dict[str, str]
    kind: str
    code: str


def blocks_of(page: str) -> Iterator[CodeBlock]:
    """The code blocks of a page in their order."""
    for found in BLOCK.finditer((REPOSITORY / page).read_text(encoding="utf-8")):
        name, _, rest = (found["mark"] or "").partition(": ")
        code = re.sub(rf"^{found['in']}", "", found["code"], flags=re.MULTILINE)
        yield CodeBlock({name: rest} if rest else {}, found["kind"], code)


def lay_out(names: str) -> None:
    """Make the files that a text says its reader has, in the present folder: those of `TEXTS`, maps and an image."""
    for name in names.split():
        if name in TEXTS:
            Path(name).write_text(TEXTS[name], encoding="utf-8")
            continue
        cells = np.zeros((320, 600), dtype=bool)  # 16 m x 30 m, with a wall that leaves a gap
        cells[[0, -1], :] = cells[:, [0, -1]] = cells[:200, 300:304] = True
        OccupancyMap.from_array(cells, 0.05).save(Path(name).with_suffix(".yaml"))
        if name.endswith(".png"):
            with Image.open(Path(name).with_suffix(".pgm")) as image:
                image.save(name)


TEXTS = {
    "chairs.yaml": "obstacles:\n  - {type: disc, center: [3.0, 4.2], radius: 0.2}\n",
    "nav2_params.yaml": "local_costmap:\n  local_costmap:\n    ros__parameters:\n      robot_radius: 0.22\n",
}


@pytest.fixture
def _few_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(film, "FRAMES_PER_SECOND", 1)
    monkeypatch.setattr(film, "LONGEST", 2.0)


@pytest.mark.slow
@pytest.mark.needs_ompl
@pytest.mark.usefixtures("_few_frames")
@pytest.mark.parametrize("page", [page for page in PAGES if any("not run" not in one.mark for one in blocks_of(page))])
def test_the_code_of_a_page_runs_in_an_empty_folder(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": "__main__"}
    for block in blocks_of(page):
        if "not run" in block.mark:
            continue
        lay_out(block.mark.get("given", ""))
        if block.kind == "console":
            for line in commands_of(block.code):
                allowed = (0, 1) if line[0] == "drive" else (0,)  # plans come late on a slow machine
                assert main(line) in allowed, (line, capsys.readouterr())
        elif block.kind == "python":
            exec(compile(block.code, page, "exec"), names)
        elif "file" in block.mark:
            Path(block.mark["file"]).write_text(block.code, encoding="utf-8")
        else:
            assert block.kind == "yaml" and yaml.safe_load(block.code), block


def commands_of(code: str) -> list[list[str]]:
    """The arguments of each ``$ cbrrt`` in a block; no other program is run."""
    lines = code.replace("\\\n", " ").splitlines()
    words = [shlex.split(line.strip().removeprefix("$ "), comments=True) for line in lines if line.strip()]
    assert all(program == "cbrrt" for program, *_ in words), code
    return [arguments for _, *arguments in words]


@pytest.mark.parametrize("page", PAGES)
def test_a_block_that_is_not_run_says_why(page: str) -> None:
    for block in blocks_of(page):
        assert set(block.mark) <= {"not run", "file", "given"}, block
        assert block.mark.get("not run", "a reason").count(" ") >= 1, block
        assert block.kind in ("console", "python", "yaml") or "not run" in block.mark, block


@pytest.mark.parametrize("page", PAGES)
def test_commands_that_are_not_run_exist(page: str) -> None:
    text = "\n".join(block.code for block in blocks_of(page) if block.kind in ("console", "bash"))
    for line in text.replace("\\\n", " ").splitlines():
        words = shlex.split(line.removeprefix("$ ").partition(" > ")[0], comments=True)
        if words[:1] == ["cbrrt"]:
            assert callable(build_parser().parse_args(words[1:]).run), line


def test_every_fence_is_a_block_that_is_found() -> None:
    for page in PAGES:
        fences = re.findall(r"^ *```\w+$", (REPOSITORY / page).read_text(encoding="utf-8"), flags=re.MULTILINE)
        assert len(fences) == len(list(blocks_of(page))), page
