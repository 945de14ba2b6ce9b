"""Compiled nearest neighbours in (x, y): a grid, a k-d tree and brute force.

All three index places: positions of nodes. Nodes at exactly the position of their parent or of a sibling (point turns)
share its place, so that neither structure degenerates; which of them is extended is drawn by lot (see
:mod:`cbrrt_ompl.planners.growth`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.kernels import inner_kernel, kernel
from cbrrt_ompl.motion.records import Records, put_records, record_array
from cbrrt_ompl.planners.bits import highest_bit, lowest_bit
from cbrrt_ompl.problem.obstacles import Bounds
from cbrrt_ompl.problem.settings import NEAREST_NEIGHBOUR

GRID, KD_TREE, BRUTE_FORCE = 0, 1, 2
"""Kinds of index."""

KINDS = dict(zip(NEAREST_NEIGHBOUR, (GRID, KD_TREE, BRUTE_FORCE), strict=True))
"""Their names in the settings."""

PLACE = np.dtype(
    [
        ("x", np.float64),  # [m]
        ("y", np.float64),
        ("left", np.int32),  # grid: next place of the cell; k-d tree: left child; -1 at the end
        ("right", np.int32),  # k-d tree: right child
        ("failures", np.int32),  # extensions from here that have failed
        ("steps", np.int32),  # of the way from the root to here
    ],
    align=True,
)
"""What an index knows of a node."""

INDEX_STATE = np.dtype([("places", np.int64), ("depth", np.int64)], align=True)
"""How many places are indexed, and how deep the k-d tree is."""

NOT_INDEXED = 2**31 - 1
"""Failures of a node that its place stands for, so that brute force finds no other nodes than the indexes."""

WORD = 64
"""Bits of a word; the columns of a grid come in words."""

PLACES_PER_CELL = 2
"""Nodes that a tree has room for, a cell of its grid."""


class Index(NamedTuple):
    """Positions that can be searched; a place has the number of its node."""

    kind: int
    """`GRID`, `KD_TREE` or `BRUTE_FORCE`."""
    places: Records
    """Records of type `PLACE`, one a node, shape (n,)."""
    state: Records
    """One record of type `INDEX_STATE`, shape (1,)."""
    heads: NDArray[np.int32]
    """Grid: first place of each cell, shape (rows, columns)."""
    words: NDArray[np.uint64]
    """Grid: a bit for each cell that holds a place, shape (rows, columns / WORD)."""
    row_words: NDArray[np.uint64]
    """Grid: a bit for each row that holds a place, shape (rows / WORD,)."""
    stack: NDArray[np.float64]
    """K-d tree: room for a search, rows of (place, axis, squared distance of its half plane), shape (m, 3)."""
    x_min: float
    """Lower left corner of the grid [m]."""
    y_min: float
    width: float
    """Sides of a cell [m]."""
    height: float
    columns_per_metre: float
    rows_per_metre: float


def make_index(kind: int, bounds: Bounds, capacity: int, depth: int = 0) -> Index:
    """An empty index.

    Args:
        kind: `GRID`, `KD_TREE` or `BRUTE_FORCE`.
        bounds: where most positions are.
        capacity: places that there is room for.
        depth: of a k-d tree that is to be entered.
    """
    cells = WORD
    while kind == GRID and cells * cells * PLACES_PER_CELL < capacity:
        cells *= 2
    rows = cells if kind == GRID else 0
    return Index(
        kind,
        record_array(capacity, PLACE),
        record_array(1, INDEX_STATE),
        np.empty((rows, cells), dtype=np.int32),
        np.zeros((rows, cells // WORD), dtype=np.uint64),
        np.zeros(rows // WORD, dtype=np.uint64),
        np.empty((2 * depth + WORD if kind == KD_TREE else 0, 3)),
        *bounds.min,
        bounds.size[0] / cells,
        bounds.size[1] / cells,
        cells / bounds.size[0],
        cells / bounds.size[1],
    )


def enlarged(index: Index, bounds: Bounds, nodes: int) -> Index:
    """The same index with twice the room, its grid finer.

    Args:
        index: what is full.
        bounds: see :func:`make_index`.
        nodes: how many of its places are in use.
    """
    larger = make_index(index.kind, bounds, 2 * len(index.places), int(index.state["depth"][0]))
    put_records(larger.places, index.places[:nodes])
    larger.state[:] = index.state
    if index.kind == GRID:
        _enter_again(larger, nodes)
    return larger


def with_room_for_a_search(index: Index) -> Index:
    """The same index with a stack as deep as its k-d tree asks for."""
    depth = int(index.state["depth"][0])
    return index._replace(stack=np.empty((2 * depth + WORD, 3))) if index.kind == KD_TREE else index


@kernel
def _enter_again(index: Index, nodes: int) -> None:
    """Enter all places into an empty grid."""
    for node in range(nodes):
        if index.places[node].failures != NOT_INDEXED:
            _insert_into_grid(index, node)


@kernel
def insert(index: Index, node: int, x: float, y: float) -> None:
    """Add a place."""
    place = index.places[node]
    place.x, place.y, place.left, place.right, place.failures, place.steps = x, y, -1, -1, 0, 0
    if index.kind == GRID:
        _insert_into_grid(index, node)
    elif index.kind == KD_TREE:
        _insert_into_kd_tree(index, node)
    index.state[0].places += 1


@kernel
def leave_out(index: Index, node: int) -> None:
    """Note that a node has no place of its own."""
    index.places[node].failures = NOT_INDEXED


@kernel(inline="always")
def _cell_of(index: Index, x: float, y: float) -> tuple[int, int]:
    """Row and column of a position; positions outside fall into the nearest cell."""
    rows, columns = index.heads.shape
    column = int(min(max((x - index.x_min) * index.columns_per_metre, 0.0), columns - 1.0))
    row = int(min(max((y - index.y_min) * index.rows_per_metre, 0.0), rows - 1.0))
    return row, column


@inner_kernel
def _insert_into_grid(index: Index, node: int) -> None:
    """Put a place in front of the others of its cell."""
    place = index.places[node]
    row, column = _cell_of(index, place.x, place.y)
    word, bit = column // WORD, np.uint64(1) << np.uint64(column % WORD)
    is_taken = index.words[row, word] & bit != 0
    place.left = index.heads[row, column] if is_taken else -1
    index.heads[row, column] = node
    index.words[row, word] |= bit
    index.row_words[row // WORD] |= np.uint64(1) << np.uint64(row % WORD)


@inner_kernel
def _insert_into_kd_tree(index: Index, node: int) -> None:
    """Hang a place under the leaf where it belongs; the first one ever is the root, number 0."""
    state, places = index.state[0], index.places
    if state.places == 0:
        return
    parent, depth, is_along_x = 0, 1, True
    while True:
        goes_left = places[node].x < places[parent].x if is_along_x else places[node].y < places[parent].y
        child = places[parent].left if goes_left else places[parent].right
        if child < 0:
            if goes_left:
                places[parent].left = node
            else:
                places[parent].right = node
            state.depth = max(state.depth, depth)
            return
        parent, depth, is_along_x = child, depth + 1, not is_along_x


@kernel
def nearest(index: Index, x: float, y: float, nodes: int, most_failures: float, most_steps: float) -> int:
    """The place nearest to a position.

    Args:
        index: the index; not empty.
        x: position [m].
        y: position [m].
        nodes: nodes in the tree, for brute force.
        most_failures: places with more failures than this are passed over.
        most_steps: places more steps away from the root than this are passed over.

    Returns:
        Its node, -1 where all are passed over.
    """
    if index.kind == GRID:
        return _nearest_in_grid(index, x, y, most_failures, most_steps)
    if index.kind == KD_TREE:
        return _nearest_in_kd_tree(index, x, y, most_failures, most_steps)
    best, node = math.inf, -1
    for i in range(nodes):
        place = index.places[i]
        dx, dy = place.x - x, place.y - y
        squared = dx * dx + dy * dy
        is_taken = place.failures <= most_failures and place.steps <= most_steps and place.failures != NOT_INDEXED
        if squared < best and is_taken:
            best, node = squared, i
    return node


@inner_kernel
def _nearest_in_grid(index: Index, x: float, y: float, most_failures: float, most_steps: float) -> int:
    """Search the rows of cells outwards, and in each row its occupied cells outwards, as far as they can be nearer."""
    row, column = _cell_of(index, x, y)
    rows = len(index.heads)
    best, node = math.inf, row - row - 1  # no literal, for which all would be compiled twice
    above, below = _next_row(index.row_words, row), _last_row(index.row_words, row - 1)
    while True:
        gap_above = (index.y_min + above * index.height - y if above > row else 0.0) if above < rows else math.inf
        gap_below = y - index.y_min - (below + 1) * index.height if below >= 0 else math.inf
        gap = min(gap_above, gap_below)
        if gap * gap >= best:
            return node
        if gap_above <= gap_below:
            here, above = above, _next_row(index.row_words, above + 1)
        else:
            here, below = below, _last_row(index.row_words, below - 1)
        best, node = _nearest_in_row(index, x, y, here, column, gap * gap, best, node, most_failures, most_steps)


@kernel(inline="always")
def _next_row(row_words: NDArray[np.uint64], row: int) -> int:
    """The first row from one on that holds a place, or the number of rows."""
    word = row // WORD
    bits = row_words[word] & (~np.uint64(0) << np.uint64(row % WORD)) if word < len(row_words) else np.uint64(0)
    while bits == 0 and word + 1 < len(row_words):
        word += 1
        bits = row_words[word]
    return word * WORD + lowest_bit(bits) if bits != 0 else len(row_words) * WORD


@kernel(inline="always")
def _last_row(row_words: NDArray[np.uint64], row: int) -> int:
    """The last row up to one that holds a place, or -1."""
    word = row // WORD  # -1 below the first row
    bits = row_words[word] & (~np.uint64(0) >> np.uint64(WORD - 1 - row % WORD)) if row >= 0 else np.uint64(0)
    while bits == 0 and word > 0:
        word -= 1
        bits = row_words[word]
    return word * WORD + highest_bit(bits) if bits != 0 else -1


@inner_kernel(forceinline=True)
def _nearest_in_row(
    index: Index,
    x: float,
    y: float,
    row: int,
    column: int,
    squared_gap: float,
    best: float,
    node: int,
    most_failures: float,
    most_steps: float,
) -> tuple[float, int]:
    """Search one row of the grid, from a column on to the right and then to the left.

    Args:
        index: the index.
        x: position [m].
        y: position [m].
        row: of the grid.
        column: of the position.
        squared_gap: squared distance of the position from the row [m^2].
        best: squared distance of the nearest place so far [m^2].
        node: the nearest place so far.
        most_failures: see :func:`nearest`.
        most_steps: see :func:`nearest`.

    Returns:
        Distance and number of the nearest place again.
    """
    words, all_bits = index.words[row], ~np.uint64(0)
    word, bit = column // WORD, np.uint64(column % WORD)
    cells = words[word] & (all_bits << bit)
    is_near = True
    while is_near and (cells != 0 or word + 1 < len(words)):
        if cells == 0:
            word += 1
            cells = words[word]
            continue
        c = word * WORD + lowest_bit(cells)
        gap = index.x_min + c * index.width - x if c > column else 0.0
        is_near = gap * gap + squared_gap < best
        if is_near:
            best, node = _nearest_in_cell(index, index.heads[row, c], x, y, best, node, most_failures, most_steps)
        cells &= cells - np.uint64(1)
    word = column // WORD
    cells = words[word] & ((np.uint64(1) << bit) - np.uint64(1))
    is_near = True
    while is_near and (cells != 0 or word > 0):
        if cells == 0:
            word -= 1
            cells = words[word]
            continue
        place = highest_bit(cells)
        c = word * WORD + place
        gap = x - index.x_min - (c + 1) * index.width
        is_near = gap * gap + squared_gap < best
        if is_near:
            best, node = _nearest_in_cell(index, index.heads[row, c], x, y, best, node, most_failures, most_steps)
        cells ^= np.uint64(1) << np.uint64(place)
    return best, node


@kernel(inline="always")
def _nearest_in_cell(
    index: Index, place: int, x: float, y: float, best: float, node: int, most_failures: float, most_steps: float
) -> tuple[float, int]:
    """Search the places of a cell from its first on; see :func:`_nearest_in_row`."""
    while place >= 0:
        here = index.places[place]
        dx, dy = here.x - x, here.y - y
        squared = dx * dx + dy * dy
        if squared < best and here.failures <= most_failures and here.steps <= most_steps:
            best, node = squared, place
        place = here.left
    return best, node


@inner_kernel
def _nearest_in_kd_tree(index: Index, x: float, y: float, most_failures: float, most_steps: float) -> int:
    """Search depth first, the nearer side first, leaving out what lies beyond the best so far."""
    places, stack = index.places, index.stack
    best, node = math.inf, -1
    stack[0, 0], stack[0, 1], stack[0, 2] = 0.0, 0.0, 0.0
    depth = 1
    while depth > 0:
        depth -= 1
        i, axis = int(stack[depth, 0]), int(stack[depth, 1])
        if stack[depth, 2] >= best:
            continue
        while i >= 0:
            place = places[i]
            dx, dy = place.x - x, place.y - y
            squared = dx * dx + dy * dy
            if squared < best and place.failures <= most_failures and place.steps <= most_steps:
                best, node = squared, i
            offset = dx if axis == 0 else dy
            near, far = (place.left, place.right) if offset > 0.0 else (place.right, place.left)
            if far >= 0 and offset * offset < best:
                stack[depth, 0], stack[depth, 1], stack[depth, 2] = far, 1 - axis, offset * offset
                depth += 1
            i, axis = near, 1 - axis
    return node
