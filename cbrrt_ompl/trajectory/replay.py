"""Compiled replay of stored controls: paths as dense trajectories, tree edges as lines."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.kernels import kernel
from cbrrt_ompl.motion.control_laws import reference_pose
from cbrrt_ompl.motion.laws import raise_errors
from cbrrt_ompl.motion.model import CANDIDATES, STEERING, advance, candidate
from cbrrt_ompl.motion.records import Records
from cbrrt_ompl.problem.robot import Limits
from cbrrt_ompl.problem.settings import State
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.trajectory.tree import Tree

MAX_EDGE_POINTS = 1000
"""Steps of an edge up to which each has its point."""


def trajectory_from_controls(
    start: NDArray[np.float64], controls: NDArray[np.float64], steps: NDArray[np.int64], model: Records
) -> Trajectory:
    """Drive from a state by controls, one after the other.

    Args:
        start: (x, y, theta, v, omega), shape (5,).
        controls: a control a row, see :func:`cbrrt_ompl.motion.model.advance`, shape (n, 3).
        steps: integration steps of each control, shape (n,).
        model: model that the controls were made for.

    Returns:
        The trajectory on the integration grid, from time 0, with the limits of the model.
    """
    states, commands = replay_path(start, controls, steps, model)
    raise_errors()
    t = model["dt"][0] * np.arange(len(states))
    limits = Limits(*model["limits"][0].tolist())
    return Trajectory(t, *states.T, *commands.T, kinematic=model["jumps"][0], limits=limits)


def tree_from_controls(
    states: NDArray[np.float64],
    parents: NDArray[np.int64],
    controls: NDArray[np.float64],
    steps: NDArray[np.int64],
    model: Records,
) -> Tree:
    """A tree with the way along every edge.

    Args:
        states: state of each node, shape (n, 5).
        parents: parent of each node, -1 at a root, shape (n,).
        controls: control of the edge to each node, shape (n, 3).
        steps: integration steps of that edge, 0 at a root, shape (n,).
        model: model that the controls were made for.
    """
    return Tree(states, parents, replay_edges(states, parents, controls, steps, model))


def extension_trajectories(node: State, sample: tuple[float, float], model: Records) -> list[Trajectory]:
    """What an extension tries from a node, as if there were no obstacles and no goal.

    Args:
        node: state to extend.
        sample: position to drive towards [m].
        model: see :func:`cbrrt_ompl.motion.model.make_model`.

    Returns:
        One whole horizon for CB-RRT; for S-RRT one for each steering rate: right, straight on, left.
    """
    x, y, theta, v, omega = (float(value) for value in node)
    reference = reference_pose(x, y, theta, float(sample[0]), float(sample[1]), model["look_ahead"][0])
    controls = [
        candidate(index, (x, y, theta, v, omega), reference, model[0])[2]
        for index in range(CANDIDATES if model["law"][0] == STEERING else 1)
    ]
    steps = np.array([model["steps"][0]])
    return [
        trajectory_from_controls(np.array([x, y, theta, v, omega]), np.array([control]), steps, model)
        for control in controls
    ]


def replay_path(
    start: NDArray[np.float64], controls: NDArray[np.float64], steps: NDArray[np.int64], model: Records
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """States at every step, shape (m + 1, 5), and the command that acts from each on, shape (m + 1, 2).

    The last state has no command of its own and repeats the one before it (its own velocities where there is none).
    """
    rows = 1 + int(steps.sum())
    states, commands = np.empty((rows, 5)), np.empty((rows, 2))
    fill_path(start, controls, steps, model, states, commands)
    return states, commands


@kernel
def fill_path(
    start: NDArray[np.float64],
    controls: NDArray[np.float64],
    steps: NDArray[np.int64],
    models: Records,
    states: NDArray[np.float64],
    commands: NDArray[np.float64],
) -> None:
    """Write what :func:`replay_path` returns; a kernel that makes arrays itself takes longer to load."""
    model = models[0]
    x, y, theta, v, omega = start[0], start[1], start[2], start[3], start[4]
    v_command, omega_command = v, omega
    row = 0
    for i in range(len(steps)):
        control = (controls[i, 0], controls[i, 1], controls[i, 2])
        for _ in range(steps[i]):
            states[row, 0], states[row, 1], states[row, 2], states[row, 3], states[row, 4] = x, y, theta, v, omega
            x, y, theta, v, omega, v_command, omega_command = advance(x, y, theta, v, omega, control, model, model.dt)
            commands[row, 0], commands[row, 1] = v_command, omega_command
            row += 1
    states[row, 0], states[row, 1], states[row, 2], states[row, 3], states[row, 4] = x, y, theta, v, omega
    commands[row, 0], commands[row, 1] = v_command, omega_command


@kernel
def replay_edges(
    states: NDArray[np.float64],
    parents: NDArray[np.int64],
    controls: NDArray[np.float64],
    steps: NDArray[np.int64],
    models: Records,
) -> NDArray[np.float64]:
    """Points (x, y) along all edges, a row of NaN after each edge, shape (m, 2).

    An edge has a point a step, or evenly fewer where it has more than `MAX_EDGE_POINTS` steps.
    """
    model = models[0]
    total = 0
    for i in range(len(parents)):
        if parents[i] >= 0:
            stride = 1 + steps[i] // (MAX_EDGE_POINTS + 1)
            total += (steps[i] + stride - 1) // stride + 2
    points = np.empty((total, 2))
    row = 0
    for i in range(len(parents)):
        p = parents[i]
        if p < 0:
            continue
        x, y, theta, v, omega = states[p, 0], states[p, 1], states[p, 2], states[p, 3], states[p, 4]
        points[row, 0], points[row, 1] = x, y
        control = (controls[i, 0], controls[i, 1], controls[i, 2])
        stride = 1 + steps[i] // (MAX_EDGE_POINTS + 1)
        for step in range(1, steps[i] + 1):
            x, y, theta, v, omega, _, _ = advance(x, y, theta, v, omega, control, model, model.dt)
            if step % stride == 0 or step == steps[i]:
                row += 1
                points[row, 0], points[row, 1] = x, y
        points[row + 1, 0], points[row + 1, 1] = np.nan, np.nan
        row += 2
    return points
