"""Textures of one material on several sets of texture coordinates, with wrap modes of their own."""

from dataclasses import replace

import numpy as np
import pytest

from texbake.errors import TexbakeError, UvError
from texbake.mesh.files import write_mesh
from texbake.mesh.mesh import UvSet
from texbake.mesh.shapes import plane, uv_sphere
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render_scene
from texbake.rendering.scene.lights import Light, Lighting
from texbake.rendering.scene.material import BumpMap, Displacement, Material, NormalMap, Parallax
from texbake.rendering.scene.read import read_scene
from texbake.rendering.scene.scene import CameraView, Scene, SceneObject
from texbake.rendering.scene.textures import ImageTexture, ProcedureTexture
from texbake.texture.image import write_image
from texbake.texture.sample import FILTERS, sample_texture

NOISE = np.random.default_rng(4).random((16, 16, 3)).astype(np.float32)
VIEW = CameraView(position=(0.5, -0.8, 2.5), target=(0.1, 0.0, 0.0), fov=50.0)
OPTIONS = RenderOptions(width=48, height=40, supersampling=1, max_triangles=20_000)
LIGHTING = Lighting(lights=(Light(direction=(0.4, -0.3, -1.0)),))


def with_second(mesh, change):
    """A mesh with its coordinates, changed, as a further set, and seams where it had none."""
    corners = change(mesh.corner_uvs()).reshape(-1, 2)
    rows = np.arange(3 * mesh.n_faces, dtype=np.int32).reshape(-1, 3)
    return mesh.replace(uv_sets={"second": UvSet(corners, rows)})


def turned(uvs):
    return np.stack([1.0 - 2.5 * uvs[..., 1], 0.3 + 1.7 * uvs[..., 0]], axis=-1)


def picture(mesh, material, **options):
    scene = Scene(objects=(SceneObject(mesh=mesh, material=material),), view=VIEW,
                  lighting=LIGHTING)  # fmt: skip
    return render_scene(scene, replace(OPTIONS, **options)).color


def image(**fields):
    return ImageTexture(image=NOISE, wrap="repeat", **fields)


def heights(name):
    return ImageTexture(image=NOISE[..., :1], wrap="repeat", uv_set=name)


def checker(name):
    return ProcedureTexture(procedure="checker", space="uv", scale=8.0, uv_set=name)


def vectors(name):
    leaning = np.array([0.0, 0.0, 1.0]) + 0.2 * NOISE
    return ImageTexture(image=np.float32(leaning), wrap="repeat", uv_set=name)


# Materials whose picture depends on a set of texture coordinates, by its name.
READERS = {
    "image": lambda name: {"base_color": image(uv_set=name)},
    "filtered image": lambda name: {"base_color": image(uv_set=name, filter="ewa")},
    "number": lambda name: {"roughness": image(uv_set=name, channel=1), "metalness": 1.0},
    "opacity": lambda name: {"opacity": heights(name)},
    "procedure": lambda name: {"base_color": checker(name)},
    "normal map": lambda name: {"normal_map": NormalMap(texture=vectors(name), space="tangent")},
    "bump map": lambda name: {"bump_map": BumpMap(texture=heights(name), height=0.3)},
    "bumps of a procedure": lambda name: {"bump_map": BumpMap(texture=checker(name))},
    "emboss": lambda name: {"bump_map": BumpMap(texture=heights(name), form="emboss")},
    "parallax": lambda name: {
        "parallax": Parallax(texture=heights(name), depth=0.1), "base_color": image(uv_set=name),
    },
    "displacement": lambda name: {
        "displacement": Displacement(texture=heights(name), height=0.1, edge_px=8.0)
    },
    "vectors": lambda name: {
        "displacement": Displacement(texture=vectors(name), height=0.2, vector=True)
    },
    "cells": lambda name: {
        "displacement": Displacement(texture=checker(name), height=0.1, edge_px=8.0)
    },
    "vertex rate": lambda name: {"base_color": image(uv_set=name), "shading_rate": "vertex"},
}  # fmt: skip


@pytest.mark.parametrize("slots", READERS.values(), ids=READERS)
def test_a_set_looks_as_it_does_as_the_only_one(slots):
    mesh = with_second(uv_sphere(8, 16), turned)
    only = mesh.on_uv_set("second").replace(uv_sets={})
    expected = picture(only, Material(**slots(None)))
    assert expected.std() > 0.02
    np.testing.assert_array_equal(picture(mesh, Material(**slots("second"))), expected)
    # A mesh needs no first set for that.
    bare = mesh.replace(uvs=None, uv_faces=None)
    np.testing.assert_array_equal(picture(bare, Material(**slots("second"))), expected)


