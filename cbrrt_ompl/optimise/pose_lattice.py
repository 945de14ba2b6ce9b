"""A cheap path over a lattice of poses, for a footprint with corners: weighted A*, compiled.

The moves are those that a differential-drive robot makes from rest to rest: straight ahead, straight back and turns on
the spot, from one of a ring of headings to another. As in hybrid A* (D. Dolgov et al., "Path planning for autonomous
vehicles in unknown semi-structured environments", International Journal of Robotics Research 29(5), 2010), poses are
exact and cells of (x, y, heading) tell which are alike: of these the cheapest goes on. In the open a robot moves as far
as its clearance proves to be free, and what is alike is wider; near obstacles the lattice is as fine as its cells.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.clearance import clearance
from cbrrt_ompl.collision.motion_check import MOTION_RESOLUTION
from cbrrt_ompl.collision.scene import Scene
from cbrrt_ompl.kernels import inner_kernel, kernel
from cbrrt_ompl.motion.kinematics import wrap_angle
from cbrrt_ompl.motion.model import GOAL_REGION, in_goal
from cbrrt_ompl.motion.records import Record, Records
from cbrrt_ompl.optimise.geodesic import heap_pop, heap_push

LATTICE_RUNNING, LATTICE_REACHED, LATTICE_EXHAUSTED, LATTICE_FULL = 0, 1, 2, 3
"""How a search stands: it may go on, a pose is in the goal region, no pose is left, or there is no room for more."""

AHEAD, BACK, LEFT, RIGHT, NO_MOVE = 0, 1, 2, 3, 4
"""Moves from one pose to the next."""

MOVES = 4
"""How many there are."""

MOST_STRIDE = 8
"""Largest factor of moves in the open."""

NODES_AT_ONCE = 8
"""Nodes that one expansion makes at most: four moves, and a turn, a straight way and a turn to the goal."""

LATTICE = np.dtype(
    [
        ("x_min", np.float64),  # lower left corner of the cells [m]
        ("y_min", np.float64),
        ("cell", np.float64),  # side of a cell [m]
        ("columns", np.int64),  # cells in a row
        ("step", np.float64),  # shortest straight move [m]
        ("room", np.float64),  # distance that poses and moves keep from everything [m]
        ("seconds", np.float64, (MOVES,)),  # a metre or a radian of each move takes, infinite where there is none
        ("begin", np.float64, (MOVES,)),  # and what it takes to begin and end one [s]
        ("greed", np.float64),  # weight of the bound of what is left
        ("to_go_cell", np.float64),  # side of a cell of the bound [m]
        ("goal", GOAL_REGION),
    ],
    align=True,
)
"""What a search does not change."""

NODE = np.dtype(
    [
        ("x", np.float64),  # position [m]
        ("y", np.float64),
        ("theta", np.float64),  # heading [rad]
        ("cost", np.float64),  # of the way there [s]
        ("clearance", np.float64),  # or a bound below it [m]
        ("key", np.int64),  # of its cell
        ("parent", np.int32),  # -1 at a root
        ("heading", np.int16),  # in the ring
        ("move", np.int8),  # that led there
    ],
    align=True,
)
"""A pose that was reached."""

SEARCH = np.dtype([("nodes", np.int64), ("queued", np.int64), ("waited", np.int64)])
"""How many nodes there are, how many wait to be expanded, and how many have been since the goal was aimed at."""


@kernel
def grow_lattice(
    scene: Scene,
    lattices: Records,
    headings: NDArray[np.float64],
    to_go: NDArray[np.float32],
    nodes: Records,
    keys: NDArray[np.float32],
    heap: NDArray[np.int32],
    table: NDArray[np.int32],
    searches: Records,
    most: int,
) -> int:
    """Expand nodes until one is in the goal region: the last one then.

    Args:
        scene: world and footprint.
        lattices: one record of type `LATTICE`, shape (1,).
        headings: the ring, increasing within a full turn, shape (h,) [rad].
        to_go: bound of the way left from each cell of a grid, shape (rows, columns) [m].
        nodes: room for records of type `NODE`, the roots among them, shape (n,).
        keys: of the heap, shape (n,) [s].
        heap: nodes that wait to be expanded, shape (n,).
        table: nodes by their cells, a power of two above n of them, shape (t,).
        searches: one record of type `SEARCH`, shape (1,).
        most: nodes to expand at most.

    Returns:
        `LATTICE_RUNNING`, `LATTICE_REACHED`, `LATTICE_EXHAUSTED` or `LATTICE_FULL`.
    """
    lattice, search = lattices[0], searches[0]
    for _ in range(most):
        if search.queued == 0:
            return LATTICE_EXHAUSTED
        if search.nodes + NODES_AT_ONCE > len(nodes):
            return LATTICE_FULL
        here = heap[0]
        search.queued = heap_pop(keys, heap, search.queued)
        node = nodes[here]
        if table[slot_of_cell(node.key, nodes, table)] != here + 1:
            continue  # a cheaper one is alike
        search.waited += 1
        if search.waited * lattice.step >= math.hypot(lattice.goal.x - node.x, lattice.goal.y - node.y):
            search.waited = 0
            if aim_at_goal(scene, lattice, here, nodes, search):
                return LATTICE_REACHED
        stride = 1
        while stride < MOST_STRIDE and 2 * stride * lattice.step <= node.clearance - lattice.room:
            stride *= 2
        for move in range(MOVES):
            if lattice.seconds[move] == math.inf:
                continue
            length, turn, heading = 0.0, 0.0, node.heading
            if move <= BACK:
                length = stride * lattice.step if move == AHEAD else -stride * lattice.step
            else:
                heading = (heading + (stride if move == LEFT else -stride)) % len(headings)
                turn = headings[heading] - node.theta
                if move == LEFT and turn < 0.0:
                    turn += 2.0 * math.pi
                if move == RIGHT and turn > 0.0:
                    turn -= 2.0 * math.pi
            x, y = node.x + length * math.cos(node.theta), node.y + length * math.sin(node.theta)
            cost = node.cost + cost_of_move(move, abs(length) + abs(turn), node.move, lattice)
            key = key_of(x, y, heading, stride, lattice, len(headings))
            slot = slot_of_cell(key, nodes, table)
            if table[slot] != 0 and nodes[table[slot] - 1].cost <= cost + 1e-6:
                continue
            distance = free_after(scene, lattice, node, length, turn)
            if distance <= 0.0:
                continue
            new = add_pose(nodes, search, here, x, y, headings[heading], cost, distance, heading, move)
            nodes[new].key = key
            table[slot] = new + 1
            if in_goal(lattice.goal, x, y, headings[heading], 0.0, 0.0):
                return LATTICE_REACHED
            left = bound_of(x, y, lattice, to_go)
            search.queued = heap_push(keys, heap, search.queued, np.float32(cost + lattice.greed * left), new)
    return LATTICE_RUNNING


@kernel
def plant_root(
    scene: Scene,
    lattices: Records,
    headings: NDArray[np.float64],
    pose: tuple[float, float, int],
    nodes: Records,
    keys: NDArray[np.float32],
    heap: NDArray[np.int32],
    table: NDArray[np.int32],
    searches: Records,
) -> None:
    """Add a pose (x, y, heading in the ring) to begin from, if it is free; see :func:`grow_lattice`."""
    lattice, search = lattices[0], searches[0]
    x, y, heading = pose
    distance = clearance_at_pose(scene, lattice, x, y, headings[heading])
    if distance <= lattice.room:
        return
    new = add_pose(nodes, search, -1, x, y, headings[heading], 0.0, distance, heading, NO_MOVE)
    nodes[new].key = key_of(x, y, heading, 1, lattice, len(headings))
    table[slot_of_cell(nodes[new].key, nodes, table)] = new + 1
    search.queued = heap_push(keys, heap, search.queued, np.float32(0.0), new)


@inner_kernel
def add_pose(
    nodes: Records,
    search: Record,
    parent: int,
    x: float,
    y: float,
    theta: float,
    cost: float,
    distance: float,
    heading: int,
    move: int,
) -> int:
    """Write a node without its key; returns its row."""
    new = search.nodes
    search.nodes += 1
    node = nodes[new]
    node.x, node.y, node.theta, node.cost, node.clearance = x, y, theta, cost, distance
    node.parent, node.heading, node.move = parent, heading, move
    return int(new)


@inner_kernel
def cost_of_move(move: int, way: float, move_before: int, lattice: Record) -> float:
    """Seconds that a move takes [m or rad], and those to begin it unless it goes on with the one before."""
    return float(lattice.seconds[move] * way + (0.0 if move == move_before else lattice.begin[move]))


@inner_kernel
def key_of(x: float, y: float, heading: int, stride: int, lattice: Record, headings: int) -> int:
    """Number of the cell of a pose that was reached by a stride."""
    column = int((x - lattice.x_min) / lattice.cell) // stride * stride
    row = int((y - lattice.y_min) / lattice.cell) // stride * stride
    return int((row * lattice.columns + column) * headings + heading)


@inner_kernel
def slot_of_cell(key: int, nodes: Records, table: NDArray[np.int32]) -> int:
    """Where a cell is in the table, or where it is to be: 0 there (open addressing)."""
    mask = len(table) - 1
    slot = ((key * 2654435761) >> 16) & mask
    while table[slot] != 0 and nodes[table[slot] - 1].key != key:
        slot = (slot + 1) & mask
    return slot


@inner_kernel
def bound_of(x: float, y: float, lattice: Record, to_go: NDArray[np.float32]) -> float:
    """Seconds that are left at least, about: the way over the grid's free cells at full speed."""
    row = min(int((y - lattice.y_min) / lattice.to_go_cell), to_go.shape[0] - 1)
    column = min(int((x - lattice.x_min) / lattice.to_go_cell), to_go.shape[1] - 1)
    return float(to_go[row, column] * min(lattice.seconds[AHEAD], lattice.seconds[BACK]))


