"""Lead OMPL's virtual calls of an object made in Python to compiled code instead of a look-up for an override.

A C++ object begins with the address of its class's vtable. Boost.Python's classes have one whose every method looks
for an override in Python, calls it or else libompl's method. An object whose class overrides nothing is given
libompl's own vtable; one whose class overrides a method is given a copy of its vtable, with compiled functions in the
slots of that method. The object's record, what the functions know of it, is found by the word before the copy.

The functions keep the C++ contract: the first argument is the object, and for all that is not the common case they
call the method that was in the slot before, which still calls Python.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.kernels import kernel
from cbrrt_ompl.ompl_plugin.native_layout import (
    BEFORE_SLOTS,
    WORD,
    LayoutError,
    object_address,
    slot_of,
    symbol_address,
    vtable_address,
    vtable_words,
    words_at,
)
from cbrrt_ompl.ompl_plugin.native_memory import peek


def call_libompl(python_object: Any, class_name: str, wrapper: str) -> None:
    """Let virtual calls of an object without overrides go straight to libompl.

    Args:
        python_object: an object made in Python.
        class_name: its C++ class, with a vtable that lives as long as the process.
        wrapper: the class that Boost.Python derives from it.

    Raises:
        LayoutError: if its vtable is not the wrapper's; it is left as it was.
    """
    _redirect(python_object, class_name, wrapper, vtable_address(class_name))


def call_compiled(
    python_object: Any,
    class_name: str,
    wrapper: str,
    methods: Mapping[str, int | None],
    record: NDArray[Any],
    base: str | None = None,
) -> None:
    """Let some virtual calls of an object go to compiled functions.

    The Python object keeps the copy of the vtable and the record as attributes: Boost.Python destroys the C++ object
    before the attributes, and C++ holds on to the Python object, so both live as long as anything calls them.

    Args:
        python_object: an object made in Python.
        class_name: its C++ class.
        wrapper: the class that Boost.Python derives from it.
        methods: for the symbol of each method to replace the address of its compiled function.
        record: NumPy record that the functions read, shape (1,), see :func:`record_address`.
        base: the class whose vtable is copied; the wrapper if None.

    Raises:
        LayoutError: if its vtable is not the wrapper's, or lacks a method; it is left as it was.
    """
    original = vtable_words(base or wrapper)
    copy = np.empty(1 + len(original), dtype=np.uint64)
    copy[0], copy[1:] = record.ctypes.data, original
    for symbol, function in methods.items():
        assert function is not None  # numba's types allow it
        copy[1 + slot_of(original, symbol_address(symbol))] = function
    _redirect(python_object, class_name, wrapper, copy.ctypes.data + (1 + BEFORE_SLOTS) * WORD)
    python_object._vtable, python_object._record = copy, record


def _redirect(python_object: Any, class_name: str, wrapper: str, vtable: int) -> None:
    """Set the first word of the C++ object, if it is the wrapper's."""
    first = words_at(object_address(python_object, class_name), 1)
    if int(first[0]) != vtable_address(wrapper):
        raise LayoutError(f"a {type(python_object).__name__} has another vtable than {wrapper}")
    first[0] = vtable


def virtual_method(python_object: Any, class_name: str, wrapper: str, method: str) -> int:
    """Address of what C++ calls when it calls a method of an object.

    Args:
        python_object: an object made in Python.
        class_name: its C++ class.
        wrapper: the class that Boost.Python derives from it.
        method: symbol of the wrapper's method.
    """
    slot = slot_of(vtable_words(wrapper), symbol_address(method)) - BEFORE_SLOTS
    vtable = int(words_at(object_address(python_object, class_name), 1)[0])
    return int(words_at(vtable, slot + 1)[slot])


@kernel(forceinline=True)
def record_address(this: int) -> int:
    """Address of an object's record, for the compiled functions of :func:`call_compiled`."""
    return peek(peek(this) - (1 + BEFORE_SLOTS) * WORD)
