"""YAML files read into plain values: a small, safe and strict part of YAML 1.2.

PyYAML's own loader reads YAML 1.1, where ``1e-3`` is a text, ``1:30`` is ninety, ``no`` is false, and where the second
of two equal keys wins silently. Here numbers, booleans and null are those of the YAML 1.2 core schema (decimal only),
equal keys are reported, and tags, aliases and deep nesting are refused, so that no small file can grow large.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml

from cbrrt_ompl.errors import InputError, Problem, Remark
from cbrrt_ompl.files import note_read, refusal

MAX_FILE_SIZE = 16 * 2**20
"""Largest file that is read [bytes]."""

MAX_DEPTH = 20
"""Deepest nesting of lists and mappings that is read."""

_BRACKETS = re.compile(
    r"""(?<![^\s\[\]{},:])(?:"(?:[^"\\]|\\.)*"|'(?:[^']|'')*')|(?P<opening>[\[{])|(?P<closing>[\]}])""", re.DOTALL
)
"""The brackets of a text inside lists and mappings; those in quotes are passed over."""

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_UNREADABLE = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_INTEGER = re.compile(r"[-+]?[0-9]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INFINITE = re.compile(r"([-+]?)\.(inf|Inf|INF)")
_WORDS = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys((".nan", ".NaN", ".NAN"), math.nan),
}


def read_yaml(path: Path, problems: list[Problem]) -> object:
    """Plain value of a YAML file.

    Args:
        path: the file.
        problems: where mistakes that need not end the reading (equal keys) are added.

    Returns:
        What the file holds: None, bool, int, float, str, list or dict.

    Raises:
        InputError: if the file cannot be read, or is no YAML of the kind described above.
    """
    note_read(path)
    try:
        with path.open("rb") as file:
            content = file.read(MAX_FILE_SIZE + 1)
    except (OSError, ValueError) as error:
        raise InputError(Problem("", refusal(error), "a file that can be read")) from None
    if len(content) > MAX_FILE_SIZE:
        raise InputError(Problem("", Remark("a larger file"), f"at most {MAX_FILE_SIZE} bytes"))
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        where = f"byte {error.start}"
        raise InputError(Problem(where, content[error.start : error.start + 1], "text in UTF-8")) from None
    return parse_yaml(text, problems)


def parse_yaml(text: str, problems: list[Problem]) -> object:
    """Plain value of a YAML text; see :func:`read_yaml`."""
    unreadable = _UNREADABLE.search(text)
    if unreadable:
        line, column = _place(text, unreadable.start())
        raise InputError(Problem(f"line {line}, column {column}", unreadable[0], "printable characters"))
    try:
        return _Builder(yaml.parse(text, Loader=_LOADER), problems).document()
    except yaml.YAMLError as error:
        _refuse_deep_nesting(text)
        raise InputError(_syntax_problem(error, text)) from None


def _refuse_deep_nesting(text: str) -> None:
    """Say so where a text that PyYAML refuses is nested too deeply.

    PyYAML reads a thousand characters of a line ahead of the list that it reports, in case it is a key, and may end at
    a limit of its own there. Without the rest of the text nothing is left to read ahead.

    Raises:
        InputError: if lists and mappings are nested too deeply up to the place of the error.
    """
    depth = end = 0
    try:
        for event in yaml.parse(text, Loader=_LOADER):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            end = event.end_mark.index if event.end_mark else end
    except yaml.YAMLError:
        pass
    for bracket in _BRACKETS.finditer(text, end):
        depth += (bracket["opening"] is not None) - (bracket["closing"] is not None)
        if depth > MAX_DEPTH:
            with suppress(yaml.YAMLError):
                _Builder(yaml.parse(text[: bracket.end()], Loader=_LOADER), []).document()
            return


