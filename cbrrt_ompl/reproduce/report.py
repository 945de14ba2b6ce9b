"""The report: tables, figures and verdicts, put together from what was measured."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from cbrrt_ompl.benchmark.document import Block, Document, Heading, Picture, Table, Text
from cbrrt_ompl.planning import PlanResult
from cbrrt_ompl.reproduce import charts
from cbrrt_ompl.reproduce.claim_blocks import Evidence, Summary
from cbrrt_ompl.reproduce.claims import QueryCosts, make_claims
from cbrrt_ompl.reproduce.grids import GridStudy
from cbrrt_ompl.reproduce.numbers import (
    count_text,
    median_text,
    number,
    quartiles_text,
    ratio_text,
    share_text,
    whole,
)
from cbrrt_ompl.reproduce.outcomes import Outcomes, Sample, ratio_between
from cbrrt_ompl.reproduce.published import PAPER, PROCESSOR, SPEED_RATIO, TREE_SIZES
from cbrrt_ompl.reproduce.scenes import CASE_1, CASE_2, OTHERS, READINGS, ROOMS, SHIFTS, shift_title, title_of
from cbrrt_ompl.reproduce.study import COMPILED, IN_OMPL, NAIVE, NEIGHBOURS
from cbrrt_ompl.reproduce.verdicts import MEANINGS, Claim
from cbrrt_ompl.scenario.scenario import Scenario


@dataclass(frozen=True, eq=False)
class Material:
    """All that the report is made of."""

    outcomes: Outcomes
    scenarios: Mapping[str, Scenario]
    """The paper's two cases."""
    costs: QueryCosts
    grids: Sequence[GridStudy]
    failures: Mapping[str, str]
    """Series of which runs are missing, and why."""
    circumstances: str
    """Command, date, machine and versions, as a paragraph."""
    runs: int
    """Runs of a series."""
    jobs: int
    """Processes side by side."""
    brief: bool

    def sample(self, scene: str, planner: str, variant: str = "") -> Sample | None:
        """A sample, if there is one."""
        return self.outcomes.get(scene, planner, variant)


def make_report(material: Material) -> tuple[Document, list[Claim]]:
    """The report and the claims in its summary."""
    claims = make_claims(material.outcomes, material.costs, material.grids)
    plans = _typical_plans(material)
    blocks = [
        *_opening(material, claims),
        *_tables(material),
        *_paper_figures(material, plans),
        *_shifts(material),
        *_other_scenes(material),
        *_readings(material),
        *_neighbours(material),
        *_limits(material),
        *_grids(material, plans),
        *_naive(material),
        Heading("Rules and evidence"),
        Text("Every claim with its rule, each place where it was tested, and the answer there."),
        Evidence(claims),
        *_method(material),
    ]
    return Document("CB-RRT: the paper, measured again", blocks), claims


def _opening(material: Material, claims: Sequence[Claim]) -> Iterator[Block]:
    """What was done, and the verdicts."""
    brief = "This is the short report; `cbrrt reproduce` makes the whole one. " if material.brief else ""
    yield Text(
        'The paper "Practical Probabilistic Trajectory Planning Scheme based on the Rapidly-Exploring Random Trees for '
        'Two-Wheeled Mobile Robots" reports one run of each planner. Here are '
        f"{material.outcomes.total:,} runs: {material.runs} of each planner in each scene, or as many as a table says. "
        f"{brief}The scenes are **reconstructions**: the paper's figures were not at hand, and walls and gaps were "
        "searched so that the published numbers are typical. What holds in them alone is therefore a weak statement, "
        "and each claim was tested with moved gaps and in other scenes too."
    )
    yield Text(material.circumstances)
    yield Heading("Summary")
    yield Text(
        f"{_counted(claims)} The verdicts follow from the measured numbers by the rules at the end of the report."
    )
    yield Summary(claims)
    for name, reason in material.failures.items():
        yield Text(f"**Missing:** runs of {name}: {reason}.")


def _counted(claims: Sequence[Claim]) -> str:
    """How many claims have which verdict."""
    counts = {verdict: sum(claim.verdict is verdict for claim in claims) for verdict in MEANINGS}
    said = ", ".join(f"{count} × {verdict.value}" for verdict, count in counts.items() if count)
    return f"{len(claims)} claims: {said}."


