"""Figures in files."""

from __future__ import annotations

import io
from pathlib import Path

from matplotlib import rc_context
from matplotlib.figure import Figure

from cbrrt_ompl.files import write_file

TRUE_TYPE = 42
"""How fonts are embedded: editors can edit it and publishers take it; matplotlib's own choice is Type 3."""


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure in the format of the file's suffix, whole or not at all.

    Args:
        figure: what is written.
        path: the file.

    Raises:
        InputError: if the file cannot be written.
    """
    buffer = io.BytesIO()
    with rc_context({"pdf.fonttype": TRUE_TYPE}):
        figure.savefig(buffer, format=path.suffix.removeprefix(".").lower())
    write_file(path, buffer.getvalue())
