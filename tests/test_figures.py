"""Figures: what was drawn, read back from the axes."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kernels import WIDE, drive, model_of
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection, PolyCollection
from matplotlib.colors import same_color
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Wedge
from matplotlib.patches import Polygon as PolygonPatch
from numpy.typing import NDArray

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.figures import (
    draw_extension,
    draw_plan,
    draw_scene,
    draw_trajectory,
    draw_tree,
    draw_velocities,
    draw_world,
)
from cbrrt_ompl.figures.saving import save_figure
from cbrrt_ompl.figures.style import PATH_COLOR, TREE_COLOR, TURN_COLOR, time_text
from cbrrt_ompl.motion.model import OPEN_LOOP, STEERING
from cbrrt_ompl.planning import PlanResult
from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc, Obstacle, Polygon
from cbrrt_ompl.problem.robot import Footprint, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.trajectory.tree import Tree

SQUARE = Footprint.polygon([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])


@pytest.fixture
def ax() -> Axes:
    return Figure().add_subplot()


@pytest.fixture(scope="module")
def trajectory() -> Trajectory:
    """Two metres ahead, a quarter turn on the spot, one and a half metres up; 5.5 s."""
    t = np.linspace(0.0, 5.5, 56)
    x = np.clip(t, 0.0, 2.0)
    y = np.clip(t - 4.0, 0.0, 1.5)
    theta = np.clip((t - 2.0) * math.pi / 4, 0.0, math.pi / 2)
    v = np.where((t < 2.0) | (t > 4.05), 1.0, 0.0)
    omega = np.where((t > 2.05) & (t < 3.95), math.pi / 4, 0.0)
    return Trajectory(t, x, y, theta, v, omega, v, omega)


@pytest.fixture(scope="module")
def tree() -> Tree:
    states = np.array([[0, 0, 0, 0, 0], [1, 0, 0, 1, 0], [1, 1, 0, 1, 0]], dtype=float)
    polyline = np.array([[0, 0], [1, 0], [np.nan, np.nan], [0, 0], [0.6, 0.4], [1, 1], [np.nan, np.nan]])
    return Tree(states, np.array([-1, 0, 0]), polyline)


def scenario(
    obstacles: Iterable[Obstacle] = (),
    footprint: Footprint | None = None,
    corner: tuple[float, float] = (3.0, 2.0),
    **goal: Any,
) -> Scenario:
    return Scenario(
        name="corner",
        world=World(Bounds((-1.0, -1.0), corner), obstacles),
        robot=Robot(footprint=Footprint.point() if footprint is None else footprint),
        start=State(0.0, 0.0, 0.3),
        goal=Goal(2.0, 1.5, 0.4, **goal),
    )


def result(tree: Tree, trajectory: Trajectory | None, status: str = "solved") -> PlanResult:
    return PlanResult(
        planner="cb-rrt",
        seed=1,
        status=status,
        trajectory=trajectory,
        count_nodes=lambda: 1228,
        samples=2412,
        planning_time=7.754e-3,
        make_tree=lambda: tree,
    )


def line(ax: Axes, label: str) -> Line2D:
    (found,) = (drawn for drawn in ax.lines if drawn.get_label() == label)
    return found


def points(ax: Axes, label: str) -> NDArray[np.float64]:
    """What a line goes through, shape (n, 2)."""
    return np.asarray(line(ax, label).get_xydata(), dtype=float)


def labels(ax: Axes) -> set[str]:
    return set(ax.get_legend_handles_labels()[1])


def test_the_plane_has_equal_scales_units_and_the_bounds(ax: Axes) -> None:
    assert draw_world(ax, scenario().world) is ax
    assert ax.get_aspect() == 1.0
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x [m]", "y [m]")
    (border,) = ax.patches
    np.testing.assert_allclose(border.get_window_extent().transformed(ax.transData.inverted()).extents, [-1, -1, 3, 2])
    assert ax.get_xlim()[0] < -1.0 and ax.get_xlim()[1] > 3.0


def test_thousands_of_obstacles_are_one_collection(ax: Axes) -> None:
    boxes = [Box((x, y), (x + 0.01, y + 0.01)) for x in np.linspace(-0.9, 2.9, 60) for y in np.linspace(-0.9, 1.9, 50)]
    draw_world(ax, World(Bounds((-1.0, -1.0), (3.0, 2.0)), boxes))
    (solids,) = ax.collections
    assert len(solids.get_paths()) == 3000


def test_a_world_without_obstacles_has_none_in_its_legend(ax: Axes) -> None:
    assert labels(draw_world(ax, scenario().world)) == set()


def test_obstacles_cover_their_area_and_leave_their_holes_free(ax: Axes) -> None:
    ring = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    hole = np.array([(0.25, 0.25), (0.75, 0.25), (0.75, 0.75), (0.25, 0.75)])
    obstacles = (Box((-0.9, -0.9), (-0.5, -0.3)), Disc((2.0, 0.0), 0.5), Polygon(np.array(ring), (hole,)))
    draw_world(ax, World(Bounds((-1.0, -1.0), (3.0, 2.0)), obstacles))
    (solids,) = ax.collections
    assert isinstance(solids, PathCollection)
    box, disc, polygon = solids.get_paths()
    np.testing.assert_allclose(box.get_extents().extents, [-0.9, -0.9, -0.5, -0.3])
    np.testing.assert_allclose(disc.get_extents().extents, [1.5, -0.5, 2.5, 0.5], atol=1e-3)
    outer, inner = polygon.to_polygons()
    np.testing.assert_allclose(np.unique(inner), [0.25, 0.75])
    assert _signed_area(np.asarray(outer)) == pytest.approx(1.0)
    assert _signed_area(np.asarray(inner)) == pytest.approx(-0.25)


def _signed_area(ring: NDArray[np.float64]) -> float:
    x, y = ring[:-1].T if np.array_equal(ring[0], ring[-1]) else ring.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def test_the_scene_shows_start_heading_and_goal_disc(ax: Axes) -> None:
    draw_scene(ax, scenario())
    np.testing.assert_array_equal(points(ax, "start"), [[0.0, 0.0]])
    (arrow,) = ax.texts
    x, y = arrow.xy  # type: ignore[attr-defined]
    assert math.atan2(y, x) == pytest.approx(0.3)
    discs = [patch for patch in ax.patches if isinstance(patch, Circle)]
    assert {(disc.center, disc.radius) for disc in discs} == {((2.0, 1.5), 0.4)}
    assert not [patch for patch in ax.patches if isinstance(patch, Wedge | PolygonPatch)]


def test_the_scene_shows_the_footprint_at_the_start_and_the_goal_heading(ax: Axes) -> None:
    drawn = scenario(footprint=SQUARE, theta=1.0, heading_tolerance=0.2)
    draw_scene(ax, drawn)
    (outline,) = (patch for patch in ax.patches if isinstance(patch, PolygonPatch))
    np.testing.assert_allclose(outline.get_xy()[:4], SQUARE.outline_at((0.0, 0.0, 0.3)))
    (wedge,) = (patch for patch in ax.patches if isinstance(patch, Wedge))
    assert (wedge.theta1, wedge.theta2) == pytest.approx((math.degrees(0.8), math.degrees(1.2)))
    x, y = ax.texts[1].xy  # type: ignore[attr-defined]
    assert math.atan2(y - 1.5, x - 2.0) == pytest.approx(1.0)


def test_the_tree_is_red_dots_and_thin_red_lines_with_gaps_between_the_edges(ax: Axes, tree: Tree) -> None:
    assert draw_tree(ax, tree) is ax
    nodes, edges = line(ax, "node"), line(ax, "edge")
    np.testing.assert_array_equal(points(ax, "node"), tree.states[:, :2])
    np.testing.assert_array_equal(points(ax, "edge"), tree.polyline)
    assert (nodes.get_marker(), nodes.get_linestyle()) == ("o", "None")
    assert same_color(nodes.get_color(), TREE_COLOR) and same_color(edges.get_color(), TREE_COLOR)
    assert edges.get_linewidth() < 1.0


def test_an_empty_tree_draws_nothing_and_fails_nowhere(ax: Axes) -> None:
    draw_tree(ax, Tree(np.empty((0, 5)), np.empty(0, dtype=np.int64), np.empty((0, 2))))
    assert len(points(ax, "node")) == 0


def test_the_path_is_green_and_its_point_turns_blue_squares(ax: Axes, trajectory: Trajectory) -> None:
    assert draw_trajectory(ax, trajectory) is ax
    path, turns = line(ax, "path"), line(ax, "point turn")
    np.testing.assert_array_equal(points(ax, "path"), trajectory.poses[:, :2])
    np.testing.assert_allclose(points(ax, "point turn"), [[2.0, 0.0]])
    assert same_color(path.get_color(), PATH_COLOR)
    assert turns.get_marker() == "s" and same_color(turns.get_markerfacecolor(), TURN_COLOR)
    assert not ax.collections


def test_a_path_without_point_turns_has_none_in_its_legend(ax: Axes) -> None:
    t, zero, one = np.arange(3.0), np.zeros(3), np.ones(3)
    draw_trajectory(ax, Trajectory(t, t, zero, zero, one, zero, one, zero))
    assert labels(ax) == {"path"}


def test_the_footprint_is_drawn_now_and_then_and_at_the_end(ax: Axes, trajectory: Trajectory) -> None:
    draw_trajectory(ax, trajectory, SQUARE)
    (outlines,) = ax.collections
    assert isinstance(outlines, PolyCollection)
    corners = [np.asarray(path.vertices)[:4] for path in outlines.get_paths()]
    assert 4 <= len(corners) <= 7
    assert any(np.allclose(c, SQUARE.outline_at(trajectory.poses[-1])) for c in corners)


def test_a_point_and_a_robot_that_stands_still_draw_no_more_than_one_outline(ax: Axes, trajectory: Trajectory) -> None:
    draw_trajectory(ax, trajectory, Footprint.point())
    assert not ax.collections
    draw_trajectory(ax, Trajectory(*np.zeros((8, 1))), SQUARE)
    assert len(ax.collections[0].get_paths()) == 1


def test_the_velocity_curves_are_in_m_per_s_and_degrees_per_s_with_dashed_limits(trajectory: Trajectory) -> None:
    axes = Figure().subplots(2)
    limits = Limits(v_min=-0.2, v_max=1.0)
    assert draw_velocities(axes, trajectory, limits) is axes
    assert (axes[0].get_ylabel(), axes[1].get_ylabel()) == ("v [m/s]", r"$\omega$ [deg/s]")
    assert axes[1].get_xlabel() == "t [s]"
    np.testing.assert_array_equal(points(axes[0], "velocity")[:, 1], trajectory.v)
    np.testing.assert_allclose(points(axes[1], "velocity")[:, 1], np.degrees(trajectory.omega))
    for ax, wanted in zip(axes, ([-0.2, 1.0], [-30.0, 30.0]), strict=True):
        dashed = [drawn for drawn in ax.lines if drawn.get_linestyle() == "--"]
        assert sorted(float(np.asarray(drawn.get_ydata())[0]) for drawn in dashed) == pytest.approx(wanted)
        assert line(ax, "command").get_drawstyle() == "steps-post"
        np.testing.assert_allclose(points(ax, "every second")[:, 0], np.arange(6.0))
        assert ax.get_ylim()[0] < wanted[0] and ax.get_ylim()[1] > wanted[1]
    np.testing.assert_allclose(points(axes[0], "every second")[:, 1], [1.0, 1.0, 0.0, 0.0, 0.0, 1.0])


def test_velocities_beyond_their_limits_stay_in_view(trajectory: Trajectory) -> None:
    axes = Figure().subplots(2)
    draw_velocities(axes, trajectory, Limits(v_max=0.5))
    assert axes[0].get_ylim()[1] > 1.0


def test_kinematic_velocities_are_drawn_as_the_jumps_they_are() -> None:
    axes = Figure().subplots(2)
    t, zero, one = np.arange(3.0), np.zeros(3), np.ones(3)
    draw_velocities(axes, Trajectory(t, t, zero, zero, one, zero, one, zero, kinematic=True), Limits())
    assert line(axes[0], "velocity").get_drawstyle() == "steps-pre"


def test_a_plan_shows_scene_tree_path_and_both_curves(tree: Tree, trajectory: Trajectory) -> None:
    obstacle = Box((0.0, 0.5), (0.5, 1.0))
    figure = draw_plan(result(tree, trajectory), scenario([obstacle], SQUARE))
    plane, upper, lower = figure.axes
    assert labels(plane) == {"obstacle", "start", "goal", "node", "edge", "path", "point turn", "footprint"}
    assert labels(upper) == labels(lower) == {"limit", "command", "velocity", "every second"}
    assert figure.get_suptitle() == "corner, cb-rrt\n1,228 nodes, 2,412 samples, 7.75 ms, 5.50 s of driving"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (7.754e-3, "7.75 ms"),
        (0.9996, "1 s"),
        (0.9994, "999 ms"),
        (1.2345, "1.23 s"),
        (99.96, "100 s"),
        (4321.0, "4,321 s"),
    ],
)
def test_times_have_three_digits_and_never_an_exponent(seconds: float, text: str) -> None:
    """A planning time of 1.2 s was told as 1.2e+03 ms."""
    assert time_text(seconds) == text


@pytest.mark.parametrize("corner", [(2.5, 2.5), (19.0, 2.0), (3.0, 9.0)], ids=["square", "wide", "tall"])
def test_the_scene_is_the_largest_part_whatever_its_shape(
    tree: Tree, trajectory: Trajectory, corner: tuple[float, float]
) -> None:
    figure = draw_plan(result(tree, trajectory), scenario(corner=corner))
    figure.draw_without_rendering()
    plane, *curves = (ax.get_position() for ax in figure.axes)
    assert all(plane.width * plane.height > one.width * one.height for one in curves)
    is_below = all(one.y1 < plane.y0 for one in curves)
    assert is_below == (corner == (19.0, 2.0))
    assert is_below or all(one.x0 > plane.x1 for one in curves)


@pytest.mark.parametrize("solved", [False, True])
@pytest.mark.parametrize("corner", [(2.5, 2.5), (19.0, 2.0), (3.0, 9.0)], ids=["square", "wide", "tall"])
def test_nothing_in_a_plan_is_clipped_or_on_top_of_the_data(
    tree: Tree, trajectory: Trajectory, solved: bool, corner: tuple[float, float]
) -> None:
    long_name = replace(
        scenario(footprint=SQUARE, corner=corner),
        name="a scene with a name far too long for one line, costing 5 $ or 6 $",
    )
    figure = draw_plan(result(tree, trajectory if solved else None), long_name)
    figure.draw_without_rendering()
    width, height = figure.bbox.size
    (title,) = figure.texts
    assert title.get_window_extent().x0 >= 0 and title.get_window_extent().x1 <= width
    for ax in figure.axes:
        box = ax.get_tightbbox()
        assert box is not None
        assert box.x0 >= 0 and box.y0 >= 0 and box.x1 <= width and box.y1 <= height
        legend = ax.get_legend()
        assert legend is None or legend.get_window_extent().y0 > ax.get_window_extent().y1


def test_a_plan_that_failed_shows_its_tree_and_its_status(tree: Tree) -> None:
    figure = draw_plan(result(tree, None, "sample limit"), scenario([Box((0.0, 0.5), (0.5, 1.0))]))
    (plane,) = figure.axes
    assert labels(plane) == {"obstacle", "start", "goal", "node", "edge"}
    assert figure.get_suptitle() == "corner, cb-rrt\n1,228 nodes, 2,412 samples, 7.75 ms, sample limit"


def test_a_pdf_embeds_its_fonts_as_true_type(tree: Tree, trajectory: Trajectory, tmp_path: Path) -> None:
    """Publishers refuse Type 3, which is what matplotlib embeds if nobody says otherwise."""
    save_figure(draw_plan(result(tree, trajectory), scenario()), tmp_path / "plan.PDF")
    content = (tmp_path / "plan.PDF").read_bytes()
    assert content.startswith(b"%PDF")
    assert b"/FontFile2" in content
    assert re.search(rb"/Subtype\s*/CIDFontType2", content)
    assert not re.search(rb"/Subtype\s*/Type3", content)


def test_figures_leave_no_trace_in_pyplot(tree: Tree, trajectory: Trajectory) -> None:
    before = pyplot.get_fignums()
    draw_plan(result(tree, trajectory), scenario()).savefig(io.BytesIO(), format="svg")
    assert pyplot.get_fignums() == before


class TestExtension:
    NODE = State(0.5, -0.2, 0.3, 0.4, 0.1)
    SAMPLE = (3.0, 1.5)

    def test_it_starts_at_the_node_and_ends_where_the_planner_would(self, ax: Axes) -> None:
        assert draw_extension(ax, self.NODE, self.SAMPLE, Robot(), PlanningSettings()) is ax
        found = drive(WIDE, self.NODE, self.SAMPLE, model_of(OPEN_LOOP))
        np.testing.assert_array_equal(points(ax, "node"), [self.NODE[:2]])
        np.testing.assert_allclose(points(ax, "motion")[0], self.NODE[:2])
        np.testing.assert_allclose(points(ax, "motion")[-1], found.state[:2], atol=1e-12)
        np.testing.assert_allclose(points(ax, "new node"), [found.state[:2]], atol=1e-12)

    def test_the_error_posture_goes_along_the_heading_and_then_across(self, ax: Axes) -> None:
        draw_extension(ax, self.NODE, self.SAMPLE, Robot(), PlanningSettings(look_ahead=1.5))
        node, corner, reference = points(ax, "error posture")
        np.testing.assert_allclose(reference, points(ax, "reference")[0])
        assert math.dist(node, reference) == pytest.approx(1.5)
        assert math.atan2(*(corner - node)[::-1]) == pytest.approx(0.3)
        assert np.dot(corner - node, reference - corner) == pytest.approx(0.0, abs=1e-12)
        shown = [text.get_text() for text in ax.texts if "=" in text.get_text()]
        assert shown[0] == f"$x_e$ = {math.dist(node, corner):.2f} m"

    def test_a_sample_behind_is_a_point_turn(self, ax: Axes) -> None:
        draw_extension(ax, State(0.0, 0.0), (-2.0, 0.5), Robot(), PlanningSettings())
        np.testing.assert_allclose(points(ax, "motion"), 0.0, atol=1e-12)

    def test_s_rrt_has_three_choices_and_takes_the_one_that_ends_nearest(self, ax: Axes) -> None:
        draw_extension(ax, self.NODE, self.SAMPLE, Robot(), PlanningSettings(), "s-rrt")
        found = drive(WIDE, self.NODE, self.SAMPLE, model_of(STEERING))
        np.testing.assert_allclose(points(ax, "motion")[-1], found.state[:2], atol=1e-12)
        left_out = [drawn for drawn in ax.lines if drawn.get_label() == "left out"]
        assert len(left_out) == 2
        reference = points(ax, "reference")[0]
        ends = [np.asarray(drawn.get_xydata())[-1] for drawn in left_out]
        assert min(math.dist(end, reference) for end in ends) > math.dist(points(ax, "motion")[-1], reference)

    def test_every_arrow_is_in_view(self, ax: Axes) -> None:
        """An arrow whose tip was outside of the axes was not drawn at all."""
        draw_extension(ax, State(0.0, 0.0, 0.3), (-1.8, 1.0), Robot(), PlanningSettings())
        ax.figure.draw_without_rendering()
        (x0, x1), (y0, y1) = ax.get_xlim(), ax.get_ylim()
        tips = [text.xy for text in ax.texts if not text.get_text()]  # type: ignore[attr-defined]
        assert len(tips) == 3
        assert all(x0 < x < x1 and y0 < y < y1 for x, y in tips)


def test_a_long_drive_has_a_dot_every_few_seconds() -> None:
    """Of one that took minutes, the dots hid the curve."""
    t = np.linspace(0.0, 115.0, 231)
    zero, one = np.zeros(231), np.ones(231)
    axes = Figure().subplots(2)
    draw_velocities(axes, Trajectory(t, t, zero, zero, one, zero, one, zero), Limits())
    np.testing.assert_allclose(points(axes[0], "every 5 s")[:, 0], np.arange(0.0, 116.0, 5.0))
