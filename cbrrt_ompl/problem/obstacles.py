"""What may stand in a world: boxes, discs and polygons, and the bounds around them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from cbrrt_ompl.checks import LARGEST, SMALLEST, counter_clockwise_ring, is_number
from cbrrt_ompl.errors import Problem, WorldError

MAX_COORDINATE = LARGEST
"""Largest coordinate of a world [m]: beyond it the contact tolerance would drown in rounding."""

_COORDINATES = f"finite coordinates of at most {MAX_COORDINATE:g} m"


@dataclass(frozen=True)
class Bounds:
    """The rectangle that the whole footprint must stay in; its sides are walls.

    Raises:
        WorldError: if a corner is not finite or the rectangle has no area.
    """

    min: tuple[float, float]
    """Lower left corner [m]."""
    max: tuple[float, float]
    """Upper right corner [m]."""

    def __post_init__(self) -> None:
        """Check the corners."""
        _check_rectangle(self, "bounds")
        if max(map(abs, (*self.min, *self.max))) + max(self.size) > MAX_COORDINATE:
            expected = f"bounds whose walls, as thick as they are wide, stay within {MAX_COORDINATE:g} m of zero"
            raise WorldError(Problem("bounds", [self.min, self.max], expected))

    @property
    def size(self) -> tuple[float, float]:
        """Width and height [m]."""
        return self.max[0] - self.min[0], self.max[1] - self.min[1]

    def contains(self, x: float, y: float) -> bool:
        """Whether a point lies strictly inside."""
        return self.min[0] < x < self.max[0] and self.min[1] < y < self.max[1]

    def walls(self) -> list[Box]:
        """Four solid walls around the rectangle, as thick as it is wide."""
        (x0, y0), (x1, y1) = self.min, self.max
        d = max(self.size)
        return [
            Box((x0 - d, y0 - d), (x0, y1 + d)),
            Box((x1, y0 - d), (x1 + d, y1 + d)),
            Box((x0 - d, y0 - d), (x1 + d, y0)),
            Box((x0 - d, y1), (x1 + d, y1 + d)),
        ]


@dataclass(frozen=True)
class Box:
    """A solid rectangle along the axes.

    Raises:
        WorldError: if a corner is not finite or the rectangle has no area.
    """

    min: tuple[float, float]
    """Lower left corner [m]."""
    max: tuple[float, float]
    """Upper right corner [m]."""

    def __post_init__(self) -> None:
        """Check the corners."""
        _check_rectangle(self, "box")

    def to_shapely(self) -> shapely.Polygon:
        """The same area as a shapely polygon."""
        return shapely.box(*self.min, *self.max)


@dataclass(frozen=True)
class OrientedBox:
    """A solid rectangle at an angle.

    Raises:
        WorldError: if a number is not finite or a side not above 0.
    """

    center: tuple[float, float]
    """Centre [m]."""
    size: tuple[float, float]
    """Sides along its own axes [m]."""
    angle: float
    """Direction of its first side, counter-clockwise from the x axis [rad]."""

    def __post_init__(self) -> None:
        """Check centre, sides and angle."""
        problems = []
        center, size = _pair(self.center), _pair(self.size)
        if center is None:
            problems.append(Problem("oriented_box.center", self.center, _COORDINATES))
        if size is None or min(size) < SMALLEST:
            problems.append(Problem("oriented_box.size", self.size, f"two sides above 0, {SMALLEST:g} at least [m]"))
        if not is_number(self.angle, LARGEST):
            problems.append(Problem("oriented_box.angle", self.angle, "a finite angle [rad]"))
        if problems:
            raise WorldError(problems)
        object.__setattr__(self, "center", center)
        object.__setattr__(self, "size", size)
        object.__setattr__(self, "angle", float(self.angle))

    @property
    def vertices(self) -> NDArray[np.float64]:
        """Corners, counter-clockwise, shape (4, 2) [m]."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        halves = 0.5 * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]) * self.size
        return np.array(self.center) + halves @ np.array([(c, s), (-s, c)])

    @property
    def holes(self) -> tuple[NDArray[np.float64], ...]:
        """None: with its vertices, a box can stand for the polygon of the same area."""
        return ()

    def to_shapely(self) -> shapely.Polygon:
        """The same area as a shapely polygon."""
        return shapely.Polygon(self.vertices)


