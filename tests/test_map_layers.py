"""Maps and keepout masks of scenarios: the mask blocks where it is dark, and nowhere else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cbrrt_ompl.errors import ScenarioError
from cbrrt_ompl.problem.obstacles import Bounds
from cbrrt_ompl.problem.robot import Footprint
from cbrrt_ompl.scenario.map_layers import KeepoutMask
from cbrrt_ompl.scenario.scenario import Scenario, load_scenario, save_scenario

POINT = Footprint.point()
SCENARIO = "name: room\nstart: {x: 0.5, y: 0.5}\ngoal: {x: 3.5, y: 2.5, tolerance: 0.2}\nmap: "


def write_layer(folder: Path, name: str, greys: np.ndarray, resolution: float, origin: str = "[0, 0, 0]") -> None:
    """A map of greys, the upper row first."""
    Image.fromarray(greys).save(folder / f"{name}.pgm")
    (folder / f"{name}.yaml").write_text(f"image: {name}.pgm\nresolution: {resolution}\norigin: {origin}\n")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A free room of 4 m x 3 m, and a mask of unknown cells with one dark one, turned by a quarter of a turn."""
    write_layer(tmp_path, "room", np.full((6, 8), 254, dtype=np.uint8), 0.5)
    mask = np.full((2, 3), 205, dtype=np.uint8)
    mask[1, 2] = 0
    write_layer(tmp_path, "mask", mask, 0.25, "[2.0, 1.0, 1.5707963267948966]")
    return tmp_path


def load(folder: Path, layers: str) -> Scenario:
    (folder / "scenario.yaml").write_text(SCENARIO + layers + "\n")
    return load_scenario(folder / "scenario.yaml")


@pytest.mark.parametrize(
    "layers",
    ["{file: room.yaml, keepout: mask.yaml}", "{file: room.yaml, keepout: [mask.yaml]}", "[room.yaml, mask.yaml]"],
)
def test_the_dark_cells_of_a_mask_block_and_its_bounds_and_unknown_cells_do_not(folder: Path, layers: str) -> None:
    world = load(folder, layers).world
    assert world.bounds == Bounds((0.0, 0.0), (4.0, 3.0))
    assert len(world.obstacles) == 1
    assert world.collides(POINT, (1.875, 1.625, 0.0))  # the third cell of the lowest row, seen along y
    for free in ((1.875, 1.375), (1.625, 1.625), (2.125, 1.625), (1.875, 1.875)):
        assert not world.collides(POINT, (*free, 0.0)), free


@pytest.mark.parametrize("yaw", [0.3, -2.0])
def test_a_turned_mask_blocks_nothing_around_itself(folder: Path, yaw: float) -> None:
    write_layer(folder, "mask", np.full((4, 4), 254, dtype=np.uint8), 0.25, f"[2.0, 1.0, {yaw}]")
    assert load(folder, "[room.yaml, mask.yaml]").world.obstacles == ()


def test_a_mask_may_be_an_image_or_dark_all_over(folder: Path) -> None:
    Image.fromarray(np.zeros((2, 2), dtype=np.uint8)).save(folder / "dark.png")
    world = load(folder, "{file: room.yaml, keepout: [mask.yaml, {file: dark.png, resolution: 0.1}]}").world
    assert world.collides(POINT, (0.1, 0.1, 0.0))
    assert not world.collides(POINT, (0.3, 0.1, 0.0))


@pytest.mark.parametrize(
    "layers", ["[room.yaml, mask.yaml]", "[room.yaml, mask.yaml, {file: dark.png, resolution: 0.1}]"]
)
def test_masks_come_back_after_saving(folder: Path, layers: str) -> None:
    Image.fromarray(np.zeros((2, 2), dtype=np.uint8)).save(folder / "dark.png")
    scenario = load(folder, layers)
    assert scenario.map is not None
    assert scenario.map.keepout[0] == KeepoutMask((folder / "mask.yaml").resolve())
    (folder / "copies").mkdir()
    save_scenario(scenario, folder / "copies" / "copy.yaml")
    assert load_scenario(folder / "copies" / "copy.yaml") == scenario


def test_a_missing_mask_is_named_by_its_key(folder: Path) -> None:
    with pytest.raises(ScenarioError, match=r"map.keepout: .*(no such file: .*gone.yaml|gone.yaml.*no such file)"):
        load(folder, "{file: room.yaml, keepout: gone.yaml}")


def test_an_unknown_key_of_a_mask_is_named(folder: Path) -> None:
    with pytest.raises(ScenarioError, match=r"map.keepout.unknown: got an unknown key"):
        load(folder, "{file: room.yaml, keepout: {file: mask.yaml, unknown: free}}")


def test_an_image_taken_from_beside_its_map_is_remarked_on(folder: Path) -> None:
    (folder / "room.yaml").write_text("image: /home/anna/room.pgm\nresolution: 0.5\norigin: [0, 0, 0]\n")
    scenario = load(folder, "room.yaml")
    assert scenario.map is not None
    (remark,) = scenario.map.remarks
    assert "there is no /home/anna/room.pgm" in remark
