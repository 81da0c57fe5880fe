"""Scenes of the samples as other renderers draw them, for `bench_rendering` and tests.

Lights are those of the scene, without ambient light, environment and fog, whose meanings differ
from program to program; a lit scene without lights gets one from the upper left.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scene_gltf import UnwritableError, write_scene

from texbake.jobs.preview_scene import open_preview
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Light, Lighting
from texbake.rendering.scene.read import read_scene
from texbake.rendering.scene.scene import Scene, camera_of
from texbake.texture.encoding import encode_srgb
from texbake.texture.image import read_image

HERE = Path(__file__).parent
SCENES = HERE.parents[1] / "samples" / "scenes"
WIDTH, HEIGHT = 300, 200
LIGHT = Light(direction=(-0.5, -0.6, -0.62), color=(0.9, 0.9, 0.9))
LEFT_OUT = ("ambient_occlusion", "hemisphere", "environment_light", "material_map",
            "roughness_metalness", "fog")  # fmt: skip


@dataclass(frozen=True, eq=False)
class Case:
    """A scene, its camera, and the file that other programs read."""

    name: str
    scene: Scene
    options: RenderOptions
    camera: Camera
    file: Path
    center: np.ndarray
    radius: float

    def ours(self, supersampling):
        """(H, W, 4) float32 linear, with the coverage last."""
        options = replace(self.options, supersampling=supersampling)
        frame = draw(prepare(self.scene, options), self.camera)
        return np.concatenate([frame.color[..., :3], frame.coverage[..., None]], axis=2)

    def job(self, **more):
        camera = self.camera
        placed = np.eye(4)
        placed[:3, :3], placed[:3, 3] = camera.axes.T, camera.eye
        scale, near, far = 1.0 / np.tan(camera.fov / 2.0), camera.near, 1e4 * camera.near + 1e3
        projection = np.zeros((4, 4))
        projection[0, 0], projection[1, 1] = scale * HEIGHT / WIDTH, scale
        projection[2, 2:] = (near + far) / (near - far), 2.0 * near * far / (near - far)
        projection[3, 2] = -1.0
        return {
            "file": str(self.file), "width": WIDTH, "height": HEIGHT, "fov": camera.fov,
            "clip_from_camera": projection.ravel().tolist(),
            "world_from_camera": placed.ravel().tolist(),
            "center": self.center.tolist(), "radius": self.radius,
            "lights": [light_of(light) for light in self.scene.lighting.lights], **more,
        }  # fmt: skip


def light_of(light):
    """Return a light as the other programs' scripts take it."""
    return {
        "kind": light.kind, "color": [light.intensity * c for c in light.color],
        "to_light": [-x for x in light.direction], "position": list(light.position),
        "angle": float(np.radians(light.angle)), "blend": light.blend, "decay": light.decay,
        "shadow": light.shadow is not None,
    }  # fmt: skip


def sample_case(path, folder):
    """Return a scene of the samples under its own lights alone; raises `UnwritableError`."""
    scene, options = open_preview(path)
    if path.stem in LEFT_OUT or scene.lighting.environment is not None:
        raise UnwritableError("ambient light, environment or fog")
    lights = scene.lighting.lights or (LIGHT,)
    if any(light.profile is not None for light in lights):
        raise UnwritableError("cookie of a spot light")
    if any(light.follows_camera for light in lights):
        raise UnwritableError("light of the camera")
    scene = replace(scene, lighting=Lighting(lights=lights))
    options = replace(options, width=WIDTH, height=HEIGHT, background=None, buffer=None)
    write_scene(scene, folder / f"{path.stem}.glb")
    return case_of(path.stem, scene, options, folder / f"{path.stem}.glb")


def model_case(path):
    """Return a model, framed whole, under one light."""
    scene = replace(read_scene(path), view=None, lighting=Lighting(lights=(LIGHT,)))
    options = RenderOptions(width=WIDTH, height=HEIGHT, background=None)
    return case_of(path.stem, scene, options, path)


def case_of(name, scene, options, file):
    camera = camera_of(scene, options)
    view = scene.view
    if view is None or view.target is None:
        corners = np.concatenate([item.mesh.positions for item in scene.objects])
        center = 0.5 * (corners.min(0) + corners.max(0))
    else:
        center = np.asarray(view.target, float)
    radius = float(np.linalg.norm(camera.eye - center))
    return Case(name, scene, options, camera, file, center, radius)


def by_threejs(cases, folder, *, plain=False):
    jobs = [folder / f"three_{k}.json" for k in range(len(cases))]
    for case, job in zip(cases, jobs, strict=True):
        job.write_text(json.dumps(case.job(plain=plain)))
    program = HERE / "peer_threejs.py"
    subprocess.run([sys.executable, program, *jobs, "-o", folder], check=True)
    return [np.load(job.with_suffix(".npy")) for job in jobs]


def by_blender(cases, folder, engine):
    """Pictures of all cases; None where Blender has no such light."""
    known = [
        case
        for case in cases
        if all(x.kind == "directional" or x.decay == 2.0 for x in case.scene.lighting.lights)
    ]
    found = dict(zip(known, _by_blender(known, folder, engine), strict=True))
    return [found.get(case) for case in cases]


def _by_blender(cases, folder, engine):
    pictures = [folder / f"{engine}_{k}.exr" for k in range(len(cases))]
    jobs = [picture.with_suffix(".json") for picture in pictures]
    for case, job, picture in zip(cases, jobs, pictures, strict=True):
        job.write_text(json.dumps(case.job(engine=engine, picture=str(picture))))
    python = os.environ["TEXBAKE_BLENDER_PYTHON"]
    with (folder / "blender.log").open("w") as log:
        subprocess.run([python, HERE / "blender_asset.py", *jobs], check=True, stdout=log,
                       stderr=log)  # fmt: skip
    return [read_image(picture, color=True).pixels for picture in pictures]


def alike(ours, theirs):
    """PSNR in dB inside both outlines, and the share of pixels that only one covers, in percent."""
    whole = (ours[..., 3] > 0.99) & (theirs[..., 3] > 0.99)
    padded = np.pad(whole, 1)
    inside = np.logical_and.reduce(
        [padded[j : j + HEIGHT, i : i + WIDTH] for j in range(3) for i in range(3)]
    )
    codes = [255.0 * encode_srgb(np.clip(p[..., :3], 0, 1))[inside] for p in (ours, theirs)]
    error = np.mean((codes[0] - codes[1]) ** 2) if inside.any() else np.nan
    outline = np.mean((ours[..., 3] > 0.5) != (theirs[..., 3] > 0.5))
    return float(10.0 * np.log10(255.0**2 / max(error, 1e-4))), 100.0 * float(outline)


def collected(names, models, folder):
    cases, refused = [], {}
    for path in sorted(SCENES.glob("*.toml")):
        if names and path.stem not in names:
            continue
        try:
            cases.append(sample_case(path, folder))
        except UnwritableError as error:
            refused[path.stem] = str(error)
    if models is not None:
        cases += [
            model_case(path)
            for path in sorted(models.glob("*.glb"))
            if not names or path.stem in names
        ]
    return cases, refused
