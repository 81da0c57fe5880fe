"""Variants of materials and images of extensions, through every job that writes a GLB file."""

from dataclasses import replace

import numpy as np
import pytest

from tests.glb import glb_bytes, read_glb
from tests.jobs.test_lighten import OPTIONS, picture, pixels_of
from texbake.errors import OptionError, heard_warnings
from texbake.jobs.lighten_options import LightenOptions
from texbake.mesh.compose import join_meshes
from texbake.mesh.files import read_mesh
from texbake.mesh.files.gltf_write import write_glb
from texbake.mesh.materials import (
    ChannelImage,
    ChannelSource,
    Materials,
    MeshMaterial,
    read_materials,
)
from texbake.mesh.options import RepairOptions, SimplifyOptions, TransformOptions
from texbake.mesh.shapes import uv_sphere
from texbake.texture.model_materials import read_materials as read_shown
from texbake.verbs.meshes import repair_file, transform_file
from texbake.verbs.simplify import simplify_file
from texbake.verbs.unwrap import unwrap_files
from texbake.verbs.whole_jobs import lighten_file

LEATHER, RUBBER, CANVAS, GOLD = (0.8, 0.1, 0.1), (0.1, 0.1, 0.1), (0.2, 0.3, 0.9), (0.9, 0.8, 0.1)
# Colors of the upper and of the sole: by default, and in each variant.
COLORS = {None: (LEATHER, RUBBER), "summer": (CANVAS, RUBBER), "gold": (GOLD, GOLD)}


def plain(name, color, **fields):
    return MeshMaterial(name=name, channels={"base-color": ChannelSource(color)}, **fields)


@pytest.fixture
def shoe(tmp_path):
    """A shoe of two balls, an upper and a sole, whose upper is painted in one variant."""
    ball = uv_sphere(24, 48)
    mesh = join_meshes([ball, ball.replace(positions=ball.positions + np.array([3.0, 0.0, 0.0]))])
    image = picture(tmp_path, "white.png", np.full((8, 8, 3), 255, np.uint8))
    materials = Materials(
        face_materials=np.repeat(np.array([0, 1], np.int32), ball.n_faces),
        materials=(
            plain("leather", LEATHER),
            plain("rubber", RUBBER, is_double_sided=True),
            MeshMaterial(
                name="canvas",
                channels={
                    "base-color": ChannelSource(CANVAS, image), "roughness": ChannelSource((0.2,)),
                },
                alpha_mode="mask",
            ),
            plain("gold", GOLD),
        ),
        variants=(("summer", (2, 1, 2, 3)), ("gold", (3, 3, 2, 3))),
    )  # fmt: skip
    write_glb(mesh, tmp_path / "shoe.glb", materials=materials)
    return tmp_path / "shoe.glb"


def shown_colors(path):
    """Base colors of the upper and the sole, by default and in each variant, at one face each."""
    mesh = read_mesh(path)
    materials = read_materials(path, mesh)
    centers = mesh.positions[mesh.faces].mean(axis=1)[:, 0] / np.ptp(mesh.positions[:, 0])
    faces = [int(centers.argmin()), int(centers.argmax())]
    found = {}
    for number, name in enumerate([None, *(name for name, _ in materials.variants)]):
        shown = materials.in_variant(number - 1 if number else None)
        colors = []
        for face in faces:
            source = shown.materials[shown.face_materials[face]].channels["base-color"]
            color = source.factor
            if source.image is not None:
                u, v = mesh.corner_uvs()[face].mean(axis=0)
                pixels = pixels_of(source, is_color=True)
                row, column = (1 - v) % 1 * len(pixels), u % 1 * len(pixels)
                color = pixels[int(row), int(column)]
            colors.append(color)
        found[name] = colors
    return found


@pytest.mark.parametrize(
    "job",
    [
        lambda a, b: transform_file(a, b, TransformOptions()),
        lambda a, b: transform_file(a, b, TransformOptions(scale=2.0, subdivide=1)),
        lambda a, b: repair_file(a, b, RepairOptions()),
        lambda a, b: simplify_file(a, b, SimplifyOptions(n_faces=500)),
        lambda a, b: unwrap_files([a], [b]),
        lambda a, b: lighten_file(a, b, LightenOptions(n_faces=900, uvs="keep", views=0)),
        lambda a, b: lighten_file(a, b, LightenOptions(n_faces=900, images="png", views=0)),
        lambda a, b: lighten_file(a, b, OPTIONS),
    ],
    ids=["convert", "transform", "repair", "simplify", "unwrap", "keep", "auto", "new"],
)
def test_variants_go_through(shoe, tmp_path, job):
    with heard_warnings(lambda line: pytest.fail(line)):
        result = job(shoe, tmp_path / "b.glb")
    lines = getattr(result, "warnings", ())
    assert not any("material variants" in line for line in lines)
    found = shown_colors(tmp_path / "b.glb")
    assert list(found) == list(COLORS)
    for name, colors in COLORS.items():
        np.testing.assert_allclose(found[name], colors, atol=0.02)
    document, _ = read_glb(tmp_path / "b.glb")
    names = [material["name"] for material in document["materials"]]
    assert len(names) == len(set(names))
    assert "KHR_materials_variants" in document["extensionsUsed"]


