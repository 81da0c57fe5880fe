"""Remembered digests are used while they are intact; steps depend on files that meshes name."""

import hashlib
import json
import os
import time

import pytest

import texbake
from tests.fbx_writer import binary, rich_scene
from tests.glb import glb_bytes, read_glb
from texbake import build, write_mesh
from texbake.building.digests import Digests, file_digest, is_followed, sidecars
from texbake.building.locations import file_signature
from texbake.limits import raised_limits
from texbake.mesh.mesh import UvSet
from texbake.mesh.shapes import uv_sphere


@pytest.fixture
def mesh(tmp_path):
    path = tmp_path / "a.ply"
    path.write_text("x")
    return path


@pytest.fixture
def kept(tmp_path, mesh):
    path = tmp_path / "digests.json"
    digests = Digests(path)
    digests.remember(str(mesh), file_signature(mesh), "what was remembered")
    digests.save()
    return path


def test_remembered_digests_are_used(mesh, kept):
    assert Digests(kept).digest(str(mesh)) == "what was remembered"
    assert Digests(kept, trusting=False).digest(str(mesh)) == file_digest(mesh)


def test_a_flipped_bit_discards_the_digests(mesh, kept):
    kept.write_text(kept.read_text().replace("was remembered", "was remembereD"))
    assert Digests(kept).digest(str(mesh)) == file_digest(mesh)


def test_digests_of_results_that_no_step_has_are_forgotten(write, run):
    """Otherwise `watch` would remember, read and write one more set of them with each save."""
    path = write()
    run(path)
    kept = path.parent / "build" / ".texbake" / "digests.json"
    n_files = len(json.loads(kept.read_bytes())["files"])
    text = path.read_text()
    for radius in (2.5, 2.6, 2.7):
        path.write_text(text.replace("radius = 2.0", f"radius = {radius}"))
        _, steps = run(path)
        assert len(steps) == 3
        assert len(json.loads(kept.read_bytes())["files"]) == n_files
    run(path, only=("ball",))
    assert len(json.loads(kept.read_bytes())["files"]) == n_files
    path.write_text(text)
    result, steps = run(path)
    assert result.ok and not steps


OBJ = "mtllib my stuff.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n"
MTL = "newmtl a\nKd 1 0 0\nmap_Kd -s 1 1 1 my wood.png\nbump -bm 0.5 gone.png\n"
STEPS = '[steps.r]\ndo = "repair"\nmesh = "high"\n'


def test_sidecars_of_an_obj_file(tmp_path):
    (tmp_path / "a.obj").write_text(OBJ)
    # As one name and as two: which is meant depends on which files there are.
    found = [path.name for path in sidecars(tmp_path / "a.obj")]
    assert found == ["my stuff.mtl", "my", "stuff.mtl", "a.uvs.npz"]
    (tmp_path / "my stuff.mtl").write_text(MTL)
    (tmp_path / "my wood.png").write_text("x")
    names = [path.name for path in sidecars(tmp_path / "my stuff.mtl")]
    assert names == ["my wood.png", "gone.png"]
    (tmp_path / "my wood.png").unlink()
    assert [path.name for path in sidecars(tmp_path / "my stuff.mtl")] == names


@pytest.mark.parametrize(("statement", "name"), [
    (b"MAP_KD wood.png", "wood.png"),
    (b"map_kd h\xf6lz.png", "h\u00f6lz.png"),
    (rb"map_Kd C:\art\wood.png", "wood.png"),
])  # fmt: skip
def test_the_image_that_the_reader_finds_counts(statement, name, tmp_path):
    (tmp_path / "a.obj").write_text(OBJ.replace("my stuff", "a"))
    (tmp_path / "a.mtl").write_bytes(b"newmtl a\n" + statement)
    (tmp_path / name).write_bytes(b"image")
    found = texbake.read_materials(tmp_path / "a.obj", texbake.read_mesh(tmp_path / "a.obj"))
    assert found is not None and not found.missing
    assert sidecars(tmp_path / "a.mtl")[-1] == tmp_path / name


def test_sidecars_of_an_fbx_file(tmp_path):
    nodes = rich_scene(7400)
    file = ("RelativeFilename", ["maps\\wood.png"], [])
    nodes[1][2].append(("Texture", [60, "paint\0\1Texture", ""], [file]))
    (tmp_path / "a.fbx").write_bytes(binary(nodes))
    names = [path.relative_to(tmp_path).as_posix() for path in sidecars(tmp_path / "a.fbx")]
    assert names == ["maps/wood.png", "wood.png"]
    (tmp_path / "a.fbx").write_bytes(b"none")
    assert sidecars(tmp_path / "a.fbx") == []


def test_further_uv_sets_of_an_obj_file_count(tmp_path, write, run):
    mesh = uv_sphere(4, 6)
    path = write('[[assets]]\ninputs.high = "a.obj"\n', STEPS)
    for scale in (1.0, 0.5):
        sets = {"light": UvSet(scale * mesh.uvs, mesh.uv_faces)}
        write_mesh(mesh.replace(uv_sets=sets), tmp_path / "a.obj")
        assert run(path)[1] == ["a.r"]
    assert run(path)[1] == []


