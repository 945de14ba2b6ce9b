"""Logs of OMPL's Benchmark: read, written and merged."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from cbrrt_ompl.errors import MISSING, InputError, Problem

Row = tuple[str, ...]
"""Texts of one run, in the order of the columns."""


@dataclass(frozen=True)
class PlannerLog:
    """What a log holds of one planner."""

    name: str
    """The planner's name with the prefix of OMPL, such as ``control_rrt``."""
    settings: Row
    """Lines ``name = value``, sorted by name."""
    columns: Row
    """Name and type of each column, such as ``time REAL``."""
    runs: tuple[Row, ...]
    """A row a run."""
    progress_columns: Row = ()
    """Name and type of what was recorded while the planner ran."""
    progress: tuple[tuple[Row, ...], ...] = ()
    """For each run the rows recorded while it ran."""


@dataclass(frozen=True)
class Log:
    """One experiment: a scenario, and all planners that ran in it."""

    name: str
    """The experiment's name; readers of OMPL's keep its last word."""
    version: str = "OMPL version 0.0.0"
    """First line of the log."""
    parameters: dict[str, str] = field(default_factory=dict)
    """Parameters of the experiment by name and type, such as ``max_samples INTEGER``."""
    host: str = "UNKNOWN"
    """The machine."""
    date: str = ""
    """When it began."""
    setup: str = ""
    """OMPL's account of spaces and planners."""
    cpu: str = ""
    """OMPL's account of the processor."""
    seed: str = "0"
    """Seed of the experiment."""
    time_limit: str = "0"
    """Time that a run may take [s]."""
    memory_limit: str = "0"
    """Memory that a run may take [MB]."""
    run_count: str = "0"
    """Runs of each planner."""
    total_time: str = "0"
    """Time that the experiment took [s]."""
    enums: tuple[Row, ...] = ()
    """Types of enumerations: name, then the text of each value."""
    planners: tuple[PlannerLog, ...] = ()
    """What each planner did."""


def read_log(path: str | Path) -> Log:
    """Read a log file.

    Raises:
        InputError: if it is no complete log of OMPL's Benchmark.
        OSError: if it cannot be read.
    """
    return parse_log(Path(path).read_text(encoding="utf-8", errors="replace"), str(path))


def parse_log(text: str, source: str = "log") -> Log:
    """Read a log.

    Args:
        text: what OMPL wrote.
        source: what messages call it.

    Raises:
        InputError: if it is no complete log of OMPL's Benchmark.
    """
    lines = _Lines(text, source)
    return Log(
        version=lines.next("a line 'OMPL version ...'"),
        name=lines.after("Experiment "),
        parameters=dict(_pair(lines.next("a parameter")) for _ in range(lines.count(" experiment properties"))),
        host=lines.after("Running on "),
        date=lines.after("Starting at "),
        setup=lines.block(),
        cpu=lines.block(),
        seed=lines.before(" is the random seed"),
        time_limit=lines.before(" seconds per run"),
        memory_limit=lines.before(" MB per run"),
        run_count=lines.before(" runs per planner"),
        total_time=lines.before(" seconds spent to collect the data"),
        enums=tuple(tuple(lines.next("an enumeration").split("|")) for _ in range(lines.count(" enum type"))),
        planners=tuple(_parse_planner(lines) for _ in range(lines.count(" planners"))),
    )


def format_log(log: Log) -> str:
    """The text of a log, as OMPL's Benchmark writes it."""
    head = [
        log.version,
        f"Experiment {log.name}",
        f"{len(log.parameters)} experiment properties",
        *(f"{name} = {value}" for name, value in log.parameters.items()),
        f"Running on {log.host}",
        f"Starting at {log.date}",
        f"<<<|\n{log.setup}|>>>",
        f"<<<|\n{log.cpu}|>>>",
        f"{log.seed} is the random seed",
        f"{log.time_limit} seconds per run",
        f"{log.memory_limit} MB per run",
        f"{log.run_count} runs per planner",
        f"{log.total_time} seconds spent to collect the data",
        f"{len(log.enums)} enum type",
        *("|".join(enum) for enum in log.enums),
        f"{len(log.planners)} planners",
    ]
    return "\n".join([*head, *(line for planner in log.planners for line in _planner_lines(planner))]) + "\n"


def merge_logs(logs: Sequence[Log], name: str, seed: int, run_count: int) -> Log:
    """Put the parts of an experiment together: planners of equal name and settings become one, with all their runs.

    Args:
        logs: the parts; the head is taken from the first.
        name: the experiment's name.
        seed: its seed.
        run_count: runs of each planner.
    """
    planners: dict[tuple[str, Row], PlannerLog] = {}
    for planner in (planner for log in logs for planner in log.planners):
        key = planner.name, planner.settings
        planners[key] = _joined(planners[key], planner) if key in planners else planner
    setups = {tuple(planner.name for planner in log.planners): log.setup for log in reversed(logs)}
    return replace(
        logs[0],
        name=name,
        seed=str(seed),
        run_count=str(run_count),
        host=",".join(_unique(log.host for log in logs)),
        date=min(log.date for log in logs),
        setup="\n".join(_unique(reversed(setups.values()))),
        cpu="\n".join(_unique(log.cpu for log in logs)),
        total_time=f"{sum(float(log.total_time) for log in logs):.6g}",
        planners=tuple(planners.values()),
    )


