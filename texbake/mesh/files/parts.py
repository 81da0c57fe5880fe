"""Meshes of one file as one mesh, with whatever any of them has."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.mesh.join import offset_joined
from texbake.mesh.mesh import Mesh


def joined_parts(parts: Sequence[Mesh], name: str) -> Mesh:
    """Put the meshes of a file into one.

    Where only some have texture coordinates or normals, the others get zeros, and white where only
    some have colors; tangents are kept where all have them. Each keeps its groups.

    Parameters
    ----------
    parts : sequence of Mesh
        At least one, each with groups.
    name
        Of the whole.
    """
    if len(parts) == 1:
        return parts[0].replace(name=name)
    fields: dict[str, Any] = {
        "positions": np.concatenate([part.positions for part in parts]),
        "faces": offset_joined([(part.faces, part.n_vertices) for part in parts]),
    }
    for values, corners, width in (("uvs", "uv_faces", 2), ("normals", "normal_faces", 3)):
        arrays = [getattr(part, values) for part in parts]
        if all(array is None for array in arrays):
            continue
        zero = np.zeros((1, width))
        fields[values] = np.concatenate([zero if array is None else array for array in arrays])
        fields[corners] = offset_joined(
            [
                (0 * part.faces, 1) if array is None else (getattr(part, corners), len(array))
                for part, array in zip(parts, arrays, strict=True)
            ]
        )
    if all(part.tangents is not None for part in parts):
        fields["tangents"] = np.concatenate([part.tangents for part in parts])
    if any(part.colors is not None for part in parts):
        fields["colors"] = np.concatenate(
            [
                np.ones((part.n_vertices, 4), np.float32)
                if part.colors is None
                else with_alpha(part.colors)
                for part in parts
            ]
        )
    groups = [(part.face_groups, len(part.group_names)) for part in parts]
    return Mesh(
        face_groups=offset_joined(groups),  # type: ignore[arg-type]
        group_names=tuple(group for part in parts for group in part.group_names),
        name=name,
        **fields,
    )


def with_alpha(colors: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(V, 4) colors of (V, 3) or (V, 4), opaque where they say nothing of it."""
    rgba = np.ones((len(colors), 4), np.float32)
    rgba[:, : colors.shape[1]] = colors
    return rgba