def test_warnings_of_readers_are_notes_of_the_step(tmp_path, write, run):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2\n")
    result, _ = run(write('[[assets]]\ninputs.high = "a.obj"\n', STEPS))
    notes = result.assets[0].steps[0].figures["notes"]
    assert any("left out 1 face with fewer than three corners" in note for note in notes)


def test_sidecars_of_a_gltf_file(tmp_path):
    (tmp_path / "a.gltf").write_text(
        '{"buffers": [{"uri": "a%20b.bin"}, {"uri": "data:;base64,AA"}],'
        ' "images": [{"uri": "c.png"}]}'
    )
    assert [path.name for path in sidecars(tmp_path / "a.gltf")] == ["a b.bin", "c.png"]
    (tmp_path / "w.gltf").write_text('{"buffers": [{"uri": "parts\\\\a.bin"}]}')
    assert tmp_path / "parts" / "a.bin" in sidecars(tmp_path / "w.gltf")
    content = glb_bytes({"images": [{"uri": "c%20d.png"}, {"bufferView": 0}]})
    (tmp_path / "a.glb").write_bytes(content)
    assert [path.name for path in sidecars(tmp_path / "a.glb")] == ["c d.png"]
    (tmp_path / "a.glb").write_bytes(content[:11])
    (tmp_path / "b.gltf").write_text("{")
    assert sidecars(tmp_path / "a.glb") == sidecars(tmp_path / "b.gltf") == []
    assert sidecars(tmp_path / "nothing.obj") == []


def test_a_name_that_readers_do_not_follow_is_not_read(tmp_path, write, run):
    """Its checksum would be in the store, for everybody who shares it to see."""
    (tmp_path / "asset").mkdir()
    (tmp_path / "asset" / "a.obj").write_text(OBJ.replace("my stuff.mtl", "../secret.mtl"))
    (tmp_path / "secret.mtl").write_text("newmtl a\nmap_Kd secret.png\n")
    path = write('[[assets]]\ninputs.high = "asset/a.obj"\n', STEPS)

    def is_in_build():
        run(path)
        secret = hashlib.sha256((tmp_path / "secret.mtl").read_bytes()).hexdigest()
        files = [file for file in (path.parent / "build").rglob("*") if file.is_file()]
        return any(secret.encode() in file.read_bytes() for file in files)

    assert not is_in_build()
    with raised_limits(allow_outside=True):
        assert is_in_build()
        (tmp_path / "secret.mtl").write_text("newmtl a\nKd 1 0 0\n")
        assert run(path)[1] == ["a.r"]


@pytest.mark.parametrize(("named", "is_read", "is_read_if_allowed"), [
    ("https://here/in/b.bin", True, True),
    ("https://here/in/deep/b.bin", True, True),
    ("https://here/other/b.bin", False, True),
    ("https://here/in-secret/b.bin", False, True),
    ("https://elsewhere/b.bin", False, False),
])  # fmt: skip
def test_no_other_machine_is_asked_for_a_file(named, is_read, is_read_if_allowed):
    assert is_followed("https://here/in/a.gltf", named) == is_read
    with raised_limits(allow_outside=True):
        assert is_followed("https://here/in/a.gltf", named) == is_read_if_allowed


