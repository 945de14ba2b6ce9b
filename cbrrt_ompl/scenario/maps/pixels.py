"""Images read as brightness and opacity, whatever their file is like."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.occupancy import check_cell_count
from cbrrt_ompl.errors import MapError, Problem, Remark
from cbrrt_ompl.files import note_read, refusal
from cbrrt_ompl.scenario.maps.pnm import open_straight

FORMATS = ("PNG", "PPM", "BMP", "JPEG", "GIF", "TIFF")
"""Formats that are read, by Pillow's names; PPM stands for PGM and PBM as well."""

_CELLS_PER_BYTE = 8300
"""More pixels than this in a byte of file none of the formats can hold: deflate packs 1032 bytes of 8 pixels."""


class Pixels(NamedTuple):
    """Brightness and opacity of an image; the first row is the upper one."""

    sums: NDArray[np.uint16]
    """Sum of the colour channels, shape (rows, columns)."""
    peak: int
    """The sum of a white pixel."""
    alpha: NDArray[np.uint8] | None
    """Opacity from 0 to 255, shape (rows, columns); None if the image has none."""


def read_pixels(path: Path) -> Pixels:
    """Brightness and opacity of the pixels of an image file.

    Args:
        path: a PGM, PNG, BMP, JPEG, GIF or TIFF file: grey, RGB or of a palette, of 1, 8 or 16 bits, with alpha or
            without.

    Raises:
        MapError: if there is no such file, or it is no such image, too large or cut off.
    """
    from PIL import Image  # here, since scenarios without a map need none

    source = str(path)
    note_read(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow warns of large images, which are checked here
            with open_straight(path) as file, Image.open(file, formats=FORMATS) as image:
                check_cell_count((image.height, image.width), "image")
                if image.width * image.height > _CELLS_PER_BYTE * path.stat().st_size:
                    raise _unreadable(source, "the file is shorter than its header says")
                image.load()
                return _pixels(image, source)
    except MapError as error:
        raise MapError(error.problems, source) from None
    except Image.DecompressionBombError:
        raise MapError(Problem("image", Remark("too many pixels"), "at most 10^8 cells"), source) from None
    except Image.UnidentifiedImageError:
        raise _unreadable(source, "not an image") from None
    except (FileNotFoundError, PermissionError, IsADirectoryError) as error:
        raise MapError(Problem("", refusal(error), "an image"), source) from None
    except Exception as error:  # decoders of broken files raise nearly anything
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise _unreadable(source, reason) from None


def _pixels(image: Any, source: str) -> Pixels:
    """Brightness and opacity of a Pillow image."""
    if image.mode.startswith("I"):  # 16 bits of grey
        levels = np.asarray(image)
        if levels.min() < 0 or levels.max() > 65535:
            raise _unreadable(source, "more than 16 bits a pixel")
        return Pixels(levels.astype(np.uint16), 65535, None)
    if image.mode == "F":
        raise _unreadable(source, "pixels of floating point")
    has_alpha = image.mode in ("LA", "La", "PA", "RGBA", "RGBa") or "transparency" in image.info
    if not has_alpha and image.mode in ("1", "L"):
        return Pixels(np.asarray(image.convert("L")).astype(np.uint16), 255, None)
    channels = np.asarray(image.convert("RGBA" if has_alpha else "RGB"))  # (rows, columns, 3 or 4)
    sums = channels[:, :, :3].sum(axis=2, dtype=np.uint16)
    return Pixels(sums, 3 * 255, channels[:, :, 3] if has_alpha else None)


def _unreadable(source: str, reason: str) -> MapError:
    return MapError(Problem("", Remark(reason), "a whole image: PGM, PNG, BMP, JPEG, GIF or TIFF"), source)
