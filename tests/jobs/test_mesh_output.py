"""Meshes made from a mesh file keep its materials: GLB files whole, OBJ files what .mtl has."""

from dataclasses import replace

import numpy as np
import pytest

from tests.glb import GltfFile
from tests.raycast.test_hidden_faces import windowed_box
from texbake.errors import FileError
from texbake.jobs.lighten_options import LightenOptions
from texbake.jobs.mesh_output import MaterialPartition, MeshFileMaterials
from texbake.mesh.compose import join_meshes
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.materials import (
    ChannelImage,
    ChannelSource,
    Materials,
    MeshMaterial,
    read_materials,
)
from texbake.mesh.mesh import Mesh
from texbake.mesh.options import RepairOptions, SimplifyOptions, TransformOptions
from texbake.mesh.shapes import cube, icosphere, uv_sphere
from texbake.texture.image import write_image
from texbake.texture.material_images import components_of, image_codes
from texbake.verbs.meshes import convert_file, repair_file, transform_file
from texbake.verbs.simplify import simplify_file, simplify_levels
from texbake.verbs.unwrap import unwrap_files
from texbake.verbs.whole_jobs import lighten_file

CODES = np.random.default_rng(3).integers(0, 255, (4, 6, 8, 4), np.uint8)


def materials_of(path):
    found = read_materials(path, read_mesh(path))
    assert found is not None
    return found


def codes_of(source):
    pixels, bits = image_codes(source.image, is_color=False)
    assert bits == 8
    return np.rint(255 * components_of(pixels, source.image.components)).astype(int)


