"""The paper's claims, each with its rule and what the measured runs answer."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from cbrrt_ompl.benchmark.statistics import Interval
from cbrrt_ompl.reproduce.grids import GridStudy
from cbrrt_ompl.reproduce.numbers import (
    count_text,
    interval_text,
    median_text,
    number,
    ratio_text,
    share_text,
    whole,
)
from cbrrt_ompl.reproduce.outcomes import Outcomes, Sample, Share, ratio_between
from cbrrt_ompl.reproduce.published import PAPER, REAL_TIME, SPEED_RATIO, TREE_SIZES
from cbrrt_ompl.reproduce.scenes import CASE_1, CASE_2, OTHERS, ROOMS, title_of
from cbrrt_ompl.reproduce.study import COMPILED, IN_OMPL, NAIVE, NEIGHBOURS
from cbrrt_ompl.reproduce.verdicts import MOST, Answer, Claim, Finding, above, all_of, below, inside, none_of

ALMOST_TEN = 9.0
"""What "almost ten times as fast" is at least."""

TYPICAL = (0.1, 0.9)
"""Shares of the runs between which a number is typical."""

WAYS = {"cb-rrt": "in OMPL", "cb-rrt-compiled": "compiled", "s-rrt": "in OMPL", "s-rrt-compiled": "compiled"}
"""Where the planners of the paper run."""

QueryCosts = Mapping[tuple[str, int], Sequence[float]]
"""Times of a query [s] by kind of index and number of nodes, one a repetition."""


class Place(NamedTuple):
    """A scene with or without a variant."""

    scene: str
    variant: str = ""

    @property
    def title(self) -> str:
        """What the report calls it."""
        return f"{title_of(self.scene)}, {self.variant}" if self.variant else title_of(self.scene)


def make_claims(outcomes: Outcomes, costs: QueryCosts, grids: Sequence[GridStudy]) -> list[Claim]:
    """All claims of which something was measured.

    Args:
        outcomes: of all runs.
        costs: of nearest-neighbour queries.
        grids: what grids give.
    """
    claims = [
        _solves(outcomes),
        _fails(outcomes),
        _fewer_nodes(outcomes),
        _faster(outcomes),
        _harder(outcomes),
        _typical(outcomes, "cb-rrt", "CB-RRT: 228 in Case 1, 1,391 in Case 2"),
        _typical(outcomes, "s-rrt", "S-RRT: 658 in Case 1"),
        _no_smoothing(outcomes),
        _jumps(outcomes),
        _point_turns(outcomes),
        _real_time(outcomes),
        _plane(outcomes),
        _tree_pays(outcomes),
        _ten_times(costs),
        _grids(grids),
    ]
    return [claim for claim in claims if claim.findings]


def _elsewhere(outcomes: Outcomes, scene: str) -> list[Place]:
    """Where else a claim about a scene is tested: moved gaps and other readings, and the other scenes."""
    variants = [variant for variant in outcomes.variants(scene) if variant not in NEIGHBOURS]
    return [*(Place(scene, variant) for variant in variants), *(Place(other) for other in OTHERS)]


def _each(
    outcomes: Outcomes,
    planner: str,
    scenes: Sequence[str],
    ask: Callable[[Sample], tuple[str, Answer]],
    others: Sequence[Place] = (),
) -> tuple[Finding, ...]:
    """Ask the samples of a planner, in OMPL and compiled in the paper's scenes, and compiled elsewhere."""
    asked = [(Place(scene), planner + suffix, True) for scene in scenes for suffix in ("", "-compiled")]
    asked += [(place, f"{planner}-compiled", False) for place in dict.fromkeys(others)]
    findings = []
    for place, name, in_paper in asked:
        sample = outcomes.get(place.scene, name, place.variant)
        if sample is not None:
            title = f"{place.title}, {WAYS[name]}" if in_paper else place.title
            findings.append(Finding(title, *ask(sample), in_paper))
    return tuple(findings)


