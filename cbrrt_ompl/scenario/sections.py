"""Mappings of an input file read key by key into checked values, every mistake collected in a report."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from cbrrt_ompl.checks import is_number
from cbrrt_ompl.errors import MISSING, InputError, Problem, Remark
from cbrrt_ompl.scenario.plain_yaml import key_path

T = TypeVar("T")


UNLIMITED = "unlimited"
"""What stands for a limit that there is not."""

MAX_TEXT = 1000
"""Longest text that is read, such as a name [characters]."""


@dataclass
class Report:
    """What was wrong with an input, in the order of reading.

    Attributes:
        problems: the mistakes.
        homes: the section that a key belongs to, for the message where it stands elsewhere.
        foreign: what stands here for a key of another program, by its name there.
        folder: what the names of files are relative to.
        defaults: values that take the place of keys that are left out, by the section; from a file that another
            section names.
        degrees: for every angle that was given in degrees, the path of its value in radians, and the path and value
            as written.
    """

    problems: list[Problem] = field(default_factory=list)
    homes: Mapping[str, str] = field(default_factory=dict)
    foreign: Mapping[str, str] = field(default_factory=dict)
    folder: Path = field(default_factory=Path)
    defaults: dict[str, dict[str, Any]] = field(default_factory=dict)
    degrees: dict[str, tuple[str, object]] = field(default_factory=dict)

    def add(self, path: str, value: object, expected: str) -> None:
        """Add one mistake; a value that was left empty is called nothing."""
        self.problems.append(Problem(path, Remark("nothing") if value is None else value, expected))

    def adopt(self, problems: Sequence[Problem], path: str | None = None) -> None:
        """Add the mistakes that a constructor found, as the user wrote the values.

        Args:
            problems: what the constructor reported.
            path: what replaces the first part of their fields; None keeps the fields.
        """
        for problem in problems:
            if path is not None:
                problem = replace(problem, field=path + problem.field[_first_part(problem.field) :])
            if problem.field in self.degrees:
                written_field, written = self.degrees[problem.field]
                problem = replace(problem, field=written_field, value=written)
            self.problems.append(problem)


Converter: TypeAlias = Callable[[object, str, Report], Any]
"""Makes a value of a plain one at a path; reports a mistake and then returns None."""


@dataclass(frozen=True)
class Key:
    """How one key of a section is read."""

    convert: Converter
    """What makes its value."""
    required: str = ""
    """What is expected where it is missing; empty if it may be left out."""
    is_angle: bool = False
    """Whether it may be given in degrees, with the suffix ``_deg``."""


def read_partial(data: object, path: str, keys: Mapping[str, Key], report: Report) -> dict[str, Any]:
    """Values of the keys of a section that are there and right.

    Args:
        data: what the file holds at the path.
        path: dotted path of the section.
        keys: the keys that the section may have.
        report: where the mistakes go.

    Returns:
        The values by the names of the keys, angles in radians.
    """
    if not isinstance(data, Mapping):
        report.add(path, data, f"a mapping with the keys {', '.join(keys)}")
        return {}
    known = _names(keys)
    for unknown in [key for key in data if key not in known]:
        report.add(key_path(path, unknown), Remark("an unknown key"), _advice(unknown, path, keys, report))
    values = {name: _read_key(data, path, name, key, report) for name, key in keys.items()}
    return {name: value for name, value in values.items() if value is not None}


def read_section(data: object, path: str, keys: Mapping[str, Key], report: Report) -> dict[str, Any] | None:
    """Values of the keys of a section, or None if anything in it is wrong; see :func:`read_partial`."""
    before = len(report.problems)
    values = read_partial(data, path, keys, report)
    return values if len(report.problems) == before else None


def build(make: Callable[..., T], values: Mapping[str, Any] | None, path: str, report: Report) -> T | None:
    """An object made of a section's values.

    Args:
        make: what makes it, from keyword arguments.
        values: the arguments; None if the section was wrong.
        path: dotted path of the section, the first part of the fields that ``make`` complains about.
        report: where the mistakes go.

    Returns:
        The object, or None if there is none.
    """
    if values is None:
        return None
    try:
        return make(**values)
    except InputError as error:
        report.adopt(error.problems, path)
        return None


def number(value: object, path: str, report: Report) -> float | None:
    """A finite number."""
    if is_number(value):
        return float(value)
    report.add(path, value, "a finite number")
    return None


def number_or_unlimited(value: object, path: str, report: Report) -> float | None:
    """A finite number, or infinity where it says so."""
    if value == UNLIMITED:
        return math.inf
    if not is_number(value):
        report.add(path, value, f"a finite number, or {UNLIMITED}")
        return None
    return float(value)


def whole_number(value: object, path: str, report: Report) -> int | None:
    """A number without a fraction."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or value % 1 != 0:
        report.add(path, value, "a whole number")
        return None
    return int(value)


