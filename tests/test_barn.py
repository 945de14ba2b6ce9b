"""The benchmark of BARN reads the challenge's worlds and scores as the challenge does."""

from __future__ import annotations

import importlib
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from cbrrt_ompl import Disc

REPOSITORY = Path(__file__).resolve().parent.parent
CYLINDER = """<model name='unit_cylinder_{i}'>
<pose frame=''>{x} {y} 0 0 0 0</pose>
<link name='link'><collision name='collision'><geometry><cylinder><radius>0.075</radius></cylinder></geometry>
</collision></link></model>"""


@pytest.fixture
def barn(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """The module, which imports its neighbours by their names."""
    monkeypatch.syspath_prepend(str(REPOSITORY / "benchmarks"))
    before = set(sys.modules)
    yield importlib.import_module("barn")
    for name in set(sys.modules) - before:
        if str(REPOSITORY / "benchmarks") in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]


@pytest.mark.parametrize(("time", "score"), [(5.0, 0.5), (12.0, 0.5), (24.0, 0.25), (100.0, 0.125)])
def test_the_metric_is_the_challenges(barn: ModuleType, time: float, score: float) -> None:
    assert barn.metric(True, time, 6.0) == pytest.approx(score)
    assert barn.metric(False, time, 6.0) == 0.0


def test_worlds_are_read_as_the_challenge_writes_them(barn: ModuleType, tmp_path: Path) -> None:
    models = "".join(CYLINDER.format(i=i, x=-0.15 * i, y=5.0) for i in range(3))
    ground = "<model name='ground_plane'><pose>0 0 0 0 0 0</pose></model>"
    state = "<state world_name='default'><model name='unit_cylinder_0'><pose>9 9 0 0 0 0</pose></model></state>"
    (tmp_path / "world_12.world").write_text(
        f"<sdf version='1.6'><world name='w'>{ground}{models}{state}</world></sdf>"
    )
    (tmp_path / "world_3.csv").write_text("x,y,radius\n1,2,0.5\n")
    (tmp_path / "world_7.csv").write_text("x,y,radius\n1,2,0.5\n")
    for number in (3, 12):
        np.save(tmp_path / f"path_{number}.npy", np.array([(15, 0), (15, 20)]))
    found = barn.worlds_in(tmp_path)
    assert [(world.name, path.name) for world, path in found] == [
        ("world_3.csv", "path_3.npy"),
        ("world_12.world", "path_12.npy"),
    ], "world 7 has no path"
    assert barn.load_world(found[0][0]) == [Disc((1.0, 2.0), 0.5)]
    assert barn.load_world(found[1][0]) == [Disc((-0.15 * i, 5.0), 0.075) for i in range(3)]
    lengths = math.hypot(0.075, 2.075), 3.0, math.hypot(0.075, 4.925)  # cell (15, 0) is at (-2.325, 5.075)
    assert barn.optimal_time(found[0][1]) == pytest.approx(sum(lengths) / 2.0)
