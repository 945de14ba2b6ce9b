"""Maps and worlds of others: ROS map_server, images, MovingAI, lists of discs, dynobench."""

from cbrrt_ompl.maps.discs import load_discs
from cbrrt_ompl.maps.dynobench import load_dynobench
from cbrrt_ompl.maps.loading import load_map
from cbrrt_ompl.maps.occupancy_map import OccupancyMap
from cbrrt_ompl.maps.rasterizing import rasterize, save_map

__all__ = ["OccupancyMap", "load_discs", "load_dynobench", "load_map", "rasterize", "save_map"]
