"""What shows itself in a notebook: a picture, drawn when it is asked for."""

from __future__ import annotations


class Shown:
    """A value that Jupyter shows as a picture."""

    __slots__ = ()

    def _repr_png_(self) -> bytes | None:
        """The picture; None where there is nothing to draw."""
        from cbrrt_ompl.figures.notebook import png_of  # the one way up: nothing below figures draws by itself

        return png_of(self)
