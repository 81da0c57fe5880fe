"""`lighten`: fewer triangles, one set of images, and all that the materials say."""

import json
import math
import re
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from tests.character import character, posed
from tests.glb import GltfFile, read_glb
from tests.models import sponge
from texbake.errors import MeshError, OptionError, ReadWarning, UnwrapError, UvError, heard_warnings
from texbake.jobs import light_models, lighten_options
from texbake.jobs.fitting_atlas import unwrap_to_fit
from texbake.jobs.light_budget import Budget, Trial
from texbake.jobs.light_codings import Codings
from texbake.jobs.light_images import (
    Picture,
    coded,
    decoded,
    pictures_of,
    psnr,
    squared_errors,
    turned_share,
    with_files,
)
from texbake.jobs.light_models import LightModel, Source
from texbake.jobs.lighten_options import LightenOptions
from texbake.jobs.material_transfer import texture_size
from texbake.jobs.options import RunOptions
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.compose import excerpt, join_meshes
from texbake.mesh.distance import surface_distance
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.files.gltf_write import write_glb
from texbake.mesh.materials import (
    CHANNELS,
    ChannelImage,
    ChannelSource,
    Materials,
    MeshMaterial,
    read_materials,
)
from texbake.mesh.rig import read_rig
from texbake.mesh.shapes import plane, uv_sphere
from texbake.mesh.topology import face_components
from texbake.progress import Stages
from texbake.rendering.compare_models import compare_models
from texbake.rendering.options import RenderOptions
from texbake.texture.image import decode_image, write_image
from texbake.texture.image_files import encode_image
from texbake.texture.model_materials import without_damaged_images
from texbake.texture.pack import resized
from texbake.verbs.whole_jobs import lighten_file, run_files

pytestmark = pytest.mark.usefixtures("small_room")
OPTIONS = LightenOptions(n_faces=600, uvs="new", size=256, images="png", views=0)


def picture(folder, name, pixels, components=(0, 1, 2)):
    write_image(pixels, folder / name, color=False, bits=8)
    return ChannelImage((folder / name).read_bytes(), name, components=components)


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """Two spheres: a painted one, seen from both sides in places, and one of plain copper."""
    folder = tmp_path_factory.mktemp("model")
    ball = uv_sphere(48, 96)
    mesh = join_meshes([ball, ball.replace(positions=ball.positions + np.array([3.0, 0.0, 0.0]))])
    ramp = np.linspace(0, 255, 64).astype(np.uint8)
    codes = np.full((64, 64, 4), 255, np.uint8)
    codes[:, :, 0] = ramp
    codes[:, :, 1] = ramp[:, np.newaxis]
    codes[:32, :, 3] = 64
    surface = np.full((64, 64, 3), 255, np.uint8)
    surface[:, :, 1] = ramp[:, np.newaxis]
    surface[:, :, 2] = 51
    paint = picture(folder, "paint.png", codes)
    rough = picture(folder, "rough.png", surface, (1,))
    materials = Materials(
        face_materials=np.repeat(np.array([0, 1], np.int32), ball.n_faces),
        materials=(
            MeshMaterial(
                name="paint",
                channels={
                    "base-color": ChannelSource((1.0, 1.0, 0.5), paint),
                    "alpha": ChannelSource(
                        (1.0,), ChannelImage(paint.data, paint.name, components=(3,))
                    ),
                    "roughness": ChannelSource((1.0,), rough),
                    "metallic": ChannelSource(
                        (1.0,), ChannelImage(rough.data, rough.name, components=(2,))
                    ),
                    "emissive": ChannelSource((0.0, 4.0, 0.0)),
                },
                alpha_mode="mask",
                alpha_cutoff=0.25,
                is_double_sided=True,
            ),
            MeshMaterial(
                name="copper",
                channels={
                    "base-color": ChannelSource((0.9, 0.4, 0.2)),
                    "roughness": ChannelSource((0.3,)),
                    "metallic": ChannelSource((1.0,)),
                    "clearcoat": ChannelSource((0.8,)),
                },
            ),
        ),
    )
    path = folder / "two.glb"
    write_glb(mesh, path, materials=materials)
    return path


@pytest.fixture(scope="module")
def light(model, tmp_path_factory):
    path = tmp_path_factory.mktemp("light") / "light.glb"
    done = lighten_file(model, path, OPTIONS)
    mesh = read_mesh(path)
    return done, mesh, read_materials(path, mesh)


def pixels_of(source, *, is_color):
    image = source.image
    pixels = decode_image(image.data, image.name, color=is_color).pixels
    return pixels[:, :, list(image.components)] * source.factor


def test_the_model_is_smaller_and_says_so(model, light):
    done, mesh, _ = light
    report = done.report
    assert mesh.n_faces == report.n_faces <= 600 < report.n_faces_before == read_mesh(model).n_faces
    assert report.n_bytes_before == model.stat().st_size
    assert report.n_bytes == done.files[0].stat().st_size
    assert report.simplified is not None and report.simplified.distance.rms_relative < 0.01


def test_what_a_renderer_asks_of_a_whole_material_stays_apart(light):
    _, mesh, materials = light
    modes = {m.alpha_mode: (m.alpha_cutoff, m.is_double_sided) for m in materials.materials}
    assert modes == {"mask": (0.25, True), "opaque": (0.5, False)}
    centers = mesh.positions[mesh.faces].mean(axis=1)
    is_copper = np.array([m.alpha_mode == "opaque" for m in materials.materials])
    assert np.array_equal(is_copper[materials.face_materials], centers[:, 0] > 1.5)