def test_slots_of_one_material_lie_on_sets_of_their_own():
    mesh = with_second(plane(4, 4), turned)
    other = mesh.on_uv_set("second").replace(uv_sets={})
    both = Material(base_color=image(), emission=image(uv_set="second"))
    first = picture(mesh, Material(base_color=image()))
    second = picture(other, Material(base_color=(0.0, 0.0, 0.0), emission=image()))
    black = picture(other, Material(base_color=(0.0, 0.0, 0.0)))
    seen = picture(mesh, both)
    np.testing.assert_allclose(seen[..., :3], first[..., :3] + (second - black)[..., :3], atol=2e-6)


def test_parallax_moves_the_coordinates_of_all_sets_to_the_same_place():
    """On a set that is an affine map of the first, the picture is that of a texture transform."""
    mesh = with_second(plane(2, 2), lambda uvs: uvs * (2.0, -3.0) + (0.25, 0.5))
    relief = Parallax(texture=heights(None), depth=0.1)
    seen = picture(mesh, Material(base_color=image(uv_set="second"), parallax=relief))
    placed = image(scale=(2.0, -3.0), offset=(0.25, 0.5))
    expected = picture(mesh, Material(base_color=placed, parallax=relief))
    np.testing.assert_allclose(seen, expected, atol=1e-4)
    assert np.abs(expected - picture(mesh, Material(base_color=placed))).max() > 0.1


@pytest.mark.parametrize("slots", [
    {"base_color": image(uv_set="TEXCOORD_0")},
    {"base_color": ProcedureTexture(procedure="checker", space="uv", uv_set="TEXCOORD_0")},
    {"normal_map": NormalMap(texture=image(uv_set="TEXCOORD_0"), space="tangent")},
])  # fmt: skip
def test_texcoord_0_is_the_first_set(slots):
    mesh = with_second(uv_sphere(8, 16), turned)
    ((name, holder),) = slots.items()
    unnamed = (
        replace(holder, texture=replace(holder.texture, uv_set=None))
        if name == "normal_map" else replace(holder, uv_set=None)
    )  # fmt: skip
    expected = picture(mesh, Material(**{name: unnamed}))
    np.testing.assert_array_equal(picture(mesh, Material(**slots)), expected)


def test_a_missing_set_is_named():
    with pytest.raises(UvError, match=r"has no UV set 'second'.*--uv-set second"):
        picture(plane(2, 2), Material(base_color=image(uv_set="second")))


@pytest.mark.parametrize("filter_name", FILTERS)
@pytest.mark.parametrize("wraps", [("repeat", "clamp"), ("clamp", "mirror"), ("mirror", "repeat"),
                                   ("border", "repeat"), ("clamp", "border")])  # fmt: skip
def test_wrap_modes_of_each_direction(filter_name, wraps):
    """Where one coordinate lies well inside the image, the other alone decides."""
    rng = np.random.default_rng(1)
    chosen = np.full(200, 0.5), rng.uniform(-2.3, 3.3, 200)
    changes = np.tile(np.array([[0.05, 0.0, 0.0, 0.05]], np.float32), (200, 1))
    for axis in range(2):
        uvs = np.stack(chosen if axis else chosen[::-1], axis=1)
        both, alone = (
            sample_texture(NOISE, uvs, changes, filter=filter_name, wrap=wrap, border=0.25)
            for wrap in (wraps, wraps[axis])
        )
        np.testing.assert_array_equal(both, alone)


def test_a_scene_file_names_the_set_and_two_wrap_modes(tmp_path):
    write_image(NOISE, tmp_path / "a.png", color=True)
    text = """
[[objects]]
mesh = "plane.obj"

[objects.material]
base_color = {image = "a.png", wrap = ["mirror", "clamp"]}
light_map = {image = "a.png", uv_set = "lightmap"}
"""
    file = tmp_path / "a.toml"
    write_mesh(plane(2, 2), tmp_path / "plane.obj")
    file.write_text(text)
    material = read_scene(file).objects[0].material
    assert material.base_color.wrap == ("mirror", "clamp")
    assert material.light_map.uv_set == "lightmap"
    for wrong, message in (('["mirror", "over"]', "over"), ('["mirror"]', "or two")):
        file.write_text(text.replace('["mirror", "clamp"]', wrong))
        with pytest.raises(TexbakeError, match=message):
            read_scene(file)
