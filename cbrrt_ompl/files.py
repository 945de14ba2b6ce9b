"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import shutil
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path

from cbrrt_ompl.errors import CbrrtError, InputError, Problem, Refusal, Remark

_READ: ContextVar[list[Path] | None] = ContextVar("_READ", default=None)
"""Where :func:`note_read` writes to."""


def as_path(path: object, error: type[InputError]) -> Path:
    """A path that a caller handed over.

    Args:
        path: a text or a path.
        error: what to raise.

    Raises:
        InputError: of the kind asked for, if it is neither.
    """
    if isinstance(path, str | os.PathLike) and isinstance(os.fspath(path), str):
        return Path(path)
    raise error(Problem("path", path, "the name of a file"))


def refusal(error: Exception, verb: str = "read") -> Refusal:
    """Why a file was not opened: the system's words, or ours for a name that Python refuses before it asks.

    Args:
        error: what the system, or Python, raised.
        verb: what was tried, ``read`` or ``write``.
    """
    if isinstance(error, FileNotFoundError):
        return Refusal("no such file" if verb == "read" else "no such folder to write in")
    words = str(getattr(error, "strerror", None) or "no name of a file")
    return Refusal(f"cannot {verb} {{}}: {words[0].lower()}{words[1:]}")


@contextmanager
def files_read() -> Iterator[list[Path]]:
    """The files that worlds and robots are read from meanwhile."""
    files: list[Path] = []
    token = _READ.set(files)
    try:
        yield files
    finally:
        _READ.reset(token)


def note_read(path: Path) -> None:
    """Tell :func:`files_read` of a file."""
    files = _READ.get()
    if files is not None:
        files.append(path)


def write_file(path: Path, content: bytes | str, error: type[InputError] = InputError) -> None:
    """Write one file; see :func:`write_files`."""
    write_files({path: content}, error)


def write_new_file(path: Path, content: str) -> None:
    """Write a file that must not exist.

    Raises:
        InputError: if it exists, or cannot be written.
    """
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(content)
    except FileExistsError:
        raise InputError(
            Problem("", Remark("a file that exists"), "a new one: none is overwritten"), str(path)
        ) from None
    except (OSError, ValueError) as error:
        raise InputError(Problem("", refusal(error, "write"), "a file that can be written"), str(path)) from None


def write_files(contents: Mapping[Path, bytes | str], error: type[InputError] = InputError) -> None:
    """Write files that belong together: each beside the old one first, then all into their places.

    A full disk, an exception or a kill leaves the old files whole.

    Args:
        contents: bytes, or text to be written in UTF-8, by the name of the file.
        error: what to raise.

    Raises:
        InputError: of the kind asked for, if a file cannot be written.
    """
    drafts: list[tuple[Path, Path]] = []
    try:
        for path, content in contents.items():
            target = Path(os.path.realpath(path))  # a link stays a link
            data = content.encode() if isinstance(content, str) else content
            if target.exists() and not target.is_file():  # a device takes its bytes at once, a folder none
                target.write_bytes(data)
                continue
            drafts.append((target.with_name(f".cbrrt-{uuid.uuid4().hex}.tmp"), target))
            _write_draft(*drafts[-1], data)
        for draft, target in drafts:
            os.replace(draft, target)
    except (OSError, ValueError) as cause:  # ValueError: a NUL in the name
        raise error(Problem("", refusal(cause, "write"), "a file that can be written"), str(path)) from cause
    finally:
        for draft, _ in drafts:
            with suppress(OSError):  # gone into its place, or never made
                draft.unlink()


@contextmanager
def locked(folder: Path, occupied: str) -> Iterator[None]:
    """Keep other processes out of a folder that they lock as well.

    Args:
        folder: the folder.
        occupied: what to say where another one is using it.

    Raises:
        CbrrtError: if another one is using it.
    """
    import fcntl  # here, since Windows has none

    with open(folder / ".lock", "w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise CbrrtError(f"{folder}: {occupied}") from None
        yield


def _write_draft(draft: Path, target: Path, data: bytes) -> None:
    """Write what is to become the target, with its mode, down to the disk."""
    if target.exists():
        target.open("r+b").close()  # a file that is read-only stays as it is
    with draft.open("xb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    if target.exists():
        shutil.copymode(target, draft)