@pytest.fixture
def painted(tmp_path):
    """An OBJ file with two materials and an image for each channel, one of them a TGA file."""
    mesh = uv_sphere(4, 6)
    write_mesh(mesh, tmp_path / "bare.obj")
    text = (tmp_path / "bare.obj").read_text()
    at = text.index("f ")
    middle = text.index("f ", len(text) - (len(text) - at) // 2)
    (tmp_path / "ball.obj").write_text(
        f"mtllib ball.mtl\n{text[:at]}usemtl wood\n{text[at:middle]}usemtl glow\n{text[middle:]}"
    )
    for i, name in enumerate(("color.tga", "rough.png", "metal.png")):
        write_image(CODES[i, ..., : 4 if i == 0 else 3], tmp_path / name)
    (tmp_path / "ball.mtl").write_text(
        "newmtl wood\nmap_Kd color.tga\nmap_Pr -clamp on rough.png\nmap_Pm -clamp on metal.png\n"
        "newmtl glow\nKd 0.5 0.25 0\nKe 2 1 0\nd 0.5\nPr 0.75\n"
    )
    return tmp_path / "ball.obj"


def test_obj_to_glb_and_back(painted, tmp_path):
    done = transform_file(painted, tmp_path / "ball.glb")
    assert done.warnings == ()
    wood, glow = materials_of(tmp_path / "ball.glb").materials
    assert (wood.name, glow.name) == ("wood", "glow")
    assert wood.channels["base-color"].image.data.startswith(b"\x89PNG")
    assert wood.channels["roughness"].image.wraps == ("clamp", "clamp")
    assert wood.channels["roughness"].image.data == wood.channels["metallic"].image.data
    assert glow.channels["emissive"].factor == (2.0, 1.0, 0.0)
    assert (glow.alpha_mode, glow.channels["alpha"].factor) == ("blend", (0.5,))
    back = transform_file(tmp_path / "ball.glb", tmp_path / "back.obj")
    assert back.warnings == ()
    assert {path.name for path in back.files} == {
        "back.obj", "back.mtl", "back_base-color.png", "back_roughness.png", "back_metallic.png",
    }  # fmt: skip
    for path in tmp_path / "ball.glb", tmp_path / "back.obj":
        found, given = materials_of(path), materials_of(painted)
        np.testing.assert_array_equal(found.face_materials, given.face_materials)
        for i, channel in enumerate(("base-color", "roughness", "metallic")):
            source = found.materials[0].channels[channel]
            width = 3 if i == 0 else 1
            np.testing.assert_array_equal(codes_of(source), CODES[i, ..., :width])
    again = {path.name: path.read_bytes() for path in back.files}
    transform_file(tmp_path / "ball.glb", tmp_path / "back.obj")
    assert again == {path.name: path.read_bytes() for path in back.files}


def test_what_mtl_cannot_say_is_said(tmp_path):
    write_image(CODES[0, ..., :3], tmp_path / "a.png")
    image = ChannelImage(data=(tmp_path / "a.png").read_bytes(), uv_set=1)
    mesh = uv_sphere(4, 6)
    channels = {
        "base-color": ChannelSource((1.0, 0.5, 1.0), replace(image, uv_set=0)),
        "emissive": ChannelSource((1.0, 1.0, 1.0), image),
        "clearcoat": ChannelSource((0.5,)),
        "transmission": ChannelSource((0.0,)),
    }
    materials = Materials(
        face_materials=np.zeros(mesh.n_faces, np.int32),
        materials=(MeshMaterial(name="a", channels=channels),),
        uv_sets={1: mesh.uvs},
    )
    write_mesh(mesh, tmp_path / "a.glb", materials=materials)
    (warning,) = transform_file(tmp_path / "a.glb", tmp_path / "a.obj").warnings
    for words in "factors of images", "clearcoat", "further UV sets":
        assert words in warning
    assert "transmission" not in warning
    assert materials_of(tmp_path / "a.obj").materials[0].channels["emissive"].image is None


def test_if_one_file_cannot_be_written_none_is(painted, tmp_path):
    transform_file(painted, tmp_path / "ball.glb")
    (tmp_path / "back.mtl").mkdir()
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(FileError, match=r"back\.mtl"):
        transform_file(tmp_path / "ball.glb", tmp_path / "back.obj")
    assert sorted(tmp_path.rglob("*")) == before


def test_moved_and_repaired_meshes_keep_materials_with_their_faces(painted, tmp_path):
    transform_file(painted, tmp_path / "ball.glb")
    transform_file(
        tmp_path / "ball.glb", tmp_path / "over.glb", TransformOptions(flip=True, scale=2)
    )
    options = RepairOptions(degenerate=False)
    done = repair_file(tmp_path / "ball.glb", tmp_path / "mended.glb", options)
    assert done.warnings == ()
    given = materials_of(painted).face_materials
    for name in "over.glb", "mended.glb":
        np.testing.assert_array_equal(materials_of(tmp_path / name).face_materials, given)
    # The poles of the sphere have faces without area.
    done = repair_file(tmp_path / "ball.glb", tmp_path / "fewer.glb")
    assert ("written without materials" in "".join(done.warnings)) == (
        done.report.n_faces < len(given)
    )


def test_images_need_texture_coordinates(painted, tmp_path):
    done = repair_file(
        painted, tmp_path / "a.glb", RepairOptions(coordinates=False, degenerate=False)
    )
    assert "images" in done.warnings[-1]
    wood, glow = materials_of(tmp_path / "a.glb").materials
    assert wood.channels["base-color"].image is None
    assert glow.channels["emissive"].factor == (2.0, 1.0, 0.0)


def test_colors_of_vertices_are_kept_where_a_material_has_none(tmp_path):
    ball = uv_sphere(4, 6)
    mesh = Mesh(
        positions=ball.positions, faces=ball.faces, colors=np.full((ball.n_vertices, 3), 0.5)
    )
    write_mesh(mesh, tmp_path / "a.obj")
    text = (tmp_path / "a.obj").read_text()
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nusemtl a\n" + text)
    for line, has_colors in ("Pr 0.5", True), ("Kd 1 0 0", False):
        (tmp_path / "a.mtl").write_text(f"newmtl a\n{line}\n")
        done = transform_file(tmp_path / "a.obj", tmp_path / "a.glb")
        assert (read_mesh(tmp_path / "a.glb").colors is not None) == has_colors
        assert ("vertex colors" in "".join(done.warnings)) != has_colors


def halves(mesh):
    """0 for the faces of the lower half of a mesh along y, 1 for the others."""
    return (mesh.positions[mesh.faces].mean(axis=1)[:, 1] > 0.0).astype(np.int32)


@pytest.fixture
def ball(tmp_path):
    """A sphere as GLB: its lower half has an image, the upper half a factor."""
    write_image(np.random.default_rng(1).random((4, 4, 3)), tmp_path / "image.png", bits=8)
    mesh = uv_sphere(48, 64)
    image = ChannelImage((tmp_path / "image.png").read_bytes(), "image.png")
    wood = MeshMaterial(name="wood", channels={"base-color": ChannelSource((1.0,) * 3, image)})
    iron = MeshMaterial(name="iron", channels={"metallic": ChannelSource((0.75,))})
    materials = Materials(face_materials=halves(mesh), materials=(wood, iron))
    write_mesh(mesh, tmp_path / "ball.glb", materials=materials)
    return tmp_path / "ball.glb"


@pytest.mark.parametrize("quality", ["fast", "best"])
@pytest.mark.parametrize("suffix", [".glb", ".obj"])
def test_simplify_keeps_materials(ball, tmp_path, quality, suffix):
    done = simplify_file(
        ball, tmp_path / f"low{suffix}", SimplifyOptions(n_faces=600, quality=quality)
    )
    assert not any("materials" in line for line in done.warnings)
    low, materials = read_mesh(tmp_path / f"low{suffix}"), materials_of(tmp_path / f"low{suffix}")
    assert low.n_faces <= 600
    names = np.array([materials.names[i] for i in materials.face_materials])
    # No edge is collapsed across the border, which lies at y = 0.
    np.testing.assert_array_equal(names, np.array(["wood", "iron"])[halves(low)])
    wood, iron = (materials.materials[materials.names.index(name)] for name in ("wood", "iron"))
    assert wood.channels["base-color"].image.data == (tmp_path / "image.png").read_bytes()
    assert iron.channels["metallic"].factor == (0.75,)
    assert all(path.exists() for path in done.files)
    assert len(done.files) == (1 if suffix == ".glb" else 3)


def test_simplify_says_what_formats_cannot_hold(ball, tmp_path):
    levels = [(600, tmp_path / "low.ply"), (600, tmp_path / "low.stl")]
    ply, stl = simplify_levels(ball, levels)
    assert ply.warnings[-1] == f"{tmp_path / 'low.ply'}: written without materials"
    assert stl.warnings[-1].endswith("low.stl: written without texture coordinates, materials")
    plain = simplify_file(ball, tmp_path / "bare.obj", SimplifyOptions(n_faces=600), mtl=False)
    assert plain.files == (tmp_path / "bare.obj",)
    assert plain.warnings[-1].endswith("bare.obj: written without materials")


def test_images_go_with_texture_coordinates(ball, tmp_path):
    done = simplify_file(ball, tmp_path / "low.glb", SimplifyOptions(n_faces=600, seams="drop"))
    assert done.warnings[-1].endswith("images, for which there are no texture coordinates")
    low, materials = read_mesh(tmp_path / "low.glb"), materials_of(tmp_path / "low.glb")
    assert low.uvs is None
    assert not materials.has_images
    assert materials.names == ("wood", "iron")


@pytest.mark.parametrize(
    ("glass", "n_left"),
    [
        ({}, 12),
        ({"alpha_mode": "blend"}, 332),
        ({"alpha_mode": "mask"}, 332),
        ({"channels": {"transmission": ChannelSource((0.5,))}}, 332),
    ],
    ids=["opaque", "blend", "mask", "transmission"],
)
def test_what_an_opaque_case_hides_is_dropped(tmp_path, glass, n_left):
    ball = icosphere(2)
    mesh = join_meshes([cube(), ball.replace(positions=0.3 * ball.positions)])
    channels = {"base-color": ChannelSource((1.0, 0.5, 1.0))}
    case = MeshMaterial(name="case", **({"channels": channels} | glass))
    materials = Materials(
        face_materials=(np.arange(mesh.n_faces) >= 12).astype(np.int32),
        materials=(case, MeshMaterial(name="ball", channels=channels)),
    )
    write_mesh(mesh, tmp_path / "a.glb", materials=materials)
    options = SimplifyOptions(n_faces=2_000, drop_hidden=True)
    done = simplify_file(tmp_path / "a.glb", tmp_path / "low.glb", options)
    assert (done.report.n_faces_before, done.report.n_faces) == (332, n_left)
    dropped = "dropped 320 triangles of hidden parts"
    assert any(dropped in line for line in done.warnings) == (n_left == 12)
    names = materials_of(tmp_path / "low.glb").names
    assert ("ball" in names) == (n_left > 12)
    light = LightenOptions(n_faces=2_000, drop_hidden=True, views=0)
    done = lighten_file(tmp_path / "a.glb", tmp_path / "light.glb", light)
    assert (done.report.n_faces_before, done.report.n_faces) == (332, n_left)
    assert any(dropped in line for line in done.warnings) == (n_left == 12)


@pytest.mark.parametrize("is_instanced", [False, True])
def test_what_is_seen_gets_more_triangles_but_in_copies(tmp_path, is_instanced):
    box = windowed_box()
    file = GltfFile()
    arrays = {"POSITION": file.accessor(box.positions)}
    corners = file.accessor(box.faces.reshape(-1, 1), "I")
    mesh = file.mesh({"attributes": arrays, "indices": corners})
    nodes = [{"mesh": mesh, "translation": [2 * i, 0, 0]} for i in range(1 + is_instanced)]
    file.json |= {"nodes": nodes, "scenes": [{"nodes": list(range(len(nodes)))}]}
    path, low = file.write(tmp_path / "a.glb"), tmp_path / "low.glb"
    counts = []
    for drop_hidden in (False, True):
        done = simplify_file(path, low, SimplifyOptions(n_faces=1_000, drop_hidden=drop_hidden))
        x, y, z = read_mesh(low).positions.T
        in_window = (np.hypot(x, y) < 0.3) & (z > 0.3) & (z < 0.41)
        counts.append(np.count_nonzero(in_window))
        is_told = any("hardly seen" in note for note in done.report.notes)
        assert is_told == (drop_hidden and not is_instanced)
    assert (counts[1] > 1.4 * counts[0]) == (not is_instanced)


def test_groups_are_what_they_were(ball):
    mesh, materials = read_mesh(ball), materials_of(ball)
    groups = np.arange(mesh.n_faces, dtype=np.int32) % 3
    mesh = mesh.replace(face_groups=groups, group_names=("a", "b", "c"))
    source = MeshFileMaterials(path=ball, materials=materials)
    borders = MaterialPartition.of(mesh, source)
    back, of_back = borders.restored(borders.mesh, mesh)
    np.testing.assert_array_equal(back.face_groups, groups)
    assert back.group_names == mesh.group_names
    np.testing.assert_array_equal(of_back.materials.face_materials, materials.face_materials)


def test_unwrap_names_the_command_that_carries_images_over(ball, tmp_path):
    done = unwrap_files(ball, tmp_path / "new.glb")
    (line,) = done.warnings
    assert "written without the images of" in line and "texbake lighten" in line
    materials = materials_of(tmp_path / "new.glb")
    assert not materials.has_images
    assert materials.names == ("wood", "iron")
    assert materials.materials[1].channels["metallic"].factor == (0.75,)


def test_unwrap_does_not_write_over_the_mtl_file_of_images(ball, tmp_path):
    simplify_file(ball, tmp_path / "low.obj", SimplifyOptions(n_faces=600))
    before = (tmp_path / "low.mtl").read_bytes()
    done = unwrap_files(tmp_path / "low.obj", tmp_path / "low.obj")
    assert (tmp_path / "low.mtl").read_bytes() == before
    assert done.files == (tmp_path / "low.obj",)
    assert "low.obj: written without materials" in done.warnings[0]


def test_gltf_without_materials_keeps_the_default_material(tmp_path):
    file, ball = GltfFile(), uv_sphere(24, 48)
    arrays = {"POSITION": file.accessor(ball.positions), "NORMAL": file.accessor(ball.positions)}
    file.mesh({"attributes": arrays, "indices": file.accessor(ball.faces.reshape(-1, 1), "I")})
    bare, made = file.write(tmp_path / "ball.glb"), tmp_path / "made.glb"
    for write in (
        lambda: convert_file(bare, made, TransformOptions(), progress=None),
        lambda: simplify_file(bare, made, SimplifyOptions(n_faces=300)),
        lambda: lighten_file(bare, made, LightenOptions(n_faces=3000, views=0)),
    ):
        write()
        (material,) = materials_of(made).materials
        assert all(material.channels[name].factor == (1.0,) for name in ("metallic", "roughness"))
    write_mesh(ball, tmp_path / "ball.obj")
    # The default of glTF is not that of other formats.
    convert_file(tmp_path / "ball.obj", made, TransformOptions(), progress=None)
    (material,) = materials_of(made).materials
    assert material.channels["metallic"].factor == (0.0,)
