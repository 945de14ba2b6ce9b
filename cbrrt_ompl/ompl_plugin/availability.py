"""Whether there is an OMPL to plan with; nothing here imports it."""

from __future__ import annotations

from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from typing import NoReturn

from cbrrt_ompl.errors import OmplMissingError


def has_ompl() -> bool:
    """Whether an OMPL that this package knows is installed: 2.0 has other classes in Python."""
    return find_spec("ompl") is not None and _is_first_generation()


@cache
def _is_first_generation() -> bool:
    """Whether the installed OMPL is 1.x; this takes a millisecond to find out."""
    try:
        return version("ompl").startswith("1.")
    except PackageNotFoundError:  # built from source
        return True


def check_ompl(what: str, instead: str = "") -> None:
    """Refuse what needs OMPL where there is none.

    Args:
        what: what needs it.
        instead: what does not need it.

    Raises:
        OmplMissingError: if there is no OMPL.
    """
    if not has_ompl():
        raise OmplMissingError(what, instead)


class Absent:
    """Stands for a name that needs OMPL where there is none: imported without complaint, refused when used."""

    def __init__(self, name: str) -> None:
        """Stand for a name."""
        self.name = name

    def __repr__(self) -> str:
        """What it is, and why it is not there."""
        return f"<{OmplMissingError(self.name)}>"

    def __call__(self, *_: object, **__: object) -> NoReturn:
        """Say that OMPL is missing."""
        raise OmplMissingError(self.name)

    def __mro_entries__(self, _: object) -> NoReturn:
        """Say so to a class that derives from it."""
        raise OmplMissingError(self.name)
