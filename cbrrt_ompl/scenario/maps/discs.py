"""Lists of discs in CSV files, as the BARN worlds come in."""

from __future__ import annotations

import csv
from pathlib import Path

from cbrrt_ompl.errors import MapError, Problem, Remark, WorldError
from cbrrt_ompl.files import as_path, refusal
from cbrrt_ompl.problem.obstacles import Disc

HEADER = ["x", "y", "radius"]


def load_discs(path: str | Path) -> list[Disc]:
    """Discs from a CSV file with the header ``x,y,radius``, in metres.

    Args:
        path: the file.

    Returns:
        A disc a row.

    Raises:
        MapError: with every line that holds no disc.
    """
    path = as_path(path, MapError)
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv.reader(file))
    except (OSError, ValueError, csv.Error) as error:
        reason = refusal(error) if isinstance(error, OSError) else Remark(error)
        raise MapError(Problem("", reason, "a CSV file that can be read"), str(path)) from None
    if not rows or [cell.strip() for cell in rows[0]] != HEADER:
        found = ",".join(rows[0]) if rows else ""
        raise MapError(Problem("line 1", found, f"the header {','.join(HEADER)}"), str(path))
    discs, problems = [], []
    for number, row in enumerate(rows[1:], start=2):
        try:
            if row:
                x, y, radius = map(float, row)
                discs.append(Disc((x, y), radius))
        except WorldError as error:
            problems += [Problem(f"line {number}: {p.field}", p.value, p.expected) for p in error.problems]
        except ValueError:
            problems.append(Problem(f"line {number}", ",".join(row), "three numbers x,y,radius [m]"))
    if problems:
        raise MapError(problems, str(path))
    return discs
