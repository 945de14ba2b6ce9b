"""Damaged files: read, or refused in our own words. benchmarks/fuzz_files.py does the same many times over."""

from __future__ import annotations

import importlib.util
import time
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from cbrrt_ompl import InputError
from cbrrt_ompl.benchmark.case import Case, crash_log
from cbrrt_ompl.benchmark.database import write_database
from cbrrt_ompl.benchmark.results import read_experiments

CASES = 400


@pytest.fixture(scope="module")
def fuzz(repository: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("fuzz_files", repository / "benchmarks" / "fuzz_files.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_kind_of_file_is_accepted_before_it_is_damaged(fuzz: ModuleType, tmp_path: Path) -> None:
    for kind in fuzz.kinds():
        for use_cli in (False, True):
            assert fuzz.run_case(kind, kind.files[kind.name], tmp_path, use_cli) == (fuzz.ACCEPTED, ""), kind.name


def test_damaged_files_are_read_or_refused_and_nothing_else(fuzz: ModuleType, tmp_path: Path) -> None:
    chosen = fuzz.kinds()
    outcomes = []
    for number in range(CASES):
        kind, content, use_cli = fuzz.make_case(0, number, chosen)
        outcome, description = fuzz.run_case(kind, content, tmp_path, use_cli)
        assert outcome in (fuzz.ACCEPTED, fuzz.REFUSED), f"case {number} of {kind.name}: {outcome}\n{description}"
        outcomes.append(outcome)
    assert set(outcomes) == {fuzz.ACCEPTED, fuzz.REFUSED}


def test_a_damaged_database_is_read_or_refused(tmp_path: Path) -> None:
    path, rng = tmp_path / "a.db", np.random.default_rng(1)
    write_database(path, [crash_log(Case("e", {}, "rrt", 0, (1, 2, 3), 1.0, "0"))])
    whole, refused = path.read_bytes(), 0
    assert len(read_experiments(path)[0].series[0]) == 3
    for _ in range(200):
        damaged = bytearray(whole)
        for _ in range(rng.integers(1, 30)):
            damaged[rng.integers(len(damaged))] = rng.integers(256)
        path.write_bytes(damaged)
        try:
            read_experiments(path)
        except InputError:
            refused += 1
    assert refused > 20


def fail(_: Path) -> Any:
    raise KeyError("x")


def sleep(_: Path) -> Any:
    time.sleep(10.0)


def exhaust(_: Path) -> Any:
    raise MemoryError


@pytest.mark.parametrize(("load", "outcome"), [(fail, "traceback"), (sleep, "hang"), (exhaust, "memory")])
def test_the_fuzz_tells_what_goes_wrong(
    fuzz: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, load: Any, outcome: str
) -> None:
    monkeypatch.setattr(fuzz, "ALARM", 1)
    kind = fuzz.Kind("a.txt", {"a.txt": b""}, load)
    found, description = fuzz.run_case(kind, b"", tmp_path, use_cli=False)
    assert found == outcome
    assert load.__name__ in description
