"""Tables of the distortion of texture coordinates, for `texbake info` and `texbake unwrap`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from texbake import Distortion

Rows = list[tuple[str, str]]

_CHARTS_SHOWN = 10


def distortion_rows(found: Distortion) -> Rows:
    """Return rows of labels and figures for the whole mesh."""
    whole, turned = found.stretch, found.turned_stretch
    rows = [
        ("charts", f"{found.n_charts:,}"),
        ("stretch L2", f"{whole.l2:.4f}  (1 at best)"),
        ("stretch L∞", f"{whole.linf:.4f}  (1 at best)"),
        ("symmetric Dirichlet energy", f"{whole.symmetric_dirichlet:.4f}  (4 at best)"),
    ]
    if found.n_mirrored:
        figures = f"{turned.l2:.4f}, {turned.linf:.4f}, {turned.symmetric_dirichlet:.4f}"
        rows.append(("  with mirrored faces flipped", figures))
    tiles = "texture" if found.n_tiles == 1 else f"{found.n_tiles:,} tiles"
    rows += [
        ("quasi-conformal error", f"{whole.quasi_conformal:.4f}  (1 at best)"),
        ("angle distortion", f"{whole.angle:.4f}  (0 at best)"),
        ("area distortion", f"{whole.area:.4f}  (0 at best)"),
        ("mirrored faces", f"{found.n_mirrored:,}"),
        ("overlapping faces", f"{found.n_overlapping:,}{_unsure(found)}"),
        ("without area on the surface", f"{found.n_degenerate:,} faces"),
        ("without area in the texture", f"{found.n_collapsed:,} faces"),
        ("seams", f"{found.seam_length:.6g} model units"),
        (
            "texels per model unit",
            f"{found.texel_density:.6g}, varying by {100 * found.texel_density_variation:.1f} %",
        ),
        (f"{tiles} filled", f"{100 * found.packing_efficiency:.1f} %"),
    ]
    return rows


def worst_rows(found: Distortion) -> Rows:
    """Return rows of the charts, then of the faces, with the greatest stretch."""
    charts = sorted(found.charts, key=lambda chart: -chart.stretch.l2)[:_CHARTS_SHOWN]
    of = f" of {found.n_charts:,}" if found.n_charts > len(charts) else ""
    surface = sum(chart.area for chart in found.charts)
    rows = [(f"Charts of greatest stretch{of}", "")]
    rows += _columns(
        ("chart", "L2", "L2 alone", "L∞", "Dirichlet", "faces", "mirrored", "surface", "texels"),
        [
            (
                f"{chart.chart}",
                f"{chart.stretch.l2:.4f}",
                f"{chart.l2_alone:.4f}",
                f"{chart.stretch.linf:.4f}",
                f"{chart.stretch.symmetric_dirichlet:.4f}",
                f"{chart.n_faces:,}",
                f"{chart.n_mirrored:,}",
                f"{100.0 * chart.area / surface:.2f} %",
                f"{chart.texel_density:.5g}",
            )
            for chart in charts
        ],
    )
    rows.append(("Faces of greatest stretch", ""))
    rows += _columns(
        ("face", "chart", "L2", "L∞", ""),
        [
            (
                f"{face.face}",
                f"{face.chart}",
                f"{face.l2:.4f}",
                f"{face.linf:.4f}",
                "mirrored" if face.mirrored else "",
            )
            for face in found.worst_faces
        ],
    )
    return rows


def _unsure(found: Distortion) -> str:
    if not found.n_unsure:
        return ""
    return f"; {found.n_unsure:,} more were not checked, because too many faces are near them"


def _columns(heads: Sequence[str], lines: Sequence[Sequence[str]]) -> Rows:
    """Return rows of aligned columns with headings; the first column is the label."""
    table = [heads, *lines]
    widths = [max(len(line[i]) for line in table) for i in range(len(heads))]
    return [
        (
            f"  {line[0]:>{widths[0]}}",
            "  ".join(
                f"{word:>{width}}" for word, width in zip(line[1:], widths[1:], strict=True)
            ).rstrip(),
        )
        for line in table
    ]
