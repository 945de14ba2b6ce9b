"""What values show of themselves in a notebook, and the explorer that plans where one clicks."""

from __future__ import annotations

import io
import subprocess
import sys

import numpy as np
import pytest
from matplotlib.backend_bases import MouseButton, MouseEvent
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from cbrrt_ompl import Bounds, Box, Goal, PlanResult, Scenario, State, Trajectory, World, plan
from cbrrt_ompl.figures import explore
from cbrrt_ompl.figures.explorer import Explorer
from cbrrt_ompl.figures.notebook import figure_of


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    world = World(Bounds((0.0, 0.0), (8.0, 4.0)), [Box((3.0, 0.0), (3.4, 1.0))])
    return Scenario(name="hall", world=world, start=State(1.0, 2.0), goal=Goal(7.0, 2.0, 0.4))


@pytest.fixture(scope="module")
def result(scenario: Scenario) -> PlanResult:
    return plan(scenario, "cb-rrt-compiled", seed=1)


@pytest.mark.parametrize("name", ["world", "scenario", "trajectory", "result"])
def test_a_value_shows_itself_as_a_picture(name: str, scenario: Scenario, result: PlanResult) -> None:
    values = {"world": scenario.world, "scenario": scenario, "trajectory": result.trajectory, "result": result}
    png = values[name]._repr_png_()
    assert len(png) < 300_000
    with Image.open(io.BytesIO(png)) as image:
        assert image.format == "PNG" and min(image.size) > 200
        assert len(np.unique(np.asarray(image.convert("L")))) > 10


def test_the_picture_of_a_plan_has_its_scene_and_its_velocities(result: PlanResult) -> None:
    plane, upper, lower = figure_of(result).axes
    assert {"obstacle", "start", "goal", "path"} <= set(plane.get_legend_handles_labels()[1])
    assert (upper.get_ylabel(), lower.get_ylabel()) == ("v [m/s]", r"$\omega$ [deg/s]")


def test_a_trajectory_whose_limits_nobody_knows_shows_none() -> None:
    t, zero, one = np.arange(3.0), np.zeros(3), np.ones(3)
    _, upper, _ = figure_of(Trajectory(t, t, zero, zero, one, zero, one, zero)).axes
    assert "limit" not in upper.get_legend_handles_labels()[1]


def test_a_result_without_its_scenario_shows_nothing() -> None:
    stub = PlanResult("cb-rrt", 1, "time limit", None, lambda: 0, 0, 0.0, lambda: None)  # type: ignore[arg-type, return-value]
    assert stub._repr_png_() is None


def test_texts_are_short(scenario: Scenario, result: PlanResult) -> None:
    assert repr(scenario.world) == "World(8 x 4 m, 1 obstacle)"
    assert repr(scenario) == "Scenario('hall', World(8 x 4 m, 1 obstacle), (1, 2) to (7, 2))"
    assert repr(result.trajectory).startswith("Trajectory(") and repr(result.trajectory).endswith(" rows)")
    assert repr(result).startswith("PlanResult(cb-rrt-compiled, solved, ")
    assert max(map(len, map(repr, (scenario, result, result.trajectory)))) < 120


def test_planning_imports_no_matplotlib() -> None:
    code = "import sys, cbrrt_ompl as c; c.plan, c.verify, c.Scenario, c.improve; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


class TestExplorer:
    @pytest.fixture
    def explorer(self, scenario: Scenario) -> Explorer:
        return explore(scenario)

    def click(self, explorer: Explorer, x: float, y: float, button: MouseButton, key: str | None = None) -> None:
        canvas = FigureCanvasAgg(explorer.figure)
        canvas.draw()
        px, py = explorer.figure.axes[0].transData.transform((x, y))
        explorer.click(MouseEvent("button_press_event", canvas, px, py, button, key))

    def test_a_click_sets_the_goal_and_plans_to_it(self, explorer: Explorer) -> None:
        self.click(explorer, 6.0, 3.0, MouseButton.LEFT)
        goal = explorer.scenario.goal
        assert (goal.x, goal.y) == pytest.approx((6.0, 3.0), abs=0.02)
        assert explorer.result.trajectory is not None
        assert not goal.violations(State(*explorer.result.trajectory.states[-1]))

    @pytest.mark.parametrize(("button", "key"), [(MouseButton.RIGHT, None), (MouseButton.LEFT, "shift")])
    def test_the_right_button_or_shift_sets_the_start(
        self, explorer: Explorer, button: MouseButton, key: str | None
    ) -> None:
        self.click(explorer, 2.0, 3.0, button, key)
        assert explorer.scenario.start[:2] == pytest.approx((2.0, 3.0), abs=0.02)

    def test_a_start_in_an_obstacle_is_told_and_changes_nothing(self, explorer: Explorer, scenario: Scenario) -> None:
        self.click(explorer, 3.2, 0.5, MouseButton.RIGHT)
        assert explorer.scenario == scenario
        assert explorer.message.startswith("start: got [3.")

    def test_the_axes_stay_where_they_are(self, explorer: Explorer) -> None:
        ax = explorer.figure.axes[0]
        before = ax.get_xlim(), ax.get_ylim()
        self.click(explorer, 6.0, 3.0, MouseButton.LEFT)
        explorer.change(seed=5, start_theta=1.0)
        assert (ax.get_xlim(), ax.get_ylim()) == before

    def test_a_click_beside_the_plane_does_nothing(self, explorer: Explorer, scenario: Scenario) -> None:
        self.click(explorer, -100.0, 3.0, MouseButton.LEFT)
        assert explorer.scenario == scenario

    def test_sliders_plan_again_and_the_text_tells_what_came_of_it(self, explorer: Explorer) -> None:
        ipywidgets = pytest.importorskip("ipywidgets")
        box = explorer.widget(ipywidgets)
        (_, sliders), text = box.children[0].children, box.children[1]
        slider = next(one for one in sliders.children if one.description == "goal x")
        slider.value = 5.0
        assert explorer.scenario.goal.x == pytest.approx(5.0, abs=0.03)
        assert text.value.startswith("solved, ")

    def test_without_widgets_there_is_a_line_of_text(
        self, explorer: Explorer, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.setitem(sys.modules, "ipywidgets", None)
        explorer._ipython_display_()
        told = capsys.readouterr().out
        assert told.startswith("hall: solved, ") and "pip install 'cbrrt-ompl[notebooks]'" in told
