"""What runs again and what does not, what fails alone, and that damage never goes unnoticed."""

import errno
import json
import os
import re

import numpy as np
import pytest

from texbake import FileError, OptionError
from texbake.building import locations
from texbake.building.build import build, plan_build
from texbake.building.digests import checksum
from texbake.building.options import BuildOptions, parse_bytes
from texbake.building.store import Store
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.shapes import uv_sphere
from texbake.raycast.scene import RayScene
from texbake.texture.image import read_image, write_image

SCAN = """
[[assets]]
inputs.high = "*.ply"
"""
SCAN_STEPS = """
[steps.clean]
do = "repair"
mesh = "high"
output = "{asset}.{ext}"
[steps.low]
do = "unwrap"
mesh = "clean"
method = "spherical"
output = "{asset}.{ext}"
"""


def report(path, folder="build"):
    return json.loads((path.parent / folder / "build.json").read_text())


@pytest.fixture
def scans(tmp_path, write):
    for number, name in enumerate(["a", "b", "c"]):
        write_mesh(uv_sphere(4 + number, 8), tmp_path / f"{name}.ply")
    return write(SCAN, SCAN_STEPS)


def test_a_build_makes_everything_and_the_next_nothing(write, run, contents):
    path = write()
    result, steps = run(path)
    assert result.ok and len(steps) == 6
    before = contents(path.parent / "build")
    assert (path.parent / "build" / ".texbake" / ".gitignore").read_text() == "*\n"
    assert set(before) == {
        f"{asset}_{rest}"
        for asset in ("ball", "egg")
        for rest in ("low.obj", "misses.png", "normal.png", "report.json")
    }
    assert read_mesh(path.parent / "build" / "egg_low.obj").diagonal > 4
    again, steps = run(path)
    assert again.ok and steps == []
    assert [asset.state for asset in again.assets] == ["current", "current"]
    assert contents(path.parent / "build") == before


@pytest.mark.parametrize(("choices", "n_in_chunks"), [
    ("", 2),
    ('maps = ["curvature"]\n', 0),  # it needs the whole mesh
    ('maps = ["base-color"]\nhigh_texture = "./white.png"\n', 0),
])  # fmt: skip
def test_less_memory_gives_the_same_bytes(
    write, run, contents, monkeypatch, tmp_path, choices, n_in_chunks
):
    write_image(np.ones((4, 4, 3), np.float32), tmp_path / "white.png")
    path = write()
    path.write_text(path.read_text() + choices)
    assert run(path)[0].ok
    before = contents(path.parent / "build")
    in_chunks = []
    trees = RayScene.trees

    def spy(scene):
        if scene.in_chunks and not any(scene is known for known in in_chunks):
            in_chunks.append(scene)
        return trees(scene)

    monkeypatch.setattr(RayScene, "trees", spy)
    again, steps = run(path, folder=path.parent / "small", max_memory="1M")
    assert again.ok and len(steps) == 6 and len(in_chunks) == n_in_chunks
    assert contents(path.parent / "small") == before
    # It is not a setting: built steps stay valid.
    assert run(path, max_memory="1M")[1] == []


def test_only_changed_steps_run(write, run):
    path = write()
    run(path)
    path.write_text(path.read_text().replace("padding = 1", "padding = 2"))
    plan = {(s.asset, s.step): (s.state, s.why) for s in plan_build(path)}
    assert plan["ball", "maps"] == ("runs", "padding: 1 before, 2 now")
    assert plan["ball", "low"] == ("current", "")
    assert run(path)[1] == ["ball.maps", "egg.maps"]
    path.write_text(path.read_text().replace("radius = 2.0", "radius = 3.0"))
    plan = {(s.asset, s.step): s.state for s in plan_build(path)}
    assert [plan["egg", step] for step in ("high", "low", "maps")] == ["runs", "may run", "may run"]
    assert run(path)[1] == ["egg.high", "egg.low", "egg.maps"]
    # What was built before is still there, and comes back without any work.
    path.write_text(path.read_text().replace("radius = 3.0", "radius = 2.0"))
    assert run(path)[1] == []


