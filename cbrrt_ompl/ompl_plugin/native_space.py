"""The state space, goals, projections and objectives without look-ups, and the space's distance in compiled code."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import carray, types
from numpy.typing import NDArray

from cbrrt_ompl.kernels import callback
from cbrrt_ompl.ompl_plugin.native_layout import (
    WORD,
    LayoutError,
    object_address,
    symbol_address,
    words_at,
)
from cbrrt_ompl.ompl_plugin.native_memory import call_distance, peek_real, pointer, position_at
from cbrrt_ompl.ompl_plugin.virtual_calls import call_compiled, call_libompl, record_address

SPACE = "ompl::base::CompoundStateSpace"
REAL_VECTOR_SPACE = "ompl::base::RealVectorStateSpace"
SPACE_WRAPPER = "CompoundStateSpace_wrapper"
DISTANCE = "_ZNK4ompl4base18CompoundStateSpace8distanceEPKNS0_5StateES4_"

NATIVE_CLASSES = {
    "GoalState": "ompl::base::GoalState",
    "GoalStates": "ompl::base::GoalStates",
    "PathLengthOptimizationObjective": "ompl::base::PathLengthOptimizationObjective",
    "RealVectorControlSpace": "ompl::control::RealVectorControlSpace",
    "SubspaceProjectionEvaluator": "ompl::base::SubspaceProjectionEvaluator",
}
"""Classes whose objects made in Python may use libompl's vtable: the name in Python and in C++."""


def make_native(python_object: Any) -> Any:
    """Let virtual calls of an object of one of the `NATIVE_CLASSES` go straight to libompl.

    Objects of derived classes stay as they are.

    Args:
        python_object: the object, made in Python.

    Returns:
        The object itself.

    Raises:
        LayoutError: if it is not laid out as expected.
    """
    name = type(python_object).__name__
    if type(python_object).__module__.startswith("ompl.") and name in NATIVE_CLASSES:
        call_libompl(python_object, NATIVE_CLASSES[name], f"{name}_wrapper")
    return python_object


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
    """Address of the weights of a locked compound space of ours: they never move.

    Raises:
        LayoutError: if there is none, or more than one.
    """
    expected = [space.getSubspaceWeight(i) for i in range(space.getSubspaceCount())]
    words = words_at(object_address(space, SPACE), _SPACE_WORDS)
    found = [begin for _, begin in _vectors(words, len(expected)) if _reals(begin, len(expected)) == expected]
    if len(found) != 1:
        raise LayoutError(f"{len(found)} vectors hold the weights of a compound space instead of one")
    return found[0]


def bounds_address(space: Any, component: int) -> int:
    """Address of the bounds of an R^2 in a space of ours: the vector of the lows, and after it that of the highs.

    Raises:
        LayoutError: if there are none, or several.
    """
    subspace = space.getSubspace(component)
    bounds = subspace.getBounds()
    address = object_address(subspace, REAL_VECTOR_SPACE)
    vectors = dict(_vectors(words_at(address, _SPACE_WORDS), 2))
    found = [
        offset
        for offset, begin in vectors.items()
        if offset + 3 in vectors
        and _reals(begin, 2) == list(bounds.low)
        and _reals(vectors[offset + 3], 2) == list(bounds.high)
    ]
    if len(found) != 1:
        raise LayoutError(f"{len(found)} pairs of vectors hold the bounds of an R^2 instead of one")
    return address + found[0] * WORD


def reals_of_bounds(address: int) -> list[list[float]]:
    """The lows and the highs of an R^2 at an address of :func:`bounds_address`."""
    words = words_at(address, 4).tolist()
    return [_reals(words[0], 2), _reals(words[3], 2)]


_SPACE_WORDS = 48
"""Words of a state space that are searched: all of ``StateSpace``, and two vectors more."""


def _vectors(words: NDArray[np.uint64], length: int) -> list[tuple[int, int]]:
    """What may be a ``std::vector<double>`` of a length: index of its first word, and address of its numbers.

    A vector is three addresses: begin, end, and end of the storage.
    """
    numbers = words.tolist()
    return [
        (i, begin)
        for i, (begin, end, storage_end) in enumerate(zip(numbers, numbers[1:], numbers[2:], strict=False))
        if begin and begin % WORD == 0 and end - begin == length * WORD and end <= storage_end <= end + 64 * WORD
    ]


def _reals(address: int, count: int) -> list[float]:
    numbers: list[float] = words_at(address, count).view(np.float64).tolist()
    return numbers


@callback(types.float64(types.int64, types.int64, types.int64))
def distance(this: int, first: int, second: int) -> float:
    """``CompoundStateSpace::distance``: of the positions alone where the weights are 1, 0, 0, else libompl's."""
    record = carray(pointer(record_address(this)), 1, SPACE_RECORD)[0]
    weights = record.weights
    if not (peek_real(weights) == 1.0 and peek_real(weights + 8) == 0.0 and peek_real(weights + 16) == 0.0):
        return call_distance(record.distance, this, first, second)
    x, y = position_at(first)
    x_other, y_other = position_at(second)
    dx, dy = x - x_other, y - y_other
    return math.sqrt(dx * dx + dy * dy)
