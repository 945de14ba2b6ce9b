"""Maps as they come: read as map_server reads them, in the right place, and refused in one clear line."""

from __future__ import annotations

import math
import resource
import struct
import time
import zlib
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from numpy.typing import NDArray
from PIL import Image

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import InputError, MapError
from cbrrt_ompl.maps import OccupancyMap, load_discs, load_dynobench, load_map, rasterize, save_map
from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc, Obstacle, OrientedBox, Polygon
from cbrrt_ompl.problem.robot import Footprint, Limits
from cbrrt_ompl.scenario.scenario import load_scenario

X, F, U = 100, 0, -1
GREYS = np.array([(0, 254, 205, 254), (254, 254, 0, 0), (0, 254, 254, 254)], dtype=np.uint8)  # the upper row first
CELLS = np.array([(X, F, F, F), (F, F, X, X), (X, F, U, F)])  # the lowest row first
POINT = Footprint.point()
YAML = {"image": "map.pgm", "resolution": "0.5", "origin": "[1.0, -2.0, 0.0]", "negate": "0"}
YAML |= {"occupied_thresh": "0.65", "free_thresh": "0.196"}

REAL_MAPS = Path(__file__).resolve().parents[2] / "shared" / "maps"
needs_real_maps = pytest.mark.skipif(not REAL_MAPS.is_dir(), reason="the maps of others are not beside this checkout")


def write_yaml(folder: Path, **changes: str | None) -> Path:
    keys: dict[str, str | None] = {**YAML, **changes}
    path = folder / "map.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in keys.items() if value is not None))
    return path


def write_map(folder: Path, image: Image.Image | None = None, name: str = "map.pgm", **changes: str | None) -> Path:
    (Image.fromarray(GREYS) if image is None else image).save(folder / name)
    return write_yaml(folder, image=name, **changes)


def write_levels(folder: Path, bands: str, levels: list[Any], **changes: str | None) -> Path:
    """A map of one row of pixels."""
    image = Image.new(bands, (len(levels), 1))
    image.putdata(levels)
    return write_map(folder, image, "map.png", **changes)


def one_line(error: pytest.ExceptionInfo[InputError]) -> str:
    text = str(error.value)
    assert len(text.splitlines()) == 1
    return text


def as_palette() -> Image.Image:
    return Image.fromarray(GREYS).convert("RGB").quantize(3)


def as_16_bits() -> Image.Image:
    return Image.fromarray(GREYS.astype(np.uint16) * 257)


@pytest.mark.parametrize(
    ("make", "name"),
    [
        *((lambda mode=mode: Image.fromarray(GREYS).convert(mode), "map.png") for mode in ("L", "LA", "RGB", "RGBA")),
        *((lambda mode=mode: Image.fromarray(GREYS).convert(mode), "map.bmp") for mode in ("L", "RGB", "RGBA")),
        (lambda: Image.fromarray(GREYS).convert("RGB"), "map.ppm"),
        (as_palette, "map.png"),
        (as_palette, "map.bmp"),
        (as_16_bits, "map.png"),
        *((lambda mode=mode: Image.fromarray(GREYS).convert(mode), "map.tif") for mode in ("L", "RGB", "RGBA")),
        (as_16_bits, "map.tiff"),
        (lambda: Image.fromarray(GREYS), "map.PGM"),
    ],
)
def test_images_of_every_kind_give_the_same_cells(tmp_path: Path, make: Callable[[], Image.Image], name: str) -> None:
    found = load_map(write_map(tmp_path, make(), name))
    np.testing.assert_array_equal(found.cells, CELLS)


def test_a_pgm_of_numbers_in_text_gives_the_same_cells(tmp_path: Path) -> None:
    numbers = "\n".join(" ".join(map(str, row)) for row in GREYS.tolist())
    (tmp_path / "map.pgm").write_text(f"P2\n# CREATOR: map_saver 0.050 m/pix\n4 3\n255\n{numbers}\n")
    np.testing.assert_array_equal(load_map(write_yaml(tmp_path)).cells, CELLS)


@pytest.mark.parametrize(
    "header",
    [
        b"P5\r\n# CREATOR: map_saver 0.050 m/pix\r\n4 3\r\n255\r\n",
        b"P5 # a\n# b\n4 # c\n3\n# d\n255\n",
        b"P5\n4 3\n255\n# behind the header\n# twice\n",
        b"P5 4 3 255 ",
        b"P5\t4\r3\n255\r",
    ],
)
@pytest.mark.parametrize("bits", [8, 16])
def test_a_pgm_header_of_any_kind_shifts_no_pixel(tmp_path: Path, header: bytes, bits: int) -> None:
    """With Windows' line ends, the line feed behind 255 became the first pixel, and all others moved on by one."""
    pixels = GREYS.tobytes() if bits == 8 else (GREYS.astype(">u2") * 257).astype(">u2").tobytes()
    (tmp_path / "map.pgm").write_bytes((header if bits == 8 else header.replace(b"255", b"65535")) + pixels)
    np.testing.assert_array_equal(load_map(write_yaml(tmp_path)).cells, CELLS)


def test_a_first_pixel_that_looks_like_a_line_end_stays_a_pixel(tmp_path: Path) -> None:
    (tmp_path / "map.pgm").write_bytes(b"P5\n3 1\n255\n\n#\n")  # greys 10, 35 and 10
    assert load_map(write_yaml(tmp_path), may_be_full=True).cells.tolist() == [[X, X, X]]


def test_a_pgm_of_16_bits_gives_the_same_cells(tmp_path: Path) -> None:
    levels = (GREYS.astype(">u2") * 257).astype(">u2")
    (tmp_path / "map.pgm").write_bytes(b"P5 4 3 65535\n" + levels.tobytes())
    np.testing.assert_array_equal(load_map(write_yaml(tmp_path)).cells, CELLS)


