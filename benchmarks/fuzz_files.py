"""Damaged scenario, map and trajectory files: are they read or refused in one line, soon, and in little memory?

    python benchmarks/fuzz_files.py --cases 20000 --seed 1

Each case takes a valid file, damages it (bytes, keys, values, length) and reads it in a worker process under an alarm
and a limit of memory. A share of the cases goes through the command line. Exits with 1 on any traceback, hang or loss.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import multiprocessing
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image

from cbrrt_ompl import cli
from cbrrt_ompl.errors import InputError
from cbrrt_ompl.maps import load_map
from cbrrt_ompl.scenario.dynobench import load_dynobench
from cbrrt_ompl.scenario.maps.discs import load_discs
from cbrrt_ompl.scenario.scenario import load_scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory

ALARM = 5
"""Time after which a case hangs [s]."""

MEMORY = 2**30
"""Memory that a case may take besides what the libraries have mapped [bytes]."""

CLI_SHARE = 0.1
"""Share of the cases that go through the command line."""

BATCH = 100
"""Cases that a worker takes at a time."""

ACCEPTED, REFUSED, TRACEBACK, HANG, MEMORY_LOSS = "accepted", "refused", "traceback", "hang", "memory"
"""What may come of a case; the last three are findings."""

SCENARIO = """\
name: fuzz
bounds: {min: [-5, -5], max: [5, 5]}
obstacles:
  - {type: box, min: [-5, -0.1], max: [-2.1, 0.1]}
  - {type: disc, center: [1.0, 2.0], radius: 0.3}
  - {type: polygon, vertices: [[0, 1], [1, 1], [0.5, 2]], holes: [[[0.4, 1.1], [0.6, 1.1], [0.5, 1.3]]]}
  - {type: oriented_box, center: [3, -3], size: [1, 0.5], angle_deg: 30}
robot:
  footprint: {type: polygon, vertices: [[-0.2, -0.1], [0.2, -0.1], [0.2, 0.1], [-0.2, 0.1]]}
  limits: {v: [0.0, 1.0], omega_deg: [-30, 30], acceleration: 0.6, angular_acceleration_deg: 30}
  gains: {k_x: 1.5, k_y: 0.5, k_theta: 0.1}
