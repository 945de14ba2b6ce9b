"""Directed control samplers: a whole extension of CB-RRT or S-RRT behind one call of OMPL's control::RRT."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cbrrt_ompl.collision.clearance_map import ClearanceMap, unpack_view
from cbrrt_ompl.collision.motion_check import ASK
from cbrrt_ompl.motion.model import control_dimension, unpack_model
from cbrrt_ompl.ompl_plugin.binding import oc
from cbrrt_ompl.ompl_plugin.reals import StateReals
from cbrrt_ompl.ompl_plugin.space import STATE_DIMENSION
from cbrrt_ompl.planners.extension import EXTENDED, NO_CHILD, REFUSED, UNTRIED, extend
from cbrrt_ompl.planners.roll_out import SCRATCH_SHAPE


class ExtensionSampler(oc.DirectedControlSampler):  # type: ignore[misc]  # OMPL has no type information
    """Extends a node of control::RRT towards a sample, by Algorithm II of the paper.

    Contract with OMPL: ``source`` is the node and is only read; ``dest`` holds the sample and, where the extension
    succeeds, takes the state at its end; ``control`` takes the control. The result is the number of propagation steps,
    or 0 where nothing is to be added. The way is checked for collision here and nowhere else; it ends early at the
    first state in the goal region. OMPL makes one sampler a tree, so the sampler remembers the children of its nodes.

    Attributes:
        should_stop: asked with the samples so far whenever FCL has to be; an extension that it ends adds nothing.
        samples: calls so far.
        refused: calls refused by line 5 of Algorithm II.
        children: nodes made so far.
    """

    def __init__(self, si: Any, space: Any, model: NDArray[np.float64], clearance_map: ClearanceMap) -> None:
        """Make the buffers.

        Args:
            si: the space information that allocates this sampler.
            space: its state space. (References to ``si`` itself would make a cycle that Python cannot see.)
            model: packed model, see :func:`cbrrt_ompl.motion.model.pack_model`.
            clearance_map: decides the states.
        """
        super().__init__(si)
        self.should_stop: Callable[[int], bool] = lambda _: False
        self.samples = 0
        self.refused = 0
        self._node, self._sample = StateReals(space, STATE_DIMENSION), StateReals(space, STATE_DIMENSION)
        self._model, self._map = model, clearance_map
        self._control_dimension = control_dimension(model)
        self._outcome = np.empty(OUTCOME_SIZE)
        self._scratch = np.empty(SCRATCH_SHAPE)
        self._first_child: dict[bytes, int] = {}
        self._following: NDArray[np.int32] = np.empty(64, dtype=np.int32)
        self._commands: NDArray[np.float64] = np.empty((64, 2))
        self.children = 0

    def sampleTo(self, control: Any, *states: Any) -> int:  # noqa: N802  # OMPL's name
        """Extend ``states[-2]`` towards ``states[-1]``; OMPL may pass the node's control before them."""
        source, dest = states[-2:]
        self.samples += 1
        self._node.read(source)
        self._sample.read(dest)
        node = self._node.values.tobytes()
        first = self._first_child.setdefault(node, UNTRIED)
        self._map.forget_findings()
        status = self._extend(first)
        if status == ASK:
            status = self._ask_and_extend(first)
        if first == UNTRIED:
            self._first_child[node] = NO_CHILD
        if status != EXTENDED:
            self.refused += status == REFUSED
            return 0
        outcome = self._outcome.tolist()
        self._remember(node, outcome[1], outcome[2])
        for i in range(self._control_dimension):
            control[i] = outcome[3 + i]
        self._sample.write(dest)
        return int(outcome[0])

    def _extend(self, first: int) -> int:
        """Run the kernel on the present node and sample."""
        m = self._map
        return extend_packed(
            self._node.values,
            self._sample.values,
            first,
            self._following,
            self._commands,
            self._model,
            m.children,
            m.clearances,
            m.frame,
            m.findings,
            self._outcome,
            self._scratch,
        )

    def _ask_and_extend(self, first: int) -> int:
        """Answer the kernel's questions by FCL until it has none, or the search is to stop."""
        status = ASK
        while status == ASK and not self.should_stop(self.samples):
            x, y, theta = self._outcome[3:6].tolist()
            self._map.answer(x, y, theta)
            status = self._extend(first)
        return status

    def _remember(self, node: bytes, v: float, omega: float) -> None:
        """Note the command of a new child, for line 5 of Algorithm II."""
        child = self.children
        if child == len(self._following):
            self._following = np.concatenate([self._following, np.empty_like(self._following)])
            self._commands = np.concatenate([self._commands, np.empty_like(self._commands)])
        self._following[child] = self._first_child[node]
        self._commands[child] = v, omega
        self._first_child[node] = child
        self.children = child + 1


class KanayamaDirectedControlSampler(ExtensionSampler):
    """CB-RRT: the Kanayama law under acceleration limits, once an extension or in closed loop (as the model says)."""


class SteeringDirectedControlSampler(ExtensionSampler):
    """S-RRT: full speed at the best of three steering rates."""


OUTCOME_SIZE = 6
"""Numbers of an outcome: steps, command (2), control or pose in question (3)."""


@njit(cache=True)
def extend_packed(
    node: NDArray[np.float64],
    sample: NDArray[np.float64],
    first: int,
    following: NDArray[np.int32],
    commands: NDArray[np.float64],
    model: NDArray[np.float64],
    children: NDArray[np.int32],
    clearances: NDArray[np.float64],
    frame: NDArray[np.float64],
    findings: NDArray[np.float64],
    outcome: NDArray[np.float64],
    scratch: NDArray[np.float64],
) -> int:
    """:func:`extend` for a caller in Python: flat arrays in, outcome and last state out."""
    extension = extend(
        (node[0], node[1], node[2], node[3], node[4]),
        sample[0],
        sample[1],
        first,
        following,
        commands,
        unpack_model(model),
        unpack_view(children, clearances, frame),
        findings,
        scratch,
    )
    outcome[0] = extension.steps
    outcome[1], outcome[2] = extension.command
    outcome[3], outcome[4], outcome[5] = extension.control
    if extension.outcome == EXTENDED:
        sample[0], sample[1], sample[2], sample[3], sample[4] = extension.state
    return extension.outcome


def warm_up_sampler(model: NDArray[np.float64], clearance_map: ClearanceMap) -> None:
    """Load or compile the samplers' kernel."""
    extend_packed(
        np.array([0.5, 0.5, 0.0, 0.0, 0.0]),
        np.array([0.6, 0.6, 0.0, 0.0, 0.0]),
        NO_CHILD,
        np.empty(1, dtype=np.int32),
        np.empty((1, 2)),
        model,
        clearance_map.children,
        clearance_map.clearances,
        clearance_map.frame,
        clearance_map.findings,
        np.empty(OUTCOME_SIZE),
        np.empty(SCRATCH_SHAPE),
    )
