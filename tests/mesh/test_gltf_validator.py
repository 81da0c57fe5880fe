"""What `write_glb` writes, judged by the Khronos glTF validator.

Needs node and the npm package `gltf-validator`, found through NODE_PATH, the folder that
TEXBAKE_NODE_MODULES names, or a node_modules folder above this one.
"""

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from tests.mesh.test_gltf_material_write import full_material, sphere_of
from tests.mesh.test_tangents import REFERENCES, reference_mesh
from tests.models import REAL, real
from texbake.mesh.files.gltf import read_gltf
from texbake.mesh.files.gltf_write import write_glb
from texbake.mesh.materials import MeshMaterial, read_materials
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import grid_sphere, plane, uv_sphere
from texbake.texture.material_images import gltf_images
from texbake.texture.png_files import write_png

SCRIPT = Path(__file__).with_name("validate_gltf.cjs")


@pytest.fixture(scope="module")
def validate():
    """Run the validator on a file, and return its report."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    folders = [os.environ.get(name) for name in ("NODE_PATH", "TEXBAKE_NODE_MODULES")]
    environment = {**os.environ, "NODE_PATH": os.pathsep.join(filter(None, folders))}

    def run(*arguments):
        return subprocess.run(
            [node, *arguments], env=environment, capture_output=True, text=True, check=False,
            timeout=60,
        )  # fmt: skip

    if run("-e", f"require('module').createRequire({str(SCRIPT)!r})('gltf-validator')").returncode:
        pytest.skip("npm's gltf-validator is not found; name its folder in TEXBAKE_NODE_MODULES")

    def report(path):
        result = run(str(SCRIPT), str(path))
        assert result.returncode == 0, result.stderr
        return json.loads(result.stdout)

    return report


@pytest.fixture
def normal_map(tmp_path):
    codes = np.full((64, 64, 3), 32768, np.uint16)
    codes[..., 2] = 65535
    write_png(tmp_path / "normal.png", codes)
    return tmp_path / "normal.png"


def assert_sound(report):
    issues = report["issues"]
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues["messages"]


def test_the_validator_finds_fault_with_a_damaged_file(validate, tmp_path):
    write_glb(plane(), tmp_path / "a.glb")
    data = (tmp_path / "a.glb").read_bytes()
    (tmp_path / "a.glb").write_bytes(data.replace(b'"VEC4"', b'"VEC3"'))
    assert validate(tmp_path / "a.glb")["issues"]["numErrors"] > 0


SPHERE = uv_sphere(8, 12)
MESHES = {
    "plane": plane(),
    "groups, colors and a far place": SPHERE.replace(
        positions=SPHERE.positions + 1e6,
        face_groups=np.arange(SPHERE.n_faces) % 3,
        group_names=("a", 'quotes " and \\', "Schale \U0001f34a"),
        colors=np.full((SPHERE.n_vertices, 3), 1.5),
    ),
    "degenerate faces": Mesh(
        positions=[[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0], [5, 5, 5]],
        faces=[[0, 1, 3], [0, 1, 2], [4, 4, 4], [2, 1, 0]],
        uvs=[[0, 0], [1, 0], [0, 1]],
        uv_faces=[[0, 1, 2], [1, 1, 1], [0, 1, 2], [0, 0, 1]],
    ),
}


@pytest.mark.parametrize("name", MESHES)
def test_a_textured_mesh_is_sound(validate, tmp_path, normal_map, name):
    mesh = MESHES[name]
    write_glb(mesh, tmp_path / "a.glb", normal_map=normal_map, base_color=(0.9, 0.4, 0.1))
    report = validate(tmp_path / "a.glb")
    assert_sound(report)
    # Nothing written is without use either.
    assert report["issues"]["numInfos"] == report["issues"]["numHints"] == 0
    assert report["info"]["generator"].startswith("texbake ")
    assert report["info"]["totalTriangleCount"] == mesh.n_faces
    assert report["info"]["drawCallCount"] == max(len(mesh.group_names), 1)
    image = report["info"]["resources"][1]["image"]
    assert (image["width"], image["bits"]) == (64, 16)


def test_a_bare_mesh_is_sound(validate, tmp_path):
    write_glb(grid_sphere(10, 20), tmp_path / "a.glb")
    assert_sound(validate(tmp_path / "a.glb"))


@pytest.mark.meshoptimizer
@pytest.mark.parametrize("compress", [False, True])
@pytest.mark.parametrize("quantize", [False, True])
def test_levels_and_compressed_views_are_sound(
    validate, tmp_path, normal_map, compress, quantize, request
):
    """The validator knows neither of levels nor of compression, but all that they refer to."""
    if compress:
        request.getfixturevalue("meshoptimizer")
    levels = [uv_sphere(8, 12), uv_sphere(4, 6)]
    write_glb(
        uv_sphere(16, 24), tmp_path / "a.glb", normal_map=normal_map, levels=levels,
        compress=compress, quantize=quantize,
    )  # fmt: skip
    report = validate(tmp_path / "a.glb")
    assert_sound(report)
    assert report["info"]["hasTextures"]


@pytest.mark.parametrize("path", REFERENCES, ids=lambda path: path.stem)
def test_torture_meshes_are_sound(validate, tmp_path, normal_map, path):
    write_glb(reference_mesh(np.load(path))[0], tmp_path / "a.glb", normal_map=normal_map)
    assert_sound(validate(tmp_path / "a.glb"))


IMAGES = {"plain": {}, "clamped": {"wraps": ("clamp", "mirror")}, "second set": {"uv_set": 1}}


@pytest.mark.parametrize(
    "name",
    [*IMAGES, *real("gltf/ClearCoatTest.glb", "gltf/GlamVelvetSofa.glb", "gltf/SpecularTest.glb",
                    "gltf/TextureTransformMultiTest.glb", "gltf/ToyCar/ToyCar.gltf")],
)  # fmt: skip
def test_materials_are_sound_when_read_and_written_again(validate, tmp_path, name):
    path = REAL / name
    if name in IMAGES:
        path = tmp_path / "made.glb"
        glass = MeshMaterial(name="glass", alpha_mode="mask", alpha_cutoff=0.25, is_unlit=True)
        mesh, materials = sphere_of(full_material("all", **IMAGES[name]), glass)
        write_glb(mesh, path, materials=materials)
        assert_sound(validate(path))
    mesh = read_gltf(path)
    materials = read_materials(path, mesh)
    # What stands where glTF reads it is not touched.
    assert gltf_images(materials).materials == materials.materials
    for quantize in False, True:
        write_glb(mesh, tmp_path / "a.glb", materials=materials, quantize=quantize)
        assert_sound(validate(tmp_path / "a.glb"))
