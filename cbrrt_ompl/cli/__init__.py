"""The command line, ``cbrrt``: one module a command, and what they share."""

from __future__ import annotations

from cbrrt_ompl.cli.program import build_parser, main

__all__ = ["build_parser", "main"]
