"""The player: a page of its own that draws an animation from numbers on canvases, without a network."""

from __future__ import annotations

import html
import json
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

PLACE = "/*NUMBERS*/"
"""Where the template takes the numbers."""


def player_page(numbers: Mapping[str, Any]) -> str:
    """The page that plays an animation.

    Args:
        numbers: what :mod:`cbrrt_ompl.figures.player_numbers` makes.

    Returns:
        HTML with its style and script in it.
    """
    template = files("cbrrt_ompl.figures").joinpath("player.html").read_text(encoding="utf-8")
    title = html.escape(str(numbers["name"]))
    text = json.dumps(numbers, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return template.replace("<title></title>", f"<title>{title}</title>").replace(PLACE, text)


def framed(page: str) -> str:
    """A page inside another one, as notebooks show it."""
    return (
        '<iframe title="animation" style="width: 100%; height: 640px; border: 0" '
        f'sandbox="allow-scripts" srcdoc="{html.escape(page)}"></iframe>'
    )