def test_one_bit_is_occupied_or_free(tmp_path: Path) -> None:
    path = write_levels(tmp_path, "1", [0, 255, 255])
    assert load_map(path).cells.tolist() == [[X, F, F]]


def test_negate_1_turns_dark_and_bright_round(tmp_path: Path) -> None:
    path = write_levels(tmp_path, "L", [0, 255, 128], negate="1")
    assert load_map(path).cells.tolist() == [[F, X, U]]


@pytest.mark.parametrize(("word", "is_negated"), [("true", True), ("false", False), ("0", False)])
def test_negate_may_be_a_truth_value(tmp_path: Path, word: str, is_negated: bool) -> None:
    path = write_levels(tmp_path, "L", [0, 255], negate=word)
    assert load_map(path).cells.tolist() == ([[F, X]] if is_negated else [[X, F]])


@pytest.mark.parametrize("free_thresh", ["0.196", "0.25"])
def test_205_is_unknown_also_where_nav2_wrote_a_threshold_above_it(tmp_path: Path, free_thresh: str) -> None:
    found = load_map(write_map(tmp_path, free_thresh=free_thresh, occupied_thresh="0.65"))
    np.testing.assert_array_equal(found.cells, CELLS)


def test_a_file_without_mode_or_thresholds_is_trinary(tmp_path: Path) -> None:
    path = write_map(tmp_path, mode=None, negate=None, occupied_thresh=None, free_thresh=None)
    np.testing.assert_array_equal(load_map(path).cells, CELLS)


def test_a_low_threshold_of_occupied_cells_is_that_of_free_ones_where_none_is_given(tmp_path: Path) -> None:
    """A map of others with `occupied_thresh: 0.05` alone was refused for a 0.196 that it does not have."""
    path = write_levels(tmp_path, "L", [0, 240, 250, 255], occupied_thresh="0.05", free_thresh=None)
    assert load_map(path).cells.tolist() == [[X, X, F, F]]


def test_comments_after_values_and_keys_of_no_interest_are_skipped(tmp_path: Path) -> None:
    path = write_map(tmp_path)
    lines = ["image: map.pgm   # from the old robot", "resolution: 5e-1 # [m]", "origin: [1, -2, 0.0] # x, y, yaw"]
    path.write_text("\n".join([*lines, "negate: 0 # no", "cost_translation_table_name: x", "", "# -3.071 3.583"]))
    found = load_map(path)
    assert (found.resolution, found.origin) == (0.5, (1.0, -2.0, 0.0))
    np.testing.assert_array_equal(found.cells, CELLS)


