"""What OMPL found, in this package's terms: paths as trajectories, planner data as trees."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.motion.model import control_dimension
from cbrrt_ompl.motion.records import Records
from cbrrt_ompl.ompl_plugin.binding import oc, ou
from cbrrt_ompl.trajectory.replay import trajectory_from_controls, tree_from_controls
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.trajectory.tree import Tree


def trajectory_from_path(path: Any, space: Any, model: Records) -> Trajectory:
    """A control path, replayed on the integration grid.

    Args:
        path: an ``ompl.control.PathControl`` of at least one state.
        space: its state space.
        model: model that its controls were made for.
    """
    count = path.getControlCount()
    controls = np.array([_control(path.getControl(i), model) for i in range(count)]).reshape(count, 3)
    durations = np.array([path.getControlDuration(i) for i in range(count)])
    steps = np.rint(durations / model["dt"][0]).astype(np.int64)
    return trajectory_from_controls(_reals(space, path.getState(0)), controls, steps, model)


def tree_from_planner(planner: Any, si: Any, space: Any, model: Records) -> Tree:
    """The tree that a planner holds, with the way along every edge.

    Args:
        planner: a planner of OMPL after ``solve``.
        si: its space information.
        space: its state space.
        model: model that its controls were made for.
    """
    data = oc.PlannerData(si)
    planner.getPlannerData(data)
    n = data.numVertices()
    states = np.array([_reals(space, data.getVertex(i).getState()) for i in range(n)]).reshape(n, 5)
    parents = np.full(n, -1, dtype=np.int64)
    controls, steps = np.zeros((n, 3)), np.zeros(n, dtype=np.int64)
    children = ou.vectorUint()
    for parent in range(n):
        data.getEdges(parent, children)
        for child in children:
            edge = data.getEdge(parent, child)
            parents[child] = parent
            if edge.getControl() is not None:  # PDST gives none for edges that it has split
                controls[child] = _control(edge.getControl(), model)
                steps[child] = round(edge.getDuration() / model["dt"][0])
    return tree_from_controls(states, parents, controls, steps, model)


def _reals(space: Any, state: Any) -> NDArray[np.float64]:
    reals = ou.vectorDouble()
    space.copyToReals(reals, state)
    return np.array(list(reals))  # (5,)


def _control(control: Any, model: Records) -> tuple[float, float, float]:
    return control[0], control[1], control[2] if control_dimension(model) == 3 else 0.0
