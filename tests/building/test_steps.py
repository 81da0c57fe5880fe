"""Each kind of step, alone and against the function of the library that it calls."""

from dataclasses import replace

import click
import numpy as np
import pytest
from texbake_cli.main import COMMANDS, texbake

from texbake import RunOptions, run
from texbake.baking.memory import PROCESS
from texbake.building.steps import STEP_KINDS
from texbake.errors import MeshError, OptionError, UvError
from texbake.mesh.compose import join_meshes
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.parametric.make import make
from texbake.mesh.shapes import icosphere, plane, uv_sphere
from texbake.targets import PROGRAMS
from texbake.texture.image import read_image, write_image
from texbake.verbs.step import InputSize, Job, without_timings

# Options of steps that have no default.
NEEDED = {"run": {"faces": 1000}, "simplify": {"faces": 1000}, "export": {"to": "blender"}}


@pytest.fixture
def do(tmp_path):
    """Do a step; returns its files and figures."""

    def do(name, options, threads=1, **inputs):
        kind = STEP_KINDS[name]
        roles = {
            role: file if isinstance(file, tuple) else (file,) for role, file in inputs.items()
        }
        settings = kind.settings({**options, **dict.fromkeys(roles, "x")})
        folder = tmp_path / f"{name}{len(list(tmp_path.iterdir()))}"
        folder.mkdir()
        outputs = {key: folder / file for key, file in kind.outputs(settings).items()}
        figures = kind.run(
            Job(settings=settings, inputs=roles, outputs=outputs, threads=threads, asset="a")
        )
        assert all(path.exists() for path in outputs.values())
        assert set(folder.iterdir()) == set(outputs.values())
        return outputs, figures

    return do


@pytest.fixture
def ball(tmp_path):
    write_mesh(uv_sphere(8, 16), tmp_path / "ball.obj")
    return tmp_path / "ball.obj"


def test_made_meshes_are_those_of_the_library(do):
    files, figures = do("make", {"shape": "torus", "resolution": (12, 8), "format": "obj"})
    mesh = read_mesh(files["mesh"])
    expected = make("torus", resolution=(12, 8))
    assert np.array_equal(mesh.positions, expected.positions)
    assert figures["faces"] == 2 * 12 * 8


def test_relief_moves_along_the_normals_by_at_most_its_height(do):
    files, _ = do("make", {"shape": "sphere", "relief": "worley", "relief_height": 0.1})
    radii = np.linalg.norm(read_mesh(files["mesh"]).positions, axis=1)
    assert radii.min() >= 1.0 - 1e-6 and radii.max() <= 1.1 + 1e-6
    assert radii.std() > 0.01


def test_a_mesh_is_wrapped(do, ball):
    files, figures = do("remesh", {"resolution": 16}, mesh=ball)
    mesh = read_mesh(files["mesh"])
    assert figures == {"faces": mesh.n_faces, "components": 1, "notes": []}


def test_levels_of_detail(do, ball):
    files, figures = do("simplify", {"faces": (100, 40)}, mesh=ball)
    assert list(files) == ["lod0", "lod1"]
    assert [read_mesh(path).n_faces for path in files.values()] == [
        level["faces"] for level in figures["levels"]
    ]
    assert figures["levels"][0]["faces"] <= 100 and figures["levels"][1]["faces"] <= 40


def test_levels_of_detail_stay_within_an_error(do, ball):
    files, figures = do("simplify", {"error": "10%"}, mesh=ball)
    assert list(files) == ["lod0"]
    (level,) = figures["levels"]
    assert level["faces"] < read_mesh(ball).n_faces and level["distance_max_relative"] <= 0.1
    with pytest.raises(OptionError, match="faces, error: neither is given"):
        do("simplify", {}, mesh=ball)


