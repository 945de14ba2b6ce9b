"""A report as a list of blocks, written as Markdown or as one HTML page that needs no other file."""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

PIXEL_RATIO = 1.5
"""Pixels of a picture for one of the page."""

NARROW = 650
"""Width up to which a picture is shrunk to a narrow page; wider ones are scrolled [pixels of the page]."""


class Block(Protocol):
    """A part of a document."""

    def markdown(self, folder: str) -> Iterator[str]:
        """Lines of Markdown; pictures are files in a folder beside the document, or beside it without one."""

    def html(self) -> Iterator[str]:
        """Lines of HTML."""


@dataclass(frozen=True)
class Heading:
    """The title of a section."""

    text: str

    def markdown(self, folder: str) -> Iterator[str]:
        """A second-level heading."""
        yield f"## {self.text}"

    def html(self) -> Iterator[str]:
        """A second-level heading."""
        yield f"<h2>{inline(self.text)}</h2>"


@dataclass(frozen=True)
class Text:
    """A paragraph; `code` and **bold** as in Markdown."""

    text: str

    def markdown(self, folder: str) -> Iterator[str]:
        """The paragraph itself."""
        yield self.text

    def html(self) -> Iterator[str]:
        """A paragraph."""
        yield f"<p>{inline(self.text)}</p>"


@dataclass(frozen=True)
class Bullets:
    """A list of paragraphs."""

    items: Sequence[str]

    def markdown(self, folder: str) -> Iterator[str]:
        """An item a line."""
        yield from (f"- {item}" for item in self.items)

    def html(self) -> Iterator[str]:
        """A list."""
        yield f"<ul>{''.join(f'<li>{inline(item)}</li>' for item in self.items)}</ul>"


@dataclass(frozen=True)
class Table:
    """Rows of cells, the first column to the left and all others to the right."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: int = 1
    """Columns to the left."""

    def markdown(self, folder: str) -> Iterator[str]:
        """A row a line."""
        yield f"| {' | '.join(self.header)} |"
        yield f"|{'|'.join(' --- ' if column < self.left else ' ---: ' for column in range(len(self.header)))}|"
        yield from (f"| {' | '.join(cell.replace('|', '/') for cell in row)} |" for row in self.rows)

    def html(self) -> Iterator[str]:
        """A table that is scrolled where the page is narrow."""
        yield f'<div class="table" tabindex="0"><table><thead><tr>{self._cells("th", self.header)}</tr></thead><tbody>'
        yield from (f"<tr>{self._cells('td', row)}</tr>" for row in self.rows)
        yield "</tbody></table></div>"

    def _cells(self, tag: str, cells: Sequence[str]) -> str:
        kinds = ("l" if column < self.left else "r" for column in range(len(self.header)))
        return "".join(f'<{tag} class="{kind}">{inline(cell)}</{tag}>' for kind, cell in zip(kinds, cells, strict=True))


@dataclass(frozen=True)
class Picture:
    """A picture with its caption."""

    name: str
    """Name of its file."""
    png: bytes = field(repr=False)
    caption: str

    def markdown(self, folder: str) -> Iterator[str]:
        """A link to its file, and the caption."""
        yield f"![{self.caption}]({folder}/{self.name})" if folder else f"![{self.caption}]({self.name})"
        yield ""
        yield f"*{self.caption}*"

    def html(self) -> Iterator[str]:
        """The picture itself, and the caption."""
        data = base64.b64encode(self.png).decode()
        text = html.escape(self.caption)
        width = round(int.from_bytes(self.png[16:20], "big") / PIXEL_RATIO)
        image = f'<img alt="{text}" width="{width}" src="data:image/png;base64,{data}">'
        kind = ' class="wide"' if width > NARROW else ""
        yield f'<figure{kind}><div tabindex="0">{image}</div><figcaption>{text}</figcaption></figure>'


@dataclass(frozen=True)
class Document:
    """A title and what follows."""

    title: str
    blocks: Sequence[Block]

    @property
    def pictures(self) -> dict[str, bytes]:
        """All pictures by the names of their files."""
        return {block.name: block.png for block in self.blocks if isinstance(block, Picture)}

    def markdown(self, picture_folder: str = "") -> str:
        """The document in Markdown; its pictures are files in a folder beside it, or beside it without one."""
        lines = [f"# {self.title}"]
        for block in self.blocks:
            lines += ["", *block.markdown(picture_folder)]
        return "\n".join(lines) + "\n"

    def html(self) -> str:
        """The document as one page, with its style and pictures in it."""
        body = "\n".join(part for block in self.blocks for part in block.html())
        title = html.escape(self.title)
        return _PAGE.replace("{title}", title).replace("{style}", _STYLE).replace("{body}", body)


def inline(text: str) -> str:
    """Text with `code` and **bold**."""
    escaped = html.escape(text, quote=False)
    escaped = re.sub(r"`([^`]+)`", r"<code>\1</code>", escaped)
    return re.sub(r"\*\*([^*]+)\*\*", r"<strong>\1</strong>", escaped)


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
