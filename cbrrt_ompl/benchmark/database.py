"""The database of OMPL's benchmark tools, made from logs: what Planner Arena reads."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from pathlib import Path

from cbrrt_ompl.benchmark.log import Log, PlannerLog
from cbrrt_ompl.errors import InputError, Problem, Refusal

TABLES = """
CREATE TABLE experiments (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    name VARCHAR(512),
    totaltime REAL,
    timelimit REAL,
    memorylimit REAL,
    runcount INTEGER,
    version VARCHAR(128),
    hostname VARCHAR(1024),
    cpuinfo TEXT,
    date DATETIME,
    seed VARCHAR(24),
    setup TEXT
);
CREATE TABLE plannerConfigs (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    name VARCHAR(512) NOT NULL,
    settings TEXT
);
CREATE TABLE enums (
    name VARCHAR(512),
    value INTEGER,
    description TEXT,
    PRIMARY KEY (name, value)
);
CREATE TABLE runs (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    experimentid INTEGER REFERENCES experiments(id) ON DELETE CASCADE,
    plannerid INTEGER REFERENCES plannerConfigs(id) ON DELETE CASCADE
);
CREATE TABLE progress (
    runid INTEGER REFERENCES runs(id) ON DELETE CASCADE,
    time REAL,
    PRIMARY KEY (runid, time)
);
"""
"""Tables as the tools of OMPL have them; logs add columns to experiments, runs and progress."""

VIEWS = {
    "bestPlannerConfigsPerExperiment": """
        WITH configs AS (
            SELECT plannerid, name, experimentid, AVG(solved) AS solved, AVG({time}) AS time
            FROM runs JOIN plannerConfigs ON plannerConfigs.id = runs.plannerid
            GROUP BY plannerid, experimentid)
        SELECT plannerid, experimentid, MIN(solved) AS avg_solved, time AS avg_total_time
        FROM configs GROUP BY name, experimentid
        ORDER BY avg_solved DESC, avg_total_time""",
    "bestPlannerConfigs": """
        WITH configs AS (
            SELECT plannerid, name, AVG(solved) AS solved, AVG({time}) AS time
            FROM runs JOIN plannerConfigs ON plannerConfigs.id = runs.plannerid
            GROUP BY plannerid)
        SELECT plannerid, MIN(solved) AS avg_solved, time AS avg_total_time
        FROM configs GROUP BY name
        ORDER BY avg_solved DESC, avg_total_time""",
}
"""Of several configurations of one planner the one that solves least, as in the tools of OMPL."""


def write_database(path: str | Path, logs: Sequence[Log]) -> None:
    """Make the database of some experiments; an older one of that name is replaced once the new one is complete.

    Args:
        path: the file.
        logs: the experiments, one each.

    Raises:
        InputError: if the file is there and is no benchmark database.
        OSError: if it cannot be written.
    """
    check_replaceable(path)
    path = Path(path)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    unfinished.unlink(missing_ok=True)
    try:
        with closing(sqlite3.connect(unfinished)) as connection, connection:
            connection.executescript(TABLES)
            for log in logs:
                _add_experiment(connection, log)
            _add_views(connection)
        os.replace(unfinished, path)
    except sqlite3.OperationalError as error:
        raise OSError(None, str(error), str(path)) from None
    finally:
        unfinished.unlink(missing_ok=True)


def check_replaceable(path: str | Path) -> None:
    """Refuse to write over a file that is no benchmark database.

    Raises:
        InputError: if the file is there and is none.
    """
    path = Path(path)
    if path.exists() and path.stat().st_size > 0:
        open_database(path).close()


def open_database(path: str | Path) -> sqlite3.Connection:
    """Open a benchmark database for reading.

    Raises:
        InputError: if the file is missing or is none.
    """
    path = Path(path)
    if not path.is_file():
        reason = Refusal("cannot read {}: a folder" if path.is_dir() else "no such file")
        raise InputError(Problem("", reason, "the file of a benchmark database"), str(path))
    connection = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)
    try:
        found = {name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
        connection.close()
        raise InputError(Problem("", str(error), "an SQLite database"), str(path)) from None
    if not {"experiments", "plannerConfigs", "runs"} <= found:
        connection.close()
        expected = "the tables of a benchmark database: experiments, plannerConfigs, runs"
        raise InputError(Problem("", sorted(found), expected), str(path))
    return connection


def _add_experiment(connection: sqlite3.Connection, log: Log) -> None:
    """Enter one log."""
    for name, *values in log.enums:
        if not connection.execute("SELECT 1 FROM enums WHERE name = ?", (name,)).fetchone():
            connection.executemany(
                "INSERT INTO enums VALUES (?, ?, ?)", [(name, value, text) for value, text in enumerate(values)]
            )
    parameters = {_parameter_name(key): (key.split()[-1], value) for key, value in log.parameters.items()}
    _add_columns(connection, "experiments", [(name, kind) for name, (kind, _) in sorted(parameters.items())])
    entry = {
        "name": log.name.split()[-1],
        "totaltime": float(log.total_time),
        "timelimit": float(log.time_limit),
        "memorylimit": float(log.memory_limit),
        "runcount": int(log.run_count),
        "version": f"{log.version.split()[0]} {log.version.split()[-1]}",
        "hostname": log.host.split()[-1],
        "cpuinfo": log.cpu,
        "date": log.date,
        "seed": log.seed,
        "setup": log.setup,
        **{name: value for name, (_, value) in parameters.items()},
    }
    experiment = _insert(connection, "experiments", entry)
    for planner in log.planners:
        _add_planner(connection, experiment, planner)


def _add_planner(connection: sqlite3.Connection, experiment: int, planner: PlannerLog) -> None:
    """Enter the runs of one planner."""
    settings = "".join(f"{line}\n;" for line in planner.settings)
    config = {"name": planner.name, "settings": settings}
    known = connection.execute(
        "SELECT id FROM plannerConfigs WHERE name = :name AND settings = :settings", config
    ).fetchone()
    keys: dict[str, object] = {
        "experimentid": experiment,
        "plannerid": known[0] if known else _insert(connection, "plannerConfigs", config),
    }
    columns = _run_columns(planner.columns)
    _add_columns(connection, "runs", columns)
    runs = [
        _insert(connection, "runs", keys | dict(zip([name for name, _ in columns], _cells(row), strict=True)))
        for row in planner.runs
    ]
    columns = _run_columns(planner.progress_columns)
    _add_columns(connection, "progress", columns)
    for run, rows in zip(runs, planner.progress, strict=False):  # no rows at all where no planner reports progress
        for row in rows:
            cells = dict(zip([name for name, _ in columns], _cells(row), strict=True))
            _insert(connection, "progress", {"runid": run, **cells}, "INSERT OR IGNORE")


def _add_columns(connection: sqlite3.Connection, table: str, columns: Iterable[tuple[str, str]]) -> None:
    """Add what a table does not have yet; SQLite's names do not tell upper from lower case."""
    known = {row[1] for row in connection.execute(f"PRAGMA table_info({table})")}
    for name, kind in columns:
        if name not in known:
            connection.execute(f'ALTER TABLE {table} ADD "{name}" {kind}')


