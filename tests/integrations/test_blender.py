"""The extension for Blender: built, installed in a Blender of its own, and used on made scenes.

Skipped where TEXBAKE_BLENDER_PYTHON names no Python with bpy.
"""

import base64
import hashlib
import importlib.util
import json
import os
import subprocess
import sys
import sysconfig
import threading
import time
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pytest

import texbake
from texbake.mesh.tangents import corner_tangents

FOLDER = Path(__file__).parents[2] / "integrations" / "blender"
SCRIPT = Path(__file__).with_name("blender_scenes.py")
NORMAL = {"maps": ["normal"], "size": 64}


def module(name):
    """Load a module of the extension that imports nothing of Blender."""
    spec = importlib.util.spec_from_file_location(f"blender_{name}", FOLDER / f"{name}.py")
    loaded = importlib.util.module_from_spec(spec)
    sys.path.insert(0, str(FOLDER))  # as in the process beside Blender
    try:
        spec.loader.exec_module(loaded)
    finally:
        sys.path.pop(0)
    return loaded


def wheel_of_installed(folder, tag):
    """Pack the installed package, with its core, as a wheel."""
    root = Path(texbake.__file__).parent
    info = f"texbake-{texbake.__version__}.dist-info"
    path = folder / f"texbake-{texbake.__version__}-py3-none-{tag}.whl"
    files = {
        f"texbake/{file.relative_to(root).as_posix()}": file.read_bytes()
        for file in root.rglob("*")
        if file.suffix in (".py", ".pyi", ".so", ".dll", ".dylib")
    }
    files[f"{info}/METADATA"] = (
        f"Metadata-Version: 2.1\nName: texbake\nVersion: {texbake.__version__}\n".encode()
    )
    files[f"{info}/WHEEL"] = f"Wheel-Version: 1.0\nTag: py3-none-{tag}\n".encode()
    digests = {
        name: base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        for name, data in files.items()
    }
    rows = [f"{name},sha256={digests[name]},{len(data)}" for name, data in files.items()]
    files[f"{info}/RECORD"] = "\n".join([*rows, f"{info}/RECORD,,", ""]).encode()
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return path


@pytest.fixture(scope="module")
def extension(tmp_path_factory):
    """Return the zip of the extension for this platform."""
    folder = tmp_path_factory.mktemp("extension")
    tag = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    return module("build").build(wheel_of_installed(folder, tag), folder)


@pytest.fixture(scope="module")
def python():
    """Return the Python that has bpy."""
    found = os.environ.get("TEXBAKE_BLENDER_PYTHON")
    if not found:
        pytest.skip("TEXBAKE_BLENDER_PYTHON names no Python with bpy")
    return found


@pytest.fixture(scope="module")
def user(tmp_path_factory):
    """Return the environment of a Blender with new settings, and a folder for its files."""
    folder = tmp_path_factory.mktemp("user")
    (folder / "tmp").mkdir()
    variables = {"BLENDER_USER_RESOURCES": str(folder), "TMPDIR": str(folder / "tmp")}
    return {**os.environ, **variables, "PYTHONDONTWRITEBYTECODE": "1"}


