"""Limits, gains and footprints: what a robot may be, and how mistakes are named."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from cbrrt_ompl.errors import InputError, RobotError
from cbrrt_ompl.problem.robot import Footprint, Gains, Limits, Robot

RECTANGLE = [(-0.2, -0.15), (0.2, -0.15), (0.2, 0.15), (-0.2, 0.15)]
ARROW = [(-0.3, -0.2), (0.3, 0.0), (-0.3, 0.2), (-0.1, 0.0)]


def fields_of(error: InputError) -> list[str]:
    return [problem.field for problem in error.problems]


def test_the_default_robot_is_that_of_the_paper() -> None:
    robot = Robot()
    assert robot.footprint.kind == "point"
    assert robot.limits[:2] == (0.0, 1.0)
    assert np.degrees(robot.limits[2:4]) == pytest.approx([-30.0, 30.0])
    assert (robot.limits.acceleration, math.degrees(robot.limits.angular_acceleration)) == pytest.approx((0.6, 30.0))
    assert robot.gains is None
    assert Gains() == (1.5, 0.5, 0.1)


@pytest.mark.parametrize(
    ("limits", "field"),
    [
        (Limits(v_max=0.0), "robot.limits.v"),
        (Limits(v_min=0.1), "robot.limits.v"),
        (Limits(v_min=2.0), "robot.limits.v"),
        (Limits(omega_max=-1.0), "robot.limits.omega"),
        (Limits(omega_min=0.2), "robot.limits.omega"),
        (Limits(acceleration=0.0), "robot.limits.acceleration"),
        (Limits(angular_acceleration=-0.1), "robot.limits.angular_acceleration"),
        (Limits(v_max=math.inf), "robot.limits.v_max"),
        (Limits(omega_min=math.nan), "robot.limits.omega_min"),
    ],
)
def test_a_wrong_limit_is_named(limits: Limits, field: str) -> None:
    with pytest.raises(RobotError) as caught:
        Robot(limits=limits)
    assert fields_of(caught.value) == [field]
    assert str(caught.value).startswith(f"{field}: got ")


@pytest.mark.parametrize("name", Gains._fields)
@pytest.mark.parametrize("value", [-0.1, math.nan, math.inf])
def test_a_wrong_gain_is_named(name: str, value: float) -> None:
    with pytest.raises(RobotError) as caught:
        Robot(gains=Gains(**{name: value}))
    assert fields_of(caught.value) == [f"robot.gains.{name}"]


def test_gains_of_zero_are_allowed() -> None:
    assert Robot(gains=Gains(0.0, 0.0, 0.0)).gains.k_x == 0.0


def test_all_wrong_limits_and_gains_are_reported_together() -> None:
    with pytest.raises(RobotError) as caught:
        Robot(limits=Limits(v_max=-1.0, acceleration=-1.0), gains=Gains(k_y=-1.0))
    assert fields_of(caught.value) == ["robot.limits.v", "robot.limits.acceleration", "robot.gains.k_y"]
    assert len(str(caught.value).splitlines()) == 3


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: Footprint.disc(-0.1), "footprint.radius"),
        (lambda: Footprint.disc(math.nan), "footprint.radius"),
        (lambda: Footprint.polygon([(0, 0), (1, 0)]), "footprint.vertices"),
        (lambda: Footprint.polygon([(0, 0), (1, 0), (2, 0)]), "footprint.vertices"),
        (lambda: Footprint.polygon([(0, 0), (1, 1), (1, 0), (0, 1)]), "footprint.vertices"),
        (lambda: Footprint.polygon([(0, 0), (1, 0), (0, math.nan)]), "footprint.vertices"),
        (lambda: Footprint.polygon([(0, 0, 0), (1, 0, 0), (0, 1, 0)]), "footprint.vertices"),
    ],
    ids=["negative", "not a number", "two corners", "no area", "crossing", "corner not a number", "in space"],
)
def test_a_footprint_that_is_no_area_is_refused(make: Callable[[], Footprint], field: str) -> None:
    with pytest.raises(RobotError) as caught:
        make()
    assert fields_of(caught.value) == [field]


def test_a_polygon_is_turned_counter_clockwise_and_opened() -> None:
    clockwise_and_closed = [*RECTANGLE[::-1], RECTANGLE[-1]]
    corners = Footprint.polygon(clockwise_and_closed).vertices
    assert corners is not None
    assert corners.shape == (4, 2)
    assert shapely.LinearRing(corners).is_ccw


def test_the_corners_of_a_footprint_are_a_copy_that_cannot_be_written() -> None:
    given_corners = np.array(RECTANGLE)
    corners = Footprint.polygon(given_corners).vertices
    given_corners[0] = 9.0
    assert corners is not None
    assert corners[0] == pytest.approx(RECTANGLE[0])
    assert not corners.flags.writeable


def test_equal_footprints_have_equal_hashes() -> None:
    assert Footprint.polygon(RECTANGLE) == Footprint.polygon(np.array(RECTANGLE))
    assert hash(Footprint.polygon(RECTANGLE)) == hash(Footprint.polygon(np.array(RECTANGLE)))
    assert Footprint.disc(0.3) == Footprint.disc(0.3)
    assert Footprint.disc(0.3) != Footprint.disc(0.4)
    assert Footprint.point() == Footprint.disc(0.0)
    assert Footprint.polygon(RECTANGLE) != Footprint.polygon(ARROW)
    assert Footprint.point() != 0


@pytest.mark.parametrize(
    ("footprint", "kind", "is_round", "inscribed", "circumscribed"),
    [
        (Footprint.point(), "point", True, 0.0, 0.0),
        (Footprint.disc(0.3), "disc", True, 0.3, 0.3),
        (Footprint.polygon(RECTANGLE), "polygon", False, 0.15, 0.25),
        (Footprint.polygon(np.array(RECTANGLE) + 1.0), "polygon", False, 0.0, math.hypot(1.2, 1.15)),
    ],
    ids=["point", "disc", "rectangle", "origin outside"],
)
def test_kinds_and_radii(
    footprint: Footprint, kind: str, is_round: bool, inscribed: float, circumscribed: float
) -> None:
    assert (footprint.kind, footprint.is_round) == (kind, is_round)
    assert footprint.inscribed_radius == pytest.approx(inscribed)
    assert footprint.circumscribed_radius == pytest.approx(circumscribed)


@given(st.floats(-10, 10), st.floats(-10, 10), st.floats(-7, 7))
def test_the_outline_lies_between_the_two_radii(x: float, y: float, theta: float) -> None:
    for footprint in (Footprint.disc(0.3), Footprint.polygon(RECTANGLE), Footprint.polygon(ARROW)):
        outline = footprint.outline_at((x, y, theta))
        distances = np.hypot(*(outline - [x, y]).T)
        assert distances.max() == pytest.approx(footprint.circumscribed_radius)
        assert shapely.LinearRing(outline).distance(shapely.Point(x, y)) == pytest.approx(
            footprint.inscribed_radius, rel=2e-3
        )


def test_the_outline_turns_counter_clockwise_with_the_heading() -> None:
    nose_up = Footprint.polygon(ARROW).outline_at((1.0, 2.0, math.pi / 2))
    assert nose_up[nose_up[:, 1].argmax()] == pytest.approx([1.0, 2.3])
