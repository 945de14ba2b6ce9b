"""Footprints of robots in scenario files: by their type, or as Nav2 writes them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from cbrrt_ompl.checks import is_number
from cbrrt_ompl.errors import InputError
from cbrrt_ompl.problem.robot import Footprint
from cbrrt_ompl.scenario.plain_yaml import parse_yaml
from cbrrt_ompl.scenario.sections import Key, Report, build, kind_of, list_of, number, pair_of, shape_of

_corners = list_of(pair_of("a point [x, y] of finite numbers [m]"), "a list of corners [[x, y], ...] [m]")


class FootprintKind(NamedTuple):
    """A kind of footprint."""

    make: Callable[..., Footprint]
    """Makes it from the values of its keys."""
    keys: dict[str, Key]
    """Its keys besides the type."""


FOOTPRINTS = {
    "disc": FootprintKind(Footprint.disc, {"radius": Key(number, required="a radius of 0 or more [m]")}),
    "polygon": FootprintKind(
        Footprint.polygon,
        {"vertices": Key(_corners, required="a list of corners [[x, y], ...] [m] in the robot's frame")},
    ),
}
"""All kinds by their type."""


def footprint(value: object, path: str, report: Report) -> Footprint | None:
    """A footprint of any type, given with its type or in the notation of Nav2.

    A list of corners is a polygon, also inside a text (``"[[0.2, 0.1], ...]"``), and a number is the radius of a disc.
    """
    value = _typed(value)
    kind = kind_of(value, path, FOOTPRINTS, report)
    if kind is None:
        return None
    make, keys = FOOTPRINTS[kind]
    return build(make, shape_of(value, path, keys, report), path, report)


def disc(value: object, path: str, report: Report) -> Footprint | None:
    """The disc of a radius."""
    radius = number(value, path, report)
    try:
        return None if radius is None else Footprint.disc(radius)
    except InputError:
        report.add(path, value, "a radius of 0 or more [m]")
        return None


def _typed(value: object) -> object:
    """A footprint with its type, where its notation tells it."""
    if isinstance(value, str):
        value = _inside(value)
    if isinstance(value, list):
        return {"type": "polygon", "vertices": value}
    if is_number(value):
        return {"type": "disc", "radius": value}
    if isinstance(value, Mapping) and "type" not in value:
        kinds = [kind for kind, row in FOOTPRINTS.items() if row.keys.keys() & value.keys()]
        return {"type": kinds[0], **value} if len(kinds) == 1 else value
    return value


def _inside(text: str) -> object:
    """The list that a text holds; the text itself where there is none."""
    try:
        found = parse_yaml(text, [])
    except InputError:
        return text
    return found if isinstance(found, list) else text