def test_the_modes_of_variants_are_those_of_their_materials(shoe, tmp_path):
    lighten_file(shoe, tmp_path / "b.glb", OPTIONS)
    mesh = read_mesh(tmp_path / "b.glb")
    materials = read_materials(tmp_path / "b.glb", mesh)
    modes = [{item.alpha_mode for item in materials.in_variant(n).materials} for n in (None, 0, 1)]
    assert modes == [{"opaque"}, {"mask", "opaque"}, {"opaque"}]
    # What the variant shares with the default shares its image.
    first, second = (materials.in_variant(n).materials for n in (None, 0))
    roughness = {item.channels["roughness"].image is None for item in (*first, *second)}
    assert roughness == {True, False}


def test_bakes_and_pictures_see_only_what_is_shown_without_a_variant(shoe):
    mesh = read_mesh(shoe)
    assert read_shown(shoe, mesh).names == ("leather", "rubber")
    assert len(read_shown(shoe, mesh, variants=True).variants) == 2


def test_an_obj_file_has_no_variants(shoe, tmp_path):
    (line,) = transform_file(shoe, tmp_path / "b.obj").warnings
    assert "material variants" in line
    assert (tmp_path / "b.mtl").read_text().count("newmtl") == 2


def test_many_variants_are_not_baked(shoe, tmp_path):
    mesh = read_mesh(shoe)
    materials = read_materials(shoe, mesh)
    many = replace(materials, variants=9 * materials.variants[:1])
    write_glb(mesh, shoe, materials=many)
    with pytest.raises(OptionError, match=r"9 variants.*use keep"):
        lighten_file(shoe, tmp_path / "b.glb", OPTIONS)
    options = LightenOptions(n_faces=4, images="png", views=0)  # fewer than its charts need
    result = lighten_file(shoe, tmp_path / "b.glb", options)
    assert any("because of its many variants" in line for line in result.warnings)
    assert len(read_materials(tmp_path / "b.glb", read_mesh(tmp_path / "b.glb")).variants) == 9


