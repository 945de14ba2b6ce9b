"""A scenario file for a map, with comments, to be changed by hand."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from cbrrt_ompl.problem.settings import FOR_MAPS
from cbrrt_ompl.scenario.plain_yaml import dump_line

WIDTH = 44
"""Column of the comments behind values."""


def scenario_text(data: Mapping[str, Any], command: str) -> str:
    """A commented scenario file.

    Args:
        data: plain values with the keys of a scenario file: name, map, robot, start, goal and planning.
        command: what the file is planned with.

    Returns:
        YAML, from which the same values are read.
    """
    start, goal = _in_degrees(data["start"]), _in_degrees(data["goal"])
    lines = [
        f"# Look at it with 'cbrrt show FILE', plan with '{command}'.",
        "# Metres, seconds and radians (degrees in keys that end in _deg), in the frame of the map.",
        _line({"name": data["name"]}, "for figures and tables"),
        _line({"map": _short(data["map"], "file")}, "or {file: ..., unknown: free, keepout: mask.yaml}"),
        _line({"robot": data["robot"]}, "or {model: ..., footprint: ..., limits: ...}"),
        _line({"start": start}, "the robot stands still there"),
        _line({"goal": goal}, "a disc to stop or drive through"),
    ]
    if "theta_deg" not in goal:
        lines.append("  # in a heading: theta_deg: 90, heading_tolerance_deg: 15")
    if "speed_tolerance" not in goal:
        lines.append("  # and at rest: speed_tolerance: 0.01")
    lines.append("planning:")
    lines += [_line({key: value}, _MEANINGS.get(key, ""), "  ") for key, value in data["planning"].items()]
    lines += [
        f"  # {dump_line({key: value})}  {meaning}" for key, value, meaning in _MORE if key not in data["planning"]
    ]
    return "\n".join(line.rstrip() for line in lines) + "\n"


_MEANINGS = {
    "clearance": "distance to keep from everything [m]",
}
_MORE = (
    ("horizon", FOR_MAPS.horizon, "duration of one extension [s]: about a room at full speed"),
    ("closed_loop", FOR_MAPS.closed_loop, "ask the control law at every step"),
    ("goal_bias", FOR_MAPS.goal_bias, "fraction of the samples that are the goal"),
    ("max_samples", FOR_MAPS.max_samples, "samples after which a plan has failed"),
    ("brake_safe", True, "keep only what the robot can brake from"),
)


def _line(entry: Mapping[str, Any], comment: str, indent: str = "") -> str:
    """A key and its value, and a comment in its column."""
    ((key, value),) = entry.items()
    text = f"{indent}{dump_line({key: value})}"
    return f"{text:{WIDTH}}  # {comment}" if comment else text


def _short(section: Mapping[str, Any], key: str) -> object:
    """The value of a section's only key, which stands for the section."""
    return section[key] if list(section) == [key] else section


def _in_degrees(section: Mapping[str, Any]) -> dict[str, Any]:
    """A section whose angles are in degrees, as people think of them."""
    angles = ("theta", "heading_tolerance")
    return {
        (f"{name}_deg" if name in angles else name): round(math.degrees(value), 3) if name in angles else value
        for name, value in section.items()
    }
