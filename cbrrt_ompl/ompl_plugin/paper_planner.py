"""CB-RRT and S-RRT as OMPL's control::RRT with a directed sampler of ours."""

from __future__ import annotations

from typing import Any

from cbrrt_ompl.motion.laws import raise_errors
from cbrrt_ompl.ompl_plugin.binding import oc
from cbrrt_ompl.ompl_plugin.own_sampler import OwnSampler
from cbrrt_ompl.ompl_plugin.samplers import (
    ExtensionSampler,
    KanayamaDirectedControlSampler,
    SteeringDirectedControlSampler,
)
from cbrrt_ompl.ompl_plugin.user_parts import Query, check_control_sampler, check_parts, query_of
from cbrrt_ompl.ompl_plugin.warm_up import warm_up
from cbrrt_ompl.planners.registry import Steering, planner_named
from cbrrt_ompl.scenario.scenario import Scenario

SAMPLERS: dict[Steering, type[ExtensionSampler]] = {
    Steering.KANAYAMA: KanayamaDirectedControlSampler,
    Steering.RATES: SteeringDirectedControlSampler,
}
"""The directed samplers of the paper's planners."""


class PaperPlanner(OwnSampler, oc.RRT):  # type: ignore[misc]  # OMPL has no type information
    """control::RRT that extends by Algorithm II of the paper.

    What was put into space information and problem definition before ``solve`` is obeyed. If starts or parts are others
    than those that the tree was grown with, ``solve`` begins a new tree, whether ``clear`` was called or not; another
    goal is planned for with the tree that is there.
    """

    def __init__(self, si: Any, scenario: Scenario, name: str, compiled: bool | None = None) -> None:
        """Name the planner and choose its sampler.

        Args:
            si: the space information, with our propagator or a user's own.
            scenario: robot, world and settings.
            name: a planner with a directed sampler of ours.
            compiled: whether OMPL calls compiled code, see :mod:`cbrrt_ompl.ompl_plugin.compiled_methods`.
        """
        super().__init__(si)
        self.setName(name)
        self.setGoalBias(scenario.planning.filled().goal_bias)
        self._scenario, self._compiled = scenario, compiled
        self._kind = name  # the name may be changed
        self._query: Query | None = None
        self._goal: Any = None

    def setup(self) -> None:
        """Compile, and refuse what this planner cannot take.

        Raises:
            SettingsError: see :func:`cbrrt_ompl.ompl_plugin.user_parts.check_parts` and
                :func:`cbrrt_ompl.ompl_plugin.user_parts.check_control_sampler`.
        """
        warm_up()
        self._check()
        super().setup()
        self.prepare()

    def solve(self, *condition: Any) -> Any:
        """Grow the tree, with the parts and towards the goal that are there now."""
        self.checkValidity()
        self._check()
        problem = self.getProblemDefinition()
        query = query_of(problem)
        if self._query is not None and not self._query.is_continued_by(query):
            self.clear()
        self._query, self._goal = query, problem.getGoal()
        status = super().solve(*condition)
        raise_errors()
        return status

    def tell(self, sampler: Any) -> None:
        """Have a sampler look at the parts and at the goal that are there now."""
        if sampler is not None:
            sampler.aim_at(self._goal)

    def _check(self) -> None:
        """Refuse what this planner cannot take."""
        si = self.getSpaceInformation()
        check_parts(si, self._scenario, self._kind)
        if self.looks_around:
            check_control_sampler(si.getControlSpace(), self._kind)

    def clear(self) -> None:
        """Forget the tree."""
        super().clear()
        self._query = None

    def allocate(self, si: Any) -> ExtensionSampler:
        """Make the sampler of a tree."""
        scenario = self._scenario
        return SAMPLERS[planner_named(self._kind).steering](
            si,
            scenario.robot,
            scenario.world,
            scenario.planning,
            ompl_goal=self._goal,
            compiled=self._compiled,
        )

    @property
    def samples(self) -> int:
        """Samples drawn for the present tree."""
        return 0 if self.sampler is None else self.sampler.samples

    @property
    def extension_attempts(self) -> int:
        """Extensions that were driven: the samples but those refused by line 5 of Algorithm II."""
        return 0 if self.sampler is None else self.sampler.samples - self.sampler.refused
