"""`texbake preview` of scenes: the plan that it prints, pictures side by side and turntables."""

import json

import numpy as np
import pytest

from texbake import read_image, read_scene, render_scene, write_image, write_mesh
from texbake.mesh.shapes import plane, uv_sphere
from texbake.rendering.render import plan_scene

SCENE = """
[render]
width = 64
height = 48

[camera]
view = [20, 15]

[[lights]]
name = "key"
kind = "directional"
direction = [-1, -1, -1]

[materials.checked]
shading = "lambert"
base_color = { procedure = "checker", space = "uv", scale = 8.0 }

[[objects]]
name = "ball"
mesh = "ball.obj"
material = "checked"
"""


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """A current folder with a scene of a ball in it."""
    write_mesh(uv_sphere(12, 24), tmp_path / "ball.obj")
    (tmp_path / "ball.toml").write_text(SCENE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def pixels(path):
    return read_image(path, color=True).pixels


def test_a_scene_is_drawn_as_the_api_draws_it(invoke, scene):
    invoke("preview ball.toml -o ball.exr")
    read = read_scene("ball.toml")
    frame = render_scene(read, read.options())
    assert pixels("ball.exr").shape == (48, 64, 3)
    # Half floats: 11 bits.
    np.testing.assert_allclose(pixels("ball.exr"), frame.color[..., :3], rtol=6e-4, atol=1e-6)


def test_a_normal_map_in_object_space_is_noticed_and_drawn(invoke, scene):
    # A sphere's own normals: the picture is that of the sphere without a map.
    invoke("preview ball.obj -o plain.exr --size 64x48")
    invoke("bake-normals ball.obj ball.obj -o known.png --size 256 --space object")
    write_image(read_image("known.png", color=False).pixels, "normal.png")
    wrong = invoke("preview ball.obj -o wrong.exr --size 64x48 --normal-map normal.png")
    assert "normal.png: its normals point in all directions" in wrong.stderr
    assert "--space object" in wrong.stderr
    for line in ("--normal-map normal.png --space object", "--normal-map known.png"):
        right = invoke(f"preview ball.obj -o right.exr --size 64x48 {line}")
        assert right.stderr == ""
        assert np.abs(pixels("right.exr") - pixels("plain.exr")).mean() < 2e-3
    assert np.abs(pixels("wrong.exr") - pixels("plain.exr")).mean() > 2e-2


def test_a_normal_map_in_tangent_space_is_not_suspected(invoke, scene):
    write_image(np.full((8, 8, 3), (0.9, 0.5, 0.6), np.float32), "steep.png")
    assert invoke("preview ball.obj -o a.png --size 32x24 --normal-map steep.png").stderr == ""
    write_image(np.zeros((8, 8, 3), np.float32), "black.png")
    assert invoke("preview ball.obj -o a.png --size 32x24 --normal-map black.png").stderr == ""


def test_a_transparent_background_is_written_with_its_opacity(invoke, scene):
    (scene / "clear.toml").write_text(
        SCENE.replace("[render]", '[render]\nbackground = "transparent"')
    )
    invoke("preview clear.toml -o clear.png --size 32x24")
    opacity = pixels("clear.png")[..., 3]
    assert (opacity.shape, opacity[0, 0]) == ((24, 32), 0.0)
    assert opacity[12, 16] == 1.0
    # A format without opacity is an error; the opacity is not dropped silently.
    assert "not 4" in invoke("preview clear.toml -o clear.jpg --size 32x24", 2).stderr


def test_options_override_the_scene(invoke, scene):
    invoke("preview ball.toml -o ball.png --size 40x30 --view 0,90")
    assert pixels("ball.png").shape == (30, 40, 3)
    # Not given: the scene's, whatever the default of the option is.
    invoke("preview ball.toml -o same.png")
    assert pixels("same.png").shape == (48, 64, 3)


def test_explain_lists_the_passes_and_their_reasons(invoke, scene):
    output = invoke("preview ball.toml -o ball.png --explain").stdout
    plan = plan_scene(read_scene("ball.toml"))
    passes, left_out = output.split("\n\n")
    rows = [line.split("  ")[0] for line in passes.splitlines()[1:]]
    assert set(rows) == {item.name for item in plan.passes} | {
        "rasterizing", "fragments", "pixels",
    }  # fmt: skip
    assert 'its shading is lambert (object "ball")' in passes
    assert "ms" in passes.splitlines()[0]
    assert "fog" not in rows
    assert "the scene has no fog" in left_out


def test_a_plan_alone_draws_nothing(invoke, scene):
    output = invoke("preview ball.toml --plan-only").stdout
    assert "ms" not in output.splitlines()[0]
    assert sorted(path.name for path in scene.iterdir()) == ["ball.obj", "ball.toml"]
    plan = json.loads(invoke("preview ball.toml --plan-only --explain json").stdout)
    assert {"name", "does", "called_for_by"} == set(plan["passes"][0])
    invoke("preview ball.toml --plan-only --report plan.json")
    inputs = {"inputs": {"input": ["ball.toml"]}}
    assert json.loads((scene / "plan.json").read_text()) == plan | inputs


@pytest.mark.parametrize(("options", "n_panels"), [
    ("--affine-vs-perspective", 2),
    ("--interpolation affine,scanline,perspective", 3),
    ("--filter nearest,trilinear", 2),
    ("--buffer depth,normals,uv,mip-level,overdraw,object-id,texel-grid", 7),
    ("--buffer uv --interpolation affine,perspective", 2),
])  # fmt: skip
def test_variants_are_laid_side_by_side(invoke, scene, options, n_panels):
    invoke(f"preview ball.toml -o ways.png {options}")
    height, width, _ = pixels("ways.png").shape
    # Panels are at least twelve letters wide, each with a margin, and a caption below.
    assert width // n_panels >= 64
    assert height > 48


def test_a_turntable_is_a_folder_of_pictures(invoke, scene):
    invoke("preview ball.toml -o frames --view turntable:4 --explain")
    names = sorted(path.name for path in (scene / "frames").iterdir())
    assert names == ["000.png", "001.png", "002.png", "003.png"]
    first = pixels(scene / "frames" / "000.png")
    invoke("preview ball.toml -o alone.png")
    np.testing.assert_array_equal(first, pixels("alone.png"))
    # A quarter of a turn under a fixed light gives another picture.
    assert np.abs(first - pixels(scene / "frames" / "001.png")).max() > 0.05


def test_a_gltf_file_is_drawn_with_its_own_materials(invoke, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_mesh(plane(), "sheet.glb")
    output = invoke("preview sheet.glb -o sheet.png --size 32 --explain").stdout
    assert "metallic-roughness" in output
    flat = np.zeros((2, 2, 3), np.float32)
    from texbake import write_image

    write_image(flat, "black.png", color=True)
    invoke("preview sheet.glb --albedo black.png -o black_sheet.png --size 32 --view 0,0")
    assert pixels("black_sheet.png")[16, 16].max() < 0.1


@pytest.mark.parametrize("line", [
    "preview s.toml -o frames/000.png",
    "preview s.toml -o frames --view turntable:2",
    "preview s.toml -o p.png --report frames/000.png",
    "preview s.toml --plan-only --report frames/000.png",
])  # fmt: skip
def test_files_of_a_scene_are_not_overwritten(invoke, scene, line):
    (scene / "frames").mkdir()
    image = scene / "frames" / "000.png"
    write_image(np.full((2, 2, 3), 0.5, np.float32), image, color=True)
    old = '{ procedure = "checker", space = "uv", scale = 8.0 }'
    (scene / "s.toml").write_text(SCENE.replace(old, '"frames/000.png"'))
    before = image.read_bytes()
    assert "000.png: it is also an input" in invoke(line, 2).stderr
    assert image.read_bytes() == before
    assert not (scene / "p.png").exists()


def test_names_of_files_keep_their_capital_letters(invoke, scene):
    (scene / "Ball.toml").write_text(SCENE)
    assert " Ball.toml: it is also an input" in invoke("preview Ball.toml -o Ball.toml", 2).stderr
