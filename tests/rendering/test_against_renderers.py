"""Scenes of the samples as three.js draws them, from files that texbake's writer did not write.

`tests/benchmarks/bench_renderers.py` draws all of them, in Blender too.
"""

import subprocess
import sys
from pathlib import Path

import pytest

from texbake.rendering.scene.read import read_scene

PROGRAMS = Path(__file__).parents[1] / "benchmarks"
sys.path.insert(0, str(PROGRAMS))
try:
    import bench_renderers
finally:
    sys.path.remove(str(PROGRAMS))

UNAVAILABLE = 3  # exit code of a peer that is not here
# Least PSNR in dB, a little below what was measured; the rest is rounding and mip levels.
LEAST = {
    "orange_colored": 50.0, "orange_mapped": 50.0, "vertex_colors": 50.0, "baked_marble": 46.0,
    "emission": 44.0, "normal_map": 40.0, "affine": 50.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def cases(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenes")
    found, _ = bench_renderers.collected(list(LEAST), None, folder)
    return {case.name: case for case in found}


@pytest.fixture(scope="module")
def by_threejs(cases, tmp_path_factory):
    try:
        pictures = bench_renderers.by_threejs(
            list(cases.values()), tmp_path_factory.mktemp("three")
        )
    except subprocess.CalledProcessError as error:
        if error.returncode == UNAVAILABLE:
            pytest.skip("three.js or Chromium is not installed")
        raise
    return dict(zip(cases, pictures, strict=True))


@pytest.mark.parametrize("name", LEAST)
def test_threejs_draws_the_scene_alike(cases, by_threejs, name):
    psnr, outline = bench_renderers.alike(cases[name].ours(1), by_threejs[name])
    print(f"{name}: {psnr:.1f} dB, {outline:.2f} %")
    assert psnr > LEAST[name]
    assert outline < 0.1


@pytest.mark.parametrize("name", ["orange_colored", "vertex_colors", "baked_marble"])
def test_texbake_reads_the_file_as_the_scene(cases, name):
    case = cases[name]
    scene = read_scene(case.file)
    lighting = case.scene.lighting
    again = bench_renderers.Case(
        name, type(scene)(objects=scene.objects, lighting=lighting), case.options, case.camera,
        case.file, case.center, case.radius,
    )  # fmt: skip
    psnr, outline = bench_renderers.alike(case.ours(1), again.ours(1))
    assert psnr > 55.0  # positions and normals of float32
    assert outline < 0.01


def test_what_gltf_cannot_hold_is_named(tmp_path):
    _, refused = bench_renderers.collected(["marble", "orange_bump", "fog"], None, tmp_path)
    assert refused == {
        "marble": "procedure",
        "orange_bump": "bump map",
        "fog": "ambient light, environment or fog",
    }


def test_a_wrong_light_would_be_seen(cases, by_threejs):
    """The measure detects errors: a light that is turned by 10 degrees costs more than 15 dB."""
    case = cases["orange_colored"]
    (light,) = case.scene.lighting.lights
    x, y, z = light.direction
    turned = bench_renderers.replace(light, direction=(x + 0.2 * z, y, z - 0.2 * x))
    wrong = bench_renderers.replace(
        case,
        scene=bench_renderers.replace(
            case.scene, lighting=bench_renderers.Lighting(lights=(turned,))
        ),
    )
    psnr, _ = bench_renderers.alike(wrong.ours(1), by_threejs["orange_colored"])
    assert psnr < LEAST["orange_colored"] - 15.0
