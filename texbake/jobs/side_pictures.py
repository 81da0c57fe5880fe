"""Pictures of meshes from four sides, with a checker or with findings; and layouts as files.

On the checker a person sees at once what figures of stretch mean: where the cells have equal size
and shape the texture looks as it was painted, and where their names read backwards it is mirrored.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from texbake.checks.check import CheckReport
from texbake.checks.checked_mesh import N_WORST, Finding
from texbake.checks.picture import COLORS, ring
from texbake.core import portable_math as pm
from texbake.errors import OptionError
from texbake.files import PathLike, replacing
from texbake.jobs.outputs import check_layout
from texbake.mapping.corner_uvs import measurable_uvs, signed_areas
from texbake.mapping.layout import draw_layout
from texbake.mapping.layout_svg import layout_svg
from texbake.mesh.frame import LocalFrame
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import Float32Array, FloatArray, Mesh
from texbake.mesh.normals import face_normals
from texbake.progress import Progress, Stages
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.panels import Panel, side_by_side
from texbake.rendering.studio import studio_scene
from texbake.texture.checker import checker_image
from texbake.texture.encoding import decode_srgb
from texbake.texture.image import write_image

N_CELLS = 16
_TEXELS = 1024
_LEAST_CELL = 4  # texels; smaller cells cannot be distinguished
# With enough samples that distant cells do not form moiré patterns.
CHECKER_PICTURE = RenderOptions(
    width=640, height=640, supersampling=3, view=(25.0, 20.0), exposure="auto"
)
_SIDES = ("front", "right", "back", "left")


def render_checker(
    mesh: MeshLike,
    options: RenderOptions | None = None,
    *,
    n_cells: int = N_CELLS,
    threads: int | None = None,
) -> Float32Array:
    """(H, W, 3) linear picture from four sides with a numbered checker, cropped."""
    mesh = as_mesh(mesh)
    options = options or CHECKER_PICTURE
    checker = checker_image(_texels_for(mesh, n_cells), n_cells)
    scene = studio_scene(mesh, albedo=checker, options=options)
    prepared = prepare(scene, options, threads=threads)
    panels = []
    seen = np.zeros((options.height, options.width), dtype=bool)
    for side, (azimuth, camera) in zip(_SIDES, _cameras(mesh, options), strict=True):
        frame = draw(prepared, camera)
        seen |= frame.coverage > 0.0
        panels.append(Panel(frame.color, side, azimuth))
    return side_by_side(panels, seen)


def _cameras(mesh: Mesh, options: RenderOptions) -> list[tuple[str, Camera]]:
    """Cameras at the view of the options and after each quarter of a turn, with their azimuths."""
    azimuth, *others = options.view
    return [
        (
            f"azimuth {(azimuth + turn) % 360.0:g}°",
            Camera.framing(mesh, options=replace(options, view=(azimuth + turn, *others))),
        )
        for turn in (0.0, 90.0, 180.0, 270.0)
    ]


def _texels_for(mesh: Mesh, n_cells: int) -> int:
    """Side of the checker in texels: smaller if it repeats, so that no texel is skipped."""
    repeats = math.sqrt(max(float(np.abs(signed_areas(measurable_uvs(mesh))).sum()), 1.0))
    halvings = math.ceil(pm.log2(repeats)) if repeats < _TEXELS else _TEXELS
    return max(_TEXELS >> min(halvings, 30), _LEAST_CELL * n_cells)


def write_layout(
    mesh: MeshLike,
    path: PathLike,
    size: int | tuple[int, int] = 1024,
    *,
    heat: bool = False,
    threads: int | None = None,
) -> None:
    """Draw the uvs of a mesh into a PNG or SVG file, of `size` px per tile."""
    mesh = as_mesh(mesh)
    check_layout(path)
    if Path(path).suffix.lower() == ".png":
        picture = draw_layout(mesh, size, heat=heat, threads=threads)
        write_image(picture, path, color=True, threads=threads)
        return
    document = layout_svg(mesh, size, heat=heat)
    with replacing(path) as temporary:
        temporary.write_text(document, encoding="utf-8")


# Some findings are about faces that are flipped, so back faces are drawn.
FINDINGS_PICTURE = RenderOptions(
    width=420,
    height=420,
    supersampling=2,
    view=(25.0, 20.0),
    back_faces="show",
    filter="nearest",
    exposure="auto",
)
_SURFACE = (0.72, 0.73, 0.75)  # sRGB, of all other faces
_RING = (1.0, 1.0, 1.0)


def write_findings(report: CheckReport, path: PathLike, *, progress: Progress = None) -> None:
    """Write the picture of `render_findings` to a file."""
    threads = report.options.threads
    picture = render_findings(report, threads=threads, progress=progress)
    write_image(picture, path, color=True, threads=threads)


def render_findings(
    report: CheckReport, *, threads: int | None = None, progress: Progress = None
) -> Float32Array:
    """(H, W, 3) picture from four sides with the faces of each finding in color."""
    shown = [finding for finding in report.findings if len(finding.faces)]
    if not shown:
        raise OptionError("check: no finding is at any face; there is nothing to draw")
    rows = []
    with Stages(progress).stage("draw findings", total=len(shown), unit="findings") as advance:
        for finding in shown:
            mesh = report.low if finding.mesh == "low" else report.high
            assert mesh is not None
            rows.append(_row(mesh, finding, FINDINGS_PICTURE, threads))
            advance(1)
    width = max(row.shape[1] for row in rows)
    # Shorter rows are continued in their background.
    padded = [np.pad(row, ((0, 0), (0, width - row.shape[1]), (0, 0)), "edge") for row in rows]
    return np.concatenate(padded)


def _row(mesh: Mesh, finding: Finding, options: RenderOptions, threads: int | None) -> Float32Array:
    """Four sides of one mesh with the faces of one finding."""
    colored = _colored(mesh, finding)
    albedo = decode_srgb(np.array([[_SURFACE, COLORS[finding.severity]]])).astype(np.float32)
    scene = studio_scene(colored, albedo=albedo, options=options)
    prepared = prepare(scene, options, threads=threads)
    normals = face_normals(colored, threads=threads)[finding.faces[:N_WORST]]
    middles = colored.positions[colored.faces[finding.faces[:N_WORST]]].mean(axis=1)
    cameras = _cameras(colored, options)
    # Each of the worst is ringed where it is seen most directly.
    facing = np.stack([_facing(camera, middles, normals) for _, camera in cameras])
    best = facing.argmax(axis=0)
    panels = []
    seen = np.zeros((options.height, options.width), dtype=bool)
    for i, (azimuth, camera) in enumerate(cameras):
        frame = draw(prepared, camera)
        seen |= frame.coverage > 0.0
        color = np.ascontiguousarray(frame.color[:, :, :3])
        for x, y in _pixels(camera, middles[best == i], options):
            ring(color, x, y, np.array(decode_srgb(_RING)))
        notes = (f"{finding.severity}, {finding.mesh}-poly mesh", finding.counted, "", "")
        caption = finding.kind.title if i == 0 else azimuth
        panels.append(Panel(color, caption, notes[i]))
    return side_by_side(panels, seen)


def _colored(mesh: Mesh, finding: Finding) -> Mesh:
    """Return a mesh whose texture coordinates pick one of two colors for each face."""
    flagged = np.zeros(mesh.n_faces, dtype=np.int32)
    flagged[finding.faces] = 1
    frame = LocalFrame.around(mesh)  # so that no size is too large to be drawn
    return Mesh(
        positions=frame.to_local(mesh.positions),
        faces=mesh.faces,
        uvs=np.array([[0.25, 0.5], [0.75, 0.5]]),
        uv_faces=np.repeat(flagged[:, None], 3, axis=1),
        name=mesh.name,
    )


def _facing(camera: Camera, points: FloatArray, normals: FloatArray) -> FloatArray:
    """Cosine between each face's normal and the direction to the camera."""
    to_eye = camera.eye - points
    return np.asarray(pm.vecdot(to_eye, normals) / pm.norm(to_eye, axis=1))


def _pixels(
    camera: Camera, points: FloatArray, options: RenderOptions
) -> list[tuple[float, float]]:
    """Where points lie in the picture, from its upper left corner."""
    matrix = camera.clip_from_world(options.width / options.height)
    clip = pm.matmul(np.column_stack([points, np.ones(len(points))]), matrix.T)
    x, y = (clip[:, :2] / clip[:, 3:]).T
    return list(
        zip(
            ((x + 1.0) / 2.0 * options.width).tolist(),
            ((1.0 - y) / 2.0 * options.height).tolist(),
            strict=True,
        )
    )
