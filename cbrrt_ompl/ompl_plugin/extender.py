"""One extension by whoever decides: compiled kernels, or the parts that a user has put into the space information."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.scene import Scene
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import Problem, SettingsError
from cbrrt_ompl.kernels import kernel
from cbrrt_ompl.motion.laws import is_compiled_law, law_address, raise_errors
from cbrrt_ompl.motion.model import CLOSED_LOOP, MODEL, OPEN_LOOP, STEERING, check_step, make_model
from cbrrt_ompl.motion.records import Records, record_array
from cbrrt_ompl.ompl_plugin.asked_extension import OmplSteps
from cbrrt_ompl.ompl_plugin.goals import region_of
from cbrrt_ompl.ompl_plugin.propagators import NOWHERE, drives_like
from cbrrt_ompl.ompl_plugin.space import check_controls, check_space, covers, read_state
from cbrrt_ompl.ompl_plugin.user_parts import loop_problems, step_problems
from cbrrt_ompl.ompl_plugin.validity import is_of_ours
from cbrrt_ompl.planners.extension import CHILD, EXTENDED, NO_CHILD, UNTRIED, extend, is_refused
from cbrrt_ompl.planners.roll_out import STEPS, margin_at
from cbrrt_ompl.problem.robot import Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings

EXTENSION = np.dtype(
    [
        ("steps", np.int64),  # integration steps
        ("v_command", np.float64),  # that line 5 compares [m/s, rad/s]
        ("omega_command", np.float64),
        ("control", np.float64, (3,)),  # see advance of the model
    ],
    align=True,
)
"""What a kernel hands to a caller in Python."""


class Extender:
    """Extends states towards samples, by Algorithm II of the paper.

    Where validity checker and propagator of the space information are ours, for the same robot and world, compiled
    kernels decide; where a user has put others in their place, these are asked at every step. The length of a step and
    the longest duration are always those of the space information. A goal that the kernels do not know is asked at
    every step of what they have found.

    Attributes:
        block: room for the kernel, one record of type :data:`cbrrt_ompl.planners.roll_out.STEPS`.
        scene: world and footprint, see :meth:`cbrrt_ompl.World.scene`.
        model: one record, see :func:`cbrrt_ompl.motion.model.make_model`; it stays where it is.
        end: (x, y, theta, v, omega) at the end of the last extension that was `EXTENDED`, shape (5,).
        steps: its number of steps.
        command: its command (v, omega), which line 5 of Algorithm II compares.
        control: its control, three numbers.
    """

    def __init__(
        self,
        si: Any,
        robot: Robot,
        world: World,
        planning: PlanningSettings | None = None,
        *,
        kinematic: bool = False,
        goal: Goal | None = None,
        ompl_goal: Any = None,
    ) -> None:
        """Look at the space information.

        Args:
            si: the space information; what OMPL hands to an allocator does.
            robot: limits, gains and footprint.
            world: obstacles and walls.
            planning: settings of the extension; None takes the defaults. Step and horizon are those of ``si``.
            kinematic: whether the velocities jump.
            goal: region that ends an extension, and that final approaches lead to; None where it is not known.
            ompl_goal: goal of a problem definition, in the place of ``goal``.
        """
        check_space(si.getStateSpace())
        check_controls(si.getControlSpace())
        self.end = np.empty(5)
        self.steps, self.command, self.control = 0, (0.0, 0.0), (0.0, 0.0, 0.0)
        self._si, self._kinematic = si, kinematic
        self._robot, self._world, self._planning = robot, world, planning or PlanningSettings()
        self._goal, self._ompl_goal = goal, ompl_goal
        self.scene = world.scene(robot.footprint)
        self.model = record_array(1, MODEL)
        self._made_for: tuple[Goal, int] | None = None
        self._control_dimension = si.getControlSpace().getDimension()
        self._extension = record_array(1, EXTENSION)
        self.block = record_array(1, STEPS)
        self.look_again()

    @property
    def is_compiled(self) -> bool:
        """Whether compiled kernels decide everything."""
        return self._asked is None and self._goal_finder is None

    @property
    def has_compiled_law(self) -> bool:
        """Whether the control law is compiled, so that nothing in an extension can raise an exception."""
        return is_compiled_law(self._planning.law)

    def aim_at(self, goal: Any) -> None:
        """Plan for a goal of OMPL's: it ends the extensions from now on.

        Args:
            goal: any goal of a problem definition.
        """
        self._ompl_goal = goal
        self.look_again()

    def look_again(self) -> None:
        """See which parts the space information and the goal have now.

        Raises:
            SettingsError: if the step is no time or too long for the robot, or the settings ask for what a user's own
                parts cannot promise, or for other controls than the propagator takes.
        """
        si, planning, space = self._si, self._planning, self._si.getStateSpace()
        law = STEERING if self._kinematic else CLOSED_LOOP if planning.closed_loop else OPEN_LOOP
        region = self._goal if self._ompl_goal is None else region_of(self._ompl_goal, space)
        model = self.model
        made_for = (region or NOWHERE, law_address(planning.law))
        if self._made_for != made_for:
            self._made_for, self._made = made_for, make_model(law, self._robot, made_for[0], planning)
        model[:] = self._made
        step = si.getPropagationStepSize()
        propagator = si.getStatePropagator()
        is_set_up = not step <= 0.0  # it is 0 until then
        problems = loop_problems(propagator, law == CLOSED_LOOP) + (step_problems(step) if is_set_up else [])
        if problems:
            raise SettingsError(problems)
        if is_set_up:
            if step != planning.step:
                planning = replace(planning, step=step, horizon=step)
            check_step(self._robot, planning)
            model["dt"] = step
        if si.getMaxControlDuration() > 0:
            model["steps"] = si.getMaxControlDuration()
        is_driven_by_us = drives_like(propagator, model)
        may_approach = is_driven_by_us and region is not None and propagator.goal == region
        model["approaches"] &= may_approach and self._control_dimension == 3
        if region is None:
            model["goal"]["tolerance"] = 0.0
        is_ours = (
            is_driven_by_us
            and is_of_ours(si.getStateValidityChecker(), self._robot, self._world)
            and si.getMinControlDuration() <= 1
            and covers(space, self._world.bounds, self._robot.limits)
        )
        self._asked: OmplSteps | None = None if is_ours else OmplSteps(si, model[0], self._ompl_goal)
        has_own_goal = self._ompl_goal is not None and region is None
        self._goal_finder = OmplSteps(si, model[0], self._ompl_goal) if has_own_goal else None
        if not is_ours and planning.brake_safe and not model["jumps"][0]:
            expected = "False where the validity checker or the propagator is not ours"
            raise SettingsError(Problem("planning.brake_safe", True, expected))

    def extend(
        self,
        source: Any,
        node: NDArray[np.float64],
        x: float,
        y: float,
        first_child: int,
        children: Records,
    ) -> int:
        """Extend a state towards a sample.

        Args:
            source: the state, as OMPL's.
            node: its numbers, shape (5,).
            x: the sample [m].
            y: the sample [m].
            first_child: this and the next: see :func:`cbrrt_ompl.planners.extension.extend`.
            children: see above.

        Returns:
            `EXTENDED`, and then ``end``, ``steps``, ``command`` and ``control`` tell the rest; or another outcome.
        """
        if self._asked is not None:
            return self._ask(self._asked, source, x, y, first_child, children)
        self.end[0], self.end[1] = x, y
        outcome: int = extend_values(
            node, self.end, first_child, children, *self.scene, self.model, self.block, self._extension
        )
        raise_errors()
        steps, v, omega, control = self._extension[0]
        self.steps, self.command, self.control = int(steps), (v, omega), tuple(control.tolist())
        if outcome == EXTENDED and self._goal_finder is not None:
            steps = self._goal_finder.steps_to_goal(source, self.control, self.steps)
            if steps:
                self.steps = steps
                self.end[:] = read_state(self._goal_finder.end)
        return outcome

    def _ask(
        self,
        asked: OmplSteps,
        source: Any,
        x: float,
        y: float,
        first_child: int,
        children: Records,
    ) -> int:
        """Extend by OMPL's parts."""
        tolerance = float(self.model["equal_control_tolerance"][0])
        found = asked.extend(
            source,
            x,
            y,
            lambda v, omega: is_refused(first_child, children, v, omega, tolerance),
            first_child == UNTRIED,
        )
        self.steps, self.command, self.control = found.steps, found.command, found.control
        if found.outcome == EXTENDED:
            self.end[:] = read_state(asked.end)
        return found.outcome


