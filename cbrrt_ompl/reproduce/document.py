"""A report as a list of blocks, written as Markdown or as one HTML page that needs no other file."""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from cbrrt_ompl.reproduce.verdicts import Answer, Claim, Verdict

PIXEL_RATIO = 1.5
"""Pixels of a picture for one of the page."""

NARROW = 650
"""Width up to which a picture is shrunk to a narrow page; wider ones are scrolled [pixels of the page]."""


@dataclass(frozen=True)
class Heading:
    """The title of a section."""

    text: str


@dataclass(frozen=True)
class Text:
    """A paragraph; `code` and **bold** as in Markdown."""

    text: str


@dataclass(frozen=True)
class Table:
    """Rows of cells, the first column to the left and all others to the right."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: int = 1
    """Columns to the left."""


@dataclass(frozen=True)
class Picture:
    """A picture with its caption."""

    name: str
    """Name of its file."""
    png: bytes = field(repr=False)
    caption: str


@dataclass(frozen=True)
class Summary:
    """Claims with their verdicts."""

    claims: Sequence[Claim]


@dataclass(frozen=True)
class Evidence:
    """Claims with their rules and all that was found."""

    claims: Sequence[Claim]


Block: TypeAlias = Heading | Text | Table | Picture | Summary | Evidence


@dataclass(frozen=True)
class Document:
    """A title and what follows."""

    title: str
    blocks: Sequence[Block]

    @property
    def pictures(self) -> dict[str, bytes]:
        """All pictures by the names of their files."""
        return {block.name: block.png for block in self.blocks if isinstance(block, Picture)}

    def markdown(self, picture_folder: str) -> str:
        """The document in Markdown; its pictures are files in a folder beside it."""
        lines = [f"# {self.title}"]
        for block in self.blocks:
            lines += ["", *_markdown(block, picture_folder)]
        return "\n".join(lines) + "\n"

    def html(self) -> str:
        """The document as one page, with its style and pictures in it."""
        body = "\n".join(part for block in self.blocks for part in _html(block))
        title = html.escape(self.title)
        return _PAGE.replace("{title}", title).replace("{style}", _STYLE).replace("{body}", body)


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


def _markdown(block: Block, folder: str) -> Iterator[str]:
    """A block in Markdown."""
    match block:
        case Heading(text):
            yield f"## {text}"
        case Text(text):
            yield text
        case Table(header, rows, left):
            yield f"| {' | '.join(header)} |"
            yield f"|{'|'.join(' --- ' if column < left else ' ---: ' for column in range(len(header)))}|"
            yield from (f"| {' | '.join(cell.replace('|', '/') for cell in row)} |" for row in rows)
        case Picture(name, _, caption):
            yield f"![{caption}]({folder}/{name})"
            yield ""
            yield f"*{caption}*"
        case Summary(claims):
            for verdict in Verdict:
                chosen = [claim for claim in claims if claim.verdict is verdict]
                if chosen:
                    yield f"**{_capital(verdict.value)}**"
                    yield ""
                    for claim in chosen:
                        yield f"- {claim.text} *{'. '.join(strongest(claim))}.*{f' {claim.note}' if claim.note else ''}"
                    yield ""
        case Evidence(claims):
            for claim in claims:
                yield f"**{claim.text}** {claim.rule} Verdict: **{claim.verdict.value}**."
                yield ""
                yield from _markdown(_findings(claim), folder)
                yield ""


def _html(block: Block) -> Iterator[str]:
    """A block in HTML."""
    match block:
        case Heading(text):
            yield f"<h2>{_inline(text)}</h2>"
        case Text(text):
            yield f"<p>{_inline(text)}</p>"
        case Table(header, rows, left):
            classes = ["l" if column < left else "r" for column in range(len(header))]
            head = "".join(
                f'<th class="{kind}">{_inline(cell)}</th>' for kind, cell in zip(classes, header, strict=True)
            )
            yield f'<div class="table" tabindex="0"><table><thead><tr>{head}</tr></thead><tbody>'
            for row in rows:
                cells = "".join(
                    f'<td class="{kind}">{_inline(cell)}</td>' for kind, cell in zip(classes, row, strict=True)
                )
                yield f"<tr>{cells}</tr>"
            yield "</tbody></table></div>"
        case Picture(_, png, caption):
            data = base64.b64encode(png).decode()
            text = html.escape(caption)
            width = round(int.from_bytes(png[16:20], "big") / PIXEL_RATIO)
            image = f'<img alt="{text}" width="{width}" src="data:image/png;base64,{data}">'
            kind = ' class="wide"' if width > NARROW else ""
            yield f'<figure{kind}><div tabindex="0">{image}</div><figcaption>{text}</figcaption></figure>'
        case Summary(claims):
            yield '<div class="claims">'
            for verdict in Verdict:
                for claim in claims:
                    if claim.verdict is verdict:
                        yield _card(claim)
            yield "</div>"
        case Evidence(claims):
            for claim in claims:
                yield f"<details><summary>{_badge(claim.verdict)} {_inline(claim.text)}</summary>"
                yield f"<p>{_inline(claim.rule)}</p>"
                yield from _html(_findings(claim))
                yield "</details>"


def _findings(claim: Claim) -> Table:
    """All findings of a claim."""
    rows = [
        (finding.place, "paper" if finding.in_paper else "elsewhere", finding.value, finding.answer.value)
        for finding in claim.findings
    ]
    return Table(("place", "", "measured", "answer"), rows, left=2)


def _card(claim: Claim) -> str:
    """A claim in the summary."""
    lines = "".join(f"<li>{_inline(line)}</li>" for line in strongest(claim))
    note = f'<p class="note">{_inline(claim.note)}</p>' if claim.note else ""
    return f'<div class="claim">{_badge(claim.verdict)}<h3>{_inline(claim.text)}</h3><ul>{lines}</ul>{note}</div>'


def _badge(verdict: Verdict) -> str:
    """A verdict as a coloured label."""
    return f'<span class="badge {verdict.name.lower()}">{html.escape(verdict.value)}</span>'


def _inline(text: str) -> str:
    """Text with `code` and **bold**."""
    escaped = html.escape(text, quote=False)
    escaped = re.sub(r"`([^`]+)`", r"<code>\1</code>", escaped)
    return re.sub(r"\*\*([^*]+)\*\*", r"<strong>\1</strong>", escaped)


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
<main>
<h1>{title}</h1>
{body}
</main>
</body>
</html>
"""

