"""Figures of a job as JSON: files that a script reads and a person keeps."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from texbake.files import PathLike, replacing

if TYPE_CHECKING:
    from texbake.rendering.compare import Comparison


def write_report(path: PathLike, report: Mapping[str, Any]) -> None:
    """Write figures as JSON; the file appears whole or not at all.

    What JSON has no number for (NaN, infinities) becomes null, and paths become text.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    text = json.dumps(_plain(report), indent=2, allow_nan=False)
    with replacing(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def comparison_report(comparison: Comparison) -> dict[str, Any]:
    """Return the figures of a comparison, with the bare light mesh beside the mapped one."""
    return {
        "mapped": asdict(comparison.mapped),
        "bare": asdict(comparison.bare),
        "views_deg": [list(view) for view in comparison.views],
    }


def comparison_table(comparison: Comparison) -> list[tuple[str, str]]:
    """Rows of a label and figures, for a person."""
    bare, mapped = comparison.bare, comparison.mapped
    return [
        ("angle between normals, mean", f"{mapped.mean_deg:.2f}° (bare {bare.mean_deg:.2f}°)"),
        ("  median", f"{mapped.median_deg:.2f}° (bare {bare.median_deg:.2f}°)"),
        ("  95 % are below", f"{mapped.p95_deg:.2f}° (bare {bare.p95_deg:.2f}°)"),
        ("PSNR of the picture", f"{mapped.psnr_db:.1f} dB (bare {bare.psnr_db:.1f} dB)"),
        ("SSIM of the picture", f"{mapped.ssim:.3f} (bare {bare.ssim:.3f})"),
        ("outline differs on", f"{100 * mapped.silhouette_mismatch:.2f} % of the pixels"),
    ]


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    return value
