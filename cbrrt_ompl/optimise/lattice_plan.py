"""A plan over a state lattice: straight ways and turns on the spot, each from rest to rest.

A state lattice (M. Pivtoraiko, R. Knepper and A. Kelly, "Differentially constrained mobile robot motion planning in
state lattices", Journal of Field Robotics 26(3), 2009) finds what samples rarely do: the few moves that lead a
footprint with corners into a gap hardly longer than itself. Two searches take turns, one from the start and one,
backwards in time, from the goal: the one that begins in the tighter place ends soon.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import groupby, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.motion_check import MOTION_RESOLUTION
from cbrrt_ompl.kernels import kernel
from cbrrt_ompl.motion.kinematics import axis_limits, brake, decelerations, dynamic_step, kinematic_step
from cbrrt_ompl.motion.manoeuvres import FORWARD, REACHED, REVERSE, approach_command, most_steps
from cbrrt_ompl.motion.records import record_array
from cbrrt_ompl.optimise.clearance import is_motion_free, least_clearance, unsafe_rows
from cbrrt_ompl.optimise.geodesic import ways_to
from cbrrt_ompl.optimise.guess import Guess, guess_at_full_speed
from cbrrt_ompl.optimise.guesses import LEAST_ROOM, cell_side, cells_of
from cbrrt_ompl.optimise.pose_lattice import (
    AHEAD,
    BACK,
    LATTICE,
    LATTICE_EXHAUSTED,
    LATTICE_REACHED,
    LATTICE_RUNNING,
    LEFT,
    MOVES,
    NODE,
    RIGHT,
    SEARCH,
    grow_lattice,
    plant_root,
)
from cbrrt_ompl.problem.robot import Limits
from cbrrt_ompl.problem.settings import MAX_STEPS, Goal, State
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory

STATE_LATTICE = "state lattice"
"""What a plan over one goes by."""

HEADINGS = 32
"""Headings of the coarsest lattice, evenly; those of the start and of the goal come on top."""

FINEST = 8
"""How much finer cells and headings may become: twice as fine where there are no more poses."""

CELLS_A_RADIUS = 8.0
"""Cells of the coarsest lattice along the circumscribed radius of the footprint, as far as their side may be that."""

LARGEST_CELL, SMALLEST_CELL = 0.1, 0.01
"""Range of the side of a cell [m]."""

MOST_NODES = 400_000
"""Nodes of a search at most: 24 MB."""

GREED = 2.0
"""Weight of the bound of what is left: a path may cost about so many times as much as the cheapest one."""

BEGIN = 0.3
"""What a move costs to begin, in terms of the time that it loses to a start and a stop at full acceleration."""

NODES_AT_ONCE = 2000
"""Nodes that are expanded between two looks at the clock."""

MORE_THAN_SHORTEST = 1.5
"""Ways that are so many times as long as that from the start are not told apart."""

TURN_AT_ONCE = 0.5 * math.pi
"""Largest turn on the spot that is driven as one [rad]."""


OPPOSITES = [BACK, AHEAD, RIGHT, LEFT]
"""The moves that undo others."""


class Pose(NamedTuple):
    """Where a robot is."""

    x: float
    y: float
    theta: float


class Corner(NamedTuple):
    """A pose in which the robot rests, and the move that leads there."""

    x: float
    y: float
    theta: float
    move: int


def lattice_plan(
    scenario: Scenario,
    should_stop: Callable[[], bool],
    *,
    is_kinematic: bool = False,
    most_nodes: int = MOST_NODES,
) -> Trajectory | None:
    """A trajectory of straight ways and turns on the spot from the start into the goal region.

    Args:
        scenario: world, robot, start and goal.
        should_stop: asked every few milliseconds whether to give up.
        is_kinematic: whether the velocities jump.
        most_nodes: of a search, at most.

    Returns:
        The trajectory, free as the planners check it; None where the lattice has no path, or none within so many nodes.
    """
    limits, step = scenario.robot.limits, scenario.planning.step
    braking = np.array([scenario.start]) if is_kinematic else brake(*scenario.start, limits, step, MAX_STEPS)
    start = State(*braking[-1].tolist())
    corners = lattice_path(scenario, Pose(*start[:3]), should_stop, most_nodes)
    if corners is None:
        return None
    aims = np.array(corners, dtype=float).reshape(-1, 4)
    states = np.concatenate([braking[:-1], drive(braking[-1], aims, limits, step, is_kinematic)])
    if scenario.goal.violations(State(*states[-1].tolist())):
        return None
    if not is_motion_free(states, step, scenario, is_kinematic=is_kinematic):
        return None
    if scenario.planning.brake_safe and not is_kinematic and unsafe_rows(states, scenario).any():
        return None
    commands = np.concatenate([states[1:, 3:], states[-1:, 3:]])
    t: NDArray[np.float64] = step * np.arange(len(states), dtype=float)
    return Trajectory(t, *states.T, *commands.T, kinematic=is_kinematic, limits=limits)


def full_speed_guess(trajectory: Trajectory, limits: Limits) -> Guess:
    """The guess that a plan over the lattice is without its stops."""
    return guess_at_full_speed(trajectory, limits, f"{STATE_LATTICE} at full speed")


def lattice_path(
    scenario: Scenario, start: Pose, should_stop: Callable[[], bool], most_nodes: int
) -> list[Corner] | None:
    """Corners of a cheap path from a pose into the goal region, without that pose itself; None where there is none."""
    searches = {way: LatticeSearch(scenario, start, most_nodes, is_backwards=way) for way in (False, True)}
    while searches:
        for is_backwards, search in list(searches.items()):
            if should_stop():
                return None
            status = search.run(NODES_AT_ONCE)
            if status == LATTICE_REACHED:
                return merged(start.theta, search.corners())
            if status == LATTICE_EXHAUSTED and search.fineness < FINEST:
                searches[is_backwards] = search.finer()
            elif status != LATTICE_RUNNING:
                del searches[is_backwards]
    return None


class LatticeSearch:
    """One search over the lattice.

    Attributes:
        fineness: how much finer the lattice is than the coarsest one.
    """

    def __init__(
        self, scenario: Scenario, start: Pose, most_nodes: int, *, is_backwards: bool, fineness: int = 1
    ) -> None:
        """Plant the roots.

        Args:
            scenario: world, robot and goal.
            start: where the robot rests.
            most_nodes: nodes at most.
            is_backwards: whether time runs backwards: from the goal's centre to the start, by the opposites of moves.
            fineness: see above.
        """
        self.fineness, self._scenario, self._start, self._is_backwards = fineness, scenario, start, is_backwards
        footprint, bounds, goal = scenario.robot.footprint, scenario.world.bounds, scenario.goal
        self._scene = scenario.world.scene(footprint)
        self._headings = ring_of(HEADINGS * fineness, [start.theta, goal.theta])
        cell = min(max(footprint.circumscribed_radius / CELLS_A_RADIUS, SMALLEST_CELL), LARGEST_CELL) / fineness
        self._lattice = record_array(1, LATTICE)
        lattice = self._lattice[0]
        lattice["x_min"], lattice["y_min"] = bounds.min
        lattice["cell"], lattice["columns"] = cell, math.ceil(bounds.size[0] / cell)
        lattice["step"], lattice["greed"] = math.sqrt(2.0) * cell, GREED
        lattice["room"] = least_clearance(scenario) + 0.5 * MOTION_RESOLUTION
        order = OPPOSITES if is_backwards else list(range(MOVES))
        lattice["seconds"], lattice["begin"] = costs_of_moves(scenario.robot.limits)[:, order]
        lattice["goal"] = region_of(Goal(*start[:2], REACHED, start.theta, REACHED) if is_backwards else goal)
        lattice["to_go_cell"], self._to_go = ways_left(scenario, is_backwards=is_backwards)
        self._nodes, self._search = record_array(most_nodes, NODE), record_array(1, SEARCH)
        self._keys, self._heap = np.empty(most_nodes, dtype=np.float32), np.empty(most_nodes, dtype=np.int32)
        self._table = np.zeros(1 << (2 * most_nodes - 1).bit_length(), dtype=np.int32)
        x, y, theta = (goal.x, goal.y, goal.theta) if is_backwards else start
        for heading in range(len(self._headings)) if theta is None else [nearest_heading(self._headings, theta)]:
            plant_root(
                self._scene,
                self._lattice,
                self._headings,
                (x, y, heading),
                self._nodes,
                self._keys,
                self._heap,
                self._table,
                self._search,
            )

    def finer(self) -> LatticeSearch:
        """The same search over a lattice twice as fine, from its beginning."""
        most, way = len(self._nodes), self._is_backwards
        return LatticeSearch(self._scenario, self._start, most, is_backwards=way, fineness=2 * self.fineness)

    def run(self, most: int) -> int:
        """Expand some nodes; see :func:`cbrrt_ompl.optimise.pose_lattice.grow_lattice`."""
        status: int = grow_lattice(
            self._scene,
            self._lattice,
            self._headings,
            self._to_go,
            self._nodes,
            self._keys,
            self._heap,
            self._table,
            self._search,
            most,
        )
        return status

    def corners(self) -> list[Corner]:
        """The way that was found, as time runs."""
        node, rows = int(self._search["nodes"][0]) - 1, []
        while node >= 0:
            x, y, theta, move = (self._nodes[name][node].item() for name in ("x", "y", "theta", "move"))
            rows.append(Corner(x, y, theta, move))
            node = int(self._nodes["parent"][node])
        if not self._is_backwards:
            return rows[-2::-1]
        return [after._replace(move=OPPOSITES[before.move]) for before, after in pairwise(rows)]


def ring_of(count: int, thetas: list[float | None]) -> NDArray[np.float64]:
    """Headings of a lattice, some given ones among them, increasing within a full turn, shape (h,) [rad].

    Args:
        count: of the others, evenly, but for those that are next to a given one.
        thetas: given ones, where they are not None [rad].
    """
    given = np.unique([math.remainder(theta, math.tau) for theta in thetas if theta is not None])
    spacing = math.tau / count
    even: NDArray[np.float64] = spacing * np.arange(-count // 2, count // 2, dtype=float)
    return np.sort(np.concatenate([even[turns_between(even[:, None], given).min(axis=1) > 0.25 * spacing], given]))


def nearest_heading(ring: NDArray[np.float64], theta: float) -> int:
    """The place in a ring of the heading nearest to some other one."""
    return int(np.argmin(turns_between(ring, np.array(theta))))


def turns_between(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angles between headings, 0 to pi [rad]."""
    return np.abs(np.mod(one - other + math.pi, math.tau) - math.pi)


