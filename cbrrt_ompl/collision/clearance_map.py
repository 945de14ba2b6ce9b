"""FCL's answers, certified and stored: a quadtree that decides states in compiled code.

The distance of a point from the nearest solid is 1-Lipschitz. If FCL says that a point q has clearance c,
then every position p nearer to q than c - r is free for a footprint inside a disc of radius r, and every p nearer than
r' - c is in collision for a footprint that holds a disc of radius r' (c is negative below a surface). A footprint with
corners is a tree of such discs. What no certificate decides is asked: FCL answers with the real footprint, and the cell
is split where the question was.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cbrrt_ompl.collision.disc_tree import disc_tree
from cbrrt_ompl.collision.world import CONTACT_TOLERANCE, MITRE_LIMIT, CollisionChecker, World
from cbrrt_ompl.motion.kinematics import sine_cosine
from cbrrt_ompl.problem.obstacles import Obstacle, bounding_box, distance_from_box, signed_distance
from cbrrt_ompl.problem.robot import Footprint

COLLISION = -1.0
"""Certificate of a position at which the footprint touches something, whatever its heading."""

UNDECIDED = 0.0
"""Certificate of a position that only FCL can decide."""

ROOM = 5e-4
"""Distance that planned motions keep from everything [m]; poses by themselves only have to be free."""

CERTIFICATE_MARGIN = 1e-6
"""What a certificate must hold by [m]: well above the rounding of FCL's closed-form distances and of its GJK."""

GOOD_MARGIN = 0.02
"""Certificates of coarse parts below this are improved by asking finer ones [m]: it saves checks further on."""

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
    """Where FCL was asked in each cell, and the signed clearance there: rows of (x, y, clearance), shape (n, 3) [m].

    The rows before the root are no cells but the parts of the footprint, two rows a disc: (x, y, outer), (inner, next,
    0), see `disc_tree`. An array of their own would cost a fifth of the kernels' speed.
    """
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
    root: int
    """Row of the root cell."""


FRAME_SIZE = len(MapView._fields) - 2
"""Numbers of a view besides its arrays."""


@njit(cache=True)
def unpack_view(children: NDArray[np.int32], clearances: NDArray[np.float64], f: NDArray[np.float64]) -> MapView:
    """The view out of its arrays, f of shape (FRAME_SIZE,)."""
    return MapView(children, clearances, f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7] != 0.0, int(f[8]))


@njit(cache=True)
def find_leaf(view: MapView, x: float, y: float) -> tuple[int, float, float, float]:
    """The leaf that holds a position inside the bounds.

    Returns:
        Its index, the centre and the side of its cell [m].
    """
    size = view.size
    x_centre, y_centre = view.x_min + 0.5 * size, view.y_min + 0.5 * size
    cell = view.root
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
def certify(view: MapView, x: float, y: float, room: float) -> float:
    """What the map knows about a position.

    Args:
        view: the map.
        x: position of the robot's origin [m].
        y: position of the robot's origin [m].
        room: how much farther than to touch nothing the footprint has to be from everything [m]; 0 or `ROOM`.

    Returns:
        `COLLISION`; or `UNDECIDED`; or a distance [m] within which every position is free, whatever the heading.
    """
    if not (view.x_min < x < view.x_max and view.y_min < y < view.y_max):
        return COLLISION
    if len(view.children) == 0:
        return UNDECIDED
    return certify_disc(view, x, y, view.outer + room, view.inner + room)


@njit(cache=True)
def certify_disc(view: MapView, x: float, y: float, outer: float, inner: float) -> float:
    """What the map knows about a shape that lies in one disc and holds another about the same centre.

    Args:
        view: the map, which must not be empty.
        x: the centre, inside the bounds [m].
        y: the centre [m].
        outer: radius of the disc that holds the shape [m].
        inner: radius of the disc that the shape holds [m].

    Returns:
        `COLLISION`; or `UNDECIDED`; or a distance [m] that the shape may be moved by.
    """
    cell, _, _, _ = find_leaf(view, x, y)
    dx, dy, clearance = x - view.clearances[cell, 0], y - view.clearances[cell, 1], view.clearances[cell, 2]
    distance = math.sqrt(dx * dx + dy * dy) + CERTIFICATE_MARGIN
    if clearance - outer - distance > 0.0:
        return clearance - outer - distance
    if inner - clearance - distance > 0.0:
        return COLLISION
    return UNDECIDED


