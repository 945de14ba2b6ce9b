"""What the paper reports: its tables, one run each, and the numbers in its claims."""

from __future__ import annotations

from typing import NamedTuple


class Published(NamedTuple):
    """What the paper reports of its one run."""

    nodes: int | None
    """Nodes of the tree; None where the planner failed."""
    milliseconds: float | None
    """Planning time [ms]; None where the planner failed."""


PAPER = {
    ("paper_case1", "cb-rrt"): Published(228, 7.75),
    ("paper_case1", "s-rrt"): Published(658, 15.0),
    ("paper_case2", "cb-rrt"): Published(1391, 16.0),
    ("paper_case2", "s-rrt"): Published(None, None),
}
"""The paper's results by scene and planner: Table 1 is Case 1, Table 2 is Case 2."""

SPEED_RATIO = 15.0 / 7.75
"""Planning time of S-RRT over that of CB-RRT in Case 1: "twice as fast"."""

REAL_TIME = 7.0
"""Planning time that the paper calls real time [ms]."""

TREE_SIZES = (228, 658, 1391)
"""Nodes of the trees for which the paper calls k-d trees "almost ten times" as fast as brute force."""

PROCESSOR = "an Intel i7 at 2.6 GHz"
"""The paper's computer."""
