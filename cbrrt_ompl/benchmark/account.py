"""What an experiment's account of its set-up says of the problem.

They are lines of that text, and no parameters of the experiment as OMPL has them: with such a one, Planner Arena 1.0.1
draws no progress.
"""

from __future__ import annotations

import re

NAME = "Scenario: "
LIMIT = "Samples of a run at most: "


def describe_problem(name: str, max_samples: int | None) -> str:
    """Lines to begin the account with.

    Args:
        name: the scenario's own name.
        max_samples: samples that a run may draw; None where the planners' limits differ.
    """
    limit = "" if max_samples is None else f"{LIMIT}{max_samples}\n"
    return f"{NAME}{' '.join(name.split())}\n{limit}"


def name_of(account: str) -> str | None:
    """The scenario's name; None where the account does not tell."""
    found = re.search(f"^{NAME}(.+)$", account, re.MULTILINE)
    return found and found[1]


def max_samples_of(account: str) -> int | None:
    """Samples that a run may draw; None where the account does not tell, or planners differ in it."""
    found = set(re.findall(f"^{LIMIT}([0-9]+)$", account, re.MULTILINE))
    return int(found.pop()) if len(found) == 1 else None