def test_each_face_has_the_channels_of_its_material(light):
    _, mesh, materials = light
    (first, second) = materials.materials
    assert first.channels["base-color"].image == second.channels["base-color"].image
    copper = mesh.positions[mesh.faces].mean(axis=1)[:, 0] > 1.5
    # Centers of the faces in the images, v down.
    u, v = mesh.corner_uvs().mean(axis=1).T
    expected = {
        "base-color": (0.9, 0.4, 0.2),
        "roughness": (0.3,),
        "metallic": (1.0,),
        "clearcoat": (0.8,),
        "emissive": (0.0, 0.0, 0.0),
    }
    for name, value in expected.items():
        pixels = pixels_of(first.channels[name], is_color=CHANNELS[name].is_color)
        height, width = pixels.shape[:2]
        assert height == width == OPTIONS.size
        found = pixels[((1 - v) * height).astype(int), (u * width).astype(int)]
        assert np.abs(found[copper] - value).max() < 0.02, name
        if name == "emissive":
            assert np.abs(found[~copper] - (0.0, 4.0, 0.0)).max() < 0.04
        if name == "metallic":
            assert np.abs(found[~copper] - 0.2).max() < 0.01


def test_alpha_is_there_only_where_it_is_asked_for(light):
    _, _, materials = light
    by_mode = {m.alpha_mode: m for m in materials.materials}
    assert "alpha" not in by_mode["opaque"].channels
    alpha = pixels_of(by_mode["mask"].channels["alpha"], is_color=True)
    assert alpha.min() < 0.3
    assert alpha.max() == 1.0


def test_the_same_model_gives_the_same_bytes_also_in_several_files(model, light, tmp_path):
    document, data = read_glb(model)
    image = document["images"][0]
    view = document["bufferViews"][image.pop("bufferView")]
    first = view.get("byteOffset", 0)
    image["uri"], document["buffers"][0]["uri"] = "the%20paint.png", "a%20buffer.bin"
    folder = tmp_path / "apart"
    folder.mkdir()
    (folder / "the paint.png").write_bytes(data[first : first + view["byteLength"]])
    (folder / "a buffer.bin").write_bytes(data)
    (folder / "two.gltf").write_text(json.dumps(document))
    for path, threads in ((model, 3), (folder / "two.gltf", 1)):
        again = lighten_file(path, tmp_path / "light.glb", replace(OPTIONS, threads=threads))
        assert again.files[0].read_bytes() == light[0].files[0].read_bytes()
    assert again.report.n_bytes_before == sum(file.stat().st_size for file in folder.iterdir())


@pytest.mark.parametrize(
    ("n_materials", "size"), [(0, 16), (1, 64), (2, 128), (4, 128), (5, 256), (99, 256)]
)
def test_an_atlas_has_room_for_the_largest_image_of_each_material(tmp_path, n_materials, size):
    large, small = np.zeros((32, 128, 3), np.uint8), np.zeros((64, 32, 3), np.uint8)
    channels = {
        "base-color": ChannelSource((1.0, 1.0, 1.0), picture(tmp_path, "a.png", large)),
        "emissive": ChannelSource((1.0, 1.0, 1.0), picture(tmp_path, "b.png", small)),
        "metallic": ChannelSource((1.0,)),
    }
    materials = Materials(
        face_materials=np.arange(n_materials, dtype=np.int32),
        materials=(MeshMaterial(name="one", channels=channels),) * n_materials,
    )
    assert texture_size(materials, 16, 256) == size


def test_a_channel_that_is_one_number_needs_no_image(tmp_path):
    mesh = uv_sphere(24, 48)
    channels = {"roughness": ChannelSource((0.25,)), "base-color": ChannelSource((0.5, 0.5, 0.5))}
    materials = Materials(
        face_materials=np.zeros(mesh.n_faces, np.int32),
        materials=(MeshMaterial(name="gray", channels=channels),),
    )
    write_glb(mesh, tmp_path / "gray.glb", materials=materials)
    done = lighten_file(tmp_path / "gray.glb", tmp_path / "light.glb", OPTIONS)
    assert done.report.images == ("gray_normal.png",)
    found = read_materials(tmp_path / "light.glb", read_mesh(tmp_path / "light.glb"))
    assert found.materials[0].channels["roughness"] == ChannelSource((0.25,))


def test_a_model_without_materials_gets_its_vertex_colors(tmp_path):
    ball = uv_sphere(24, 48)
    colors = (0.5 + 0.5 * ball.positions).astype(np.float32)
    write_glb(ball.replace(colors=colors), tmp_path / "colored.glb")
    lighten_file(tmp_path / "colored.glb", tmp_path / "light.glb", OPTIONS)
    mesh = read_mesh(tmp_path / "light.glb")
    assert mesh.colors is None
    (material,) = read_materials(tmp_path / "light.glb", mesh).materials
    assert np.ptp(pixels_of(material.channels["base-color"], is_color=True)) > 0.5


def test_vertex_colors_of_a_scan_look_as_before(tmp_path):
    ball = uv_sphere(48, 96)
    colors = (0.5 + 0.5 * ball.positions).astype(np.float32)
    write_mesh(ball.replace(colors=colors), tmp_path / "scan.ply")
    options = replace(OPTIONS, n_faces=3000, views=2)
    done = lighten_file(tmp_path / "scan.ply", tmp_path / "light.glb", options)
    assert done.report.comparison.mean_db > 30.0


def test_a_gltf_file_without_materials_looks_as_before(tmp_path):
    file, ball = GltfFile(), uv_sphere(24, 48)
    arrays = {"POSITION": file.accessor(ball.positions), "NORMAL": file.accessor(ball.positions)}
    file.mesh({"attributes": arrays, "indices": file.accessor(ball.faces.reshape(-1, 1), "I")})
    path = file.write(tmp_path / "ball.glb")
    options = replace(OPTIONS, uvs="auto", n_faces=3000, views=2)
    done = lighten_file(path, tmp_path / "light.glb", options)
    assert done.report.comparison.mean_db > 35.0


