"""FCL's answers, certified and stored: a quadtree that decides states in compiled code.

The distance of a point from the nearest solid is 1-Lipschitz. If FCL says that a point q has clearance c,
then every position p nearer to q than c - r is free for a footprint inside a disc of radius r, and every p nearer than
r' - c is in collision for a footprint that holds a disc of radius r' (c is negative below a surface). What neither
certificate decides is asked: FCL answers with the real footprint, and the cell is split where the question was.
"""

from __future__ import annotations

import math
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cbrrt_ompl.robot import Footprint
from cbrrt_ompl.world import CONTACT_TOLERANCE, MITRE_LIMIT, World

COLLISION = -1.0
"""Certificate of a position at which the footprint touches something, whatever its heading."""

UNDECIDED = 0.0
"""Certificate of a position that only FCL can decide."""

CERTIFICATE_MARGIN = 1e-6
"""What a certificate must hold by [m]: well above the rounding of FCL's closed-form distances and of its GJK."""

SMALLEST_CELL = 0.002
"""Cells are split down to no less than this size [m]."""

MAX_CELLS = 2_000_000
"""Cells that a map holds at most: 56 MB."""


MAX_MARGINS = 100_000
"""Answers about single poses that a map keeps at most: 20 MB."""


class MapView(NamedTuple):
    """The map as the kernels see it."""

    children: NDArray[np.int32]
    """Index of the first of a cell's four children, 0 at a leaf; empty where there is no map, shape (n,)."""
    clearances: NDArray[np.float64]
    """Where FCL was asked in each cell, and the signed clearance there: rows of (x, y, clearance), shape (n, 3) [m]."""
    x_min: float
    """Bounds of the world [m]."""
    y_min: float
    x_max: float
    y_max: float
    size: float
    """Side of the root cell, whose lower left corner is that of the bounds [m]."""
    inner: float
    """Radius of a disc about the robot's origin that the grown footprint holds [m]."""
    outer: float
    """Radius of a disc about the robot's origin that holds the grown footprint [m]."""
    is_round: bool
    """Whether the heading makes no difference."""


FRAME_SIZE = len(MapView._fields) - 2
"""Numbers of a view besides its two arrays."""


@njit(cache=True)
def unpack_view(children: NDArray[np.int32], clearances: NDArray[np.float64], f: NDArray[np.float64]) -> MapView:
    """The view out of its arrays, f of shape (FRAME_SIZE,)."""
    return MapView(children, clearances, f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7] != 0.0)


@njit(cache=True)
def find_leaf(view: MapView, x: float, y: float) -> tuple[int, float, float, float]:
    """The leaf that holds a position inside the bounds.

    Returns:
        Its index, the centre and the side of its cell [m].
    """
    size = view.size
    x_centre, y_centre = view.x_min + 0.5 * size, view.y_min + 0.5 * size
    cell = 0
    while view.children[cell] > 0:
        cell = view.children[cell]
        size *= 0.5
        if x >= x_centre:
            cell += 1
            x_centre += 0.5 * size
        else:
            x_centre -= 0.5 * size
        if y >= y_centre:
            cell += 2
            y_centre += 0.5 * size
        else:
            y_centre -= 0.5 * size
    return cell, x_centre, y_centre, size


@njit(cache=True)
def certify(view: MapView, x: float, y: float) -> float:
    """What the map knows about a position.

    Args:
        view: the map.
        x: position of the robot's origin [m].
        y: position of the robot's origin [m].

    Returns:
        `COLLISION`; or `UNDECIDED`; or a distance [m] within which every position is free, whatever the heading.
    """
    if not (view.x_min < x < view.x_max and view.y_min < y < view.y_max):
        return COLLISION
    if len(view.children) == 0:
        return UNDECIDED
    cell, _, _, _ = find_leaf(view, x, y)
    dx, dy, clearance = x - view.clearances[cell, 0], y - view.clearances[cell, 1], view.clearances[cell, 2]
    distance = math.sqrt(dx * dx + dy * dy) + CERTIFICATE_MARGIN
    if clearance - view.outer - distance > 0.0:
        return clearance - view.outer - distance
    if view.inner - clearance - distance > 0.0:
        return COLLISION
    return UNDECIDED


