"""The numbers of an OMPL state as a NumPy array, at the price of one call.

Reading a state number by number costs a Boost.Python call for each (1.5 us a state, as much again to write).
``copyToReals`` moves all of them in one call of 0.1 us, but into a ``std::vector`` that Python can again read only
number by number. So the vector's own memory is looked up once, and viewed as an array.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.ompl_plugin.binding import ou


class StateReals:
    """The reals of one state at a time.

    Attributes:
        values: the numbers last read, or to be written, shape (dimension,). Never outlives its StateReals.
    """

    def __init__(self, space: Any, dimension: int) -> None:
        """Make room for a state.

        Args:
            space: the OMPL state space whose states are read and written.
            dimension: its number of reals.
        """
        self._vector = ou.vectorDouble()
        self._vector.extend([0.0] * dimension)
        self.values: NDArray[np.float64] = vector_memory(self._vector)
        self._copy_to_reals = space.copyToReals
        self._copy_from_reals = space.copyFromReals

    def read(self, state: Any) -> None:
        """Fill ``values`` from an OMPL state."""
        self._copy_to_reals(self._vector, state)

    def write(self, state: Any) -> None:
        """Set an OMPL state to ``values``."""
        self._copy_from_reals(state, self._vector)


def vector_memory(vector: Any) -> NDArray[np.float64]:
    """The memory of a ``std::vector<double>`` as an array; valid until the vector is resized or dies.

    A Boost.Python object ends with the pointer to its holder, and this holder, after two pointers of its own, with the
    vector: three pointers to the begin, the end and the end of the storage.

    Args:
        vector: an ``ompl.util.vectorDouble`` that is not empty.

    Returns:
        A view of its numbers, shape (n,).

    Raises:
        ImportError: if the layout is not that of the OMPL wheel that this package is made for.
    """
    pointer = ctypes.sizeof(ctypes.c_void_p)
    holder = ctypes.c_size_t.from_address(id(vector) + type(vector).__instance_size__ - pointer).value
    begin, end, storage_end = (ctypes.c_size_t * 3).from_address(holder + 2 * pointer)
    size = len(vector) * ctypes.sizeof(ctypes.c_double)
    if not (size > 0 and end - begin == size and storage_end >= end):
        raise ImportError("this build of OMPL lays out std::vector in another way than the wheel of ompl 1.7.0")
    return np.ctypeslib.as_array((ctypes.c_double * len(vector)).from_address(begin))