def _compare(
    outcomes: Outcomes, measure: str, threshold: float, scene: str, others: Sequence[Place]
) -> tuple[Finding, ...]:
    """How many times the median of S-RRT is that of CB-RRT, in a scene of the paper and elsewhere."""
    findings = []
    places = [(Place(scene), pair, True) for pair in (IN_OMPL, COMPILED)] + [(p, COMPILED, False) for p in others]
    for place, (cb, s), in_paper in places:
        one, other = (outcomes.get(place.scene, name, place.variant) for name in (s, cb))
        if one is not None and other is not None:
            ratio = ratio_between(one, other, measure)
            title = f"{place.title}, {WAYS[cb]}" if in_paper else place.title
            findings.append(Finding(title, f"{ratio_text(ratio)} times", above(ratio.interval, threshold), in_paper))
    return tuple(findings)


def _solves(outcomes: Outcomes) -> Claim:
    def ask(sample: Sample) -> tuple[str, Answer]:
        return f"solved {share_text(sample.succeeded)}", above(sample.succeeded.interval, MOST)

    others = [*_elsewhere(outcomes, CASE_1), *_elsewhere(outcomes, CASE_2), Place(ROOMS), *_elsewhere(outcomes, ROOMS)]
    return Claim(
        "CB-RRT solves both cases within 50,000 samples.",
        f"Yes if the interval of the share of solved runs lies above {100 * MOST:.0f} %, no if below.",
        _each(outcomes, "cb-rrt", (CASE_1, CASE_2), ask, others),
    )


def _fails(outcomes: Outcomes) -> Claim:
    def ask(sample: Sample) -> tuple[str, Answer]:
        return f"solved {share_text(sample.succeeded)}", below(sample.succeeded.interval, 1.0 - MOST)

    others = [*_elsewhere(outcomes, CASE_2), Place(ROOMS), *_elsewhere(outcomes, ROOMS)]
    return Claim(
        "S-RRT fails in Case 2.",
        f"Yes if the interval of the share of solved runs lies below {100 * (1 - MOST):.0f} %, no if above.",
        _each(outcomes, "s-rrt", (CASE_2,), ask, others),
    )


def _fewer_nodes(outcomes: Outcomes) -> Claim:
    paper = PAPER[CASE_1, "s-rrt"].nodes, PAPER[CASE_1, "cb-rrt"].nodes
    return Claim(
        f"CB-RRT needs fewer nodes than S-RRT in Case 1 (published: {paper[1]} against {paper[0]}).",
        "Ratio of the median nodes, S-RRT over CB-RRT, failures counted as infinite: yes if its interval lies above 1, "
        "no if below.",
        _compare(outcomes, "nodes", 1.0, CASE_1, _elsewhere(outcomes, CASE_1)),
    )


def _faster(outcomes: Outcomes) -> Claim:
    return Claim(
        f"CB-RRT is twice as fast as S-RRT (published: 15 ms / 7.75 ms = {SPEED_RATIO:.2f}).",
        f"Ratio of the median planning times in Case 1, failures counted as infinite: yes if its interval lies above "
        f"{SPEED_RATIO:.2f}, no if below.",
        _compare(outcomes, "time", SPEED_RATIO, CASE_1, _elsewhere(outcomes, CASE_1)),
    )


def _harder(outcomes: Outcomes) -> Claim:
    findings = []
    for planner in ("cb-rrt", "cb-rrt-compiled"):
        for scene in (CASE_2, ROOMS):
            one, other = outcomes.get(scene, planner), outcomes.get(CASE_1, planner)
            if one is not None and other is not None:
                ratio = ratio_between(one, other, "nodes")
                place = f"{title_of(scene)} over Case 1, {WAYS[planner]}"
                findings.append(
                    Finding(place, f"{ratio_text(ratio)} times", above(ratio.interval, 1.0), scene == CASE_2)
                )
    return Claim(
        "Case 2 is harder than Case 1: CB-RRT needs more nodes (published: 1,391 against 228).",
        "Ratio of the median nodes: yes if its interval lies above 1, no if below.",
        tuple(findings),
    )


