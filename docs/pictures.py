"""Make the pictures of the gallery: run the code blocks of ``gallery.md`` and keep what its pictures are named after.

``make pictures`` does it. Pictures are made small here, since everybody who has the repository has them all.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).resolve().parent
WIDTH = {".png": 1120, ".gif": 600}
"""Width at most [pixel]."""
COLORS = 64
"""Colours of a picture."""
EVERY = 2
"""Of an animation each second frame is kept."""


def commands(page: str) -> Iterator[list[str]]:
    """What the code blocks of a page run, as arguments of Python."""
    for kind, code in re.findall(r"^```(console|python)\n(.*?)^```$", page, flags=re.MULTILINE | re.DOTALL):
        if kind == "python":
            yield ["-c", code]
            continue
        for line in code.replace("\\\n", " ").splitlines():
            dollar, program, *arguments = shlex.split(line, comments=True)
            assert (dollar, program) == ("$", "cbrrt"), line
            yield ["-m", "cbrrt_ompl", *arguments]


def write_small(source: Path, target: Path) -> None:
    """Write a picture or an animation again, with fewer pixels, colours and frames."""
    with Image.open(source) as image:
        size = (WIDTH[source.suffix], round(image.height * WIDTH[source.suffix] / image.width))
        frames = []
        for number in range(0, getattr(image, "n_frames", 1), EVERY):
            image.seek(number)
            whole = image.convert("RGB")
            frames.append(whole.resize(size, Image.Resampling.LANCZOS) if size < image.size else whole)
        duration = EVERY * image.info.get("duration", 0)
    palette = frames[-1].quantize(COLORS)
    palette.putpalette([255 if value >= 248 else value for value in palette.getpalette()])  # white stays white
    frames = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    if len(frames) == 1:
        frames[0].save(target, optimize=True)
    else:
        frames[0].save(target, save_all=True, append_images=frames[1:], duration=duration, loop=0)


def main() -> None:
    """Run the blocks in an empty folder, and copy what they drew."""
    page = (DOCS / "gallery.md").read_text(encoding="utf-8")
    names = re.findall(r"\]\(images/(\S+)\)", page)
    with tempfile.TemporaryDirectory() as folder:
        for command in commands(page):
            print(shlex.join(command), flush=True)
            subprocess.run([sys.executable, *command], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        made = {path.name: path for path in Path(folder).rglob("*") if path.suffix in WIDTH}
        missing = sorted(set(names) - set(made))
        if missing:
            sys.exit(f"no command has made {', '.join(missing)}")
        for name in names:
            write_small(made[name], DOCS / "images" / name)


if __name__ == "__main__":
    main()
