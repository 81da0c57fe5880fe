"""Pictures side by side with captions, and angles shown as colors with a scale."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import require_library
from texbake.mesh.mesh import BoolArray, ByteArray, FloatArray
from texbake.records import dataclass
from texbake.texture.encoding import decode_srgb, encode_srgb
from texbake.texture.image import FloatImage

if TYPE_CHECKING:
    from PIL.ImageDraw import ImageDraw

# Angle of the brightest color; larger angles have the same color.
MAX_ANGLE_DEG = 30.0
# Evenly spaced sRGB colors from 0 to that angle, perceptually uniform, after matplotlib's inferno.
_RAMP = np.array(
    [
        (0.001, 0.000, 0.014),
        (0.133, 0.047, 0.290),
        (0.342, 0.062, 0.429),
        (0.541, 0.134, 0.415),
        (0.736, 0.216, 0.330),
        (0.892, 0.350, 0.199),
        (0.978, 0.558, 0.035),
        (0.974, 0.797, 0.206),
        (0.988, 0.998, 0.645),
    ]
)
# Background in sRGB, 0 to 255.
_PAPER = (24, 26, 29)
_INK = (232, 232, 232)
_FAINT = (160, 164, 170)
# Color for pixels without an angle.
_NOTHING = (0.25, 0.27, 0.30)


@dataclass(frozen=True, eq=False)
class Panel:
    """A picture (H, W, 3 or 4), linear, with a caption, and a note or the scale of angles."""

    color: FloatImage
    caption: str
    note: str
    legend: bool = False


def color_angles(angles_deg: FloatImage) -> FloatImage:
    """(H, W, 3): colors of angles (H, W) in linear light; NaN is gray."""
    shown = np.isfinite(angles_deg)
    colors = np.empty((*angles_deg.shape, 3), np.float32)
    colors[...] = decode_srgb(_NOTHING)
    colors[shown] = decode_srgb(_ramp(angles_deg[shown] / MAX_ANGLE_DEG))
    return colors


def side_by_side(panels: Sequence[Panel], seen: BoolArray) -> FloatImage:
    """(H', W', 3): pictures in a row, in linear light, cropped to the pixels that are seen."""
    levels = decode_srgb(np.arange(256, dtype=np.float32) / 255.0).astype(np.float32)
    return np.asarray(levels[sheets(panels, seen)[-1]])


def sheets(panels: Sequence[Panel], seen: BoolArray) -> tuple[ByteArray, ByteArray]:
    """Codes in sRGB, cropped, of all pictures but the last in a row, and of all."""
    require_library("PIL", "text in pictures")
    from PIL import Image, ImageDraw

    rows, columns = _crop(seen)
    height, width = rows.stop - rows.start, columns.stop - columns.start
    # A text size that is legible at the width of a panel.
    size = max(12, round(width / 26))
    margin, line = size // 2, round(size * 1.6)
    panel_width = max(width, 12 * size)
    step = panel_width + margin
    whole = Image.new("RGB", (len(panels) * step + margin, height + 2 * line + 2 * margin), _PAPER)
    draw = ImageDraw.Draw(whole)
    paper = decode_srgb(np.array(_PAPER) / 255.0)
    for i, panel in enumerate(panels):
        left = margin + i * step
        shown = panel.color[rows, columns]
        if shown.shape[2] == 4:
            opacity = shown[..., 3:]
            shown = (shown[..., :3] * opacity + paper * (1.0 - opacity)).astype(np.float32)
        codes = np.rint(encode_srgb(shown) * 255).astype(np.uint8)
        whole.paste(Image.fromarray(codes), (left + (panel_width - width) // 2, margin))
        below = height + margin + size // 3
        _text(draw, left, below, panel.caption, size, _INK, panel_width)
        if panel.legend:
            _legend(draw, left, below + line, size, panel_width)
        else:
            _text(draw, left, below + line, panel.note, size, _FAINT, panel_width)
    codes = np.asarray(whole)
    return codes[:, :-step], codes


def _ramp(levels: npt.NDArray[np.floating]) -> FloatArray:
    """(..., 3): sRGB colors for levels from 0 to 1."""
    knots = np.linspace(0.0, 1.0, len(_RAMP))
    return np.stack([pm.interp(levels, knots, _RAMP[:, k]) for k in range(3)], axis=-1)


def _crop(seen: BoolArray) -> tuple[slice, slice]:
    """Rows and columns of the visible pixels, with a margin of 4 % of the longer side."""
    if not seen.any():
        return slice(0, seen.shape[0]), slice(0, seen.shape[1])
    spans = [np.flatnonzero(seen.any(axis=axis)) for axis in (1, 0)]
    margin = max(1, round(0.04 * max(span[-1] - span[0] for span in spans)))
    rows, columns = (
        slice(max(0, int(span[0]) - margin), min(length, int(span[-1]) + 1 + margin))
        for span, length in zip(spans, seen.shape, strict=True)
    )
    return rows, columns


def _text(
    draw: ImageDraw, left: int, top: int, text: str, size: int, ink: tuple[int, int, int], room: int
) -> None:
    """Draw a line of text, smaller if it does not fit."""
    from PIL import ImageFont

    font = ImageFont.load_default(size)
    while draw.textlength(text, font=font) > room and size > 8:
        size -= 1
        font = ImageFont.load_default(size)
    draw.text((left, top), text, fill=ink, font=font)


def _legend(draw: ImageDraw, left: int, top: int, size: int, room: int) -> None:
    """Draw the scale of angles from 0 to `MAX_ANGLE_DEG`, with both ends labeled."""
    start = left + 2 * size
    stop = left + min(room, 16 * size) - 4 * size
    colors = _ramp(np.arange(stop - start) / (stop - 1 - start)).tolist()
    for x, ramp in zip(range(start, stop), colors, strict=True):
        draw.line([(x, top + size // 6), (x, top + size)], fill=tuple(round(255 * c) for c in ramp))
    _text(draw, left, top, "0°", size, _FAINT, 2 * size)
    _text(draw, stop + size // 2, top, f"{MAX_ANGLE_DEG:.0f}°", size, _FAINT, 4 * size)