def test_a_step_whose_inputs_come_out_the_same_does_not_run(scans, run):
    run(scans)
    mesh = read_mesh(scans.parent / "a.ply")
    # The same triangles with a vertex that none uses, which the repair leaves out again.
    unused = mesh.replace(
        positions=[*mesh.positions.tolist(), [9.0, 9.0, 9.0]], normals=None, normal_faces=None
    )
    write_mesh(mesh.replace(normals=None, normal_faces=None), scans.parent / "a.ply")
    run(scans)
    write_mesh(unused, scans.parent / "a.ply")
    assert run(scans)[1] == ["a.clean"]


def test_a_file_that_is_only_touched_is_not_built_again(scans, run):
    run(scans)
    os.utime(scans.parent / "a.ply")
    assert run(scans)[1] == []


def test_a_file_that_changed_with_its_time_set_back_is_seen(scans, run):
    run(scans)
    file = scans.parent / "a.ply"
    status = file.stat()
    data = bytearray(file.read_bytes())
    data[-60] ^= 1  # in a coordinate or an index: the length stays
    file.write_bytes(data)
    os.utime(file, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert "a.clean" in run(scans)[1]


def test_a_bad_asset_fails_alone(scans, run, contents):
    (scans.parent / "b.ply").write_bytes(b"ply\nnonsense\n")
    result, _ = run(scans)
    assert not result.ok
    (failed,) = result.failed
    assert failed.name == "b"
    assert failed.error.startswith("clean: ") and "b.ply" in failed.error
    assert "\n" not in failed.error
    states = {asset.name: [step.state for step in asset.steps] for asset in result.assets}
    assert states == {"a": ["built"] * 2, "b": ["failed", "blocked"], "c": ["built"] * 2}
    assert set(contents(scans.parent / "build")) == {"a.ply", "a.obj", "c.ply", "c.obj"}
    written = report(scans)
    assert (written["ok"], written["counts"]["failed"]) == (False, 1)
    by_name = {asset["name"]: asset for asset in written["assets"]}
    assert by_name["b"]["error"] == failed.error
    assert by_name["b"]["steps"][1]["error"] == "it needs clean, which failed"
    # Once repaired, it is built, and nothing else is.
    write_mesh(uv_sphere(5, 8), scans.parent / "b.ply")
    assert run(scans)[1] == ["b.clean", "b.low"]


@pytest.mark.parametrize(("name", "fault"), [
    ("b.ply", "there is no such file"),  # it is looked at later
    ("c.ply", "it changed since the build looked at it; build again"),
])  # fmt: skip
def test_an_input_that_changes_or_vanishes_during_a_build(scans, inline, name, fault):
    crew = inline(slots=1 if name == "b.ply" else 9)
    submit = crew.submit

    def change(number, task):
        if name == "b.ply":
            (scans.parent / name).unlink(missing_ok=True)
        elif task.asset == "c":
            write_mesh(uv_sphere(9, 9), scans.parent / name)
        submit(number, task)

    crew.submit = change
    (failed,) = build(scans, workers=crew).failed
    assert failed.name == name[0] and f"{name}: {fault}" in failed.error


@pytest.mark.parametrize("step", ["clean", "low"])
@pytest.mark.parametrize("kind", ["flipped", "cut", "gone", "manifest", "no manifest"])
def test_a_damaged_store_is_noticed_and_repaired(step, kind, scans, run, contents):
    first, _ = run(scans)
    before = contents(scans.parent / "build")
    key = next(s.key for s in first.assets[0].steps if s.step == step)
    entry = scans.parent / "build" / ".texbake" / "store" / key[:2] / key
    name = (
        "manifest.json"
        if "manifest" in kind
        else next(path.name for path in entry.iterdir() if path.suffix in (".ply", ".obj"))
    )
    file = entry / name
    status = file.stat()
    data = bytearray(file.read_bytes())
    if kind in ("flipped", "manifest"):
        data[len(data) // 2] ^= 4
        file.write_bytes(data)
        os.utime(file, ns=(status.st_atime_ns, status.st_mtime_ns))
    elif kind == "cut":
        file.write_bytes(data[:-7])
    else:
        file.unlink()
    result, steps = run(scans)
    assert result.ok
    assert steps == [f"a.{step}"]
    if kind != "no manifest":
        (note,) = [n for s in result.assets[0].steps for n in s.notes]
        assert "damaged" in note and "made again" in note
    assert contents(scans.parent / "build") == before
    assert run(scans)[1] == []


def test_bits_that_rot_are_found_with_verify_or_when_they_are_read(scans, run, contents):
    first, _ = run(scans)
    before = contents(scans.parent / "build")
    key = first.assets[0].steps[0].key
    entry = scans.parent / "build" / ".texbake" / "store" / key[:2] / key
    (file,) = [path for path in entry.iterdir() if path.suffix == ".ply"]

    def rot():
        """Change a bit as a disk does: the remembered signature stays that of the file."""
        data = bytearray(file.read_bytes())
        data[-9] ^= 1
        file.write_bytes(data)
        digests = scans.parent / "build" / ".texbake" / "digests.json"
        known = json.loads(digests.read_text())["files"]
        known[str(file)][0] = list(locations.file_signature(file) or ())
        digests.write_text(json.dumps({"checksum": checksum(known), "files": known}))

    rot()
    assert run(scans)[1] == []
    text = scans.read_text()
    scans.write_text(text.replace('"spherical"', '"box"'))
    result, _ = run(scans)
    (failed,) = result.failed
    assert failed.name == "a"
    damage = (
        "low: a stored input is damaged: .*/repaired.ply does not have its checksum; build again"
    )
    assert re.fullmatch(damage, failed.error)
    assert run(scans)[1] == ["a.clean", "a.low"]
    rot()
    scans.write_text(text)
    assert (run(scans)[1], run(scans, verify=True)[1]) == ([], ["a.clean"])
    assert contents(scans.parent / "build") == before


def test_a_step_is_blocked_by_any_step_before_it_that_failed(scans, run):
    (scans.parent / "b.ply").write_bytes(b"ply\nnonsense\n")
    later = '[steps.{}]\ndo = "repair"\nmesh = "{}"\n'
    scans.write_text(scans.read_text() + later.format("two", "low") + later.format("own", "high"))
    result, _ = run(scans)
    steps = {step.step: (step.state, step.error) for step in result.assets[1].steps}
    blocked = "blocked", "it needs clean, which failed"
    assert steps["low"] == steps["two"] == blocked
    assert steps["clean"][0] == steps["own"][0] == "failed"


def test_outputs_that_were_changed_or_removed_are_put_back(scans, run, contents):
    run(scans)
    folder = scans.parent / "build"
    before = contents(folder)
    (folder / "a.obj").unlink()
    (folder / "b.ply").write_bytes(b"edited")
    result, steps = run(scans)
    assert steps == [] and contents(folder) == before
    notes = [note for asset in result.assets for step in asset.steps for note in step.notes]
    assert notes == ["restored 1 missing or changed output"] * 2


def test_a_new_asset_whose_results_are_stored_misses_no_outputs(tmp_path, write, run):
    write_mesh(uv_sphere(4, 8), tmp_path / "one.ply")
    asset = '[[assets]]\nname = "{}"\ninputs.high = "one.ply"\n'
    run(write(asset.format("a"), SCAN_STEPS))
    path = write(asset.format("a") + asset.format("b"), SCAN_STEPS)
    whys = [(step.asset, step.why) for step in plan_build(path) if step.why]
    assert whys == [("b", "1 output is written")] * 2
    result, steps = run(path)
    assert steps == []
    assert [note for found in result.assets for step in found.steps for note in step.notes] == []
    assert (path.parent / "build" / "b.obj").is_file()


def test_equal_steps_of_two_assets_run_once(write, run):
    path = write('[[assets]]\nname = "a"\n[[assets]]\nname = "b"\n')
    result, steps = run(path)
    assert result.ok
    assert sorted(step.partition(".")[2] for step in steps) == ["high", "low", "maps"]
    assert (path.parent / "build" / "a_low.obj").read_bytes() == (
        path.parent / "build" / "b_low.obj"
    ).read_bytes()


def test_all_steps_that_check_allow_what_the_file_allows(write, run):
    steps = """
[steps.low]
do = "make"
shape = "plane"
width = 1e12
[steps.strict]
do = "check"
mesh = "low"
fail_on = "note"
[steps.empty]
do = "check"
mesh = "low"
fail_on = "note"
allow = []
"""
    path = write(
        '[check]\nallow = ["extreme-size", "low-texel-density"]\n[[assets]]\nname = "a"\n', steps
    )
    (failed,) = run(path)[0].failed
    states = {step.step: step.state for step in failed.steps}
    assert states == {"low": "built", "strict": "built", "empty": "failed"}
    assert "low texel density (2 faces), extreme size (1 mesh)" in failed.error


def test_steps_wait_for_a_check(write, run):
    steps = """
[steps.high]
do = "make"
shape = "plane"
[steps.limits]
do = "check"
mesh = "high"
max_faces = 1
fail_on = "never"
[steps.low]
do = "repair"
mesh = "high"
after = "limits"
"""
    path = write('[[assets]]\nname = "a"\n', steps)
    result, ran = run(path)
    assert ran == ["a.high", "a.limits"]
    assert "2 triangles are more than max_faces, 1" in result.failed[0].error
    path.write_text(path.read_text().replace("max_faces = 1", "max_faces = 2"))
    assert run(path)[1] == ["a.limits", "a.low"]


def test_a_full_disk_fails_a_step_and_leaves_no_partial_file(scans, run, contents, monkeypatch):
    def full(source, target):
        target.write_bytes(source.read_bytes()[:100])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(locations, "copy_file", full)
        result, _ = run(scans)
    assert len(result.failed) == 3
    assert "No space left on device" in result.failed[0].error
    assert contents(scans.parent / "build") == {}
    result, steps = run(scans)
    assert result.ok
    assert steps == ["a.low", "b.low", "c.low"]  # the others were stored before


def test_bugs_are_reported_with_their_traceback(scans, run, monkeypatch):
    monkeypatch.setattr("texbake.mesh.repair.repair", lambda mesh, options: 1 // 0)
    result, _ = run(scans)
    step = result.failed[0].steps[0]
    assert step.error == (
        "texbake itself failed: ZeroDivisionError: integer division or modulo by zero"
    )
    assert "Traceback" in step.trace


def test_an_interrupted_build_says_so_and_goes_on_where_it_was(scans, inline):
    crew = inline(slots=1)
    submit = crew.submit

    def interrupt(number, task):
        if len(crew.tasks) == 3:
            raise KeyboardInterrupt
        submit(number, task)

    crew.submit = interrupt
    with pytest.raises(KeyboardInterrupt):
        build(scans, workers=crew)
    assert report(scans)["state"] == "interrupted"
    crew = inline()
    assert build(scans, workers=crew).ok
    assert len(crew.tasks) == 3
    assert report(scans)["state"] == "finished"


def test_stored_results_that_are_not_used_are_removed_when_asked(write, run):
    path = write()
    run(path)
    store = path.parent / "build" / ".texbake" / "store"
    text = path.read_text()
    path.write_text(text.replace("radius = 2.0", "radius = 3.0"))
    run(path)
    assert len(list(store.glob("??/*"))) == 9
    run(path, prune=True)
    assert len(list(store.glob("??/*"))) == 6
    path.write_text(text)
    assert run(path)[1] == ["egg.high", "egg.low", "egg.maps"]


def test_two_pipelines_of_one_store_do_not_take_work_in_hand_from_each_other(write, inline):
    path = write(head='store = "common"\n')
    other = path.with_name("other.toml")
    text = path.read_text().replace("radius = 2.0", "radius = 3.0")
    other.write_text('folder = "elsewhere"\n' + text)

    class Nested(inline):
        def finished(self, timeout):
            if timeout != 0.0 and not other.with_name("elsewhere").exists():
                with Store(str(path.parent / "common")).folder() as folder:
                    assert build(other, workers=inline()).ok
                    assert folder.is_dir()
            return super().finished(timeout)

    assert build(path, workers=Nested()).ok


def test_an_interrupted_removal_is_completed(write, run):
    path = write()
    run(path)
    store = path.parent / "build" / ".texbake" / "store"
    entry = next(store.glob("??/*"))
    left = entry.with_name(f"{entry.name}.0123abcd")
    left.mkdir()
    (left / "file").write_text("x")
    assert run(path)[1] == []
    assert not left.exists() and entry.exists()


def test_materials_of_the_high_poly_mesh_are_baked_and_count(tmp_path, write, run):
    square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    faces = "usemtl one\nf 1/1 2/2 3/3\nusemtl two\nf 1/1 3/3 4/4\n"
    (tmp_path / "a.obj").write_text(f"mtllib a.mtl\n{square}{faces}")
    (tmp_path / "a.mtl").write_text("newmtl one\nKd 1 0 0\nnewmtl two\nKd 0 0 1\n")
    steps = """
[steps.maps]
do = "bake"
high = "high"
low = "high"
maps = ["base-color", "material-id"]
size = 16
padding = 0
output = "{output}.{ext}"
"""
    path = write('[[assets]]\ninputs.high = "a.obj"\n', steps)
    result, _ = run(path)
    assert result.ok, result.failed

    def colors():
        texture = read_image(path.parent / "build" / "base-color.png", color=True).pixels
        return texture[12, 14].round().tolist(), texture[2, 3].round().tolist()

    assert colors() == ([1, 0, 0], [0, 0, 1])
    ids = read_image(path.parent / "build" / "material-id.png", color=False).pixels
    assert not np.array_equal(ids[12, 14], ids[2, 3])
    (tmp_path / "a.mtl").write_text("newmtl one\nKd 0 1 0\nnewmtl two\nKd 0 0 1\n")
    assert run(path)[1] == ["a.maps"]
    assert colors() == ([0, 1, 0], [0, 0, 1])
    # An image in place of the materials' own colors.
    write_image(np.ones((4, 4, 3), np.float32), tmp_path / "white.png")
    path.write_text(path.read_text() + 'high_texture = "./white.png"\n')
    result, _ = run(path)
    assert result.ok, result.failed
    assert colors() == ([1, 1, 1], [1, 1, 1])


@pytest.mark.parametrize("key", ["folder", "store", "outputs"])
@pytest.mark.parametrize("name", ["a\\u0000b", "a" * 300])
def test_a_name_that_no_folder_can_have_is_one_line(key, name, write, run):
    path = write(SCAN, SCAN_STEPS, f'{key} = "{name}"\n')
    write_mesh(uv_sphere(4, 6), path.parent / "a.ply")
    for use in (run, plan_build):
        with pytest.raises(FileError, match="it cannot be the name of a file"):
            use(path)


def test_invalid_options():
    for choice in ({"jobs": 0}, {"threads": -1}, {"max_memory": "much"}, {"scheduler": "there"}):
        with pytest.raises(OptionError):
            BuildOptions(**choice)
    assert parse_bytes("2 GiB") == 2 * 1024**3