def flag(value: object, path: str, report: Report) -> bool | None:
    """A truth value."""
    if isinstance(value, bool):
        return value
    report.add(path, value, "true or false")
    return None


def text(value: object, path: str, report: Report) -> str | None:
    """One line of text."""
    if isinstance(value, str) and value.strip() and value.isprintable() and len(value) <= MAX_TEXT:
        return value
    is_long = isinstance(value, str) and len(value) > MAX_TEXT
    report.add(path, value, f"one line of text{f' of at most {MAX_TEXT} letters' if is_long else ''}")
    return None


def one_of(choices: Sequence[str]) -> Converter:
    """Reader of one of some texts."""

    def choice(value: object, path: str, report: Report) -> str | None:
        if isinstance(value, str) and value in choices:
            return value
        report.add(path, value, f"one of {', '.join(choices)}")
        return None

    return choice


def list_of(convert: Converter, expected: str) -> Converter:
    """Reader of a list, without the entries that are wrong."""

    def entries(value: object, path: str, report: Report) -> list[Any] | None:
        if not isinstance(value, (list, tuple)):
            report.add(path, value, expected)
            return None
        read = (convert(entry, f"{path}[{i}]", report) for i, entry in enumerate(value))
        return [entry for entry in read if entry is not None]

    return entries


def pair_of(expected: str) -> Converter:
    """Reader of two finite numbers."""

    def pair(value: object, path: str, report: Report) -> tuple[float, float] | None:
        silent = Report()
        if isinstance(value, (list, tuple)) and len(value) == 2:
            first, second = (number(entry, path, silent) for entry in value)
            if first is not None and second is not None:
                return first, second
        report.add(path, value, expected)
        return None

    return pair


def kind_of(value: object, path: str, kinds: Mapping[str, object], report: Report) -> str | None:
    """The type of a shape."""
    if not isinstance(value, Mapping):
        report.add(path, value, f"a mapping with a type: {', '.join(kinds)}")
        return None
    kind: str | None = one_of(list(kinds))(value.get("type", MISSING), f"{path}.type", report)
    return kind


def shape_of(value: object, path: str, keys: Mapping[str, Key], report: Report) -> dict[str, Any] | None:
    """The values of a shape, without its type."""
    values = read_section(value, path, {"type": Key(text), **keys}, report)
    return values and {name: value for name, value in values.items() if name != "type"}


def _read_key(data: Mapping[Any, object], path: str, name: str, key: Key, report: Report) -> Any:
    """Value of one key, or None if it is not there or wrong."""
    spellings = [name, f"{name}_deg"] if key.is_angle else [name]
    found = [spelling for spelling in spellings if spelling in data]
    if not found:
        if key.required:
            report.add(key_path(path, name), MISSING, key.required)
        return None
    written = key_path(path, found[0])
    if len(found) > 1:
        report.add(key_path(path, found[1]), data[found[1]], f"either {found[0]} or {found[1]}")
        return None
    value = key.convert(data[found[0]], written, report)
    if found[0] == name or value is None:
        return value
    report.degrees[key_path(path, name)] = (written, data[found[0]])
    return tuple(map(math.radians, value)) if isinstance(value, tuple) else math.radians(value)


def _names(keys: Mapping[str, Key]) -> list[str]:
    """All spellings of some keys."""
    return [spelling for name, key in keys.items() for spelling in (name, f"{name}_deg")[: 1 + key.is_angle]]


def _advice(unknown: object, path: str, keys: Mapping[str, Key], report: Report) -> str:
    """What should stand in the place of an unknown key."""
    home = report.homes.get(str(unknown).removesuffix("_deg"), path)
    if home != path:
        return f"it under {home}"
    if str(unknown) in report.foreign:
        return report.foreign[str(unknown)]
    close = difflib.get_close_matches(str(unknown), _names(keys), n=1)
    return close[0] if close else f"one of {', '.join(_names(keys))}"


def _first_part(path: str) -> int:
    """Length of the first part of a dotted path."""
    return min((i for i in (path.find("."), path.find("[")) if i >= 0), default=len(path))