@pytest.mark.parametrize(
    "name", ["/home/anna/maps/map.pgm", "~/map.pgm", "maps/map.pgm", r"C:\maps\map.pgm", "$(find nav)/maps/map.pgm"]
)
def test_a_map_from_another_machine_takes_the_image_beside_it_with_a_remark(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    write_map(tmp_path)
    found = load_map(write_yaml(tmp_path, image=f"'{name}'"))
    np.testing.assert_array_equal(found.cells, CELLS)
    assert found.remarks == (f"{tmp_path / 'map.yaml'}: image: there is no {name}, {tmp_path / 'map.pgm'} is taken",)


def test_a_tilde_is_the_home_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    (tmp_path / "home").mkdir()
    Image.fromarray(GREYS).save(tmp_path / "home" / "map.pgm")
    Image.fromarray(np.zeros_like(GREYS)).save(tmp_path / "map.pgm")
    found = load_map(write_yaml(tmp_path, image="~/map.pgm"))
    np.testing.assert_array_equal(found.cells, CELLS)
    assert found.remarks == ()


def test_a_missing_image_is_told_with_where_it_was_looked_for_and_what_lies_there(tmp_path: Path) -> None:
    Image.fromarray(GREYS).save(tmp_path / "map.png")
    with pytest.raises(MapError) as caught:
        load_map(write_yaml(tmp_path, image="/far/away.pgm"))
    assert one_line(caught).endswith(
        f"image: got '/far/away.pgm', expected a file that exists, looked for as /far/away.pgm and as "
        f"{tmp_path / 'away.pgm'} (map.png lies there: write image: map.png)"
    )


def test_the_name_of_an_image_that_no_file_can_have_is_not_repeated(tmp_path: Path) -> None:
    with pytest.raises(MapError) as caught:
        load_map(write_yaml(tmp_path, image=5000 * "a"))
    expected = (
        f"expected a file that exists, looked for as a file in {tmp_path}, where names have at most 255 characters"
    )
    assert one_line(caught).endswith(expected)


@pytest.mark.parametrize("yaw", ["nan", "-nan", ".nan", "NaN", "-nan(ind)"])
def test_a_yaw_that_is_no_number_is_refused_with_the_remedy(tmp_path: Path, yaw: str) -> None:
    with pytest.raises(MapError, match=r"origin: got \[1.0, -2.0, .*write 0.0 there"):
        load_map(write_map(tmp_path, origin=f"[1.0, -2.0, {yaw}]"))


def test_an_image_may_lie_in_another_folder(tmp_path: Path) -> None:
    (tmp_path / "images").mkdir()
    Image.fromarray(GREYS).save(tmp_path / "images" / "floor.png")
    for name in ("images/floor.png", str(tmp_path / "images" / "floor.png")):
        np.testing.assert_array_equal(load_map(write_yaml(tmp_path, image=name)).cells, CELLS)


@pytest.mark.parametrize("mode", ["trinary", "scale"])
def test_what_is_not_opaque_is_unknown(tmp_path: Path, mode: str) -> None:
    pixels = [(0, 0, 0, 255), (0, 0, 0, 254), (255, 255, 255, 0), (255, 255, 255, 255)]
    assert load_map(write_levels(tmp_path, "RGBA", pixels, mode=mode)).cells.tolist() == [[X, U, U, F]]


@pytest.mark.parametrize(("mode", "between"), [("trinary", U), ("scale", F)])
def test_the_thresholds_themselves_are_occupied_and_free(tmp_path: Path, mode: str, between: int) -> None:
    """Greys of 0.6 and 0.2, exact in the single precision that nav2_map_server computes in."""
    changes = {"mode": mode, "occupied_thresh": "0.6", "free_thresh": "0.2"}
    path = write_levels(tmp_path, "L", [101, 102, 103, 203, 204, 206], **changes)
    assert load_map(path).cells.tolist() == [[X, X, between, between, F, F]]
    path = write_levels(tmp_path, "L", [154, 153, 152, 52, 51, 50], negate="1", **changes)
    assert load_map(path).cells.tolist() == [[X, X, between, between, F, F]]


def test_scale_is_occupied_from_the_grey_on_that_rounds_to_100_percent(tmp_path: Path) -> None:
    """The static layer of a costmap takes 100 percent for an obstacle and 99 for none."""
    path = write_levels(tmp_path, "L", [0, 1, 2, 255], mode="scale", occupied_thresh="1.0", free_thresh="0.0")
    assert load_map(path).cells.tolist() == [[X, X, F, F]]


def test_raw_maps_hold_percent_up_to_100_and_unknown_above(tmp_path: Path) -> None:
    path = write_levels(tmp_path, "L", [0, 19, 65, 66, 99, 100, 101, 255], mode="raw", negate="1")
    assert load_map(path).cells.tolist() == [[F, F, F, F, F, X, U, U]]


@pytest.mark.parametrize("mode", ["Trinary", "SCALE", "Raw"])
def test_the_mode_may_be_written_in_any_case(tmp_path: Path, mode: str) -> None:
    greys = [0, 128, 255]
    found = load_map(write_levels(tmp_path, "L", greys, mode=mode)).cells.tolist()
    assert found == load_map(write_levels(tmp_path, "L", greys, mode=mode.lower())).cells.tolist()


def test_colours_are_as_bright_as_their_mean(tmp_path: Path) -> None:
    path = write_levels(tmp_path, "RGB", [(255, 0, 0), (255, 255, 0), (60, 200, 60), (255, 255, 240)])
    assert load_map(path).cells.tolist() == [[X, U, U, F]]


@pytest.mark.parametrize("yaw", [0.0, 0.4, -2.0, math.pi / 2])
def test_a_map_lies_where_its_origin_says_neither_mirrored_nor_shifted(tmp_path: Path, yaw: float) -> None:
    world = load_map(write_map(tmp_path, origin=f"[1.0, -2.0, {yaw!r}]")).to_world()
    c, s = math.cos(yaw), math.sin(yaw)
    for row, col in np.ndindex(CELLS.shape):
        for u, v in ((0.02, 0.02), (0.98, 0.02), (0.02, 0.98), (0.98, 0.98)):
            along, up = 0.5 * (col + u), 0.5 * (row + v)
            pose = (1.0 + c * along - s * up, -2.0 + s * along + c * up, 0.0)
            assert world.collides(POINT, pose) == (CELLS[row, col] != F), (row, col, u, v)
    for corner in ((-0.02, 0.75), (2.02, 0.75), (1.0, -0.02), (1.0, 1.52)):
        pose = (1.0 + c * corner[0] - s * corner[1], -2.0 + s * corner[0] + c * corner[1], 0.0)
        assert world.collides(POINT, pose), corner


def test_unknown_cells_are_blocked_or_free_by_choice(tmp_path: Path) -> None:
    path = write_map(tmp_path)
    there = (1.0 + 2.5 * 0.5, -2.0 + 2.5 * 0.5, 0.0)
    assert load_map(path).to_world().collides(POINT, there)
    assert not load_map(path).to_world(unknown="free").collides(POINT, there)
    assert not load_map(path, unknown="free").to_world().collides(POINT, there)
    assert load_map(path, unknown="free").to_world("occupied").collides(POINT, there)


def test_a_map_takes_more_obstacles(tmp_path: Path) -> None:
    found = load_map(write_map(tmp_path))
    place = (1.0 + 1.5 * 0.5, -2.0 + 0.25, 0.0)
    assert not found.to_world().collides(POINT, place)
    assert World(found.bounds(), [*found.obstacles(), Disc(place[:2], 0.1)]).collides(POINT, place)


def test_a_scenario_takes_a_map_by_name(tmp_path: Path) -> None:
    write_map(tmp_path)
    path = tmp_path / "scenario.yaml"
    path.write_text("name: m\nmap: map.yaml\nstart: {x: 1.75, y: -1.75}\ngoal: {x: 2.75, y: -0.75, tolerance: 0.2}\n")
    assert load_scenario(path).world.bounds == Bounds((1.0, -2.0), (3.0, -0.5))


def test_an_image_alone_is_a_map_dark_occupied_and_transparent_unknown(tmp_path: Path) -> None:
    Image.fromarray(GREYS).save(tmp_path / "floor.png")
    found = load_map(tmp_path / "floor.png", resolution=0.1, origin=(2.0, 3.0, 0.5))
    np.testing.assert_array_equal(found.cells, CELLS)
    assert (found.resolution, found.origin) == (0.1, (2.0, 3.0, 0.5))
    seen = Image.new("RGBA", (3, 1))
    seen.putdata([(0, 0, 0, 255), (0, 0, 0, 0), (255, 255, 255, 255)])
    seen.save(tmp_path / "seen.png")
    assert load_map(tmp_path / "seen.png", resolution=0.1).cells.tolist() == [[X, U, F]]


def test_a_resolution_given_replaces_that_of_the_file(tmp_path: Path) -> None:
    found = load_map(write_map(tmp_path), resolution=0.25, origin=(0, 0, 1))
    assert (found.resolution, found.origin) == (0.25, (0.0, 0.0, 1.0))


MOVINGAI = "type octile\nheight 3\nwidth 4\nmap\n@...\n..TW\nOGSO\n"


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_movingai_map_has_its_first_row_at_the_top(tmp_path: Path, end: str) -> None:
    (tmp_path / "arena.map").write_bytes(MOVINGAI.replace("\n", end).encode())
    found = load_map(tmp_path / "arena.map", resolution=2.0)
    assert found.cells.tolist() == [[X, F, F, X], [F, F, X, X], [X, F, F, F]]
    assert found.bounds() == Bounds((0.0, 0.0), (8.0, 6.0))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("..TW", "..T", "line 6: got 3 cells, expected 4, the width"),
        ("OGSO\n", "", "height: got 3, expected the 2 rows"),
        ("OGSO\n", "OGSO\n....\n", "line 8: got '....', expected the end after 3 rows"),
        ("..TW", "..xW", "line 6, column 3: got 'x', expected one of ., G, S, @, O, T, W"),
        ("height 3\n", "", "height: missing"),
        ("width 4", "width -4", "line 3: got 'width -4'"),
        ("width 4", "width 0", "width: got 0"),
        ("map\n", "", "line 4: got '@...', expected type, height, width or map"),
        (MOVINGAI, "type octile\n", "map: missing"),
        ("height 3\nwidth 4", "height 100000\nwidth 100000", "at most 100000000 cells"),
        (MOVINGAI, "\xff\x00\n", "line 1: got"),
    ],
)
def test_a_broken_movingai_map_is_refused_by_line(tmp_path: Path, old: str, new: str, words: str) -> None:
    (tmp_path / "arena.map").write_bytes(MOVINGAI.replace(old, new).encode("latin-1"))
    with pytest.raises(MapError) as caught:
        load_map(tmp_path / "arena.map", resolution=1.0)
    assert words in one_line(caught)
    assert "arena.map" in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"image": None}, "image: missing, expected the name of an image file"),
        ({"image": "[a]"}, "image: got ['a'], expected the name of an image file"),
        ({"image": "flor.pgm"}, "image: got 'flor.pgm', expected a file that exists, looked for "),
        ({"resolution": None}, "resolution: missing"),
        (
            {"resolution": "0"},
            "resolution: got 0, expected the side of a cell, a number above 0, from 1e-09 to 1e+06 [m]",
        ),
        ({"resolution": "-0.05"}, "resolution: got -0.05"),
        ({"resolution": ".nan"}, "resolution: got nan"),
        ({"resolution": ".inf"}, "resolution: got inf"),
        ({"resolution": "five"}, "resolution: got 'five'"),
        ({"resolution": "true"}, "resolution: got True"),
        ({"resolution": "1e-12"}, "resolution: got 1e-12, expected the side of a cell, a number above 0, from 1e-09"),
        ({"resolution": "1e9"}, "resolution: got 1000000000.0, expected the side of a cell, a number above 0, from"),
        ({"resolution": "1e6"}, "expected a map within 1e+06 m of zero"),
        ({"origin": None}, "origin: missing"),
        ({"origin": "[0, 0]"}, "origin: got [0, 0], expected three finite numbers [x, y, yaw]"),
        ({"origin": "[0, 0, 0, 0, 0, 0, 1]"}, "origin: got [0, 0, 0, 0, 0, 0, 1]"),
        ({"origin": "[0, .nan, 0]"}, "origin: got [0, nan, 0]"),
        ({"origin": "0"}, "origin: got 0"),
        ({"negate": "2"}, "negate: got 2, expected 0 or 1"),
        ({"mode": "cubic"}, "mode: got 'cubic', expected one of trinary, scale, raw"),
        ({"mode": "[1]"}, "mode: got [1]"),
        ({"free_thresh": "0.7"}, "free_thresh: got 0.7, expected at most occupied_thresh, which is 0.65"),
        ({"occupied_thresh": "65"}, "occupied_thresh: got 65, expected a number from 0 to 1"),
        ({"free_thresh": "low"}, "free_thresh: got 'low', expected a number from 0 to 1"),
        ({"resolution": "0.05\nresolution: 0.1"}, "resolution: got 0.1, expected this key only once"),
    ],
)
def test_a_broken_yaml_file_is_refused_by_key(tmp_path: Path, changes: dict[str, str | None], words: str) -> None:
    Image.fromarray(GREYS).save(tmp_path / "map.pgm")
    with pytest.raises(MapError) as caught:
        load_map(write_yaml(tmp_path, **changes))
    assert words in one_line(caught)
    assert one_line(caught).startswith(str(tmp_path / "map.yaml"))


