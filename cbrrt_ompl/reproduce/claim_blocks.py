"""Claims with their verdicts as blocks of a report: in short, and with all that was found."""

from __future__ import annotations

import html
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from cbrrt_ompl.benchmark.document import Table, inline
from cbrrt_ompl.reproduce.verdicts import Answer, Claim, Verdict


@dataclass(frozen=True)
class Summary:
    """Claims with their verdicts."""

    claims: Sequence[Claim]

    def markdown(self, folder: str) -> Iterator[str]:
        """A list a verdict."""
        for verdict in Verdict:
            chosen = [claim for claim in self.claims if claim.verdict is verdict]
            if chosen:
                yield f"**{_capital(verdict.value)}**"
                yield ""
                for claim in chosen:
                    yield f"- {claim.text} *{'. '.join(strongest(claim))}.*{f' {claim.note}' if claim.note else ''}"
                yield ""

    def html(self) -> Iterator[str]:
        """A card a claim."""
        yield '<div class="claims">'
        for verdict in Verdict:
            yield from (_card(claim) for claim in self.claims if claim.verdict is verdict)
        yield "</div>"


@dataclass(frozen=True)
class Evidence:
    """Claims with their rules and all that was found."""

    claims: Sequence[Claim]

    def markdown(self, folder: str) -> Iterator[str]:
        """A table a claim."""
        for claim in self.claims:
            yield f"**{claim.text}** {claim.rule} Verdict: **{claim.verdict.value}**."
            yield ""
            yield from _findings(claim).markdown(folder)
            yield ""

    def html(self) -> Iterator[str]:
        """A table a claim, to be unfolded."""
        for claim in self.claims:
            yield f"<details><summary>{_badge(claim.verdict)} {inline(claim.text)}</summary>"
            yield f"<p>{inline(claim.rule)}</p>"
            yield from _findings(claim).html()
            yield "</details>"


def strongest(claim: Claim) -> list[str]:
    """What was found in the paper's scenes, and where the answer was another elsewhere, shortened."""
    lines = [f"{finding.place}: {finding.value}" for finding in claim.findings if finding.in_paper]
    against = [finding for finding in claim.findings if not finding.in_paper and finding.answer is Answer.NO]
    others = sum(not finding.in_paper for finding in claim.findings)
    if against:
        named = "; ".join(f"{finding.place}: {finding.value}" for finding in against[:3])
        more = f"; and {len(against) - 3} more" if len(against) > 3 else ""
        lines.append(f"No in {len(against)} of {others} other places: {named}{more}")
    elif others:
        unclear = sum(not finding.in_paper and finding.answer is Answer.OPEN for finding in claim.findings)
        lines.append(f"Yes in {others - unclear} of {others} other places{', open in the rest' if unclear else ''}")
    return lines


def _findings(claim: Claim) -> Table:
    """All findings of a claim."""
    rows = [
        (finding.place, "paper" if finding.in_paper else "elsewhere", finding.value, finding.answer.value)
        for finding in claim.findings
    ]
    return Table(("place", "", "measured", "answer"), rows, left=2)


def _card(claim: Claim) -> str:
    """A claim in the summary."""
    lines = "".join(f"<li>{inline(line)}</li>" for line in strongest(claim))
    note = f'<p class="note">{inline(claim.note)}</p>' if claim.note else ""
    return f'<div class="claim">{_badge(claim.verdict)}<h3>{inline(claim.text)}</h3><ul>{lines}</ul>{note}</div>'


def _badge(verdict: Verdict) -> str:
    """A verdict as a coloured label."""
    return f'<span class="badge {verdict.name.lower()}">{html.escape(verdict.value)}</span>'


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]
