"""The demonstration: a run of both planners of the paper on its two scenes, beside the published numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from matplotlib.figure import Figure

from cbrrt_ompl.figures import draw_plan, draw_velocities
from cbrrt_ompl.figures.saving import save_figure
from cbrrt_ompl.files import write_file
from cbrrt_ompl.ompl_plugin.availability import has_ompl
from cbrrt_ompl.planners.registry import planner_named
from cbrrt_ompl.planning import PlanResult, plan
from cbrrt_ompl.reproduce.published import PAPER, Published
from cbrrt_ompl.scenario.scenario import Scenario, load_scenario
from cbrrt_ompl.scenario.sources import scenario_path
from cbrrt_ompl.verification import verify

TIME_LIMIT = 300.0
"""Planning time that a run may take [s]; the paper's limit is the number of samples."""

WARM_UP = 0.01
"""Planning time of a run before the measured ones, which makes most of the clearance map [s]."""

REPRODUCTION_RUNS = 8
"""Runs of each planner in each scene of the short report at the end."""

SUFFIXES = ("", "-compiled")
"""What is added to the paper's names of the planners: inside OMPL, and without it."""

Watch: TypeAlias = Callable[[int, str], AbstractContextManager[Callable[[int, float], None] | None]]
"""Makes the progress report of one run from its number of samples at most and its name."""


COLUMNS = (
    "scene",
    "planner",
    "result",
    "nodes",
    "nodes (paper)",
    "samples",
    "time [ms]",
    "time [ms] (paper)",
    "duration [s]",
    "length [m]",
    "point turns",
    "verified",
)


@dataclass(frozen=True)
class DemoRun:
    """One planner on one scene."""

    scene: str
    """Name of the scenario file without its suffix."""
    scenario: Scenario
    """What was planned for."""
    result: PlanResult
    """The plan."""
    verified: bool | None
    """Whether the trajectory passed verification; None where there is none."""

    @property
    def published(self) -> Published:
        """What the paper reports."""
        return PAPER[self.scene, self.result.planner.removesuffix("-compiled")]

    @property
    def as_published(self) -> bool:
        """Whether it solved what the paper's run solved and failed where that failed, with a valid trajectory."""
        return self.result.solved == (self.published.nodes is not None) and self.verified is not False

    def cells(self) -> tuple[str, ...]:
        """The row of the table, in the order of COLUMNS."""
        result, paper, trajectory = self.result, self.published, self.result.trajectory
        outcome = "solved" if result.solved else f"not solved ({result.status})"
        if not result.solved and self.as_published:
            outcome = "not solved (as in the paper)"
        return (
            self.scene,
            result.planner,
            outcome,
            f"{result.nodes:,}",
            "failure" if paper.nodes is None else f"{paper.nodes:,}",
            f"{result.samples:,}",
            f"{1e3 * result.planning_time:,.1f}",
            "failure" if paper.milliseconds is None else f"{paper.milliseconds:g}",
            "-" if trajectory is None else f"{trajectory.duration:.1f}",
            "-" if trajectory is None else f"{trajectory.length:.1f}",
            "-" if trajectory is None else f"{len(trajectory.point_turns)}",
            "-" if self.verified is None else ("yes" if self.verified else "NO"),
        )


def run_demo(output: Path, seed: int | None, watch: Watch) -> Iterator[DemoRun]:
    """Run both planners on both scenes and write what each run gives.

    Without OMPL the compiled planners run alone.

    Args:
        output: folder that takes the scenarios, trajectories (CSV), figures (PNG) and the table (Markdown).
        seed: seed of every run.
        watch: makes the progress report of a run.

    Yields:
        Each run when it is done and written.
    """
    pairs = [(scene, planner + suffix) for scene, planner in PAPER for suffix in SUFFIXES if has_ompl() or suffix]
    scenarios = {}
    for scene, planner in pairs:
        if scene not in scenarios:
            path = scenario_path(scene)
            write_file(output / path.name, path.read_bytes())
            scenarios[scene] = load_scenario(path)
        plan(scenarios[scene], planner, seed, WARM_UP)
    runs = []
    for scene, planner in pairs:
        scenario = scenarios[scene]
        with watch(planner_named(planner).settings(scenario.planning).max_samples, f"{scene} {planner}") as progress:
            result = plan(scenario, planner, seed, TIME_LIMIT, progress=progress)
        verified = None if result.trajectory is None else verify(result.trajectory, scenario).ok
        run = DemoRun(scene, scenario, result, verified)
        _write(output / f"{scene}_{planner}", run)
        runs.append(run)
        yield run
    write_file(output / "results.md", markdown(runs, seed))


def markdown(runs: Sequence[DemoRun], seed: int | None) -> str:
    """The table of all runs with a heading and the caveats, in Markdown."""
    rows = [COLUMNS, tuple("---" for _ in COLUMNS), *(run.cells() for run in runs)]
    table = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    return f"# Both planners on the paper's scenes\n\n{table}\n\n{caveat(seed)}\n"


def caveat(seed: int | None) -> str:
    """How the numbers may be read."""
    return (
        f"One run each, seed {seed}; the paper reports one run each as well, on other hardware. The scenes are "
        "reconstructions: the published numbers are typical of them, the published figures were not at hand."
    )


def _write(stem: Path, run: DemoRun) -> None:
    """Write figures and trajectory of one run; ``stem`` is their path without suffix."""
    save_figure(draw_plan(run.result, run.scenario), stem.with_name(f"{stem.name}.png"))
    trajectory = run.result.trajectory
    if trajectory is None:
        return
    trajectory.save(stem.with_name(f"{stem.name}.csv"))
    if run.scene == "paper_case2":
        figure = Figure(figsize=(6.4, 4.0), layout="constrained", dpi=150)
        draw_velocities(figure.subplots(2, sharex=True), trajectory, run.scenario.robot.limits)
        figure.axes[0].legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, fontsize=8, frameon=False)
        save_figure(figure, stem.with_name(f"{stem.name}_velocities.png"))
