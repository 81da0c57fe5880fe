"""Meshes made from a mesh file keep its materials where the output and its coordinates allow."""

from pathlib import Path

import numpy as np
import pytest

from texbake.jobs.mesh_output import MaterialPartition, MeshFileMaterials
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.materials import (
    ChannelImage,
    ChannelSource,
    Materials,
    MeshMaterial,
    read_materials,
)
from texbake.mesh.mesh import Mesh
from texbake.mesh.options import SimplifyOptions
from texbake.mesh.shapes import uv_sphere
from texbake.texture.image import write_image
from texbake.verbs.simplify import simplify_file, simplify_levels
from texbake.verbs.unwrap import unwrap_files


def halves(mesh: Mesh) -> np.ndarray:
    """0 for the faces of the lower half of a mesh along y, 1 for the others."""
    return (mesh.positions[mesh.faces].mean(axis=1)[:, 1] > 0.0).astype(np.int32)


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    """A sphere as GLB: its lower half has an image, the upper half a factor."""
    write_image(np.random.default_rng(1).random((4, 4, 3)), tmp_path / "image.png", bits=8)
    mesh = uv_sphere(48, 64)
    image = ChannelImage((tmp_path / "image.png").read_bytes(), "image.png")
    wood = MeshMaterial(name="wood", channels={"base-color": ChannelSource((1.0,) * 3, image)})
    iron = MeshMaterial(name="iron", channels={"metallic": ChannelSource((0.75,))})
    materials = Materials(face_materials=halves(mesh), materials=(wood, iron))
    write_mesh(mesh, tmp_path / "ball.glb", materials=materials)
    return tmp_path / "ball.glb"


def found_in(path: Path) -> tuple[Mesh, Materials]:
    mesh = read_mesh(path)
    materials = read_materials(path, mesh)
    assert materials is not None
    return mesh, materials


@pytest.mark.parametrize("quality", ["fast", "best"])
@pytest.mark.parametrize("suffix", [".glb", ".obj"])
def test_simplify_keeps_materials(ball: Path, tmp_path: Path, quality: str, suffix: str) -> None:
    done = simplify_file(
        ball, tmp_path / f"low{suffix}", SimplifyOptions(n_faces=600, quality=quality)
    )
    assert not any("materials" in line for line in done.warnings)
    low, materials = found_in(tmp_path / f"low{suffix}")
    assert low.n_faces <= 600
    names = np.array([materials.names[i] for i in materials.face_materials])
    # No edge is collapsed across the border, which lies at y = 0.
    np.testing.assert_array_equal(names, np.array(["wood", "iron"])[halves(low)])
    wood, iron = (materials.materials[materials.names.index(name)] for name in ("wood", "iron"))
    assert wood.channels["base-color"].image.data == (tmp_path / "image.png").read_bytes()
    assert iron.channels["metallic"].factor == (0.75,)
    assert all(path.exists() for path in done.files)
    assert len(done.files) == (1 if suffix == ".glb" else 3)


def test_simplify_says_what_formats_cannot_hold(ball: Path, tmp_path: Path) -> None:
    levels = [(600, tmp_path / "low.ply"), (600, tmp_path / "low.stl")]
    ply, stl = simplify_levels(ball, levels)
    assert ply.warnings[-1] == f"{tmp_path / 'low.ply'}: written without materials"
    assert stl.warnings[-1].endswith("low.stl: written without texture coordinates, materials")
    plain = simplify_file(ball, tmp_path / "bare.obj", SimplifyOptions(n_faces=600), mtl=False)
    assert plain.files == (tmp_path / "bare.obj",)
    assert plain.warnings[-1].endswith("bare.obj: written without materials")


def test_images_go_with_texture_coordinates(ball: Path, tmp_path: Path) -> None:
    done = simplify_file(ball, tmp_path / "low.glb", SimplifyOptions(n_faces=600, seams="drop"))
    assert done.warnings[-1].endswith("images, for which there are no texture coordinates")
    low, materials = found_in(tmp_path / "low.glb")
    assert low.uvs is None
    assert not materials.has_images
    assert materials.names == ("wood", "iron")


def test_groups_are_what_they_were(ball: Path) -> None:
    mesh, materials = found_in(ball)
    groups = np.arange(mesh.n_faces, dtype=np.int32) % 3
    mesh = mesh.replace(face_groups=groups, group_names=("a", "b", "c"))
    source = MeshFileMaterials(path=ball, materials=materials)
    borders = MaterialPartition.of(mesh, source)
    back, of_back = borders.restored(borders.mesh, mesh)
    np.testing.assert_array_equal(back.face_groups, groups)
    assert back.group_names == mesh.group_names
    assert of_back.materials is not None
    np.testing.assert_array_equal(of_back.materials.face_materials, materials.face_materials)


def test_unwrap_names_the_command_that_carries_images_over(ball: Path, tmp_path: Path) -> None:
    done = unwrap_files(ball, tmp_path / "new.glb")
    (line,) = done.warnings
    assert "written without the images of" in line
    assert "texbake lighten" in line
    _, materials = found_in(tmp_path / "new.glb")
    assert not materials.has_images
    assert materials.names == ("wood", "iron")
    assert materials.materials[1].channels["metallic"].factor == (0.75,)


def test_unwrap_does_not_write_over_the_mtl_file_of_images(ball: Path, tmp_path: Path) -> None:
    simplify_file(ball, tmp_path / "low.obj", SimplifyOptions(n_faces=600))
    before = (tmp_path / "low.mtl").read_bytes()
    done = unwrap_files(tmp_path / "low.obj", tmp_path / "low.obj")
    assert (tmp_path / "low.mtl").read_bytes() == before
    assert done.files == (tmp_path / "low.obj",)
    assert "low.obj: written without materials" in done.warnings[0]