@pytest.mark.parametrize(("join", "n_objects"), [(False, 2), (True, 0)])
def test_objects_of_levels_stay_apart_unless_they_are_joined(do, tmp_path, join, n_objects):
    high = tmp_path / "balls.obj"
    write_mesh(join_meshes([icosphere(3).replace(name=name) for name in ("one", "two")]), high)
    files, _ = do("simplify", {"faces": 200, "join_objects": join}, mesh=high)
    assert len(set(read_mesh(files["lod0"]).group_objects)) == n_objects


def test_a_run_is_that_of_the_command(do, tmp_path, small_pictures):
    write_mesh(icosphere(4), tmp_path / "high.ply")
    given = {"faces": 100, "size": 32, "maps": ("ao",), "levels": (40,), "preset": "unity"}
    files, figures = do("run", given, high=tmp_path / "high.ply")
    own = {**given, "n_faces": given["faces"]}
    del own["faces"]
    result = run(read_mesh(tmp_path / "high.ply"), tmp_path / "out", RunOptions(**own))
    for key, path in files.items():
        assert key == "report" or path.read_bytes() == result.files[key].read_bytes(), key
    assert figures["faces"] == result.low.n_faces and len(figures["levels"]) == 1
    for preset in (None, *PROGRAMS):  # the step alone means the mesh
        settings = STEP_KINDS["run"].settings({"faces": 100, "preset": preset})
        assert next(iter(STEP_KINDS["run"].outputs(settings))) in ("mesh", "glb")
    with pytest.raises(OptionError, match="faces, error: neither is given"):
        do("run", {}, high=tmp_path / "high.ply")


@pytest.fixture(scope="module")
def red(tmp_path_factory):
    """A red, half transparent ball, whose metalness is an image and whose roughness is a value."""
    path = tmp_path_factory.mktemp("red") / "red.obj"
    write_mesh(uv_sphere(16, 32), path)
    metal = np.zeros((32, 32, 1))
    metal[:16] = 1.0
    write_image(metal, path.with_name("metal.png"), color=False)
    text = "newmtl a\nKd 1 0 0\nd 0.5\nPr 0.2\nmap_Pm metal.png\n"
    path.with_name("red.mtl").write_text(text)
    lines = path.read_text()
    path.write_text("mtllib red.mtl\nusemtl a\n" + lines)
    return path


@pytest.mark.parametrize("preset", ["unreal", "unity"])
def test_a_run_publishes_the_materials_of_a_mesh(do, red, preset):
    given = {"faces": 100, "size": 32, "preset": preset, "compare": "off"}
    with pytest.raises(OptionError, match="images: ") as caught:
        do("run", given, high=red)
    assert "['base_color', 'orm']" in str(caught.value)
    files, _ = do("run", given | {"images": ("base_color", "orm")}, high=red)
    color = read_image(files["base_color"], color=True).pixels
    assert np.allclose(color, (1.0, 0.0, 0.0, 0.5), atol=0.003)
    packed = read_image(files["orm"], color=False).pixels
    ao, rough, metal = (1, 3, 0) if preset == "unity" else (0, 1, 2)
    assert np.allclose(packed[..., ao], 1.0)
    assert np.allclose(packed[..., rough], 0.8 if preset == "unity" else 0.2, atol=0.003)
    assert np.ptp(packed[..., metal]) == 1.0
    with pytest.raises(OptionError, match="images: the GLB file contains them"):
        do("run", {**given, "preset": "godot", "images": ("orm",)}, high=red)


def test_occlusion_is_packed_beside_a_plain_material(do, ball):
    ball.with_suffix(".mtl").write_text("newmtl a\nKd 1 1 1\nPr 1\n")
    ball.write_text("mtllib ball.mtl\nusemtl a\n" + ball.read_text())
    given = {"faces": 100, "size": 32, "preset": "unreal", "compare": "off", "maps": ("ao",)}
    files, _ = do("run", given, high=ball)
    assert files["orm"].exists() and files["ao"].exists()


