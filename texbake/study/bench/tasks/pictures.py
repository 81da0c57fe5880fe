"""Pictures of the high-poly mesh: a white diffuse surface under one lamp, without shadows."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray
from texbake.mesh.normals import shading_normals
from texbake.raycast.rays import NO_HIT, Rays
from texbake.raycast.scene import RayScene
from texbake.rendering.camera import Camera
from texbake.rendering.options import RenderOptions
from texbake.rendering.resolve import picture_error
from texbake.study.bench.cases import BenchCase, mesh_file
from texbake.study.bench.options import BenchOptions
from texbake.study.bench.programs import Product
from texbake.study.bench.task import BenchTask, Prepared
from texbake.study.knob import Judgment
from texbake.study.truth.pictures import sight_rays
from texbake.texture.image import read_image

_LIGHT = (-0.4, 0.5, -0.77)  # the direction in which it shines, as seen from the camera
_PER_SIDE = 4  # rays of the truth along each side of a pixel
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
    size = options.picture_size
    camera = Camera.framing(case.high, options=RenderOptions(width=size, height=size))
    light = pm.matmul(np.array(_LIGHT), camera.axes)
    truth = lambert_picture(case, camera, size, -light / pm.norm(light))
    mesh = mesh_file(case.high, folder, f"{case.name} high")
    scene = folder / f"{case.name}.toml"
    numbers = {
        "eye": camera.eye.tolist(),
        "target": (camera.eye - camera.axes[2]).tolist(),
        "up": camera.axes[1].tolist(),
        "fov": math.degrees(camera.fov),
        "light": light.tolist(),
    }
    scene.write_text(_SCENE.format(size=size, mesh=Path(mesh).name, **numbers), encoding="utf-8")

    def judge(product: Product) -> Judgment:
        picture = read_image(product.path, color=False).pixels[..., :3]
        return Judgment(picture_error(np.maximum(picture, 0.0), truth), picture=picture)

    exact = "the closed form" if case.surface is not None else "the mesh's own normals"
    return Prepared(
        subject=f"{case.high.name}, {case.high.n_faces:,} triangles, {size} x {size} pixels",
        truth="closed form" if case.surface is not None else "rays",
        truth_text=f"{_PER_SIDE**2} rays per pixel, shaded with the normals of {exact}.",
        job={
            "mesh": mesh,
            "scene": str(scene),
            "size": size,
            "axes": camera.axes.tolist(),
            **{key: numbers[key] for key in ("eye", "fov", "light")},
        },
        judge=judge,
    )


def lambert_picture(
    case: BenchCase, camera: Camera, size: int, to_light: FloatArray
) -> npt.NDArray[np.float32]:
    """(size, size, 3) float32: the cosine of the angle to the light, averaged over each pixel."""
    rays = sight_rays(camera, size * _PER_SIDE, size * _PER_SIDE).reshape(-1, 3)
    rays /= pm.norm(rays, axis=1, keepdims=True)
    frame = LocalFrame.around(case.high)
    origins = np.broadcast_to(frame.to_local(camera.eye[None]), rays.shape)
    reach = pm.norm(origins[0]) + 2.0  # behind the mesh, which is about one unit wide
    with RayScene.build(case.high, frame) as scene:
        hits = scene.cast(
            Rays(
                np.ascontiguousarray(origins), rays, np.full(len(rays), reach), np.zeros(len(rays))
            )
        )
    seen = np.flatnonzero(hits.faces != NO_HIT)
    weights = hits.barycentrics[seen]
    weights = np.column_stack([1.0 - weights.sum(axis=1), weights])
    if case.surface is not None:
        corners = case.high.positions[case.high.faces[hits.faces[seen]]]
        normals = case.surface.normals(pm.vecmat(weights, corners))
    else:
        values, rows = shading_normals(case.high)
        normals = pm.vecmat(weights, values[rows[hits.faces[seen]]])
        normals /= np.maximum(pm.norm(normals, axis=1, keepdims=True), 1e-30)
    light = np.zeros(len(rays))
    light[seen] = np.maximum(pm.matmul(normals, to_light), 0.0)
    picture = light.reshape(size, _PER_SIDE, size, _PER_SIDE).mean(axis=(1, 3))
    return np.repeat(picture[..., None], 3, axis=2).astype(np.float32)


PREVIEW_TASK = BenchTask(
    name="preview",
    title="Preview",
    about="A picture of the high-poly mesh as EXR, white and diffuse under one lamp infinitely far "
    "away, without shadows and bounces. Blender draws with Cycles.",
    error="picture, root mean square",
    unit="of 255",
    prepare=_prepare_preview,
)