def test_an_obj_file_without_materials_looks_as_before(tmp_path):
    write_mesh(uv_sphere(12, 24), tmp_path / "ball.obj")
    options = LightenOptions(views=2, quantize=False)
    done = lighten_file(tmp_path / "ball.obj", tmp_path / "light.glb", options)
    assert done.report.comparison.mean_db == math.inf


def test_few_triangles_without_images_keep_their_colors_and_growth_is_a_warning(tmp_path):
    ball = uv_sphere(6, 12).replace(uvs=None, uv_faces=None)
    model = tmp_path / "a.glb"
    write_glb(ball.replace(colors=(0.5 + 0.5 * ball.positions).astype(np.float32)), model)
    done = lighten_file(model, tmp_path / "b.glb", LightenOptions(views=2))
    assert done.report.comparison.mean_db > 40 and not done.warnings
    assert done.report.n_bytes < done.report.n_bytes_before
    (line,) = lighten_file(model, tmp_path / "b.glb", OPTIONS).warnings
    assert " bytes, more than the " in line


def test_a_missing_image_is_a_warning(model, tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl skin\nKd 0.5 0.25 0\nmap_Kd gone.png\n")
    (tmp_path / "a.obj").write_text(
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl skin\n"
        "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
    )
    options = replace(OPTIONS, views=2)
    warned = []
    with heard_warnings(warned.append):
        done = lighten_file(tmp_path / "a.obj", tmp_path / "light.glb", options)
    (line,) = warned
    assert line.startswith(f"{tmp_path / 'a.obj'}: ") and "gone.png: there is no such file" in line
    compared = f"{tmp_path / 'a.obj'}: compared without its missing images: gone.png"
    assert compared in done.warnings
    assert done.report.missing_images == ("gone.png",)
    assert any(
        label == "PSNR in 2 views without missing images" for label, _ in done.report.table()
    )
    ran = run_files(tmp_path / "a.obj", tmp_path / "run", RunOptions(n_faces=4, size=64))
    assert compared in ran.warnings
    # The shape is as it was, so there is nothing to bake.
    assert done.report.images == ()
    assert done.report.baked is None
    mesh = read_mesh(tmp_path / "light.glb")
    (material,) = read_materials(tmp_path / "light.glb", mesh).materials
    assert material.channels["base-color"] == ChannelSource((0.5, 0.25, 0.0))


def test_images_without_texture_coordinates_are_a_warning(tmp_path):
    (tmp_path / "paint.png").write_bytes(b"never read")
    (tmp_path / "a.mtl").write_text("newmtl skin\nKd 0.5 0.25 0\nPr 0.5\nmap_Kd paint.png\n")
    (tmp_path / "a.obj").write_text(
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl skin\n"
        "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
    )
    with pytest.warns(ReadWarning, match="no texture coordinates"):
        lighten_file(tmp_path / "a.obj", tmp_path / "light.glb", OPTIONS)
    mesh = read_mesh(tmp_path / "light.glb")
    (material,) = read_materials(tmp_path / "light.glb", mesh).materials
    assert material.channels["roughness"] == ChannelSource((0.5,))


def test_pictures_of_both_are_compared(model, tmp_path):
    page = tmp_path / "light.html"
    done = lighten_file(
        model,
        tmp_path / "light.glb",
        replace(OPTIONS, n_faces=4000, views=2),
        report=tmp_path / "light.json",
        html=page,
        command="texbake lighten",
    )
    assert done.files[-2:] == (page, tmp_path / "light.json")
    assert "two.glb" in page.read_text(encoding="utf-8")
    figures = json.loads((tmp_path / "light.json").read_text())["compare"]
    assert len(figures["psnr_db"]) == 2
    assert figures["worst_db"] > 25.0
    with pytest.raises(OptionError, match="one view or more"):
        lighten_file(model, tmp_path / "light.glb", OPTIONS, html=page)


def test_a_lightened_character_moves_as_before(tmp_path):
    mesh, rig = character()
    write_glb(mesh, tmp_path / "a.glb", rig=rig)
    options = replace(OPTIONS, n_faces=mesh.n_faces // 3, quantize=False)
    lighten_file(tmp_path / "a.glb", tmp_path / "b.glb", options)
    before, after = read_mesh(tmp_path / "a.glb"), read_mesh(tmp_path / "b.glb")
    assert after.uvs is not None and after.n_faces <= mesh.n_faces // 3
    kept, given = read_rig(tmp_path / "b.glb"), read_rig(tmp_path / "a.glb")
    assert [node["name"] for node in kept.nodes] == [node["name"] for node in given.nodes]
    assert kept.content["cameras"] == given.content["cameras"]
    assert len(kept.content["animations"][0]["channels"]) == 3
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        shapes = [m.replace(positions=posed(m, None, share)) for m in (before, after)]
        assert surface_distance(*shapes).max < 0.03


KEPT = LightenOptions(n_faces=1500, uvs="keep", views=0)


def atlas_of_balls(folder, *, overlap, rows=24, cells=64):
    """Three balls as nodes, side by side in the texture or all at one place of it."""
    ball = uv_sphere(rows, 2 * rows)
    parts = []
    for i, name in enumerate(("body", "left", "right")):
        uvs = ball.uvs if overlap else (ball.uvs * 0.9 + 0.05 + np.array([i, 0.0])) / [3.0, 1.0]
        scale = 1.0 if i == 0 else 0.1
        place = np.array([2.0 * i, 0.0, 0.0])
        parts.append(ball.replace(positions=ball.positions * scale + place, uvs=uvs, name=name))
    mesh = join_meshes(parts)
    codes = np.random.default_rng(0).integers(0, 256, (cells, cells, 3)).astype(np.uint8)
    codes = np.repeat(np.repeat(codes, 512 // cells, axis=0), 512 // cells, axis=1)
    channels = {"base-color": ChannelSource((1.0, 1.0, 1.0), picture(folder, "paint.png", codes))}
    materials = Materials(
        face_materials=np.zeros(mesh.n_faces, np.int32),
        materials=(MeshMaterial(name="paint", channels=channels),),
    )
    write_glb(mesh, folder / "balls.glb", materials=materials)
    return folder / "balls.glb"


@pytest.mark.parametrize("overlap", [False, True])
def test_coordinates_that_stay_keep_nodes_and_images_and_get_normals_where_they_are_an_atlas(
    tmp_path, overlap
):
    model = atlas_of_balls(tmp_path, overlap=overlap)
    source = read_mesh(model)
    done = lighten_file(model, tmp_path / "light.glb", replace(KEPT, size=256))
    low = read_mesh(tmp_path / "light.glb")
    assert done.report.keeps_uvs
    assert low.group_names == source.group_names == ("body", "left", "right")
    (material,) = read_materials(tmp_path / "light.glb", low).materials
    assert ("normal" in material.channels) is not overlap
    image = material.channels["base-color"].image
    assert decode_image(image.data, image.name, color=False).pixels.shape[:2] == (256, 256)
    if not overlap:  # each ball still lies in its third of the texture
        thirds = np.floor(3.0 * low.corner_uvs().mean(axis=1)[:, 0]).astype(int)
        assert np.array_equal(thirds, low.face_groups)
    # By their quadrics, a tenth of the size would keep 0.046 of the triangles.
    counts = np.bincount(low.face_groups)
    assert counts[1:].min() > 0.08 * counts[0]


def test_auto_makes_new_coordinates_where_faces_overlap_and_one_node_if_asked(tmp_path):
    model = atlas_of_balls(tmp_path, overlap=True)
    options = replace(KEPT, uvs="auto", size=128, join=True)
    done = lighten_file(model, tmp_path / "light.glb", options)
    assert not done.report.keeps_uvs
    row = dict(done.report.table())["texture coordinates"]
    assert row.startswith("new, because the model has texture coordinates that overlap")
    assert len(read_glb(tmp_path / "light.glb")[0]["nodes"]) == 1
    whole = lighten_file(model, tmp_path / "light.glb", replace(options, n_faces=10**6))
    assert whole.report.keeps_uvs and whole.report.simplified is None


@pytest.mark.parametrize("uvs", ["keep", "auto"])
def test_auto_makes_new_coordinates_where_those_that_stay_would_overlap(tmp_path, monkeypatch, uvs):
    path = atlas_of_balls(tmp_path, overlap=False)
    monkeypatch.setattr(light_models, "is_atlas", lambda mesh, threads=None: mesh.n_faces > 1500)
    done = lighten_file(path, tmp_path / "light.glb", replace(KEPT, uvs=uvs))
    assert done.report.keeps_uvs == (uvs == "keep") and done.report.n_faces <= 1500
    assert any("would overlap with so few triangles" in line for line in done.warnings) == (
        uvs == "auto"
    )


def test_parts_that_are_copies_share_texels_and_look_as_before(tmp_path):
    model = atlas_of_balls(tmp_path, overlap=True, rows=12, cells=16)
    options = replace(KEPT, uvs="new", size=256, views=2)
    apart = lighten_file(model, tmp_path / "light.glb", options).report
    stacked = lighten_file(model, tmp_path / "light.glb", replace(options, stack=True)).report
    assert (apart.n_shared, stacked.n_shared) == (0, 1)  # the body is ten times as large
    assert stacked.unwrapped.n_charts < apart.unwrapped.n_charts
    assert stacked.comparison.mean_db > apart.comparison.mean_db - 0.5
    low = read_mesh(tmp_path / "light.glb")
    assert low.group_names == ("body", "left", "right")
    _, left, right = np.bincount(low.face_groups)
    assert left == right
    model = atlas_of_balls(tmp_path, overlap=False)
    done = lighten_file(model, tmp_path / "light.glb", replace(options, stack=True, views=0))
    assert any("no parts share texels" in line for line in done.warnings)
    with pytest.raises(OptionError, match=r"^stack: .*; set `uvs`"):
        replace(options, stack=True, uvs="keep")


@pytest.mark.parametrize(("overlap", "n_faces"), [(False, 1500), (True, 10**6)])
def test_a_request_to_share_texels_changes_no_file_whose_coordinates_stay(
    tmp_path, overlap, n_faces
):
    model, files = atlas_of_balls(tmp_path, overlap=overlap, rows=12, cells=16), []
    options = replace(KEPT, uvs="auto", n_faces=n_faces, size=128)
    for stack in (False, True):
        done = lighten_file(model, tmp_path / "light.glb", replace(options, stack=stack))
        assert done.report.keeps_uvs
        assert any("share texels as before" in line for line in done.warnings) == stack
        files.append((tmp_path / "light.glb").read_bytes())
    assert files[0] == files[1]


@pytest.mark.parametrize("given", ["clamp", "placing", "tangents"])
def test_balls_that_look_different_share_no_texels(tmp_path, given):
    ball = uv_sphere(12, 24)
    balls = [ball, ball.replace(positions=ball.positions + np.array([3.0, 0.0, 0.0]))]
    if given != "tangents":
        balls[1] = balls[1].replace(uvs=ball.uvs + np.array([1.0, 0.0]))
    mesh = join_meshes(balls)
    codes = np.full((64, 64, 3), (220, 128, 220), np.uint8)
    codes[:, 32 if given == "placing" else 60 :] = (128, 128, 255)
    image = picture(tmp_path, "paint.png", codes)
    if given == "clamp":
        image = replace(image, wraps=("clamp", "clamp"))
    elif given == "placing":
        image = replace(image, placing=((0.5, 0.0, 0.0), (0.0, 1.0, 0.0)))
    else:
        tangents = np.zeros((mesh.n_faces, 3, 4), np.float32)
        tangents[:, :, 0] = tangents[:, :, 3] = np.where(mesh.face_groups == 0, 1, -1)[:, None]
        mesh = mesh.replace(tangents=tangents)
    channel = "normal" if given == "tangents" else "base-color"
    channels = {channel: ChannelSource((1.0, 1.0, 1.0), image)}
    materials = Materials(
        face_materials=np.zeros(mesh.n_faces, np.int32),
        materials=(MeshMaterial(name="paint", channels=channels),),
    )
    write_glb(mesh, tmp_path / "balls.glb", materials=materials)
    options = replace(KEPT, uvs="new", size=256, views=2)
    apart, stacked = (
        lighten_file(
            tmp_path / "balls.glb", tmp_path / "light.glb", replace(options, stack=stack)
        ).report
        for stack in (False, True)
    )
    assert stacked.comparison.mean_db > apart.comparison.mean_db - 2.0


def test_a_model_without_texture_coordinates_says_so(tmp_path):
    write_glb(uv_sphere(8, 12).replace(uvs=None, uv_faces=None), tmp_path / "bare.glb")
    done = lighten_file(tmp_path / "bare.glb", tmp_path / "light.glb", LightenOptions(views=0))
    assert dict(done.report.table())["texture coordinates"] == "none"


def test_coordinates_cannot_stay_where_no_image_lies_on_them(tmp_path):
    write_glb(uv_sphere(24, 48), tmp_path / "plain.glb")
    with pytest.raises(OptionError, match=r"^uvs: plain\.glb has no images .*; use new$"):
        lighten_file(tmp_path / "plain.glb", tmp_path / "light.glb", KEPT)


def test_a_texture_too_small_for_the_charts_names_the_size_that_does(tmp_path):
    model = atlas_of_balls(tmp_path, overlap=True)
    options = replace(KEPT, uvs="new", size=16)
    with pytest.raises(UvError, match="at 16 x 16; use `size` "):
        lighten_file(model, tmp_path / "light.glb", options)


def test_a_target_size_is_kept_and_more_bytes_come_closer(tmp_path):
    model = atlas_of_balls(tmp_path, overlap=True, rows=6)
    found = []
    for target in (15_000, 60_000):
        options = LightenOptions(target_size=target, views=2)
        found.append(lighten_file(model, tmp_path / "light.glb", options).report)
        assert found[-1].n_bytes == (tmp_path / "light.glb").stat().st_size <= target
    assert found[0].comparison.mean_db < found[1].comparison.mean_db
    with pytest.raises(
        OptionError, match=r"^target_size: the smallest file of .* has [\d,]+ bytes; "
    ):
        lighten_file(model, tmp_path / "light.glb", LightenOptions(target_size=500))


@pytest.fixture
def budget_of(monkeypatch):
    """Return a function that makes a budget whose trials have the bytes and dB of a function."""
    mesh = uv_sphere(48, 96)
    materials = Materials(
        face_materials=np.zeros(mesh.n_faces, np.int32), materials=(MeshMaterial(name="a"),)
    )

    def budget(n_bytes_of, db_of):
        def made(budget, n_faces, n_bytes, least_db=0.0):
            model = LightModel(
                mesh=excerpt(mesh, np.arange(mesh.n_faces) < n_faces),
                materials=materials,
                pictures=(),
                simplified=None,
                warnings=(),
            )
            compare = partial(SimpleNamespace, mean_db=db_of(n_faces))
            size = n_bytes_of(n_faces)
            return Trial(
                light_model=model,
                materials=materials,
                n_bytes=size,
                compare=compare if size <= n_bytes else None,
            )

        monkeypatch.setattr(Budget, "_trial", made)
        source = Source(mesh, materials, None, LightenOptions(), Stages(), None)
        return Budget("a.glb", source, "b.glb")

    return budget


def test_triangles_become_fewer_until_a_target_size_fits(budget_of):
    budget = budget_of(lambda n: 50_000 if n < 800 else 200_000, float)
    assert budget.within(100_000).light_model.mesh.n_faces < 800


def test_a_psnr_is_reached_with_hardly_more_triangles_than_it_takes(budget_of, monkeypatch):
    monkeypatch.setattr(Budget, "_in_large_pictures", lambda budget, trial: trial)
    budget = budget_of(lambda n: 100 * n, lambda n: n / 100.0)
    for n_faces in range(900, 8000, 500):
        found = budget.reaching(n_faces / 100.0).light_model.mesh.n_faces
        assert n_faces <= found <= 1.01 * math.sqrt(1.5) * n_faces


def test_a_psnr_is_reached_with_few_bytes_or_the_reachable_one_is_named(tmp_path):
    model = atlas_of_balls(tmp_path, overlap=True, rows=12, cells=8)
    found = []
    for goal in (25.0, 32.0):
        options = LightenOptions(min_psnr=goal, views=1)
        found.append(lighten_file(model, tmp_path / "light.glb", options).report)
        assert found[-1].n_bytes == (tmp_path / "light.glb").stat().st_size
        # The pictures are large ones, of the file that was written.
        size = RenderOptions(width=512, height=512)
        light = tmp_path / "light.glb"
        written = compare_models(model, light, n_views=1, options=size, at_rest=True)
        assert found[-1].comparison.psnr_db == written.psnr_db
        assert written.mean_db >= goal
    assert found[0].n_bytes < found[1].n_bytes
    with pytest.raises(
        OptionError, match=r"^min_psnr: the closest result .* has [\d.]+ dB; "
    ) as error:
        lighten_file(model, tmp_path / "none.glb", LightenOptions(min_psnr=99, views=1))
    assert not (tmp_path / "none.glb").exists()
    reachable = float(re.search(r"has ([\d.]+) dB", str(error.value))[1])
    assert found[1].comparison.mean_db <= reachable < 99.0


@pytest.mark.parametrize("others", [{"views": 0}, {"target_size": "5kB"}, {"image_quality": 80}])
def test_a_psnr_excludes_options_that_contradict_it(others):
    with pytest.raises(OptionError, match="min_psnr"):
        LightenOptions(min_psnr=30, **others)


@pytest.mark.parametrize("size", ["0", "-5kB", "five", "nan", ""])
def test_what_is_no_size_of_a_file_is_an_error(size):
    with pytest.raises(OptionError, match=r"^target_size: "):
        LightenOptions(target_size=size)


def test_smaller_sides_are_means_of_texels_and_their_errors_those_of_the_whole():
    values = np.random.default_rng(4).random((16, 16, 3))
    codes = np.rint(255 * values.repeat(8, axis=0).repeat(8, axis=1)).astype(np.uint8)
    image = Picture("noise", codes, is_color=False)
    np.testing.assert_array_equal(image.at_side(16), codes[::8, ::8])
    halves = codes[::8, ::8].reshape(8, 2, 8, 2, 3).astype(float).mean(axis=(1, 3))
    assert np.abs(image.at_side(8) - halves).max() <= 0.5
    smooth = Picture("smooth", resized(codes[::8, ::8] * np.float32(1), 256, 256).astype(np.uint8),
                     is_color=False)  # fmt: skip
    for side in (128, 64):
        large = resized(smooth.at_side(side).astype(np.float32), 256, 256)
        error = ((large - smooth.codes) ** 2).mean()
        assert Codings(256, "webp", 1)._error_of(smooth, side) == pytest.approx(error, rel=0.3)


@pytest.mark.parametrize(("n_channels", "is_cut"), [(3, False), (4, False), (4, True)])
@pytest.mark.parametrize("shape", [(16, 64), (8, 32), (10, 40)])
def test_errors_of_codes_are_exact_and_smaller_pictures_are_enlarged(n_channels, is_cut, shape):
    rng = np.random.default_rng(7)
    other = rng.integers(0, 256, (16, 64, n_channels)).astype(np.uint8)
    one = rng.integers(0, 256, (*shape, n_channels)).astype(np.uint8)
    large = resized(one.astype(np.float32), 64, 16).astype(np.float64)
    squares = (large - other) ** 2
    weights = other[..., 3:] / 1.0 if is_cut else np.ones((16, 64, 1))
    colors = (squares[..., :3] * weights).sum() / (3 * weights.sum())
    alpha = squares[..., 3].mean() if n_channels == 4 else 0.0
    # Other sides than a half are rounded to codes, which adds 1 / 12.
    rel = 1e-2 if shape == (10, 40) else 1e-6
    assert squared_errors(one, other, is_cut=is_cut) == pytest.approx((colors, alpha), rel=rel)


def test_the_highest_quality_is_lossless_where_that_has_fewer_bytes():
    tiles = np.random.default_rng(3).integers(0, 256, (4, 4, 3)).astype(np.uint8)
    codes = np.tile(tiles, (32, 32, 1))
    noise = np.random.default_rng(3).integers(0, 256, (128, 128, 3)).astype(np.uint8)
    kept, lost = (
        decoded(coded(Picture("p", each, True), "webp", quality=None, side=128), 3)
        for each in (codes, noise)
    )
    np.testing.assert_array_equal(kept, codes)
    assert psnr(lost, noise) < 40.0
    files = Codings(128, "webp", 1).extreme([Picture("p", codes, True)], is_finest=True)
    np.testing.assert_array_equal(decoded(files["p"], 3), codes)


def test_a_quality_leaves_forty_decibels_if_any_does():
    ramp = np.linspace(0, 255, 64).astype(np.uint8)
    codes = np.broadcast_to(ramp[:, np.newaxis, np.newaxis], (64, 64, 3)).copy()
    data = coded(Picture("ramp", codes, True), "webp", quality=None, side=64)
    assert psnr(decoded(data, 3), codes) >= 40.0
    small = coded(Picture("ramp", codes, True), "png", quality=None, side=16)
    assert decoded(small, 3).shape == (16, 16, 3)
    assert coded(Picture("ramp", codes, True, data), "webp", quality=100, side=64) == data


def test_a_normal_map_keeps_the_directions_of_its_normals():
    x, y = np.meshgrid(np.linspace(0.0, 40.0, 256), np.linspace(0.0, 40.0, 256))
    tilted = np.stack([0.5 * np.sin(x), 0.5 * np.sin(y), np.ones_like(x)], axis=-1)
    noise = np.random.default_rng(0).normal((0.0, 0.0, 1.0), 0.3, (256, 256, 3))
    for vectors in (tilted, noise):
        vectors = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
        codes = np.rint(127.5 * (vectors + 1.0)).astype(np.uint8)
        image = Picture("bumps", codes, False, is_normal=True)
        data = coded(image, "webp", quality=None, side=256)
        made = decoded(data, 3).astype(float) - 127.5
        means, true = (each.reshape(64, 4, 64, 4, 3).mean(axis=(1, 3)) for each in (made, vectors))
        cosines = (means * true).sum(axis=-1) / (
            np.linalg.norm(means, axis=-1) * np.linalg.norm(true, axis=-1)
        )
        assert np.degrees(np.arccos(np.quantile(cosines, 0.01))) <= 1.8
        # Without a need for directions, fewer bytes would do.
        assert len(data) > len(coded(replace(image, is_normal=False), "webp", quality=30, side=256))


def test_the_share_of_turned_normals_is_that_of_squares_of_texels():
    codes = np.full((64, 64, 3), (128, 128, 255), np.uint8)
    turned = codes.copy()
    turned[:16, :, 0] += 8  # 3.6 degrees
    assert turned_share(turned, codes) == 0.25
    codes[:32] = 128  # no direction
    assert turned_share(turned, codes) == 0.0
    # The mean of a square is what counts.
    checkers = codes.copy()
    checkers[:, ::2, 0], checkers[:, 1::2, 0] = 136, 120
    assert turned_share(checkers, codes) == 0.0


@pytest.mark.parametrize("quality", [None, 30, 90])
def test_few_colors_are_lossless_at_every_quality(quality):
    flat = np.full((64, 64, 3), (128, 128, 255), np.uint8)
    squares = np.random.default_rng(0).integers(0, 2, (8, 8, 3)).repeat(8, 0).repeat(8, 1)
    for codes in (flat, (255 * squares).astype(np.uint8)):
        image = Picture("few", codes, False)
        data = coded(image, "webp", quality=quality, side=64)
        np.testing.assert_array_equal(decoded(data, 3), codes)
        files = Codings(64, "webp", 1).extreme([image], is_finest=quality == 90)
        np.testing.assert_array_equal(decoded(files["few"], 3), codes)


def test_an_image_is_lossless_where_no_quality_is_close_and_that_takes_hardly_more_bytes():
    rng = np.random.default_rng(0)
    few_colors = 36 * rng.integers(0, 8, (128, 128, 3)).astype(np.uint8)
    noise = rng.integers(0, 256, (128, 128, 3)).astype(np.uint8)
    for codes, is_lossless in ((few_colors, True), (noise, False)):
        lossy = encode_image(codes, "webp", quality=90, is_color=True)
        assert psnr(decoded(lossy, 3), codes) < 40.0
        data = coded(Picture("p", codes, True), "webp", quality=None, side=128)
        assert len(lossy) <= len(data) < 2.5 * len(lossy)
        assert np.array_equal(decoded(data, 3), codes) == is_lossless


@pytest.mark.parametrize("uvs", ["keep", "new"])
def test_a_normal_map_without_bumps_is_not_written(tmp_path, uvs):
    mesh = plane(20)
    codes = np.arange(64 * 64 * 3).reshape(64, 64, 3) % 251
    image = picture(tmp_path, "paint.png", codes.astype(np.uint8))
    materials = Materials(
        face_materials=np.zeros(mesh.n_faces, np.int32),
        materials=(
            MeshMaterial(name="a", channels={"base-color": ChannelSource((1.0,) * 3, image)}),
        ),
    )
    write_glb(mesh, tmp_path / "plane.glb", materials=materials)
    options = replace(OPTIONS, n_faces=8, uvs=uvs, size=64, padding=1)
    done = lighten_file(tmp_path / "plane.glb", tmp_path / "light.glb", options)
    assert done.report.baked is not None
    assert not any("normal" in name for name in done.report.images)
    (primitive,) = read_glb(tmp_path / "light.glb")[0]["meshes"][0]["primitives"]
    assert "TANGENT" not in primitive["attributes"]


def test_parts_that_were_dropped_are_named(tmp_path):
    ball = uv_sphere(6, 12)
    places = [np.array([3.0 * i, 0.0, 0.0]) for i in range(60)]
    parts = [ball.replace(positions=ball.positions + place) for place in places]
    write_glb(join_meshes(parts), tmp_path / "parts.glb")
    options = replace(OPTIONS, n_faces=200)
    done = lighten_file(tmp_path / "parts.glb", tmp_path / "light.glb", options)
    assert any("of 60 separate parts were dropped" in warning for warning in done.warnings)


def test_no_part_is_dropped_where_coordinates_stay(tmp_path):
    balls = read_mesh(atlas_of_balls(tmp_path, overlap=False, rows=6))
    row = [
        balls.replace(positions=balls.positions + np.array([0.0, 3.0 * i, 0.0])) for i in range(20)
    ]
    mesh = join_meshes(row)
    codes = np.full((64, 64, 3), 90, np.uint8)
    paint = ChannelSource((1.0, 1.0, 1.0), picture(tmp_path, "paint.png", codes))
    items = (MeshMaterial(name="unused"), MeshMaterial(name="a", channels={"base-color": paint}))
    materials = Materials(face_materials=np.ones(mesh.n_faces, np.int32), materials=items)
    whole = Source(mesh, materials, None, replace(KEPT, n_faces=200), Stages(), None)
    with pytest.raises(MeshError, match="texture coordinates, holes and separate parts need "):
        whole.lightened(200)
    kept = whole.lightened(200, is_trial=True)
    assert face_components(kept.mesh.faces, kept.mesh.n_vertices)[1] == 60
    assert [material.name for material in kept.materials.materials] == ["a"]


@pytest.mark.parametrize("share", [0.1, 0.9])
def test_a_mesh_stays_whose_topology_does_not_allow_the_default_number(
    tmp_path, monkeypatch, share
):
    monkeypatch.setattr(lighten_options, "LEAST_FACES", 10)
    monkeypatch.setattr(lighten_options, "SHARE", share)
    mesh = sponge(2)
    write_glb(mesh, tmp_path / "sponge.glb")
    options = LightenOptions(views=0, size=512, samples=1, padding=0, quality="fast")
    done = lighten_file(tmp_path / "sponge.glb", tmp_path / "light.glb", options)
    assert (done.report.n_faces == mesh.n_faces) == (share == 0.1)
    assert (done.report.simplified is None) == (share == 0.1)
    assert any("triangles stay" in line for line in done.warnings) == (share == 0.1)


@pytest.mark.parametrize("uvs", ["keep", "new"])
def test_a_number_of_triangles_that_cannot_be_reached_is_an_error(tmp_path, uvs):
    mesh = sponge(2)
    mesh = mesh.replace(uvs=mesh.positions[:, :2], uv_faces=mesh.faces)
    paint = picture(tmp_path, "paint.png", np.zeros((4, 4, 3), np.uint8))
    channels = {"base-color": ChannelSource((1.0, 1.0, 1.0), paint)}
    materials = Materials(
        face_materials=np.zeros(mesh.n_faces, np.int32),
        materials=(MeshMaterial(name="paint", channels=channels),),
    )
    write_glb(mesh, tmp_path / "sponge.glb", materials=materials)
    options = LightenOptions(n_faces=200, uvs=uvs, size=128, views=0)
    with pytest.raises(MeshError, match=r"200 triangles cannot be reached, .*; request more"):
        lighten_file(tmp_path / "sponge.glb", tmp_path / "light.glb", options)
    # Trials of a size may have more.
    done = lighten_file(
        tmp_path / "sponge.glb",
        tmp_path / "light.glb",
        replace(options, n_faces=700, target_size=60_000),
    )
    assert done.report.n_bytes <= 60_000


def test_why_no_atlas_can_be_made_is_said_and_not_that_charts_are_small():
    flat = uv_sphere(6, 12).replace(positions=np.zeros((uv_sphere(6, 12).n_vertices, 3)))
    with pytest.raises(UnwrapError, match="no face has an area"):
        unwrap_to_fit(flat, UnwrapOptions(size=64, padding=None), may_grow=True)


def test_no_warning_says_that_a_skin_which_stays_was_left_out(tmp_path):
    mesh, rig = character()
    write_glb(mesh, tmp_path / "a.glb", rig=rig)
    heard = []
    with heard_warnings(heard.append):
        lighten_file(tmp_path / "a.glb", tmp_path / "b.glb", replace(OPTIONS, views=1))
    assert heard == []


def test_colors_that_alpha_hides_cost_no_quality_and_others_get_forty_decibels():
    rng = np.random.default_rng(0)
    codes = np.full((64, 64, 4), 255, np.uint8)
    codes[..., :3] = np.linspace(60, 200, 64).astype(np.uint8)[:, np.newaxis, np.newaxis]
    codes[32:, :, :3] = rng.integers(0, 256, (32, 64, 3))
    codes[32:, :, 3] = 0
    whole = Picture("leaf", codes, True)
    data, plain = (
        coded(replace(whole, is_cut=cut), "webp", quality=None, side=64) for cut in (True, False)
    )
    assert len(data) < len(plain)
    assert psnr(decoded(data, 4)[:32, :, :3], codes[:32, :, :3]) >= 40.0
    worse = codes.copy()
    worse[:32, :, :3] -= 3
    assert psnr(worse, codes, is_cut=True) == psnr(worse[:32, :, :3], codes[:32, :, :3]) < 40.0


@pytest.mark.parametrize(
    ("modes", "is_cut"), [(("mask",), True), (("blend",), True), (("mask", "opaque"), False)]
)
def test_alpha_hides_colors_where_no_opaque_material_shows_them(tmp_path, modes, is_cut):
    codes = np.full((4, 4, 4), 128, np.uint8)
    paint = picture(tmp_path, "paint.png", codes)
    alpha = replace(paint, components=(3,))
    channels = {"base-color": ChannelSource((1.0, 1.0, 1.0), paint)}
    items = tuple(
        MeshMaterial(
            name=mode,
            channels={
                **channels,
                **({} if mode == "opaque" else {"alpha": ChannelSource((1.0,), alpha)}),
            },
            alpha_mode=mode,
        )
        for mode in modes
    )
    (found,) = pictures_of(Materials(face_materials=np.zeros(1, np.int32), materials=items), {})
    assert found.is_cut is is_cut


def test_images_of_one_stem_get_names_of_their_own(tmp_path):
    codes = np.zeros((4, 4, 3), np.uint8)
    paints = [picture(tmp_path, "a.png", codes), picture(tmp_path, "a.jpg", codes)]
    items = tuple(
        MeshMaterial(
            name=paint.name, channels={"base-color": ChannelSource((1.0, 1.0, 1.0), paint)}
        )
        for paint in paints
    )
    materials = Materials(face_materials=np.zeros(1, np.int32), materials=items)
    files = {paint.name: paints[0].data for paint in paints}
    names = [m.channels["base-color"].image.name for m in with_files(materials, files).materials]
    assert names == ["a.png", "a_2.png"]


def test_damaged_images_of_extensions_are_left_out(tmp_path):
    image = picture(tmp_path, "thickness.png", np.full((8, 8, 3), 90, np.uint8))
    image = replace(image, data=image.data[: len(image.data) // 2])
    volume = {"KHR_materials_volume": {"thicknessFactor": 2.0, "thicknessTexture": image}}
    materials = Materials(
        face_materials=np.zeros(1, np.int32),
        materials=(MeshMaterial(name="glass", extensions=volume),),
    )
    found, (line,) = without_damaged_images(materials)
    assert line.startswith("glass: ") and line.endswith("; written without its thicknessTexture")
    (glass,) = found.materials
    assert glass.extensions == {"KHR_materials_volume": {"thicknessFactor": 2.0}}


def test_images_of_extensions_are_encoded_as_well(tmp_path):
    image = picture(tmp_path, "thickness.png", np.full((8, 8, 3), 90, np.uint8))
    glass = MeshMaterial(
        name="glass",
        extensions={"KHR_materials_volume": {"thicknessFactor": 2.0, "thicknessTexture": image}},
    )
    materials = Materials(face_materials=np.zeros(1, np.int32), materials=(glass,))
    (found,) = pictures_of(materials, {})
    assert not found.is_color and np.array_equal(found.codes, np.full((8, 8, 3), 90))
    (made,) = with_files(materials, {"thickness.png": b"new"}).materials
    volume = made.extensions["KHR_materials_volume"]
    assert volume["thicknessFactor"] == 2.0 and volume["thicknessTexture"].data == b"new"