def test_maps_in_several_formats(do, ball):
    given = {
        "maps": ("normal", "displacement"), "format": {"displacement": "exr"}, "size": 32,
        "padding": 1,
    }  # fmt: skip
    files, figures = do("bake", given, high=ball, low=ball)
    assert [path.suffix for path in files.values()] == [".png", ".exr", ".png", ".json"]
    assert figures["miss_percent"] == 0.0 and figures["faces"] == 224
    again, _ = do("bake", given, threads=2, high=ball, low=ball)
    for name, path in files.items():
        assert path.read_bytes() == again[name].read_bytes()


@pytest.mark.parametrize("name", STEP_KINDS)
def test_larger_inputs_are_estimated_to_take_no_less_memory(name):
    kind = replace(STEP_KINDS[name], check=None)
    settings = kind.settings(NEEDED.get(name, {}))
    few, more, most = (
        kind.memory(settings, {role.name: (InputSize(100 * n, n),) for role in kind.inputs})
        for n in (1_000, 100_000, 10_000_000)
    )
    assert PROCESS <= few <= more <= most
    assert few < most or not kind.inputs


def test_reports_have_no_times():
    report = {"a": [{"seconds": 1.0, "b": 2}], "stages": [], "options": {"threads": 3, "size": 4}}
    assert without_timings(report) == {"a": [{"b": 2}], "options": {"size": 4}}


def test_textures(do, ball, tmp_path):
    made, _ = do(
        "bake-texture", {"procedure": "marble", "size": 32, "padding": 1, "samples": 1}, mesh=ball
    )
    assert read_image(made["texture"], color=True).pixels.std() > 0.01
    levels, figures = do("mipmap", {}, image=made["texture"])
    assert figures["levels"] == len(list(levels["levels"].iterdir())) == 6
    write_image(np.zeros((16, 16, 3)), tmp_path / "black.png", color=True)
    packed, figures = do(
        "pack-textures", {"meshes": 2, "padding": 0},
        images=(made["texture"], tmp_path / "black.png"), mesh=(ball, ball),
    )  # fmt: skip
    assert list(packed) == ["texture", "mesh0", "mesh1"]
    places = [read_mesh(packed[f"mesh{i}"]).corner_uvs() for i in range(2)]
    assert not np.array_equal(*places)
    with pytest.raises(OptionError, match="meshes: it is the number"):
        do("pack-textures", {"meshes": 1}, images=(made["texture"],))


def test_channels(do, tmp_path):
    values = np.linspace(0.0, 1.0, 64).reshape(8, 8)
    write_image(values, tmp_path / "rough.png", bits=16)
    packed, figures = do("pack-channels", {"blue_value": 0.25}, green=tmp_path / "rough.png")
    assert figures == {"width": 8, "height": 8}
    pixels = read_image(packed["texture"], color=False).pixels
    assert pixels[..., 1] == pytest.approx(values, abs=1e-5)
    assert np.ptp(pixels[..., [0, 2]], axis=(0, 1)) == pytest.approx(0.0)
    split, _ = do("split-channels", {"names": ("ao", "", "metal")}, image=packed["texture"])
    assert list(split) == ["ao", "metal"]
    assert read_image(split["metal"], color=False).pixels == pytest.approx(0.25, abs=1e-5)
    with pytest.raises(OptionError, match="give a map for at least one"):
        do("pack-channels", {})
    with pytest.raises(OptionError, match="names: all are empty"):
        do("split-channels", {"names": ("", "")}, image=packed["texture"])


def test_a_picture(do, ball):
    files, _ = do("preview", {"width": 64, "height": 48}, mesh=ball)
    assert read_image(files["picture"], color=True).pixels.shape[:2] == (48, 64)