def test_all_mistakes_of_a_yaml_file_are_told_at_once(tmp_path: Path) -> None:
    with pytest.raises(MapError) as caught:
        load_map(write_yaml(tmp_path, resolution="0", origin="[1]", negate="no"))
    assert [p.field for p in caught.value.problems] == ["image", "resolution", "origin", "negate"]


@pytest.mark.parametrize("text", ["- image: map.pgm\n- resolution: 0.05\n", "", "just words", "image: [", "a: &b [*b]"])
def test_a_yaml_file_that_is_no_mapping_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "map.yaml").write_text(text)
    with pytest.raises(MapError, match=r"map\.yaml: .*expected"):
        load_map(tmp_path / "map.yaml")


def png_header(width: int, height: int) -> bytes:
    """A PNG whose header promises much, with hardly a pixel in it."""
    chunks = [(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)), (b"IDAT", zlib.compress(b"\0"))]
    parts = (struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in chunks)
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def bmp_header(width: int, height: int) -> bytes:
    info = struct.pack("<IiiHHIIiiII", 40, width, height, 1, 24, 0, 0, 0, 0, 0, 0)
    return b"BM" + struct.pack("<IHHI", 54, 0, 0, 54) + info


LIARS: dict[str, list[Any]] = {
    "map.pgm": [b"P5\n%d %d\n255\n\0\0", b"P2\n%d %d\n255\n0 0 0\n"],
    "map.png": [png_header],
    "map.bmp": [bmp_header],
}