def costs_of_moves(limits: Limits) -> NDArray[np.float64]:
    """Seconds a metre or a radian of each move, infinite where there is none, and seconds to begin it, shape (2, 4)."""
    within = axis_limits(limits)
    slower, turns_slower = decelerations(within)
    top = np.array([within.v_max, -within.v_min, within.omega_max, -within.omega_min])
    rates = np.array([1.0 / within.acceleration + 1.0 / slower, 1.0 / within.angular_acceleration + 1.0 / turns_slower])
    with np.errstate(divide="ignore"):
        return np.stack([1.0 / np.maximum(top, 0.0), BEGIN * 0.5 * top * np.repeat(rates, 2)])


def region_of(goal: Goal) -> tuple[float, ...]:
    """A goal region as a record of type :data:`cbrrt_ompl.motion.model.GOAL_REGION`, to end in at rest."""
    tolerance = max(goal.tolerance - 2.0 * REACHED, 0.5 * goal.tolerance)  # motions end within REACHED of a pose
    if goal.theta is None:
        return goal.x, goal.y, tolerance, 0.0, math.inf, math.inf
    return goal.x, goal.y, tolerance, goal.theta, max(goal.heading_tolerance - 2.0 * REACHED, 0.0), math.inf


def ways_left(scenario: Scenario, *, is_backwards: bool) -> tuple[float, NDArray[np.float32]]:
    """Bound of the way of the robot's origin that is left from each cell of a grid: side of a cell, and the ways [m].

    Args:
        scenario: world, robot, start and goal.
        is_backwards: whether it is the way to the start instead of the goal.
    """
    bounds, radius = scenario.world.bounds, scenario.robot.footprint.inscribed_radius + least_clearance(scenario)
    cell = cell_side(bounds, radius)
    inner = max(radius - 0.5 * cell, LEAST_ROOM * cell)
    costs, (start, goal) = cells_of(scenario, cell, inner, inner)
    end, begin = (start, goal) if is_backwards else (goal, start)
    rows, columns = costs.shape
    ways = ways_to(costs.ravel(), columns, end, begin, MORE_THAN_SHORTEST).reshape(rows, columns)
    if np.isinf(ways.flat[begin]):  # the grid is too coarse for it
        ways = np.hypot(np.arange(columns) - end % columns, np.arange(rows)[:, None] - end // columns)
    ways[np.isinf(ways)] = ways[np.isfinite(ways)].max()
    return cell, (cell * ways).astype(np.float32)


def merged(theta: float, corners: list[Corner]) -> list[Corner]:
    """The corners at which the move changes, and those that divide long turns.

    Args:
        theta: heading before the first move [rad].
        corners: of single moves.
    """
    found = list[Corner]()
    for move, group in groupby(corners, lambda corner: corner.move):
        last, turn, sign = found[-1] if found else None, 0.0, 1.0 if move == LEFT else -1.0
        before = theta if last is None else last.theta
        for corner in group:
            turn += math.fmod(sign * (corner.theta - before) + 2.0 * math.tau, math.tau)
            before, last = corner.theta, corner
        assert last is not None
        parts = math.ceil(turn / TURN_AT_ONCE - 1e-9) if move in (LEFT, RIGHT) else 1
        found += [last._replace(theta=last.theta - sign * turn * left / parts) for left in range(parts - 1, -1, -1)]
    return found


@kernel
def drive(
    begin: NDArray[np.float64], aims: NDArray[np.float64], limits: Limits, dt: float, is_kinematic: bool
) -> NDArray[np.float64]:
    """States a step apart of a robot that moves from one aim to the next, at rest in each, shape (n, 5).

    Args:
        begin: state at rest, shape (5,).
        aims: rows of (x, y, theta, move), shape (m, 4).
        limits: of the robot.
        dt: duration of a step [s].
        is_kinematic: whether the velocities jump.
    """
    states: NDArray[np.float64] = np.empty((256, 5))
    x, y, theta, v, omega = begin[0], begin[1], begin[2], begin[3], begin[4]
    states[0, 0], states[0, 1], states[0, 2], states[0, 3], states[0, 4] = x, y, theta, v, omega
    count = 1
    for i in range(len(aims)):
        aim, is_reverse = (aims[i, 0], aims[i, 1], aims[i, 2]), aims[i, 3] == BACK
        left = most_steps(REVERSE if is_reverse else FORWARD, math.hypot(aim[0] - x, aim[1] - y), limits, dt)
        while left > 0:
            left -= 1
            command = approach_command((x, y, theta, v, omega), aim, True, is_reverse, is_kinematic, limits, dt)
            if command[0] == 0.0 and command[1] == 0.0 and v == 0.0 and omega == 0.0:
                break
            if is_kinematic:
                x, y, theta, v, omega = kinematic_step(x, y, theta, command, dt)
            else:
                x, y, theta, v, omega = dynamic_step(x, y, theta, v, omega, command, limits, dt)
            if count == len(states):
                states = np.concatenate((states, np.empty_like(states)))
            row = states[count]
            row[0], row[1], row[2], row[3], row[4] = x, y, theta, v, omega
            count += 1
    return states[:count].copy()
