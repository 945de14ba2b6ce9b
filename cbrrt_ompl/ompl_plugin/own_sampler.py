"""Planners of OMPL's that extend by a directed sampler of their own, whatever others on their space information do.

A space information has one directed sampler for all of its planners, and who asks for it cannot be told. So a planner
with its own one puts it there for as long as it sets itself up or solves, and takes it away again.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

from cbrrt_ompl.errors import Problem, Remark, SettingsError
from cbrrt_ompl.ompl_plugin.binding import oc

DEFAULT_SAMPLERS = ("SimpleDirectedControlSampler", "SteeredControlSampler")
"""What a space information allocates if nothing else is set: random controls, or a propagator that can steer."""

WITH_DIRECTED_SAMPLER = (oc.RRT, oc.EST, oc.PDST, oc.SyclopRRT)
"""Planners of OMPL's that ask for a directed sampler; the others draw controls and durations by themselves."""


def with_directed_sampler(planner: type, si: Any, allocate: Callable[[Any], Any], *arguments: Any) -> Any:
    """A planner of OMPL's with a directed sampler of its own.

    Other planners on the same space information, in one ``ompl.tools.Benchmark`` for example, keep OMPL's::

        est = with_directed_sampler(oc.EST, si, lambda si: KanayamaDirectedControlSampler(si, robot, world))

    Args:
        planner: a class of OMPL's, such as ``oc.RRT`` or ``oc.EST``.
        si: the space information.
        allocate: makes the sampler, given the space information.
        arguments: further arguments of the class.

    Returns:
        An object of a class derived from ``planner``.

    Raises:
        SettingsError: if planners of this class never ask for a directed sampler.
    """
    if not issubclass(planner, WITH_DIRECTED_SAMPLER):
        known = ", ".join(f"ompl.control.{one.__name__}" for one in WITH_DIRECTED_SAMPLER)
        expected = f"one that extends by a directed sampler: {known}"
        raise SettingsError(Problem("planner", Remark(planner.__name__), expected))
    made = _class_with_sampler(planner)(si, *arguments)
    made._allocate_by = allocate
    return made


class OwnSampler:
    """To be derived from together with a planner class of OMPL's, before it.

    Attributes:
        sampler: the one allocated last; None before the first.
        looks_around: whether a directed sampler that a user has put into the space information is looked for. That
            takes one of the seeds that OMPL deals out.
    """

    sampler: Any = None
    looks_around = True
    _prepared: Any = None
    _allocate_by: Callable[[Any], Any] | None = None
    _is_in_place = False  # OMPL's solve with a time calls the solve with a condition

    def allocate(self, si: Any) -> Any:
        """Make the sampler of a tree."""
        assert self._allocate_by is not None
        return self._allocate_by(si)

    def setup(self) -> None:
        """Set the planner up; Syclop planners allocate their sampler here."""
        with self._own_sampler():
            super().setup()  # type: ignore[misc]  # OMPL's

    def prepare(self) -> None:
        """Make the sampler of the next tree, which ``solve`` would take the time for."""
        if self.sampler is None and self._prepared is None:
            self._prepared = self.allocate(self.getSpaceInformation())  # type: ignore[attr-defined]  # OMPL's

    def solve(self, *condition: Any) -> Any:
        """Solve; the other planners allocate their sampler here, the first time after ``clear``."""
        self.tell(self.sampler or self._prepared)
        with self._own_sampler():
            return super().solve(*condition)  # type: ignore[misc]  # OMPL's

    def tell(self, sampler: Any) -> None:
        """Have a sampler look at the parts that are there now, if it is one of ours: they go by what they have seen."""
        look_again = getattr(sampler, "look_again", None)
        if look_again is not None:
            look_again()

    def clear(self) -> None:
        """Forget tree and sampler."""
        super().clear()  # type: ignore[misc]  # OMPL's
        self.sampler = self._prepared = None

    def clearQuery(self) -> None:  # noqa: N802  # OMPL's name
        """Forget tree and sampler: what OMPL's method says that it does, which calls itself without end instead."""
        self.clear()

    @contextmanager
    def _own_sampler(self) -> Iterator[None]:
        """Have the space information allocate this planner's sampler."""
        si = self.getSpaceInformation()  # type: ignore[attr-defined]  # OMPL's
        if self._is_in_place or self._is_overruled(si):
            yield
            return
        was_set_up = si.isSetup()
        si.setDirectedControlSamplerAllocator(oc.DirectedControlSamplerAllocator(self._allocate))
        self._is_in_place = True
        try:
            yield
        finally:
            self._is_in_place = False
            si.clearDirectedSamplerAllocator()
            if was_set_up:
                si.setup()

    def _allocate(self, si: Any) -> Any:
        made, self._prepared = self._prepared or self.allocate(si), None
        if not isinstance(made, oc.DirectedControlSampler):  # OMPL would crash on None
            raise SettingsError(Problem("directed sampler", made, "an ompl.control.DirectedControlSampler"))
        self.sampler = made
        return made

    def _is_overruled(self, si: Any) -> bool:
        """Whether a user has put another directed sampler into the space information: that one is obeyed."""
        if not self.looks_around or self.sampler is not None:
            return False
        found = type(si.allocDirectedControlSampler()).__name__
        if found in DEFAULT_SAMPLERS:
            return False
        warnings.warn(
            f"{self.getName()} extends by {found}, which the space information has for all of its planners, "  # type: ignore[attr-defined]
            "instead of its own directed sampler; si.clearDirectedSamplerAllocator() takes it away, and "
            "with_directed_sampler() gives it to one planner alone",
            stacklevel=6,
        )
        return True


@cache
def _class_with_sampler(planner: type) -> type:
    return type(f"{planner.__name__}WithSampler", (OwnSampler, planner), {})
