"""The parts of a page that move: the view in three dimensions, and the maps."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh
from texbake.mesh.simplify import simplify
from texbake.pages.map_pictures import MapPicture, miss_picture
from texbake.pages.packing import packed_mesh
from texbake.pages.sections import angle_colors, legend, section
from texbake.pages.shell import as_json
from texbake.rendering.camera import Camera
from texbake.rendering.options import RenderOptions
from texbake.rendering.panels import MAX_ANGLE_DEG

MOST_TRIANGLES = 300_000  # of a mesh in a page: two to three MB

_SIDES = (("dense", "Dense"), ("bare", "Bare"), ("baked", "Baked"), ("error", "Error"))


def shown_mesh(mesh: Mesh, *, keeps_uvs: bool) -> Mesh:
    """Return a mesh with at most `MOST_TRIANGLES`, and without what a page does not show of it."""
    mesh = mesh.replace(tangents=None, colors=None, face_groups=None, group_names=())
    if not keeps_uvs:
        mesh = mesh.replace(uvs=None, uv_faces=None)
    return mesh if mesh.n_faces <= MOST_TRIANGLES else simplify(mesh, MOST_TRIANGLES)


class View:
    """Dense, bare and baked mesh in one view: `html` for the page, `data` for its script.

    Parameters
    ----------
    high, low
        In one frame.
    pictures
        Maps of `low`. What "baked" shows is the one with the name `normal`.
    view, up
        Where it is seen from at first; see `RenderOptions`.
    """

    def __init__(
        self,
        high: Mesh,
        low: Mesh,
        pictures: Sequence[MapPicture],
        *,
        view: Sequence[float | None] = RenderOptions.view,
        up: str = RenderOptions.up,
        missed: bool = False,
    ) -> None:
        dense, light = shown_mesh(high, keeps_uvs=False), shown_mesh(low, keeps_uvs=True)
        frame = LocalFrame.around(high, low)
        center, radius = Camera.sphere_around(high, low)
        normals = next((picture.name for picture in pictures if picture.name == "normal"), None)
        settings: dict[str, Any] = {
            "center": frame.to_local(center).tolist(),
            "radius": float(frame.length_to_local(radius)),
            "view": [float(angle or 0.0) for angle in view[:2]],
            "up": up,
            "fov": RenderOptions.fov,
            "normals": normals,
            "missed": missed,
            "labels": {
                "dense": f"Dense, {high.n_faces:,} faces",
                "bare": f"Bare, {low.n_faces:,} faces",
                "baked": f"Baked, {low.n_faces:,} faces",
                "error": "Error: angle between dense and baked",
            },
            "colors": angle_colors(),
            "greatest": MAX_ANGLE_DEG,
        }
        self.data = {
            "mesh-dense": packed_mesh(dense, frame),
            "mesh-light": packed_mesh(light, frame),
            "view-settings": as_json(settings),
        }
        notes = [
            f"{name} mesh is shown with {shown.n_faces:,} of its {mesh.n_faces:,} triangles."
            for name, mesh, shown in (("The dense", high, dense), ("The light", low, light))
            if shown.n_faces < mesh.n_faces
        ]
        self.html = section(
            "Dense, bare, baked",
            _VIEW.format(
                left=_side("left", "dense"),
                right=_side("right", "baked"),
                surfaces="".join(
                    f'<option value="{escape(p.name)}">{escape(p.name)} map</option>'
                    for p in pictures
                ),
                missed=_MISSED if missed else "",
                legend=legend(),
                notes=escape(" ".join(notes)),
            ),
            name="view",
        )


class Maps:
    """Maps with zoom to the texel: `html` for the page, `data` for its script.

    Parameters
    ----------
    pictures
        At least one.
    missed : (H, W) bool, optional
        Texels that no ray found a surface for.
    """

    def __init__(
        self, pictures: Sequence[MapPicture], missed: npt.NDArray[np.bool_] | None
    ) -> None:
        self.data = {"map-settings": as_json([picture.settings() for picture in pictures])}
        tabs = "".join(
            f'<label><input type="radio" name="map" value="{k}"{" checked" if k == 0 else ""}>'
            f"<span>{escape(picture.name)}</span></label>"
            for k, picture in enumerate(pictures)
        )
        images = "".join(_map_figure(k, picture) for k, picture in enumerate(pictures))
        has_misses = missed is not None and bool(missed.any())
        if missed is not None and has_misses:
            images += f'<img id="missed" alt="Missed texels" src="{miss_picture(missed)}" hidden>\n'
        self.html = section(
            "Maps",
            _MAPS.format(tabs=tabs, images=images, missed=_MISSED + _NEXT if has_misses else ""),
            name="maps",
        )


def _side(name: str, chosen: str) -> str:
    """Buttons of what one side of the view shows."""
    buttons = "".join(
        f'<label><input type="radio" name="{name}" value="{value}"'
        f"{' checked' if value == chosen else ''}><span>{label}</span></label>"
        for value, label in _SIDES
    )
    return f'<fieldset class="choice"><legend>{name.title()}</legend>{buttons}</fieldset>'


def _map_figure(k: int, picture: MapPicture) -> str:
    size = f"{picture.full_width:,} x {picture.full_height:,} texels"
    if picture.width < picture.full_width:
        size += f", shown at {picture.width:,} x {picture.height:,}"
    note = f" {picture.note}" if picture.note else ""
    return (
        f'<figure><img id="map-{k}" alt="{escape(picture.name)} map" src="{picture.uri}">'
        f"<figcaption>{escape(picture.name)}: {size}.{escape(note)}</figcaption></figure>\n"
    )


_MISSED = '<label class="tick"><input type="checkbox" name="missed"> Missed rays</label>'
_NEXT = '<button type="button" name="next">Next missed</button>'

_VIEW = """
<div class="stage">
<canvas tabindex="0" role="img" aria-label="Meshes in three dimensions; arrow keys turn them, plus \
and minus zoom, Home goes back"></canvas>
<div class="tag left" aria-hidden="true"></div><div class="tag right" aria-hidden="true"></div>
<div class="divider" aria-hidden="true"><i></i></div>
<p class="failure" hidden>This browser draws nothing in three dimensions here.</p>
</div>
<label class="slider"><span>Left</span><input type="range" name="wipe" min="0" max="1000" \
value="500" aria-label="Share of the left side"><span>Right</span></label>
<div class="controls">
{left}{right}
<label class="slider light"><span>Light</span><input type="range" name="light" min="-180" \
max="180" value="-50" aria-label="Direction of the light in degrees"></label>
<label class="pick">Surface <select name="surface"><option value="lit">lit</option>\
<option value="normals">normals</option>{surfaces}</select></label>
<label class="tick"><input type="checkbox" name="wire"> Triangles</label>
{missed}
<label class="pick">Up <select name="up"><option>y</option><option>z</option></select></label>
<button type="button" name="home">Reset view</button>
</div>
<p class="faint">Drag to turn, with two fingers or the right button to move; click, then the wheel \
zooms. <span class="when-error" hidden>{legend}</span> {notes}</p>
"""

_MAPS = """
<div class="tabs" role="radiogroup" aria-label="Map">{tabs}</div>
<div class="stage" hidden>
<canvas tabindex="0" role="img" aria-label="Map; arrow keys move it, plus and minus zoom, \
0 shows it whole, 1 shows a texel a pixel"></canvas>
</div>
<div class="controls" hidden>
<button type="button" name="out" aria-label="Zoom out">−</button>
<button type="button" name="in" aria-label="Zoom in">+</button>
<button type="button" name="fit">Whole</button>
<button type="button" name="one">1 : 1</button>
<label class="tick"><input type="checkbox" name="layout"> UV layout</label>
{missed}
<output class="readout"></output>
</div>
<p class="caption faint" hidden></p>
<div class="plain">{images}</div>
"""