start: {x: -4, y: -4, theta: 0}
goal: {x: 4, y: 4, tolerance: 0.5, theta_deg: 90, heading_tolerance_deg: 20, speed_tolerance: 0.1}
planning: {horizon: 2.0, step: 0.05, goal_bias: 0.1, max_samples: 50, cut_extension: discard, look_ahead: 2.0}
"""
MAP_SCENARIO = """\
name: on a map
map: {file: map.yaml, unknown: free}
start: {x: 0.25, y: 0.25}
goal: {x: 1.0, y: 0.8, tolerance: 0.2}
planning: {max_samples: 50}
"""
MAP = """\
image: map.pgm
mode: trinary
resolution: 0.05
origin: [0.0, 0.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""
MOVINGAI = "type octile\nheight 4\nwidth 6\nmap\n......\n.@@T..\n.W.G..\n......\n"
DISCS = "x,y,radius\n1.0,2.0,0.5\n-1.5,0.25,0.1\n3.0,3.0,0.2\n"
PROBLEM = """\
name: fuzz
environment:
  min: [0, 0]
  max: [6, 6]
  obstacles:
    - {type: box, center: [3, 3], size: [1, 2]}
robots:
  - type: unicycle2_v0
    start: [1, 1, 0, 0, 0]
    goal: [5, 5, 1.5, 0, 0]
"""
MODEL = """\
min_vel: -0.5
max_vel: 0.5
min_angular_vel: -0.5
max_angular_vel: 0.5
max_acc_abs: 0.25
max_angular_acc: 0.25
size: [0.5, 0.25]
distance_weights: [1, 0.5, 0.25, 0.25]
dt: 0.1
"""


class Kind(NamedTuple):
    """A kind of file to damage."""

    name: str
    """File that is damaged."""
    files: dict[str, bytes]
    """It and what belongs to it, by name."""
    load: Callable[[Path], object]
    """Reads it."""
    command: tuple[str, ...] = ()
    """Command line that reads it, with names of files in braces; empty if none does."""


def kinds() -> list[Kind]:
    """All kinds of files, valid."""
    pixels = np.full((20, 30), 254, dtype=np.uint8)
    pixels[10, 8:20], pixels[0, :5] = 0, 205
    images = {f"map.{suffix}": _image(pixels, suffix) for suffix in ("pgm", "png", "bmp", "gif", "jpg")}
    rgba = np.dstack([pixels, pixels, pixels, np.full_like(pixels, 255)])
    images["rgba.png"] = _image(rgba, "png")
    maps = {"map.yaml": MAP.encode(), **images}
    t: NDArray[np.float64] = np.linspace(0.0, 0.4, 5, dtype=np.float64)
    trajectory = Trajectory(t, t * 0.1 - 4.0, 0.0 * t - 4.0, 0.0 * t, 0.0 * t + 0.1, 0.0 * t, 0.0 * t + 0.1, 0.0 * t)
    with tempfile.TemporaryDirectory() as folder:
        trajectories = {}
        for suffix in ("csv", "npz", "json"):
            trajectory.save(Path(folder, f"a.{suffix}"))
            trajectories[f"a.{suffix}"] = Path(folder, f"a.{suffix}").read_bytes()
    plan = ("plan", "{}", "--planner", "cb-rrt-compiled", "--seed", "1", "--time-limit", "0.2")
    found = [
        Kind("s.yaml", {"s.yaml": SCENARIO.encode()}, load_scenario, plan),
        Kind("s.yaml", {"s.yaml": MAP_SCENARIO.encode(), **maps}, load_scenario, plan),
        Kind("map.yaml", maps, _world),
        Kind("map.yaml", {"s.yaml": MAP_SCENARIO.encode(), **maps}, _world, ("plan", "s.yaml", *plan[2:])),
        *(Kind(name, {name: content}, _image_world) for name, content in images.items()),
        Kind("map.pgm", maps, lambda path: _world(path.with_name("map.yaml"))),
        Kind("a.map", {"a.map": MOVINGAI.encode()}, _image_world),
        Kind("discs.csv", {"discs.csv": DISCS.encode()}, load_discs),
        *(
            Kind(name, {name: content, "s.yaml": SCENARIO.encode()}, _drive, ("verify", "{}", "s.yaml"))
            for name, content in trajectories.items()
        ),
    ]
    problem = {"problem.yaml": PROBLEM.encode(), "model.yaml": MODEL.encode()}
    return [*found, *(Kind(name, problem, _dynobench) for name in problem)]


def _image(pixels: Any, suffix: str) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, {"pgm": "PPM", "jpg": "JPEG"}.get(suffix, suffix))
    return buffer.getvalue()


def _world(path: Path) -> object:
    return load_map(path).to_world()


def _image_world(path: Path) -> object:
    return load_map(path, resolution=0.05).to_world()


def _drive(path: Path) -> object:
    trajectory = Trajectory.load(path)
    return trajectory.length, trajectory.duration, trajectory.point_turns


def _dynobench(path: Path) -> object:
    return load_dynobench(path.with_name("problem.yaml"), path.with_name("model.yaml"))


NASTY = (
    b"\0", b"\xff\xfe", b"1e308", b"-1e308", b"1e400", b".nan", b".inf", b"-.inf", b"nan", b"inf", b"1" * 5000, b"-0",
    b"1e-320", b"999999999", b"4294967296", b"[", b"]", b"{", b"}", b": ", b"- ", b"\n", b"\r", b"\t", b"#", b"&a ",
    b"*a", b"!!python/object:os.system ", b"%", b"'", b'"', b"|", b">", b"---\n", b"...\n", b"\xc2\x85",
    b"\xe2\x80\xa8", b"\xf0\x9f\xa4\x96", b"\x1b[2J", b",", b"null", b"true", b"~", b"[" * 200, b"{a: " * 30,
    b"a" * 100_000,
)  # fmt: skip
"""What is put into files."""

VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 0.0, -0.0, 1e-320, 1e-12, 1e-6, 0.5, 1e6, 1e9, 1e17, 1e308, -1e308, float("nan"),
    float("inf"), float("-inf"), 10**30, "", "a", "1", "1e3", "\0", "$x$", "../map.yaml", "/", ".", [], {}, [[]], [0],
    [0, 0], [1, 0], [[0, 0], [1, 1], [0, 1]], {"x": 0}, {"type": "disc", "radius": 1.0}, "disc", "free", "raw", "scale",
)  # fmt: skip
"""What is put in the place of values."""


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """A file with one to four damages, of its bytes or of its values."""
    for _ in range(min(rng.geometric(0.6), 4)):
        content = _DAMAGES[rng.integers(len(_DAMAGES))](content, rng)
    return content


def _flip(content: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(content)
    for _ in range(rng.integers(1, 9) if changed else 0):
        changed[rng.integers(len(changed))] = rng.integers(256)
    return bytes(changed)


def _truncate(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: rng.integers(len(content) + 1)]


def _drop(content: bytes, rng: np.random.Generator) -> bytes:
    first = rng.integers(len(content) + 1)
    return content[:first] + content[first + rng.integers(1, 40) :]


def _insert(content: bytes, rng: np.random.Generator) -> bytes:
    first = rng.integers(len(content) + 1)
    return content[:first] + NASTY[rng.integers(len(NASTY))] + content[first:]


def _duplicate(content: bytes, rng: np.random.Generator) -> bytes:
    first = rng.integers(len(content) + 1)
    piece = content[first : first + rng.integers(1, 200)]
    return content[:first] + piece * int(rng.integers(2, 2000 if len(content) < 10_000 else 3)) + content[first:]


def _number(content: bytes, rng: np.random.Generator) -> bytes:
    """Put something in the place of a run of digits."""
    digits = [i for i, byte in enumerate(content) if 48 <= byte <= 57]
    if not digits:
        return content
    first = last = digits[rng.integers(len(digits))]
    while last < len(content) and content[last] in b"0123456789.e-":
        last += 1
    return content[:first] + NASTY[rng.integers(len(NASTY))] + content[last:]


def _lines(content: bytes, rng: np.random.Generator) -> bytes:
    lines = content.splitlines(keepends=True)
    rng.shuffle(lines)
    return b"".join(lines)


def _value(content: bytes, rng: np.random.Generator) -> bytes:
    """Change, drop or swap a value of a YAML or JSON file."""
    try:
        data = yaml.safe_load(content.decode())
        places = list(_places(data))
        if not places:
            return content
        box, key = places[rng.integers(len(places))]
        action = rng.integers(4)
        if action == 0:
            del box[key]
        elif action == 1:
            other, other_key = places[rng.integers(len(places))]
            box[key], other[other_key] = other[other_key], box[key]
        else:
            box[key] = VALUES[rng.integers(len(VALUES))]
        if content.startswith(b"{"):
            return json.dumps(data).encode()
        return yaml.safe_dump(data).encode()
    except (yaml.YAMLError, UnicodeDecodeError, ValueError, KeyError, IndexError, RecursionError):
        return _flip(content, rng)


def _places(data: Any) -> Iterator[tuple[Any, Any]]:
    """Containers in a value, each with each of its keys."""
    keys = data if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ()
    for key in list(keys):
        yield data, key
        yield from _places(data[key])


_DAMAGES = (_flip, _truncate, _drop, _insert, _duplicate, _number, _lines, _value, _value, _value, _value)


class Hang(BaseException):
    """A case took too long; no ``except Exception`` takes it for an error of its own."""


def run_case(kind: Kind, content: bytes, folder: Path, use_cli: bool) -> tuple[str, str]:
    """Outcome of one case, and a description of what went wrong."""
    for name, valid in kind.files.items():
        (folder / name).write_bytes(content if name == kind.name else valid)

    def ring(*_: object) -> NoReturn:
        raise Hang

    previous = signal.signal(signal.SIGALRM, ring)
    signal.alarm(ALARM)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            if use_cli and kind.command:
                return _run_command(kind, folder)
            kind.load(folder / kind.name)
            return ACCEPTED, ""
    except InputError as error:
        text = str(error)
        lines = text.splitlines()
        if not text.strip() or len(lines) > len(error.problems) or max(map(len, lines)) > 2000:
            return TRACEBACK, f"not a line a problem: {text[:500]!r}"
        return REFUSED, ""
    except Hang:
        return HANG, traceback.format_exc(limit=-3)
    except MemoryError:
        return MEMORY_LOSS, traceback.format_exc(limit=-3)
    except BaseException:
        return TRACEBACK, traceback.format_exc(limit=-4)
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, previous)


