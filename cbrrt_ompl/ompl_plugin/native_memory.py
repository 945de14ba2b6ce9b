"""Compiled access to the memory of C++ objects: words, numbers, records, and the states and controls of OMPL.

A state of :func:`cbrrt_ompl.ompl_plugin.space.make_state_space` is a ``CompoundState``, whose second word points to the
pointers to its three components: (x, y), theta, (v, omega). Each of these has its values after the word of its vtable,
SO(2) itself, R^2 behind a pointer. A control of R^n is laid out like a state of R^n. All classes here have a vtable (of
one word), which is why everything begins at `VALUES`. :mod:`self_check` proves it before the first use.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from cbrrt_ompl.kernels import inner_kernel, kernel

VALUES = 8
"""Offset of the members after the word of the vtable [bytes]."""

_intrinsic: Any = intrinsic  # its types take no account of the typing context that it hands over

_ADDRESS, _REAL = ir.IntType(64), ir.DoubleType()


@_intrinsic
def peek(_: Any, address: Any) -> Any:
    """The word at an address."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.load(builder.inttoptr(args[0], _ADDRESS.as_pointer()))

    return types.int64(types.int64), generate


@_intrinsic
def peek_real(_: Any, address: Any) -> Any:
    """The double at an address."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.load(builder.inttoptr(args[0], _REAL.as_pointer()))

    return types.float64(types.int64), generate


@_intrinsic
def poke_real(_: Any, address: Any, value: Any) -> Any:
    """Write a double to an address."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        builder.store(args[1], builder.inttoptr(args[0], _REAL.as_pointer()))
        return context.get_dummy_value()

    return types.void(types.int64, types.float64), generate


@_intrinsic
def pointer(_: Any, address: Any) -> Any:
    """An address as the pointer that ``numba.carray`` takes."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], ir.IntType(8).as_pointer())

    return types.voidptr(types.int64), generate


@_intrinsic
def bits_of(_: Any, value: Any) -> Any:
    """The 64 bits of a double."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], _ADDRESS)

    return types.int64(types.float64), generate


def _call_of(result: ir.Type, count: int) -> Any:
    """Code that calls the C++ method whose address is the first argument with the other ones, so many addresses."""
    kind = ir.FunctionType(result, [_ADDRESS] * count)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.call(builder.inttoptr(args[0], kind.as_pointer()), args[1:])

    return generate


@_intrinsic
def call_is_valid(_: Any, method: Any, this: Any, state: Any) -> Any:
    """Call a ``bool (const State *) const`` at an address."""
    return types.uint8(types.int64, types.int64, types.int64), _call_of(ir.IntType(8), 2)


@_intrinsic
def call_condition(_: Any, invoker: Any, held: Any) -> Any:
    """Call what calls a ``std::function<bool()>`` that is held at an address."""
    return types.uint8(types.int64, types.int64), _call_of(ir.IntType(8), 1)


@_intrinsic
def call_distance(_: Any, method: Any, this: Any, state: Any, other: Any) -> Any:
    """Call a ``double (const State *, const State *) const`` at an address."""
    return types.float64(*[types.int64] * 4), _call_of(_REAL, 3)


@_intrinsic
def call_sample_to(_: Any, method: Any, this: Any, control: Any, source: Any, dest: Any) -> Any:
    """Call an ``unsigned int (Control *, const State *, State *)`` at an address."""
    return types.uint32(*[types.int64] * 5), _call_of(ir.IntType(32), 4)


@_intrinsic
def call_propagate(_: Any, method: Any, this: Any, state: Any, control: Any, duration: Any, result: Any) -> Any:
    """Call a ``void (const State *, const Control *, double, State *) const`` at an address."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind = ir.FunctionType(ir.VoidType(), [_ADDRESS, _ADDRESS, _ADDRESS, _REAL, _ADDRESS])
        builder.call(builder.inttoptr(args[0], kind.as_pointer()), args[1:])
        return context.get_dummy_value()

    return types.void(*[types.int64] * 4, types.float64, types.int64), generate


@kernel(forceinline=True)
def state_at(state: int) -> tuple[float, float, float, float, float]:
    """(x, y, theta, v, omega) of the state at an address."""
    components = peek(state + VALUES)
    position = peek(peek(components) + VALUES)
    velocity = peek(peek(components + 16) + VALUES)
    return (
        peek_real(position),
        peek_real(position + 8),
        peek_real(peek(components + 8) + VALUES),
        peek_real(velocity),
        peek_real(velocity + 8),
    )


@kernel(forceinline=True)
def position_at(state: int) -> tuple[float, float]:
    """(x, y) of the state at an address."""
    position = peek(peek(peek(state + VALUES)) + VALUES)
    return peek_real(position), peek_real(position + 8)


@kernel(forceinline=True)
def set_state_at(state: int, x: float, y: float, theta: float, v: float, omega: float) -> None:
    """Set the state at an address."""
    components = peek(state + VALUES)
    position = peek(peek(components) + VALUES)
    velocity = peek(peek(components + 16) + VALUES)
    poke_real(position, x)
    poke_real(position + 8, y)
    poke_real(peek(components + 8) + VALUES, theta)
    poke_real(velocity, v)
    poke_real(velocity + 8, omega)


@kernel(forceinline=True)
def control_at(control: int, dimension: int) -> tuple[float, float, float]:
    """The numbers of the control of R^2 or R^3 at an address; the third is 0 where there is none."""
    values = peek(control + VALUES)
    return peek_real(values), peek_real(values + 8), peek_real(values + 16) if dimension == 3 else 0.0


@inner_kernel(forceinline=True)
def set_control_at(control: int, values: tuple[float, float, float], dimension: int) -> None:
    """Set the control of R^2 or R^3 at an address."""
    numbers = peek(control + VALUES)
    poke_real(numbers, values[0])
    poke_real(numbers + 8, values[1])
    if dimension == 3:
        poke_real(numbers + 16, values[2])
