"""What commands on a pair of meshes write and print."""

import json
from pathlib import Path

import numpy as np
import pytest

from texbake import distortion, read_mesh, write_image
from texbake.jobs.light_maps import file_names
from texbake.metadata import DISPLACEMENT_MID, DISPLACEMENT_SCALE


@pytest.mark.parametrize(("line", "name"), [
    ("bake-normals high.ply low.obj -o n.png --size 64 --padding 1 --threads 1", "n.png"),
    ("bake-texture low.obj -o t.exr --procedure noise --scale 3,1,1 --size 32", "t.exr"),
])  # fmt: skip
def test_command_as_a_process(line, name, workplace, run, only_known_lines):
    done = run(line)
    assert done.returncode == 0, done.stderr
    assert (workplace / name).stat().st_size > 0
    assert "\x1b" not in done.stdout + done.stderr  # no color, no bar: this is no terminal
    assert only_known_lines(done.stderr)


def test_info_prints_json_alone(workplace, run):
    done = run("info high.ply --json")
    found = json.loads(done.stdout)
    assert (found["n_faces"], found["n_vertices"]) == (11_400, 5_800)
    assert found["n_boundary_edges"] == 200  # the two rings about the poles
    assert done.stderr == ""
    assert "triangles" not in run("info high.ply").stdout  # all faces are
    Path("quad.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    assert "faces 1 triangles 2 vertices 4" in " ".join(run("info quad.obj").stdout.split())


def test_info_lists_materials_and_images(workplace, invoke):
    write_image(np.zeros((8, 16, 3), dtype=np.float32), "paint.png", color=True)
    Path("paint.mtl").write_text("newmtl skin\nmap_Kd paint.png\nmap_Bump missing.png\n")
    Path("painted.obj").write_text("mtllib paint.mtl\nusemtl skin\n" + Path("low.obj").read_text())
    text = " ".join(invoke("info painted.obj").stdout.split())
    assert "material skin base-color (paint.png), bump (missing.png)" in text
    assert "image paint.png 16 x 8, 3 channels" in text
    assert "image missing.png missing or not readable" in text
    assert "up axis not in the file" in text
    found = json.loads(invoke("info painted.obj --json").stdout)
    assert found["images"] == {"paint.png": [16, 8, 3], "missing.png": None}
    assert found["materials"][0]["channels"]["base-color"] == "paint.png"


def test_a_projector_can_be_a_matrix(workplace, invoke):
    # Looks along -z, in parallel: s = (x + 1) / 2, t = (y + 1) / 2.
    Path("slide.txt").write_text("0.5 0 0 0.5  0 0.5 0 0.5  0 0 -1 1  0 0 0 1")
    invoke("unwrap low.obj -o out.obj --method projector --matrix slide.txt --unseen project")
    mesh = read_mesh("out.obj")
    positions = mesh.positions[mesh.faces]
    np.testing.assert_allclose(mesh.corner_uvs(), (positions[:, :, :2] + 1.0) / 2.0, atol=1e-9)


def test_report_has_settings_figures_and_the_coding_of_heights(workplace, invoke):
    line = "bake-displacement high.ply low.obj -o d.png --size 32 --report r.json"
    invoke(f"{line} --mid 0.25 --scale 0.5")
    report = json.loads(Path("r.json").read_text())
    assert report["options"]["mid"] == 0.25
    assert report["inputs"] == {"high": ["high.ply"], "low": ["low.obj"]}
    assert report["texels_covered"] > 0
    assert report["files"]["displacement"] == {
        "path": "d.png", "bits": 16, "metadata": {DISPLACEMENT_MID: 0.25, DISPLACEMENT_SCALE: 0.5},
        "n_clipped": 0,
    }  # fmt: skip
    stages = [stage["name"] for stage in report["stages"]]
    assert (stages[0], stages[-1]) == ("read meshes", "write maps")
    assert report["seconds"] == pytest.approx(sum(stage["seconds"] for stage in report["stages"]))


def test_clipped_heights_are_reported(workplace, invoke):
    line = "bake-displacement high.ply low.obj -o d.png --size 32 --padding 0 --quiet"
    assert invoke(line).stderr == ""
    message = invoke(f"{line} --scale 0.001").stderr
    assert "d.png: " in message and " clipped to the range" in message


def test_progress_as_json(workplace, run):
    done = run("bake-normals high.ply low.obj -o n.png --size 32 --padding 0 --progress json")
    events = [json.loads(line) for line in done.stderr.splitlines()]
    started = [event["stage"] for event in events if event["event"] == "started"]
    finished = [event["stage"] for event in events if event["event"] == "finished"]
    assert started[:2] == ["read low.obj", "read high.ply"]
    assert sorted(started) == sorted(finished)


def test_the_figures_of_the_whole_and_of_the_worst(workplace, invoke):
    found = distortion(read_mesh("low.obj"), 2048)
    text = invoke("info low.obj --uv --size 2048").stdout
    assert f"stretch L2                   {found.stretch.l2:.4f}" in text
    assert "(4 at best)" in text and f"{found.texel_density:.6g}, varying by" in text
    lines = [line.split() for line in text.splitlines()]
    start = next(i for i, line in enumerate(lines) if line[:1] == ["face"])
    named = [int(line[0]) for line in lines[start + 1 :]]
    assert named == [face.face for face in found.worst_faces]
    charts = next(i for i, line in enumerate(lines) if line[:2] == ["chart", "L2"])
    assert lines[charts + 1][:2] == ["0", f"{found.charts[0].stretch.l2:.4f}"]


def test_json_has_everything(workplace, invoke):
    written = json.loads(invoke("info low.obj --uv --json").stdout)
    assert written["n_faces"] == 112
    assert written["distortion"] == distortion(read_mesh("low.obj")).to_json()
    assert "distortion" not in json.loads(invoke("info low.obj --json").stdout)


def test_objects_of_one_name_get_files_of_their_own():
    names = ["lamp", "Lamp", "lamp_2", "a/b", "..", "", "Stra\u00dfe 1"]
    files = file_names(names)
    assert files == ["lamp", "Lamp_2", "lamp_2_2", "a_b", "object", "object_2", "Stra\u00dfe_1"]
    assert len({name.lower() for name in files}) == len(names)
