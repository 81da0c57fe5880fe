"""Tasks of the bench that work on one mesh, and the table of all tasks.

The error of an atlas is the share of texels that it wastes, that of a mesh its distance from the
high-poly mesh. Pictures show a white diffuse surface under one lamp, without shadows.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from texbake.core import portable_math as pm
from texbake.mapping.corner_uvs import with_coordinates
from texbake.mapping.distortion import distortion
from texbake.mesh.distance import surface_distance
from texbake.mesh.files import read_mesh
from texbake.mesh.mesh import Mesh
from texbake.mesh.topology import find_edges
from texbake.rendering.camera import Camera
from texbake.rendering.options import RenderOptions
from texbake.rendering.resolve import picture_error
from texbake.study.bench.cases import BenchCase, mesh_file
from texbake.study.bench.map_tasks import (
    AO_TASK,
    DISPLACEMENT_TASK,
    NORMALS_TASK,
    BenchTask,
    Prepared,
)
from texbake.study.bench.programs import Product
from texbake.study.knob import Evaluation
from texbake.study.options import BenchOptions
from texbake.study.truth.pictures import RAYS_PER_SIDE, lambert_picture
from texbake.texture.image import read_image

_ATLAS_SIZE, _GAP = 1024, 2  # texels


def _prepare_unwrap(case: BenchCase, options: BenchOptions, folder: Path) -> Prepared:
    mesh = case.low if case.build is None else case.build(options.amounts.unwrapped_triangles)
    name = f"{case.name}-to-unwrap"

    def judge(product: Product) -> Evaluation:
        return unwrap_error(_unwrapped(product.path))

    return Prepared(
        subject=f"{case.name}, {mesh.n_faces:,} triangles, {_GAP} texels between charts at "
        f"{_ATLAS_SIZE} x {_ATLAS_SIZE}",
        truth="exact values",
        truth_text="The stretch of every triangle and the area that the charts fill follow from "
        "the texture coordinates.",
        job={
            "mesh": mesh_file(mesh, folder, name),
            "size": _ATLAS_SIZE,
            "gap": _GAP,
            "padding": _GAP // 2,
        },
        judge=judge,
    )


def unwrap_error(mesh: Mesh) -> Evaluation:
    """Return the share of the texels that an atlas wastes, in percent; see `Distortion.wasted`."""
    found = distortion(mesh, _ATLAS_SIZE)
    stretch = found.turned_stretch  # of some atlases half the charts are mirrored
    return Evaluation(
        100.0 * found.wasted,
        figures={
            "charts": float(found.n_charts),
            "filled (%)": 100.0 * found.fill,
            "L2 stretch": stretch.l2,
            "symmetric Dirichlet": stretch.symmetric_dirichlet,
            "seams (diagonals)": found.seam_length / mesh.diagonal,
            "mirrored triangles": float(found.n_mirrored),
            "overlapping triangles": float(found.n_overlapping),
            "triangles without area": float(found.n_collapsed),
        },
    )


def _unwrapped(path: Path) -> Mesh:
    if path.suffix != ".npz":
        return read_mesh(path)
    with np.load(path) as arrays:
        mesh = Mesh(
            positions=arrays["positions"].astype(np.float64),
            faces=arrays["faces"].astype(np.int32),
            name=path.stem,
        )
        return with_coordinates(mesh, arrays["corners"].astype(np.float64))


UNWRAP_TASK = BenchTask(
    name="unwrap",
    title="Unwrap",
    about="Texture coordinates for a mesh that has none, in one square without overlaps. What an "
    "atlas wastes is a single figure of its stretch and its gaps; the table has both, and the "
    "charts and seams.",
    error="texels wasted by stretch and gaps",
    unit="%",
    prepare=_prepare_unwrap,
)


def _prepare_simplify(case: BenchCase, options: BenchOptions, folder: Path) -> Prepared | None:
    if case.high.n_faces <= min(options.amounts.counts):
        return None
    return _prepare_mesh(case, options, folder)


def _prepare_mesh(case: BenchCase, options: BenchOptions, folder: Path) -> Prepared:
    def judge(product: Product) -> Evaluation:
        mesh = read_mesh(product.path)
        apart = surface_distance(case.high, mesh, n_samples=options.amounts.n_probes)
        return Evaluation(
            100.0 * apart.mean_relative,
            figures={
                "triangles": float(mesh.n_faces),
                "distance, maximum (% of diagonal)": 100.0 * apart.max_relative,
                "open edges": float(find_edges(mesh.faces).boundary.sum()),
            },
        )

    exact = ", whose vertices lie on the closed form" if case.surface is not None else ""
    return Prepared(
        subject=f"{case.high.name}, {case.high.n_faces:,} triangles",
        truth="high-poly mesh",
        truth_text=f"The high-poly mesh{exact}: distances between both surfaces, in both "
        "directions.",
        job={"mesh": mesh_file(case.high, folder, f"{case.name}-high")},
        judge=judge,
    )


SIMPLIFY_TASK = BenchTask(
    name="simplify",
    title="Simplify",
    about="The high-poly mesh reduced to a number of triangles, from file to file. Some programs "
    "stop above that number, which makes them look more accurate than they are.",
    error="distance between the surfaces, mean",
    unit="% of diagonal",
    prepare=_prepare_simplify,
)


REMESH_TASK = BenchTask(
    name="remesh",
    title="Remesh",
    about="A new mesh of the same surface from voxels, from file to file. Programs count voxels "
    "along the longest side of the mesh.",
    error="distance between the surfaces, mean",
    unit="% of diagonal",
    prepare=_prepare_mesh,
)


_LIGHT = (-0.4, 0.5, -0.77)  # the direction in which it shines, as seen from the camera
_SCENE = """\
[render]
width = {size}
height = {size}
background = [0, 0, 0]

