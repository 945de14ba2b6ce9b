"""Tree after tree, each bounded by the best plan so far: AO-RRT's meta-algorithm over the compiled loop.

K. Hauser and Y. Zhou, "Asymptotically optimal planning by feasible kinodynamic planning in a state-cost space", IEEE
Transactions on Robotics, 2016. The cost is the duration, counted in integration steps; see docs/improve.md.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cbrrt_ompl.planners.search import Search

TREE_SAMPLES = 10_000
"""Samples of a bounded tree at most; then another one is planted."""


class BoundedTrees:
    """Looks for quicker and quicker plans.

    Attributes:
        best: the search that found the quickest plan so far.
        samples: drawn in all trees.
        trees: how many there were.
    """

    def __init__(self, first: Search, seed: int) -> None:
        """Begin with a plan.

        Args:
            first: a search that has reached the goal.
            seed: of the seeds of all further trees.
        """
        self.best, self.samples, self.trees = first, first.samples, 1
        self._rng = np.random.default_rng(seed)

    def find_quicker(self, should_stop: Callable[[int], bool], most_samples: float) -> bool:
        """Plant trees until one has a plan that is quicker than the best by a step or more; says whether one has.

        Args:
            should_stop: asked every few milliseconds with the samples of all trees so far.
            most_samples: of all trees, to stop at.
        """
        most_steps = int(self.best.total_steps[-1]) - 1
        while self.samples < most_samples and not should_stop(self.samples):
            tree = self.best.again(int(self._rng.integers(2**31)), most_steps)
            most = min(TREE_SAMPLES, most_samples - self.samples)
            tree.run(lambda drawn: should_stop(self.samples + drawn), most)
            self.samples += tree.samples
            self.trees += 1
            if tree.has_reached_goal:
                self.best = tree
                return True
        return False