def _tables(material: Material) -> Iterator[Block]:
    """Tables 1 and 2 of the paper."""
    yield Heading("Tables 1 and 2")
    for table, scenes in (("Table 1, Case 1", (CASE_1,)), ("Table 2, Case 2", (CASE_2, ROOMS))):
        rows = [
            _table_row(sample, scene)
            for scene in scenes
            for planner in (*IN_OMPL, *COMPILED)
            if (sample := material.sample(scene, planner)) is not None
        ]
        header = (
            "scene", "planner", "runs", "solved", "nodes: median", "nodes: quartiles", "nodes: paper",
            "time [ms]: median", "time [ms]: quartiles", "time [ms]: paper",
        )  # fmt: skip
        yield Text(f"**{table}**")
        yield Table(header, rows, left=2)
    yield Text(
        "In brackets: 95 % intervals. A run that needs more than 50,000 samples has failed, and counts as infinite in "
        "medians and quartiles. Planners without the suffix `-compiled` run in OMPL's `control::RRT`. Times are those "
        f"of the search alone, on another computer than the paper's ({PROCESSOR})."
    )
    rows = []
    for name, (cb, s) in (("in OMPL", IN_OMPL), ("compiled", COMPILED)):
        one, other = material.sample(CASE_1, s), material.sample(CASE_1, cb)
        if one is not None and other is not None:
            rows.append((name, *(ratio_text(ratio_between(one, other, measure)) for measure in ("nodes", "time"))))
    published = PAPER[CASE_1, "s-rrt"].nodes, PAPER[CASE_1, "cb-rrt"].nodes
    if None not in published:
        rows.append(("paper", number(658 / 228), number(SPEED_RATIO)))
    yield Text("**Case 1: S-RRT as a multiple of CB-RRT**")
    yield Table(("", "nodes", "time"), rows)
    yield _picture(
        "nodes.png", charts.nodes_figure(material.outcomes), "Nodes of every run, and the published numbers."
    )


def _table_row(sample: Sample, scene: str) -> tuple[str, ...]:
    """One planner in one scene."""
    planner = sample.key.planner
    paper = PAPER[CASE_1 if scene == CASE_1 else CASE_2, planner.removesuffix("-compiled")]
    return (
        title_of(scene),
        planner,
        whole(len(sample)),
        share_text(sample.succeeded),
        median_text(sample, "nodes"),
        quartiles_text(sample.quartiles("nodes")),
        "failure" if paper.nodes is None else whole(paper.nodes),
        median_text(sample, "time", 1e3),
        quartiles_text(sample.quartiles("time"), 1e3),
        "failure" if paper.milliseconds is None else f"{paper.milliseconds:g}",
    )


def _typical_plans(material: Material) -> dict[tuple[str, str], PlanResult]:
    """Typical runs of the planners in OMPL, made again: those of the paper's figures."""
    plans = {}
    for scene, planner in ((CASE_1, "cb-rrt"), (CASE_1, "s-rrt"), (CASE_2, "cb-rrt")):
        sample = material.sample(scene, planner)
        if sample is not None and sample.succeeded.count:
            plans[scene, planner] = charts.typical_plan(sample, material.scenarios[scene])
    return plans


def _paper_figures(material: Material, plans: Mapping[tuple[str, str], PlanResult]) -> Iterator[Block]:
    """Figures 3 to 6 of the paper."""
    yield Heading("Figures 3 to 6, made again")
    yield Text("Each shows the run that is nearest to the medians of all runs in nodes and duration, in OMPL.")
    yield _picture("fig3.png", charts.scenes_figure(material.scenarios), "Fig. 3: the two scenes, as reconstructed.")
    first = [plans[CASE_1, planner] for planner in IN_OMPL if (CASE_1, planner) in plans]
    if first:
        figure = charts.trees_figure(first, material.scenarios[CASE_1])
        yield _picture("fig4.png", figure, "Fig. 4: trees and paths of both planners in Case 1.")
    second = plans.get((CASE_2, "cb-rrt"))
    if second is not None:
        figure = charts.path_figure(second, material.scenarios[CASE_2])
        yield _picture("fig5.png", figure, "Fig. 5: the path of CB-RRT in Case 2, point turns as blue squares.")
        figure = charts.velocities_figure(second, material.scenarios[CASE_2])
        yield _picture("fig6.png", figure, "Fig. 6: its velocities over time, a dot every second, within the limits.")


