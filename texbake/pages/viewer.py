"""Data for the 3D viewer of an asset's page: both meshes, the camera and the maps.

Meshes are packed as compact text, for the script of the page to unpack. All values are integers:
points on a grid over the bounding box, directions on an octahedron, texture coordinates in steps of
2^-20. Each column is stored as differences from row to row, with their bytes grouped by
significance, and deflated: 7 to 9 bytes per triangle. `unpack` in `assets/page.js` is the inverse.

Based on: Cigolle et al., "A survey of efficient representations for independent unit vectors", JCGT
3(2), 2014, for the octahedron.
"""

from __future__ import annotations

import base64
import json
import struct
import zlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.mapping.seams import border_edges
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import IntArray, Mesh
from texbake.mesh.normals import shading_normals
from texbake.mesh.simplify import simplify
from texbake.mesh.tangents import corner_tangents
from texbake.mesh.weld import weld_rows
from texbake.pages.page import as_json
from texbake.pages.pictures import MapPicture, picture_codes
from texbake.rendering.camera import Camera
from texbake.rendering.options import RenderOptions
from texbake.rendering.panels import MAX_ANGLE_DEG, color_angles

MOST_TRIANGLES = 300_000  # per mesh on a page: two to three MB
_LEGEND_STEPS = 24
# How the values of map files are coded, by the name of the map.
CODINGS = {"normal": "normal", "displacement": "height", "albedo": "color"}


def shown_mesh(mesh: Mesh, *, keeps_uvs: bool) -> Mesh:
    """Simplify a mesh to `MOST_TRIANGLES`, and remove the attributes that a page does not show."""
    mesh = mesh.replace(tangents=None, colors=None, face_groups=None, group_names=())
    if not keeps_uvs:
        mesh = mesh.replace(uvs=None, uv_faces=None)
    return mesh if mesh.n_faces <= MOST_TRIANGLES else simplify(mesh, MOST_TRIANGLES)


def view_data(
    high: Mesh, low: Mesh, pictures: Sequence[MapPicture], picture: RenderOptions
) -> tuple[dict[str, str], list[str]]:
    """Pack both meshes, in the same space, and the settings of the viewer."""
    shown_high, shown_low = shown_mesh(high, keeps_uvs=False), shown_mesh(low, keeps_uvs=True)
    frame = LocalFrame.around(high, low)
    settings = view_settings((high, low), pictures, picture)
    settings["labels"] = {
        "high": f"High-poly, {high.n_faces:,} faces",
        "low": f"Low-poly, {low.n_faces:,} faces",
        "baked": f"Baked, {low.n_faces:,} faces",
        "error": "Error: angle between high-poly and baked",
    }
    data = {
        "mesh-high": packed_mesh(shown_high, frame),
        "mesh-low": packed_mesh(shown_low, frame),
        "view-settings": as_json(settings),
    }
    notes = [
        f"The {name} mesh is shown with {shown.n_faces:,} of its {mesh.n_faces:,} triangles."
        for name, mesh, shown in (("high-poly", high, shown_high), ("low-poly", low, shown_low))
        if shown.n_faces < mesh.n_faces
    ]
    return data, notes


def view_settings(
    meshes: Sequence[Mesh], pictures: Sequence[MapPicture], picture: RenderOptions
) -> dict[str, Any]:
    """Return the settings of the viewer for meshes in one space, but for their labels."""
    frame = LocalFrame.around(*meshes)
    center, radius = Camera.sphere_around(*meshes)
    return {
        "center": frame.to_local(center).tolist(),
        "radius": float(frame.length_to_local(radius)),
        "view": [float(angle or 0.0) for angle in picture.view[:2]],
        "up": picture.up,
        "fov": RenderOptions.fov,
        "normals": next((p.name for p in pictures if p.name == "normal"), None),
        "colors": angle_colors(),
        "greatest": MAX_ANGLE_DEG,
    }


def angle_colors() -> list[str]:
    """Return the CSS colors of angles from 0 to `MAX_ANGLE_DEG` in even steps."""
    angles = np.linspace(0.0, MAX_ANGLE_DEG, _LEGEND_STEPS, dtype=np.float32)
    codes = picture_codes(color_angles(angles[None, :]))[0]
    return [f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in codes.tolist()]