def _joined(first: PlannerLog, second: PlannerLog) -> PlannerLog:
    """Both parts of a planner's runs, with the columns of either; a cell that a part does not have is empty."""
    columns = tuple(sorted({*first.columns, *second.columns}))
    runs = []
    for part in (first, second):
        for row in part.runs:
            cells = dict(zip(part.columns, row, strict=True))
            runs.append(tuple(cells.get(column, "") for column in columns))
    padding = tuple(() for _ in first.runs) if second.progress and not first.progress else ()
    return replace(
        first,
        columns=columns,
        runs=tuple(runs),
        progress_columns=first.progress_columns or second.progress_columns,
        progress=padding + first.progress + second.progress,
    )


def _planner_lines(planner: PlannerLog) -> Iterator[str]:
    """The lines of one planner."""
    yield planner.name
    yield f"{len(planner.settings)} common properties"
    yield from planner.settings
    yield f"{len(planner.columns)} properties for each run"
    yield from planner.columns
    yield f"{len(planner.runs)} runs"
    yield from ("".join(f"{cell}; " for cell in row) for row in planner.runs)
    if planner.progress:
        yield f"{len(planner.progress_columns)} progress properties for each run"
        yield from planner.progress_columns
        yield f"{len(planner.progress)} runs"
        for rows in planner.progress:
            yield "".join("".join(f"{cell}," for cell in row) + ";" for row in rows)
    yield "."


def _parse_planner(lines: _Lines) -> PlannerLog:
    name = lines.next("the name of a planner")
    settings = tuple(lines.next("a setting") for _ in range(lines.count(" common properties")))
    columns = tuple(lines.next("a column") for _ in range(lines.count(" properties for each run")))
    runs = tuple(tuple(lines.next("a run").split("; ")[:-1]) for _ in range(lines.count(" runs")))
    progress_columns: Row = ()
    progress: tuple[tuple[Row, ...], ...] = ()
    if lines.peek() != ".":
        count = lines.count(" progress properties for each run")
        progress_columns = tuple(lines.next("a column") for _ in range(count))
        progress = tuple(
            tuple(tuple(row.split(",")[:-1]) for row in lines.next("progress").split(";")[:-1])
            for _ in range(lines.count(" runs"))
        )
    lines.after(".")
    for row in runs:
        if len(row) != len(columns):
            raise lines.error(f"{len(row)} values in a run", f"{len(columns)}, one a column")
    return PlannerLog(name, settings, columns, runs, progress_columns, progress)


def _pair(line: str) -> tuple[str, str]:
    name, _, value = line.partition(" = ")
    return name, value


def _unique(texts: Iterable[str]) -> list[str]:
    """Different texts, in order, without empty ones."""
    return [text for text in dict.fromkeys(texts) if text]


class _Lines:
    """The lines of a log, taken one by one."""

    def __init__(self, text: str, source: str) -> None:
        self._lines = text.removesuffix("\n").split("\n")
        self._source = source
        self._at = 0

    def peek(self) -> str | None:
        """The next line, left where it is."""
        return self._lines[self._at] if self._at < len(self._lines) else None

    def next(self, expected: str) -> str:
        """Take a line."""
        line = self.peek()
        if line is None:
            raise self.error(MISSING, expected)
        self._at += 1
        return line

    def after(self, beginning: str) -> str:
        """Take a line that begins so; its rest."""
        line = self.next(f"a line that begins with {beginning.strip()!r}")
        if not line.startswith(beginning):
            raise self.error(line, f"a line that begins with {beginning.strip()!r}")
        return line[len(beginning) :]

    def before(self, ending: str) -> str:
        """Take a line that ends so; what stands before."""
        line = self.next(f"a line that ends with {ending.strip()!r}")
        if not line.endswith(ending):
            raise self.error(line, f"a line that ends with {ending.strip()!r}")
        return line[: -len(ending)]

    def count(self, ending: str) -> int:
        """Take a line with a number before that ending."""
        number = self.before(ending)
        if not number.isdecimal():
            raise self.error(number, "a number of lines")
        return int(number)

    def block(self) -> str:
        """Take a text between marks, with its line ends."""
        self.after("<<<|")
        taken = []
        while not (line := self.next("the end of a block, '|>>>'")).startswith("|>>>"):
            taken.append(f"{line}\n")
        return "".join(taken)

    def error(self, value: object, expected: str) -> InputError:
        """A complaint about the line taken last."""
        return InputError(Problem(f"line {max(self._at, 1)}", value, expected), self._source)
