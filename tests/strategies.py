"""Hypothesis strategies: values of every wrong kind, and the inputs of this package with some of them in it."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn, SearchStrategy

from cbrrt_ompl.problem.robot import Limits

NUMBERS: SearchStrategy[Any] = st.one_of(
    st.floats(-10.0, 10.0),
    st.integers(-10, 10),
    st.floats(),
    st.sampled_from([0.0, -0.0, 1e-320, 1e-9, 1e-6, 1e6, 1e9, 1e308, -1e308, math.nan, math.inf, -math.inf]),
    st.sampled_from([10**30, -(10**400), 2**31, 2**63, True, False, Fraction(1, 3), Fraction(10**400), 1 + 2j]),
    st.sampled_from([np.float64(0.5), np.float32(0.5), np.float16(2.0), np.int8(1), np.uint64(2**63), np.bool_(True)]),
)
"""Numbers of every kind and size, good and bad."""

OTHERS: SearchStrategy[Any] = st.one_of(
    st.none(),
    st.sampled_from(["", "2", "nan", "free", "\0", "ü$x$", b"2", [], {}, (), set(), object, object(), Path("a"), len]),
    st.builds(np.zeros, st.sampled_from([(), (0,), (1,), (2,), (3, 2), (2, 2, 2)])),
    st.sampled_from([np.array("a"), np.array([None, 1]), np.array([1 + 2j, 0]), np.array([[math.nan, 0], [1, 1]])]),
)
"""Values that are no numbers."""

POINTS = st.one_of(
    st.tuples(st.floats(-10.0, 10.0), st.floats(-10.0, 10.0)),
    st.lists(NUMBERS, max_size=3),
    st.tuples(NUMBERS, NUMBERS),
    st.builds(np.array, st.lists(st.floats(), min_size=2, max_size=2)),
)
"""Positions, good and bad."""

RINGS = st.one_of(
    st.lists(st.tuples(st.floats(-10.0, 10.0), st.floats(-10.0, 10.0)), max_size=6),
    st.lists(POINTS, max_size=5),
    st.builds(np.array, st.lists(st.tuples(st.floats(), st.floats()), min_size=3, max_size=5)),
)
"""Lists of corners, good and bad."""

ANYTHING: SearchStrategy[Any] = st.one_of(NUMBERS, OTHERS, POINTS, RINGS, st.lists(NUMBERS | OTHERS, max_size=3))
"""What a caller may hand over by mistake."""

SIZES = st.floats(0.05, 5.0)
SHARES = st.floats(0.0, 1.0)

LIMITS: SearchStrategy[Limits] = st.builds(
    Limits,
    st.floats(-2.0, 0.0),
    SIZES,
    st.floats(-4.0, -0.05),
    SIZES,
    SIZES,
    SIZES,
    SIZES,
    SIZES | st.just(math.inf),
    SIZES | st.just(math.inf),
    SIZES | st.just(math.inf),
    SIZES | st.just(math.inf),
)
"""Limits of robots of all kinds."""

WHEELED: SearchStrategy[Limits] = LIMITS.filter(lambda limits: limits.has_wheel_limits)
"""Limits of robots whose wheels are limited."""


@st.composite
def arguments(draw: DrawFn, good: dict[str, Any]) -> dict[str, Any]:
    """Keyword arguments, of which one to three are anything.

    Args:
        draw: Hypothesis's.
        good: arguments that are accepted.
    """
    wrong = draw(st.lists(st.sampled_from(sorted(good)), min_size=1, max_size=3, unique=True))
    return {**good, **{name: draw(ANYTHING) for name in wrong}}


PLAIN: SearchStrategy[Any] = st.recursive(
    st.one_of(
        st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5), st.sampled_from(["disc", "box", 1e6])
    ),
    lambda children: st.lists(children, max_size=4) | st.dictionaries(st.text(max_size=5), children, max_size=3),
    max_leaves=8,
)
"""What a YAML or JSON file may hold."""


@st.composite
def changed(draw: DrawFn, data: Any) -> Any:
    """A plain value with one of its parts replaced, dropped or doubled."""
    if not isinstance(data, dict | list) or not data or draw(st.integers(0, 3)) == 0:
        return draw(PLAIN)
    keys = sorted(data) if isinstance(data, dict) else list(range(len(data)))
    key = draw(st.sampled_from(keys))
    copy = data.copy()
    match draw(st.sampled_from(["into", "into", "drop", "double"])):
        case "into":
            copy[key] = draw(changed(data[key]))
        case "drop":
            del copy[key]
        case _ if isinstance(copy, list):
            copy.append(copy[key])
        case _:
            copy[str(key) + draw(st.text(max_size=2))] = copy[key]
    return copy
