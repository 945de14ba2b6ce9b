"""One extension in OMPL's terms: its propagation, its validity checker and its goal, asked at every step.

This is EXTEND_TRAJECTORY as :mod:`cbrrt_ompl.planners.extension` has it, for everything that a user may have put in
the place of our own parts: the law chooses the control, and OMPL's parts decide how the robot moves, which states are
valid and where the goal is. It costs some hundred microseconds instead of one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from cbrrt_ompl.motion.control_laws import is_past, reference_pose
from cbrrt_ompl.motion.laws import raise_errors
from cbrrt_ompl.motion.manoeuvres import FORWARD, REVERSE, most_steps
from cbrrt_ompl.motion.model import CANDIDATES, CLOSED_LOOP, STEERING, candidate, manoeuvre_has_ended
from cbrrt_ompl.motion.records import Record
from cbrrt_ompl.ompl_plugin.binding import ob
from cbrrt_ompl.ompl_plugin.space import read_state
from cbrrt_ompl.planners.extension import BLOCKED, EXTENDED, REFUSED
from cbrrt_ompl.problem.settings import State


class AskedExtension(NamedTuple):
    """Outcome of an extension."""

    outcome: int
    """`EXTENDED`, `REFUSED` or `BLOCKED`."""
    steps: int
    """Propagation steps."""
    command: tuple[float, float]
    """Command (v, omega) that line 5 of Algorithm II compares."""
    control: tuple[float, float, float]
    """Control of the new edge."""


class OmplSteps:
    """Extends nodes by calls of a space information.

    Attributes:
        end: the state at the end of the last extension that was `EXTENDED`, a scoped state.
    """

    def __init__(self, si: Any, model: Record, goal: Any = None) -> None:
        """Take over the parts that decide.

        Args:
            si: the space information.
            model: what the law depends on; its step and number of steps are not looked at, but those of ``si``.
            goal: OMPL's goal, which ends an extension; None where it is not known.
        """
        space = si.getStateSpace()
        self._si, self._model, self._goal = si, model, goal
        self.end, self._spare, self._other = (ob.State(space) for _ in range(3))
        self._control = si.getControlSpace()
        self._dimension = self._control.getDimension()

    def extend(
        self, source: Any, x_sample: float, y_sample: float, is_refused: Callable[[float, float], bool], untried: bool
    ) -> AskedExtension:
        """Extend a node towards a sample, or by a final approach to the goal.

        Args:
            source: the node's state, only read.
            x_sample: the sample [m].
            y_sample: the sample [m].
            is_refused: line 5 of Algorithm II, for a command (v, omega).
            untried: whether no final approach was tried from the node.
        """
        node = read_state(source)
        control = self._control.allocControl()
        try:
            if untried and self._model["approaches"]:
                best = self._approach(source, node, control)
                if best.outcome == EXTENDED:
                    return best
            return self._best_candidate(source, node, (x_sample, y_sample), is_refused, control)
        finally:
            self._control.freeControl(control)

    def steps_to_goal(self, source: Any, numbers: tuple[float, float, float], steps: int) -> int:
        """Steps under a control after which the goal is reached first, 0 if it is not within ``steps``.

        Validity is not looked at. The state in the goal is in ``end``.
        """
        control = self._control.allocControl()
        try:
            for i in range(self._dimension):
                control[i] = numbers[i]
            state = source
            for step in range(1, steps + 1):
                self._si.propagate(state, control, 1, self.end())
                state = self.end()
                if self._is_in_goal(state):
                    return step
            return 0
        finally:
            self._control.freeControl(control)

    def _best_candidate(
        self,
        source: Any,
        node: State,
        sample: tuple[float, float],
        is_refused: Callable[[float, float], bool],
        control: Any,
    ) -> AskedExtension:
        """The candidate that ends nearest to the reference, of those that are neither refused nor blocked."""
        model = self._model
        reference = reference_pose(node.x, node.y, node.theta, *sample, model["look_ahead"])
        best = AskedExtension(REFUSED, 0, (0.0, 0.0), (0.0, 0.0, 0.0))
        nearest = math.inf
        for choice in range(CANDIDATES if model["law"] == STEERING else 1):
            v, omega, numbers = candidate(choice, (*node,), reference, model)
            raise_errors()
            if is_refused(v, omega):
                continue
            steps, is_free, _ = self._drive(source, numbers, control)
            if steps == 0 or not (is_free or model["keep_cut"]):
                if best.outcome == REFUSED:
                    best = best._replace(outcome=BLOCKED)
                continue
            reached = read_state(self._spare)
            distance = (reached.x - reference[0]) ** 2 + (reached.y - reference[1]) ** 2
            if distance < nearest:
                nearest = distance
                best = AskedExtension(EXTENDED, steps, (v, omega), numbers)
                self.end, self._spare = self._spare, self.end
        return best

    def _approach(self, source: Any, node: State, control: Any) -> AskedExtension:
        """The final approach, ahead or backwards, whichever is free and takes the smaller turn."""
        goal, limits = self._model["goal"], self._model["limits"]
        ahead = math.cos(node.theta) * (goal["x"] - node.x) + math.sin(node.theta) * (goal["y"] - node.y) >= 0.0
        for manoeuvre in (FORWARD, REVERSE) if ahead else (REVERSE, FORWARD):
            if manoeuvre == REVERSE and limits["v_min"] == 0.0:
                continue
            distance = math.hypot(goal["x"] - node.x, goal["y"] - node.y)
            most = most_steps(manoeuvre, distance, limits, self._si.getPropagationStepSize())
            numbers = (0.0, 0.0, manoeuvre)
            steps, is_free, in_goal = self._drive(source, numbers, control, most)
            if is_free and in_goal:
                self.end, self._spare = self._spare, self.end
                return AskedExtension(EXTENDED, steps, (0.0, 0.0), numbers)
        return AskedExtension(BLOCKED, 0, (0.0, 0.0), (0.0, 0.0, 0.0))

    def _drive(
        self, source: Any, numbers: tuple[float, float, float], control: Any, most: int | None = None
    ) -> tuple[int, bool, bool]:
        """Propagate under one control until the longest duration, an invalid state, the goal or the loop's reference.

        Args:
            source: the state to start from.
            numbers: the control.
            control: takes the control.
            most: steps within which a manoeuvre ends; None for a control that is none.

        Returns:
            The number of valid steps, whether no state was invalid, and whether the last one is in the goal; the last
            valid state is in ``self._spare``.
        """
        si = self._si
        for i in range(self._dimension):
            control[i] = numbers[i]
        longest = si.getMaxControlDuration() if most is None else most
        shortest = si.getMinControlDuration() if most is None else 1
        state, following = source, self._other()
        for step in range(1, longest + 1):
            si.propagate(state, control, 1, following)
            if not si.isValid(following):
                return step - 1, False, False
            self._other, self._spare = self._spare, self._other
            state, following = self._spare(), self._other()
            if most is not None:
                if manoeuvre_has_ended(numbers[2], (*read_state(state),), self._model["goal"]):
                    return step, True, self._is_in_goal(state)
            elif step >= shortest:
                if self._is_in_goal(state):
                    return step, True, True
                if self._model["law"] == CLOSED_LOOP and is_past(*read_state(state)[:2], numbers):
                    return step, True, False
        return longest, most is None, False

    def _is_in_goal(self, state: Any) -> bool:
        return self._goal is not None and bool(self._goal.isSatisfied(state))
