"""How well texture coordinates keep the shape of a surface: stretch, angles, areas, seams.

All measures of stretch compare the surface with the texture after both are scaled to a total area
of 1, so that neither the size of the model nor how full the texture is changes them; and in square
texels, so that a texture of 2048 x 1024 is measured as it is used.

Based on: Sander, Snyder, Gortler, Hoppe, "Texture Mapping Progressive Meshes", 2001 (L2 and L∞
stretch); Smith, Schaefer, "Bijective Parameterization with Free Boundaries", 2015 (symmetric
Dirichlet energy; without the factor 1/2 that some give it); Shay et al., arXiv 2208.01772, 2022
(angle and area distortion).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import UvError
from texbake.mapping.areas import signed_areas, surface_areas
from texbake.mapping.overlap import overlapping_faces
from texbake.mapping.seams import chart_ids, seam_length
from texbake.mesh.mesh import FloatArray, Mesh

# An area below this times the square of the longest edge is rounding: subtracting, multiplying and
# subtracting again leave up to 4 units of 2^-53 an edge.
_AREA_ROUNDING = 8.0 * 2.0**-53


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """Stretch of a mesh or of one chart; means are weighted by area in space.

    With σ1 ≥ σ2 the singular values of the map from surface to texture and Γ = 1/σ2, γ = 1/σ1
    those of the map back. Mirrored faces count as infinite in the first three.

    Attributes
    ----------
    l2 : float
        √ of the mean of (Γ² + γ²) / 2; 1 at best, for the mesh as a whole.
    linf : float
        Largest Γ.
    symmetric_dirichlet : float
        Mean of σ1² + σ2² + Γ² + γ²; 4 at best.
    quasi_conformal : float
        Mean of σ1/σ2; 1 at best.
    angle : float
        Mean of σ1/σ2 + σ2/σ1 - 2; 0 at best.
    area : float
        Mean of a/A + A/a - 2 with the areas of a face in the texture and on the surface; 0 at best.
    """

    l2: float
    linf: float
    symmetric_dirichlet: float
    quasi_conformal: float
    angle: float
    area: float


@dataclass(frozen=True, kw_only=True)
class Distortion:
    """What texture coordinates do to a mesh.

    Attributes
    ----------
    stretch : Stretch
        Of the mesh as a whole.
    chart_stretch : dict of int to Stretch
        Of each chart that has a measured face, by its number in `chart_ids`, at the scale of the
        whole: a chart that is smaller than its share has more stretch.
    n_measured : int
        Faces with area both in space and in the texture, mirrored ones among them.
    n_degenerate : int
        Faces without area in space; left out.
    n_collapsed : int
        Faces with area in space but none in the texture; left out.
    n_mirrored : int
        Faces that run clockwise in the texture.
    n_overlapping : int
        Faces that cover, in the texture, what another covers.
    n_charts : int
        Charts with area.
    seam_length : float
        Model units along which the texture is cut and the surface is not.
    fill : float
        Sum of the areas in the texture; what is covered twice counts twice.
    texel_density : float
        Texels a model unit, the root of the mean texels an area.
    texel_density_variation : float
        Standard deviation of texels a model unit from face to face, as a share of the mean.
    """

    stretch: Stretch
    chart_stretch: Mapping[int, Stretch]
    n_measured: int
    n_degenerate: int
    n_collapsed: int
    n_mirrored: int
    n_overlapping: int
    n_charts: int
    seam_length: float
    fill: float
    texel_density: float
    texel_density_variation: float

    def to_json(self) -> dict[str, Any]:
        """Return the figures of the whole as plain numbers; what is infinite becomes None."""
        figures = {name: value for name, value in asdict(self).items() if name != "chart_stretch"}
        stretch = figures.pop("stretch").items()
        return {**{k: v if math.isfinite(v) else None for k, v in stretch}, **figures}


def distortion(mesh: Mesh, size: int | tuple[int, int] = 1024) -> Distortion:
    """Measure the texture coordinates of a mesh.

    Parameters
    ----------
    mesh : Mesh
        With texture coordinates.
    size : int or (int, int)
        Texels a side, or (width, height). Only the texel densities depend on more than its shape.

    Raises
    ------
    UvError
        The mesh has no texture coordinates, or no face has area in space and in the texture.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> round(distortion(plane(4, 4)).stretch.l2, 12)
    1.0
    """
    width, height = (size, size) if isinstance(size, int) else size
    corners, uvs = mesh.positions[mesh.faces], mesh.corner_uvs()
    texels = uvs * np.array([width, height], dtype=np.float64)
    areas, texel_areas = surface_areas(corners), signed_areas(texels)
    solid = areas > _AREA_ROUNDING * _longest_squares(corners)
    flat = np.abs(texel_areas) > _AREA_ROUNDING * _longest_squares(texels)
    measured = solid & flat
    if not measured.any():
        raise UvError(
            f"{mesh.name}: none of its faces has area both in space and in the texture; "
            f"make coordinates with: texbake unwrap {mesh.name} -o OUT"
        )
    charts = chart_ids(mesh)[measured]
    areas, texel_areas = areas[measured], texel_areas[measured]
    squares = _stretch_squares(corners[measured], texels[measured], areas, texel_areas)
    squares *= np.abs(texel_areas).sum() / areas.sum()
    densities = np.sqrt(np.abs(texel_areas) / areas)
    mean_density = float(np.average(densities, weights=areas))
    deviation = math.sqrt(np.average((densities - mean_density) ** 2, weights=areas))
    mirrored = texel_areas < 0.0
    return Distortion(
        stretch=_summary(squares, areas, mirrored),
        chart_stretch=_chart_summaries(charts, squares, areas, mirrored),
        n_measured=int(measured.sum()),
        n_degenerate=int((~solid).sum()),
        n_collapsed=int((solid & ~flat).sum()),
        n_mirrored=int(mirrored.sum()),
        n_overlapping=int(overlapping_faces(uvs).sum()),
        n_charts=len(np.unique(charts)),
        seam_length=seam_length(mesh, measured),
        fill=float(np.abs(texel_areas).sum()) / (width * height),
        texel_density=math.sqrt(np.abs(texel_areas).sum() / areas.sum()),
        texel_density_variation=deviation / mean_density,
    )


def _longest_squares(corners: FloatArray) -> FloatArray:
    """(F,) float64: squared length of the longest edge of each triangle, in 2 or 3 dimensions."""
    edges = corners - np.roll(corners, 1, axis=1)
    return np.asarray((edges**2).sum(axis=2).max(axis=1))


def _stretch_squares(
    corners: FloatArray, texels: FloatArray, areas: FloatArray, texel_areas: FloatArray
) -> FloatArray:
    """(F, 2) float64: Γ² and γ² of the map from texture to surface, for faces with area."""
    q1, q2, q3 = (corners[:, i] for i in range(3))
    s1, s2, s3 = (texels[:, i, :1] for i in range(3))
    t1, t2, t3 = (texels[:, i, 1:] for i in range(3))
    d = 2.0 * texel_areas[:, None]
    along_s = (q1 * (t2 - t3) + q2 * (t3 - t1) + q3 * (t1 - t2)) / d
    along_t = (q1 * (s3 - s2) + q2 * (s1 - s3) + q3 * (s2 - s1)) / d
    a, b, c = (
        (x * y).sum(axis=1) for x, y in ((along_s, along_s), (along_s, along_t), (along_t, along_t))
    )
    greater = (a + c + np.sqrt((a - c) ** 2 + 4.0 * b**2)) / 2.0
    # Γ γ = A / a; the difference of a + c and the root would cancel.
    lesser = (areas / texel_areas) ** 2 / greater
    return np.stack([greater, np.minimum(lesser, greater)], axis=1)


def _summary(squares: FloatArray, areas: FloatArray, mirrored: npt.NDArray[np.bool_]) -> Stretch:
    """Stretch of some faces from Γ² and γ² of each."""
    greater, lesser = squares[:, 0], squares[:, 1]
    ratios, growths = np.sqrt(greater / lesser), np.sqrt(greater * lesser)

    def mean(values: FloatArray) -> float:
        return float(np.average(values, weights=areas))

    # A mirrored face has no finite stretch: no path of maps that keep area leads to it.
    worst = math.inf if mirrored.any() else 1.0
    return Stretch(
        l2=worst * math.sqrt(mean(greater + lesser) / 2.0),
        linf=worst * math.sqrt(greater.max()),
        symmetric_dirichlet=worst * mean(greater + lesser + 1.0 / greater + 1.0 / lesser),
        quasi_conformal=mean(ratios),
        angle=mean(ratios + 1.0 / ratios - 2.0),
        area=mean(growths + 1.0 / growths - 2.0),
    )


def _chart_summaries(
    charts: npt.NDArray[np.int32],
    squares: FloatArray,
    areas: FloatArray,
    mirrored: npt.NDArray[np.bool_],
) -> dict[int, Stretch]:
    order = np.argsort(charts, kind="stable")
    ids, starts = np.unique(charts[order], return_index=True)
    groups = np.split(order, starts[1:])
    return {
        int(chart): _summary(squares[group], areas[group], mirrored[group])
        for chart, group in zip(ids, groups, strict=True)
    }
