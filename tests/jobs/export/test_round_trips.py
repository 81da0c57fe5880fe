"""Exported assets, shown by three.js, and compared with texbake's own picture.

three.js runs in Chromium, as `tests/benchmarks/peer_threejs.py` says. Where it cannot be had, the
tests are skipped with the reason. `pytest -rP` prints how similar the pictures are.
"""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from texbake import Light, Lighting, RenderOptions, read_scene, write_image
from texbake.jobs.export.export import export_asset
from texbake.jobs.export.programs import ExportOptions
from texbake.mesh.shapes import uv_sphere
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.texture.encoding import encode_srgb
from texbake.texture.image_files import write_normals

PROGRAMS = Path(__file__).parents[2] / "benchmarks"
UNAVAILABLE = 3  # exit code of a program that is not installed
WIDTH, HEIGHT = 240, 180
TO_LIGHT = np.array([0.5, 0.6, 0.62]) / np.linalg.norm([0.5, 0.6, 0.62])
LIGHT = (0.8, 0.75, 0.7)
CAMERA = Camera.looking_at((1.2, 1.0, 2.6), (0, 0, 0), fov=np.radians(40.0), near=0.05)


def write_maps(folder, *, green=1.0):
    """Maps of a ball, not metallic; `green` of -1 makes the normals wrong."""
    y, x = np.mgrid[:256, :512] / 256 * 2 * np.pi * 10
    ones = np.ones_like(x)
    normals = np.stack([0.4 * np.cos(x), 0.3 * np.sin(y) * green, ones], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    color = np.stack([0.8 * ones, 0.4 + 0.2 * np.sin(x / 4), 0.2 + 0.1 * np.sin(y / 3)], axis=-1)
    write_normals(normals.astype(np.float32), folder / "normal.png")
    write_image(color.astype(np.float32), folder / "albedo.png", color=True)
    for name, values in (("roughness", 0.6 + 0.3 * np.sin(y)), ("metalness", 0.0 * x),
                         ("ao", ones)):  # fmt: skip
        write_image(values[..., None].astype(np.float32), folder / f"{name}.png", bits=8)
    return {path.stem: path for path in folder.glob("*.png")}


@pytest.fixture(scope="module")
def assets(tmp_path_factory, meshoptimizer):
    """The ball as exported: as it should be, compressed with levels, and with green wrong."""
    made = {}
    for name, green, options in (("ball", 1.0, {}), ("compressed", 1.0, {"compress": True}),
                                 ("wrong", -1.0, {})):  # fmt: skip
        folder = tmp_path_factory.mktemp(name)
        levels = [uv_sphere(12, 24)] if options else []
        made[name] = export_asset(
            uv_sphere(48, 96), write_maps(folder, green=green), folder / "out",
            ExportOptions(to="threejs", **options), levels=levels,
        ).mesh  # fmt: skip
    return made


def job_of(file):
    """A picture as three.js needs it, which chooses near and far itself."""
    world_from_camera = np.eye(4)
    world_from_camera[:3, :3] = CAMERA.axes.T
    world_from_camera[:3, 3] = CAMERA.eye
    scale, near, far = 1.0 / np.tan(CAMERA.fov / 2.0), CAMERA.near, 100.0
    projection = np.zeros((4, 4))
    projection[0, 0], projection[1, 1] = scale * HEIGHT / WIDTH, scale
    projection[2, 2:] = (near + far) / (near - far), 2.0 * near * far / (near - far)
    projection[3, 2] = -1.0
    return {
        "file": str(file), "width": WIDTH, "height": HEIGHT, "fov": CAMERA.fov,
        "clip_from_camera": projection.ravel().tolist(),
        "world_from_camera": world_from_camera.ravel().tolist(),
        "to_light": TO_LIGHT.tolist(), "light": list(LIGHT),
    }  # fmt: skip


def by_texbake(file, supersampling):
    scene = read_scene(file)
    lighting = Lighting(lights=(Light(direction=tuple(-TO_LIGHT), color=LIGHT),))
    options = RenderOptions(
        width=WIDTH, height=HEIGHT, supersampling=supersampling, background=None
    )
    frame = draw(prepare(replace(scene, lighting=lighting, view=None), options), CAMERA)
    return np.concatenate([frame.color[..., :3], frame.coverage[..., None]], axis=2)


@pytest.fixture(scope="module")
def by_threejs(assets, tmp_path_factory):
    folder = tmp_path_factory.mktemp("threejs")
    jobs = []
    for name, file in assets.items():
        jobs.append(folder / f"{name}.json")
        jobs[-1].write_text(json.dumps(job_of(file)))
    done = subprocess.run(
        [sys.executable, PROGRAMS / "peer_threejs.py", *jobs, "-o", folder],
        capture_output=True, text=True, check=False, timeout=180,
    )  # fmt: skip
    if done.returncode == UNAVAILABLE:
        pytest.skip(f"three.js: {done.stderr.strip()}")
    assert done.returncode == 0, done.stderr
    return {name: np.load(folder / f"{name}.npy") for name in assets}


def alike(ours, theirs):
    """PSNR in dB of sRGB codes inside the outline, and the share of pixels out of it otherwise."""
    whole = (ours[..., 3] > 0.99) & (theirs[..., 3] > 0.99)
    padded = np.pad(whole, 1)
    windows = [padded[j : j + HEIGHT, i : i + WIDTH] for j in range(3) for i in range(3)]
    inside = np.logical_and.reduce(windows)
    assert inside.mean() > 0.3
    codes = [255.0 * encode_srgb(picture[..., :3])[inside] for picture in (ours, theirs)]
    psnr = 10.0 * np.log10(255.0**2 / np.mean((codes[0] - codes[1]) ** 2))
    outline = np.mean((ours[..., 3] > 0.5) != (theirs[..., 3] > 0.5))
    print(f"PSNR {psnr:.1f} dB, outlines differ in {100 * outline:.3f} % of the pixels")
    return psnr, outline


def test_threejs_draws_the_same_picture(assets, by_threejs):
    psnr, outline = alike(by_texbake(assets["ball"], 1), by_threejs["ball"])
    # What is left is rounding to 8 bits and mip levels.
    assert psnr > 45.0
    assert outline < 0.001


def test_threejs_shows_the_compressed_file_as_the_plain_one(assets, by_threejs):
    difference = np.abs(by_threejs["compressed"] - by_threejs["ball"])
    # Triangles come in another order, whose shared edges may be rounded differently, and vertices
    # are integers.
    assert (difference.max(axis=2) > 0.01).mean() < 0.001


def test_a_wrong_green_channel_would_be_seen(assets, by_threejs):
    """The measure detects errors: one inverted channel costs half of it."""
    psnr, _ = alike(by_texbake(assets["ball"], 1), by_threejs["wrong"])
    assert psnr < 30.0
