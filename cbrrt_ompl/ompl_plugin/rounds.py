"""A termination condition for OMPL: rounds of a main loop, counted by compiled code that asks Python now and then.

A condition in Python costs two microseconds a round, as much as the round itself. The condition that OMPL is given is
such a one; as long as it is in use, its ``std::function`` calls a compiled function instead, which calls the Python one
where a look at the clock is due.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numba import carray, types

from cbrrt_ompl.kernels import callback
from cbrrt_ompl.motion.records import record_array
from cbrrt_ompl.ompl_plugin.binding import ob
from cbrrt_ompl.ompl_plugin.compiled_methods import use_compiled_methods
from cbrrt_ompl.ompl_plugin.native_layout import WORD, LayoutError, object_address, words_at
from cbrrt_ompl.ompl_plugin.native_memory import call_condition, peek, pointer

CONDITION = "ompl::base::PlannerTerminationCondition"

PAUSE = 0.001
"""Aim for the time between two looks [s]."""

PERIOD = -1.0
"""What OMPL holds of a condition that has no period, behind its function [s]."""

FUNCTION_WORDS, INVOKER = 4, 3
"""Words of a ``std::function``: two for what it holds, and the addresses of what manages and what calls that."""

ROUNDS = np.dtype(
    [
        ("function", np.int64, (FUNCTION_WORDS,)),  # the one that calls Python
        ("count", np.int64),  # rounds so far
        ("limit", np.int64),  # rounds to end after
        ("look_at", np.int64),  # round before which Python is asked
    ]
)
"""What the compiled function knows."""


@callback(types.uint8(types.int64))
def has_ended(held: int) -> int:
    """Whether rounds or time are over; the argument is the address of the address of a record of type `ROUNDS`."""
    rounds = carray(pointer(peek(held)), 1, ROUNDS)[0]
    if rounds.count >= rounds.limit:
        return 1
    if rounds.count >= rounds.look_at and call_condition(rounds.function[INVOKER], peek(held)):
        return 1
    rounds.count += 1
    return 0


class Rounds:
    """Counts the rounds of a planner's main loop, and ends it."""

    def __init__(self, limit: int, should_stop: Callable[[int], bool]) -> None:
        """Begin to count.

        Args:
            limit: rounds to end after.
            should_stop: asked about every millisecond, with the rounds so far, whether to end now.
        """
        self._record = record_array(1, ROUNDS)
        self._record["limit"] = limit
        self._should_stop, self._portion = should_stop, 1
        self._looked_at = time.perf_counter()

    @property
    def count(self) -> int:
        """Rounds so far."""
        return int(self._record["count"][0])

    @contextmanager
    def condition(self) -> Iterator[Any]:
        """OMPL's condition for one ``solve``."""
        if not use_compiled_methods():
            yield ob.PlannerTerminationCondition(ob.PlannerTerminationConditionFn(self._counted))
            return
        condition = ob.PlannerTerminationCondition(ob.PlannerTerminationConditionFn(self._look))
        function = function_words(condition)
        own = function.copy()
        self._record["function"] = own
        function[0], function[INVOKER] = self._record.ctypes.data, has_ended.address
        try:
            yield condition
        finally:
            function[:] = own

    def _counted(self) -> bool:
        """A round without compiled code."""
        if self.count >= self._record["limit"][0] or self._should_stop(self.count):
            return True
        self._record["count"] += 1
        return False

    def _look(self) -> bool:
        """Whether to stop, and if not, when to look again."""
        if self._should_stop(self.count):
            return True
        now = time.perf_counter()
        elapsed, self._looked_at = max(now - self._looked_at, 1e-6), now
        self._portion = int(min(max(1.0, self._portion * PAUSE / elapsed), 4.0 * self._portion))
        self._record["look_at"] = self.count + self._portion
        return False


def function_words(condition: Any) -> Any:
    """The words of the ``std::function`` of a condition without a period: a view, shape (FUNCTION_WORDS,).

    Raises:
        LayoutError: if what follows is not the period that OMPL gives such a condition.
    """
    held = int(words_at(object_address(condition, CONDITION), 1)[0])
    words = words_at(held, FUNCTION_WORDS + 1)
    period = float(words[FUNCTION_WORDS:].view(np.float64)[0])
    if not (held % WORD == 0 and math.isclose(period, PERIOD) and words[INVOKER] != 0):
        raise LayoutError("a termination condition is laid out in another way")
    return words[:FUNCTION_WORDS]
