"""Why a robot cannot be at a pose: what is there, how deep it reaches into the footprint, and where there is room."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from cbrrt_ompl.collision.free_poses import nearest_free_pose
from cbrrt_ompl.collision.occupancy import UNKNOWN
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import InputError
from cbrrt_ompl.problem.obstacles import Obstacle, bounding_box
from cbrrt_ompl.problem.robot import Footprint

if TYPE_CHECKING:
    from cbrrt_ompl.scenario.map_layers import MapSource

_SEGMENTS = 64
"""Corners that stand for a disc."""

_TOUCHING = 1e-3
"""Depths below this are told as touching [m]."""


def why_not(world: World, footprint: Footprint, pose: Sequence[float], source: MapSource | None = None) -> str:
    """What keeps a robot from a pose that collides, and the nearest one that does not.

    Args:
        world: bounds and obstacles.
        footprint: the robot's area.
        pose: (x, y, theta) [m, m, rad].
        source: the map of the world, if it came from one.

    Returns:
        Part of a sentence.
    """
    outline = shapely.Polygon(footprint.outline_at(pose, _SEGMENTS)) if footprint.kind != "point" else None
    area: Any = shapely.Point(pose[0], pose[1]) if outline is None else outline
    found = _what_is_there(world, area, source)
    free = nearest_free_pose(world, footprint, pose)
    if free is None:
        return f"{found}; no free pose is near"
    x, y, theta = free
    away = math.hypot(x - pose[0], y - pose[1])
    return f"{found}; the nearest free pose is about ({x:.2f}, {y:.2f}, {theta:.3g}), {away:.2g} m away"


def nearest_thing(world: World, footprint: Footprint, pose: Sequence[float], known: int) -> str:
    """The obstacle or wall that is nearest to a robot at a pose, and how far away it is.

    Args:
        world: bounds and obstacles.
        footprint: the robot's area.
        pose: (x, y, theta) [m, m, rad].
        known: how many of the obstacles are the scenario's; those behind them were hidden.
    """
    area: Any = shapely.Point(pose[0], pose[1])
    if footprint.kind != "point":
        area = shapely.Polygon(footprint.outline_at(pose, _SEGMENTS))
    (x0, y0), (x1, y1) = world.bounds.min, world.bounds.max
    a0, b0, a1, b1 = area.bounds
    found, name = min(a0 - x0, b0 - y0, x1 - a1, y1 - b1), "the bounds"
    for i, obstacle in enumerate(world.obstacles):
        if _meets(obstacle, a0 - found, b0 - found, a1 + found, b1 + found):
            distance = float(shapely.distance(area, obstacle.to_shapely()))
            if distance < found:
                number = f"obstacles[{i}]" if i < known else f"hidden obstacle {i - known}"
                found, name = distance, f"{number}, a {type(obstacle).__name__.lower()}"
    return f"{name}, {max(found, 0.0):.2g} m away"


def _what_is_there(world: World, area: Any, source: MapSource | None) -> str:
    """The unknown cells, the wall or the obstacle that an area touches, and how deep."""
    from_map = 0 if source is None else source.obstacles
    cells = "occupied cells of the map" + (" or of its keepout mask" if source is not None and source.keepout else "")
    touched = _touched(world, area)
    unknown = "" if source is None else _unknown_cells(area, source)
    if unknown and all(index < from_map for index in touched):
        return unknown
    name, deepest = "", -1.0
    for index in touched:
        depth = _depth(area, world.obstacles[index].to_shapely())
        if depth > deepest:
            place = world.obstacles[index]
            kind = type(place).__name__.lower() if index >= from_map else cells
            number = f"obstacles[{index - from_map}], a {kind}" if index >= from_map else kind
            name, deepest = number, depth
    low, high = world.bounds.min, world.bounds.max
    x0, y0, x1, y1 = area.bounds
    beyond = max(low[0] - x0, low[1] - y0, x1 - high[0], y1 - high[1])
    if beyond >= 0.0 and beyond >= deepest:
        return "it touches the bounds" if beyond < _TOUCHING else f"it reaches {beyond:.2g} m beyond the bounds"
    if deepest < _TOUCHING:
        return f"it touches {name or 'something'}"
    return f"it reaches {deepest:.2g} m into {name}"


def _touched(world: World, area: Any) -> list[int]:
    """Which obstacles meet an area."""
    x0, y0, x1, y1 = area.bounds
    near = [i for i, o in enumerate(world.obstacles) if _meets(o, x0, y0, x1, y1)]
    return [i for i in near if shapely.distance(world.obstacles[i].to_shapely(), area) <= 1e-6]


def _meets(obstacle: Obstacle, x0: float, y0: float, x1: float, y1: float) -> bool:
    """Whether the rectangle around an obstacle meets another one."""
    a0, b0, a1, b1 = bounding_box(obstacle)
    return bool(a0 <= x1 + 1e-6 and a1 >= x0 - 1e-6 and b0 <= y1 + 1e-6 and b1 >= y0 - 1e-6)


def _depth(area: Any, solid: Any) -> float:
    """How deep a solid reaches into an area; of a point, how deep it lies in the solid [m]."""
    if area.geom_type == "Point":
        return float(shapely.distance(area, solid.boundary))
    overlap = shapely.intersection(area, solid)
    if overlap.is_empty:
        return 0.0
    corners = shapely.get_coordinates(shapely.segmentize(overlap, 0.05 * area.length))
    inner = shapely.get_coordinates(overlap.centroid)
    return float(shapely.distance(shapely.points(np.concatenate([corners, inner])), area.exterior).max())


def _unknown_cells(area: Any, source: MapSource) -> str:
    """That an area reaches into unknown cells, and the key that frees them; empty where it does not."""
    from cbrrt_ompl.scenario.maps.loading import load_map

    if source.unknown != "occupied":
        return ""
    try:
        grid = load_map(source.file, resolution=source.resolution)
    except InputError:  # it has changed since
        return ""
    x, y, yaw = grid.origin
    c, s = math.cos(yaw), math.sin(yaw)
    in_grid = shapely.transform(
        area, lambda p: np.column_stack([c * (p[:, 0] - x) + s * (p[:, 1] - y), c * (p[:, 1] - y) - s * (p[:, 0] - x)])
    )
    x0, y0, x1, y1 = (value / grid.resolution for value in in_grid.bounds)
    rows, columns = grid.cells.shape
    bottom, left = max(math.floor(y0), 0), max(math.floor(x0), 0)
    part = grid.cells[
        bottom : max(min(math.ceil(y1 + 1e-9), rows), 0), left : max(min(math.ceil(x1 + 1e-9), columns), 0)
    ]
    corners = (np.argwhere(part == UNKNOWN)[:, ::-1] + (left, bottom)) * grid.resolution
    cells = shapely.box(*corners.T, *(corners + grid.resolution).T)
    if not shapely.intersects(cells, in_grid).any():
        return ""
    key = f"map: {{file: {source.file.name}, unknown: free}}"
    return f"it reaches into unknown cells, which count as occupied ({key} lets it in)"
