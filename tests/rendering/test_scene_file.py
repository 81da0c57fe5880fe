"""Scene files: every key takes effect, and errors are reported in one line."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from texbake.errors import FileError, FileFormatError
from texbake.mesh.files import write_mesh
from texbake.mesh.shapes import cube, uv_sphere
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import plan_scene, render_scene
from texbake.rendering.scene.file.schema import TABLES
from texbake.rendering.scene.read import read_scene
from texbake.rendering.scene.scene import apply_mapping, camera_of
from texbake.rendering.scene.textures import ImageTexture, ProcedureTexture
from texbake.texture.image import write_image

BALL = '[[objects]]\nshape = "sphere"\nresolution = [8, 4]\n'


@pytest.fixture
def folder(tmp_path):
    write_image(np.full((2, 4, 3), 128, np.uint8), tmp_path / "gray.png")
    write_mesh(uv_sphere(4, 6), tmp_path / "ball.obj")
    (tmp_path / "matrix.txt").write_text("1 0 0 5\n0 1 0 0\n0 0 1 0\n0 0 0 1\n")
    return tmp_path


def read(folder, text):
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return read_scene(path)


def material(folder, text):
    return read(folder, f"{BALL}material = {{{text}}}").objects[0].material


def test_a_light_without_shadow_may_say_so(folder):
    light = '[[lights]]\nkind = "directional"\n'
    for text, casts in (("", False), ("shadow = false", False), ("shadow = true", True)):
        assert (
            read(folder, f"{light}{text}\n{BALL}").lighting.lights[0].shadow is not None
        ) == casts


def test_the_matrix_of_a_projector_may_have_three_rows(folder):
    """Without the row of r, which no picture is looked up by."""
    (folder / "three.txt").write_text("1 0 0 5\n0 1 0 0\n0 0 -1 2\n")
    expected = [[1, 0, 0, 5], [0, 1, 0, 0], [0, 0, -1, 2], [0, 0, -1, 2]]
    for matrix in (
        "[1, 0, 0, 5, 0, 1, 0, 0, 0, 0, -1, 2]",
        "[[1, 0, 0, 5], [0, 1, 0, 0], [0, 0, -1, 2]]",
        '"three.txt"',
    ):
        text = f'projected = [{{texture = "gray.png", matrix = {matrix}}}]'
        np.testing.assert_array_equal(material(folder, text).projected[0].matrix, expected)


def test_a_scene_is_drawn_as_its_render_table_says_unless_options_are_given(folder):
    table = '[render]\nwidth = 24\nheight = 10\nsupersampling = 1\nbackground = "#000000"\n'
    scene = read(folder, BALL + table)
    for found in render_scene(scene), draw(prepare(scene), camera_of(scene, scene.options())):
        assert found.color.shape == (10, 24, 4)
        np.testing.assert_array_equal(found.color[0, 0], [0.0, 0.0, 0.0, 1.0])
    buffered = read(folder, BALL + '[render]\nbuffer = "depth"\n')
    assert plan_scene(buffered).has("buffer") and not plan_scene(buffered, RenderOptions()).has(
        "buffer"
    )
    assert render_scene(scene, RenderOptions(width=16, height=12)).color.shape == (12, 16, 4)
    assert render_scene(scene, scene.options(width=16)).color.shape == (10, 16, 4)


def test_everything_that_a_file_says_is_there(folder):
    scene = read(folder, '''
        name = "all of it"
        [camera]
        position = [1, 2, 3]
        target = [0, 0, 0]
        fov = 50
        [render]
        width = 64
        height = 32
        background = "transparent"
        supersampling = 3
        [ambient]
        color = "#ffffff"
        ground = [0.1, 0.2, 0.3]
        [environment]
        image = "gray.png"
        lighting = true
        [fog]
        mode = "linear"
        end = 20
        [ambient_occlusion]
        samples = 8
        [[lights]]
        kind = "directional"
        shadow = true
        [[lights]]
        kind = "spot"
        name = "lamp"
        position = [0, 3, 0]
        target = [1, 1, 0]
        shadow = {size = 256}
        profile = "gray.png"
        [materials.red]
        base_color = "#f00"
        [[objects]]
        mesh = "ball.obj"
        material = "red"
        casts_shadows = false
    ''')  # fmt: skip
    assert (scene.name, scene.view.position) == ("all of it", (1, 2, 3))
    assert scene.view.fov == 50
    assert scene.options() == RenderOptions(width=64, height=32, background=None, supersampling=3)
    assert scene.options(width=8).width == 8
    lighting = scene.lighting
    assert lighting.ambient.color == pytest.approx((1, 1, 1))
    assert lighting.ambient.ground == (0.1, 0.2, 0.3)
    assert lighting.environment.image == folder / "gray.png"
    assert lighting.environment.lighting
    assert (lighting.fog.mode, lighting.fog.end) == ("linear", 20)
    assert lighting.occlusion.samples == 8
    sun, lamp = lighting.lights
    assert (sun.name, sun.shadow.size, lamp.name, lamp.shadow.size) == (
        "directional 1", 1024, "lamp", 256,
    )  # fmt: skip
    assert lamp.direction == (1, -2, 0)
    assert lamp.profile.image == folder / "gray.png"
    (ball,) = scene.objects
    assert (ball.name, ball.material.name, ball.casts_shadows) == ("ball", "red", False)
    assert ball.material.base_color == (1, 0, 0)
    assert ball.mesh.n_faces == uv_sphere(4, 6).n_faces


def test_hexadecimal_colors_are_srgb_and_lists_are_linear(folder):
    # 0x80 / 255 by the formula of IEC 61966-2-1.
    half = ((128 / 255 + 0.055) / 1.055) ** 2.4
    assert material(folder, 'base_color = "#808080"').base_color == pytest.approx((half,) * 3)
    assert material(folder, "base_color = [0.5, 0.25, 2]").base_color == (0.5, 0.25, 2)
    background = read(folder, BALL + '[render]\nbackground = "#204080"').options().background
    assert background == pytest.approx((32 / 255, 64 / 255, 128 / 255), abs=1e-6)


def test_slots_hold_constants_images_and_procedures(folder):
    made = material(
        folder,
        'roughness = {image = "gray.png", channel = "g", filter = "ewa", scale = 3},'
        'base_color = {procedure = "marble", seed = 4, scale = 2, colors = ["#000", "#fff"]},'
        'normal_map = "gray.png", metalness = 1, exponent = 1e4, reflection = 0.25,'
        'bump_map = {texture = {procedure = "noise"}, height = 0.1}',
    )
    image = made.roughness
    assert isinstance(image, ImageTexture)
    assert (image.channel, image.filter, image.scale) == (1, "ewa", (3, 3))
    marble = made.base_color
    assert isinstance(marble, ProcedureTexture)
    assert (marble.parameters, marble.scale) == ({"seed": 4}, (2, 2, 2))
    assert marble.colors == ((0, 0, 0), (1, 1, 1))
    assert made.normal_map.texture.image == folder / "gray.png"
    assert (made.normal_map.strength, made.bump_map.texture.procedure) == (1, "noise")
    assert made.reflection.strength == (0.25, 0.25, 0.25)
    assert (made.metalness, made.exponent) == (1, 1e4)


def test_what_is_not_written_is_as_the_classes_have_it(folder):
    from texbake.rendering.scene.lights import Ambient, Lighting
    from texbake.rendering.scene.material import Material

    scene = read(folder, BALL)
    assert scene.view is None
    assert scene.options() == RenderOptions()
    assert scene.lighting.ambient == Ambient()
    assert (scene.lighting.lights, scene.lighting.fog) == (Lighting().lights, None)
    assert vars(scene.objects[0].material) == vars(Material(name="sphere"))
    assert scene.objects[0].transform is None


def test_transforms(folder):
    def transform(text):
        return read(folder, BALL + text).objects[0].transform

    # Turned about x first, then y, then z: (0, 0, 1) goes to (0, -1, 0), stays, goes to (1, 0, 0).
    turned = transform("rotate = [90, 0, 90]") @ [0, 0, 1, 1]
    np.testing.assert_array_equal(turned, [1, 0, 0, 1])
    everything = transform("scale = [2, 3, 4]\nrotate = [0, 0, 90]\ntranslate = [10, 20, 30]")
    np.testing.assert_array_equal(everything @ [1, 1, 1, 1], [7, 22, 34, 1])
    rows = "1, 0, 0, 5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1"
    for matrix in f"[{rows}]", '"matrix.txt"':
        np.testing.assert_array_equal(transform(f"matrix = {matrix}") @ [0, 0, 0, 1], [5, 0, 0, 1])
    far = transform("translate = [1e9, -1e9, 1e9]")
    np.testing.assert_array_equal(far[:3, 3], [1e9, -1e9, 1e9])


def test_a_mapping_gives_coordinates(folder):
    box = '[[objects]]\nshape = "cube"\n'
    assert read(folder, box).objects[0].mesh.uvs is None
    found = read(folder, f'{box}mapping = {{method = "planar", axis = "y", scale = [2, 3]}}')
    uvs = apply_mapping(found.objects[0]).mesh.uvs
    np.testing.assert_allclose(uvs.max(axis=0) - uvs.min(axis=0), [2, 3], atol=1e-12)
    (item,) = read(folder, f'{box}mapping = "spherical"').objects
    assert item.mapping.method == "spherical" and apply_mapping(item).mesh.uvs is not None


def test_shapes(folder):
    def mesh(text):
        return read(folder, f"[[objects]]\n{text}").objects[0].mesh

    assert mesh('shape = "cube"').n_faces == cube().n_faces
    assert mesh('shape = "icosphere"\nlevel = 2').n_faces == 20 * 4**2
    assert mesh('shape = "torus"\nresolution = [8, 6]\nminor_radius = 0.3').n_faces == 96
    # A picture of 4 x 2 pixels: a vertex each.
    assert mesh('shape = "height-field"\nimage = "gray.png"').n_vertices == 8


def test_a_cube_has_flat_sides(folder):
    (item,) = read(folder, "[[objects]]\nshape = 'cube'").objects
    corners = item.mesh.positions[item.mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = item.mesh.normals[item.mesh.normal_faces]
    assert np.array_equal(normals, np.repeat(across[:, None], 3, axis=1))


def test_the_studio_is_an_environment_without_a_file(folder):
    text = "[environment]\nimage = 'studio'\n[[objects]]\nshape = 'cube'"
    assert read(folder, text).lighting.environment.image == "studio"


def test_a_mesh_of_two_objects_is_read_once_and_names_differ(folder):
    plane = '[[objects]]\nshape = "plane"\n'
    objects = read(folder, '[[objects]]\nmesh = "ball.obj"\n' * 3 + plane).objects
    assert objects[0].mesh is objects[1].mesh is objects[2].mesh
    assert [item.name for item in objects] == ["ball", "ball 2", "ball 3", "plane"]


def test_projectors(folder):
    text = (
        'projected = [{texture = "gray.png", position = [0, 0, 4], target = [0, 0, 0], fov = 90},'
        '{texture = "gray.png", matrix = "matrix.txt", strength = 0.5}]'
    )
    slide, other = material(folder, text).projected
    # 90 degrees high at distance 4: from -4 to 4; the picture is twice as wide as high.
    for point, place in ((0, 0), (0.5, 0.5)), ((8, 4), (1, 1)), ((-8, -4), (0, 0)):
        s, t, _, q = slide.world_matrix @ [*point, 0, 1]
        np.testing.assert_allclose([s / q, t / q], place, atol=1e-12)
    assert (slide.world_matrix @ [0, 0, 5, 1])[3] == pytest.approx(-1)  # behind it
    assert (other.matrix[0, 3], other.strength) == (5, 0.5)


def test_a_gltf_file_brings_its_own_materials(folder):
    write_mesh(uv_sphere(4, 6), folder / "box.glb", base_color=folder / "gray.png")
    moved = read(folder, '[[objects]]\nmesh = "box.glb"\ntranslate = [0, 5, 0]\nvisible = false')
    (item,) = moved.objects
    np.testing.assert_array_equal(item.transform[:3, 3], [0, 5, 0])
    assert isinstance(item.material.base_color, ImageTexture) and not item.visible
    other = read(folder, '[[objects]]\nmesh = "box.glb"\nmaterial = {roughness = 1}').objects[0]
    assert other.material.base_color == (0.8, 0.8, 0.8)


@pytest.mark.parametrize(("text", "message"), [
    ("x = ", "it is not TOML: Invalid value (at end of document)"),
    ("[camra]\nfov = 3\n" + BALL, "camra: unknown key; did you mean 'camera'?"),
    (BALL + "[bloom]", "bloom: unknown key; known: name, camera, render, ambient, "
     "environment, fog, ambient_occlusion, lights, materials, objects"),
    ("objects = []", "objects: it is empty; a scene needs at least one object"),
    ("objects = 3", "objects: 3 is not a list; give one in brackets"),
    ("[camera]\nfov = 30", "objects: it is missing; it must be given"),
    (BALL + "material = 3", "objects[0].material: 3 is not a table; its keys are shading"),
])  # fmt: skip
def test_wrong_files(folder, text, message):
    with pytest.raises(FileFormatError) as caught:
        read(folder, text)
    assert str(caught.value).startswith(f"{folder / 'scene.toml'}: {message}")


# Texts of files, and what is said of them.
WRONG = [
    *((BALL + text, message) for text, message in [
        ("[camera]\nfov = 'wide'", "camera.fov: 'wide' is not a number; give one such as 0.5"),
        ("[camera]\nfov = 0", "camera.fov: 0.0 is out of range; it must be above 0 and below 180"),
        ("[camera]\nposition = [0, 0, 1]",
         "camera: position and target belong together; give both or neither"),
        ("[camera]\nposition = [1, 1, 1]\ntarget = [1, 1, 1]",
         "camera.position: it is the same as the target; move one of them"),
        ("[camera]\nview = [1]",
         "camera.view: [1] is neither [azimuth, elevation] nor [azimuth, elevation, distance]"),
        ("[render]\nwidth = 1.5", "render.width: 1.5 is not a whole number; give one such as 4"),
        ("[render]\nbackground = 'blue'", "render.background: 'blue' is not a color; write "
         "'#rrggbb', or a list of three linear numbers"),
        ("[fog]\nmode = 'lineal'",
         "fog.mode: 'lineal' is not one of linear, exp, exp2; did you mean 'linear'?"),
        ("[ambient]\ncolor = [-1, 0, 0]",
         "ambient.color: [-1, 0, 0] is not a color; its numbers must be 0 or more"),
    ]),
    *((f"{BALL}[[lights]]\n{text}", f"lights[0].{message}") for text, message in [
        ("intensity = 1", "kind: it is missing; it must be given"),
        ("kind = 'point'", "position: it is missing; a point light needs one"),
        ("kind = 'point'\nposition = [0, 1, 0]\nangle = 3",
         "angle: a point light does not use it; leave it out"),
        ("kind = 'directional'\nintensity = true",
         "intensity: true is not a number; give one such as 0.5"),
    ]),
    *((f"{BALL}material = {{{text}}}", f"objects[0].material.{message}") for text, message in [
        ("roughness = 'shiny'", "roughness: 'shiny' is not a number; give one from 0 to 1, "
         "an image or a procedure"),
        ("roughness = 2", "roughness: 2 is out of range; give one from 0 to 1, "
         "an image or a procedure"),
        ("base_color = 'none.png'",
         "base_color.image: {folder}/none.png: there is no such file; check its name"),
        ("base_color = {image = ''}", "base_color.image: '' is not a file name"),
        ("base_color = {image = 3}", "base_color.image: 3 is not a file name"),
        ("base_color = {filter = 'ewa'}", "base_color.image: it is missing; it must be given"),
        ("base_color = [1, 2]", "base_color: [1, 2] is not a color; give a number, [r, g, b] "
         "(linear), '#rrggbb' (sRGB), an image or a procedure"),
        ("base_color = {procedure = 'marble', sed = 1}",
         "base_color.sed: unknown key of marble; did you mean 'seed'?"),
        ("base_color = {procedure = 'marble', seed = 'x'}",
         "base_color.seed: 'x' is not a whole number; give one such as 7"),
        ("projected = [{texture = 'gray.png'}]",
         "projected[0].position: it is missing; give position and target, or a matrix"),
    ]),
    *((f"[[objects]]\n{text}", f"objects[0].{message}") for text, message in [
        ("name = 'x'", "mesh: it is missing; give mesh = 'FILE' or shape = 'NAME'"),
        ("mesh = 'no.obj'", "mesh: {folder}/no.obj: there is no such file; check its name"),
        ("mesh = 'ball.obj'\nshape = 'cube'", "shape: it conflicts with the mesh; give only one"),
        ("mesh = 'ball.obj'\nradius = 2",
         "radius: it belongs to a shape, and this object has a mesh"),
        ("shape = 'sphere'\nminor_radius = 3", "minor_radius: the shape sphere does not use it"),
        ("shape = 'cube'\nmapping = {method = 'spherical', padding = 1}",
         "mapping.padding: the method spherical does not use it"),
        ("shape = 'cube'\nscale = 0",
         "scale: it is singular and flattens the object; stretch none by 0"),
        ("shape = 'cube'\nmatrix = [1, 2]",
         "matrix: [1, 2] is neither 16 numbers, row by row, nor a file of them"),
        ("shape = 'cube'\nmatrix = 'matrix.txt'\nscale = 2",
         "scale: it conflicts with the matrix; give only one"),
        ("shape = 'cube'\nmaterial = 'red'",
         "material: there is no 'red'; the file has no [materials.NAME]"),
        ("shape = 'cube'\nmaterial = 'rde'\n[materials.red]",
         "material: there is no 'rde'; did you mean 'red'?"),
        ("shape = 'cube'\ncasts_shadows = 1", "casts_shadows: 1 is neither true nor false"),
    ]),
]  # fmt: skip


@pytest.mark.parametrize(("text", "message"), WRONG)
def test_what_is_wrong_is_one_line(folder, text, message):
    with pytest.raises(FileFormatError) as caught:
        read(folder, text)
    line = message.replace("{folder}", str(folder))
    assert str(caught.value) == f"{folder / 'scene.toml'}: {line}"


@pytest.mark.parametrize("name", TABLES)
def test_only_a_shadow_is_switched_on_and_every_table_names_its_keys(name):
    """`true` stands for a shadow with its defaults alone, and unknown keys are of no table."""
    model = TABLES[name]
    if name == "shadow":
        assert model.model_validate(True).set_values() == {}
    else:
        with pytest.raises(ValidationError):
            model.model_validate(True)
    with pytest.raises(ValidationError, match=r"unknown key|is missing"):
        model.model_validate({"nonsense": 1})


def test_a_file_that_is_no_scene(tmp_path):
    with pytest.raises(FileError, match="there is no such file"):
        read_scene(tmp_path / "none.toml")
    path = tmp_path / "scene.yaml"
    path.write_text("a: 1")
    with pytest.raises(FileFormatError, match=r"'\.yaml' is not a suffix of scene files"):
        read_scene(path)
    path = tmp_path / "scene.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileFormatError, match="it is not text in UTF-8"):
        read_scene(path)


@pytest.mark.parametrize(("objects", "n_made"), [
    ('shape = "sphere"\nresolution = [1000, 2000]', 1),
    ('shape = "icosphere"\nlevel = 8', 4),
    ('shape = "orange"\nn_triangles = 2_500_000', 2),
    ('shape = "cylinder"\nsides = 2_500_000', 1),
    ('shape = "plane"\nresolution = [1000, 1500]', 2),  # together exactly 6,000,000
])  # fmt: skip
def test_too_many_triangles_of_shapes_are_refused(tmp_path, monkeypatch, objects, n_made):
    made = []
    monkeypatch.setattr(
        "texbake.rendering.scene.file.objects._make_shape",
        lambda shape, options: made.append(shape) or cube(),
    )
    path = tmp_path / "many.toml"
    path.write_text(f"[[objects]]\n{objects}\n" * 9)
    with pytest.raises(FileFormatError, match=r"objects\[\d\].shape: .* 6,000,000 are the most"):
        read_scene(path)
    assert len(made) == n_made


# The documentation of scene files matches the keys that the reader accepts.
PAGE = (Path(__file__).parents[2] / "docs" / "reference" / "scenes.md").read_text(encoding="utf-8")


def section(heading):
    found = re.search(rf"^#+ {re.escape(heading)}\n(.*?)(?=^#|\Z)", PAGE, re.M | re.S | re.I)
    assert found, f"no section {heading!r}"
    return found[1]


def test_the_example_is_read(tmp_path):
    example = re.search(r"```toml\n(.*?)```", PAGE, re.S)[1]
    path = tmp_path / "scene.toml"
    path.write_text(example)
    scene = read_scene(path)
    assert [item.name for item in scene.objects] == ["sphere", "plane"]
    assert scene.objects[0].material.bump_map.height == 0.01
    assert set(tomllib.loads(example)) <= set(TABLES["the file"].keys())


def test_extensions_on_the_page_are_those_that_are_shown():
    from texbake.rendering.scene.gltf import SHOWN

    row = next(line for line in section("glTF").splitlines() if line.startswith("| extensions"))
    assert set(re.findall(r"[A-Z]{3,4}_\w+", row)) == set(SHOWN) - {"KHR_xmp_json_ld"}
