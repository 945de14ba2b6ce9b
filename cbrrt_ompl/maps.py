"""Maps and worlds of others: ROS map_server, images, MovingAI, lists of discs, dynobench."""

from __future__ import annotations

from cbrrt_ompl.scenario.dynobench import load_dynobench
from cbrrt_ompl.scenario.maps.discs import load_discs
from cbrrt_ompl.scenario.maps.loading import load_map
from cbrrt_ompl.scenario.maps.occupancy_map import OccupancyMap
from cbrrt_ompl.scenario.maps.rasterizing import rasterize, save_map

__all__ = ["OccupancyMap", "load_discs", "load_dynobench", "load_map", "rasterize", "save_map"]
