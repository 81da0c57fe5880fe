"""Further sets of texture coordinates, each with a layout and seams of its own.

The first set is `Mesh.uvs`: what is baked, packed and measured. A further set has a name, such as
`lightmap`, and indices of its own, so that its charts may be cut where those of the first are not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from texbake.errors import MeshError, quoted

if TYPE_CHECKING:
    from texbake.mesh.join import MeshPart
    from texbake.mesh.mesh import Mesh

MOST_UV_SETS = 64
"""Further sets of a mesh: each takes as much memory as its faces, and a file can name one array as
any number of sets."""


@dataclass(frozen=True, eq=False)
class UvSet:
    """A set of texture coordinates."""

    uvs: npt.NDArray[np.float64]  # (T, 2) float64; v up, (0, 0) at the lower left
    faces: npt.NDArray[np.int32]  # (F, 3) int32; indices into `uvs`


def require_few_sets(n_sets: int, mesh: str) -> None:
    """Raise `MeshError` for more further sets than a mesh can have."""
    if n_sets > MOST_UV_SETS:
        raise MeshError(
            f"{mesh}: it has {n_sets:,} sets of texture coordinates besides the first, and at most "
            f"{MOST_UV_SETS} are read; remove those that nothing uses"
        )


def checked_uv_sets(sets: Mapping[str, UvSet], n_faces: int, mesh: str) -> Mapping[str, UvSet]:
    """Return sets with read-only arrays of their types."""
    require_few_sets(len(sets), mesh)
    checked = {}
    for name, item in sets.items():
        if not isinstance(name, str) or not name.strip() or not name.isprintable():
            raise MeshError(f"{mesh}: {quoted(name)} is not a name of texture coordinates")
        try:
            uvs = np.ascontiguousarray(item.uvs, np.float64)
            faces = np.asarray(item.faces)
            if np.ma.is_masked(item.faces) or faces.dtype.kind not in "iu":
                raise TypeError(faces.dtype)
        except (TypeError, ValueError) as error:
            raise MeshError(
                f"{mesh}: the UV set {quoted(name)} is not two arrays of numbers"
            ) from error
        if uvs.ndim != 2 or uvs.shape[1] != 2 or faces.shape != (n_faces, 3):
            raise MeshError(
                f"{mesh}: the UV set {quoted(name)} has the shapes {uvs.shape} and {faces.shape}, "
                f"not (n, 2) and ({n_faces}, 3)"
            )
        if not np.isfinite(uvs).all():
            raise MeshError(
                f"{mesh}: a texture coordinate of the UV set {quoted(name)} is not finite"
            )
        if faces.min() < 0 or faces.max() >= len(uvs):
            raise MeshError(f"{mesh}: the UV set {quoted(name)} has an index that is out of range")
        uvs, faces = uvs.view(), np.ascontiguousarray(faces, np.int32).view()
        for array in uvs, faces:
            array.flags.writeable = False
        checked[name] = UvSet(uvs, faces)
    return checked


def sets_by_corner(
    mesh: Mesh, change: slice | npt.NDArray[np.bool_], *, columns: bool = False
) -> dict[str, UvSet]:
    """Return the sets of some faces of a mesh, or, by `columns`, with corners in another order."""
    return {
        name: UvSet(item.uvs, item.faces[:, change] if columns else item.faces[change])
        for name, item in mesh.uv_sets.items()
    }


def joined_uv_sets(parts: Sequence[Mesh | MeshPart]) -> dict[str, UvSet]:
    """Return the sets of meshes put into one; (0, 0) where only others have a set."""
    names = dict.fromkeys(name for part in parts for name in part.uv_sets)
    require_few_sets(len(names), f"{len(parts)} meshes")
    joined = {}
    for name in names:
        uvs, faces, n = [], [], 0
        for part in parts:
            item = part.uv_sets.get(name) or UvSet(np.zeros((1, 2)), 0 * part.faces)
            uvs.append(item.uvs)
            faces.append(item.faces + np.int32(n))
            n += len(item.uvs)
        joined[name] = UvSet(np.concatenate(uvs), np.concatenate(faces))
    return joined
