"""Data for the 3D viewer of an asset's page: both meshes, the camera and the maps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh
from texbake.mesh.simplify import simplify
from texbake.pages.packing import packed_mesh
from texbake.pages.page import as_json
from texbake.pages.pictures import MapPicture, picture_codes
from texbake.rendering.camera import Camera
from texbake.rendering.options import RenderOptions
from texbake.rendering.panels import MAX_ANGLE_DEG, colored_angles

MOST_TRIANGLES = 300_000  # per mesh on a page: two to three MB

_LEGEND_STEPS = 24


def shown_mesh(mesh: Mesh, *, keeps_uvs: bool) -> Mesh:
    """Simplify a mesh to `MOST_TRIANGLES`, and remove the attributes that a page does not show."""
    mesh = mesh.replace(tangents=None, colors=None, face_groups=None, group_names=())
    if not keeps_uvs:
        mesh = mesh.replace(uvs=None, uv_faces=None)
    return mesh if mesh.n_faces <= MOST_TRIANGLES else simplify(mesh, MOST_TRIANGLES)


def view_data(
    high: Mesh, low: Mesh, pictures: Sequence[MapPicture], picture: RenderOptions, *, missed: bool
) -> tuple[dict[str, str], list[str]]:
    """Pack both meshes and the settings of the viewer.

    `high`, `low`: meshes in the same space.
    """
    shown_high, shown_low = shown_mesh(high, keeps_uvs=False), shown_mesh(low, keeps_uvs=True)
    frame = LocalFrame.around(high, low)
    center, radius = Camera.sphere_around(high, low)
    settings: dict[str, Any] = {
        "center": frame.to_local(center).tolist(),
        "radius": float(frame.length_to_local(radius)),
        "view": [float(angle or 0.0) for angle in picture.view[:2]],
        "up": picture.up,
        "fov": RenderOptions.fov,
        "normals": next((p.name for p in pictures if p.name == "normal"), None),
        "missed": missed,
        "labels": {
            "high": f"High-poly, {high.n_faces:,} faces",
            "low": f"Low-poly, {low.n_faces:,} faces",
            "baked": f"Baked, {low.n_faces:,} faces",
            "error": "Error: angle between high-poly and baked",
        },
        "colors": angle_colors(),
        "greatest": MAX_ANGLE_DEG,
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


def angle_colors() -> list[str]:
    """Return the CSS colors of angles from 0 to `MAX_ANGLE_DEG` in even steps."""
    angles = np.linspace(0.0, MAX_ANGLE_DEG, _LEGEND_STEPS, dtype=np.float32)
    codes = picture_codes(colored_angles(angles[None, :]))[0]
    return [f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in codes.tolist()]
