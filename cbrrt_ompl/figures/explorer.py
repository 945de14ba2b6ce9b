"""A scenario to play with in a notebook: click to set start and goal, and see the plan."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from matplotlib.backend_bases import MouseButton, MouseEvent

from cbrrt_ompl.errors import CbrrtError
from cbrrt_ompl.figures.layout import NOTEBOOK_DPI, plane_alone
from cbrrt_ompl.figures.scene import draw_scene
from cbrrt_ompl.figures.style import legend_above, shrink_labels, time_text
from cbrrt_ompl.figures.trajectory import draw_trajectory
from cbrrt_ompl.figures.tree import draw_tree
from cbrrt_ompl.planning import PlanResult, plan
from cbrrt_ompl.scenario.scenario import Scenario

HINT = "click: goal; right click, or click with shift: start"
WITHOUT = "(sliders need ipywidgets, clicks ipympl as well: pip install 'cbrrt-ompl[notebooks]')"


def explore(scenario: Scenario, planner: str = "cb-rrt-compiled", seed: int = 1, time_limit: float = 1.0) -> Explorer:
    """Show a scenario with its plan, to be changed by sliders and clicks in a notebook.

    Args:
        scenario: what to begin with.
        planner: who plans.
        seed: of the random numbers.
        time_limit: of each plan [s].

    Returns:
        What a notebook shows: the plane with sliders beside it (with ipywidgets), clickable (with ipympl as well), and
        a line of text without them.

    Raises:
        CbrrtError: if the planner cannot plan in the scenario.
    """
    return Explorer(scenario, planner, seed, time_limit)


class Explorer:
    """A scenario, its plan, and a figure of both whose axes stay where they are.

    Attributes:
        scenario: the present one.
        result: its plan.
        message: what came of the last change, one line.
    """

    def __init__(self, scenario: Scenario, planner: str, seed: int, time_limit: float) -> None:
        """Plan, and draw."""
        self.scenario, self._planner, self._seed, self._time_limit = scenario, planner, seed, time_limit
        self.figure, self._ax = plane_alone(scenario.world.bounds)
        self.figure.set_dpi(NOTEBOOK_DPI)
        self._listeners: list[Any] = []
        self.result: PlanResult = self._plan(scenario)
        self.message = self._told()
        self._draw()

    def change(self, **changes: float) -> None:
        """Plan for another start, goal or seed; what cannot be is told, and changes nothing.

        Args:
            changes: ``start_x``, ``start_y``, ``start_theta``, ``goal_x``, ``goal_y``, ``seed`` [m, rad].
        """
        self._seed = int(changes.pop("seed", self._seed))
        parts = {
            part: {name.removeprefix(f"{part}_"): value for name, value in changes.items() if name.startswith(part)}
            for part in ("start", "goal")
        }
        try:
            start, goal = self.scenario.start._replace(**parts["start"]), replace(self.scenario.goal, **parts["goal"])
            scenario = replace(self.scenario, start=start, goal=goal)
            self.result = self._plan(scenario)
        except CbrrtError as error:
            self.message = str(error).splitlines()[0]
        else:
            self.scenario, self.message = scenario, self._told()
            self._draw()
        for listener in self._listeners:
            listener()

    def click(self, event: MouseEvent) -> None:
        """Set the goal, or with the right button or shift the start, to where somebody clicked."""
        if event.inaxes is not self._ax or event.xdata is None or event.ydata is None:
            return
        part = "start" if event.button is MouseButton.RIGHT or event.key == "shift" else "goal"
        self.change(**{f"{part}_x": float(event.xdata), f"{part}_y": float(event.ydata)})

    def __repr__(self) -> str:
        """The scenario and the outcome of the plan."""
        return f"{self.scenario.name}: {self.message}"

    def _plan(self, scenario: Scenario) -> PlanResult:
        return plan(scenario, self._planner, self._seed, self._time_limit)

    def _told(self) -> str:
        """The outcome of the plan, one line."""
        found = self.result.trajectory
        driving = "" if found is None else f", {found.duration:.2f} s of driving"
        return f"{self.result.status}, {self.result.nodes:,} nodes, {time_text(self.result.planning_time)}{driving}"

    def _draw(self) -> None:
        """Draw everything anew; the axes show the bounds, as ever."""
        self._ax.clear()
        draw_scene(self._ax, self.scenario)
        draw_tree(self._ax, self.result.tree)
        if self.result.trajectory is not None:
            draw_trajectory(self._ax, self.result.trajectory, self.scenario.robot.footprint)
        legend_above(self._ax)
        shrink_labels(self.figure)

    def _ipython_display_(self) -> None:
        """Sliders and picture; a line of text where there is no ipywidgets."""
        from IPython.display import display

        try:
            import ipywidgets
        except ImportError:
            print(f"{self!r} {WITHOUT}")
            return
        display(self.widget(ipywidgets))

    def widget(self, ipywidgets: Any) -> Any:
        """Sliders beside the picture, and a line of text below.

        Args:
            ipywidgets: the module.
        """
        picture, show = self._picture(ipywidgets)
        text = ipywidgets.Label()
        (x0, y0), (x1, y1) = self.scenario.world.bounds.min, self.scenario.world.bounds.max
        start, goal = self.scenario.start, self.scenario.goal
        sliders = {}
        for name, value, low, high in (
            ("start_x", start.x, x0, x1), ("start_y", start.y, y0, y1), ("start_theta", start.theta, -3.14, 3.14),
            ("goal_x", goal.x, x0, x1), ("goal_y", goal.y, y0, y1),
        ):  # fmt: skip
            look = {"step": (high - low) / 200.0, "continuous_update": False, "readout_format": ".2f"}
            sliders[name] = ipywidgets.FloatSlider(value, min=low, max=high, description=name.replace("_", " "), **look)
        sliders["seed"] = ipywidgets.IntSlider(self._seed, min=0, max=99, description="seed", continuous_update=False)

        def show_all() -> None:
            show()
            text.value = f"{self.message}   ({HINT})"

        for name, slider in sliders.items():
            slider.observe(lambda change, name=name: self.change(**{name: change["new"]}), names="value")
        self._listeners = [show_all]
        show_all()
        return ipywidgets.VBox([ipywidgets.HBox([picture, ipywidgets.VBox(list(sliders.values()))]), text])

    def _picture(self, ipywidgets: Any) -> tuple[Any, Any]:
        """A canvas that hears clicks, where there is ipympl, or a picture; and what shows the present state in it."""
        try:
            from ipympl.backend_nbagg import Canvas
        except ImportError:
            image = ipywidgets.Image(format="png")

            def show() -> None:
                image.value = self.figure._repr_png_()

            return image, show
        from ipympl.backend_nbagg import FigureManager

        canvas = Canvas(self.figure)
        FigureManager(canvas, 0)
        canvas.header_visible = canvas.toolbar_visible = False
        canvas.mpl_connect("button_press_event", self.click)
        return canvas, canvas.draw_idle