@inner_kernel
def clearance_at_pose(scene: Scene, lattice: Record, x: float, y: float, theta: float) -> float:
    """Distance of the footprint from everything, or a bound below it that allows for the longest moves [m]."""
    return float(clearance(scene, x, y, theta, lattice.room + MOST_STRIDE * lattice.step)[0])


@inner_kernel
def free_after(scene: Scene, lattice: Record, node: Record, length: float, turn: float) -> float:
    """Clearance after a straight way [m] or a turn [rad] from a node; 0 where that is not free.

    The end is looked at first, and then what neither end proves: poses of which each proves the way to the next, as the
    motion check does (:mod:`cbrrt_ompl.collision.motion_check`).
    """
    c, s = math.cos(node.theta), math.sin(node.theta)
    at_end = clearance_at_pose(scene, lattice, node.x + length * c, node.y + length * s, node.theta + turn)
    if at_end <= lattice.room:
        return 0.0
    way = abs(length) + scene.frame[0].reach * abs(turn)
    done = max(node.clearance - lattice.room, MOTION_RESOLUTION)
    while done < way - (at_end - lattice.room):
        part = done / way
        x, y = node.x + part * length * c, node.y + part * length * s
        distance = clearance_at_pose(scene, lattice, x, y, node.theta + part * turn)
        if distance <= lattice.room:
            return 0.0
        done += max(distance - lattice.room, MOTION_RESOLUTION)
    return float(at_end)