def _typical(outcomes: Outcomes, planner: str, text: str) -> Claim:
    findings: list[Finding] = []
    for (scene, name), published in PAPER.items():
        if name != planner or published.nodes is None:
            continue
        nodes = published.nodes

        def ask(sample: Sample, nodes: int = nodes) -> tuple[str, Answer]:
            fewer = Share(int((sample.values("nodes") <= nodes).sum()), len(sample))
            return f"{share_text(fewer)} of the runs need no more", inside(fewer.interval, *TYPICAL)

        shifts = [variant for variant in outcomes.variants(scene) if variant.startswith("gaps")]
        findings += _each(outcomes, planner, (scene,), ask, [Place(scene, variant) for variant in shifts])
    return Claim(
        f"The published number of nodes is typical ({text}).",
        "Share of runs that need no more nodes than published: yes if its interval lies between "
        f"{100 * TYPICAL[0]:.0f} % and {100 * TYPICAL[1]:.0f} %, no if outside.",
        tuple(findings),
        "Our scenes were reconstructed so that it is: a yes in them is no evidence for the paper, the moved gaps are.",
    )


def _no_smoothing(outcomes: Outcomes) -> Claim:
    def ask(sample: Sample) -> tuple[str, Answer]:
        return f"{count_text(sample.verified)} valid", all_of(sample.verified.count, sample.verified.of)

    others = [*_elsewhere(outcomes, CASE_1), *_elsewhere(outcomes, CASE_2), Place(ROOMS), *_elsewhere(outcomes, ROOMS)]
    found = _each(outcomes, "cb-rrt", (CASE_1, CASE_2), ask, others)
    return Claim(
        "CB-RRT's trajectories keep all limits and need no smoothing.",
        "Yes if every trajectory passes `verify` (limits of velocity and acceleration, motion, collisions, goal), no "
        "if one does not; open without any trajectory.",
        tuple(f for f in found if f.in_paper or f.answer is not Answer.OPEN),
    )


def _jumps(outcomes: Outcomes) -> Claim:
    def ask(sample: Sample) -> tuple[str, Answer]:
        use = sample.found_values("acceleration_use")
        share = Share(int((use > 1.0).sum()), len(use))
        worst = f", up to {number(use.max())} times the limit" if len(use) else ""
        return f"{count_text(share)} exceed an acceleration limit{worst}", all_of(share.count, share.of)

    shifts = [place for place in _elsewhere(outcomes, CASE_1) if outcomes.get(place.scene, COMPILED[1], place.variant)]
    found = _each(outcomes, "s-rrt", (CASE_1,), ask, shifts)
    return Claim(
        "S-RRT is kinematic only: its velocities jump.",
        "Yes if every trajectory asks for more acceleration than the robot has, no if one does not; places without a "
        "trajectory are left out.",
        tuple(finding for finding in found if finding.answer is not Answer.OPEN),
    )


def _point_turns(outcomes: Outcomes) -> Claim:
    def ask(sample: Sample) -> tuple[str, Answer]:
        turns = sample.found_values("point_turns")
        median = f", median {np.median(turns):g}" if len(turns) else ""
        return f"{share_text(sample.turning)} with a turn{median}", above(sample.turning.interval, MOST)

    others = [*_elsewhere(outcomes, CASE_2), Place(ROOMS), *_elsewhere(outcomes, ROOMS)]
    return Claim(
        "Point turns carry CB-RRT through Case 2.",
        f"Yes if the interval of the share of trajectories with a turn in place lies above {100 * MOST:.0f} %, no if "
        "below.",
        _each(outcomes, "cb-rrt", (CASE_2,), ask, others),
    )


