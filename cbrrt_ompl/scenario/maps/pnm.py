"""PGM, PBM and PPM files whose header is not as Pillow wants it: with line ends of Windows, or a last comment."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import BinaryIO

_SEPARATOR = rb"(?:\s|#[^\r\n]*[\r\n])+"
_HEADER = re.compile(rb"P([56])" + 2 * (_SEPARATOR + rb"([0-9]{1,9})") + _SEPARATOR + rb"([0-9]{1,5})\s")
_LONGEST_HEADER = 4096
_TOO_MUCH = re.compile(rb"\n|(?:[ \t]*#[^\n]*\n)+")
"""What may stand between the white space behind the header and the first pixel though it should not."""


def open_straight(path: Path) -> BinaryIO:
    """An image file open for reading, where it is a PGM or PPM with nothing between its header and its pixels.

    A single white space ends the header. Who wrote a line end of Windows there, or a comment behind it, shifts every
    pixel; this is told by the length of the file.

    Raises:
        OSError: if the file cannot be read.
    """
    file = path.open("rb")
    try:
        head = file.read(_LONGEST_HEADER)
        header = _HEADER.match(head)
        extra = _TOO_MUCH.match(head, header.end()) if header else None
        if header and extra:
            channels, (width, height, peak) = 3 if header[1] == b"6" else 1, map(int, header.groups()[1:])
            pixels = width * height * channels * (1 if peak < 256 else 2)
            behind = path.stat().st_size - header.end()
            is_comment = extra[0] != b"\n"
            if behind - len(extra[0]) == pixels or (not is_comment and _ends_in_cr(head, header) and behind > pixels):
                file.seek(extra.end())
                return io.BytesIO(head[: header.end()] + file.read())
        file.seek(0)
    except BaseException:
        file.close()
        raise
    return file


def _ends_in_cr(head: bytes, header: re.Match[bytes]) -> bool:
    return head[header.end() - 1 : header.end()] == b"\r"
