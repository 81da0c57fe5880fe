"""Draw text in pictures."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def text_coverage(text: str, size: int) -> npt.NDArray[np.float32]:
    """Draw a line of text, cropped to its glyphs.

    `size`: height of the font in pixels, about 4/3 of the height of a digit. Returns (h, w)
    float32: share of each pixel that glyphs cover, row 0 at the top. Empty if nothing is drawn.
    """
    from PIL import Image, ImageDraw, ImageFont

    font = ImageFont.load_default(size)
    left, top, right, bottom = font.getbbox(text)
    room = int(right - left) + 2 * size, int(bottom - top) + 2 * size
    sheet = Image.new("L", room)
    ImageDraw.Draw(sheet).text((size - left, size - top), text, fill=255, font=font)
    box = sheet.getbbox() or (0, 0, 0, 0)
    coverage = np.asarray(sheet.crop(box), np.float32) / np.float32(255.0)
    return coverage.astype(np.float32, copy=False)
