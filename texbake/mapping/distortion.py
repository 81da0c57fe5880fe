"""How well texture coordinates preserve the shape of a surface: all measurements in one report.

The measures and their sources are in `stretch`, charts and seams in `seams`, overlaps in `overlap`.
This module combines them, for the whole mesh, for each chart and for the worst faces.
"""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from texbake.errors import counted
from texbake.mapping.corner_uvs import check_measurable
from texbake.mapping.overlap import find_overlaps
from texbake.mapping.seams import charts_and_seams
from texbake.mapping.stretch import FaceStretch, Stretch, face_stretch, stretch_by_group
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.records import dataclass

N_WORST = 10  # faces listed


@dataclass(frozen=True, kw_only=True)
class ChartDistortion:
    """Measurements of one chart."""

    chart: int  # its number in `chart_ids`
    n_faces: int  # measured faces
    n_mirrored: int  # faces that are clockwise in the texture
    area: float  # area on the surface, in squares of model units
    fill: float  # share of the texture that the chart covers; overlaps count twice
    texel_density: float  # texels per model unit
    # At the scale of the whole mesh: a chart that is smaller than its share is stretched more.
    stretch: Stretch
    l2_alone: float  # L2 stretch as if there were no other chart, 1 at best

    def to_json(self) -> dict[str, Any]:
        """Return the figures by name; an infinite value becomes None."""
        figures = {name: getattr(self, name) for name in _CHART_FIGURES}
        alone = self.l2_alone if math.isfinite(self.l2_alone) else None
        return {**figures, **self.stretch.to_json(), "l2_alone": alone}


_CHART_FIGURES = ("chart", "n_faces", "n_mirrored", "area", "fill", "texel_density")


@dataclass(frozen=True, kw_only=True)
class FaceDistortion:
    """One of the most stretched faces."""

    face: int  # its index in the mesh
    chart: int
    # l2, linf: Stretch at the scale of the whole mesh; a mirrored face is measured as if flipped.
    l2: float
    linf: float
    mirrored: bool


@dataclass(frozen=True, kw_only=True)
class Distortion:
    """Measurements of the texture coordinates of a mesh."""

    stretch: Stretch  # stretch of the mesh as a whole
    turned_stretch: Stretch  # the same with mirrored faces flipped, so always finite
    charts: tuple[ChartDistortion, ...]  # every chart that has a measured face, by number
    worst_faces: tuple[FaceDistortion, ...]  # the ten faces of greatest L2 stretch, the worst first
    n_measured: int  # faces with an area both in space and in the texture, including mirrored ones
    n_degenerate: int  # faces without area in space; they are left out
    n_collapsed: int  # faces with an area in space but none in the texture; they are left out
    n_mirrored: int  # faces that are clockwise in the texture
    n_overlapping: int  # faces that overlap another in the texture
    n_unsure: int  # faces for which that could not be decided in bounded time; see `Overlaps`
    n_charts: int  # charts with area
    seam_length: float  # total length of the seams, in model units
    fill: float  # sum of the areas in the texture; overlaps count twice
    # unit squares of texture space that contain the centroid of a face: 1 except with UDIM tiles
    # and repeating textures
    n_tiles: int
    texel_density: float  # texels per model unit: the square root of texels per area
    # standard deviation of the texel density from face to face, as a share of the mean
    texel_density_variation: float

    @property
    def packing_efficiency(self) -> float:
        """Area that the faces cover, as a share of the tiles that they lie in."""
        return self.fill / self.n_tiles

    @property
    def wasted(self) -> float:
        """Share of the texels that stretch and gaps waste, from 0 to 1.

        A texture without stretch that fills the whole square samples the surface evenly. An atlas
        that fills the share f of its square, at a root mean square stretch of L2, samples it as far
        apart in the mean as such a texture with f / L2² of the texels. Mirrored charts count as the
        others.

        Based on: Sander, Snyder, Gortler and Hoppe, "Texture Mapping Progressive Meshes", SIGGRAPH
        2001 (L2 stretch, with the total areas scaled to be the same).
        """
        l2 = self.turned_stretch.l2
        return max(1.0 - self.fill / l2**2, 0.0) if math.isfinite(l2) else 1.0

    def table(self) -> list[tuple[str, str]]:
        """Return rows of labels and figures for the whole mesh."""
        unsure = ""
        if self.n_unsure:
            unsure = (
                f"; {self.n_unsure:,} more were not checked, because too many faces are near them"
            )
        whole, turned = self.stretch, self.turned_stretch
        rows = [
            ("charts", f"{self.n_charts:,}"),
            ("stretch L2", f"{whole.l2:.4f}  (1 at best)"),
            ("stretch L∞", f"{whole.linf:.4f}  (1 at best)"),
            ("symmetric Dirichlet energy", f"{whole.symmetric_dirichlet:.4f}  (4 at best)"),
        ]
        if self.n_mirrored:
            figures = f"{turned.l2:.4f}, {turned.linf:.4f}, {turned.symmetric_dirichlet:.4f}"
            rows.append(("  with mirrored faces flipped", figures))
        tiles = "texture" if self.n_tiles == 1 else f"{self.n_tiles:,} tiles"
        rows += [
            ("quasi-conformal error", f"{whole.quasi_conformal:.4f}  (1 at best)"),
            ("angle distortion", f"{whole.angle:.4f}  (0 at best)"),
            ("area distortion", f"{whole.area:.4f}  (0 at best)"),
            ("mirrored faces", f"{self.n_mirrored:,}"),
            ("overlapping faces", f"{self.n_overlapping:,}{unsure}"),
            ("without area on the surface", counted(self.n_degenerate, "face")),
            ("without area in the texture", counted(self.n_collapsed, "face")),
            ("seams", f"{self.seam_length:.6g} model units"),
            (
                "texels per model unit",
                f"{self.texel_density:.6g}, varying by {100 * self.texel_density_variation:.1f} %",
            ),
            (f"{tiles} filled", f"{100 * self.packing_efficiency:.1f} %"),
        ]
        return rows

    def to_json(self) -> dict[str, Any]:
        """Return everything, with the fields of `stretch`, as plain values; None for infinite."""
        return {
            **self.stretch.to_json(),
            **{name: getattr(self, name) for name in _FIGURES},
            "turned_stretch": self.turned_stretch.to_json(),
            "charts": [chart.to_json() for chart in self.charts],
            "worst_faces": [asdict(face) for face in self.worst_faces],
        }


