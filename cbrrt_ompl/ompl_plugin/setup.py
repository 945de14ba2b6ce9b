"""make_setup: a scenario as an ordinary ``ompl.control.SimpleSetup``."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from cbrrt_ompl.motion.model import CLOSED_LOOP, STEERING, check_step
from cbrrt_ompl.motion.records import Records
from cbrrt_ompl.ompl_plugin.binding import ob, oc
from cbrrt_ompl.ompl_plugin.compiled_planner import CompiledPlanner
from cbrrt_ompl.ompl_plugin.decomposition import PositionDecomposition
from cbrrt_ompl.ompl_plugin.goals import make_goal
from cbrrt_ompl.ompl_plugin.paper_planner import PaperPlanner
from cbrrt_ompl.ompl_plugin.propagators import TwoWheelPropagator
from cbrrt_ompl.ompl_plugin.space import make_control_space, make_reference_space, make_state_space, write_state
from cbrrt_ompl.ompl_plugin.validity import FclStateValidityChecker
from cbrrt_ompl.planners.registry import Backend, planner_named
from cbrrt_ompl.scenario.scenario import Scenario, check_scenario

FREE_VOLUME_SAMPLES = 8192
"""States by which Syclop estimates the free volume of its cells before it looks at the clock: 8 a cell, not 98."""


@dataclass
class Equipment:
    """What one planner was given.

    Attributes:
        model: of its propagator, see :func:`cbrrt_ompl.motion.model.make_model`.
    """

    model: Records


def make_setup(scenario: Scenario, planner: str = "cb-rrt") -> Any:
    """A scenario as an ordinary ``ompl.control.SimpleSetup``, ready for ``solve``.

    Args:
        scenario: world, robot, start, goal and settings.
        planner: `cb-rrt`, `s-rrt`, `cb-rrt-compiled`, `s-rrt-compiled`, `cb-rrt-robust`, or a planner of OMPL: `rrt`,
            `kpiece1`, `est`, `sst`, `pdst`, `syclop-rrt`, `syclop-est`.

    Returns:
        The set-up with state space, validity checker, propagator, start, goal and planner. Its limits are OMPL's: pass
        ``solve`` a time or a termination condition; ``max_samples`` is a matter of :func:`cbrrt_ompl.plan`.

    Raises:
        ScenarioError: if this is no scenario.
        UnknownPlannerError: if there is no such planner.
        SettingsError: if the step is too long for the robot.
    """
    return make_equipped_setup(scenario, planner)[0]


def make_equipped_setup(scenario: Scenario, planner: str = "cb-rrt") -> tuple[Any, Equipment]:
    """:func:`make_setup` together with what the planner was given.

    Args:
        scenario: world, robot, start, goal and settings.
        planner: see :func:`make_setup`.
    """
    check_scenario(scenario)
    row = planner_named(planner)
    check_step(scenario.robot, scenario.planning)
    limits, bounds = scenario.robot.limits, scenario.world.bounds
    space = make_state_space(bounds, limits)
    if row.law(scenario.planning) == CLOSED_LOOP:
        setup = oc.SimpleSetup(make_reference_space(space, bounds))
    else:
        setup = oc.SimpleSetup(make_control_space(space, limits, scenario.planning.approaches(scenario.goal)))
    si = setup.getSpaceInformation()
    si.setPropagationStepSize(scenario.planning.step)
    si.setMinMaxControlDuration(1, scenario.planning.steps)
    setup.setStateValidityChecker(FclStateValidityChecker(si, scenario.robot, scenario.world))
    start = ob.State(space)
    write_state(start(), scenario.start)
    setup.setStartState(start)
    setup.setGoal(make_goal(si, space, scenario.goal))
    equipment = equip(si, scenario, planner)
    setup.setPlanner(make_planner(si, scenario, planner))
    if planner == "sst":
        setup.setOptimizationObjective(first_solution_objective(si))
    return setup, equipment


def equip(si: Any, scenario: Scenario, planner: str) -> Equipment:
    """Give a space information the propagator of one planner, and take away all others' parts.

    Args:
        si: the space information that the planner will use.
        scenario: robot, goal and settings.
        planner: a known planner's name.
    """
    law = planner_named(planner).law(scenario.planning)
    propagator = TwoWheelPropagator(
        si,
        scenario.robot,
        replace(scenario.planning, closed_loop=law == CLOSED_LOOP),
        kinematic=law == STEERING,
        goal=scenario.goal,
    )
    si.setStatePropagator(propagator)
    si.clearDirectedSamplerAllocator()
    return Equipment(propagator.model)


def make_planner(si: Any, scenario: Scenario, planner: str) -> Any:
    """A planner under our name; for `cb-rrt` and `s-rrt` control::RRT, with the scenario's goal bias.

    Args:
        si: the equipped space information.
        scenario: bounds (for Syclop's grid), goal bias, and all that the compiled planners plan for.
        planner: a known planner's name.
    """
    row = planner_named(planner)
    if row.backend is Backend.COMPILED:
        return CompiledPlanner(si, scenario, planner)
    if row.backend is Backend.PLUGIN:
        return PaperPlanner(si, scenario, planner)
    if row.ompl_class.startswith("Syclop"):
        made = getattr(oc, row.ompl_class)(si, PositionDecomposition(scenario.world.bounds))
        made.setNumFreeVolumeSamples(FREE_VOLUME_SAMPLES)
    else:
        made = getattr(oc, row.ompl_class)(si)
    made.setName(planner)
    return made


def first_solution_objective(si: Any) -> Any:
    """Path length, any: lets SST end with its first solution, as all the other planners do."""
    objective = ob.PathLengthOptimizationObjective(si)
    objective.setCostThreshold(objective.infiniteCost())
    return objective