@pytest.fixture(scope="module")
def blender(extension, python, user):
    """Ask a running Blender for what a function of `blender_scenes.py` returns."""
    process = subprocess.Popen(
        [python, SCRIPT, extension], env=user, text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    log = []
    listener = threading.Thread(target=lambda: log.extend(process.stderr), daemon=True)
    listener.start()

    def ask(name, *arguments):
        process.stdin.write(json.dumps([name, *map(_plain, arguments)]) + "\n")
        process.stdin.flush()
        return answer()

    def answer():
        line = process.stdout.readline()
        if not line:
            listener.join(5)
        assert line, "".join(log[-40:])
        result, error = json.loads(line)
        assert error is None, error
        return result

    assert answer() == ["FINISHED"]
    yield ask
    process.stdin.close()
    process.wait(30)
    for stream in process.stdout, process.stderr:
        stream.close()


def _plain(value):
    return str(value) if isinstance(value, Path) else value


def test_the_zip_has_what_blender_asks_for(extension):
    with zipfile.ZipFile(extension) as archive:
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
        names = set(archive.namelist())
    assert manifest["version"] == texbake.__version__
    assert manifest["license"] == ["SPDX:GPL-3.0-or-later"]
    assert {name.removeprefix("./") for name in manifest["wheels"]} <= names
    assert {"__init__.py", "worker.py", "tasks.py", "LICENSE"} <= names
    assert "build.py" not in names and "measure.py" not in names
    assert set(manifest["permissions"]) == {"files"}


@pytest.mark.parametrize(("tag", "platform"), [
    ("manylinux_2_17_x86_64.manylinux2014_x86_64", "linux-x64"),
    ("linux_aarch64", "linux-arm64"),
    ("macosx_11_0_arm64", "macos-arm64"),
    ("macosx_10_9_x86_64", "macos-x64"),
    ("win_amd64", "windows-x64"),
])  # fmt: skip
def test_every_wheel_has_a_platform_of_blender(tag, platform):
    assert module("build").platform_of(Path(f"texbake-0.1.0-py3-none-{tag}.whl")) == platform


def test_every_wheel_of_a_release_has_a_platform_of_blender():
    sys.path.insert(0, str(FOLDER.parents[1] / "texbake" / "core"))
    try:
        from compile_core import TARGETS
    finally:
        sys.path.pop(0)
    tags = [target.wheel_tag for target in TARGETS]
    build = module("build")
    platforms = {build.platform_of(Path(f"texbake-1-py3-none-{tag}.whl")) for tag in tags}
    assert platforms == set(build.PLATFORMS.values())


def test_a_wheel_of_an_unknown_platform_is_refused():
    with pytest.raises(SystemExit, match="freebsd"):
        module("build").platform_of(Path("texbake-0.1.0-py3-none-freebsd_14_amd64.whl"))


def test_blender_finds_the_extension_valid(extension, python):
    code = "import bpy; print(bpy.utils.system_resource('SCRIPTS'))"
    done = subprocess.run([python, "-c", code], capture_output=True, text=True, check=True)
    tool = Path(done.stdout.split()[-1], "addons_core", "bl_pkg", "cli", "blender_ext.py")
    done = subprocess.run(
        [python, tool, "validate", extension], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_blender_refuses_an_extension_for_another_platform(python, tmp_path):
    other = "win_amd64" if sys.platform != "win32" else "macosx_11_0_arm64"
    path = module("build").build(wheel_of_installed(tmp_path, other), tmp_path)
    options = f"filepath={str(path)!r}, repo='user_default'"
    code = f"import bpy; bpy.ops.extensions.package_install_files({options})"
    done = subprocess.run(
        [python, "-c", code], env={**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert "This platform" in done.stdout + done.stderr
    assert not (tmp_path / "extensions" / "user_default" / "texbake").exists()


def test_menus_and_panels_show_every_operator(blender):
    known, operators, properties = blender("menus")
    assert known
    names = ["bake", "check", "lighten", "remesh", "select_finding", "simplify", "unwrap"]
    assert operators == [f"texbake.{name}" for name in names]
    assert {"maps", "size", "seams", "ratio", "resolution"} <= set(properties)


@pytest.mark.parametrize("modifier", [False, True])
def test_maps_have_the_bytes_that_the_command_writes(blender, tmp_path, modifier):
    maps = ["normal", "displacement", "ao", "vertex-color"]
    options = {"maps": maps, "size": 96, "samples": "4", "padding": 3, "front": 0.25, "back": 0.25}
    assert blender("bake_pair", tmp_path, "plain", options, modifier) == "FINISHED"
    high, low = (texbake.read_mesh(tmp_path / f"{name}.obj") for name in ("high", "low"))
    chosen = texbake.BakeOptions(
        maps=tuple(maps), size=96, samples=4, padding=3, front=0.25, back=0.25,
        vertex_colors="linear",
    )  # fmt: skip
    for path in texbake.bake(high, low, chosen).write(tmp_path):
        assert path.read_bytes() == (tmp_path / f"low_{path.name}").read_bytes(), path.name


def test_a_normal_map_has_the_bytes_of_bake_normals(blender, tmp_path):
    assert blender("bake_pair", tmp_path, "plain", NORMAL) == "FINISHED"
    files = [tmp_path / "high.obj", tmp_path / "low.obj", "-o", tmp_path / "normal.png"]
    subprocess.run(
        [sys.executable, "-P", "-m", "texbake", "bake-normals", *files, "--size", "64"], check=True
    )
    assert (tmp_path / "normal.png").read_bytes() == (tmp_path / "low_normal.png").read_bytes()


@pytest.mark.parametrize("matrix", ["turned", "large", "small", "mirrored", "uneven"])
def test_a_matrix_of_both_meshes_changes_no_byte(blender, tmp_path, matrix):
    pictures = []
    for name in "plain", matrix:
        folder = tmp_path / name
        folder.mkdir()
        assert blender("bake_pair", folder, name, NORMAL) == "FINISHED"
        pictures.append((folder / "low_normal.png").read_bytes())
    assert pictures[0] == pictures[1]


# Blender bakes in float32, from tangents that it computes in float32 as well. Where the surface is
# mirrored, single texels at edges of the low-poly mesh hit another face.
@pytest.mark.parametrize(("high", "low"), [
    ("plain", "plain"),
    ("mirrored", "plain"),
    ("plain", "mirrored"),
    ("turned and mirrored", "turned"),
    ("small", "small"),
])  # fmt: skip
def test_a_normal_map_is_what_blender_bakes(blender, high, low):
    mean, percentile = blender("angle_to_own_bake", high, low)
    assert mean < 0.02
    assert percentile < 0.1


def test_tangents_are_those_of_blender(blender, tmp_path):
    assert blender("tangents", tmp_path) == "Suzanne"
    with np.load(tmp_path / "arrays.npz") as arrays:
        mesh = module("tasks").mesh_of(dict(arrays))
        corners = arrays["triangles"]
    with np.load(tmp_path / "tangents.npz") as own:
        directions, signs = own["directions"][corners], own["signs"][corners]
    ours = corner_tangents(mesh)
    cosines = (ours[..., :3].astype(float) * directions).sum(axis=-1)
    # A polynomial for the arc cosine in both, added up in float32 in another order.
    assert np.degrees(np.arccos(np.clip(cosines, -1, 1))).max() < 0.05
    assert (ours[..., 3] == signs).all()


def test_maps_are_linked_to_the_material(blender):
    found = blender("nodes_of", "blender")
    assert found["answer"] == "FINISHED"
    assert found["images"] == {
        "low_ao": ["Non-Color", 16],
        "low_displacement": ["Non-Color", 16],
        "low_normal": ["Non-Color", 16],
    }
    assert (found["before normal"], found["uv map"]) == ("TEX_IMAGE", "UVMap")
    assert not found["displaced"]  # the normal map shows that detail


def test_a_target_has_its_names_and_its_green_channel(blender):
    found = blender("nodes_of", "unreal")
    assert set(found["images"]) == {"T_low_N", "T_low_H", "T_low_AO"}
    assert found["before normal"] == "COMBINE_COLOR"
    assert blender("nodes_of", "gltf-web")["images"]["low_normal"] == ["Non-Color", 8]


def test_every_map_is_baked_on_the_active_uv_map(blender):
    assert blender("every_map") == ["FINISHED", True, ["second"]]


def test_heights_alone_are_linked_with_their_range(blender):
    answer, space, (mid, scale) = blender("displacement")
    assert (answer, space) == ("FINISHED", "OBJECT")
    assert 0.0 < mid < 1.0
    assert 0.02 < scale < 0.3  # the wave is at most 0.05 deep, and so is the low-poly mesh


def test_materials_of_other_objects_stay_and_maps_are_replaced(blender):
    found = blender("materials")
    assert found["answers"] == ["FINISHED", "FINISHED"]
    assert (found["high"], found["low"]) == ("shared", "shared.001")
    assert (found["textures"], found["images"]) == ([0, 1], ["low_normal"])


def test_images_are_saved_beside_the_file(blender, tmp_path):
    answer, path, is_file, size = blender("saved", tmp_path)
    assert (answer, path, is_file, size) == ("FINISHED", "//textures/T_low_N.png", True, [64, 64])
    assert [file.name for file in (tmp_path / "textures").iterdir()] == ["T_low_N.png"]


@pytest.mark.parametrize(
    ("name", "stem"),
    [("wall/door", "wall_door"), ("../../door", ".._.._door"), ("Größe.001", "Größe.001")],
)
def test_names_of_objects_lead_to_no_other_folder(blender, tmp_path, name, stem):
    answer, path, *_ = blender("saved", tmp_path, name)
    assert (answer, path) == ("FINISHED", f"//textures/T_{stem}_N.png")
    assert [file.name for file in (tmp_path / "textures").iterdir()] == [f"T_{stem}_N.png"]
    assert sorted(file.name for file in tmp_path.iterdir()) == ["scene.blend", "textures"]


def test_a_long_name_is_shortened_in_a_path(blender, tmp_path):
    assert blender("saved", tmp_path, "石" * 80)[0] == "FINISHED"
    (file,) = (tmp_path / "textures").iterdir()
    assert file.name.startswith("T_石石") and file.suffix == ".png"


def test_only_files_of_earlier_bakes_are_replaced(blender, tmp_path):
    own = tmp_path / "textures" / "T_low_N.png"
    own.parent.mkdir()
    own.write_bytes(b"painted by hand")
    answer, path, *_ = blender("saved", tmp_path, "low", [64, 32])
    assert (answer, path) == ("FINISHED", "//textures/T_low_N.001.png")
    assert own.read_bytes() == b"painted by hand"
    files = sorted(file.name for file in own.parent.iterdir())
    assert files == ["T_low_N.001.png", "T_low_N.png"]
    baked = (own.parent / files[0]).read_bytes()
    assert int.from_bytes(baked[16:20], "big") == 32


def test_the_script_of_the_page_runs(blender, tmp_path):
    page = FOLDER.parents[1] / "docs" / "how-to" / "blender.md"
    assert blender("page_script", page, tmp_path) == ["T_high_low_AO", "T_high_low_N"]


@pytest.mark.parametrize("in_edit_mode", [False, True])
def test_marked_seams_are_kept(blender, in_edit_mode):
    found = blender("unwrap_cylinder", in_edit_mode)
    assert found == {
        "answer": "FINISHED",
        "layer": "atlas",
        "mode": "EDIT" if in_edit_mode else "OBJECT",
        "seams kept": True,
        "others cut": 0,
    }


def test_objects_share_a_texture_without_overlaps(blender):
    answer, n_shared, least, greatest = blender("unwrap_together")
    assert (answer, n_shared) == ("FINISHED", 0)
    assert 0.0 <= least < greatest <= 1.0


def test_an_object_without_room_leaves_all_others_as_they_were(blender):
    answer, maps = blender("unwrap_without_room")
    assert answer == "Torus: it already has 8 UV maps, the most possible"
    assert maps == [["UVMap"], 8]


def test_simplify_keeps_what_a_mesh_has(blender):
    found = blender("simplified", "simplify", {"faces": 200, "seams": "keep"})
    assert found["answer"] == "FINISHED"
    assert (found["name"], found["selected"]) == ("box_low", ["box", "box_low"])
    assert found["faces"] <= 200
    assert found["materials"] == ["red", "blue"]
    assert min(found["counts"]) > 0
    assert found["volume"] == pytest.approx(8.0)  # not turned inside out by the mirror
    assert found["sharp"] >= 12
    assert found["uv maps"] == ["UVMap"]


def test_remesh_closes_a_mesh(blender):
    found = blender("simplified", "remesh", {"resolution": 32, "sharp_edges": True, "faces": 500})
    assert (found["answer"], found["name"]) == ("FINISHED", "box_remesh")
    assert found["closed"] and found["faces"] <= 500
    assert found["volume"] == pytest.approx(8.0, rel=0.02)
    assert found["size"] == pytest.approx([2.0] * 3, rel=0.02)


def test_lighten_keeps_the_materials(blender, tmp_path):
    found = blender("lightened", tmp_path)
    assert (found["answer"], found["name"]) == ("FINISHED", "ball_light")
    assert found["faces"] <= 200
    assert found["kept"] == "JPEG"
    assert found["size"] == pytest.approx([2.0] * 3, rel=0.05)
    assert found["color"][2] > 0.9 > 0.7 > found["color"][0] > 0.3


def test_check_selects_the_faces_that_it_names(blender):
    found = blender("checked", False)
    assert found["answer"] == "FINISHED"
    assert ["error", "overlapping-coordinates", "2 faces"] in found["found"]
    assert (found["mode"], found["selected"]) == ("EDIT", [0, 1])
    assert found["again"] == "FINISHED"


def test_check_says_where_modifiers_hide_the_faces(blender):
    found = blender("checked", True)
    assert found["answer"] == "FINISHED"
    assert found["mode"] == "EDIT"  # as before
    assert found["found"] and "cannot be selected" in found["again"]
    assert found["mode again"] == "EDIT"


@pytest.mark.parametrize(("operator", "options"), [
    ("bake", NORMAL),
    ("unwrap", {"size": 64}),
    ("simplify", {"ratio": 0.5}),
    ("check", {"size": 16}),
])  # fmt: skip
def test_undo_takes_an_operator_back(blender, operator, options):
    before, after, undone = blender("undone", operator, options)
    assert after != before or operator == "check"
    assert undone == before


def test_a_bake_comes_back_to_edit_mode(blender):
    before, after, undone = blender("undone", "bake", NORMAL, True)
    assert [state["objects"]["low"][1] for state in (before, after, undone)] == ["EDIT"] * 3
    assert [state["images"] for state in (before, after, undone)] == [0, 1, 0]


@pytest.mark.parametrize(("how", "operator", "options", "message"), [
    ("nothing selected", "bake", NORMAL, "the active object is not a mesh"),
    ("nothing selected", "unwrap", {}, "no mesh is selected"),
    ("nothing selected", "simplify", {}, "no mesh is selected"),
    ("nothing selected", "remesh", {}, "no mesh is selected"),
    ("nothing selected", "lighten", {}, "no mesh is selected"),
    ("nothing selected", "check", {}, "the active object is not a mesh"),
    ("low-poly mesh alone", "bake", NORMAL, "no high-poly mesh is selected"),
    ("no UV map", "bake", NORMAL, "low: it has no UV map; unwrap it first"),
    ("no UV map", "unwrap", {"seams": "PACK"}, "it has no UV map, so there are no seams"),
    ("no UV map in edit mode", "bake", NORMAL, "low: it has no UV map; unwrap it first"),
    ("no UV map in edit mode", "unwrap", {"seams": "PACK"}, "there are no seams"),
    ("no folder in edit mode", "bake", NORMAL, "could not start"),
    ("no folder in edit mode", "unwrap", {}, "could not start"),
    ("no folder in edit mode", "simplify", {}, "could not start"),
    ("no folder in edit mode", "remesh", {}, "could not start"),
    ("no folder in edit mode", "lighten", {}, "could not start"),
    ("no folder in edit mode", "check", {}, "could not start"),
    ("active object is no mesh", "bake", NORMAL, "the active object is not a mesh"),
    ("no faces", "bake", NORMAL, "low: it has no faces"),
    ("no faces", "unwrap", {}, "low: it has no faces"),
    ("no faces", "simplify", {}, "low: it has no faces"),
    ("no faces", "check", {}, "low: it has no faces"),
    ("scale of 0", "bake", NORMAL, "low: its scale is 0"),
    ("wheel missing", "bake", NORMAL, "the package texbake is missing"),
    ("wheel of another platform", "bake", NORMAL, "does not work here: its core is for"),
    ("no temporary folder", "bake", NORMAL, "could not start"),
    ("nothing wrong", "bake", {**NORMAL, "cage": "nowhere"}, "no mesh object of this name"),
    ("other mesh", "bake", {**NORMAL, "cage": "other"}, "other: "),
    ("nothing wrong", "bake", {**NORMAL, "maps": []}, "no map is chosen"),
    ("nothing wrong", "bake", {**NORMAL, "save": "FILES"}, "save the .blend file first"),
    ("nothing wrong", "select_finding", {"number": 99}, "this finding names no faces"),
])  # fmt: skip
def test_a_mistake_is_one_line_and_changes_nothing(blender, how, operator, options, message):
    answer, is_unchanged = blender("refused", how, operator, options)
    assert message in answer
    assert "\n" not in answer and "Traceback" not in answer
    assert is_unchanged


def test_objects_that_are_not_meshes_are_skipped(blender):
    assert blender("skips_others") == ["FINISHED", 1]


def test_escape_ends_the_process(blender):
    found = blender("modal", ["MOUSEMOVE", "progress", "ESC"], 4096, "EDIT")
    assert (found["answers"][0], found["answers"][-1]) == ("RUNNING_MODAL", "CANCELLED")
    assert set(found["answers"][1:-1]) == {"PASS_THROUGH"}  # the interface stays free
    assert found["reports"] == ["texbake was stopped; nothing has changed"]
    assert found["mode"] == "EDIT"
    assert found["ended"] and not found["files"] and not found["running"]
    assert found["texts"][-1] is None  # the status bar is Blender's again
    assert any("Esc" in text for text in found["texts"][:-1])
    assert {"event_timer_remove", "progress_end"} <= set(found["calls"])


def test_an_operator_that_cannot_start_comes_back_to_edit_mode(blender):
    found = blender("modal", [], 64, "EDIT")
    assert found == {"answers": ["CANCELLED"], "reports": ["nothing to do"], "mode": "EDIT"}


def test_events_of_a_window_bring_the_result(blender):
    found = blender("modal", ["MOUSEMOVE", "end"], 64)
    assert found["answers"][-1] == "FINISHED"
    assert set(found["answers"][1:-1]) == {"PASS_THROUGH"}
    assert found["reports"][-1] == "the end"
    assert found["ended"] and not found["files"] and not found["running"]
    assert found["texts"][-1] is None


def test_disabling_the_extension_ends_its_process(blender):
    assert blender("switched_off") == [True, True, True]


def _is_running(number):
    try:
        stat = Path(f"/proc/{number}/stat").read_text(encoding="utf-8")
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[0] != "Z"


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="it reads /proc")
def test_a_killed_blender_leaves_nothing_behind(blender, python, user):
    process = subprocess.Popen(
        [python, SCRIPT, "zip", "wait"], env=user, text=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=None,
    )  # fmt: skip
    with process:
        lines = iter(process.stdout.readline, "")
        number, folder = next(json.loads(line) for line in lines if line.startswith("["))
        assert _is_running(number)
        process.kill()
    deadline = time.monotonic() + 20
    while (_is_running(number) or Path(folder).exists()) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not _is_running(number)
    assert not Path(folder).exists()