@njit(cache=True)
def certify_pose(view: MapView, x: float, y: float, theta: float, room: float) -> tuple[float, bool]:
    """What the map knows about a pose.

    Args:
        view: the map.
        x: position [m].
        y: position [m].
        theta: heading [rad].
        room: see :func:`certify`.

    Returns:
        `COLLISION`, `UNDECIDED` or a distance [m] that no point of the footprint may move further than, to be free;
        and whether it is one for the origin alone, whatever the heading.
    """
    margin = certify(view, x, y, room)
    if margin != UNDECIDED or view.is_round or len(view.children) == 0:
        return margin, True
    margin, _, _, _ = certify_parts(view, x, y, theta, room)
    return margin, False


@njit(cache=True)
def certify_parts(view: MapView, x: float, y: float, theta: float, room: float) -> tuple[float, int, float, float]:
    """What the map knows about the parts of a footprint, coarse ones first.

    Args:
        view: the map, which must not be empty.
        x: position [m].
        y: position [m].
        theta: heading [rad].
        room: see :func:`certify`.

    Returns:
        See :func:`certify_pose`; and where it is `UNDECIDED` the smallest part that could not be decided, the first row
        of its disc and its centre [m].
    """
    s, c = sine_cosine(theta)
    margin, row = min(x - view.x_min, view.x_max - x, y - view.y_min, view.y_max - y), 0  # the origin stays inside
    discs = view.clearances
    while row < view.root:
        dx, dy, outer, inner = discs[row, 0], discs[row, 1], discs[row, 2], discs[row + 1, 0]
        x_disc, y_disc = x + c * dx - s * dy, y + s * dx + c * dy
        found = UNDECIDED
        if view.x_min < x_disc < view.x_max and view.y_min < y_disc < view.y_max:
            found = certify_disc(view, x_disc, y_disc, outer + room, inner + room)
        after = int(discs[row + 1, 1])
        if found == COLLISION:
            return COLLISION, row, x_disc, y_disc
        has_parts = after > row + 2
        if found >= GOOD_MARGIN or (found != UNDECIDED and not has_parts):
            margin = min(margin, found)
            row = after
        elif has_parts:
            row += 2
        else:
            return UNDECIDED, row, x_disc, y_disc
    return margin, row, x, y


