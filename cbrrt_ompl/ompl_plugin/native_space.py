"""The state space, goals, projections and objectives without look-ups, and the space's distance in compiled code."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import carray, cfunc, types
from numpy.typing import NDArray

from cbrrt_ompl.ompl_plugin.native_layout import (
    WORD,
    LayoutError,
    object_address,
    symbol_address,
    words_at,
)
from cbrrt_ompl.ompl_plugin.native_memory import call_distance, peek_real, pointer, read_position
from cbrrt_ompl.ompl_plugin.virtual_calls import call_compiled, record_address

SPACE = "ompl::base::CompoundStateSpace"
SPACE_WRAPPER = "CompoundStateSpace_wrapper"
DISTANCE = "_ZNK4ompl4base18CompoundStateSpace8distanceEPKNS0_5StateES4_"

NATIVE_CLASSES = {
    "CompoundStateSpace": SPACE,
    "GoalState": "ompl::base::GoalState",
    "GoalStates": "ompl::base::GoalStates",
    "PathLengthOptimizationObjective": "ompl::base::PathLengthOptimizationObjective",
    "RealVectorControlSpace": "ompl::control::RealVectorControlSpace",
    "SubspaceProjectionEvaluator": "ompl::base::SubspaceProjectionEvaluator",
}
"""Classes whose objects made in Python may use libompl's vtable: the name in Python and in C++."""

SPACE_RECORD = np.dtype([("weights", np.int64), ("distance", np.int64)])
"""What the compiled distance knows: the address of the three weights, and libompl's distance for other weights."""


def make_space_native(space: Any) -> None:
    """Give a space of :func:`cbrrt_ompl.ompl_plugin.space.make_state_space` libompl's methods and a compiled distance.

    Raises:
        LayoutError: if it is not laid out as expected.
    """
    record = np.zeros(1, SPACE_RECORD)
    record["weights"] = weights_address(space)
    record["distance"] = symbol_address(DISTANCE)
    call_compiled(space, SPACE, SPACE_WRAPPER, {DISTANCE: distance.address}, record, base=SPACE)


def weights_address(space: Any) -> int:
    """Address of the weights of a locked compound space of three components: they never move.

    The object is searched for a ``std::vector<double>`` (begin, end, end of storage) that holds them.

    Raises:
        LayoutError: if there is none, or more than one.
    """
    expected = [space.getSubspaceWeight(i) for i in range(space.getSubspaceCount())]
    size = len(expected) * WORD
    words = words_at(object_address(space, SPACE), _SPACE_WORDS).tolist()
    found = [
        begin
        for begin, end, storage_end in zip(words, words[1:], words[2:], strict=False)
        if begin and begin % WORD == 0 and end - begin == size and end <= storage_end <= end + 64 * WORD
    ]
    found = [begin for begin in found if _reals_at(begin, len(expected)).tolist() == expected]
    if len(found) != 1:
        raise LayoutError(f"{len(found)} vectors hold the weights of a compound space instead of one")
    return int(found[0])


_SPACE_WORDS = 48
"""Words of a ``CompoundStateSpace`` that are searched; its wrapper is larger."""


def _reals_at(address: int, count: int) -> NDArray[np.float64]:
    return words_at(address, count).view(np.float64)


@cfunc(types.float64(types.int64, types.int64, types.int64), cache=True)
def distance(this: int, first: int, second: int) -> float:
    """``CompoundStateSpace::distance``: of the positions alone where the weights are 1, 0, 0, else libompl's."""
    record = carray(pointer(record_address(this)), 1, SPACE_RECORD)[0]
    weights = record.weights
    if not (peek_real(weights) == 1.0 and peek_real(weights + 8) == 0.0 and peek_real(weights + 16) == 0.0):
        return call_distance(record.distance, this, first, second)
    x, y = read_position(first)
    x_other, y_other = read_position(second)
    dx, dy = x - x_other, y - y_other
    return math.sqrt(dx * dx + dy * dy)