@pytest.mark.parametrize(("width", "height"), [(100_000, 100_000), (12_000, 12_000), (9_999, 9_999), (300, 300)])
@pytest.mark.parametrize(("name", "make"), [(name, make) for name, makers in LIARS.items() for make in makers])
def test_a_header_that_lies_costs_no_memory(
    tmp_path: Path, name: str, make: bytes | Callable[[int, int], bytes], width: int, height: int
) -> None:
    content = make % (width, height) if isinstance(make, bytes) else make(width, height)
    (tmp_path / name).write_bytes(content)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(MapError) as caught:
        load_map(write_yaml(tmp_path, image=name))
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 20_000  # [kB]
    line = one_line(caught)
    assert name in line
    assert ("10^8" in line or "100000000" in line) == (width * height > 1e8)


@pytest.mark.parametrize(
    ("name", "mode"), [("map.pgm", "L"), ("map.png", "L"), ("map.bmp", "RGB"), ("map.png", "RGBA")]
)
@pytest.mark.parametrize("share", [0.9, 0.5, 0.1, 0.0])
def test_an_image_that_was_cut_off_is_refused(tmp_path: Path, name: str, mode: str, share: float) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (40, 50), dtype=np.uint8)
    path = write_map(tmp_path, Image.fromarray(noise).convert(mode), name)
    content = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(content[: int(share * len(content))])
    with pytest.raises(MapError, match="expected a whole image") as caught:
        load_map(path)
    assert name in one_line(caught)


@pytest.mark.parametrize(
    "content",
    [b"not an image", b"\x89PNG\r\n\x1a\n" + b"x" * 50, b"P5 a b 255\n", b"P5\n2 2\n70000\n", b"Pf\n1 1\n1\n0000", b""],
)
def test_what_is_no_image_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "map.png").write_bytes(content)
    for path in (write_yaml(tmp_path, image="map.png"), tmp_path / "map.png"):
        with pytest.raises(MapError, match="expected a whole image") as caught:
            load_map(path, resolution=0.1)
        assert "map.png" in one_line(caught)


@pytest.mark.parametrize(
    "name", ["map.png", "map.pgm", "map.bmp", "map.gif", "map.jpg", "arena.map", "map.yaml", "d.csv"]
)
def test_damaged_files_raise_nothing_but_our_own_error(tmp_path: Path, name: str) -> None:
    noise = np.random.default_rng(2).integers(0, 256, (20, 20), dtype=np.uint8)
    write_map(tmp_path, Image.fromarray(noise), name if name.startswith("map.") and name != "map.yaml" else "map.pgm")
    (tmp_path / "arena.map").write_text(MOVINGAI)
    (tmp_path / "d.csv").write_text("x,y,radius\n1,2,0.5\n")
    content = (tmp_path / name).read_bytes()
    rng = np.random.default_rng(3)
    refused = 0
    for _ in range(100):
        damaged = np.frombuffer(content, dtype=np.uint8).copy()
        damaged[rng.integers(0, min(len(damaged), 80), 3)] = rng.integers(0, 256, 3)
        (tmp_path / name).write_bytes(damaged.tobytes())
        try:
            load_discs(tmp_path / name) if name == "d.csv" else load_map(tmp_path / name, resolution=0.1)
        except MapError:
            refused += 1
    assert refused > 0


@pytest.mark.parametrize("name", ["map.yaml", "map.png", "map.map", "map.pgm"])
def test_a_file_that_is_missing_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(MapError) as caught:
        load_map(tmp_path / name, resolution=1.0)
    assert str(tmp_path / name) in one_line(caught)


@pytest.mark.parametrize("name", ["map.xyz", "map"])
def test_a_file_of_another_kind_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(MapError, match=r"expected one of \.yaml, \.yml, \.map, "):
        load_map(tmp_path / name)


@pytest.mark.parametrize("name", ["floor.png", "arena.map"])
def test_a_map_without_a_scale_needs_a_resolution(tmp_path: Path, name: str) -> None:
    with pytest.raises(MapError, match=r"resolution: missing, expected the side of a cell \[m\]"):
        load_map(tmp_path / name)


def test_a_map_without_any_free_cell_is_refused(tmp_path: Path) -> None:
    path = write_levels(tmp_path, "L", [0] * 3)
    with pytest.raises(MapError, match="map.yaml: cells: got only occupied ones, expected a free one"):
        load_map(path)


def test_a_map_that_nobody_has_seen_is_refused_where_unknown_is_blocked(tmp_path: Path) -> None:
    path = write_levels(tmp_path, "L", [205] * 3)
    with pytest.raises(MapError, match="map.yaml: cells: got 3 x 1 blocked ones, expected a free one .unknown"):
        load_map(path).to_world()
    assert load_map(path).to_world(unknown="free").obstacles == ()