def test_an_asset_for_another_program(do, ball):
    maps, _ = do("bake", {"size": 32, "padding": 1}, high=ball, low=ball)
    far, _ = do("simplify", {"faces": [150, 80], "seams": "keep"}, mesh=ball)
    files, figures = do(
        "export", {"to": "unreal", "mesh_format": "glb"}, mesh=ball,
        levels=(far["lod0"], far["lod1"]), normal=maps["normal"],
    )  # fmt: skip
    made = {path.name: path for path in files["folder"].iterdir()}
    assert set(made) == {"SM_a.glb", "T_a_N.png", "import_a.py", "SETTINGS.txt"}
    assert figures["bytes"] == sum(path.stat().st_size for path in made.values())
    # Unreal's green goes down, that of the bake up.
    ours, theirs = (read_image(p, color=False).pixels for p in (maps["normal"], made["T_a_N.png"]))
    np.testing.assert_allclose(theirs[..., 1], 1.0 - ours[..., 1], atol=2 / 255)


def test_a_page_of_files(do, ball):
    given = {"maps": ("normal", "displacement"), "size": 32, "padding": 1}
    maps, _ = do("bake", given, high=ball, low=ball)
    files, figures = do(
        "page", {"size": 64}, high=ball, low=ball, normal_map=maps["normal"],
        displacement=maps["displacement"], misses=maps["misses"],
    )  # fmt: skip
    text = files["page"].read_text()
    assert "<title>a: baked from its high-poly mesh</title>" in text
    assert 'id="distances"' in text and 'id="errors"' in text and str(ball.parent) not in text
    # A mesh baked onto itself: the remaining error comes from 8-bit and 16-bit codes and 64 pixels.
    assert figures["error_deg"] < 0.5 and figures["bare_error_deg"] < 0.5
    bare, figures = do("page", {}, high=ball, low=ball)
    assert 'id="errors"' not in bare["page"].read_text() and figures == {}


def test_limits(do, ball, tmp_path):
    _, figures = do("check", {"fail_on": "never", "max_faces": 224}, mesh=ball)
    assert figures["stretch_l2"] > 1.0
    with pytest.raises(MeshError, match="224 triangles are more than max_faces, 223"):
        do("check", {"fail_on": "never", "max_faces": 223}, mesh=ball)
    with pytest.raises(UvError, match=r"max_stretch is 1\.01"):
        do("check", {"fail_on": "never", "max_stretch": 1.01}, mesh=ball)
    write_mesh(plane().replace(uvs=[[1, 0], [0, 0], [1, 1], [0, 1]]), tmp_path / "mirrored.obj")
    with pytest.raises(MeshError, match="the check found mirrored"):
        do("check", {"fail_on": "warning"}, mesh=tmp_path / "mirrored.obj")


# Keys of steps that the command writes otherwise: files have suffixes there, several values of one
# option one flag, and a picture or a map is an argument.
ONLY_IN_FILES = {
    "run": {"images"}, "make": {"relief", "relief_height", "relief_scale", "triangles"},
    "check": {"max_faces", "max_stretch"}, "bake-texture": {"parameters"},
    "pack-textures": {"mesh_format", "meshes"},
    "pack-channels": {"red_value", "green_value", "blue_value"},
    "preview": {
        *("background", "base_color", "bounces", "fov", "max_triangles"), *("width", "height"),
    },
}  # fmt: skip


@pytest.mark.parametrize("name", [name for name in STEP_KINDS if name in COMMANDS])
def test_options_have_one_name_in_pipelines_and_commands(name):
    """A key is the flag of the command with `_` for `-`, unless only files have it."""
    command = texbake.get_command(click.Context(texbake), name)
    flags = {flag.lstrip("-").replace("-", "_") for option in command.params
             for flag in (*option.opts, *option.secondary_opts)}  # fmt: skip
    assert set(STEP_KINDS[name].choices) - flags == {
        *ONLY_IN_FILES.get(name, ()), *({"format"} & {*STEP_KINDS[name].choices} - flags),
    }  # fmt: skip
