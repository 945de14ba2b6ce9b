"""Files that commands write: their options, and whether they can be written, before any work."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from cbrrt_ompl.errors import InputError, Problem, Refusal
from cbrrt_ompl.files import files_read

SUFFIXES = {
    "trajectory": (".csv", ".npz", ".json", ".mcap", ".yaml"),
    "output": (".csv", ".npz", ".json", ".mcap", ".yaml"),
    "figure": (".png", ".pdf", ".svg"),
    "animation": (".gif", ".html", ".mp4"),
    "database": (".db", ".sqlite", ".sqlite3"),
}
"""What the names of files end in, by the option that takes them."""


def add_output_files(parser: argparse.ArgumentParser, files: Mapping[str, str], required: bool = False) -> None:
    """Options that take files to write.

    Args:
        parser: takes the options.
        files: what is written, by the option's name from `SUFFIXES`.
        required: whether they must be given.
    """
    for name, meaning in files.items():
        *others, last = SUFFIXES[name]
        text = f"{meaning}: {', '.join(others)} or {last}"
        parser.add_argument(f"--{name}", type=Path, required=required, metavar="FILE", help=text)


def add_output_folder(parser: argparse.ArgumentParser, default: str, content: str) -> None:
    """``--output``, a folder that is made where it is missing.

    Args:
        parser: takes the option.
        default: the folder without it.
        content: what is written there.
    """
    text = f"folder for {content} (default: {default})"
    parser.add_argument("--output", type=Path, default=Path(default), metavar="DIR", help=text)


def check_output_files(arguments: argparse.Namespace, names: Iterable[str]) -> None:
    """Find out before any work whether its results can be written.

    Args:
        arguments: the command line.
        names: options from `SUFFIXES` that the command writes files for, where they are given.

    Raises:
        InputError: with every file that cannot be written, or for a kind of animation that needs a program.
        CbrrtError: if matplotlib, which is to draw one of them, cannot be used.
    """
    files = {name: path for name in names if (path := getattr(arguments, name)) is not None}
    problems = [problem for name, path in files.items() if (problem := _problem_with(name, path))]
    if problems:
        raise InputError(problems)
    if any(path.suffix.lower() == ".mcap" for path in files.values()):
        from cbrrt_ompl.export.ros_bag import check_rosbags

        check_rosbags()
    if "figure" in files or "animation" in files:
        check_backend()
    if "animation" in files:
        from cbrrt_ompl.figures.animation import check_animation_file

        check_animation_file(files["animation"])


@contextmanager
def keeping_inputs(arguments: argparse.Namespace, names: Iterable[str]) -> Iterator[None]:
    """Read what a command works on, and refuse to write its results over that: a map's image is soon forgotten.

    Args:
        arguments: the command line.
        names: options that the command writes files for.

    Raises:
        InputError: at the end, with every file to write that was read.
    """
    with files_read() as read:
        yield
    problems = [
        Problem(f"--{name}", str(path), "another file: this one is read, and would be lost")
        for name in names
        if (path := getattr(arguments, name)) is not None
        and path.exists()
        and any(file.exists() and path.samefile(file) for file in read)
    ]
    if problems:
        raise InputError(problems)


def _problem_with(name: str, path: Path) -> Problem | None:
    """Why a file of an option cannot be written; None where it can be."""
    suffixes = SUFFIXES[name]
    if path.suffix.lower() not in suffixes:
        return Problem(f"--{name}", str(path), f"a file name that ends in {', '.join(suffixes)}")
    if not path.parent.is_dir():
        return Problem(f"--{name}", Refusal(f"no such folder: {path.parent}"), "a file in a folder that exists")
    if path.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK):
        return Problem(f"--{name}", str(path), "a file that may be written")
    return None


def check_backend() -> None:
    """Import matplotlib, which refuses a wrong MPLBACKEND.

    Raises:
        InputError: if it does.
    """
    try:
        import matplotlib  # noqa: F401  # the import is the check
    except ValueError:
        raise InputError(Problem("MPLBACKEND", os.environ.get("MPLBACKEND"), "a backend of matplotlib")) from None
