"""How much each face is stretched between the surface and the texture, and means over many faces.

Surface and texture are compared after scaling both to a total area of 1, so that neither the size
of the model nor the fill of the texture changes a figure. Lengths in the texture are measured in
texels, so that a texture of 2048 x 1024 is measured as it is used.

Based on: Sander, Snyder, Gortler, Hoppe, "Texture Mapping Progressive Meshes", 2001 (L2 and L∞
stretch); Hormann, Lévy, Sheffer, "Mesh Parameterization: Theory and Practice", SIGGRAPH course
notes, 2007 (quasi-conformal error); Smith, Schaefer, "Bijective Parameterization with Free
Boundaries", 2015 (symmetric Dirichlet energy; without the factor 1/2 that some give it); Shay et
al., arXiv 2208.01772, 2022 (angle and area distortion).
"""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import UvError
from texbake.mapping.corner_uvs import measurable_uvs, signed_areas, surface_areas
from texbake.mesh.mesh import BoolArray, FloatArray, Int64Array, Mesh
from texbake.mesh.normals import AREA_ROUNDING
from texbake.records import dataclass


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """Stretch of a mesh or of one chart, weighted by area in space; mirrored faces are infinite.

    With σ1 ≥ σ2 the singular values of the map from surface to texture, Γ = 1/σ2 and γ = 1/σ1.
    """

    l2: float  # √ of the mean of (Γ² + γ²) / 2; 1 at best, for the mesh as a whole
    linf: float  # largest Γ
    symmetric_dirichlet: float  # mean of σ1² + σ2² + Γ² + γ²; 4 at best
    quasi_conformal: float  # mean of σ1/σ2; 1 at best
    angle: float  # mean of σ1/σ2 + σ2/σ1 - 2; 0 at best
    area: float  # mean of a/A + A/a - 2, for area a in the texture and A on the surface; 0 at best

    def to_json(self) -> dict[str, Any]:
        """Return the figures by name; an infinite value becomes None."""
        return {k: v if math.isfinite(v) else None for k, v in asdict(self).items()}


@dataclass(frozen=True, kw_only=True, eq=False)
class FaceStretch:
    """Stretch of each face that has area both in space and in the texture."""

    faces: Int64Array  # (M,) int64; indices of those faces, ascending
    areas: FloatArray  # (M,) float64; areas in space, in squares of model units
    texel_areas: FloatArray  # (M,) float64; areas in texels, negative for mirrored faces
    # greatest, least: (M,) float64; Γ and γ, the singular values of the map from texture to
    # surface, for total areas of 1.
    greatest: FloatArray
    least: FloatArray
    n_degenerate: int  # faces without area in space
    n_collapsed: int  # faces with area in space but none in the texture

    @property
    def mirrored(self) -> BoolArray:
        """(M,) bool: faces that are clockwise in the texture."""
        return self.texel_areas < 0.0

    @property
    def l2(self) -> FloatArray:
        """(M,) float64: √((Γ² + γ²) / 2) of each face, ignoring mirroring."""
        return np.sqrt((self.greatest**2 + self.least**2) / 2.0)


def face_stretch(mesh: Mesh, size: int | tuple[int, int] = 1024) -> FaceStretch:
    """Measure the stretch of each face; `size`: texels along each side, or (width, height)."""
    corners = mesh.positions[mesh.faces]
    texels = measurable_uvs(mesh) * np.array([size, size] if isinstance(size, int) else size, float)
    areas, texel_areas = surface_areas(corners), signed_areas(texels)
    solid = areas > AREA_ROUNDING * longest_squares(corners)
    flat = np.abs(texel_areas) > AREA_ROUNDING * longest_squares(texels)
    faces = np.flatnonzero(solid & flat)
    if len(faces) == 0:
        why = "look for the cause with: texbake info"
        if solid.any():
            why = "map it along another axis or by another method of: texbake unwrap"
        both = " both in space and in the texture" if solid.any() else ""
        raise UvError(f"{mesh.name}: none of its faces has an area{both}; {why}")
    areas, texel_areas = areas[faces], texel_areas[faces]
    greatest, least = _singular_values(corners[faces], texels[faces], areas, texel_areas)
    unit = math.sqrt(np.abs(texel_areas).sum() / areas.sum())
    return FaceStretch(
        faces=faces,
        areas=areas,
        texel_areas=texel_areas,
        greatest=greatest * unit,
        least=least * unit,
        n_degenerate=int((~solid).sum()),
        n_collapsed=int((solid & ~flat).sum()),
    )


def stretch_by_group(
    found: FaceStretch, groups: npt.NDArray[np.integer[Any]], *, turned: bool = False
) -> list[Stretch]:
    """Average stretch by groups (M,); `turned` measures mirrored faces as if flipped."""
    n_groups = int(groups.max()) + 1
    ratios, growths = found.greatest / found.least, found.greatest * found.least
    doubled_l2 = found.greatest**2 + found.least**2
    totals = np.bincount(groups, found.areas, n_groups)

    def means(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(groups, values * found.areas, n_groups) / totals)

    # A mirrored face has no finite stretch: no continuous map without a collapse leads to it.
    flips = np.bincount(groups, found.mirrored, n_groups) > 0
    worst = np.where(flips & (not turned), math.inf, 1.0)
    largest = np.zeros(n_groups)
    np.maximum.at(largest, groups, found.greatest)
    columns = (
        worst * np.sqrt(means(doubled_l2) / 2.0),
        worst * largest,
        worst * means(doubled_l2 + 1.0 / np.square(found.greatest) + 1.0 / np.square(found.least)),
        means(ratios),
        means(ratios + 1.0 / ratios - 2.0),
        means(growths + 1.0 / growths - 2.0),
    )
    return [
        Stretch(
            l2=l2, linf=linf, symmetric_dirichlet=energy, quasi_conformal=qc, angle=angle, area=area
        )
        for l2, linf, energy, qc, angle, area in zip(*(c.tolist() for c in columns), strict=True)
    ]


def longest_squares(corners: FloatArray) -> FloatArray:
    """(F,) float64: squared length of the longest edge of each triangle, in 2 or 3 dimensions."""
    squares = np.zeros(len(corners))
    for corner in range(3):
        edges = corners[:, corner] - corners[:, corner - 1]
        np.maximum(squares, sum(side * side for side in edges.T), out=squares)
    return squares


def _singular_values(
    corners: FloatArray, texels: FloatArray, areas: FloatArray, texel_areas: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(F,) float64 each: Γ and γ of the map from texture to surface, for faces with area."""
    q1, q2, q3 = (corners[:, i] for i in range(3))
    s1, s2, s3 = (texels[:, i, :1] for i in range(3))
    t1, t2, t3 = (texels[:, i, 1:] for i in range(3))
    d = 2.0 * texel_areas[:, None]
    # Relative to the first corner, so that no digits are lost far from the origin.
    along_s = ((q2 - q1) * (t3 - t1) - (q3 - q1) * (t2 - t1)) / d
    along_t = ((q3 - q1) * (s2 - s1) - (q2 - q1) * (s3 - s1)) / d
    a, b, c = (
        (x * y).sum(axis=1) for x, y in ((along_s, along_s), (along_s, along_t), (along_t, along_t))
    )
    greater = (a + c + np.sqrt((a - c) ** 2 + 4.0 * b**2)) / 2.0
    # From Γ γ = A / a; the difference of a + c and the root would cancel.
    lesser = (areas / texel_areas) ** 2 / greater
    return np.sqrt(greater), np.sqrt(np.minimum(lesser, greater))