cells = arrays(np.int8, array_shapes(min_dims=2, max_dims=2, max_side=8), elements=st.sampled_from([X, F, U]))
poses = st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-7.0, 7.0))


@given(cells, st.floats(1e-3, 10.0), poses)
def test_a_saved_map_is_read_back_equal(
    tmp_path_factory: pytest.TempPathFactory, grid: NDArray[np.int8], resolution: float, origin: tuple[float, ...]
) -> None:
    grid[0, 0] = F
    saved = OccupancyMap(grid, resolution, (origin[0], origin[1], origin[2]))
    path = tmp_path_factory.mktemp("map") / "saved.yaml"
    saved.save(path)
    found = load_map(path)
    assert found == saved
    assert found.source == str(path)


def test_a_map_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    found = OccupancyMap(CELLS, 0.5)
    with pytest.raises(MapError, match="no such folder to write in|cannot write "):
        found.save(tmp_path / "missing" / "map.yaml")
    with pytest.raises(MapError, match="expected a name that ends in .yaml"):
        found.save(tmp_path / "map.png")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"cells": np.zeros(3)}, "rows and columns"),
        ({"cells": [[0, 100], [0]]}, "rows and columns"),
        ({"resolution": Fraction(10**400)}, "resolution: got"),
        ({"cells": np.full((2, 2), 1)}, r"only 100 \(occupied\), 0 \(free\) and -1 \(unknown\)"),
        ({"resolution": 0.0}, "resolution: got 0.0"),
        ({"origin": (0.0, 0.0)}, "origin: got"),
        ({"unknown": "maybe"}, "unknown: got 'maybe'"),
    ],
)
def test_an_occupancy_map_checks_what_it_is_made_of(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(MapError, match=words):
        OccupancyMap(**{"cells": CELLS, "resolution": 0.5, **changes})


def test_an_occupancy_map_is_its_own() -> None:
    grid = np.zeros((2, 2), dtype=np.int8)
    found = OccupancyMap(grid, 0.5)
    grid[0, 0] = X
    assert not found.cells.any()
    assert not found.cells.flags.writeable
    assert found == OccupancyMap.from_array(np.zeros((2, 2), dtype=bool), 0.5) != OccupancyMap(grid, 0.5)


@given(cells)
def test_a_world_of_a_map_makes_the_same_map_again(grid: NDArray[np.int8]) -> None:
    grid[0, 0] = F
    origin = (0.3, -7.1, 0.0)
    world = OccupancyMap(grid, 0.05, origin).to_world()
    expected = np.where(grid == F, F, X)
    np.testing.assert_array_equal(rasterize(world, 0.05).cells, expected)


SOLIDS: list[Obstacle] = [
    Disc((1.0, 1.0), 0.35),
    Box((2.02, 0.51), (2.4, 0.9)),
    OrientedBox((2.0, 2.2), (1.0, 0.03), 0.6),
    Polygon(np.array([(0.2, 2.0), (1.0, 2.1), (0.5, 2.8)])),
]


def test_a_cell_of_a_drawn_world_is_occupied_where_anything_reaches_into_it() -> None:
    world = World(Bounds((0.0, 0.0), (3.05, 3.0)), SOLIDS)
    found = rasterize(world, 0.1)
    x, y = np.random.default_rng(5).uniform((0.0, 0.0), (3.05, 3.0), (20_000, 2)).T
    hit = np.array([world.signed_clearance(*p) <= 0.0 for p in zip(x, y, strict=True)])
    assert found.cells.shape == (30, 31)
    assert (found.cells[:, -1] == X).all()  # half of these cells is out of bounds
    assert (found.cells[(y / 0.1).astype(int), (x / 0.1).astype(int)][hit] == X).all()
    occupied = np.argwhere(found.cells[:, :-1] == X)
    gaps = [world.signed_clearance(0.1 * c + 0.05, 0.1 * r + 0.05) for r, c in occupied]
    assert max(gaps) < 0.0708  # nothing is further from an occupied cell's centre than its corners


def test_a_world_is_written_and_read_as_a_map(tmp_path: Path) -> None:
    world = World(Bounds((-1.0, 0.0), (3.0, 3.0)), SOLIDS)
    save_map(world, tmp_path / "world.yaml", 0.05)
    assert load_map(tmp_path / "world.yaml") == rasterize(world, 0.05)


@pytest.mark.parametrize("resolution", [0.0, -1.0, math.nan, 1e-9, 1e-320])
def test_a_world_is_not_drawn_without_end(resolution: float) -> None:
    with pytest.raises(MapError, match="resolution: got"):
        rasterize(World(Bounds((0.0, 0.0), (1.0, 1.0))), resolution)


def test_discs_come_from_a_list(tmp_path: Path) -> None:
    (tmp_path / "discs.csv").write_text("x,y,radius\n-0.075,0.075,0.075\n1e0, 2,0.5\n\n")
    assert load_discs(tmp_path / "discs.csv") == [Disc((-0.075, 0.075), 0.075), Disc((1.0, 2.0), 0.5)]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x,y\n1,2\n", "line 1: got 'x,y', expected the header x,y,radius"),
        ("", "line 1: got ''"),
        ("x,y,radius\n1,2\n", "line 2: got '1,2', expected three numbers"),
        ("x,y,radius\n1,2,a\n", "line 2: got '1,2,a'"),
        ("x,y,radius\n1,2,1\n1,2,0\n", "line 3: disc.radius: got 0.0"),
        ("x,y,radius\n1,nan,1\n", "line 2: disc.center: got (1.0, nan)"),
        ("x,y,radius\n1,2,\xff\n", "expected a CSV file that can be read"),
    ],
)
def test_a_broken_list_of_discs_is_refused_by_line(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "discs.csv").write_text(text, encoding="latin-1")
    with pytest.raises(MapError) as caught:
        load_discs(tmp_path / "discs.csv")
    assert words in one_line(caught)


