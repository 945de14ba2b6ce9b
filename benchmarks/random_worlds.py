"""Plan in random worlds, and let two checkers judge every trajectory that a planner calls solved.

The worlds hold obstacles of all kinds, the robots are points, discs and polygons with random limits, and some goals ask
for a heading or for little speed. One checker is `verify`; the other is `tests/independent_checker.py`, which shares no
code with the package. A refusal or an exception is printed with the number of its world, and the exit code is then 1.
With ``--improve``, each trajectory is improved, and that is judged too: how many became shorter, and none longer.

    python benchmarks/random_worlds.py --worlds 10000 --seed 1
    python benchmarks/random_worlds.py --worlds 10000 --seed 1 --improve 0.1
    python benchmarks/random_worlds.py --worlds 1 --first 4711 --seed 1
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

from tqdm import tqdm

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from generated_worlds import COMPILED, IMPROVED, IN_TURN, Outcome, outcomes  # noqa: E402  (found on the path set above)

COLUMNS = ("plans", "solved", "by checker", "by verify", "errors", "longer", "shorter")
"""Head of the table: the third and the fourth are refusals, the last two are about what was improved."""

FAULTS = COLUMNS[2:-1]
"""What must not happen."""


def judge(world: int, seed: int, samples: int, time_limit: float, improve_for: float | None) -> list[Outcome]:
    """What became of the plans in one world."""
    return list(outcomes(seed, world, samples, time_limit, improve_for))


def judged(arguments: argparse.Namespace) -> Iterator[list[Outcome]]:
    """The outcomes of all worlds, on as many processes as asked for."""
    worlds = range(arguments.first, arguments.first + arguments.worlds)
    work = partial(
        judge,
        seed=arguments.seed,
        samples=arguments.samples,
        time_limit=arguments.time_limit,
        improve_for=arguments.improve,
    )
    if arguments.jobs == 1:
        yield from map(work, worlds)
    else:
        with ProcessPoolExecutor(arguments.jobs) as pool:
            yield from pool.map(work, worlds, chunksize=4)


def main() -> int:
    """Print one table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--worlds", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0, help="number of the first world")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--samples", type=int, default=2_000, help="samples of each plan")
    parser.add_argument("--time-limit", type=float, default=5.0, help="largest time of each plan [s]")
    parser.add_argument("--improve", type=float, help="time to improve each trajectory for [s]")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin no further world after that")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    arguments = parser.parse_args()
    counts: Counter[tuple[str, str]] = Counter()
    worlds, began = 0, time.perf_counter()
    for found in tqdm(judged(arguments), total=arguments.worlds, disable=None, unit="world"):
        worlds += 1
        for one in found:
            refusals = bool(one.by_checker), bool(one.by_verify)
            flags = (True, one.solved, *refusals, bool(one.error), one.gain < 0.0, one.gain > 0.0)
            counts.update((one.planner, column) for column, flag in zip(COLUMNS, flags, strict=True) if flag)
            for who, lines in (("checker", one.by_checker), ("verify", one.by_verify), ("error", [one.error])):
                for line in filter(None, lines):
                    tqdm.write(f"world {one.world}, {one.planner}, {who}: {line}")
        if time.perf_counter() - began > 60.0 * arguments.minutes:
            break
    print(f"{f'{worlds:,} worlds':<20}" + "".join(f"{column:>12}" for column in COLUMNS))
    rows = (*COMPILED, *IN_TURN, *([IMPROVED] if arguments.improve is not None else []))
    for planner in rows:
        print(f"{planner:<20}" + "".join(f"{counts[planner, column]:>12,}" for column in COLUMNS))
    print(f"{time.perf_counter() - began:.0f} s")
    return int(any(counts[planner, column] for planner in rows for column in FAULTS))


if __name__ == "__main__":
    sys.exit(main())
