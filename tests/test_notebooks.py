"""The notebooks: stored without outputs, in the house's form, and run from top to bottom."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

FOLDER = Path(__file__).resolve().parent.parent / "notebooks"
NOTEBOOKS = sorted(path.stem for path in FOLDER.glob("*.ipynb"))
FIGURES = {
    "1_first_plan": 4,
    "2_how_a_tree_grows": 5,
    "3_own_map_and_robot": 5,
    "4_benchmark": 2,
    "5_half_known_world": 3,
    "6_improving": 4,
}
"""Pictures that a notebook shows at least; those of sliders are theirs and not counted."""

IN_OMPL = ("1_first_plan", "4_benchmark")
"""Those that plan with OMPL."""


LARGEST = 2_000_000
"""Size of a notebook that has run [bytes]."""


def is_log_line(line: str) -> bool:
    """Whether OMPL has written a line, as in ``Info:    No planner specified. Using default.``."""
    return line.startswith(("Info:", "Debug:", "Warning:", "Error:"))


def read(name: str) -> Any:
    """A stored notebook."""
    return nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)


def test_every_notebook_is_known() -> None:
    assert NOTEBOOKS == sorted(FIGURES)


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_stored_notebook_holds_no_outputs(name: str) -> None:
    code = [cell for cell in read(name).cells if cell.cell_type == "code"]
    assert code
    assert all(cell.outputs == [] and cell.execution_count is None for cell in code)


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_asks_one_question_and_imports_in_its_first_cell(name: str) -> None:
    title, first, *others = read(name).cells
    heading = title.source.splitlines()[0]
    assert heading.startswith("# ") and heading.endswith("?")
    assert first.cell_type == "code" and first.source.startswith(("import ", "from "))
    code = [cell.source for cell in others if cell.cell_type == "code"]
    assert not [line for source in code for line in source.splitlines() if line.startswith(("import ", "from "))]


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.needs_ompl] if name in IN_OMPL else []) for name in NOTEBOOKS]
)
def test_a_notebook_runs_from_top_to_bottom(
    name: str, repository: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(repository))
    notebook = read(name)
    NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert sum("image/png" in output.get("data", {}) for output in outputs) >= FIGURES[name]
    assert not [output.text for output in outputs if output.get("name") == "stderr"]
    assert not [
        text for output in outputs if (text := output.get("data", {}).get("text/plain", "")).startswith("<Axes")
    ]
    assert not [line for output in outputs for line in output.get("text", "").splitlines() if is_log_line(line)]
    assert len(nbformat.writes(notebook)) < LARGEST