def _run_command(kind: Kind, folder: Path) -> tuple[str, str]:
    out, err = io.StringIO(), io.StringIO()
    arguments = [
        str(folder / part.format(kind.name)) if "." in part and part != "0.2" else part for part in kind.command
    ]
    arguments = [str(folder / kind.name) if part == "{}" else part for part in arguments]
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = cli.main(arguments)
    lines = err.getvalue().splitlines()
    if code not in (0, 1, 2) or (code == 2) != bool(lines):
        return TRACEBACK, f"exit code {code}: {err.getvalue()[:500]}"
    if not all(line.startswith("cbrrt: error: ") for line in lines):
        return TRACEBACK, f"not a line an error: {err.getvalue()[:500]!r}"
    return (REFUSED if code == 2 else ACCEPTED), ""


def make_case(seed: int, number: int, chosen: list[Kind]) -> tuple[Kind, bytes, bool]:
    """The case of a number: its kind, the damaged content and whether the command line reads it."""
    rng = np.random.default_rng([seed, number])
    kind = chosen[number % len(chosen)]
    return kind, damaged(kind.files[kind.name], rng), bool(rng.random() < CLI_SHARE)


def run_batch(seed: int, first: int, last: int) -> list[tuple[int, str, str, str]]:
    """Number, kind, outcome and description of some cases."""
    chosen, results = kinds(), []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(first, last):
            kind, content, use_cli = make_case(seed, number, chosen)
            outcome, description = run_case(kind, content, Path(folder), use_cli)
            if description:
                description += f"\n{content[:1000]!r}"
            results.append((number, kind.name, outcome, description))
    return results


def prepare_worker() -> None:
    """Load all libraries, then limit the memory."""
    from cbrrt_ompl.planners.warm_up import warm_up

    warm_up()
    run_batch(0, 0, 2 * len(kinds()))
    mapped = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (mapped + MEMORY, mapped + MEMORY))


def main() -> int:
    """Run the cases and report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    began = time.perf_counter()
    counts: dict[str, Counter[str]] = {}
    findings = []
    context = multiprocessing.get_context("spawn")
    waiting = [(first, min(first + BATCH, arguments.cases)) for first in range(0, arguments.cases, BATCH)]
    while waiting:
        with ProcessPoolExecutor(arguments.jobs, context, prepare_worker) as pool:
            futures = {pool.submit(run_batch, arguments.seed, *span): span for span in waiting}
            waiting = []
            for future, (first, last) in futures.items():
                try:
                    results = future.result()
                except BrokenProcessPool:  # find the case that killed its worker by halves
                    if last - first == 1:
                        results = [(first, kinds()[first % len(kinds())].name, TRACEBACK, "the process died")]
                    else:
                        middle = (first + last) // 2
                        waiting += [(first, middle), (middle, last)]
                        continue
                for number, name, outcome, description in results:
                    counts.setdefault(name, Counter())[outcome] += 1
                    if outcome not in (ACCEPTED, REFUSED):
                        findings.append(f"case {number} ({name}): {outcome}\n{description}")
    print("\n\n".join(findings[:20]), file=sys.stderr)
    outcomes = (ACCEPTED, REFUSED, TRACEBACK, HANG, MEMORY_LOSS)
    print("| file | " + " | ".join(outcomes) + " |\n|---|" + "---:|" * len(outcomes))
    for name, count in [*sorted(counts.items()), ("all", sum(counts.values(), Counter()))]:
        print(f"| {name} | " + " | ".join(str(count[outcome]) for outcome in outcomes) + " |")
    print(f"\n{arguments.cases} cases, seed {arguments.seed}, {time.perf_counter() - began:.0f} s")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
