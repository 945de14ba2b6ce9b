"""Runs as lines of text, and finished ones in a file of them, so that an interrupted study goes on where it stopped."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from cbrrt_ompl.reproduce.measuring import Run
from cbrrt_ompl.reproduce.study import Key


class Store:
    """A file of runs in JSON, which only grows."""

    def __init__(self, path: Path) -> None:
        """Read what is there; a last line that was cut off is left out, and so is what is no run.

        Args:
            path: the file; it need not exist.
        """
        self._path = path
        self._runs: dict[str, dict[int, Run]] = {}
        lines = path.read_bytes().splitlines() if path.exists() else []
        for line in lines:
            entry = _parsed(line)
            if entry is not None:
                digest, run = entry
                self._runs.setdefault(digest, {})[run.seed] = run

    def runs(self, digest: str) -> dict[int, Run]:
        """The runs of a series by their seeds."""
        return self._runs.get(digest, {})

    def add(self, digest: str, key: Key, runs: Sequence[Run]) -> None:
        """Write runs, and have them on the disk when this returns.

        Args:
            digest: of their series.
            key: which series it is, for readers of the file.
            runs: the runs.
        """
        lines = (json.dumps({"digest": digest, **key._asdict(), **asdict(run)}) for run in runs)
        with open(self._path, "ab") as file:
            if file.tell() and not _ends_a_line(self._path):
                file.write(b"\n")
            file.write("".join(f"{line}\n" for line in lines).encode())
            file.flush()
            os.fsync(file.fileno())
        self._runs.setdefault(digest, {}).update({run.seed: run for run in runs})


def _parsed(line: bytes) -> tuple[str, Run] | None:
    """Digest and run of a line; None where it holds none."""
    try:
        entry: dict[str, Any] = json.loads(line)
        digest = entry.pop("digest")
        for name in Key._fields:
            del entry[name]
        return digest, Run(**entry)
    except (ValueError, TypeError, KeyError, AttributeError):
        return None


def _ends_a_line(path: Path) -> bool:
    """Whether the last byte of a file is the end of a line."""
    with open(path, "rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1) == b"\n"
