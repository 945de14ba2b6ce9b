"""Signed distance field of a world: exact at the nodes of a grid, bicubic with a continuous gradient between them.

The field guides an optimisation and proves nothing: what the solver returns is checked by the planners' own motion
check.
"""

from __future__ import annotations

import math
import threading
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.distances import point_piece
from cbrrt_ompl.collision.pieces import DISC
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.kernels import inner_kernel, kernel
from cbrrt_ompl.motion.records import Record, Records, record_array

LARGEST_SPACING, SMALLEST_SPACING = 0.05, 0.01
"""Range of the distance between two nodes [m], as far as `MAX_NODES` allows."""

MAX_NODES = 4_400_000
"""Nodes of a field at most: 18 MB."""

BORDER = 6
"""Rows and columns of nodes beyond the bounds."""

TILES = (128, 16, 4)
"""Sides of the square tiles of nodes in which the nearest pieces are shortlisted, one in the other."""


GRID = np.dtype(
    [
        ("x_min", np.float64),  # position of the first node [m]
        ("y_min", np.float64),
        ("spacing", np.float64),  # distance between two nodes [m]
    ]
)
"""Where the nodes of a field are."""


class Field(NamedTuple):
    """A field; the kernels take its two parts."""

    grid: Record
    """Where the nodes are, a record of type `GRID`."""
    distances: NDArray[np.float32]
    """Signed distance of each node from the nearest obstacle or bound, negative inside, shape (rows, columns) [m]."""


_fields: WeakKeyDictionary[World, Field] = WeakKeyDictionary()
_lock = threading.Lock()


def field_of(world: World) -> Field:
    """The field of a world, made when first asked for and kept as long as the world; for all threads."""
    with _lock:
        if world not in _fields:
            _fields[world] = make_field(world)
        return _fields[world]


def make_field(world: World) -> Field:
    """Compute the field of a world.

    Pieces thinner than the spacing are thickened to it: no wall, however thin, is lost between two nodes.
    """
    pieces, corners = world.pieces.pieces.copy(), world.pieces.corners
    half = np.minimum(pieces["half_x"], pieces["half_y"])[pieces["kind"] <= DISC]
    spacing = _spacing(world, 2.0 * float(half.min(initial=math.inf)))
    pieces["half_x"], pieces["half_y"] = (np.maximum(pieces[name], 0.5 * spacing) for name in ("half_x", "half_y"))
    width, height = world.bounds.size
    shape = tuple(math.ceil(size / spacing - 1e-9) + 1 + 2 * BORDER for size in (height, width))
    distances = np.empty(shape, dtype=np.float32)
    x_min, y_min = (low - BORDER * spacing for low in world.bounds.min)
    grid = record_array(1, GRID)[0]
    grid["x_min"], grid["y_min"], grid["spacing"] = x_min, y_min, spacing
    fill_distances(grid, distances, pieces, corners)
    if len(pieces) > 1:
        deepen_inside(distances, np.where(distances > 0.0, 0.0, np.inf).astype(np.float32), spacing)
    _add_bounds(grid, distances, world)
    distances.setflags(write=False)
    return Field(grid, distances)


def _spacing(world: World, thinnest: float) -> float:
    """Distance between two nodes: that of the thinnest piece where possible [m]."""
    width, height = world.bounds.size
    coarsest = math.sqrt(width * height / MAX_NODES) * 1.001
    return max(coarsest, min(LARGEST_SPACING, max(thinnest, SMALLEST_SPACING), max(width, height) / 40.0))


def _add_bounds(grid: Record, distances: NDArray[np.float32], world: World) -> None:
    """Take the walls around the world into the field."""
    (x_low, y_low), (x_high, y_high) = world.bounds.min, world.bounds.max
    rows, columns = distances.shape
    x = grid["x_min"] + grid["spacing"] * np.arange(columns)
    y = grid["y_min"] + grid["spacing"] * np.arange(rows)
    from_sides = np.minimum(x - x_low, x_high - x).astype(np.float32)
    from_ends = np.minimum(y - y_low, y_high - y).astype(np.float32)
    np.minimum(distances, from_sides, out=distances)
    np.minimum(distances, from_ends[:, None], out=distances)