POSITION_STEPS = 65_535  # along the longest side of the box: far finer than a pixel
# Half the number of steps along an axis of the octahedron: accurate to 0.06 degrees.
DIRECTION_STEPS = 2_047
UV_STEPS = 1 << 20  # 1/256 of a texel of a 4096² map


def pack(arrays: Mapping[str, IntArray], more: Mapping[str, object]) -> str:
    """Return integer arrays as base64 text."""
    head = {"arrays": {name: values.shape for name, values in arrays.items()}, **more}
    words = json.dumps(head, separators=(",", ":")).encode()
    planes = [_planes(values) for values in arrays.values()]
    packed = zlib.compress(b"".join([struct.pack("<I", len(words)), words, *planes]), 9)
    return base64.b64encode(packed).decode("ascii")


def packed_mesh(mesh: Mesh, frame: LocalFrame) -> str:
    """Pack the index, positions, normals, and if there are uvs, these, tangents and borders."""
    normals, normal_faces = shading_normals(mesh)
    corners = [mesh.faces.ravel(), normal_faces.ravel()]
    tangents = None
    if mesh.uv_faces is not None:
        tangents = corner_tangents(mesh).reshape(-1, 4)
        corners += [mesh.uv_faces.ravel(), weld_rows(tangents)]
    index, chosen = _numbered(np.column_stack(corners).astype(np.int32))
    points = frame.to_local(mesh.positions[mesh.faces.ravel()[chosen]])
    low, side = points.min(axis=0), float(np.ptp(points, axis=0).max()) or 1.0
    arrays = {
        "index": index[:, None],
        "position": np.rint((points - low) / side * POSITION_STEPS).astype(np.int32),
        "normal": octahedral(normals[normal_faces.ravel()[chosen]]),
    }
    if tangents is not None:
        uvs = mesh.corner_uvs().reshape(-1, 2)[chosen]
        signs = tangents[chosen, 3:].astype(np.int32)
        arrays["uv"] = np.rint(np.clip(uvs, -1000.0, 1000.0) * UV_STEPS).astype(np.int32)
        arrays["tangent"] = np.hstack([octahedral(tangents[chosen, :3]), signs])
        arrays["borders"] = (border_edges(mesh) * np.array([1, 2, 4], np.int32)).sum(
            axis=1, keepdims=True, dtype=np.int32
        )
    steps = {
        "low": low.tolist(),
        "step": side / POSITION_STEPS,
        "directionSteps": DIRECTION_STEPS,
        "uvSteps": UV_STEPS,
    }
    return pack(arrays, steps)


def octahedral(directions: npt.NDArray[np.floating]) -> IntArray:
    """(N, 2): map unit vectors (N, 3) to an octahedron that is unfolded to a square."""
    vectors = np.asarray(directions, np.float64)
    sums = np.abs(vectors).sum(axis=1, keepdims=True)
    vectors = np.divide(
        vectors, sums, out=np.tile([0.0, 0.0, 1.0], (len(vectors), 1)), where=sums > 0
    )
    folded = vectors[:, :2]
    below = vectors[:, 2] < 0.0
    turned = (1.0 - np.abs(folded[:, ::-1])) * np.where(folded < 0.0, -1.0, 1.0)
    folded = np.where(below[:, None], turned, folded)
    return np.asarray(np.rint(folded * DIRECTION_STEPS), np.int32)


def _numbered(rows: IntArray) -> tuple[IntArray, npt.NDArray[np.intp]]:
    """Number distinct rows in order of first use; also return the first row of each number."""
    firsts = weld_rows(rows)
    is_first = firsts == np.arange(len(firsts))
    return (np.cumsum(is_first) - 1)[firsts].astype(np.int32), np.flatnonzero(is_first)


def _planes(values: IntArray) -> bytes:
    """Return the bytes of zigzag-coded differences down the columns, grouped by significance."""
    steps = np.diff(values, axis=0, prepend=np.zeros((1, values.shape[1]), np.int32))
    codes = ((steps << 1) ^ (steps >> 31)).astype("<u4")
    return (
        codes.T.reshape(-1, 1)
        .copy()
        .view(np.uint8)
        .reshape(values.shape[1], -1, 4)
        .transpose(0, 2, 1)
        .tobytes()
    )
