"""Where C++ keeps things: addresses of OMPL's symbols, of the object behind a Python object, and of its vtable.

All of it is found by name in the libraries that OMPL's modules link; nothing here is a number of one build. What is not
where it should be raises `LayoutError`, and nobody writes to memory then.
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.ompl_plugin.binding import ob, oc

WORD = ctypes.sizeof(ctypes.c_size_t)
"""Bytes of a pointer."""

BEFORE_SLOTS = 2
"""Words of a vtable before its first slot: the offset to the whole object, and the type information."""

_FIND_INSTANCE = "_ZN5boost6python7objects18find_instance_implEP7_objectNS0_9type_infoEb"


class LayoutError(Exception):
    """This build of OMPL is not laid out as the compiled methods need it."""


@cache
def _libraries() -> tuple[ctypes.CDLL, ...]:
    """OMPL's modules; a look-up in them also finds what they link: libompl and Boost.Python."""
    return ctypes.CDLL(ob._base.__file__), ctypes.CDLL(oc._control.__file__)


@cache
def symbol_address(name: str) -> int:
    """Address of an exported symbol.

    Raises:
        LayoutError: if there is none of this name.
    """
    for library in _libraries():
        try:
            return ctypes.addressof(ctypes.c_char.in_dll(library, name))
        except ValueError:
            pass
    raise LayoutError(f"no symbol {name}")


def mangled(name: str) -> str:
    """Name of a C++ class, such as ``ompl::base::State``, as symbols contain it."""
    parts = name.split("::")
    encoded = "".join(f"{len(part)}{part}" for part in parts)
    return encoded if len(parts) == 1 else f"N{encoded}E"


@cache
def _find_instance() -> Any:
    """Boost.Python's own look-up of the C++ object in a Python object."""
    function = getattr(_libraries()[0], _FIND_INSTANCE, None)
    if function is None:
        raise LayoutError("Boost.Python does not export find_instance_impl")
    function.restype = ctypes.c_size_t
    function.argtypes = [ctypes.py_object, ctypes.c_char_p, ctypes.c_bool]
    return function


def object_address(python_object: Any, class_name: str) -> int:
    """Address of the C++ object in a Python object.

    Args:
        python_object: an object of a class of OMPL's, or of a Python class derived from one.
        class_name: C++ class as which it is wanted, such as ``ompl::base::State``.

    Raises:
        LayoutError: if there is no such object in it.
    """
    address: int = _find_instance()(python_object, mangled(class_name).encode(), False)
    if not address:
        raise LayoutError(f"no {class_name} in a {type(python_object).__name__}")
    return address


def vtable_address(class_name: str) -> int:
    """Address of the first slot of a class's vtable: what an object of the class begins with."""
    return symbol_address(f"_ZTV{mangled(class_name)}") + BEFORE_SLOTS * WORD


class _SymbolInfo(ctypes.Structure):
    """``Dl_info`` of <dlfcn.h>."""

    _fields_ = (
        ("file", ctypes.c_char_p),
        ("base", ctypes.c_void_p),
        ("name", ctypes.c_char_p),
        ("address", ctypes.c_void_p),
    )


_SYMBOL_ENTRY = 1
"""``RTLD_DL_SYMENT`` of <dlfcn.h>: ask for the ELF symbol, whose size is its third word."""


@cache
def vtable_words(class_name: str) -> NDArray[np.uint64]:
    """A class's vtable with the `BEFORE_SLOTS` words before its slots, as long as its symbol says: a view, not to be
    written.

    Raises:
        LayoutError: if the class has no exported vtable, or the system does not tell the sizes of symbols.
    """  # noqa: D205
    dladdr1 = getattr(ctypes.CDLL(None), "dladdr1", None)
    start = symbol_address(f"_ZTV{mangled(class_name)}")
    info, entry = _SymbolInfo(), ctypes.c_void_p()
    if dladdr1 is None or not dladdr1(ctypes.c_void_p(start), ctypes.byref(info), ctypes.byref(entry), _SYMBOL_ENTRY):
        raise LayoutError(f"the size of the vtable of {class_name} is not known")
    if info.address != start or entry.value is None:
        raise LayoutError(f"another symbol covers the vtable of {class_name}")
    size = ctypes.c_uint64.from_address(entry.value + 2 * WORD).value
    if not BEFORE_SLOTS * WORD < size < 1000 * WORD or size % WORD:
        raise LayoutError(f"the vtable of {class_name} has {size} bytes")
    return words_at(start, size // WORD)


def words_at(address: int, count: int) -> NDArray[np.uint64]:
    """A view of some words of memory, shape (count,)."""
    return np.ctypeslib.as_array((ctypes.c_uint64 * count).from_address(address))


def slot_of(words: NDArray[np.uint64], method: int) -> int:
    """Index of the one word of a vtable that holds a method's address.

    Raises:
        LayoutError: if none does, or several do.
    """
    found = np.flatnonzero(words[BEFORE_SLOTS:] == np.uint64(method))
    if len(found) != 1:
        raise LayoutError(f"{len(found)} slots of a vtable hold the method instead of one")
    return BEFORE_SLOTS + int(found[0])