@kernel
def extend_values(
    node: NDArray[np.float64],
    sample: NDArray[np.float64],
    first_child: int,
    children: Records,
    frame: Records,
    cells: Records,
    lists: NDArray[np.int32],
    pieces: Records,
    corners: Records,
    models: Records,
    blocks: Records,
    extensions: Records,
) -> int:
    """:func:`extend` for a caller in Python: arrays in; the outcome, the end in ``sample`` and a record out."""
    scene, model, found = Scene(frame, cells, lists, pieces, corners), models[0], extensions[0]
    state = (node[0], node[1], node[2], node[3], node[4])
    margin = margin_at(node[0], node[1], node[2], scene, model.room)
    extension = extend(state, margin, (sample[0], sample[1]), first_child, children, scene, model, blocks[0])
    found.steps = extension.steps
    found.v_command, found.omega_command = extension.command
    found.control[0], found.control[1], found.control[2] = extension.control
    if extension.outcome == EXTENDED:
        sample[0], sample[1], sample[2], sample[3], sample[4] = extension.state
    return extension.outcome


def warm_up_extender(model: Records, scene: Scene) -> None:
    """Load or compile the kernel."""
    node, sample = np.array([0.5, 0.5, 0.0, 0.0, 0.0]), np.array([0.6, 0.6, 0.0, 0.0, 0.0])
    block, extension = record_array(1, STEPS), record_array(1, EXTENSION)
    extend_values(node, sample, NO_CHILD, record_array(1, CHILD), *scene, model, block, extension)
