"""Where the robot may be: bounds and obstacles, and what a footprint is free of."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cbrrt_ompl.collision.clearance import clearance_at
from cbrrt_ompl.collision.fcl_referee import CONTACT_TOLERANCE, MITRE_LIMIT, FclReferee, make_solids
from cbrrt_ompl.collision.occupancy import (
    FREE_THRESHOLD,
    OCCUPIED_THRESHOLD,
    GridLayer,
    blocked_cells,
    cells_from,
    cells_from_costs,
)
from cbrrt_ompl.collision.pieces import Pieces, join, obstacle_pieces
from cbrrt_ompl.collision.scene import Scene, make_scene
from cbrrt_ompl.errors import MISSING, Problem, WorldError
from cbrrt_ompl.problem.obstacles import Bounds, Obstacle, polygons_from_shapely
from cbrrt_ompl.problem.robot import Footprint
from cbrrt_ompl.shown import Shown

CONTACT_BAND = (MITRE_LIMIT + 1.0) * CONTACT_TOLERANCE
"""Clearance below which FCL decides whether a pose is free: what it grows corners by, and some rounding [m]."""


class World(Shown):
    """Bounds and obstacles, ready for collision queries from any thread.

    Distances are exact, by compiled code in the plane; whether a pose within some micrometres of contact is free is
    FCL's decision.

    Attributes:
        bounds: the walls around everything.
        layer: the grid whose blocked cells are among the obstacles; None if there is none.
    """

    def __init__(self, bounds: Bounds, obstacles: Iterable[Obstacle] = ()) -> None:
        """Check the parts; what queries need is made when first asked for.

        Args:
            bounds: the walls.
            obstacles: boxes, discs and polygons, any number; they may overlap.

        Raises:
            WorldError: if these are no bounds or no obstacles.
        """
        if not isinstance(bounds, Bounds):
            raise WorldError(Problem("bounds", bounds, "a value of type Bounds"))
        self.bounds = bounds
        self.layer: GridLayer | None = None
        self._loose = _checked_obstacles(obstacles)
        self._scenes: dict[Footprint, Scene] = {}
        self._lock = threading.Lock()
        self._referees = _Referees()

    @classmethod
    def from_layer(cls, layer: GridLayer, bounds: Bounds | None = None, obstacles: Iterable[Obstacle] = ()) -> World:
        """World of a grid's blocked cells and some other obstacles.

        Args:
            layer: the grid.
            bounds: the walls; those of the grid if not given.
            obstacles: what stands there as well.
        """
        world = cls(layer.bounds if bounds is None else bounds, obstacles)
        world.layer = layer
        return world

    @classmethod
    def from_grid(
        cls,
        grid: ArrayLike,
        resolution: float,
        origin: Sequence[float] = (0.0, 0.0, 0.0),
        *,
        unknown: str = "occupied",
        occupied_thresh: float = OCCUPIED_THRESHOLD,
        free_thresh: float = FREE_THRESHOLD,
    ) -> World:
        """World of an occupancy grid; its first row is the lowest, as in a ROS OccupancyGrid.

        An image has its first row at the top: flip it with ``grid[::-1]``. The cell in row r and column c covers
        x from c to c + 1 and y from r to r + 1 times the resolution, in the frame of the origin.

        Args:
            grid: shape (rows, columns): whether a cell is occupied as bool, 0 or 1; or how likely it is, from 0 to 1,
                NaN where nobody knows; or the whole numbers of ROS: -1 unknown, else 0 to 100 percent.
            resolution: side of a cell [m].
            origin: pose (x, y, yaw) of the lower left corner of the grid, [m, m, rad]; where the grid is rotated, the
                world is the rectangle around it, blocked outside of the grid.
            unknown: whether cells that are neither occupied nor free are ``occupied`` or ``free``.
            occupied_thresh: cells more likely than this are occupied.
            free_thresh: cells less likely than this are free.

        Returns:
            The world, with the blocked cells merged into boxes.

        Raises:
            MapError: if these are no such values, or no cell is free.
        """
        blocked = blocked_cells(cells_from(grid, occupied_thresh, free_thresh), unknown)
        return cls.from_layer(GridLayer(blocked, resolution, origin))  # type: ignore[arg-type]  # checked in there

    @classmethod
    def from_costmap(
        cls,
        costs: ArrayLike,
        resolution: float,
        origin: Sequence[float] = (0.0, 0.0, 0.0),
        *,
        lethal_threshold: int | None = None,
        unknown: str = "occupied",
    ) -> World:
        """World of a Nav2 costmap, or of a ROS OccupancyGrid; its first row is the lowest.

        A costmap holds 0 to 254, and 255 where nobody knows; the footprint is checked exactly here, so that inflated
        costs block nothing and 254 alone does. An OccupancyGrid holds 0 to 100 percent, and -1 where nobody knows (255
        in arrays without a sign); as for the static layer of Nav2, 100 alone blocks. An array with a value from 101 to
        254 is a costmap, any other an OccupancyGrid.

        Args:
            costs: whole numbers, shape (rows, columns).
            resolution: side of a cell [m].
            origin: as in :meth:`from_grid`.
            lethal_threshold: what blocks, with all above it; 254 in a costmap and 100 in an OccupancyGrid if not given.
                In a costmap, 253 also blocks where the inscribed disc of Nav2's robot would touch.
            unknown: whether unknown cells count as ``occupied`` or ``free``.

        Returns:
            The world, with the blocked cells merged into boxes.

        Raises:
            MapError: if these are no such values, or no cell is free.
        """
        blocked = blocked_cells(cells_from_costs(costs, lethal_threshold), unknown)
        return cls.from_layer(GridLayer(blocked, resolution, origin))  # type: ignore[arg-type]  # checked in there

    @classmethod
    def from_shapely(cls, geometry: object, bounds: Bounds | None = None) -> World:
        """World whose obstacles are the area of a shapely geometry.

        Args:
            geometry: a polygon, a multipolygon or a collection of such, or several in a list; in metres.
            bounds: the walls; the rectangle around the geometry if not given.

        Raises:
            WorldError: if a part of the geometry has no area, or it is empty and there are no bounds either.
        """
        obstacles = polygons_from_shapely(geometry)
        if bounds is None:
            if not obstacles:
                raise WorldError(Problem("bounds", MISSING, "bounds, where the geometry is empty"))
            corners = np.concatenate([o.vertices for o in obstacles])  # (n, 2)
            (x0, y0), (x1, y1) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
            bounds = Bounds((x0, y0), (x1, y1))
        return cls(bounds, obstacles)

    def updated(self, *, obstacles: Iterable[Obstacle] | None = None, grid: ArrayLike | None = None) -> World:
        """The same world with other obstacles or another grid, for a world that changes while the robot drives.

        Args:
            obstacles: all that is to stand there besides the grid's cells; those of this world if not given.
            grid: which cells are blocked, in the frame of this world's grid, shape (rows, columns) of bool, or values
                as :meth:`from_grid` takes them (unknown cells are blocked); the grid of this world if not given.

        Raises:
            WorldError: if these are no obstacles, or this world has no grid.
            MapError: if the grid has another shape, or no cell of it is free.
        """
        loose = self._loose if obstacles is None else obstacles
        layer = self.layer
        if grid is not None:
            if layer is None:
                raise WorldError(Problem("grid", grid, "none: this world was not made from a grid"))
            cells = cells_from(grid)
            if cells.shape != layer.blocked.shape:
                raise WorldError(Problem("grid", list(cells.shape), f"the shape {list(layer.blocked.shape)}"))
            layer = GridLayer(blocked_cells(cells, "occupied"), layer.resolution, layer.origin)
        if layer is None:
            return World(self.bounds, loose)
        return World.from_layer(layer, self.bounds, loose)

    def with_more(self, obstacles: Iterable[Obstacle]) -> World:
        """The same world with some more obstacles, which come last."""
        return self.updated(obstacles=(*self._loose, *obstacles))

    @cached_property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The solids inside: those of the grid, then the others in the order given."""
        return self._loose if self.layer is None else (*self.layer.obstacles, *self._loose)

    @cached_property
    def pieces(self) -> Pieces:
        """The obstacles as convex pieces."""
        loose = obstacle_pieces(self._loose)
        return loose if self.layer is None else join((self.layer.pieces, loose))

    def scene(self, footprint: Footprint) -> Scene:
        """The world as the kernels see it for one footprint; made once and kept, and shared by all threads."""
        with self._lock:
            if footprint not in self._scenes:
                self._scenes[footprint] = make_scene(self.bounds, self.pieces, footprint)
            return self._scenes[footprint]

    def collides(self, footprint: Footprint, pose: ArrayLike) -> bool:
        """Whether a footprint at a pose touches an obstacle or a wall: within `CONTACT_BAND`, FCL's answer.

        Args:
            footprint: the robot's area.
            pose: (x, y, theta), [m, m, rad].

        Returns:
            True where it touches, and wherever the robot's origin is not strictly inside the bounds.
        """
        x, y, theta = (float(value) for value in np.asarray(pose, dtype=float)[:3])
        found = clearance_at(*self.scene(footprint), x, y, theta)
        if abs(found) > CONTACT_BAND:
            return bool(found < 0.0)
        return self.referee(footprint).collides(x, y, theta)

    def clearance(self, footprint: Footprint, pose: ArrayLike) -> float:
        """Distance of a footprint from the nearest obstacle or wall, exact to rounding.

        Args:
            footprint: the robot's area.
            pose: (x, y, theta), [m, m, rad].

        Returns:
            The distance [m], no greater than that of the robot's origin from the bounds; 0 where they touch or overlap.
        """
        x, y, theta = (float(value) for value in np.asarray(pose, dtype=float)[:3])
        return max(float(clearance_at(*self.scene(footprint), x, y, theta)), 0.0)

    def signed_clearance(self, x: float, y: float) -> float:
        """Distance of a point from the nearest solid, or minus a depth below its surface.

        Inside solids the depth is that below the surface of one convex piece, so a lower bound: every point nearer
        than that is in collision as well.

        Args:
            x: position [m].
            y: position [m].

        Returns:
            Signed distance [m].
        """
        (x_min, y_min), (x_max, y_max) = self.bounds.min, self.bounds.max
        walls = min(x - x_min, x_max - x, y - y_min, y_max - y)
        return float(clearance_at(*self.scene(Footprint.point()), x, y, 0.0)) if walls > 0.0 else walls

    def referee(self, footprint: Footprint) -> FclReferee:
        """FCL's view of one footprint, made once a thread and kept."""
        referees = self._referees.by_footprint
        if footprint not in referees:
            referees[footprint] = FclReferee(self.bounds, self._solids, footprint)
        return referees[footprint]

    def __repr__(self) -> str:
        """Its size and how much stands in it."""
        width, height = self.bounds.size
        return f"World({width:.4g} x {height:.4g} m, {_count(len(self.obstacles), 'obstacle')})"

    def __reduce__(self) -> tuple[Any, ...]:
        """What is pickled: all else is made again from bounds, grid and obstacles."""
        if self.layer is None:
            return World, (self.bounds, self._loose)
        return World.from_layer, (self.layer, self.bounds, self._loose)

    @cached_property
    def _solids(self) -> Any:
        return make_solids(self.bounds, self.obstacles)


class _Referees(threading.local):
    """The referees of a thread: each moves an FCL object of its own."""

    def __init__(self) -> None:
        self.by_footprint: dict[Footprint, FclReferee] = {}


def _count(number: int, name: str) -> str:
    """So many things, in words."""
    return f"{number:,} {name}{'' if number == 1 else 's'}"


def _checked_obstacles(obstacles: Iterable[Obstacle]) -> tuple[Obstacle, ...]:
    """Obstacles in a tuple.

    Raises:
        WorldError: if one of them is none.
    """
    try:
        checked = tuple(obstacles)
    except TypeError:
        raise WorldError(Problem("obstacles", obstacles, "a list of obstacles")) from None
    for i, obstacle in enumerate(checked):
        if not isinstance(obstacle, Obstacle):
            raise WorldError(Problem(f"obstacles[{i}]", obstacle, "a Box, OrientedBox, Disc or Polygon"))
    return checked
