"""Models that no modeling program means to write: each command has a result, or one clear line."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from texbake_cli.main import texbake

from tests.fbx_writer import binary, scene
from texbake import Mesh, read_mesh, write_mesh
from texbake.mesh.normals import smooth_normals
from texbake.mesh.shapes import plane, uv_sphere

COMMANDS = {
    "info": "info {model}",
    "check": "check {model}",
    "simplify": "simplify {model} -o {out}/simple.ply --faces 60",
    "remesh": "remesh {model} -o {out}/around.ply --resolution 32",
    "convert": "convert {model} {out}/converted.glb",
    "lighten": "lighten {model} -o {out}/light.glb --faces 60 --size 256 --views 1",
    "run": "run {model} -o {out}/run --faces 60 --size 64",
}
every_command = pytest.mark.parametrize("command", COMMANDS)


@pytest.fixture
def answer(tmp_path, small_pictures):
    """What a command says of a model: its exit code and the lines on stderr."""

    def answer(command, path):
        out = tmp_path / "out"
        out.mkdir()
        words = [word.format(model=path, out=out) for word in COMMANDS[command].split()]
        result = CliRunner().invoke(texbake, words)
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        if result.exit_code:
            files = [file for file in out.rglob("*") if file.is_file()]
            assert not files, "a part of the result was left behind"
        return result

    return answer


def gltf(path, nodes):
    """A sphere in a glTF file, below nodes."""
    ball = uv_sphere(8, 12)
    positions = ball.positions.astype("<f4")
    path.with_suffix(".bin").write_bytes(positions.tobytes() + ball.faces.astype("<u4").tobytes())
    views = [(0, positions.nbytes), (positions.nbytes, 12 * ball.n_faces)]
    accessors = [
        {"componentType": 5126, "type": "VEC3", "count": len(positions)},
        {"componentType": 5125, "type": "SCALAR", "count": 3 * ball.n_faces},
    ]
    document = {
        "asset": {"version": "2.0"},
        "buffers": [{"uri": f"{path.stem}.bin", "byteLength": sum(views[1])}],
        "bufferViews": [{"buffer": 0, "byteOffset": at, "byteLength": n} for at, n in views],
        "accessors": [{**a, "bufferView": i} for i, a in enumerate(accessors)],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": nodes,
        "scenes": [{"nodes": [0]}],
    }
    path.write_text(json.dumps(document))


def fbx(path, models, **options):
    path.write_bytes(binary(scene(models=models, **options)))


def moved(**transform):
    return lambda path: gltf(path, [{"mesh": 0, **transform}])


REFUSED = {
    "nodes in a cycle.gltf": (
        lambda path: gltf(path, [{"mesh": 0, "children": [1]}, {"children": [0]}]),
        "stands twice in the scene",
    ),
    "a node below itself.gltf": (
        lambda path: gltf(path, [{"mesh": 0, "children": [0]}]), "stands twice in the scene",
    ),
    "nan.gltf": (moved(translation=[float("nan"), 0, 0]), "'translation' is not 3 numbers"),
    "models in a cycle.fbx": (
        lambda path: fbx(path, {"a": ({}, "b"), "b": ({}, "a"), "c": ({}, None)}),
        "its models stand in a cycle",
    ),
    "nan.fbx": (
        lambda path: fbx(path, {"a": ({"Lcl Translation": [np.nan, 0.0, 0.0]}, None)}),
        "its transform is not finite",
    ),
    "points alone.obj": (
        lambda path: path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n"), "it has no faces",
    ),
    "empty.gltf": (lambda path: gltf(path, [{}]), "it has no faces"),
}  # fmt: skip


# Every model with one command, and every command with all kinds of files.
@pytest.mark.parametrize(("name", "command"), [
    (name, list(COMMANDS)[(i + shift) % len(COMMANDS)])
    for i, name in enumerate(REFUSED)
    for shift in (0, 3)
])  # fmt: skip
def test_models_that_are_refused(answer, tmp_path, command, name):
    make, reason = REFUSED[name]
    make(tmp_path / name)
    result = answer(command, tmp_path / name)
    assert result.exit_code == 1
    if command == "check":
        assert "1 error" in result.stdout
        assert reason in " ".join(result.stdout.split())
    else:
        assert reason in result.stderr
        assert result.stderr.count("\n") == 1


@every_command
@pytest.mark.parametrize("scale", [[0, 0, 0], [1e-200, 1e-200, 1e-200]], ids=["zero", "least"])
def test_a_model_at_one_point(answer, tmp_path, command, scale):
    path = tmp_path / "a.gltf"
    moved(scale=scale)(path)
    result = answer(command, path)
    if command in ("info", "convert"):  # which keeps the node that scales it
        assert result.exit_code == 0
    elif result.exit_code:
        assert result.stdout if command == "check" else result.stderr.count("\n") == 1


@every_command
def test_a_model_far_too_large(answer, tmp_path, command):
    path = tmp_path / "a.gltf"
    moved(scale=[1e200, 1e200, 1e200])(path)
    result = answer(command, path)
    if command == "check":
        assert result.exit_code == 1
        assert "Scale it first" in result.stdout
    elif result.exit_code:
        assert "scale it" in result.stderr
        assert result.stderr.count("\n") == 1


@every_command
def test_a_model_that_is_all_cavities(answer, tmp_path, command):
    """Twenty balls of 168 faces, which face inwards."""
    ball = uv_sphere(8, 12)
    centers = np.stack([np.arange(20) % 5, np.arange(20) // 5, np.zeros(20)], axis=1)
    positions = (0.4 * ball.positions + centers[:, None]).reshape(-1, 3)
    faces = ball.faces[:, ::-1] + len(ball.positions) * np.arange(20)[:, None, None]
    path = tmp_path / "a.ply"
    write_mesh(Mesh(positions=positions, faces=faces.reshape(-1, 3)), path)
    result = answer(command, path)
    assert result.exit_code == int(command == "check")
    if command in ("simplify", "run"):
        assert "flipped 3,360 triangles" in result.stderr


@pytest.mark.parametrize("has_normals", [False, True])
def test_simplify_turns_an_open_tray_unless_the_file_has_its_normals(invoke, tmp_path, has_normals):
    """A tray of one sheet, whose inside is shown."""
    tray = plane(16, 16, lambda x, y: 0.4 * (np.maximum(abs(x - 0.5), abs(y - 0.5)) > 0.45))
    if has_normals:
        tray = tray.replace(normals=smooth_normals(tray), normal_faces=tray.faces)
    source, result = tmp_path / "tray.ply", tmp_path / "low.ply"
    write_mesh(tray.replace(uvs=None, uv_faces=None), source)
    invoke(f"simplify {source} -o {result} --faces 60")
    low = read_mesh(result)
    a, b, c = np.moveaxis(low.positions[low.faces], 1, 0)
    up = np.cross(b - a, c - a).sum(axis=0)[2]
    assert (up > 0.0) == has_normals


def many_materials(path):
    """A strip of 2,000 triangles, each with a material of its own."""
    n = 2000
    points = [f"v {i / 2} {i % 2} 0\n" for i in range(n + 2)]
    order = [(1, 2, 3), (2, 1, 3)]
    faces = [f"usemtl m{i}\nf {' '.join(str(i + j) for j in order[i % 2])}\n" for i in range(n)]
    path.write_text("".join(["mtllib a.mtl\n", *points, *faces]))
    materials = [f"newmtl m{i}\nKd {i / n} 0.5 0.5\n" for i in range(n)]
    path.with_name("a.mtl").write_text("".join(materials))


def test_pictures_of_two_thousand_materials_are_not_compared(answer, tmp_path):
    many_materials(tmp_path / "a.obj")
    result = answer("lighten", tmp_path / "a.obj")
    assert result.exit_code == 0, result.stderr
    assert "it has more than 1,000 parts, so its pictures are not compared" in result.stderr