_FIGURES = (
    "n_measured", "n_degenerate", "n_collapsed", "n_mirrored", "n_overlapping", "n_unsure",
    "n_charts", "seam_length", "fill", "n_tiles", "packing_efficiency", "texel_density",
    "texel_density_variation",
)  # fmt: skip


def distortion(
    mesh: MeshLike, size: int | tuple[int, int] = 1024, *, threads: int | None = None
) -> Distortion:
    """Measure the texture coordinates of a mesh.

    Parameters
    ----------
    mesh : Mesh
        With texture coordinates.
    size : int or (int, int)
        Texels along each side, or (width, height). Only the texel densities depend on more than
        its aspect ratio.
    threads
        None for every processor.

    Raises
    ------
    UvError
        The mesh has no texture coordinates, or no face has an area both in space and in the
        texture.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> round(distortion(plane(4, 4)).stretch.l2, 12)
    1.0
    """
    mesh = as_mesh(mesh)
    width, height = (size, size) if isinstance(size, int) else size
    check_measurable(mesh)
    found = face_stretch(mesh, size)
    uvs = mesh.corner_uvs()
    measured = np.zeros(mesh.n_faces, dtype=bool)
    measured[found.faces] = True
    charts, seam_length = charts_and_seams(mesh, measured)
    charts = charts[found.faces]
    overlaps = find_overlaps(uvs, threads=threads)
    everything = np.zeros(len(found.faces), dtype=np.int32)
    texel_areas = np.abs(found.texel_areas)
    chart_figures = _chart_figures(found, charts, width * height)
    return Distortion(
        stretch=stretch_by_group(found, everything)[0],
        turned_stretch=stretch_by_group(found, everything, turned=True)[0],
        charts=chart_figures,
        worst_faces=_worst_faces(found, charts),
        n_measured=len(found.faces),
        n_degenerate=found.n_degenerate,
        n_collapsed=found.n_collapsed,
        n_mirrored=int(found.mirrored.sum()),
        n_overlapping=int(overlaps.overlapping.sum()),
        n_unsure=int(overlaps.unsure.sum()),
        n_charts=len(chart_figures),
        seam_length=seam_length,
        fill=float(texel_areas.sum()) / (width * height),
        n_tiles=n_used_tiles(uvs[found.faces]),
        texel_density=math.sqrt(texel_areas.sum() / found.areas.sum()),
        texel_density_variation=_variation(np.sqrt(texel_areas / found.areas), found.areas),
    )


def _chart_figures(
    found: FaceStretch, charts: IntArray, n_texels: int
) -> tuple[ChartDistortion, ...]:
    ids, groups = np.unique(charts, return_inverse=True)
    areas = np.bincount(groups, found.areas)
    texel_areas = np.bincount(groups, np.abs(found.texel_areas))
    densities = np.sqrt(texel_areas / areas)
    whole = math.sqrt(texel_areas.sum() / areas.sum())
    rows = zip(
        ids.tolist(),
        np.bincount(groups).tolist(),
        np.bincount(groups, found.mirrored).astype(int).tolist(),
        areas.tolist(),
        (texel_areas / n_texels).tolist(),
        densities.tolist(),
        stretch_by_group(found, groups),
        strict=True,
    )
    return tuple(
        ChartDistortion(
            chart=chart,
            n_faces=n_faces,
            n_mirrored=n_mirrored,
            area=area,
            fill=fill,
            texel_density=density,
            stretch=stretch,
            l2_alone=stretch.l2 * density / whole,
        )
        for chart, n_faces, n_mirrored, area, fill, density, stretch in rows
    )


def _worst_faces(found: FaceStretch, charts: IntArray) -> tuple[FaceDistortion, ...]:
    l2 = found.l2
    worst = np.argsort(-l2, kind="stable")[:N_WORST]
    return tuple(
        FaceDistortion(
            face=int(found.faces[i]),
            chart=int(charts[i]),
            l2=float(l2[i]),
            linf=float(found.greatest[i]),
            mirrored=bool(found.mirrored[i]),
        )
        for i in worst
    )


def n_used_tiles(corners: FloatArray) -> int:
    """Number of unit squares that contain the centroid of a triangle (F, 3, 2)."""
    columns, rows = np.floor(corners.mean(axis=1)).T
    return len(np.unique(columns + 1j * rows))  # pairs of numbers as single ones


def _variation(values: FloatArray, weights: FloatArray) -> float:
    """Standard deviation as a share of the mean."""
    mean = float(np.average(values, weights=weights))
    return math.sqrt(np.average((values - mean) ** 2, weights=weights)) / mean
