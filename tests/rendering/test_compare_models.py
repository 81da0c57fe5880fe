"""Two versions of a model, drawn from all around."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from texbake_cli.main import texbake

from texbake.errors import OptionError, ReadWarning
from texbake.mesh.files import write_mesh
from texbake.mesh.hard_edges import with_normals
from texbake.mesh.materials import CHANNELS, ChannelImage, ChannelSource, Materials, MeshMaterial
from texbake.mesh.shapes import cube, plane, uv_sphere
from texbake.pages.picture_pages import write_contributions_page
from texbake.rendering.compare_models import (
    compare_models,
    contributions_of,
    model_scene,
    sphere_views,
)
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render_scene
from texbake.rendering.scene.lights import Ambient, Light, Lighting, Shadow
from texbake.rendering.scene.material import BumpMap, Material
from texbake.rendering.scene.scene import Scene, SceneObject, transform_matrix
from texbake.rendering.scene.textures import ImageTexture, ProcedureTexture
from texbake.texture.encoding import quantize_srgb
from texbake.texture.png_files import png_parts

SMALL = RenderOptions(width=48, height=32)


def painted(color, path, mesh=None):
    mesh = mesh or uv_sphere(12, 16)
    source = ChannelSource(color)
    channels = {"base-color": source, "roughness": ChannelSource((0.5,))}
    ids = np.zeros(mesh.n_faces, np.int32)
    materials = Materials(
        face_materials=ids, materials=(MeshMaterial(name="a", channels=channels),)
    )
    write_mesh(mesh, path, materials=materials)
    return path


def test_views_are_spread_evenly():
    angles = np.radians(sphere_views(12))
    azimuths, elevations = angles.T
    points = np.stack(
        [np.cos(elevations) * np.sin(azimuths), np.sin(elevations),
         np.cos(elevations) * np.cos(azimuths)], axis=1,
    )  # fmt: skip
    assert np.abs(points.mean(axis=0)).max() < 0.05
    between = np.degrees(np.arccos(np.clip(points @ points.T - 2 * np.eye(12), -1, 1)))
    # Vertices of an icosahedron, the best that there is for twelve, are 63.4 degrees apart.
    assert between.min() > 40.0


def test_a_model_is_like_itself(tmp_path):
    model = painted((0.8, 0.2, 0.1), tmp_path / "a.glb")
    found = compare_models(model, model, options=SMALL)
    assert found.psnr_db == (math.inf,) * 6 and found.mean_db == found.worst_db == math.inf
    assert found.n_faces[0] == found.n_faces[1] == uv_sphere(12, 16).n_faces
    assert found.before[0].shape == (32, 48, 3)
    # The sphere is red in each view, and fills what it is framed for.
    for picture in found.before:
        reddish = picture[..., 0] > picture[..., 1].astype(int) + 40
        assert 0.2 < reddish.mean() < 0.6


def test_errors_are_those_of_the_pixels_that_either_model_touches(tmp_path):
    models = [
        painted(color, tmp_path / f"{i}.glb")
        for i, color in enumerate([(0.5, 0.5, 0.5), (0.3, 0.5, 0.5)])
    ]
    options = RenderOptions(width=48, height=32, background=(0.0, 0.0, 0.0))
    found = compare_models(*models, n_views=3, options=options)
    assert len(found.views) == len(found.psnr_db) == 3
    total, count = 0, 0
    for before, after, error in zip(found.before, found.after, found.psnr_db, strict=True):
        seen = (before > 0).any(axis=2)
        apart = before[seen].astype(int) - after[seen]
        assert error == pytest.approx(10 * math.log10(255**2 / (apart**2).mean()))
        total, count = total + (apart**2).sum(), count + apart.size
    assert found.mean_db == pytest.approx(10 * math.log10(255**2 * count / total))
    assert found.worst_db == min(found.psnr_db) == found.psnr_db[found.worst_view]


def test_views_are_left_out_where_the_rest_cannot_help(tmp_path):
    models = [
        painted(color, tmp_path / f"{i}.glb")
        for i, color in enumerate([(0.5, 0.5, 0.5), (0.45, 0.5, 0.5)])
    ]
    whole = compare_models(*models, options=SMALL)
    few = compare_models(*models, options=SMALL, least_db=whole.mean_db + 12.0)
    assert len(few.views) == len(few.psnr_db) == len(few.before) == 1
    assert few.mean_db == few.psnr_db[0] == whole.psnr_db[0] < whole.mean_db + 12.0
    all_views = compare_models(*models, options=SMALL, least_db=whole.mean_db)
    assert all_views.psnr_db == whole.psnr_db


def test_other_formats_show_their_materials(tmp_path):
    """An OBJ file with an image for its roughness, and its GLB, packed as glTF has it."""
    from texbake.verbs.meshes import transform_file

    write_mesh(uv_sphere(8, 12), tmp_path / "a.obj")
    text = (tmp_path / "a.obj").read_text()
    (tmp_path / "a.obj").write_text(f"mtllib a.mtl\nusemtl a\n{text}")
    (tmp_path / "a.mtl").write_text("newmtl a\nKd 0.9 0.6 0.1\nPm 1\nmap_Pr r.png\n")
    codes = np.linspace(30, 200, 16 * 16 * 3).astype(np.uint8).reshape(16, 16, 3)
    (tmp_path / "r.png").write_bytes(b"".join(png_parts(codes)))
    transform_file(tmp_path / "a.obj", tmp_path / "a.glb")
    found = compare_models(tmp_path / "a.obj", tmp_path / "a.glb", n_views=2, options=SMALL)
    assert found.worst_db == math.inf
    (tmp_path / "a.mtl").write_text("newmtl a\nKd 0.9 0.6 0.1\nPm 1\nPr 1\n")
    found = compare_models(tmp_path / "a.obj", tmp_path / "a.glb", n_views=2, options=SMALL)
    assert found.worst_db < 40


def test_a_model_without_normals_is_hard_at_its_sharp_edges(tmp_path):
    """Whatever is made of it has hard normals there."""
    write_mesh(cube(), tmp_path / "a.obj")
    write_mesh(with_normals(cube(), "angle"), tmp_path / "a.glb")
    found = compare_models(tmp_path / "a.obj", tmp_path / "a.glb", n_views=2, options=SMALL)
    assert found.worst_db == math.inf


def test_white_models_share_an_exposure_in_which_they_do_not_clip(tmp_path):
    white, gray = (painted((v, v, v), tmp_path / f"{v}.glb") for v in (1.0, 0.97))
    found = compare_models(white, gray, n_views=2, options=SMALL)
    codes = [
        np.concatenate([picture.max(axis=2)[24] for picture in pictures]).astype(int)
        for pictures in (found.before, found.after)
    ]
    assert codes[0].max() < 255
    is_lit = codes[0] > 150
    assert is_lit.any() and (codes[0] > codes[1])[is_lit].all()


def test_images_without_texture_coordinates_are_left_out(tmp_path):
    mesh = cube().replace(uvs=None, uv_faces=None)
    write_mesh(mesh, tmp_path / "a.obj")
    text = (tmp_path / "a.obj").read_text()
    (tmp_path / "a.obj").write_text(f"mtllib a.mtl\nusemtl a\n{text}")
    (tmp_path / "a.mtl").write_text("newmtl a\nmap_Kd c.png\n")
    (tmp_path / "c.png").write_bytes(b"".join(png_parts(np.zeros((4, 4, 3), np.uint8))))
    assert len(model_scene(tmp_path / "a.obj").objects) == 1


def test_content_that_cannot_be_drawn_is_refused_or_named(tmp_path):
    model = painted((0.5, 0.5, 0.5), tmp_path / "a.glb")
    with pytest.raises(OptionError, match="n_views"):
        compare_models(model, model, n_views=0)
    image = ChannelImage(data=b"\xabKTX 20\xbb\r\n\x1a\n")
    source = ChannelSource(CHANNELS["base-color"].default, image)
    mesh = uv_sphere(4, 6)
    materials = Materials(
        face_materials=np.zeros(mesh.n_faces, np.int32),
        materials=(MeshMaterial(name="a", channels={"base-color": source}),),
    )
    write_mesh(mesh, tmp_path / "k.glb", materials=materials)
    with pytest.warns(ReadWarning, match="no image in a supported format"):
        compare_models(model, tmp_path / "k.glb", n_views=1)


PICTURE = RenderOptions(width=64, height=48)
FLAT = BumpMap(texture=ImageTexture(image=np.full((4, 4, 1), 0.5, np.float32)))
NOISE = ProcedureTexture(procedure="noise", scale=4.0)


def scene():
    """A ball over a floor: a shadow, ambient light, bumps on the ball and none on the floor."""
    floor = transform_matrix(scale=6.0, rotate=(-90, 0, 0), translate=(-3, -1, 3))
    ball = Material(shading="lambert", base_color=NOISE)
    return Scene(
        objects=(
            SceneObject(mesh=uv_sphere(16, 32), material=ball),
            SceneObject(
                mesh=plane(), material=Material(shading="lambert", bump_map=FLAT), transform=floor
            ),
        ),
        lighting=Lighting(
            lights=(Light(direction=(-0.5, -1.0, -0.3), shadow=Shadow(size=256)),),
            ambient=Ambient(color=(0.2, 0.2, 0.3)),
        ),
    )


def codes(of):
    frame = render_scene(of, PICTURE)
    return np.asarray(quantize_srgb(frame.color[..., :3], 8)).astype(int)


def test_pixels_that_change_are_those_of_pictures_with_and_without():
    given = scene()
    found = {item.name: item for item in
             contributions_of(given, PICTURE, render_scene(given, PICTURE))}  # fmt: skip
    lighting = given.lighting
    unshadowed = tuple(replace(light, shadow=None) for light in lighting.lights)
    plain = tuple(
        replace(item, material=replace(item.material, base_color=(0.8, 0.8, 0.8)))
        for item in given.objects
    )
    others = {
        "shadow maps": replace(given, lighting=replace(lighting, lights=unshadowed)),
        "ambient": replace(given, lighting=replace(lighting, ambient=Ambient())),
        "procedures": replace(given, objects=plain),
    }
    whole = codes(given)
    for name, other in others.items():
        difference = np.abs(whole - codes(other))
        item = found[name]
        assert item.pixels == difference.any(axis=2).sum() > 0
        assert item.largest == difference.max()
        assert item.share == item.pixels / (64 * 48)
        np.testing.assert_array_equal(item.difference, difference)
        assert item.milliseconds >= 0.0
    assert found["shadow maps"].n_bytes > 0
    assert (found["bump map"].pixels, found["images"].pixels) == (0, 0)


def test_the_page_shows_each_contribution(tmp_path):
    given = scene()
    frame = render_scene(given, PICTURE)
    found = contributions_of(given, PICTURE, frame)
    write_contributions_page(tmp_path / "page.html", "<b>ball", frame, found, "texbake preview")
    page = (tmp_path / "page.html").read_text()
    assert "&lt;b&gt;ball" in page and "<b>ball" not in page
    pictures = re.findall(r'<img src="data:image/png;base64,[^"]+"[^>]*alt="([^"]*)"', page)
    changed = [f"Contribution of {item.name}" for item in found if item.pixels]
    assert pictures == ["The picture", *changed]
    assert page.count("<strong>changed nothing</strong>") == 2


def test_the_command_prints_what_changes(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(
        "[fog]\nmode = 'exp'\ndensity = 0.2\n"
        "[[lights]]\nkind = 'directional'\ndirection = [0, -1, -1]\n"
        "[[objects]]\nshape = 'sphere'\n"
    )
    picture, page = tmp_path / "picture.png", tmp_path / "page.html"
    words = ["preview", str(path), "-o", str(picture), "--size", "64x48"]
    words += ["--explain", "changes", "--html", str(page), "--report", str(tmp_path / "r.json")]
    result = CliRunner().invoke(texbake, words)
    assert result.exit_code == 0, result.output
    assert re.search(r"effect +pixels changed", result.output)
    assert re.search(r"fog +[\d,]+ ", result.output)
    assert page.exists() and '"effects"' in (tmp_path / "r.json").read_text()
    result = CliRunner().invoke(texbake, [*words, "--filter", "nearest,bilinear"])
    assert result.exit_code == 2 and "contributions: they are those of one picture" in result.output
