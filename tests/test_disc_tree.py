"""Laws of the disc tree: every part is held by its disc, and holds its inner disc."""

import numpy as np
import pytest
import shapely

from cbrrt_ompl.collision.disc_tree import COLUMNS, disc_tree
from cbrrt_ompl.problem.robot import Footprint

GROWTH = 1e-6
SLIVER = 1e-9
FOOTPRINTS = {
    "rectangle": [(-0.25, -0.2), (0.25, -0.2), (0.25, 0.2), (-0.25, 0.2)],
    "triangle": [(-0.3, -0.2), (0.4, 0.0), (-0.3, 0.2)],
    "with a sliver": [(0.0, 0.0), (0.4, 0.0), (0.4, 0.2), (0.2 + SLIVER, 0.1), (0.2 + SLIVER, 0.2), (0.0, 0.2)],
    "L": [(0.0, 0.0), (0.4, 0.0), (0.4, 0.1), (0.1, 0.1), (0.1, 0.5), (0.0, 0.5)],
    "beside its origin": [(0.1, -0.1), (0.3, -0.1), (0.3, 0.1), (0.1, 0.1)],
    "U": [(-0.3, 0.0), (0.3, 0.0), (0.3, 0.5), (0.2, 0.5), (0.2, 0.1), (-0.2, 0.1), (-0.2, 0.5), (-0.3, 0.5)],
}


@pytest.fixture(params=FOOTPRINTS)
def footprint(request: pytest.FixtureRequest) -> Footprint:
    return Footprint.polygon(FOOTPRINTS[request.param])


def leaves(tree: np.ndarray) -> np.ndarray:
    """Rows without parts of their own."""
    return tree[tree[:, 4] == np.arange(1, len(tree) + 1)]


def grown_discs(rows: np.ndarray, growth: float) -> shapely.Geometry:
    """Polygons inside the outer discs less their growth."""
    return shapely.union_all([shapely.Point(x, y).buffer(r - growth, 128) for x, y, r, _, _ in rows])


def test_a_round_footprint_has_no_parts() -> None:
    assert disc_tree(Footprint.disc(0.3), GROWTH).shape == (0, COLUMNS)
    assert disc_tree(Footprint.point(), GROWTH).shape == (0, COLUMNS)


def test_the_leaves_cover_the_footprint(footprint: Footprint) -> None:
    rows = leaves(disc_tree(footprint, GROWTH))
    left_over = shapely.Polygon(footprint.vertices).difference(grown_discs(rows, -1e-3))
    assert left_over.area == 0.0  # the polygons in the discs are smaller than these by 1e-5


def test_a_disc_holds_the_part_that_its_own_parts_stand_for(footprint: Footprint) -> None:
    tree, rng = disc_tree(footprint, GROWTH), np.random.default_rng(1)
    polygon = shapely.Polygon(footprint.vertices)
    points = rng.uniform(*np.reshape(polygon.bounds, (2, 2)), (20_000, 2))
    points = points[shapely.contains_xy(polygon, points)]
    held = np.array([np.hypot(*(points - row[:2]).T) <= row[2] for row in tree])  # (rows, points)
    row = 0
    while row < len(tree):  # the coarsest ones
        covered = held[row] | held[[r for r in range(len(tree)) if not row < r < tree[row, 4]]].any(axis=0)
        assert covered.all()
        row = int(tree[row, 4])
    top = [r for r in range(len(tree)) if not any(q < r < tree[q, 4] for q in range(r))]
    assert held[top].any(axis=0).all()


def test_every_inner_disc_lies_in_the_footprint(footprint: Footprint) -> None:
    polygon = shapely.Polygon(footprint.vertices)
    discs = [(x, y, inner) for x, y, _, inner, _ in disc_tree(footprint, GROWTH) if inner > 1e-6]
    assert discs
    assert all(polygon.contains(shapely.Point(x, y).buffer(0.9999 * inner)) for x, y, inner in discs)


def test_the_rows_are_in_depth_first_order(footprint: Footprint) -> None:
    after = disc_tree(footprint, GROWTH)[:, 4].astype(int)
    assert (after > np.arange(len(after))).all()
    assert after.max() == len(after)
    for row, end in enumerate(after):
        assert (after[row + 1 : end] <= end).all()