PROBLEM = """
name: unicycle2_v0-wall
environment:
  # original
  min: [0.0, 0.0]
  max: [6, 4]
  obstacles:
    - type: box
      center: [3, 1]
      size: [0.2, 2]
robots:
  - type: unicycle2_v0
    start: [1, 2, 0, 0, 0] # x,y,theta,v,w
    goal: [5.2, 3, 1.55, 0, 0]
"""
MODEL = """
max_vel: 0.5
min_vel: -0.5
max_angular_vel: 0.4
min_angular_vel: -0.4
max_acc_abs: 0.25
max_angular_acc: 0.2
size: [0.5, 0.25]
distance_weights: [1, 0.5, 0.25, 0.25]
shape: "box"
dt: 0.1
"""


def dynobench_files(folder: Path, problem: str = PROBLEM, model: str = MODEL) -> tuple[Path, Path]:
    (folder / "problem.yaml").write_text(problem)
    (folder / "model.yaml").write_text(model)
    return folder / "problem.yaml", folder / "model.yaml"


def test_a_dynobench_problem_is_a_scenario(tmp_path: Path) -> None:
    found = load_dynobench(*dynobench_files(tmp_path), tolerance=0.4)
    assert found.name == "unicycle2_v0-wall"
    assert found.world.bounds == Bounds((0.0, 0.0), (6.0, 4.0))
    assert found.world.obstacles == (Box((2.9, 0.0), (3.1, 2.0)),)
    assert found.robot.limits == Limits(-0.5, 0.5, -0.4, 0.4, 0.25, 0.2)
    assert found.robot.footprint == Footprint.polygon([(-0.25, -0.125), (0.25, -0.125), (0.25, 0.125), (-0.25, 0.125)])
    assert (found.start, found.planning.step) == ((1.0, 2.0, 0.0, 0.0, 0.0), 0.1)
    goal = found.goal
    assert (goal.x, goal.y, goal.theta) == (5.2, 3.0, 1.55)
    assert (goal.tolerance, goal.heading_tolerance, goal.speed_tolerance) == pytest.approx((0.2, 0.2, 0.2))
    worst = goal.tolerance + 0.5 * goal.heading_tolerance + 2 * 0.25 * (goal.speed_tolerance or 1.0)
    assert worst <= 0.4 + 1e-9


def test_a_dynobench_robot_may_be_kept_from_reversing(tmp_path: Path) -> None:
    files = dynobench_files(tmp_path)
    assert load_dynobench(*files).robot.limits.v_min == -0.5
    assert load_dynobench(*files, forward_only=True).robot.limits.v_min == 0.0


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("dt:", "dynamics: car1_v0\ndt:", "dynamics: got the robot car1_v0, expected unicycle2, the second-order"),
        ("min_vel: -0.5", "min_vel: 0.25", "min_vel: got 0.25, expected 0 or less: a robot that cannot stand still"),
        ("type: unicycle2_v0", "type: unicycle1_v0", "robots[0].type: got the robot unicycle1_v0, expected unicycle2"),
        ("robots:", "robots: [{}, {}]\nothers:", "robots: got 2 robots, expected a list of one robot"),
    ],
)
def test_dynobench_problems_of_other_kinds_are_refused_by_name(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in PROBLEM or old in MODEL
    with pytest.raises(MapError) as caught:
        load_dynobench(*dynobench_files(tmp_path, PROBLEM.replace(old, new), MODEL.replace(old, new)))
    assert words in one_line(caught)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("max_vel: 0.5", "", "model.yaml: max_vel: missing"),
        ("size: [0.5, 0.25]", "size: [0.5]", "model.yaml: size: got [0.5]"),
        ("dt: 0.1", "dt: 0", "model.yaml: dt: got 0"),
        ("[1, 0.5, 0.25, 0.25]", "[1, 0, 0.25, 0.25]", "model.yaml: distance_weights: got"),
        ("environment:", "surroundings:", "problem.yaml: environment: missing"),
        ("center: [3, 1]", "center: 3", "problem.yaml: environment.obstacles[0].center: got 3"),
        ("size: [0.2, 2]", "size: [0.2, 0]", "problem.yaml: environment.obstacles[0]"),
        ("type: box", "type: sphere", "problem.yaml: environment.obstacles[0].type: got 'sphere', expected one of box"),
        ("max: [6, 4]", "max: [0, 4]", "problem.yaml: environment"),
        ("start: [1, 2, 0, 0, 0]", "start: [1, 2, 0]", "problem.yaml: robots[0].start: got [1, 2, 0]"),
        ("robots:", "robots: []\nothers:", "problem.yaml: robots: got [], expected a list of one robot"),
        ("1.55, 0, 0]", "1.55, 0.5, 0]", "problem.yaml: robots[0].goal: got [5.2, 3, 1.55, 0.5, 0]"),
    ],
)
def test_a_broken_dynobench_file_is_refused_by_key(tmp_path: Path, old: str, new: str, words: str) -> None:
    with pytest.raises(MapError) as caught:
        load_dynobench(*dynobench_files(tmp_path, PROBLEM.replace(old, new), MODEL.replace(old, new)))
    assert words in one_line(caught)


def rooms(size: int, noise: float) -> NDArray[np.bool_]:
    """Rooms of 5 m with doors, and single cells that are noise."""
    rng = np.random.default_rng(7)
    grid = rng.random((size, size)) < noise
    grid[::100], grid[:, ::100] = True, True
    for row in range(0, size, 100):
        for column in range(0, size, 100):
            door = int(rng.integers(5, 80))
            grid[row + door : row + door + 15, column] = False
            grid[row, column + door : column + door + 15] = False
    return grid


