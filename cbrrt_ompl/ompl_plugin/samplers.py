"""Directed control samplers: a whole extension of CB-RRT or S-RRT behind one call of OMPL's planners."""

from __future__ import annotations

from typing import Any

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.motion.records import record_array
from cbrrt_ompl.ompl_plugin.binding import oc
from cbrrt_ompl.ompl_plugin.children import Children
from cbrrt_ompl.ompl_plugin.compiled_methods import use_compiled_methods
from cbrrt_ompl.ompl_plugin.extender import Extender
from cbrrt_ompl.ompl_plugin.native_methods import SAMPLER_RECORD, enter_scene, make_sampler_native
from cbrrt_ompl.ompl_plugin.reals import StateReals
from cbrrt_ompl.ompl_plugin.space import STATE_DIMENSION
from cbrrt_ompl.planners.extension import EXTENDED, REFUSED
from cbrrt_ompl.problem.robot import Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings

LOOK_PERIOD = 4096
"""Extensions after which a sampler looks again whether the parts of its space information are still the same; that one
goes through Python, which lets a Ctrl-C through."""


class ExtensionSampler(oc.DirectedControlSampler):  # type: ignore[misc]  # OMPL has no type information
    """Extends a node of a tree towards a sample, by Algorithm II of the paper.

    Contract with OMPL: ``source`` is the node and is only read; ``dest`` holds the sample and, where the extension
    succeeds, takes the state at its end; ``control`` takes the control. The result is the number of propagation steps,
    or 0 where nothing is to be added. The motion is checked in here and nowhere else; it ends early at the first state
    in the goal, as far as a goal is known. OMPL makes one sampler a tree, so the sampler remembers the children of its
    nodes.

    What the space information was given is obeyed, see :class:`cbrrt_ompl.ompl_plugin.extender.Extender`: its step, its
    longest duration, and a validity checker or a propagator of a user's own.

    Attributes:
        extender: does the work.
    """

    kinematic = False
    """Whether the velocities jump."""

    def __init__(
        self,
        si: Any,
        robot: Robot,
        world: World,
        planning: PlanningSettings | None = None,
        *,
        goal: Goal | None = None,
        ompl_goal: Any = None,
        compiled: bool | None = None,
    ) -> None:
        """Make the buffers.

        Args:
            si: the space information that allocates this sampler; what OMPL hands to an allocator does.
            robot: limits, gains and footprint.
            world: obstacles and walls.
            planning: settings of the extension; None takes the defaults. Step and horizon are those of ``si``.
            goal: region that ends an extension, and that final approaches lead to; None where it is not known.
            ompl_goal: goal of a problem definition, in the place of ``goal``, see :meth:`aim_at`.
            compiled: whether OMPL calls compiled code, see :mod:`cbrrt_ompl.ompl_plugin.compiled_methods`.
        """
        super().__init__(si)
        self._record = record_array(1, SAMPLER_RECORD)
        self.extender = Extender(si, robot, world, planning, kinematic=self.kinematic, goal=goal, ompl_goal=ompl_goal)
        space = si.getStateSpace()
        self._node, self._sample = StateReals(space, STATE_DIMENSION), StateReals(space, STATE_DIMENSION)
        self._control_dimension = si.getControlSpace().getDimension()
        self._children = Children()
        extender, record = self.extender, self._record
        enter_scene(record, extender.scene)
        record["model"], record["block"] = extender.model.ctypes.data, extender.block.ctypes.data
        record["dimension"], record["look_period"] = self._control_dimension, LOOK_PERIOD
        self._tell_record()
        if type(self).sampleTo is _SAMPLE_TO and use_compiled_methods(compiled):
            make_sampler_native(self, self._record)

    def aim_at(self, goal: Any) -> None:
        """Plan for a goal of OMPL's: it ends the extensions from now on.

        Args:
            goal: any goal of a problem definition.
        """
        self.extender.aim_at(goal)
        self._tell_record()

    def look_again(self) -> None:
        """See which parts the space information has now; by itself a sampler does so every `LOOK_PERIOD` extensions."""
        self.extender.look_again()
        self._tell_record()

    @property
    def samples(self) -> int:
        """Calls so far."""
        return int(self._record["samples"][0])

    @property
    def refused(self) -> int:
        """Calls refused by line 5 of Algorithm II."""
        return int(self._record["refused"][0])

    @property
    def children(self) -> int:
        """Nodes made so far."""
        return len(self._children)

    def sampleTo(self, control: Any, *states: Any) -> int:  # noqa: N802  # OMPL's name
        """Extend ``states[-2]`` towards ``states[-1]``; OMPL may pass the node's control before them."""
        source, dest = states[-2:]
        extender, children = self.extender, self._children
        self._record["samples"] += 1
        if self.samples % LOOK_PERIOD == 0:
            self.look_again()
        self._node.read(source)
        self._sample.read(dest)
        if children.make_room():
            self._tell_record()
        slot = children.slot(self._node.values)
        x, y = self._sample.values[0], self._sample.values[1]
        outcome = extender.extend(source, self._node.values, x, y, children.first_child(slot), children.records)
        children.note_trial(slot)
        if outcome != EXTENDED:
            self._record["refused"] += outcome == REFUSED
            return 0
        children.add(slot, *extender.command)
        for i in range(self._control_dimension):
            control[i] = extender.control[i]
        self._sample.values[:] = extender.end
        self._sample.write(dest)
        return extender.steps

    def _tell_record(self) -> None:
        """Tell the compiled method where the children are, and whether it may decide."""
        record, extender, children = self._record, self.extender, self._children
        record["parents"], record["children"] = children.parents.ctypes.data, children.records.ctypes.data
        record["counts"], record["capacity"] = children.counts.ctypes.data, len(children.records)
        record["slots"] = len(children.parents)
        record["is_compiled"] = extender.is_compiled and extender.has_compiled_law


_SAMPLE_TO = ExtensionSampler.sampleTo


class KanayamaDirectedControlSampler(ExtensionSampler):
    """CB-RRT: the Kanayama law under acceleration limits, once an extension or in closed loop (as the settings say)."""


class SteeringDirectedControlSampler(ExtensionSampler):
    """S-RRT: full speed at the best of three steering rates, for a kinematic propagator."""

    kinematic = True
