"""Kernels as tests call them: the Python behind one, and extensions of the paper's robot."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from cbrrt_ompl.collision.scene import Scene
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.motion.kinematics import unicycle_step
from cbrrt_ompl.motion.model import CLOSED_LOOP, OPEN_LOOP, STEERING, make_model
from cbrrt_ompl.motion.records import Record, Records, record_array
from cbrrt_ompl.planners.extension import CHILD, Extension, extend
from cbrrt_ompl.planners.roll_out import STEPS, margin_at, roll_out
from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc, OrientedBox, Polygon
from cbrrt_ompl.problem.robot import Footprint, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.trajectory.replay import replay_path

LAWS = {"open loop": OPEN_LOOP, "closed loop": CLOSED_LOOP, "steering": STEERING}
LIMITS = Limits()
RATES = (LIMITS.omega_min, 0.0, LIMITS.omega_max)
OUT_OF_REACH = Goal(90.0, 90.0, tolerance=0.1)
POINT = Footprint.point()
FOOTPRINTS = {
    "point": POINT,
    "disc": Footprint.disc(0.15),
    "rectangle": Footprint.polygon([(-0.2, -0.1), (0.3, -0.1), (0.3, 0.1), (-0.2, 0.1)]),
}
WIDE = World(Bounds((-100.0, -100.0), (100.0, 100.0))).scene(POINT)

coordinates = st.floats(-2.0, 2.0)
headings = st.floats(-math.pi, math.pi, exclude_max=True)
nodes = st.builds(State, coordinates, coordinates, headings, st.floats(0.0, 1.0), st.floats(*RATES[::2]))
samples = st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0))


def plain(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """The Python function behind a kernel."""
    return getattr(kernel, "py_func", kernel)  # with NUMBA_DISABLE_JIT=1 a kernel is that function itself


def record_of(records: Records) -> Record:
    """The only one of some records, its fields attributes in Python too."""
    (record,) = records.view(np.recarray)
    return record


def model_of(law: int = OPEN_LOOP, goal: Goal = OUT_OF_REACH, **planning: Any) -> Records:
    """The paper's robot as the kernels' model."""
    return make_model(law, Robot(), goal, PlanningSettings(**planning))


def drive(
    scene: Scene,
    node: Sequence[float],
    sample: tuple[float, float],
    model: Records,
    children: Sequence[tuple[float, float]] = (),
    kernel: Callable[..., Extension] = extend,
) -> Extension:
    """One extension; ``children`` are the commands that the node has used."""
    used = record_array(len(children) + 1, CHILD)
    for child, (v, omega) in enumerate(children):
        used[child] = v, omega, child - 1, 0
    state, scene = tuple(map(float, node)), Scene(*(a.view(np.recarray) if a.dtype.names else a for a in scene))
    margin = margin_at(*state[:3], scene, model["room"][0])
    steps = record_of(record_array(1, STEPS))
    return kernel(state, margin, sample, len(children) - 1, used, scene, record_of(model), steps)


def roll_out_free(
    scene: Scene, node: Sequence[float], control: tuple[float, float, float], model: Records
) -> tuple[int, int, tuple[float, ...]]:
    """Steps, outcome and last state of a drive under one control."""
    state, steps = tuple(map(float, node)), record_of(record_array(1, STEPS))
    margin = margin_at(*state[:3], scene, model["room"][0])
    return roll_out(state, control, *margin, scene, record_of(model), steps)


def states_of(node: Sequence[float], found: Extension, model: Records) -> NDArray[np.float64]:
    """States of an extension from its node on, shape (steps + 1, 5)."""
    return replay_path(np.array(node, dtype=float), np.array([found.control]), np.array([found.steps]), model)[0]


def between(a: NDArray[np.float64], b: NDArray[np.float64], share: float, model: Records) -> list[float]:
    """Pose at a share of the step between two states."""
    v, omega = b[3:] if model["law"][0] == STEERING else a[3:]
    v_there, omega_there = v + share * (b[3] - v), omega + share * (b[4] - omega)
    return list(unicycle_step(*a[:3], v, omega, v_there, omega_there, share * model["dt"][0]))


def crowded_world() -> World:
    """Obstacles of all kinds on 4 m x 4 m."""
    return World(
        Bounds((-2.0, -2.0), (2.0, 2.0)),
        [
            Box((-1.0, -1.2), (-0.8, 0.8)),
            Disc((0.3, 0.9), 0.35),
            OrientedBox((0.8, -0.8), (0.9, 0.05), 0.6),
            Polygon(np.array([(1.2, 0.2), (1.8, 0.3), (1.5, 0.5), (1.7, 1.2)])),
            Polygon(np.array([(-0.4, -1.7), (0.3, -1.5), (-0.2, -0.9)])),
        ],
    )


def free_nodes(world: World, footprint: Footprint, count: int, seed: int) -> list[State]:
    """Random states at which nothing is touched, at random velocities."""
    rng = np.random.default_rng(seed)
    low, high = (-2.0, -2.0, -math.pi, 0.0, LIMITS.omega_min), (2.0, 2.0, math.pi, 1.0, LIMITS.omega_max)
    drawn = (State(*rng.uniform(low, high).tolist()) for _ in range(100 * count))
    return [node for node in drawn if not world.collides(footprint, node[:3])][:count]