def _shifts(material: Material) -> Iterator[Block]:
    """What centimetres do."""
    yield Heading("Gaps moved by centimetres")
    rows = []
    offsets = sorted({0.0, *SHIFTS})
    for scene in (CASE_1, CASE_2):
        for offset in offsets:
            cb, s = (material.sample(scene, planner, shift_title(offset) if offset else "") for planner in COMPILED)
            if cb is not None and s is not None:
                name = f"{100 * offset:+.0f} cm" if offset else "as they are"
                rows.append((title_of(scene), name, *_both(cb, s)))
    yield Table(("scene", "gaps", *_BOTH), rows, left=2)
    yield _picture(
        "shifts.png",
        charts.shifts_figure(material.outcomes, SHIFTS),
        "Median nodes of the compiled planners against how far all gaps were moved along their walls.",
    )


_BOTH = (
    "CB-RRT: solved",
    "S-RRT: solved",
    "CB-RRT: nodes",
    "S-RRT: nodes",
    "nodes: S / CB",
    "time: S / CB",
)
"""Columns of :func:`_both`."""


def _both(cb: Sample, s: Sample) -> tuple[str, ...]:
    """Both planners in one place."""
    return (
        share_text(cb.succeeded),
        share_text(s.succeeded),
        median_text(cb, "nodes"),
        median_text(s, "nodes"),
        ratio_text(ratio_between(s, cb, "nodes")),
        ratio_text(ratio_between(s, cb, "time")),
    )


def _other_scenes(material: Material) -> Iterator[Block]:
    """Scenes that the paper does not have."""
    rows = []
    for scene in (ROOMS, *OTHERS):
        cb, s = (material.sample(scene, planner) for planner in COMPILED)
        if cb is not None and s is not None:
            rows.append((title_of(scene), *_both(cb, s)))
    if rows:
        yield Heading("Other scenes")
        yield Text(
            "Scenes that come with the package, with robots of their own and passages for them; compiled planners. "
            "The two rooms are the other reading of Case 2."
        )
        yield Table(("scene", *_BOTH), rows)


def _readings(material: Material) -> Iterator[Block]:
    """What our readings of the paper do to the numbers."""
    series = (
        (CASE_1, COMPILED[0], "Case 1, CB-RRT"),
        (CASE_1, COMPILED[1], "Case 1, S-RRT"),
        (CASE_2, COMPILED[0], "Case 2, CB-RRT"),
        (CASE_2, COMPILED[1], "Case 2, S-RRT"),
        (ROOMS, COMPILED[0], "two rooms, CB-RRT"),
    )
    bases = {title: material.sample(scene, planner) for scene, planner, title in series}
    if all(material.sample(CASE_1, COMPILED[0], reading.title) is None for reading in READINGS):
        return
    rows, ratios = [("ours", *(_reading_cell(base) for base in bases.values()))], {}
    for reading in READINGS:
        samples = [material.sample(scene, planner, reading.title) for scene, planner, _ in series]
        rows.append((reading.title, *(_reading_cell(sample) for sample in samples)))
    for scene, planner, title in series:
        base = bases[title]
        if base is None or not base.succeeded.count:
            continue  # no multiple of a failure
        ratios[title] = {
            reading.title: _ratio_ends(material.sample(scene, planner, reading.title), base) for reading in READINGS
        }
    yield Heading("Readings")
    yield Text(
        "Where the paper is silent, something had to be chosen: the law is evaluated once an extension, the reference "
        "lies at most 2 m away, the horizon is 2 s (with another one, the reference lies at most as far away as full "
        "speed leads), a control within 0.1 m/s and 0.1 rad/s of a sister's is refused, there is no goal bias, and an "
        "extension that meets an obstacle is discarded. The table has median nodes of the compiled planners under "
        "other choices, one at a time, and the share of solved runs where it is not 100 %. S-RRT has no law and no "
        "refusal within a tolerance: where its numbers differ there, that is chance."
    )
    yield Table(("reading", *(title for _, _, title in series)), rows)
    if ratios:
        caption = "Median nodes under other readings, as multiples of those under ours."
        yield _picture("readings.png", charts.readings_figure(ratios), caption)


def _reading_cell(sample: Sample | None) -> str:
    """Median nodes, and the share solved if some failed."""
    if sample is None:
        return "–"
    if not sample.succeeded.count:
        return f"0 of {len(sample)} solved"
    failed = "" if sample.succeeded.count == len(sample) else f", {100 * sample.succeeded.value:.3g} % solved"
    return median_text(sample, "nodes") + failed