@dataclass(frozen=True)
class Disc:
    """A solid disc.

    Raises:
        WorldError: if the centre is not finite or the radius not above 0.
    """

    center: tuple[float, float]
    """Centre [m]."""
    radius: float
    """Radius [m]."""

    def __post_init__(self) -> None:
        """Check centre and radius."""
        problems = []
        center = _pair(self.center)
        if center is None:
            problems.append(Problem("disc.center", self.center, _COORDINATES))
        if not (is_number(self.radius, MAX_COORDINATE) and self.radius >= SMALLEST):
            problems.append(Problem("disc.radius", self.radius, f"a radius above 0, {SMALLEST:g} at least [m]"))
        if problems:
            raise WorldError(problems)
        object.__setattr__(self, "center", center)
        object.__setattr__(self, "radius", float(self.radius))

    def to_shapely(self) -> shapely.Polygon:
        """The disc as a shapely polygon of 256 sides."""
        return shapely.Point(self.center).buffer(self.radius, quad_segs=64)


@dataclass(frozen=True, eq=False)
class Polygon:
    """A solid simple polygon, convex or not, with holes if need be.

    Raises:
        WorldError: if the rings cross themselves or each other, or enclose no area.
    """

    vertices: NDArray[np.float64]
    """Corners, counter-clockwise, shape (n, 2) [m]."""
    holes: tuple[NDArray[np.float64], ...] = ()
    """Rings that are cut out, each of shape (m, 2) [m]."""

    def __post_init__(self) -> None:
        """Check and freeze the rings."""
        object.__setattr__(self, "vertices", counter_clockwise_ring(self.vertices, "polygon.vertices"))
        if not isinstance(self.holes, list | tuple):
            raise WorldError(Problem("polygon.holes", self.holes, "a list of rings"))
        holes = tuple(counter_clockwise_ring(h, f"polygon.holes[{i}]") for i, h in enumerate(self.holes))
        object.__setattr__(self, "holes", holes)
        shape = self.to_shapely()
        if holes and not shape.is_valid:
            reason = shapely.is_valid_reason(shape).lower()
            raise WorldError(Problem("polygon.holes", len(holes), f"holes apart from each other and inside ({reason})"))

    def __eq__(self, other: object) -> bool:
        """Equal where all rings are, corner for corner."""
        if not isinstance(other, Polygon):
            return NotImplemented
        mine, theirs = (self.vertices, *self.holes), (other.vertices, *other.holes)
        return len(mine) == len(theirs) and all(np.array_equal(a, b) for a, b in zip(mine, theirs, strict=True))

    def __hash__(self) -> int:
        """Hash of the outer ring."""
        return hash(self.vertices.tobytes())

    def to_shapely(self) -> shapely.Polygon:
        """The same area as a shapely polygon."""
        return shapely.Polygon(self.vertices, self.holes)


Obstacle: TypeAlias = Box | OrientedBox | Disc | Polygon
"""What may stand in a world."""


