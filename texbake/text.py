"""Words in pictures: how much of each pixel a line of text covers."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def text_coverage(text: str, size: int) -> npt.NDArray[np.float32]:
    """Draw a line of text, cropped to its ink.

    Parameters
    ----------
    text
    size
        Height of the font in pixels, about 4/3 of that of a digit.

    Returns
    -------
    (h, w) float32
        0 where there is paper, 1 where there is ink; row 0 at the top. No pixels for no ink.
    """
    from PIL import Image, ImageDraw, ImageFont

    font = ImageFont.load_default(size)
    left, top, right, bottom = font.getbbox(text)
    room = int(right - left) + 2 * size, int(bottom - top) + 2 * size
    sheet = Image.new("L", room)
    ImageDraw.Draw(sheet).text((size - left, size - top), text, fill=255, font=font)
    box = sheet.getbbox() or (0, 0, 0, 0)
    return np.asarray(sheet.crop(box), np.float32) / np.float32(255.0)
