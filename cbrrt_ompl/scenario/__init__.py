"""Planning problems and the files that they come from: scenarios in YAML, maps, dynobench."""

from __future__ import annotations

from cbrrt_ompl.scenario.scenario import Scenario, load_scenario, save_scenario

__all__ = ["Scenario", "load_scenario", "save_scenario"]