def _ratio_ends(sample: Sample | None, base: Sample) -> tuple[float, float, float]:
    """Ratio of the median nodes with the ends of its interval."""
    if sample is None:
        return (math.nan, math.nan, math.nan)
    ratio = ratio_between(sample, base, "nodes")
    return (ratio.value, *ratio.interval)


def _neighbours(material: Material) -> Iterator[Block]:
    """k-d tree against brute force."""
    if not material.costs:
        return
    yield Heading("k-d tree against brute force")
    sizes = sorted({size for _, size in material.costs})
    rows = []
    for size in sizes:
        medians = {kind: float(np.median(material.costs[kind, size])) for kind in ("grid", "kd-tree", "brute-force")}
        rows.append(
            (
                whole(size) + (" (published)" if size in TREE_SIZES else ""),
                *(number(1e9 * value) for value in medians.values()),
                number(medians["brute-force"] / medians["kd-tree"]),
            )
        )
    yield Text("Time of one query [ns], median of five repetitions, nodes and queries spread evenly over the scene:")
    yield Table(("nodes", "grid", "k-d tree", "brute force", "brute force / k-d tree"), rows)
    yield _picture("neighbours.png", charts.neighbours_figure(material.costs), "Time of a nearest-neighbour query.")
    rows = []
    for scene in (CASE_1, CASE_2):
        tree, brute = (material.sample(scene, COMPILED[0], kind) for kind in NEIGHBOURS)
        grid = material.sample(scene, COMPILED[0])
        if tree is not None and brute is not None and grid is not None:
            times = (median_text(sample, "time", 1e3) for sample in (grid, tree, brute))
            rows.append((title_of(scene), *times, ratio_text(ratio_between(brute, tree, "time"))))
    if rows:
        yield Text("Planning time of the compiled CB-RRT as a whole [ms]:")
        yield Table(("scene", "grid", "k-d tree", "brute force", "brute force / k-d tree"), rows)


def _limits(material: Material) -> Iterator[Block]:
    """Limits kept, and turns in place."""
    yield Heading("Limits kept, and point turns")
    rows = []
    for scene in (CASE_1, CASE_2, ROOMS, *OTHERS):
        for planner in (*IN_OMPL, *COMPILED, "rrt", NAIVE):
            sample = material.sample(scene, planner)
            if sample is not None and sample.found:
                rows.append(
                    (
                        title_of(scene),
                        planner,
                        count_text(sample.verified),
                        *(f"{100 * sample.found_values(use).max():.0f} %" for use in ("speed_use", "acceleration_use")),
                        count_text(sample.turning),
                        f"{np.median(sample.found_values('point_turns')):g}",
                        number(float(np.median(sample.found_values("duration")))),
                        number(float(np.median(sample.found_values("length")))),
                    )
                )
    header = (
        "scene", "planner", "passed verify", "most of the velocity limits", "most of the acceleration limits",
        "with a turn in place", "turns: median", "duration [s]: median", "length [m]: median",
    )  # fmt: skip
    yield Table(header, rows, left=2)
    yield Text(
        "`verify` computes each motion again from its commands, by code that shares nothing with the planners: limits, "
        "collisions by FCL, start and goal. S-RRT's trajectories are verified as kinematic ones, whose velocities may "
        "jump; what these jumps ask for is in the column of the acceleration limits. OMPL's own planners check the "
        "ends of their steps alone, so that some of their trajectories cut corners: such runs count as failed."
    )


