"""``cbrrt``: the grammar of all commands, and a command line run from its words to its exit code.

Modules that take long to import are imported where commands use them, so that ``cbrrt --help`` answers at once.
"""

from __future__ import annotations

import argparse
import io
import os
import re
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from types import FrameType
from typing import Any, NoReturn

from cbrrt_ompl.cli.exit_codes import BAD_INPUT, BROKEN_PIPE, INTERRUPTED
from cbrrt_ompl.cli.output import print_error
from cbrrt_ompl.errors import CbrrtError, Problem

COMMANDS = (
    "plan",
    "improve",
    "drive",
    "verify",
    "show",
    "new",
    "planners",
    "robots",
    "scenarios",
    "bench",
    "report",
    "reproduce",
    "demo",
    "completion",
)
"""The commands in the order of the help; each is a module beside this one."""

EXAMPLES = """\
examples:
  cbrrt plan paper_case1 --seed 1 --figure case1.png   a scene of the paper
  cbrrt show depot.yaml --figure depot_map.png         a map of map_server
  cbrrt plan depot.yaml --robot jackal --start 5 3 90deg --goal 24 10
  cbrrt new depot.yaml --robot jackal --output tour.yaml
  cbrrt drive office --seed 2 --animation office.gif   plan again on the way
  cbrrt verify case1.csv paper_case1                   check it by other code
  cbrrt bench maze office --runs 20 --database bench.db --log-dir logs
  cbrrt report bench.db --output report                tables and charts

'cbrrt COMMAND --help' explains a command."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command line.

    Args:
        argv: the arguments after the program's name; None takes those of the process.

    Returns:
        The exit code.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a name may hold what the terminal has no letters for
    try:
        with _interrupted_at_once():
            arguments = build_parser().parse_args(argv)
            code: int = arguments.run(arguments)
            sys.stdout.flush()
    except KeyboardInterrupt:
        print("cbrrt: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except (CbrrtError, OSError) as error:
        print_error(error)
        return BAD_INPUT
    return code


@contextmanager
def _interrupted_at_once() -> Iterator[None]:
    """Leave on Ctrl-C in the midst of a compilation too, which no exception may interrupt."""
    is_ours = threading.current_thread() is threading.main_thread()
    if not is_ours or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield  # ignored, as a shell does for what runs in the background, or somebody else's
        return
    signal.signal(signal.SIGINT, _interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _interrupt(number: int, frame: FrameType | None) -> None:
    compiler = sys.modules.get("numba.core.compiler_lock")
    if compiler is not None and compiler.global_compiler_lock.is_locked():
        print("cbrrt: interrupted", file=sys.stderr, flush=True)
        os._exit(INTERRUPTED)
    signal.default_int_handler(number, frame)


def build_parser() -> argparse.ArgumentParser:
    """The grammar of the command line; what it parses holds the function to `run` and this `parser`."""
    parser = _Parser(
        prog="cbrrt",
        description="Plan trajectories for two-wheeled robots with CB-RRT and S-RRT in OMPL.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(parser=parser)
    parser.add_argument("--version", action=_Version, help="print the version and exit")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in COMMANDS:
        import_module(f"cbrrt_ompl.cli.{command}").add_parser(commands)
    return parser


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line and in the words of all others of this program."""

    def __init__(self, **settings: Any) -> None:
        """A parser that takes -90deg and -1e-3 for values and not for options."""
        super().__init__(**settings)
        self._negative_number_matcher = re.compile(r"-(\d+\.?\d*|\.\d+)(e[-+]?\d+)?(deg)?$", re.IGNORECASE)

    def error(self, message: str) -> NoReturn:
        """Print the line and leave with exit code 2."""
        print_error(CbrrtError(f"{message.removeprefix('argument ')} (see '{self.prog} --help')"))
        self.exit(BAD_INPUT)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuse what is none of the choices."""
        if action.choices is not None and value not in action.choices:
            problem = Problem("", value, f"one of {', '.join(action.choices)}")
            raise argparse.ArgumentError(action, str(problem))


class _Version(argparse.Action):
    """``--version``, looked up only when asked for."""

    def __init__(self, option_strings: Sequence[str], dest: str, help: str) -> None:
        """An option without a value."""
        super().__init__(option_strings, dest, nargs=0, help=help)

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        """Print it and leave."""
        from cbrrt_ompl import __version__

        print(f"cbrrt {__version__}")
        parser.exit()
