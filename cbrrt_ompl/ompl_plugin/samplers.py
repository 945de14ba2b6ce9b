"""Directed control samplers: a whole extension of CB-RRT or S-RRT behind one call of OMPL's control::RRT."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cbrrt_ompl.collision.scene import Scene
from cbrrt_ompl.motion.model import control_dimension
from cbrrt_ompl.motion.records import Records, record_array
from cbrrt_ompl.ompl_plugin.binding import oc
from cbrrt_ompl.ompl_plugin.reals import StateReals
from cbrrt_ompl.ompl_plugin.space import STATE_DIMENSION
from cbrrt_ompl.planners.extension import CHILD, EXTENDED, NO_CHILD, REFUSED, UNTRIED, extend
from cbrrt_ompl.planners.roll_out import STEPS, margin_at

EXTENSION = np.dtype(
    [
        ("steps", np.int64),  # integration steps
        ("v_command", np.float64),  # that line 5 compares [m/s, rad/s]
        ("omega_command", np.float64),
        ("control", np.float64, (3,)),  # see advance of the model
        ("block", STEPS),  # room for the kernel
    ],
    align=True,
)
"""What a kernel hands to a sampler in Python."""


class ExtensionSampler(oc.DirectedControlSampler):  # type: ignore[misc]  # OMPL has no type information
    """Extends a node of control::RRT towards a sample, by Algorithm II of the paper.

    Contract with OMPL: ``source`` is the node and is only read; ``dest`` holds the sample and, where the extension
    succeeds, takes the state at its end; ``control`` takes the control. The result is the number of propagation steps,
    or 0 where nothing is to be added. The way is checked for collision here and nowhere else; it ends early at the
    first state in the goal region. OMPL makes one sampler a tree, so the sampler remembers the children of its nodes.

    Attributes:
        samples: calls so far.
        refused: calls refused by line 5 of Algorithm II.
        children: nodes made so far.
    """

    def __init__(self, si: Any, space: Any, model: Records, scene: Scene) -> None:
        """Make the buffers.

        Args:
            si: the space information that allocates this sampler.
            space: its state space. (References to ``si`` itself would make a cycle that Python cannot see.)
            model: see :func:`cbrrt_ompl.motion.model.make_model`.
            scene: world and footprint, see :meth:`cbrrt_ompl.World.scene`.
        """
        super().__init__(si)
        self.samples = 0
        self.refused = 0
        self._node, self._sample = StateReals(space, STATE_DIMENSION), StateReals(space, STATE_DIMENSION)
        self._model, self._scene = model, scene
        self._control_dimension = control_dimension(model)
        self._extension = record_array(1, EXTENSION)
        self._first_child: dict[bytes, int] = {}
        self._children = record_array(64, CHILD)
        self.children = 0

    def sampleTo(self, control: Any, *states: Any) -> int:  # noqa: N802  # OMPL's name
        """Extend ``states[-2]`` towards ``states[-1]``; OMPL may pass the node's control before them."""
        source, dest = states[-2:]
        self.samples += 1
        self._node.read(source)
        self._sample.read(dest)
        node = self._node.values.tobytes()
        first_child = self._first_child.setdefault(node, UNTRIED)
        outcome = extend_values(
            self._node.values,
            self._sample.values,
            first_child,
            self._children,
            *self._scene,
            self._model,
            self._extension,
        )
        if first_child == UNTRIED:
            self._first_child[node] = NO_CHILD
        if outcome != EXTENDED:
            self.refused += outcome == REFUSED
            return 0
        steps, v, omega, controls, _ = self._extension[0]
        self._remember(node, v, omega)
        for i in range(self._control_dimension):
            control[i] = float(controls[i])
        self._sample.write(dest)
        return int(steps)

    def _remember(self, node: bytes, v: float, omega: float) -> None:
        """Note the command of a new child, for line 5 of Algorithm II."""
        child = self.children
        if child == len(self._children):
            larger = record_array(2 * child, CHILD)
            larger[:child] = self._children
            self._children = larger
        self._children[child] = v, omega, self._first_child[node], 0
        self._first_child[node] = child
        self.children = child + 1


class KanayamaDirectedControlSampler(ExtensionSampler):
    """CB-RRT: the Kanayama law under acceleration limits, once an extension or in closed loop (as the model says)."""


class SteeringDirectedControlSampler(ExtensionSampler):
    """S-RRT: full speed at the best of three steering rates."""


@njit(cache=True)
def extend_values(
    node: NDArray[np.float64],
    sample: NDArray[np.float64],
    first_child: int,
    children: Records,
    frame: Records,
    cells: Records,
    pieces: Records,
    corners: Records,
    models: Records,
    extensions: Records,
) -> int:
    """:func:`extend` for a caller in Python: arrays in; the outcome, the end in ``sample`` and a record out."""
    scene, model, found = Scene(frame, cells, pieces, corners), models[0], extensions[0]
    state = (node[0], node[1], node[2], node[3], node[4])
    margin = margin_at(node[0], node[1], node[2], scene, model.room)
    extension = extend(state, margin, (sample[0], sample[1]), first_child, children, scene, model, found.block)
    found.steps = extension.steps
    found.v_command, found.omega_command = extension.command
    found.control[0], found.control[1], found.control[2] = extension.control
    if extension.outcome == EXTENDED:
        sample[0], sample[1], sample[2], sample[3], sample[4] = extension.state
    return extension.outcome


def warm_up_sampler(model: Records, scene: Scene) -> None:
    """Load or compile the samplers' kernel."""
    node, sample = np.array([0.5, 0.5, 0.0, 0.0, 0.0]), np.array([0.6, 0.6, 0.0, 0.0, 0.0])
    extend_values(node, sample, NO_CHILD, record_array(1, CHILD), *scene, model, record_array(1, EXTENSION))
