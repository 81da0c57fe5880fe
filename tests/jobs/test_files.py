"""Jobs from files to files: what they write, what they return, and what they refuse."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from texbake_cli.main import texbake as cli

import texbake
from texbake import BakeOptions
from texbake.errors import FileError, FileFormatError, MeshError
from texbake.jobs.maps import BakeFiles, bake_files
from texbake.jobs.outputs import write_report
from texbake.mesh.hard_edges import with_normals
from texbake.mesh.normals import face_normals
from texbake.mesh.shapes import cube, uv_sphere
from texbake.verbs.info import info_file
from texbake.verbs.make import make_file
from texbake.verbs.map_bakes import remap_files
from texbake.verbs.simplify import simplify_file, simplify_levels
from texbake.verbs.unwrap import unwrap_files

SIXTY = texbake.SimplifyOptions(n_faces=60)
OPTIONS = BakeOptions(maps=("normal", "displacement"), size=32, padding=1, samples=1)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a mesh that has texture coordinates and one that has none."""
    monkeypatch.chdir(tmp_path)
    texbake.write_mesh(uv_sphere(8, 16), "ball.obj")
    texbake.write_mesh(uv_sphere(8, 16).replace(uvs=None, uv_faces=None), "bare.ply")
    return tmp_path


def test_a_bake_of_files_is_a_bake_of_their_meshes(folder):
    done = bake_files("ball.obj", "ball.obj", "maps", OPTIONS)
    assert done.files == (Path("maps/normal.png"), Path("maps/displacement.png"))
    assert all(path.is_file() for path in done.files)
    mesh = texbake.read_mesh("ball.obj")
    texbake.bake(mesh, mesh, OPTIONS).maps["normal"].write("expected.png")
    assert Path("expected.png").read_bytes() == Path("maps/normal.png").read_bytes()
    assert done.maps["normal"].bits == 16
    assert [stage.name for stage in done.report.stages][:1] == ["read meshes"]


@pytest.mark.parametrize(("high", "changes", "is_warned"), [
    (cube(), {}, True),
    (cube(), {"high_shading": "flat"}, False),
    (cube(), {"maps": ("displacement",)}, False),
    (with_normals(cube()), {}, False),
    (uv_sphere(16, 32).replace(uvs=None, uv_faces=None), {}, False),
])  # fmt: skip
def test_a_warning_says_that_a_bake_rounds_sharp_edges(folder, high, changes, is_warned):
    texbake.write_mesh(high, "high.obj")
    done = bake_files("high.obj", "ball.obj", "maps", replace(OPTIONS, **changes))
    assert any("sharp edges rounded" in warning for warning in done.warnings) == is_warned


def test_the_command_in_that_warning_makes_the_sharp_edges_hard(folder):
    ring = np.array([[np.cos(a), np.sin(a)] for a in np.arange(8) * np.pi / 4])
    prism = texbake.Mesh(
        positions=np.vstack([np.insert(ring, 2, z, axis=1) for z in (0.0, 1.0)]),
        faces=[
            *((0, i + 1, i) for i in range(1, 7)),
            *((8, 8 + i, 9 + i) for i in range(1, 7)),
            *((i, (i + 1) % 8, 8 + (i + 1) % 8) for i in range(8)),
            *((i, 8 + (i + 1) % 8, 8 + i) for i in range(8)),
        ],
    )
    texbake.write_mesh(prism, "high.stl")
    (warning,) = (
        line for line in bake_files("high.stl", "ball.obj", "maps", OPTIONS).warnings
        if "sharp edges rounded" in line
    )  # fmt: skip
    assert CliRunner().invoke(cli, warning.split("texbake ")[1].split()).exit_code == 0
    hard = texbake.read_mesh("OUT.obj")
    assert np.allclose(hard.normals[hard.normal_faces], face_normals(hard)[:, np.newaxis])


def test_maps_go_to_files_of_any_name_and_come_again_from_a_trace(folder):
    done = bake_files("ball.obj", "ball.obj", {"normal": "n.tga"}, OPTIONS, BakeFiles(hits="h.npz"))
    assert set(done.maps) == {"normal"} and done.files == (Path("n.tga"), Path("h.npz"))
    again = remap_files("h.npz", "again", format="tga")
    assert Path("again/normal.tga").read_bytes() == Path("n.tga").read_bytes()
    assert again.files == (Path("again/normal.tga"),)


def test_meshes_one_after_another(folder):
    low = simplify_file("bare.ply", "low.obj", SIXTY, report="low.json")
    assert low.report.n_faces <= 60 and low.files == (Path("low.obj"), Path("low.json"))
    fine, coarse = simplify_levels("bare.ply", [(100, "a.obj"), (60, "b.obj")])
    assert fine.report.n_faces > coarse.report.n_faces
    assert Path("b.obj").read_bytes() == Path("low.obj").read_bytes()
    mapped = unwrap_files("low.obj", "mapped.obj", layout="layout.svg")
    assert mapped.files == (Path("mapped.obj"), Path("layout.svg"))
    assert info_file("mapped.obj", uv=True, size=64).report.distortion is not None
    assert info_file("low.obj").report.distortion is None


@pytest.mark.parametrize("name", ["mapped.stl", "mapped.OFF"])
def test_a_file_without_room_for_coordinates_is_refused(folder, name):
    with pytest.raises(FileFormatError, match=f"{name}: .* hold no texture coordinates"):
        unwrap_files("no such file.ply", name)  # before anything is read
    with pytest.raises(FileFormatError, match="hold no texture coordinates"):
        unwrap_files([name, "bare.ply"], "folder")
    assert not unwrap_files("bare.ply", "mapped.ply").warnings


@pytest.mark.parametrize("radius", [1e-320, 1e308])
def test_a_shape_that_cannot_be_measured_is_not_written(folder, radius):
    output = folder / "ball.ply"
    with pytest.raises(MeshError, match="its areas cannot be computed; scale it first"):
        make_file("sphere", output, texbake.MakeOptions(radius=radius))
    assert not output.exists()


def test_a_report_comes_back_as_it_was(tmp_path):
    report = {"a": [1, 2.5, None], "b": {"c": True, "d": "é"}, "e": (1, 2)}
    write_report(tmp_path / "r.json", {**report, "f": Path("g/h.png")})
    read = json.loads((tmp_path / "r.json").read_text("utf-8"))
    assert read == {**report, "e": [1, 2], "f": "g/h.png"}


def test_numbers_that_json_lacks_are_null(tmp_path):
    write_report(tmp_path / "r.json", {"psnr": math.inf, "deep": [{"mean": math.nan}]})
    text = (tmp_path / "r.json").read_text()
    assert json.loads(text) == {"psnr": None, "deep": [{"mean": None}]}
    assert "NaN" not in text


def test_a_report_that_cannot_be_written_leaves_the_old_one(tmp_path):
    path = tmp_path / "r.json"
    path.write_text("earlier")
    with pytest.raises(TypeError):
        write_report(path, {"what": object()})
    assert path.read_text() == "earlier"
    with pytest.raises(FileError, match="there is no folder"):
        write_report(tmp_path / "no" / "r.json", {})
