"""One part of a study, run in this process: what came of each run, and what its trajectory asks of the robot."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cbrrt_ompl.benchmark.job import do_job
from cbrrt_ompl.planners.first_plan import FirstPlan
from cbrrt_ompl.planning import plan
from cbrrt_ompl.problem.robot import Limits
from cbrrt_ompl.reproduce.study import NAIVE, TIME_LIMIT, Key, Part
from cbrrt_ompl.scenario.scenario import Scenario, scenario_from_dict
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.verification import verify

WARM_UP = 0.01
"""Planning time of a run before the measured ones [s]."""


@dataclass(frozen=True)
class Run:
    """The outcome of one run."""

    seed: int
    """Its seed."""
    solved: bool
    """Whether the goal was reached within the samples allowed."""
    nodes: int
    """Nodes of the tree."""
    samples: int
    """Samples drawn."""
    time: float
    """Planning time [s]."""
    verified: bool | None = None
    """Whether the trajectory passed verification; this and the following are None where there is none."""
    duration: float | None = None
    """Duration of the trajectory [s]."""
    length: float | None = None
    """Length of its path [m]."""
    point_turns: int | None = None
    """Turns in place."""
    speed_use: float | None = None
    """Largest velocity, v or omega, as a share of its limit."""
    acceleration_use: float | None = None
    """Largest change of v or omega in a step, as a share of what the acceleration limits allow."""


def measure(part: Part) -> list[Run]:
    """Run a part.

    The index of the world is made before the clock runs, and so are the kernels.
    """
    scenario = scenario_from_dict(part.scenario)
    scenario.world.scene(scenario.robot.footprint)
    planner = part.key.planner
    plan(scenario, "rrt" if planner == NAIVE else planner, seed=0, time_limit=WARM_UP)
    return [_measure_one(scenario, planner, seed) for seed in part.seeds]


def runs_of(result: str) -> list[Run]:
    """The runs that the process of a part has written, a line each."""
    return [Run(**json.loads(line)) for line in result.splitlines()]


def _do_part(values: dict[str, Any]) -> str:
    """The runs of a part, a line each, from its fields."""
    part = Part(Key(*values["key"]), values["scenario"], tuple(values["seeds"]))
    return "".join(f"{json.dumps(asdict(run))}\n" for run in measure(part))


def _measure_one(scenario: Scenario, planner: str, seed: int) -> Run:
    """One run and its verification."""
    if planner == NAIVE:
        found = plan_naively(scenario, seed)
        trajectory, figures = found.trajectory, (found.count_nodes(), found.samples, found.planning_time)
    else:
        result = plan(scenario, planner, seed, TIME_LIMIT)
        trajectory, figures = result.trajectory, (result.nodes, result.samples, result.planning_time)
    if trajectory is None:
        return Run(seed, False, *figures)
    speed_use, acceleration_use = uses_of_limits(trajectory, scenario.robot.limits)
    return Run(
        seed,
        True,
        *figures,
        verified=verify(trajectory, scenario).ok,
        duration=trajectory.duration,
        length=trajectory.length,
        point_turns=len(trajectory.point_turns),
        speed_use=speed_use,
        acceleration_use=acceleration_use,
    )


def plan_naively(scenario: Scenario, seed: int) -> FirstPlan:
    """OMPL's control::RRT as it comes, with a metric over all five components of the state.

    Each component has weight 1, so that samples are drawn from, and the nearest node is sought in, the whole state
    space. Controls are random, and a sample in twenty is the goal: OMPL's own setting.

    Args:
        scenario: world, robot, start, goal; its ``max_samples`` is obeyed.
        seed: 0 or more.
    """
    from cbrrt_ompl.ompl_plugin.run import run  # here, so that the compiled planners need no OMPL

    def weigh_all(setup: Any) -> None:
        for component in range(setup.getStateSpace().getSubspaceCount()):
            setup.getStateSpace().setSubspaceWeight(component, 1.0)

    return run(scenario, "rrt", seed, lambda: None, lambda _: False, prepare=weigh_all)


def uses_of_limits(trajectory: Trajectory, limits: Limits) -> tuple[float, float]:
    """How much of the robot's limits a trajectory takes: 1 is all, more than 1 cannot be driven.

    Args:
        trajectory: velocities over time.
        limits: of the robot.

    Returns:
        Largest share of the velocity limits, and of the acceleration limits.
    """
    speeds, accelerations = [], []
    for values, low, high, most in (
        (trajectory.v, limits.v_min, limits.v_max, limits.acceleration),
        (trajectory.omega, limits.omega_min, limits.omega_max, limits.angular_acceleration),
    ):
        below, above = float(-values.min()), float(values.max())
        speeds += [above / high, below / -low if low < 0.0 else (math.inf if below > 0.0 else 0.0)]
        changes = np.abs(np.diff(values)) / np.diff(trajectory.t)
        accelerations.append(float(changes.max(initial=0.0)) / most)
    return max(speeds), max(accelerations)


if __name__ == "__main__":
    do_job(_do_part)
