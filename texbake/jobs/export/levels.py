"""Levels of detail become coarser, and share one set of texture coordinates for one set of maps."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import OptionError, UvError
from texbake.mesh.distance import sample_surface
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh
from texbake.mesh.triangle_tree import TriangleTree

_SAMPLES = 2_000  # points on a level
# A level made from the finest takes nearly all its points to the same place of the texture. Another
# atlas takes next to none within a tenth of its width.
_FAR, _MOST_FAR = 0.1, 0.5


def check_levels(levels: Sequence[Mesh], *, threads: int | None = None) -> None:
    """Check that levels of detail become coarser, and that one set of maps fits all of them."""
    _check_layouts(levels, threads)
    for fine, coarse in pairwise(levels):
        if coarse.n_faces >= fine.n_faces:
            raise OptionError(
                f"levels: {coarse.name} has {coarse.n_faces:,} triangles, no fewer than "
                f"{fine.name} before it, which has {fine.n_faces:,}; give the levels from the "
                "finest to the coarsest, each once"
            )


def _check_layouts(levels: Sequence[Mesh], threads: int | None) -> None:
    mapped = next((level for level in levels if level.uvs is not None), None)
    bare = next((level for level in levels if level.uvs is None), None)
    if mapped is None:
        return
    if bare is not None:
        raise UvError(
            f"{bare.name}: it has no texture coordinates, and {mapped.name} has; levels of detail "
            "share one set: unwrap the finest, and simplify that with seams kept"
        )
    for level in levels[1:]:
        share = share_elsewhere(level, levels[0], threads=threads)
        if share > _MOST_FAR:
            raise UvError(
                f"{level.name}: its texture coordinates are laid out differently from those of "
                f"{levels[0].name}, at {100 * share:.0f} % of its surface; levels of detail share "
                "one set: unwrap the finest, and simplify that with seams kept"
            )


def share_elsewhere(level: Mesh, finest: Mesh, *, threads: int | None = None) -> float:
    """Share of a level's surface that has another place in the texture than the finest level.

    Both have texture coordinates and lie in one space.
    """
    assert level.uvs is not None and level.uv_faces is not None
    assert finest.uvs is not None and finest.uv_faces is not None
    frame = LocalFrame.around(finest)
    tree = TriangleTree.build(frame.to_local(finest.positions), finest.faces, threads=threads)
    local = level.replace(positions=frame.to_local(level.positions))
    points, face_ids, weights = sample_surface(local, _SAMPLES, threads=threads)
    _, nearest, nearest_weights = tree.closest_points(points, threads=threads)
    here = pm.vecmat(weights, level.uvs[level.uv_faces[face_ids]])
    there = pm.vecmat(nearest_weights, finest.uvs[finest.uv_faces[nearest]])
    width = np.ptp(finest.uvs[finest.uv_faces.ravel()], axis=0).max()
    return float((pm.hypot(*(here - there).T) > _FAR * width).mean())