def _real_time(outcomes: Outcomes) -> Claim:
    def ask(sample: Sample) -> tuple[str, Answer]:
        interval = sample.median_interval("time")
        milliseconds = Interval(1e3 * interval.low, 1e3 * interval.high)
        return f"median {median_text(sample, 'time', 1e3)} ms", below(milliseconds, REAL_TIME)

    return Claim(
        f"CB-RRT plans in real time, which the paper calls {REAL_TIME:g} ms.",
        f"Yes if the interval of the median planning time lies below {REAL_TIME:g} ms, no if above.",
        _each(outcomes, "cb-rrt", (CASE_1, CASE_2), ask, [Place(ROOMS), *(Place(scene) for scene in OTHERS)]),
        "A matter of the computer and of the implementation; the paper's own 7.75 ms and 16 ms are above it.",
    )


def _plane(outcomes: Outcomes) -> Claim:
    findings = []
    for scene in (CASE_1, CASE_2):
        naive, ours = outcomes.get(scene, NAIVE), outcomes.get(scene, "cb-rrt")
        if naive is not None and ours is not None:
            for measure in ("nodes", "time"):
                ratio = ratio_between(naive, ours, measure)
                value = f"{ratio_text(ratio)} times"
                findings.append(
                    Finding(f"{title_of(scene)}, {measure}", value, above(ratio.interval, 1.0), in_paper=True)
                )
    return Claim(
        "Searching the plane with a control law beats a naive RRT in all five dimensions.",
        "Ratio of the medians of nodes and of time, naive RRT over CB-RRT, both in OMPL: yes if its interval lies "
        "above 1, no if below.",
        tuple(findings),
    )


def _tree_pays(outcomes: Outcomes) -> Claim:
    findings = []
    for scene in (CASE_1, CASE_2):
        tree, brute = (outcomes.get(scene, "cb-rrt-compiled", kind) for kind in NEIGHBOURS)
        if tree is not None and brute is not None:
            ratio = ratio_between(brute, tree, "time")
            findings.append(
                Finding(title_of(scene), f"{ratio_text(ratio)} times", above(ratio.interval, 1.0), in_paper=True)
            )
    return Claim(
        "A k-d tree makes planning faster than brute force.",
        "Ratio of the median planning times of the compiled CB-RRT, brute force over k-d tree: yes if its interval "
        "lies above 1, no if below.",
        tuple(findings),
    )


def _ten_times(costs: QueryCosts) -> Claim:
    findings = []
    for size in sorted({size for _, size in costs}):
        ratios = np.array(costs["brute-force", size]) / np.array(costs["kd-tree", size])
        interval = Interval(float(ratios.min()), float(ratios.max()))
        value = f"{number(float(np.median(ratios)))} {interval_text(interval)} times"
        findings.append(
            Finding(f"a tree of {whole(size)} nodes", value, above(interval, ALMOST_TEN), size in TREE_SIZES)
        )
    return Claim(
        "k-d trees are almost ten times as fast as brute force.",
        f"Time of a query, brute force over k-d tree, with the range of the repetitions: yes above {ALMOST_TEN:g}, no "
        "below, in trees of the published sizes. Larger trees are listed besides.",
        tuple(findings),
    )


def _grids(grids: Sequence[GridStudy]) -> Claim:
    def findings() -> Iterator[Finding]:
        for grid in grids:
            share = Share(len(grid.paths), grid.places)
            place = f"{title_of(grid.scene)}, {grid.cell:g} m, {grid.rule} free"
            yield Finding(place, f"a path on {count_text(share)} grids", none_of(share.count, share.of), in_paper=True)

    return Claim(
        "Grids of 0.1 m to 0.2 m cannot be used where passages are 0.2 m wide.",
        "Yes if no grid, wherever it is placed, has a path; no if one has. A cell is free if its centre is, or, as in "
        "an occupancy grid, if all of it is.",
        tuple(findings()),
        "The paths are polylines: the robot has to stop and turn at each corner.",
    )