@inner_kernel
def aim_at_goal(scene: Scene, lattice: Record, here: int, nodes: Records, search: Record) -> bool:
    """Add a turn to the goal's centre, the straight way there and a turn to its heading, if they are free."""
    goal, begin = lattice.goal, search.nodes
    dx, dy = goal.x - nodes[here].x, goal.y - nodes[here].y
    distance = math.sqrt(dx * dx + dy * dy)
    for gear in (AHEAD, BACK):
        if lattice.seconds[gear] == math.inf:
            continue
        theta = math.atan2(dy, dx) if gear == AHEAD else math.atan2(-dy, -dx)
        if distance < 1e-9:
            theta = nodes[here].theta
        last = add_turn(scene, lattice, here, theta, nodes, search)
        if last >= 0 and distance >= 1e-9:
            length = distance if gear == AHEAD else -distance
            room = free_after(scene, lattice, nodes[last], length, 0.0)
            last = add_pose(nodes, search, last, goal.x, goal.y, theta, 0.0, room, 0, gear) if room > 0.0 else -1
        if last >= 0 and goal.heading_tolerance < math.inf:
            last = add_turn(scene, lattice, last, goal.theta, nodes, search)
        if last >= 0:
            return True
        search.nodes = begin
    return False


@inner_kernel
def add_turn(scene: Scene, lattice: Record, here: int, theta: float, nodes: Records, search: Record) -> int:
    """Add a turn on the spot from a node to a heading [rad]; returns the new node, -1 where that is not free."""
    turn = wrap_angle(theta - nodes[here].theta)
    if abs(turn) < 1e-9:
        return here
    move = LEFT if turn > 0.0 else RIGHT
    if lattice.seconds[move] == math.inf:
        move = LEFT + RIGHT - move
        turn += 2.0 * math.pi if move == LEFT else -2.0 * math.pi
    room = free_after(scene, lattice, nodes[here], 0.0, turn)
    if room <= 0.0:
        return -1
    return add_pose(nodes, search, here, nodes[here].x, nodes[here].y, theta, 0.0, room, 0, move)