def signed_distance(obstacle: Obstacle, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances of points from an obstacle, minus their depths below its border where they are inside.

    Args:
        obstacle: any obstacle.
        x: positions, shape (n,) [m].
        y: positions, shape (n,) [m].

    Returns:
        Signed distances, shape (n,) [m].
    """
    if isinstance(obstacle, Disc):
        return np.hypot(x - obstacle.center[0], y - obstacle.center[1]) - obstacle.radius
    shape, points = obstacle.to_shapely(), shapely.points(x, y)
    distance = np.asarray(shapely.distance(shape, points))
    inside = distance == 0.0
    distance[inside] = -shapely.distance(shape.boundary, points[inside])
    return distance


def bounding_box(obstacle: Obstacle) -> tuple[float, float, float, float]:
    """The rectangle along the axes around an obstacle: x_min, y_min, x_max, y_max [m]."""
    if isinstance(obstacle, Disc):
        (x, y), r = obstacle.center, obstacle.radius
        return x - r, y - r, x + r, y + r
    if isinstance(obstacle, Box):
        return *obstacle.min, *obstacle.max
    x_min, y_min, x_max, y_max = obstacle.to_shapely().bounds
    return x_min, y_min, x_max, y_max


def distance_from_box(
    box: tuple[float, float, float, float] | NDArray[np.float64],
    x: float | NDArray[np.float64],
    y: float | NDArray[np.float64],
) -> NDArray[np.float64]:
    """Distances of points from rectangles along the axes, 0 inside: of n points from one, or of one point from n.

    Args:
        box: x_min, y_min, x_max, y_max, see :func:`bounding_box`, of shape (4,) or (4, n) [m].
        x: positions, shape (n,) or a number [m].
        y: positions, shape (n,) or a number [m].

    Returns:
        Distances, shape (n,) [m].
    """
    x_min, y_min, x_max, y_max = box
    dx, dy = np.maximum(x_min - x, x - x_max), np.maximum(y_min - y, y - y_max)
    distances: NDArray[np.float64] = np.hypot(np.maximum(dx, 0.0), np.maximum(dy, 0.0))
    return distances


def polygons_from_shapely(geometry: object) -> list[Polygon]:
    """Obstacles of the area of a shapely geometry.

    Args:
        geometry: a polygon, a multipolygon or a collection of such, or several in a sequence; coordinates in metres.

    Returns:
        One polygon with its holes for every polygon in it; empty ones have none.

    Raises:
        WorldError: if a part has no area (points and lines do not) or is not valid.
    """
    return [
        Polygon(_ring(part.exterior), tuple(_ring(hole) for hole in part.interiors)) for part in _polygons(geometry)
    ]


def _polygons(geometry: object) -> Iterator[shapely.Polygon]:
    """The polygons in a geometry that are not empty."""
    if isinstance(geometry, shapely.Polygon):
        if not geometry.is_empty:
            yield geometry
    elif isinstance(geometry, shapely.MultiPolygon | shapely.GeometryCollection):
        for part in geometry.geoms:
            yield from _polygons(part)
    elif isinstance(geometry, list | tuple | np.ndarray):
        for part in geometry.flat if isinstance(geometry, np.ndarray) else geometry:
            yield from _polygons(part)
    else:
        raise WorldError(Problem("geometry", geometry, "polygons; give points and lines an area with shapely.buffer"))


def _ring(ring: shapely.LinearRing) -> NDArray[np.float64]:
    return shapely.get_coordinates(ring)  # (n, 2)


def _pair(values: object) -> tuple[float, float] | None:
    """Two numbers of at most `MAX_COORDINATE`; None where they are none."""
    if isinstance(values, np.ndarray):
        values = values.tolist()
    if isinstance(values, Sequence) and len(values) == 2:
        x, y = values
        if is_number(x, MAX_COORDINATE) and is_number(y, MAX_COORDINATE):
            return float(x), float(y)
    return None


def _check_rectangle(rectangle: Bounds | Box, name: str) -> None:
    """Check the corners of a rectangle, and keep them as floats.

    Raises:
        WorldError: if a corner is not finite or the rectangle has no area.
    """
    low, high = _pair(rectangle.min), _pair(rectangle.max)
    if low is None or high is None:
        raise WorldError(Problem(name, [rectangle.min, rectangle.max], _COORDINATES))
    if not (low[0] < high[0] and low[1] < high[1]):
        raise WorldError(Problem(name, [list(low), list(high)], "min below max in x and in y"))
    object.__setattr__(rectangle, "min", low)
    object.__setattr__(rectangle, "max", high)
