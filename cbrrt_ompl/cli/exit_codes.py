"""How a command ends; 0 to 2 and 130 are documented in docs/cli.md."""

from __future__ import annotations

DONE, FAILED, BAD_INPUT, INTERRUPTED, BROKEN_PIPE = 0, 1, 2, 130, 141
