"""Drive through random worlds with unknown obstacles, and judge every drive in the true world.

A drive is judged by FCL alone, at points of its motion at most a millimetre apart and at its end: whether it touched
anything, kept its limits (by `verify`) and, where it stopped, stands. "With all known" is one plan in the true world.

    python benchmarks/drive_worlds.py --worlds 200 --seed 1
"""

from __future__ import annotations

import argparse
import math
import time
from collections import Counter
from dataclasses import replace

import numpy as np

from cbrrt_ompl import Bounds, Footprint, Gains, Goal, Limits, PlanningSettings, Robot, Scenario, State, World, plan
from cbrrt_ompl.drive import DriveResult, DriveSettings, drive
from cbrrt_ompl.drive.unknown import random_obstacles

SPACING = 1e-3
"""Largest way between two points that FCL is asked about [m]."""

ROBOTS = (
    Robot(Footprint.disc(0.2), Limits(0.0, 1.0, -1.0, 1.0, 0.6, 1.5)),
    Robot(Footprint.disc(0.3), Limits(0.0, 2.0, -2.0, 2.0, 2.0, 6.0), Gains(1.5, 2.0, 1.0)),
    Robot(
        Footprint.polygon([[-0.2, -0.15], [0.3, -0.15], [0.3, 0.15], [-0.2, 0.15]]),
        Limits(-0.5, 1.0, -1.0, 1.0, 0.6, 1.5),
    ),
    Robot(
        Footprint.polygon([[-0.25, -0.2], [0.25, -0.2], [0.25, 0.2], [-0.25, 0.2]]),
        Limits(0.0, 1.5, -2.0, 2.0, 1.0, 4.0),
    ),
)
"""Round ones and such with corners, slow and fast, one of which can reverse."""


def random_world(rng: np.random.Generator) -> tuple[Scenario, list]:
    """A scenario with some known obstacles, and the unknown ones."""
    bounds = Bounds((0.0, 0.0), (10.0, 10.0))
    robot = ROBOTS[rng.integers(len(ROBOTS))]
    while True:
        (x0, y0), (x1, y1) = rng.uniform(0.8, 9.2, size=(2, 2))
        if math.hypot(x1 - x0, y1 - y0) > 5.0:
            break
    room = robot.footprint.circumscribed_radius + 0.05
    keep_free = [(x0, y0, 1.5 * room), (x1, y1, 0.4 + room)]
    scenario = Scenario(
        name="random world",
        world=World(bounds, random_obstacles(bounds, int(rng.integers(0, 10)), rng, keep_free)),
        robot=robot,
        start=State(float(x0), float(y0), float(rng.uniform(-math.pi, math.pi))),
        goal=Goal(float(x1), float(y1), tolerance=0.4),
        planning=PlanningSettings(horizon=1.5, step=0.05),
    )
    return scenario, random_obstacles(bounds, int(rng.integers(10, 40)), rng, keep_free)


def touches(result: DriveResult) -> bool:
    """Whether a drive touched anything of the true world, at points `SPACING` apart."""
    trajectory, robot = result.braking, result.scenario.robot
    reach = robot.footprint.circumscribed_radius
    v, _, omega, _ = np.abs(trajectory.step_velocities)
    v_end, omega_end = np.abs(trajectory.v[1:]), np.abs(trajectory.omega[1:])
    steps, begins = np.diff(trajectory.t), trajectory.t[:-1]
    parts = np.ceil(steps * (np.maximum(v, v_end) + reach * np.maximum(omega, omega_end)) / SPACING).astype(int) + 1
    times = np.concatenate([t + dt * np.arange(n) / n for t, dt, n in zip(begins, steps, parts, strict=True)])
    referee = result.world.referee(robot.footprint)
    return any(referee.collides(*pose) for pose in trajectory.at(np.append(times, trajectory.t[-1]))[:, :3].tolist())


def main() -> None:
    """Print one table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--worlds", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="number of the first world")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--sensor-range", type=float, default=2.5, help="[m]")
    parser.add_argument("--cycle", type=float, default=0.1, help="[s]")
    parser.add_argument("--max-samples", type=int, help="limit of a plan instead of the cycle's time")
    parser.add_argument("--all-hidden", action="store_true", help="hide the known obstacles too")
    parser.add_argument("--line-of-sight", action="store_true", help="do not see what obstacles hide")
    arguments = parser.parse_args()
    settings = DriveSettings(
        arguments.sensor_range,
        arguments.cycle,
        max_samples=arguments.max_samples,
        line_of_sight=arguments.line_of_sight,
    )
    began, results, possible = time.perf_counter(), [], 0
    collisions, invalid, moving = [], [], []
    for world in range(arguments.first, arguments.first + arguments.worlds):
        scenario, hidden = random_world(np.random.default_rng([arguments.seed, world]))
        if arguments.all_hidden:
            hidden = [*scenario.world.obstacles, *hidden]
            scenario = replace(scenario, world=World(scenario.world.bounds))
        result = drive(scenario, hidden, settings, seed=world)
        results.append(result)
        known = replace(scenario, world=result.world, planning=settings.planning(scenario.planning))
        solved = plan(known, settings.planner, seed=world, time_limit=2.0).solved
        possible += solved or result.reached
        if touches(result):
            collisions.append(world)
        if not result.verification.ok:
            invalid.append(world)
        if np.any(result.braking.states[-1, 3:]):
            moving.append(world)
        if not result.reached:
            statuses = dict(Counter(replan.status for replan in result.replans))
            print(f"world {world}: stopped after {result.trajectory.duration:.1f} s, plans {statuses}, "
                  f"with all known {'solved' if solved else 'not solved'}", flush=True)  # fmt: skip
    reached = [result for result in results if result.reached]
    replans = [replan for result in results for replan in result.replans]
    planning = 1e3 * np.array([replan.planning_time for replan in replans])
    at_speed = [c for r in results for c in r.cycles if c.replan and any(c.replan.start[3:])]
    computing = 1e3 * np.array([cycle.computing_time for cycle in at_speed])
    quiet = 1e3 * np.array([c.computing_time for r in results for c in r.cycles if c.replan is None])
    print(f"worlds                       {len(results)} in {time.perf_counter() - began:.0f} s")
    print(f"collisions                   {len(collisions)} {collisions or ''}")
    print(f"not verified                 {len(invalid)} {invalid or ''}")
    print(f"braking does not end at rest {len(moving)} {moving or ''}")
    print(f"reached the goal             {len(reached)} ({len(reached) / len(results):.1%})")
    print(f"solved with all known        {possible} (or reached)")
    print(f"plans                        {len(replans)}, {dict(Counter(replan.status for replan in replans))}")
    print(f"at speed                     {len(at_speed)} of them, {len(replans) / len(results):.1f} a world in all")
    print(f"smallest clearance           {min(result.smallest_clearance for result in results):.4f} m")
    for name, values in (("search", planning), ("cycle with plan at speed", computing), ("cycle without plan", quiet)):
        median, high, most = np.quantile(values, (0.5, 0.95, 1.0))
        print(f"{name + ' [ms]':<29}median {median:.2f}, 95 % {high:.2f}, max {most:.1f}")


if __name__ == "__main__":
    main()