class ClearanceMap:
    """Decides states for one footprint in one world: by certificate where possible, else by FCL.

    The map grows where it is asked, never beyond `MAX_CELLS`; its answers are FCL's whatever it holds. It serves one
    thread at a time, and shares no FCL object that is moved with any other map.

    Attributes:
        checker: the FCL queries behind the map.
        children: see :class:`MapView`; replaced when the map grows.
        clearances: see :class:`MapView`; replaced when the map grows.
        frame: the other numbers of the view, shape (FRAME_SIZE,).
        findings: what was found about the present motion, see `recall`, shape (n, 2).
        exact_queries: states that FCL had to decide with the real footprint.
    """

    def __init__(self, world: World, footprint: Footprint, *, enabled: bool = True) -> None:
        """Start with the root cell alone.

        Args:
            world: bounds and obstacles.
            footprint: the robot's area.
            enabled: False leaves the map empty, so that FCL decides every state inside the bounds.
        """
        self.checker = CollisionChecker(world, footprint)
        self.enabled = enabled
        self._is_round = footprint.is_round
        self.exact_queries = 0
        self._signed_clearance = CollisionChecker(world, Footprint.point()).signed_clearance
        bounds = world.bounds
        size = max(bounds.size)
        inner = footprint.inscribed_radius + (CONTACT_TOLERANCE if footprint.is_round else 0.0)
        if footprint.inscribed_radius == 0.0 and not footprint.is_round:
            inner = -math.inf  # the origin is beside the footprint, and may well be inside an obstacle
        outer = footprint.circumscribed_radius + MITRE_LIMIT * CONTACT_TOLERANCE
        discs = disc_tree(footprint, MITRE_LIMIT * CONTACT_TOLERANCE)
        root = 2 * len(discs) if enabled else 0
        self.frame = np.array([*bounds.min, *bounds.max, size, inner, outer, footprint.is_round, root], dtype=float)
        self.findings: NDArray[np.float64] = np.zeros((256, 2))
        self._margins: dict[tuple[float, float, float], float] = {}
        self._root, self._rows = root, root + 1 if enabled else 0
        self.children: NDArray[np.int32] = np.zeros(self._rows, dtype=np.int32)
        self.clearances: NDArray[np.float64] = np.zeros((self._rows, 3))
        if enabled:
            self.clearances[0:root:2], self.clearances[1:root:2, 0] = discs[:, :3], discs[:, 3]
            self.clearances[1:root:2, 1] = 2.0 * discs[:, 4]
            self._ask_clearance(root, bounds.min[0] + 0.5 * size, bounds.min[1] + 0.5 * size)

    def adopt(self, other: ClearanceMap, added: Sequence[Obstacle]) -> None:
        """Begin with all that another map knows of the same world without some obstacles.

        A clearance is then the other map's, or the distance from an added obstacle where that is smaller: computed by
        shapely, whose rounding the margin of the certificates covers as well as FCL's.

        Args:
            other: a map of the same bounds and footprint.
            added: the obstacles that its world has not.
        """
        self._rows, self.children = other._rows, other.children.copy()
        self.clearances = other.clearances.copy()
        leaves = self._root + np.flatnonzero(self.children[self._root : self._rows] == 0)
        for obstacle in added:
            x, y, clearance = self.clearances[leaves].T
            near = distance_from_box(bounding_box(obstacle), x, y) < np.maximum(clearance, SMALLEST_CELL)
            distance = signed_distance(obstacle, x[near], y[near])
            self.clearances[leaves[near], 2] = np.minimum(clearance[near], distance)

    @property
    def view(self) -> MapView:
        """The map for a kernel, as it is now."""
        return unpack_view(self.children, self.clearances, self.frame)

    @property
    def cells(self) -> int:
        """Cells in the map."""
        return self._rows - self._root

    def collides(self, x: float, y: float, theta: float) -> bool:
        """Whether the footprint touches an obstacle or a wall at a pose [m, m, rad]: always FCL's answer.

        Where the map does not know about the position yet, it is refined on the way.
        """
        certificate = certify_packed(self.children, self.clearances, self.frame, x, y, theta, 0.0)
        if certificate == UNDECIDED and self.enabled:  # to ask FCL costs less than to refine the map for the parts
            certificate = self._refine_disc(x, y, *self.frame[6:4:-1].tolist())
        if certificate == UNDECIDED:
            self.exact_queries += 1
            return self.checker.collides(x, y, theta)
        return bool(certificate == COLLISION)

    def forget_findings(self) -> None:
        """Begin with a new motion."""
        self.findings[0] = 0.0

    def answer(self, x: float, y: float, theta: float) -> None:
        """Settle whether a pose has `ROOM`: by refining the map, else by a row of ``findings`` from FCL.

        Args:
            x: position [m].
            y: position [m].
            theta: heading [rad].
        """
        used, rows = int(self.findings[0, 0]), len(self.findings)
        self.findings[0, 1] = 0.0
        if used == rows:  # some were lost: all of them are found again, with more room
            self.findings = np.zeros((2 * rows, 2))
        elif self._refine(x, y, theta, ROOM) == UNDECIDED:
            self.exact_queries += 1
            margin = self._margin(x, y, theta) - ROOM
            if used + 1 == rows:
                self.findings = np.concatenate([self.findings, np.zeros_like(self.findings)])
            self.findings[used + 1] = margin if margin > 0.0 else COLLISION, False
            self.findings[0, 0] = used + 1

    def _margin(self, x: float, y: float, theta: float) -> float:
        """FCL's margin at a pose, 0 in collision; for a round footprint the map keeps it, in place of an older one."""
        if self._is_round and self.enabled:
            cell, _, _, _ = find_leaf_packed(self.children, self.clearances, self.frame, x, y)
            self._ask_clearance(cell, x, y)
            certificate = certify_packed(self.children, self.clearances, self.frame, x, y, theta, 0.0)
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

    def _refine(self, x: float, y: float, theta: float, room: float) -> float:
        """Split the cells at an undecided pose until it is decided, or nothing could be; the certificate then."""
        rows = -1
        while self.enabled and rows != self._rows:  # what is learnt about one disc may decide another
            rows = self._rows
            inner, outer = self.frame[5:7].tolist()
            if self._refine_disc(x, y, outer + room, inner + room) != UNDECIDED or self._is_round:
                break
            found, row, x_disc, y_disc = certify_parts_packed(
                self.children, self.clearances, self.frame, x, y, theta, room
            )
            while found == UNDECIDED:
                outer, inner = self.clearances[row, 2].item(), self.clearances[row + 1, 0].item()
                if self._refine_disc(x_disc, y_disc, outer + room, inner + room) == UNDECIDED:
                    break
                found, row, x_disc, y_disc = certify_parts_packed(
                    self.children, self.clearances, self.frame, x, y, theta, room
                )
        return certify_packed(self.children, self.clearances, self.frame, x, y, theta, room)

    def _refine_disc(self, x: float, y: float, outer: float, inner: float) -> float:
        """Split the cells at a disc until it is decided, or cannot be; the certificate then."""
        while True:
            certificate, cell, x_centre, y_centre, size = find_cell_to_split(
                self.children, self.clearances, self.frame, x, y, outer, inner
            )
            if cell < 0 or self.cells + 4 > MAX_CELLS:
                return certificate
            self._split(cell, x_centre, y_centre, 0.25 * size)

    def _split(self, cell: int, x: float, y: float, offset: float) -> None:
        """Give a leaf its four children, whose centres FCL measures."""
        first = self._rows
        if first + 4 > len(self.children):
            capacity = min(2 * len(self.children) + 64, self._root + MAX_CELLS + 4)
            self.children = np.concatenate([self.children, np.zeros(capacity - first, dtype=np.int32)])
            self.clearances = np.concatenate([self.clearances, np.zeros((capacity - first, 3))])
        left, right, below, above = x - offset, x + offset, y - offset, y + offset
        centres = (left, below), (right, below), (left, above), (right, above)
        self.clearances[first : first + 4] = [(*centre, self._signed_clearance(*centre)) for centre in centres]
        self._rows += 4
        self.children[cell] = first  # last, so that no reader ever meets a child without its clearance