@kernel
def fill_distances(grid: Record, distances: NDArray[np.float32], pieces: Records, corners: Records) -> None:
    """Exact signed distances from the nearest piece at all nodes; infinite where there is none.

    A signed distance is 1-Lipschitz: in a tile whose nodes lie within r of its centre c, the nearest piece is one whose
    distance from c exceeds the least one by at most 2 r.
    """
    rows, columns = distances.shape
    lists = np.empty((len(TILES) + 1, len(pieces)), dtype=np.int32)
    counts = np.empty(len(TILES) + 1, dtype=np.int64)
    from_centre = np.empty(len(pieces))
    for k in range(len(pieces)):
        lists[0, k] = k
    counts[0] = len(pieces)
    large, middle, small = TILES
    for row in range(0, rows, large):
        for column in range(0, columns, large):
            shortlist(1, row, column, large, grid, pieces, corners, lists, counts, from_centre)
            for r in range(row, min(row + large, rows), middle):
                for c in range(column, min(column + large, columns), middle):
                    shortlist(2, r, c, middle, grid, pieces, corners, lists, counts, from_centre)
                    for i in range(r, min(r + middle, rows), small):
                        for j in range(c, min(c + middle, columns), small):
                            shortlist(3, i, j, small, grid, pieces, corners, lists, counts, from_centre)
                            fill_tile(i, j, grid, distances, pieces, corners, lists[3], counts[3])


@inner_kernel
def piece_distance(x: float, y: float, piece: Record, corners: Records) -> float:
    """:func:`cbrrt_ompl.collision.distances.point_piece`, compiled once for both of its callers here."""
    return point_piece(x, y, piece, corners)


@inner_kernel
def shortlist(
    level: int,
    row: int,
    column: int,
    side: int,
    grid: Record,
    pieces: Records,
    corners: Records,
    lists: NDArray[np.int32],
    counts: NDArray[np.int64],
    from_centre: NDArray[np.float64],
) -> None:
    """Write the list of a level: the pieces of the level above that may be the nearest ones of a tile."""
    half = 0.5 * (side - 1) * grid.spacing
    x, y = grid.x_min + column * grid.spacing + half, grid.y_min + row * grid.spacing + half
    least = math.inf
    for k in range(counts[level - 1]):
        from_centre[k] = piece_distance(x, y, pieces[lists[level - 1, k]], corners)
        least = min(least, from_centre[k])
    enough, n = least + 2.0 * math.sqrt(2.0) * half + 1e-9, 0
    for k in range(counts[level - 1]):
        if from_centre[k] <= enough:
            lists[level, n] = lists[level - 1, k]
            n += 1
    counts[level] = n


@inner_kernel
def fill_tile(
    row: int,
    column: int,
    grid: Record,
    distances: NDArray[np.float32],
    pieces: Records,
    corners: Records,
    nearest: NDArray[np.int32],
    count: int,
) -> None:
    """Distances of the nodes of one smallest tile from the pieces of its list."""
    rows, columns = distances.shape
    for i in range(row, min(row + TILES[2], rows)):
        for j in range(column, min(column + TILES[2], columns)):
            x, y, least = grid.x_min + j * grid.spacing, grid.y_min + i * grid.spacing, math.inf
            for k in range(count):
                least = min(least, piece_distance(x, y, pieces[nearest[k]], corners))
            distances[i, j] = least


