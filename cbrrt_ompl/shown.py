"""What shows itself in a notebook: a picture, drawn when it is asked for."""

from __future__ import annotations

from collections.abc import Callable


class Shown:
    """A value that Jupyter shows as a picture."""

    __slots__ = ()

    def _repr_png_(self) -> bytes | None:
        """The picture; None where there is nothing to draw."""
        return None if _painter is None else _painter(self)


_painter: Callable[[Shown], bytes | None] | None = None
"""Draws values; the package names it, since nothing below the figures draws by itself."""


def show_by(painter: Callable[[Shown], bytes | None]) -> None:
    """Have values drawn.

    Args:
        painter: makes the picture of a value as PNG; None for one that it cannot draw.
    """
    global _painter
    _painter = painter
