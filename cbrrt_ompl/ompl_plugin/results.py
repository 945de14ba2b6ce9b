"""What OMPL found, in this package's terms: paths as trajectories, planner data as trees."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.errors import Problem, TrajectoryError
from cbrrt_ompl.motion.records import Records
from cbrrt_ompl.ompl_plugin.binding import ob, oc, ou
from cbrrt_ompl.ompl_plugin.propagators import TwoWheelPropagator
from cbrrt_ompl.ompl_plugin.space import check_space, read_state, write_state
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.replay import trajectory_from_controls, tree_from_controls
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.trajectory.tree import Tree


def trajectory_from_path(path: Any, scenario: Scenario) -> Trajectory:
    """A control path of OMPL's as a trajectory, to be saved, drawn and verified.

    The path is driven again by the propagator of its space information, from its first state on. Where that is a
    :class:`cbrrt_ompl.TwoWheelPropagator`, the trajectory holds the commands that the law and the limits made of the
    controls; where it is a user's own, the first two numbers of each control, taken as (v, omega).

    Args:
        path: an ``ompl.control.PathControl`` of at least one state, in a space of :func:`make_state_space`.
        scenario: what it was planned for; its robot's limits go with the trajectory.

    Returns:
        The trajectory on the integration grid, from time 0.

    Raises:
        TrajectoryError: if this is no such path, or a duration is no whole number of steps.
    """
    if not isinstance(path, oc.PathControl) or path.getStateCount() == 0:
        raise TrajectoryError(Problem("path", path, "an ompl.control.PathControl of at least one state"))
    si = path.getSpaceInformation()
    check_space(si.getStateSpace())
    step, propagator = si.getPropagationStepSize(), si.getStatePropagator()
    durations = np.array([path.getControlDuration(i) for i in range(path.getControlCount())])
    steps = np.rint(durations / step).astype(np.int64)
    if not np.allclose(steps * step, durations, rtol=0.0, atol=1e-6 * step):
        raise TrajectoryError(Problem("path", durations.tolist(), f"durations of whole steps of {step:g} s"))
    if isinstance(propagator, TwoWheelPropagator) and propagator.drives_by_model:
        model = propagator.model.copy()
        model["dt"] = step
        return trajectory_from_controls(np.array(read_state(path.getState(0))), _controls(path), steps, model)
    return _driven_again(path, steps, scenario)


def _controls(path: Any) -> NDArray[np.float64]:
    """The controls of a path, shape (n, 3)."""
    dimension = path.getSpaceInformation().getControlSpace().getDimension()
    count = path.getControlCount()
    return np.array([_control(path.getControl(i), dimension) for i in range(count)]).reshape(count, 3)


def _driven_again(path: Any, steps: NDArray[np.int64], scenario: Scenario) -> Trajectory:
    """A path step by step by its own propagator."""
    si = path.getSpaceInformation()
    state = ob.State(si.getStateSpace())
    states, commands = [read_state(path.getState(0))], []
    write_state(state, states[0])
    for edge, count in enumerate(steps.tolist()):
        control = path.getControl(edge)
        for _ in range(count):
            si.propagate(state(), control, 1, state())
            states.append(read_state(state))
            commands.append((control[0], control[1]))
    commands.append(commands[-1] if commands else (states[0].v, states[0].omega))
    t = si.getPropagationStepSize() * np.arange(len(states))
    return Trajectory(t, *np.array(states).T, *np.array(commands).T, limits=scenario.robot.limits)


def tree_from_planner(planner: Any, si: Any, model: Records) -> Tree:
    """The tree that a planner holds, with the way along every edge.

    Args:
        planner: a planner of OMPL after ``solve``.
        si: its space information.
        model: model that its controls were made for.
    """
    data = oc.PlannerData(si)
    planner.getPlannerData(data)
    n = data.numVertices()
    states = np.array([read_state(data.getVertex(i).getState()) for i in range(n)]).reshape(n, 5)
    parents = np.full(n, -1, dtype=np.int64)
    dimension = si.getControlSpace().getDimension()
    controls, steps = np.zeros((n, 3)), np.zeros(n, dtype=np.int64)
    children = ou.vectorUint()
    for parent in range(n):
        data.getEdges(parent, children)
        for child in children:
            edge = data.getEdge(parent, child)
            parents[child] = parent
            if edge.getControl() is not None:  # PDST gives none for edges that it has split
                controls[child] = _control(edge.getControl(), dimension)
                steps[child] = round(edge.getDuration() / model["dt"][0])
    return tree_from_controls(states, parents, controls, steps, model)


def _control(control: Any, dimension: int) -> tuple[float, float, float]:
    return control[0], control[1], control[2] if dimension == 3 else 0.0
