"""Places of the lowest and the highest bit of a 64-bit word, in compiled code and in plain Python."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload


def lowest_bit(word: Any) -> int:
    """Place of the lowest bit that is set; the word must not be 0."""
    word = int(word)
    return (word & -word).bit_length() - 1


def highest_bit(word: Any) -> int:
    """Place of the highest bit that is set; the word must not be 0."""
    return int(word).bit_length() - 1


def _count_trailing_zeros(typing: Any, word: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 1))

    return word(word), generate


def _count_leading_zeros(typing: Any, word: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.ctlz(arguments[0], ir.Constant(ir.IntType(1), 1))

    return word(word), generate


_trailing_zeros: Any = intrinsic(_count_trailing_zeros)
_leading_zeros: Any = intrinsic(_count_leading_zeros)


@overload(lowest_bit, inline="always")
def _compiled_lowest_bit(word):  # type: ignore[no-untyped-def]  # numba compares signatures
    def place(word):  # type: ignore[no-untyped-def]
        return types.int64(_trailing_zeros(word))

    return place


@overload(highest_bit, inline="always")
def _compiled_highest_bit(word):  # type: ignore[no-untyped-def]
    def place(word):  # type: ignore[no-untyped-def]
        return 63 - types.int64(_leading_zeros(word))

    return place