def _grids(material: Material, plans: Mapping[tuple[str, str], PlanResult]) -> Iterator[Block]:
    """What a search on a grid gives."""
    if not material.grids:
        return
    yield Heading("A* on a grid")
    yield Text(
        "The shortest path on a grid of eight neighbours, by scipy's Dijkstra, which finds what A* finds. Two "
        "neighbours are joined where the straight line between their centres is free. How a grid lies in the scene "
        "matters, so it was placed in many ways; a whole cell of 0.2 m fits a gap of 0.2 m only where it lies in it "
        "exactly. Medians over the grids with a path; of equally short paths the search returns any, and their corners "
        "differ. Driving time: at each corner the robot brakes to rest, turns in place and starts again, under the "
        "same limits as the planners."
    )
    rows = []
    for grid in material.grids:
        scenario = material.scenarios[grid.scene]
        figures: tuple[str, ...] = ("–",) * 6
        if grid.paths:
            turns = [np.degrees(np.abs(path.turns)) for path in grid.paths]
            measured = (
                [path.length for path in grid.paths],
                [len(jumps) for jumps in turns],
                [jumps.max(initial=0.0) for jumps in turns],
                [jumps.sum() for jumps in turns],
                [path.driving_time(scenario.start.theta, scenario.robot.limits) for path in grid.paths],
                [1e3 * path.search_time for path in grid.paths],
            )
            figures = tuple(f"{np.median(values):.3g}" for values in measured)
        found = f"{len(grid.paths)} of {grid.places}"
        rows.append((title_of(grid.scene), f"{grid.cell:g} m", f"{grid.rule} free", found, *figures))
    header = (
        "scene", "cells", "a cell is free if", "grids with a path", "length [m]", "corners", "largest jump [deg]",
        "turning [deg]", "driving time [s]", "search [ms]",
    )  # fmt: skip
    yield Table(header, rows, left=3)
    rows = [
        (title_of(scene), *(median_text(sample, measure) for measure in ("duration", "length")))
        for scene in (CASE_1, CASE_2)
        if (sample := material.sample(scene, "cb-rrt")) is not None
    ]
    yield Text("CB-RRT's trajectories in the same scenes, which are driven without stopping but for their point turns:")
    yield Table(("scene", "duration [s]", "length [m]"), rows)
    result = plans.get((CASE_2, "cb-rrt"))
    paths = {
        grid.cell: grid.paths[len(grid.paths) // 2]
        for grid in reversed(material.grids)
        if grid.scene == CASE_2 and grid.paths
    }
    if result is not None and paths:
        figure = charts.grid_figure(result, material.scenarios[CASE_2], dict(sorted(paths.items())))
        yield _picture("grid.png", figure, "Case 2: paths on grids, their corners as dots, and CB-RRT's trajectory.")


def _naive(material: Material) -> Iterator[Block]:
    """The lower baseline."""
    rows = []
    for scene in (CASE_1, CASE_2):
        ours = material.sample(scene, "cb-rrt")
        for planner in ("cb-rrt", "rrt", NAIVE):
            sample = material.sample(scene, planner)
            if ours is not None and sample is not None:
                ratios = [
                    "1" if sample is ours else ratio_text(ratio_between(sample, ours, measure))
                    for measure in ("nodes", "time")
                ]
                rows.append(
                    (
                        title_of(scene),
                        planner,
                        whole(len(sample)),
                        share_text(sample.succeeded),
                        median_text(sample, "nodes"),
                        median_text(sample, "time", 1e3),
                        *ratios,
                    )
                )
    if any(row[1] == NAIVE for row in rows):
        yield Heading("A naive RRT in five dimensions")
        yield Text(
            f"`{NAIVE}` is OMPL's `control::RRT` as it comes: random controls, 5 % goal bias, and a metric over all of "
            "(x, y, theta, v, omega), each component with weight 1. `rrt` is the same with the metric of (x, y) alone, "
            "as CB-RRT has it. All run in OMPL, with the same robot and 50,000 samples."
        )
        header = (
            "scene", "planner", "runs", "solved", "nodes: median", "time [ms]: median", "nodes / CB-RRT",
            "time / CB-RRT",
        )  # fmt: skip
        yield Table(header, rows, left=2)


def _method(material: Material) -> Iterator[Block]:
    """How it was measured."""
    yield Heading("How it was measured")
    side = "one process at a time" if material.jobs == 1 else f"{material.jobs} processes side by side"
    yield Text(
        f"{side[0].upper()}{side[1:]}, each with one run at a time on a core of its own as long as there are as many "
        "cores; they share the memory and the last cache, and what else the computer does slows them. The clock starts "
        "on a loaded process: kernels are compiled, and 20,000 random poses have taught the clearance map where the "
        "obstacles are. Each run has a seed of its own, in `runs.jsonl`: `cbrrt plan --seed` repeats it."
    )
    yield Text(
        "Shares have Wilson's 95 % interval; medians and ratios of medians have percentile bootstrap intervals (95 %, "
        "5,000 resamples). Every interval is for one comparison: of twenty that show no true difference, one will miss."
    )
    yield Text("The verdicts: " + "; ".join(f"**{verdict.value}**: {text}" for verdict, text in MEANINGS.items()) + ".")


def _picture(name: str, figure: Figure, caption: str) -> Picture:
    """A figure as a picture."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return Picture(name, buffer.getvalue(), caption)
