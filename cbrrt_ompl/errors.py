"""What a caller may catch: every error of this package derives from :class:`CbrrtError`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any


class CbrrtError(Exception):
    """Base of all errors that this package raises on purpose."""


@dataclass(frozen=True)
class Problem:
    """One mistake in an input.

    Attributes:
        field: dotted path of the value inside its file or call, such as ``robot.limits.v``.
        value: what was found there.
        expected: what should have been there.
    """

    field: str
    value: object
    expected: str

    def told(self, source: str) -> str:
        """One line about a file or call; what the system refused is told as a sentence: ``no such file: x.yaml``."""
        if isinstance(self.value, Refusal) and not self.field:
            return self.value.about(source)
        return f"{source}: {self}" if source else str(self)

    def __str__(self) -> str:
        """One line: field, value, expectation."""
        where = f"{self.field}: " if self.field else ""
        if isinstance(self.value, Refusal):
            return where + self.value.about("")
        shown = "missing" if self.value is MISSING else f"got {_short(self.value)}"
        return f"{where}{shown}, expected {self.expected}"


class _Missing:
    """Marks a value that is not there, so that None can be reported as a value."""

    def __repr__(self) -> str:
        return "nothing"

    def __reduce__(self) -> str:
        return "MISSING"


MISSING = _Missing()


class Remark(str):
    """A remark in the place of a value: a message shows it without quotes."""

    __slots__ = ()

    def __repr__(self) -> str:
        """The remark itself."""
        return str(self)


class Refusal(Remark):
    """Why the system did not read or write a file, in its words; see :func:`cbrrt_ompl.files.refusal`."""

    __slots__ = ()

    def about(self, source: str) -> str:
        """A sentence about a file: the reason has a place for its name, or comes before it."""
        if not source:
            return self.replace(" {}", "")
        return self.replace("{}", source) if "{}" in self else f"{self}: {source}"


def _error_again(kind: type[InputError], text: str, attributes: dict[str, Any]) -> InputError:
    """An error that another process raised."""
    error = kind.__new__(kind, text)
    error.__dict__.update(attributes)
    return error


class InputError(CbrrtError, ValueError):
    """Input that cannot be used: a file, or the arguments of a call.

    Attributes:
        problems: every mistake that was found, in the order of the input.
        source: the file (or call) that holds them.
    """

    def __init__(self, problems: Problem | Sequence[Problem], source: str = "") -> None:
        """Report one mistake or several, each on a line of its own."""
        self.problems = [problems] if isinstance(problems, Problem) else list(problems)
        self.source = source
        super().__init__("\n".join(problem.told(source) for problem in self.problems))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled whole, for a parent process: an error is made anew from its arguments, which are a text here."""
        return _error_again, (type(self), str(self), self.__dict__)


class WorldError(InputError):
    """An obstacle, a bound or a footprint that describes no solid."""


class MapError(InputError):
    """A map that cannot be read, or that holds no world."""


class RobotError(InputError):
    """A limit, a gain or a footprint that no robot can have."""


class SettingsError(InputError):
    """A planning setting or a goal that makes no sense."""


class ScenarioError(InputError):
    """A scenario that cannot be planned in, or a scenario file that cannot be read."""


class TrajectoryError(InputError):
    """A trajectory file that cannot be read, or arrays that are no trajectory."""


class UnknownPlannerError(InputError):
    """A planner name that is not known.

    Attributes:
        name: the name that came.
        known: the names that are known, sorted.
    """

    def __init__(self, name: str, known: Sequence[str]) -> None:
        """Report the unknown name together with the known ones."""
        self.name, self.known = name, sorted(known)
        super().__init__(Problem("planner", name, f"one of {', '.join(self.known)}"))


class OmplMissingError(CbrrtError, ImportError):
    """Something that needs OMPL, where OMPL is not installed.

    Attributes:
        what: what needs it.
        instead: what does not need it; empty where nothing does the same.
    """

    def __init__(self, what: str, instead: str = "") -> None:
        """Report what needs OMPL, where OMPL is to be had, and what to use without it."""
        self.what, self.instead = what, instead
        where = f"which has wheels for Python 3.10 to 3.12 (this is {'.'.join(map(str, sys.version_info[:3]))})"
        super().__init__(f"{what} needs OMPL 1.7.0, {where}" + (f"; without it: {instead}" if instead else ""))

    def __reduce__(self) -> tuple[Any, ...]:
        """Go through a pickle as what it was made of."""
        return type(self), (self.what, self.instead)


def _short(value: object, limit: int = 60) -> str:
    """Text of a value that fits into one line."""
    try:
        text = " ".join(repr(value).split())
    except Exception:  # whole numbers of more than 4,300 digits, and whatever else a caller may hand over
        text = f"a value of type {type(value).__name__}"
    return text if len(text) <= limit else text[: limit - 3] + "..."
