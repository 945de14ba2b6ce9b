"""OMPL's Benchmark over scenarios and planners: campaigns, logs, the database of Planner Arena, statistics, report."""