def _insert(connection: sqlite3.Connection, table: str, entry: Mapping[str, object], how: str = "INSERT") -> int:
    """Insert a row; its number."""
    names, marks = ", ".join(f'"{name}"' for name in entry), ", ".join("?" for _ in entry)
    cursor = connection.execute(f"{how} INTO {table} ({names}) VALUES ({marks})", tuple(entry.values()))
    return cursor.lastrowid or 0


def _run_columns(columns: Iterable[str]) -> list[tuple[str, str]]:
    """Names and types of columns in the database, from those of a log."""
    return [("_".join(column.split()[:-1]), column.split()[-1]) for column in columns]


def _cells(row: Iterable[str]) -> list[str | None]:
    """Values for the database; SQLite turns the texts into what their columns hold."""
    return [None if cell in ("", "nan", "inf") else cell for cell in row]


def _parameter_name(key: str) -> str:
    """Name of an experiment's parameter as a column."""
    return "".join(key.split()[:-1]).replace("-", "_")


def _add_views(connection: sqlite3.Connection) -> None:
    """Add the views on the best configuration of each planner."""
    columns = {row[1] for row in connection.execute("PRAGMA table_info(runs)")}
    if not {"solved", "time"} <= columns:
        return
    time = "time + simplification_time" if "simplification_time" in columns else "time"
    for name, query in VIEWS.items():
        connection.execute(f"CREATE VIEW {name} AS {query.format(time=time)}")
