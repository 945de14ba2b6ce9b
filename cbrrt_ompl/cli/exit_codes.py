"""How a command ends; docs/cli.md says what the first four mean, the last is that of a broken pipe."""

from __future__ import annotations

DONE, FAILED, BAD_INPUT, INTERRUPTED, BROKEN_PIPE = 0, 1, 2, 130, 141