class _Maps(threading.local):
    """The maps of a thread."""

    def __init__(self) -> None:
        self.of_worlds: WeakKeyDictionary[World, dict[Footprint, ClearanceMap]] = WeakKeyDictionary()


_maps = _Maps()


def clearance_map_for(world: World, footprint: Footprint) -> ClearanceMap:
    """The calling thread's map of a footprint in a world.

    It is made once, grown by every plan of the thread, and kept as long as the world and the thread.
    """
    maps = _maps.of_worlds.setdefault(world, {})
    if footprint not in maps:
        maps[footprint] = ClearanceMap(world, footprint)
    return maps[footprint]


def extend_map(before: World, world: World, footprint: Footprint) -> ClearanceMap:
    """The map of a footprint in a world that has some more obstacles than one before; it goes on from that one's map.

    Args:
        before: the world before.
        world: the same bounds; the same obstacles first, and some more.
        footprint: the robot's area.
    """
    grown = ClearanceMap(world, footprint)
    grown.adopt(clearance_map_for(before, footprint), world.obstacles[len(before.obstacles) :])
    _maps.of_worlds.setdefault(world, {})[footprint] = grown
    return grown


@njit(cache=True)
def certify_packed(
    children: NDArray[np.int32],
    clearances: NDArray[np.float64],
    frame: NDArray[np.float64],
    x: float,
    y: float,
    theta: float,
    room: float,
) -> float:
    """:func:`certify_pose` for a caller in Python, to whom arrays cost less than a named tuple."""
    return certify_pose(unpack_view(children, clearances, frame), x, y, theta, room)[0]


@njit(cache=True)
def certify_parts_packed(
    children: NDArray[np.int32],
    clearances: NDArray[np.float64],
    frame: NDArray[np.float64],
    x: float,
    y: float,
    theta: float,
    room: float,
) -> tuple[float, int, float, float]:
    """:func:`certify_parts` for a caller in Python."""
    return certify_parts(unpack_view(children, clearances, frame), x, y, theta, room)


@njit(cache=True)
def find_cell_to_split(
    children: NDArray[np.int32],
    clearances: NDArray[np.float64],
    frame: NDArray[np.float64],
    x: float,
    y: float,
    outer: float,
    inner: float,
) -> tuple[float, int, float, float, float]:
    """The cell whose children may decide a disc that is not decided yet.

    Args:
        children: this and the next two: see :func:`unpack_view`.
        clearances: see above.
        frame: see above.
        x: see :func:`certify_disc`; a centre outside the bounds is left undecided.
        y: see above.
        outer: see above.
        inner: see above.

    Returns:
        The certificate; the row of the cell, -1 where the disc is decided or no cell can decide it, since it is
        certainly cut by a surface between its two radii; and centre and side of the cell [m].
    """
    view = unpack_view(children, clearances, frame)
    if not (view.x_min < x < view.x_max and view.y_min < y < view.y_max):
        return UNDECIDED, -1, x, y, 0.0
    certificate = certify_disc(view, x, y, outer, inner)
    if certificate != UNDECIDED:
        return certificate, -1, x, y, 0.0
    cell, x_centre, y_centre, size = find_leaf(view, x, y)
    dx, dy, clearance = x - clearances[cell, 0], y - clearances[cell, 1], clearances[cell, 2]
    distance = math.sqrt(dx * dx + dy * dy)
    if size < 2.0 * SMALLEST_CELL or (inner <= clearance - distance and clearance + distance <= outer):
        return UNDECIDED, -1, x_centre, y_centre, size
    return UNDECIDED, cell, x_centre, y_centre, size


@njit(cache=True)
def find_leaf_packed(
    children: NDArray[np.int32], clearances: NDArray[np.float64], frame: NDArray[np.float64], x: float, y: float
) -> tuple[int, float, float, float]:
    """:func:`find_leaf` for a caller in Python."""
    return find_leaf(unpack_view(children, clearances, frame), x, y)