class ClearanceMap:
    """Decides states for one footprint in one world: by certificate where possible, else by FCL.

    The map grows where it is asked, never beyond `MAX_CELLS`; its answers are FCL's whatever it holds.

    Attributes:
        checker: the FCL queries behind the map.
        children: see :class:`MapView`; replaced when the map grows.
        clearances: see :class:`MapView`; replaced when the map grows.
        frame: the other numbers of the view, shape (FRAME_SIZE,).
        answers: FCL's answers of the present extension, rows of (x, y, theta, margin), shape (n, 4).
        exact_queries: states that FCL had to decide with the real footprint.
    """

    def __init__(self, world: World, footprint: Footprint, *, enabled: bool = True) -> None:
        """Start with the root cell alone.

        Args:
            world: bounds and obstacles.
            footprint: the robot's area.
            enabled: False leaves the map empty, so that FCL decides every state inside the bounds.
        """
        self.checker = world.checker(footprint)
        self.enabled = enabled
        self._is_round = footprint.is_round
        self.exact_queries = 0
        self._signed_clearance = world.checker(Footprint.point()).signed_clearance
        bounds = world.bounds
        size = max(bounds.size)
        self._smallest = 2.0 * SMALLEST_CELL
        inner = footprint.inscribed_radius + (CONTACT_TOLERANCE if footprint.is_round else 0.0)
        if footprint.inscribed_radius == 0.0 and not footprint.is_round:
            inner = -math.inf  # the origin is beside the footprint, and may well be inside an obstacle
        outer = footprint.circumscribed_radius + MITRE_LIMIT * CONTACT_TOLERANCE
        self.frame = np.array([*bounds.min, *bounds.max, size, inner, outer, footprint.is_round], dtype=float)
        self.answers: NDArray[np.float64] = np.empty((64, 4))
        self._margins: dict[tuple[float, float, float], float] = {}
        self._cells = 1 if enabled else 0
        self.children: NDArray[np.int32] = np.zeros(self._cells, dtype=np.int32)
        self.clearances: NDArray[np.float64] = np.zeros((self._cells, 3))
        if enabled:
            self._ask_clearance(0, bounds.min[0] + 0.5 * size, bounds.min[1] + 0.5 * size)

    @property
    def view(self) -> MapView:
        """The map for a kernel, as it is now."""
        x_min, y_min, x_max, y_max, size, inner, outer, is_round = self.frame.tolist()
        return MapView(self.children, self.clearances, x_min, y_min, x_max, y_max, size, inner, outer, is_round != 0.0)

    @property
    def cells(self) -> int:
        """Cells in the map."""
        return self._cells

    def collides(self, x: float, y: float, theta: float) -> bool:
        """Whether the footprint touches an obstacle or a wall at a pose [m, m, rad]: always FCL's answer.

        Where the map does not know yet, it is refined on the way.
        """
        certificate = certify_packed(self.children, self.clearances, self.frame, x, y)
        if certificate == UNDECIDED and self._refine(x, y):
            certificate = certify_packed(self.children, self.clearances, self.frame, x, y)
        if certificate == UNDECIDED:
            self.exact_queries += 1
            return self.checker.collides(x, y, theta)
        return bool(certificate == COLLISION)

    def answer(self, answered: int, x: float, y: float, theta: float) -> int:
        """Settle a pose that a kernel asked about: by refining the map, else by a row of ``answers`` from FCL.

        Args:
            answered: rows of ``answers`` in use.
            x: position [m].
            y: position [m].
            theta: heading [rad].

        Returns:
            Rows of ``answers`` in use afterwards.
        """
        if self._refine(x, y) and certify_packed(self.children, self.clearances, self.frame, x, y) != UNDECIDED:
            return answered
        if answered == len(self.answers):
            self.answers = np.concatenate([self.answers, np.empty_like(self.answers)])
        self.exact_queries += 1
        self.answers[answered] = x, y, theta, self._margin(x, y, theta)
        return answered + 1

    def _margin(self, x: float, y: float, theta: float) -> float:
        """FCL's margin at a pose, 0 in collision; for a round footprint the map keeps it, in place of an older one."""
        if self._is_round and self.enabled:
            cell, _, _, _ = find_leaf_packed(self.children, self.clearances, self.frame, x, y)
            self._ask_clearance(cell, x, y)
            certificate = certify_packed(self.children, self.clearances, self.frame, x, y)
            if certificate != UNDECIDED:
                return max(certificate, 0.0)
            return self.checker.margin(x, y, theta)
        pose = (x, y, theta)  # nodes that are stuck ask the same again and again
        if pose not in self._margins:
            if len(self._margins) == MAX_MARGINS:
                self._margins.clear()
            self._margins[pose] = self.checker.margin(x, y, theta)
        return self._margins[pose]

    def _ask_clearance(self, cell: int, x: float, y: float) -> None:
        """Let FCL measure the clearance of a point in a cell, and keep it."""
        self.clearances[cell] = x, y, self._signed_clearance(x, y)

    def _refine(self, x: float, y: float) -> bool:
        """Split the cells at an undecided position until it is decided; False where nothing could be split."""
        has_grown = False
        while self._cells + 4 <= MAX_CELLS and self.enabled:
            cell, x_centre, y_centre, size = find_leaf_packed(self.children, self.clearances, self.frame, x, y)
            if size < self._smallest or self._is_hopeless(cell, x, y):
                break
            self._split(cell, x_centre, y_centre, 0.25 * size)
            has_grown = True
            if certify_packed(self.children, self.clearances, self.frame, x, y) != UNDECIDED:
                break
        return has_grown

    def _is_hopeless(self, cell: int, x: float, y: float) -> bool:
        """Whether a position is certainly between the two radii of the footprint, where no cell can decide it."""
        x_asked, y_asked, clearance = self.clearances[cell].tolist()
        distance = math.hypot(x - x_asked, y - y_asked)
        inner, outer = self.frame[5:7].tolist()
        return bool(inner <= clearance - distance and clearance + distance <= outer)

    def _split(self, cell: int, x: float, y: float, offset: float) -> None:
        """Give a leaf its four children, whose centres FCL measures."""
        first = self._cells
        if first + 4 > len(self.children):
            capacity = min(2 * len(self.children) + 64, MAX_CELLS + 4)
            self.children = np.concatenate([self.children, np.zeros(capacity - first, dtype=np.int32)])
            self.clearances = np.concatenate([self.clearances, np.zeros((capacity - first, 3))])
        for i, (dx, dy) in enumerate(((-1, -1), (1, -1), (-1, 1), (1, 1))):
            self._ask_clearance(first + i, x + dx * offset, y + dy * offset)
        self._cells += 4
        self.children[cell] = first  # last, so that no reader ever meets a child without its clearance


_maps: WeakKeyDictionary[World, dict[Footprint, ClearanceMap]] = WeakKeyDictionary()


def clearance_map_for(world: World, footprint: Footprint) -> ClearanceMap:
    """The map of a footprint in a world: made once, grown by every plan, and kept as long as the world."""
    maps = _maps.setdefault(world, {})
    if footprint not in maps:
        maps[footprint] = ClearanceMap(world, footprint)
    return maps[footprint]


@njit(cache=True)
def certify_packed(
    children: NDArray[np.int32], clearances: NDArray[np.float64], frame: NDArray[np.float64], x: float, y: float
) -> float:
    """:func:`certify` for a caller in Python, to whom arrays cost less than a named tuple."""
    return certify(unpack_view(children, clearances, frame), x, y)


@njit(cache=True)
def find_leaf_packed(
    children: NDArray[np.int32], clearances: NDArray[np.float64], frame: NDArray[np.float64], x: float, y: float
) -> tuple[int, float, float, float]:
    """:func:`find_leaf` for a caller in Python."""
    return find_leaf(unpack_view(children, clearances, frame), x, y)
