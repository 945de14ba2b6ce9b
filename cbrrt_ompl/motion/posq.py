"""The POSQ steering of Palmieri and Arras, as a law for CB-RRT."""

from __future__ import annotations

import math
from typing import Any


def posq(error: tuple[float, float, float], limits: Any, gains: Any) -> tuple[float, float]:
    """POSQ steering: v = K_rho tanh(K_v rho), omega = K_alpha alpha + K_phi phi.

    rho is the distance of the reference, alpha its bearing in the robot's frame, and phi the heading of the reference
    as seen along that bearing. From L. Palmieri and K. O. Arras, "A novel RRT extend function for efficient and smooth
    mobile robot motion planning", IROS 2014, with K_v = 3.8, K_alpha = 6, K_phi = -1 as published.

    Note:
        K_rho is the robot's largest velocity instead of 1 m/s, and the gains of the robot have no part in it.
    """
    x, y, theta = error
    alpha = math.atan2(y, x)
    phi = (theta - alpha + math.pi) % (2.0 * math.pi) - math.pi
    return limits.v_max * math.tanh(3.8 * math.hypot(x, y)), 6.0 * alpha - phi
