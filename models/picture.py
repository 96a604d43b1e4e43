"""Opens images as greyscale arrays; their size is checked in the header, before any pixel is decoded."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from messages.errors import BadInput
from models.input_file import read_limited

if TYPE_CHECKING:
    from PIL import Image

MAX_BYTES = 64 << 20
"""Maximum size of an image file [bytes]."""
FORMATS = ("PNG", "PPM", "BMP", "JPEG", "TIFF")
"""Pillow's format names; its PPM covers PGM, PBM and PPM."""


class Picture(NamedTuple):
    """Lightness from 0 (black) to 1 (white), shape (rows from the top, columns), and which pixels are transparent."""

    lightness: NDArray[np.float64]
    transparent: NDArray[np.bool_]


def read_picture(path: Path, most_pixels: int, what: str) -> Picture:
    """Read the image in a file; raises BadInput.

    Args:
        path: The file: PNG, PGM, PBM, PPM, BMP, JPEG or TIFF.
        most_pixels: Maximum number of pixels.
        what: What it should be, for errors: "a floor plan".
    """
    from PIL import Image  # 2 MiB in each process, and few of them read pictures

    content = read_limited(path, MAX_BYTES, "a picture")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            image = Image.open(io.BytesIO(content), formats=FORMATS)
        width, height = image.size
        if width * height > most_pixels:
            raise BadInput(
                f"{path}: the picture has {width} x {height} pixels, {what} has at most {most_pixels:,}: scale it down"
            )
        return _decode(image)
    except BadInput:
        raise
    except Image.DecompressionBombError:
        limit = f"{most_pixels:,} pixels that {what} has at most"
        raise BadInput(f"{path}: the picture is far larger than the {limit}: scale it down") from None
    except (OSError, SyntaxError, ValueError, MemoryError, EOFError) as error:
        raise BadInput(f"{path}: this is not a readable picture (PNG, PGM, BMP, JPEG or TIFF): {error}") from None


def _decode(image: Image.Image) -> Picture:
    if image.mode.startswith("I") or image.mode == "F":
        values = np.asarray(image, np.float64)
        lightness = np.nan_to_num(values) / (1.0 if image.mode == "F" else 65535.0)
        return Picture(np.clip(lightness, 0.0, 1.0), np.zeros(values.shape, np.bool_))
    rgba = np.asarray(image.convert("RGBA"), np.float64) / 255.0
    # The mean of the channels, as in map_server.
    return Picture(rgba[:, :, :3].mean(axis=2), rgba[:, :, 3] == 0)