@kernel
def deepen_inside(distances: NDArray[np.float32], depth: NDArray[np.float32], spacing: float) -> None:
    """Lower the distances inside of unions of pieces, where each piece by itself is shallow.

    The depth of a node is at least a path over the grid to the nearest free node, less one spacing, and less the eighth
    by which such a path of straight and diagonal steps may be too long.

    Args:
        distances: signed distances of the nodes from the nearest piece, shape (rows, columns) [m].
        depth: 0 at free nodes, infinite at the others; overwritten, shape (rows, columns) [m].
        spacing: distance between two nodes [m].
    """
    rows, columns = distances.shape
    straight, diagonal = 0.92 * spacing, 0.92 * math.sqrt(2.0) * spacing
    for forward in (True, False):
        for i in range(rows) if forward else range(rows - 1, -1, -1):
            before = i - 1 if forward else i + 1
            for j in range(columns) if forward else range(columns - 1, -1, -1):
                least = depth[i, j]
                if least == 0.0:
                    continue
                beside = j - 1 if forward else j + 1
                if 0 <= beside < columns:
                    least = min(least, depth[i, beside] + straight)
                if 0 <= before < rows:
                    for column in range(max(j - 1, 0), min(j + 2, columns)):
                        step = straight if column == j else diagonal
                        least = min(least, depth[before, column] + step)
                depth[i, j] = least
    for i in range(rows):
        for j in range(columns):
            if 0.0 < depth[i, j] < math.inf:
                distances[i, j] = min(distances[i, j], spacing - depth[i, j])


@inner_kernel
def catmull_rom(u: float) -> tuple[float, float, float, float]:
    """Weights of four neighbouring nodes at a fraction u between the middle two."""
    squared = u * u
    cubed = squared * u
    return (
        -0.5 * cubed + squared - 0.5 * u,
        1.5 * cubed - 2.5 * squared + 1.0,
        -1.5 * cubed + 2.0 * squared + 0.5 * u,
        0.5 * cubed - 0.5 * squared,
    )


@inner_kernel
def catmull_rom_slope(u: float) -> tuple[float, float, float, float]:
    """Derivatives of the weights of :func:`catmull_rom`."""
    squared = u * u
    return (
        -1.5 * squared + 2.0 * u - 0.5,
        4.5 * squared - 5.0 * u,
        -4.5 * squared + 4.0 * u + 0.5,
        1.5 * squared - u,
    )


@inner_kernel
def place_in(grid: Record, distances: NDArray[np.float32], x: float, y: float) -> tuple[int, int, float, float]:
    """Row and column before a point, and its fractions of a spacing beyond them."""
    rows, columns = distances.shape
    across, along = (x - grid.x_min) / grid.spacing, (y - grid.y_min) / grid.spacing
    j = int(min(max(math.floor(across), 1.0), columns - 3.0))
    i = int(min(max(math.floor(along), 1.0), rows - 3.0))
    return i, j, min(max(across - j, -1.0), 2.0), min(max(along - i, -1.0), 2.0)


@kernel
def distance_at(grid: Record, distances: NDArray[np.float32], x: float, y: float) -> float:
    """Signed distance at a point [m]."""
    i, j, u, v = place_in(grid, distances, x, y)
    a, b = catmull_rom(u), catmull_rom(v)
    found = 0.0
    for k in range(4):
        row = distances[i - 1 + k]
        found += b[k] * (a[0] * row[j - 1] + a[1] * row[j] + a[2] * row[j + 1] + a[3] * row[j + 2])
    return found


@kernel
def distance_and_gradient(
    grid: Record, distances: NDArray[np.float32], x: float, y: float
) -> tuple[float, float, float]:
    """Signed distance at a point and its derivatives by x and y, [m, 1, 1]."""
    i, j, u, v = place_in(grid, distances, x, y)
    a, b = catmull_rom(u), catmull_rom(v)
    slope_a, slope_b = catmull_rom_slope(u), catmull_rom_slope(v)
    found, by_x, by_y = 0.0, 0.0, 0.0
    for k in range(4):
        row = distances[i - 1 + k]
        d0, d1, d2, d3 = row[j - 1], row[j], row[j + 1], row[j + 2]
        value = a[0] * d0 + a[1] * d1 + a[2] * d2 + a[3] * d3
        found += b[k] * value
        by_y += slope_b[k] * value
        by_x += b[k] * (slope_a[0] * d0 + slope_a[1] * d1 + slope_a[2] * d2 + slope_a[3] * d3)
    return found, by_x / grid.spacing, by_y / grid.spacing
