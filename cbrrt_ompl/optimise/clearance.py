"""What an optimised motion is checked by: the only place of this wing that knows how collision is decided."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.clearance import clearances_at
from cbrrt_ompl.collision.motion_check import is_free
from cbrrt_ompl.kernels import kernel
from cbrrt_ompl.motion.kinematics import brake
from cbrrt_ompl.motion.model import motion_room
from cbrrt_ompl.motion.records import Record
from cbrrt_ompl.optimise.cover import cover
from cbrrt_ompl.optimise.field import distance_at, field_of
from cbrrt_ompl.problem.settings import MAX_STEPS
from cbrrt_ompl.scenario.scenario import Scenario

FAR = 0.1
"""Clearance beyond the least one from which on that by the distance field will do [m]."""


def least_clearance(scenario: Scenario) -> float:
    """Distance that the motions of a scenario keep from everything [m]."""
    return motion_room(scenario.planning.clearance)


def is_motion_free(states: NDArray[np.float64], dt: float, scenario: Scenario, *, is_kinematic: bool = False) -> bool:
    """Whether the planners would accept a motion.

    Args:
        states: rows of (x, y, theta, v, omega), shape (n, 5); between the rows the velocities are linear in time.
        dt: time between two rows [s].
        scenario: world and footprint.
        is_kinematic: whether the velocities jump instead, at each row to those of the next one.
    """
    scene = scenario.world.scene(scenario.robot.footprint)
    return is_free(states, dt, scene, least_clearance(scenario), is_kinematic=is_kinematic)


def clearances(states: NDArray[np.float64], scenario: Scenario) -> NDArray[np.float64]:
    """Exact distances of the footprint from everything, below 0 where it touches something, shape (n,) [m].

    Args:
        states: rows that begin with (x, y, theta), shape (n, 3) or more [m, m, rad].
        scenario: world and footprint.
    """
    found: NDArray[np.float64] = clearances_at(
        scenario.world.scene(scenario.robot.footprint), np.ascontiguousarray(states)
    )
    return found


def signed_clearances(states: NDArray[np.float64], scenario: Scenario) -> NDArray[np.float64]:
    """:func:`clearances`, but by the distance field where the footprint touches something or is far from all [m].

    Then it is about how deep, or about how far.
    """
    found = disc_distances(states, scenario).min(axis=1)
    is_near = found < least_clearance(scenario) + FAR
    exact = clearances(states[is_near], scenario)
    found[is_near] = np.where(exact > 0.0, exact, np.minimum(found[is_near], 0.0))
    return found


def unsafe_rows(states: NDArray[np.float64], scenario: Scenario) -> NDArray[np.bool_]:
    """From which states the robot cannot brake to rest without collision, shape (n,)."""
    step = scenario.planning.step
    found = np.zeros(len(states), dtype=np.bool_)
    for row, (x, y, theta, v, omega) in enumerate(states.tolist()):
        braking = brake(x, y, theta, v, omega, scenario.robot.limits, step, MAX_STEPS)
        found[row] = not is_motion_free(braking, step, scenario)
    return found


def disc_distances(poses: NDArray[np.float64], scenario: Scenario) -> NDArray[np.float64]:
    """Distances of the discs that stand for the footprint, by the distance field, shape (n, discs) [m].

    Args:
        poses: rows that begin with (x, y, theta), shape (n, 3) or more [m, m, rad].
        scenario: world and footprint.
    """
    grid, distances = field_of(scenario.world)
    discs = cover(scenario.robot.footprint)
    found: NDArray[np.float64] = disc_distances_in(grid, distances, discs, np.ascontiguousarray(poses))
    return found


@kernel
def disc_distances_in(
    grid: Record, distances: NDArray[np.float32], discs: NDArray[np.float64], poses: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Distances of discs from everything at poses, shape (n, discs) [m]."""
    found = np.empty((len(poses), len(discs)))
    for k in range(len(poses)):
        cosine, sine = math.cos(poses[k, 2]), math.sin(poses[k, 2])
        for i in range(len(discs)):
            x = poses[k, 0] + cosine * discs[i, 0] - sine * discs[i, 1]
            y = poses[k, 1] + sine * discs[i, 0] + cosine * discs[i, 1]
            found[k, i] = distance_at(grid, distances, x, y) - discs[i, 2]
    return found