@pytest.mark.slow
def test_a_map_of_four_million_cells_is_ready_in_time(tmp_path: Path) -> None:
    OccupancyMap.from_array(rooms(2000, 0.01), 0.05, (-50.0, -50.0, 0.0)).save(tmp_path / "map.yaml")
    started = time.process_time()
    world = load_map(tmp_path / "map.yaml").to_world()
    world.collides(Footprint.disc(0.2), (1.0, 1.0, 0.0))
    assert time.process_time() - started < 5.0


@needs_real_maps
@pytest.mark.parametrize(
    ("name", "size", "free", "occupied"),
    [
        ("depot.yaml", (30.2, 15.35), (3.0, 3.0), (0.1, 0.1)),
        ("tb3_sandbox.yaml", (19.2, 19.2), (0.5, 0.5), (8.0, 8.0)),
        ("small_warehouse/map.yaml", (14.3, 21.15), (0.0, 0.0), (-2.0, 9.0)),
    ],
)
def test_maps_of_others_are_read(
    name: str, size: tuple[float, float], free: tuple[float, float], occupied: tuple[float, float]
) -> None:
    world = load_map(REAL_MAPS / "ros" / name).to_world()
    assert world.bounds.size == pytest.approx(size)
    assert not world.collides(Footprint.disc(0.2), (*free, 0.0))
    assert world.collides(POINT, (*occupied, 0.0))


@needs_real_maps
@pytest.mark.parametrize("number", [0, 150, 228])
def test_the_reference_path_of_a_barn_world_is_free(number: int) -> None:
    discs = load_discs(REAL_MAPS / "barn" / f"world_{number}.csv")
    column, row = np.load(REAL_MAPS / "barn" / f"path_{number}.npy").T
    world = World(Bounds((-5.0, -1.0), (0.5, 15.0)), discs)
    poses = zip(0.15 * column - 4.575, 0.15 * row + 5.075, strict=True)
    assert all(not world.collides(Footprint.disc(0.15), (x, y, 0.0)) for x, y in poses)


@needs_real_maps
@pytest.mark.parametrize("name", ["bugtrap_0", "kink_0", "parallelpark_0"])
def test_the_published_path_of_a_dynobench_problem_is_free_and_arrives(name: str) -> None:
    from cbrrt_ompl.scenario.plain_yaml import read_yaml

    folder = REAL_MAPS / "dynobench"
    scenario = load_dynobench(folder / f"{name}.yaml", folder / "unicycle2_v0.yaml")
    reference = read_yaml(folder / f"{name}_reference.yaml", [])
    assert isinstance(reference, dict)
    states = np.array(reference["states"])  # (n, 5)
    limits = scenario.robot.limits
    assert (states[:, 3] >= limits.v_min - 1e-3).all() and (states[:, 3] <= limits.v_max + 1e-3).all()
    touching = [scenario.world.collides(scenario.robot.footprint, state[:3]) for state in states]
    assert sum(touching) == 0
    assert scenario.goal.violations(type(scenario.start)(*states[-1])) == []


@needs_real_maps
@pytest.mark.parametrize("tolerance", [0.2, 0.03])
@pytest.mark.parametrize("forward_only", [True, False], ids=["ahead", "both ways"])
@pytest.mark.parametrize("name", ["bugtrap_0", "kink_0", "parallelpark_0"])
def test_the_problems_of_dynobench_are_solved(name: str, forward_only: bool, tolerance: float) -> None:
    from cbrrt_ompl import plan, verify

    folder = REAL_MAPS / "dynobench"
    files = folder / f"{name}.yaml", folder / "unicycle2_v0.yaml"
    scenario = load_dynobench(*files, forward_only=forward_only, tolerance=tolerance)
    result = plan(scenario, "cb-rrt-robust", seed=1, time_limit=60.0)
    assert result.status == "solved"
    assert result.trajectory is not None
    assert verify(result.trajectory, scenario).violations == ()


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=50, deadline=None)
def test_a_cell_is_drawn_where_geos_says_that_an_obstacle_reaches_into_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turned = OrientedBox(tuple(rng.uniform(0.0, 3.0, 2)), tuple(rng.uniform(0.01, 2.0, 2)), rng.uniform(-4.0, 4.0))
    angles = (np.arange(9) + rng.uniform(0.0, 0.9, 9)) * 2.0 * np.pi / 9.0
    star = rng.uniform(0.2, 1.2, (9, 1)) * np.column_stack([np.cos(angles), np.sin(angles)])
    hole = 0.1 * np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)])
    holed = Polygon(np.array([(0.0, 0.0), (1.0, 0.2), (1.2, 1.0), (0.1, 0.9)]) + 1.5, (hole + 2.0,))
    disc = Disc(tuple(rng.uniform(0.0, 3.0, 2)), rng.uniform(0.01, 1.0))
    for obstacle in (turned, Polygon(star + rng.uniform(0.0, 3.0, 2)), holed, disc):
        found = rasterize(World(Bounds((0.0, 0.0), (3.0, 2.5)), [obstacle]), 0.1).cells == X
        y, x = np.meshgrid(0.1 * np.arange(25), 0.1 * np.arange(30), indexing="ij")
        squares = shapely.box(x + 1e-7, y + 1e-7, x + 0.1 - 1e-7, y + 0.1 - 1e-7)
        if isinstance(obstacle, Disc):
            expected = shapely.distance(squares, shapely.Point(obstacle.center)) <= obstacle.radius
        else:
            expected = shapely.intersects(squares, obstacle.to_shapely())
        np.testing.assert_array_equal(found, expected)