def resolve(text: str) -> object:
    """Value of a scalar without quotes, by the core schema of YAML 1.2.

    Args:
        text: the scalar as written.

    Returns:
        None, a bool, an int, a float (also for integers of more than 18 digits), or else the text itself.
    """
    if text in _WORDS:
        return _WORDS[text]
    if _INTEGER.fullmatch(text):
        return int(text) if len(text) <= 18 else float(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    infinite = _INFINITE.fullmatch(text)
    return float(f"{infinite[1]}inf") if infinite else text


def dump_line(value: Mapping[str, object]) -> str:
    """A mapping in YAML on one line, without the outer braces; floats keep every digit."""
    return ", ".join(f"{_dump_scalar(name)}: {_dump_flow(entry)}" for name, entry in value.items())


def _dump_flow(value: object) -> str:
    """A value on one line; PyYAML takes a quarter of a millisecond a line to say the same."""
    if isinstance(value, Mapping):
        return f"{{{dump_line(value)}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_dump_flow, value))}]"
    if isinstance(value, float) and math.isfinite(value):
        text = repr(value)
        return text if "." in text else text.replace("e", ".0e")
    return _dump_scalar(value)


@lru_cache(maxsize=1024, typed=True)
def _dump_scalar(value: object) -> str:
    text: str = yaml.dump([value], Dumper=_Dumper, default_flow_style=True, width=math.inf, allow_unicode=True)
    return text.strip()[1:-1]


def key_path(path: str, key: object) -> str:
    """Dotted path of a key inside the mapping at a path."""
    name = key if isinstance(key, str) and key.isprintable() else repr(key)
    name = name if len(name) <= 40 else name[:37] + "..."
    return f"{path}.{name}" if path else name


class _Builder:
    """Makes plain values of PyYAML's parsing events."""

    def __init__(self, events: Iterator[Any], problems: list[Problem]) -> None:
        self._events = events
        self._problems = problems

    def document(self) -> object:
        """The only document of the stream; None where there is none."""
        next(self._events)
        if isinstance(next(self._events), yaml.StreamEndEvent):
            return None
        value = self._value(next(self._events), "", 0)
        next(self._events)
        if not isinstance(next(self._events), yaml.StreamEndEvent):
            raise InputError(Problem("", Remark("a second document"), "a single one: no line ---"))
        return value

    def _value(self, event: Any, path: str, depth: int) -> object:
        if isinstance(event, yaml.AliasEvent):
            raise InputError(Problem(path, Remark(f"the alias *{event.anchor}"), "the value itself"))
        if event.tag is not None:
            raise InputError(Problem(path, Remark(f"the tag {event.tag}"), "a value without a tag"))
        if isinstance(event, yaml.ScalarEvent):
            return resolve(event.value) if event.implicit[0] else event.value
        if depth == MAX_DEPTH:
            raise InputError(Problem(path, Remark("deeper nesting"), f"at most {MAX_DEPTH} levels"))
        if isinstance(event, yaml.SequenceStartEvent):
            return self._sequence(path, depth + 1)
        return self._mapping(path, depth + 1)

    def _sequence(self, path: str, depth: int) -> list[object]:
        values: list[object] = []
        while not isinstance(event := next(self._events), yaml.SequenceEndEvent):
            values.append(self._value(event, f"{path}[{len(values)}]", depth))
        return values

    def _mapping(self, path: str, depth: int) -> dict[str, object]:
        values: dict[str, object] = {}
        while not isinstance(event := next(self._events), yaml.MappingEndEvent):
            if not isinstance(event, yaml.ScalarEvent):
                raise InputError(Problem(path, Remark("a key that is no name"), "names as keys"))
            key = event.value
            value = self._value(next(self._events), key_path(path, key), depth)
            if key in values:
                self._problems.append(Problem(key_path(path, key), value, "this key only once"))
            values[key] = value
        return values


class _Dumper(yaml.SafeDumper):
    """Writes what this module's reader reads back: no aliases, and quotes where a text looks like another value."""

    def ignore_aliases(self, data: object) -> bool:
        """Write equal objects again in full."""
        return True


def _represent_text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    quotes = None if isinstance(resolve(text), str) else '"'
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=quotes)


_Dumper.add_representer(str, _represent_text)


def _place(text: str, position: int) -> tuple[int, int]:
    """Line and column of a character, both from 1."""
    return text.count("\n", 0, position) + 1, position - text.rfind("\n", 0, position)


def _syntax_problem(error: yaml.YAMLError, text: str) -> Problem:
    """The place, the line and the reason of a YAML syntax error."""
    context, problem, *marks = (
        getattr(error, name, None) for name in ("context", "problem", "problem_mark", "context_mark")
    )
    mark = next(filter(None, marks), None)
    lines = text.splitlines() or [""]
    number = min(mark.line, len(lines) - 1) if mark else 0
    where = f"line {mark.line + 1}, column {mark.column + 1}" if mark else ""
    reason = ": ".join(part for part in (context, problem) if part) or str(error)
    return Problem(where, lines[number].strip(), f"valid YAML ({' '.join(reason.split())})")