[camera]
position = {eye}
target = {target}
up = {up}
fov = {fov}

[[lights]]
kind = "directional"
direction = {light}

[[objects]]
mesh = "{mesh}"
material = {{base_color = [1, 1, 1], shading = "lambert"}}
"""


def _prepare_preview(case: BenchCase, options: BenchOptions, folder: Path) -> Prepared:
    size = options.amounts.picture_size
    camera = Camera.framing(case.high, options=RenderOptions(width=size, height=size))
    light = pm.matmul(np.array(_LIGHT), camera.axes)
    truth = lambert_picture(case.high, case.surface, camera, size, -light / pm.norm(light))
    mesh = mesh_file(case.high, folder, f"{case.name}-high")
    scene = folder / f"{case.name}.toml"
    numbers = {
        "eye": camera.eye.tolist(),
        "target": (camera.eye - camera.axes[2]).tolist(),
        "up": camera.axes[1].tolist(),
        "fov": math.degrees(camera.fov),
        "light": light.tolist(),
    }
    scene.write_text(_SCENE.format(size=size, mesh=Path(mesh).name, **numbers), encoding="utf-8")

    def judge(product: Product) -> Evaluation:
        picture = read_image(product.path, color=False).pixels[..., :3]
        return Evaluation(picture_error(np.maximum(picture, 0.0), truth), picture=picture)

    exact = "the closed form" if case.surface is not None else "the mesh's own normals"
    return Prepared(
        subject=f"{case.high.name}, {case.high.n_faces:,} triangles, {size} x {size} pixels",
        truth="closed form" if case.surface is not None else "rays",
        truth_text=f"{RAYS_PER_SIDE**2} rays per pixel, shaded with the normals of {exact}.",
        job={
            "mesh": mesh,
            "scene": str(scene),
            "size": size,
            "axes": camera.axes.tolist(),
            **{key: numbers[key] for key in ("eye", "fov", "light")},
        },
        judge=judge,
    )


PREVIEW_TASK = BenchTask(
    name="preview",
    title="Preview",
    about="A picture of the high-poly mesh as EXR, white and diffuse under one lamp infinitely far "
    "away, without shadows and bounces. Blender draws with Cycles.",
    error="picture, root mean square",
    unit="of 255",
    prepare=_prepare_preview,
)


TASKS = {
    task.name: task
    for task in (
        NORMALS_TASK, DISPLACEMENT_TASK, AO_TASK, UNWRAP_TASK, SIMPLIFY_TASK, REMESH_TASK,
        PREVIEW_TASK,
    )
}  # fmt: skip