_STYLE = """\
:root {
  --back: #fbfbfa; --card: #fff; --text: #1d2328; --dim: #5b656e; --line: #dde1e4; --head: #f1f3f4; --link: #0b62a4;
  --yes: #0a6b4b; --mid: #8a5a00; --no: #ab2414; --open: #55606a;
}
@media (prefers-color-scheme: dark) {
  :root {
    --back: #14181b; --card: #1c2226; --text: #e4e8ea; --dim: #a2adb5; --line: #343d43; --head: #252c31;
    --yes: #15805b; --mid: #9a6700; --no: #bf3a28; --open: #65717b;
  }
}
* { box-sizing: border-box; }
body {
  margin: 0; background: var(--back); color: var(--text);
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif;
}
main { max-width: 70rem; margin: 0 auto; padding: 1.5rem 1.1rem 4rem; }
h1 { font-size: clamp(1.5rem, 5vw, 2.2rem); line-height: 1.2; margin: 0.6rem 0 1rem; }
h2 { font-size: 1.35rem; margin: 2.6rem 0 0.8rem; padding-top: 0.9rem; border-top: 1px solid var(--line); }
h3 { font-size: 1rem; line-height: 1.35; margin: 0.5rem 0 0.35rem; }
p { margin: 0.7rem 0; max-width: 46rem; overflow-wrap: anywhere; }
code { font: 0.88em ui-monospace, "DejaVu Sans Mono", Menlo, Consolas, monospace; overflow-wrap: anywhere; }
.table { overflow-x: auto; margin: 1rem 0; border: 1px solid var(--line); border-radius: 8px; background: var(--card); }
table { border-collapse: collapse; width: 100%; font-size: 0.88rem; font-variant-numeric: tabular-nums; }
th, td { padding: 0.42rem 0.6rem; text-align: left; white-space: nowrap; border-top: 1px solid var(--line); }
thead th { background: var(--head); border-top: 0; font-weight: 600; white-space: normal; vertical-align: bottom; }
th.r, td.r { text-align: right; }
figure {
  margin: 1.4rem 0; padding: 0.6rem; background: #fff; border: 1px solid var(--line); border-radius: 8px;
  text-align: center;
}
figure div { overflow-x: auto; }
figure img { max-width: 100%; height: auto; }
@media (max-width: 34rem) { .wide img { max-width: none; width: 34rem; } }
figcaption { color: #4d565d; font-size: 0.88rem; padding: 0.35rem 0.3rem 0.1rem; }
.claims { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 27rem), 1fr)); gap: 0.8rem; }
.claim { background: var(--card); border: 1px solid var(--line); border-radius: 8px; padding: 0.8rem 1rem; }
.claim ul { margin: 0; padding-left: 1.1rem; color: var(--dim); font-size: 0.86rem; }
.claim .note { margin: 0.5rem 0 0; color: var(--dim); font-size: 0.86rem; font-style: italic; }
.badge {
  display: inline-block; color: #fff; font-size: 0.76rem; font-weight: 600; line-height: 1.3;
  padding: 0.16rem 0.6rem; border-radius: 1rem;
}
.holds, .holds_there { background: var(--yes); }
.only_there { background: var(--mid); }
.fails { background: var(--no); }
.open { background: var(--open); }
details { margin: 0.5rem 0; }
summary { cursor: pointer; padding: 0.2rem 0; }
@media print { details { break-inside: avoid; } }
"""
