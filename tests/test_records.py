"""The page of records is made from its database alone."""

from __future__ import annotations

import importlib
import math
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

REPOSITORY = Path(__file__).resolve().parent.parent


@pytest.fixture
def benchmarks(monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, ModuleType]]:
    """The modules that make the records, which import each other by their names."""
    monkeypatch.syspath_prepend(str(REPOSITORY / "benchmarks"))
    before = set(sys.modules)
    yield {name: importlib.import_module(name) for name in ("barn", "record_campaigns", "record_page", "records")}
    for name in set(sys.modules) - before:
        if str(REPOSITORY / "benchmarks") in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]


@pytest.fixture
def campaigns(benchmarks: dict[str, ModuleType], monkeypatch: pytest.MonkeyPatch) -> dict[str, int]:
    """Three small campaigns in the place of the real ones; how often each was run."""
    Run, Runs = benchmarks["record_campaigns"].Run, benchmarks["record_campaigns"].Runs
    failed = Run(3, False, False, math.inf, math.inf)
    refused = Run(4, True, False, 0.004, 1.0)
    kinks = [Run(0, True, True, 0.002, 15.0), Run(1, True, True, 0.003, 16.0), Run(2, True, True, 0.001, 15.5)]
    counted: dict[str, int] = {}

    def kink(data: Path) -> Iterator[object]:
        counted["kink"] = counted.get("kink", 0) + 1
        yield Runs("unicycle2_kink", "cb-rrt-anytime", 0.2, [*kinks, failed, refused])
        yield Runs("unicycle2_kink", "sst", 3.0, [failed, failed._replace(seed=1)])

    def barn(data: Path) -> Iterator[object]:
        yield Runs("BARN", "drive", math.inf, [Run(0, True, True, 0.1, 0.5), Run(6, True, False, 0.1, 0.4)])

    def cities(data: Path) -> Iterator[object]:
        raise FileNotFoundError("movingai/NAME.map.scen")
        yield

    monkeypatch.setattr(benchmarks["records"], "CAMPAIGNS", {"kink": kink, "barn": barn, "cities": cities})
    return counted


def test_the_page_tells_what_is_in_the_database(
    benchmarks: dict[str, ModuleType],
    campaigns: dict[str, int],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    records, page = benchmarks["records"], tmp_path / "records.md"
    run = ["records.py", "run", "--data", str(tmp_path), "--output", str(tmp_path / "made")]
    for _ in range(2):
        monkeypatch.setattr(sys, "argv", run)
        records.main()
    assert campaigns["kink"] == 1
    told = capsys.readouterr().out
    assert "kink: there already" in told
    assert "cities: skipped, movingai/NAME.map.scen is not there" in told
    monkeypatch.setattr(sys, "argv", ["records.py", "page", str(tmp_path / "made/records.db"), "--output", str(page)])
    records.main()
    text = page.read_text(encoding="utf-8")
    assert text == benchmarks["record_page"].page(tmp_path / "made" / "records.db")
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]
    ours, sst, barn = (next(row for row in rows if row[1] == name) for name in ("cb-rrt-anytime", "sst", "drive"))
    assert ours[0] == "unicycle2_kink" and ours[5] == "17.7 s"
    assert ours[2] == "3 of 5 (23 to 88 %), 1 refused"
    assert ours[3].startswith("3.0 (") and ours[4].startswith("16.000 (15.000 to none")
    assert sst[2].startswith("0 of 2") and sst[4] == "none"
    assert barn[4].startswith("0.250 (0.000 to 0.500") and barn[5] == "0.169", "a drive that touched something scores 0"
    assert text.count("Not run: the files were not there.") == len(benchmarks["record_page"].SECTIONS) - 2


def test_no_database_is_one_line(
    benchmarks: dict[str, ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["records.py", "page", str(tmp_path / "no.db"), "--output", str(tmp_path / "x")])
    with pytest.raises(SystemExit, match="error: no such file: .*no.db"):
        benchmarks["records"].main()


def test_the_pages_sections_are_those_of_the_command(benchmarks: dict[str, ModuleType]) -> None:
    """What is in the repository was made by the present code: all but the tables is the same."""
    text = (REPOSITORY / "docs" / "records.md").read_text(encoding="utf-8")
    for section in benchmarks["record_page"].SECTIONS:
        assert f"## {section.title}\n\n{section.text}\n" in text
    assert text.startswith(benchmarks["record_page"].HEAD)


def test_the_readme_quotes_the_page() -> None:
    """Each row of its table of records: the first three numbers are somewhere in one row of the page."""
    readme = (REPOSITORY / "README.md").read_text(encoding="utf-8").split("## Records")[1].split("\n## ")[0]
    rows = [line for line in readme.splitlines() if line.startswith("|")][2:]
    page = [
        line for line in (REPOSITORY / "docs" / "records.md").read_text(encoding="utf-8").splitlines() if "|" in line
    ]
    assert len(rows) == 3
    for row in rows:
        problem, ours, published = (cell.strip() for cell in row.strip("|").split("|"))
        quoted = re.findall(r"\d+\.\d+", f"{ours} {published}")
        assert quoted, problem
        text = " ".join(page)
        assert all(number in text for number in quoted), problem