@pytest.mark.parametrize("is_split", [False, True])
@pytest.mark.parametrize("uvs", ["auto", "keep", "new"])
def test_variants_that_only_have_other_colors_may_be_many(shoe, tmp_path, uvs, is_split):
    """One material of one color in each variant; or two, which take turns."""
    mesh = read_mesh(shoe)
    n = 10
    materials = Materials(
        face_materials=np.repeat(np.array([0, is_split], np.int32), mesh.n_faces // 2),
        materials=tuple(plain(str(k), (k / n, 0.5, 0.5)) for k in range(n + 1)),
        variants=tuple(
            (f"v{k}", tuple((k + i) % (n + 1) for i in range(n + 1))) for k in range(1, n + 1)
        ),
    )
    write_glb(mesh, shoe, materials=materials)
    options = LightenOptions(n_faces=900, uvs=uvs, images="png", size=128, views=0)
    if uvs == ("new" if is_split else "keep"):
        with pytest.raises(OptionError, match="use keep" if is_split else "use new"):
            lighten_file(shoe, tmp_path / "b.glb", options)
        return
    lighten_file(shoe, tmp_path / "b.glb", options)
    low = read_mesh(tmp_path / "b.glb")
    assert low.n_faces <= 900
    made = read_materials(tmp_path / "b.glb", low)
    for k in range(n):
        shown = made.in_variant(k)
        colors = [item.channels["base-color"].factor[0] for item in shown.materials]
        expected = {(k + 1) % (n + 1), (k + 1 + is_split) % (n + 1)}
        np.testing.assert_allclose(
            sorted(set(colors)), [i / n for i in sorted(expected)], atol=1e-6
        )


@pytest.mark.parametrize(
    ("owner", "content"),
    [
        (0, {"variants": 3}),
        (0, {"variants": [{}, {"name": 4}]}),
        (1, {"mappings": 3}),
        (1, {"mappings": [{"material": 99, "variants": [0]}]}),
        (1, {"mappings": [{"material": 1, "variants": [7, -1]}]}),
        (1, {"mappings": [{"variants": [0]}, {"material": True, "variants": "x"}]}),
    ],
)
def test_damaged_variants_leave_the_other_materials(shoe, owner, content):
    document, data = read_glb(shoe)
    holder = document if owner == 0 else document["meshes"][0]["primitives"][0]
    holder["extensions"]["KHR_materials_variants"] = content
    shoe.write_bytes(glb_bytes(document, data))
    lines = []
    with heard_warnings(lines.append):
        mesh = read_mesh(shoe)
        materials = read_materials(shoe, mesh)
    assert materials.in_variant(None).names == ("leather", "rubber")
    for number in range(len(materials.variants)):
        assert materials.in_variant(number).face_materials.shape == (mesh.n_faces,)


def test_images_of_extensions_are_baked_onto_new_coordinates(tmp_path):
    """The right half of a ball is twice as thick as the left one, which is iridescent."""
    codes = np.zeros((64, 64, 3), np.uint8)
    codes[:, :32] = 200, 100, 50
    codes[:, 32:] = 0, 200, 50
    image = picture(tmp_path, "a.png", codes)
    glass = MeshMaterial(
        name="glass",
        extensions={
            "KHR_materials_volume": {"thicknessFactor": 2.0, "thicknessTexture": image},
            "KHR_materials_iridescence": {"iridescenceFactor": 0.5, "iridescenceTexture": image},
            "KHR_materials_anisotropy": {"anisotropyStrength": 0.5, "anisotropyTexture": image},
        },
    )
    ball = uv_sphere(32, 64)
    materials = Materials(face_materials=np.zeros(ball.n_faces, np.int32), materials=(glass,))
    write_glb(ball, tmp_path / "a.glb", materials=materials)
    options = replace(OPTIONS, quantize=False)
    result = lighten_file(tmp_path / "a.glb", tmp_path / "b.glb", options)
    assert [line for line in result.warnings if "anisotropyTexture left out" in line]
    mesh = read_mesh(tmp_path / "b.glb")
    (made,) = read_materials(tmp_path / "b.glb", mesh).materials
    volume = made.extensions["KHR_materials_volume"]
    iridescence = made.extensions["KHR_materials_iridescence"]
    assert volume["thicknessFactor"] == pytest.approx(2.0)
    assert made.extensions["KHR_materials_anisotropy"] == {"anisotropyStrength": 0.5}
    u, v = mesh.corner_uvs().mean(axis=1).T
    at = mesh.positions[mesh.faces].mean(axis=1)
    is_left = at[:, 1] < -0.1, at[:, 1] > 0.1
    for image, component, values in (
        (volume["thicknessTexture"], 1, (100, 200)),
        (iridescence["iridescenceTexture"], 0, (200, 0)),
    ):
        assert isinstance(image, ChannelImage)
        pixels = pixels_of(ChannelSource((1.0, 1.0, 1.0), image), is_color=False)[..., component]
        n = len(pixels)
        found = 255 * pixels[((1 - v) * n).astype(int), (u * n).astype(int)]
        medians = sorted(float(np.median(found[side])) for side in is_left)
        np.testing.assert_allclose(medians, sorted(values), atol=2)


def test_opaque_parts_do_not_transmit_light_beside_glass(tmp_path):
    ball = uv_sphere(24, 48)
    mesh = join_meshes([ball, ball.replace(positions=0.5 * ball.positions)])
    glass = MeshMaterial(name="glass", channels={"transmission": ChannelSource((0.9,))})
    materials = Materials(
        face_materials=np.repeat(np.array([0, 1], np.int32), ball.n_faces),
        materials=(glass, plain("wax", GOLD)),
    )
    write_glb(mesh, tmp_path / "a.glb", materials=materials)
    lighten_file(tmp_path / "a.glb", tmp_path / "b.glb", OPTIONS)
    mesh = read_mesh(tmp_path / "b.glb")
    found = read_materials(tmp_path / "b.glb", mesh)
    is_inner = np.abs(mesh.positions[mesh.faces]).max(axis=(1, 2)) < 0.6
    transmits = np.array(["transmission" in item.channels for item in found.materials])
    assert (transmits[found.face_materials] == ~is_inner).all()
