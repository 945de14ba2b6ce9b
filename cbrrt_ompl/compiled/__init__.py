"""Algorithms I and II of the paper as one compiled loop over flat arrays, and the same as a planner of OMPL."""
