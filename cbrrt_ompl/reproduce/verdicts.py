"""The rules by which measured numbers become answers, and answers verdicts."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from cbrrt_ompl.benchmark.statistics import Interval

MOST = 2.0 / 3.0
"""Share that counts as "solves it", "fails" or "most of them"."""


class Answer(Enum):
    """Whether a claim is true in one place."""

    YES = "yes"
    NO = "no"
    OPEN = "open"


class Verdict(Enum):
    """What is to be said of a claim."""

    HOLDS = "holds"
    HOLDS_THERE = "holds in the paper's scenes, open elsewhere"
    ONLY_THERE = "holds only in conditions like the paper's"
    FAILS = "does not hold"
    OPEN = "open"


MEANINGS = {
    Verdict.HOLDS: "yes in every scene of the paper, and everywhere else that it was tested",
    Verdict.HOLDS_THERE: "yes in every scene of the paper; elsewhere never no, but too few runs to tell in some",
    Verdict.ONLY_THERE: "yes in every scene of the paper, no in another one: moved gaps, other readings or scenes",
    Verdict.FAILS: "no in at least one scene of the paper",
    Verdict.OPEN: "never no in the paper's scenes, but too few runs to tell in at least one of them",
}
"""How the answers make a verdict."""


@dataclass(frozen=True)
class Finding:
    """What was measured of a claim in one place."""

    place: str
    """Scene, and what was different there."""
    value: str
    """The measured number with its interval."""
    answer: Answer
    """What follows from it by the claim's rule."""
    in_paper: bool
    """Whether it is a scene of the paper as we read it."""


@dataclass(frozen=True)
class Claim:
    """A claim of the paper, the rule by which it is judged, and what was measured."""

    text: str
    """The claim in one sentence."""
    rule: str
    """When the answer is yes and when it is no."""
    findings: tuple[Finding, ...]
    """One a place."""
    note: str = ""
    """What must be known besides; empty for nothing."""

    @property
    def verdict(self) -> Verdict:
        """What follows from all findings."""
        return judge(
            [finding.answer for finding in self.findings if finding.in_paper],
            [finding.answer for finding in self.findings if not finding.in_paper],
        )


def judge(in_paper: Iterable[Answer], elsewhere: Iterable[Answer]) -> Verdict:
    """The verdict on a claim.

    Args:
        in_paper: the answers in the paper's scenes; without any, nothing can be said.
        elsewhere: the answers in all others.
    """
    there, others = set(in_paper), set(elsewhere)
    if Answer.NO in there:
        return Verdict.FAILS
    if Answer.OPEN in there or not there:
        return Verdict.OPEN
    if Answer.NO in others:
        return Verdict.ONLY_THERE
    return Verdict.HOLDS_THERE if Answer.OPEN in others else Verdict.HOLDS


def above(interval: Interval, threshold: float) -> Answer:
    """Yes if all of an interval lies above a threshold, no if all of it lies below, else open; NaN is open."""
    if interval.low > threshold:
        return Answer.YES
    return Answer.NO if interval.high < threshold else Answer.OPEN


def below(interval: Interval, threshold: float) -> Answer:
    """Yes if all of an interval lies below a threshold, no if all of it lies above, else open; NaN is open."""
    if interval.high < threshold:
        return Answer.YES
    return Answer.NO if interval.low > threshold else Answer.OPEN


def inside(interval: Interval, low: float, high: float) -> Answer:
    """Yes if all of an interval lies between two thresholds, no if all of it lies outside, else open."""
    answers = {above(interval, low), below(interval, high)}
    if Answer.NO in answers:
        return Answer.NO
    return Answer.OPEN if Answer.OPEN in answers else Answer.YES


def all_of(count: int, of: int) -> Answer:
    """Yes if all things have a property, no if one has not; open if there is nothing to look at."""
    if not of:
        return Answer.OPEN
    return Answer.YES if count == of else Answer.NO


def none_of(count: int, of: int) -> Answer:
    """Yes if no thing has a property, no if one has; open if there is nothing to look at."""
    return all_of(of - count, of)