def test_names_without_limit_take_no_more_than_the_file(tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl a\nmap_Kd " + "a " * 100_000)
    assert len(sidecars(tmp_path / "a.mtl")) == 1
    (tmp_path / "a.obj").write_text("mtllib " + " ".join(map(str, range(10_000))))
    assert len(sidecars(tmp_path / "a.obj")) == 10_002
    (tmp_path / "a.gltf").write_text("[" * 100_000)
    assert sidecars(tmp_path / "a.gltf") == []


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
@pytest.mark.parametrize("suffix", [".mtl", ".gltf", ".glb"])
def test_a_pipe_is_not_waited_for(suffix, tmp_path):
    os.mkfifo(tmp_path / f"a{suffix}")
    assert sidecars(tmp_path / f"a{suffix}") == []


@pytest.mark.parametrize(("library", "name"), [
    ("my stuff.mtl", "my stuff.mtl"),
    ("my stuff.mtl", "my wood.png"),
    ("my stuff.mtl", "gone.png"),
    ("one.mtl two.mtl", "one.mtl"),
    ("one.mtl two.mtl", "two.mtl"),
])  # fmt: skip
def test_a_change_in_one_builds_again(library, name, tmp_path, write, run):
    (tmp_path / "a.obj").write_text(OBJ.replace("my stuff.mtl", library))
    for file in ("my stuff.mtl", "one.mtl", "two.mtl"):
        (tmp_path / file).write_text(MTL)
    (tmp_path / "my wood.png").write_text("x")
    path = write('[[assets]]\ninputs.high = "a.obj"\n', STEPS)
    assert (run(path)[1], run(path)[1]) == (["a.r"], [])
    with (tmp_path / name).open("a") as changed:
        changed.write("\n# more")
    assert (run(path)[1], run(path)[1]) == (["a.r"], [])


def test_files_named_by_a_changed_material_count_from_then_on(tmp_path, write, run):
    (tmp_path / "a.obj").write_text(OBJ)
    (tmp_path / "my stuff.mtl").write_text("newmtl a\n")
    path = write('[[assets]]\ninputs.high = "a.obj"\n', STEPS)
    for name, content in (
        ("my stuff.mtl", MTL), ("my wood.png", "added later"), ("my wood.png", "changed"),
    ):  # fmt: skip
        time.sleep(0.1)  # beyond a tick of the clock, so that it is remembered
        run(path)
        (tmp_path / name).write_text(content)
        assert run(path)[1] == ["a.r"]


def test_sidecars_of_a_usd_file(tmp_path, capfd):
    pytest.importorskip("pxr", reason="usd-core is not installed")
    (tmp_path / "sub").mkdir()
    (tmp_path / "a.usda").write_text(
        "#usda 1.0\n( subLayers = [@sub/layer.usda@, @sub/none.usda@] )\n"
        'def Xform "a" (references = @sub/ref.usda@</X>) {\nasset t = @sub/t.png@\n}\n'
        'def Xform "b" (payload = @sub/pay.usda@</X>) {\n}\n'
    )
    for name in ("layer", "ref", "pay"):
        text = '#usda 1.0\ndef Xform "X" {\nasset k = @deep.png@\n}\n'
        (tmp_path / "sub" / f"{name}.usda").write_text(text)
    for name in ("t.png", "deep.png"):
        (tmp_path / "sub" / name).write_bytes(b"")
    found = {path.relative_to(tmp_path).as_posix() for path in sidecars(tmp_path / "a.usda")}
    layers = {f"sub/{name}.usda" for name in ("layer", "none", "ref", "pay")}
    assert found == {*layers, "sub/t.png", "sub/deep.png"}
    (tmp_path / "b.usda").write_text("#usda 1.0\nno{")
    assert sidecars(tmp_path / "b.usda") == []
    assert "".join(capfd.readouterr()) == ""


def test_one_that_changes_after_the_plan(tmp_path, write, inline):
    (tmp_path / "a.obj").write_text(OBJ)
    (tmp_path / "my stuff.mtl").write_text(MTL)
    path = write('[[assets]]\ninputs.high = "a.obj"\n', STEPS)
    for name in ("gone.png", "my stuff.mtl"):
        crew = inline()
        submit = crew.submit

        def change(number, task, name=name, submit=submit):
            (tmp_path / name).write_text("# another")
            submit(number, task)

        crew.submit = change
        (failed,) = build(path, workers=crew).failed
        assert f"{name}: it changed since the build looked at it" in failed.error


def test_one_that_changes_while_it_is_read(tmp_path, write, run, monkeypatch):
    from texbake.mesh.repair import RepairReport

    (tmp_path / "a.obj").write_text(OBJ)
    (tmp_path / "my stuff.mtl").write_text(MTL)

    def change(mesh, options):
        (tmp_path / "my stuff.mtl").write_text("# another")
        return mesh, RepairReport(mesh.n_faces, {})

    monkeypatch.setattr("texbake.mesh.repair.repair", change)
    result, _ = run(write('[[assets]]\ninputs.high = "a.obj"\n', STEPS))
    assert "my stuff.mtl: it changed while r read it" in result.failed[0].error


def test_those_behind_a_url_are_fetched_and_count(tmp_path, write, run):
    fsspec = pytest.importorskip("fsspec", reason="fsspec is not installed")
    from texbake.mesh.files import read_mesh, write_mesh
    from texbake.mesh.shapes import uv_sphere

    fs = fsspec.filesystem("memory")
    write_mesh(uv_sphere(4, 6), tmp_path / "a.glb")
    document, data = read_glb(tmp_path / "a.glb")
    document["buffers"][0]["uri"] = "bin/a%20b.bin"
    fs.pipe("/with/in/a.gltf", json.dumps(document).encode())
    fs.pipe("/with/in/bin/a b.bin", data)
    steps = STEPS + 'output = "{asset}.{ext}"\n'
    path = write('[[assets]]\ninputs.high = "memory://with/in/a.gltf"\n', steps)
    result, ran = run(path)
    assert result.ok and ran == ["a.r"], result.failed
    assert read_mesh(path.parent / "build" / "a.ply").n_faces == uv_sphere(4, 6).n_faces
    assert run(path)[1] == []
    fs.pipe("/with/in/bin/a b.bin", data + bytes(4))
    assert run(path)[1] == ["a.r"]
    fs.rm("/with/in/bin/a b.bin")
    (failed,) = run(path)[0].failed
    assert "b.bin" in failed.error
