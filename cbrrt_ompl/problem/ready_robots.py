"""Ready robots with the data that their makers publish, by the names that scenario files use.

The origin of a footprint is the centre of the wheel axle. No robot reverses, as in the paper, unless its ``v_min`` is
overridden. Where nothing was published, the docstring of a robot says what was chosen, and why.
"""

from __future__ import annotations

import math

from cbrrt_ompl.problem.robot import Footprint, Gains, Limits, Robot


def rectangle(length: float, width: float, x_center: float = 0.0) -> Footprint:
    """A footprint of four corners.

    Args:
        length: side along the robot's x-axis [m].
        width: side along its y-axis [m].
        x_center: where the middle of the rectangle is, seen from the wheel axle [m].
    """
    corners = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
    return Footprint.polygon([(x_center + 0.5 * length * a, 0.5 * width * b) for a, b in corners])


TETRA_DS_II = Robot()
"""Tetra-DS II of the paper, as far as the paper describes it.

Published: the point, 0 to 1 m/s, 30 deg/s, 0.6 m/s^2, 30 deg/s^2 and the gains. The distance of its wheels is not.
"""

_AGILE = Gains(1.5, 10.0, 3.0)
"""Gains of the TurtleBots, our choice: at 0.2 m/s the paper's gains would ask for 0.1 rad/s at most.

The other robots have none of their own: each planner fills them.
"""

TURTLEBOT3_BURGER = Robot(
    rectangle(0.138, 0.178, x_center=-0.032),
    Limits(0.0, 0.22, -2.84, 2.84, 2.5, 3.2, wheel_separation=0.16, wheel_speed=2.84 * 0.08),
    _AGILE,
)
"""TurtleBot3 Burger.

Published: 0.22 m/s, 2.84 rad/s, 138 mm x 178 mm (ROBOTIS e-Manual, Specifications); the body's offset
(turtlebot3_description, turtlebot3_burger.urdf); the distance of the wheels (turtlebot3_node, param/burger.yaml);
2.5 m/s^2 and 3.2 rad/s^2 (turtlebot3_navigation2, param/humble/burger.yaml). Chosen: the wheels are as fast as turning
on the spot at 2.84 rad/s makes them, 0.227 m/s, since ROBOTIS' firmware derives both top speeds from one of the wheels.
"""

TURTLEBOT3_WAFFLE_PI = Robot(
    rectangle(0.281, 0.306, x_center=-0.064),
    Limits(0.0, 0.26, -1.82, 1.82, 2.5, 3.2, wheel_separation=0.287, wheel_speed=1.82 * 0.1435),
    _AGILE,
)
"""TurtleBot3 Waffle Pi.

Published: 0.26 m/s, 1.82 rad/s, 281 mm x 306 mm (ROBOTIS e-Manual, Specifications); the body's offset
(turtlebot3_description, turtlebot3_waffle_pi.urdf); the distance of the wheels (turtlebot3_node, param/waffle_pi.yaml);
2.5 m/s^2 and 3.2 rad/s^2 (turtlebot3_navigation, param/dwa_local_planner_params_waffle_pi.yaml). Chosen: the speed of
the wheels, 0.261 m/s, as for the Burger.
"""

JACKAL = Robot(
    rectangle(0.508, 0.430),
    Limits(0.0, 2.0, -4.0, 4.0, 2.0, 7.1, wheel_separation=1.5 * 0.37559, wheel_speed=2.0, wheel_acceleration=2.0),
)
"""Clearpath Jackal, four wheels that skid when it turns; the origin is the middle between its axles.

Published: 508 mm x 430 mm, 2 m/s (Clearpath's data sheet); 4 rad/s, and half as much again for the distance of the
wheels, which stands for the skidding (jackal_control, config/control.yaml); the distance of the wheels, 0.37559 m
(jackal_description, jackal.urdf.xacro). Chosen: the wheels are no faster than the robot straight on, and change their
speed by 2 m/s^2, which makes 2 m/s^2 and 7.1 rad/s^2 for the robot; control.yaml lets 20 m/s^2 and 25 rad/s^2 pass,
more than its tyres can hold.
"""

PIONEER_3DX = Robot(
    rectangle(0.455, 0.381, x_center=-0.04465),
    Limits(0.0, 1.2, -math.radians(300.0), math.radians(300.0), 0.3, 1.74, wheel_separation=0.33, wheel_speed=1.2),
)
"""Pioneer 3-DX without bumpers.

Published: 455 mm x 381 mm, 1.2 m/s, 300 deg/s (Adept's data sheet); the body's offset, 0.3 m/s^2 and 1.74 rad/s^2
(its maker's simulator AMRISim, PioneerRobotModels.world.inc); the distance of the wheels (0.33 m in the model of
Webots; 0.316 m in the URDF p3dx_description). Chosen: the rectangle around its rounded body, and wheels no faster than
the robot straight on.
"""

ROBOTS: dict[str, Robot] = {
    "tetra_ds_ii": TETRA_DS_II,
    "turtlebot3_burger": TURTLEBOT3_BURGER,
    "turtlebot3_waffle_pi": TURTLEBOT3_WAFFLE_PI,
    "jackal": JACKAL,
    "pioneer_3dx": PIONEER_3DX,
}
"""The ready robots by name."""
