"""make_setup: a scenario as an ordinary ``ompl.control.SimpleSetup``."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from typing import Any

from cbrrt_ompl.motion.model import CLOSED_LOOP, STEERING, check_step
from cbrrt_ompl.ompl_plugin.anytime_planner import AnytimePlanner
from cbrrt_ompl.ompl_plugin.binding import ob, oc
from cbrrt_ompl.ompl_plugin.compiled_methods import use_compiled_methods
from cbrrt_ompl.ompl_plugin.compiled_planner import CompiledPlanner
from cbrrt_ompl.ompl_plugin.decomposition import PositionDecomposition
from cbrrt_ompl.ompl_plugin.goals import make_goal
from cbrrt_ompl.ompl_plugin.native_space import make_native
from cbrrt_ompl.ompl_plugin.paper_planner import PaperPlanner
from cbrrt_ompl.ompl_plugin.propagators import TwoWheelPropagator
from cbrrt_ompl.ompl_plugin.space import make_control_space, make_reference_space, make_state_space, write_state
from cbrrt_ompl.ompl_plugin.syclop import SYCLOP
from cbrrt_ompl.ompl_plugin.validity import FclStateValidityChecker
from cbrrt_ompl.planners.registry import Backend, planner_named, scenario_for
from cbrrt_ompl.scenario.scenario import Scenario, check_scenario

FREE_VOLUME_SAMPLES = 8192
"""States by which Syclop estimates the free volume of its cells before it looks at the clock: 8 a cell, not 98."""


def make_setup(scenario: Scenario, planner: str = "cb-rrt", compiled: bool | None = None) -> Any:
    """A scenario as an ordinary ``ompl.control.SimpleSetup``, ready for ``solve``.

    Args:
        scenario: world, robot, start, goal and settings.
        planner: a name from :data:`cbrrt_ompl.planners.registry.PLANNERS`.
        compiled: whether OMPL calls compiled code in the place of our Python methods, with the same results bit for
            bit; None: yes, unless the environment has ``CBRRT_OMPL_COMPILED_METHODS=0``.

    Returns:
        The set-up with state space, validity checker, propagator, start, goal and planner. Its limits are OMPL's: pass
        ``solve`` a time or a termination condition. ``max_samples`` ends compiled planners and
        :func:`cbrrt_ompl.plan` alone.

    Raises:
        ScenarioError: if this is no scenario.
        UnknownPlannerError: if there is no such planner.
        SettingsError: if the step is too long for the robot.
    """
    compiled = use_compiled_methods(compiled)
    check_scenario(scenario)
    row, scenario = planner_named(planner), scenario_for(planner, scenario)
    check_step(scenario.robot, scenario.planning)
    limits, bounds = scenario.robot.limits, scenario.world.bounds
    space = make_state_space(bounds, limits, compiled)
    if row.law(scenario.planning) == CLOSED_LOOP:
        setup = oc.SimpleSetup(make_reference_space(space, bounds, compiled))
    else:
        has_manoeuvres = scenario.planning.approaches(scenario.goal)
        setup = oc.SimpleSetup(make_control_space(space, limits, has_manoeuvres, compiled))
    si = setup.getSpaceInformation()
    si.setPropagationStepSize(scenario.planning.step)
    si.setMinMaxControlDuration(1, scenario.planning.steps)
    setup.setStateValidityChecker(FclStateValidityChecker(si, scenario.robot, scenario.world, compiled=compiled))
    start = ob.State(space)
    write_state(start(), scenario.start)
    setup.setStartState(start)
    setup.setGoal(make_goal(si, space, scenario.goal, compiled))
    equip(si, scenario, planner, compiled)
    setup.setPlanner(make_planner(si, scenario, planner, compiled))
    if planner == "sst":
        setup.setOptimizationObjective(first_solution_objective(si, compiled))
    return setup


def equip(si: Any, scenario: Scenario, planner: str, compiled: bool | None = None) -> None:
    """Give a space information the propagator of one planner, and take away all others' parts.

    Args:
        si: the space information that the planner will use.
        scenario: robot, goal and settings.
        planner: a known planner's name.
        compiled: see :func:`make_setup`.
    """
    scenario = scenario_for(planner, scenario)
    law = planner_named(planner).law(scenario.planning)
    propagator = TwoWheelPropagator(
        si,
        scenario.robot,
        replace(scenario.planning, closed_loop=law == CLOSED_LOOP),
        kinematic=law == STEERING,
        goal=scenario.goal,
        compiled=compiled,
    )
    si.setStatePropagator(propagator)
    si.clearDirectedSamplerAllocator()


def make_planner(
    si: Any, scenario: Scenario, planner: str, compiled: bool | None = None, seed: int | None = None
) -> Any:
    """A planner under our name; for `cb-rrt` and `s-rrt` control::RRT, with the scenario's goal bias.

    Args:
        si: the equipped space information.
        scenario: bounds (for Syclop's grid), goal bias, and all that the compiled planners plan for.
        planner: a known planner's name.
        compiled: see :func:`make_setup`.
        seed: of a compiled planner; None takes one of those that OMPL deals out.
    """
    row, scenario = planner_named(planner), scenario_for(planner, scenario)
    if row.backend is Backend.COMPILED:
        return (AnytimePlanner if row.is_anytime else CompiledPlanner)(si, scenario, planner, seed)
    if row.backend is Backend.PLUGIN:
        return PaperPlanner(si, scenario, planner, compiled)
    if row.ompl_class.startswith("Syclop"):
        made = SYCLOP[row.ompl_class](si, PositionDecomposition(scenario.world.bounds))
        made.setNumFreeVolumeSamples(FREE_VOLUME_SAMPLES)
    else:
        module, _, name = row.ompl_class.rpartition(".")
        made = getattr(import_module(module) if module else oc, name)(si)
    made.setName(planner)
    return made


def first_solution_objective(si: Any, compiled: bool | None = None) -> Any:
    """Path length, any: lets SST end with its first solution, as all the other planners do."""
    objective = ob.PathLengthOptimizationObjective(si)
    objective.setCostThreshold(objective.infiniteCost())
    return make_native(objective) if use_compiled_methods(compiled) else objective
