"""`texbake bake --hits` and `texbake remap`."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from texbake_cli.main import texbake

from texbake import read_image, write_image, write_mesh
from texbake.mesh.shapes import icosphere, uv_sphere


def run(*words):
    """Run a command line, word by word, since paths may have spaces."""
    result = CliRunner().invoke(texbake, [str(word) for word in words])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


@pytest.fixture(scope="module")
def baked(tmp_path_factory):
    """A folder with both meshes, an image, a trace, and maps of it."""
    folder = tmp_path_factory.mktemp("remap")
    high = icosphere(4)
    high = high.replace(
        colors=(0.5 + 0.5 * high.positions).astype(np.float32),
        uvs=0.5 + 0.5 * high.positions[:, :2],
        uv_faces=high.faces,
    )
    write_mesh(high, folder / "ball high.ply")
    write_mesh(uv_sphere(8, 16), folder / "ball.obj")
    write_image(np.random.default_rng(1).random((9, 9, 3)), folder / "image.png", color=True)
    result = run(
        "bake", folder / "ball high.ply", folder / "ball.obj", "-o", folder / "maps",
        "--size", "48", "--maps", "normal,base-color,vertex-color,material-id",
        "--high-texture", folder / "image.png", "--hits", folder / "a.npz",
        "--report", folder / "a.json",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    assert f"wrote {folder / 'a.npz'}" in result.output
    return folder


def test_the_same_maps_come_from_the_trace_alone(baked, tmp_path):
    result = run("remap", baked / "a.npz", "-o", tmp_path / "maps")
    assert result.exit_code == 0, result.output
    files = sorted(path.name for path in (tmp_path / "maps").iterdir())
    assert files == ["base-color.png", "material-id.png", "normal.png", "vertex-color.png"]
    for name in files:
        assert (tmp_path / "maps" / name).read_bytes() == (baked / "maps" / name).read_bytes()


def test_other_maps_are_those_of_a_bake(baked, tmp_path):
    choices = ["--maps", "normal,position,curvature,displacement", "--convention", "directx"]
    choices += ["--bits", "8", "--mid", "0.25", "--padding", "1", "--curvature-scale", "3"]
    meshes = [baked / "ball high.ply", baked / "ball.obj"]
    bake = run("bake", *meshes, "-o", tmp_path / "bake", "--size", "48", *choices)
    remap = run("remap", baked / "a.npz", "-o", tmp_path / "remap", *choices)
    assert (bake.exit_code, remap.exit_code) == (0, 0), remap.output
    files = sorted(path.name for path in (tmp_path / "bake").iterdir())
    assert len(files) == 4
    for name in files:
        assert (tmp_path / "bake" / name).read_bytes() == (tmp_path / "remap" / name).read_bytes()


def test_files_are_named_by_a_pattern(baked, tmp_path):
    pattern = "{asset}_{map}_{udim}.{ext}"
    result = run(
        "remap", baked / "a.npz", "-o", tmp_path, "--maps", "normal", "--format", "exr",
        "--name-pattern", pattern,
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    assert [path.name for path in tmp_path.iterdir()] == ["ball_normal_1001.exr"]
    result = run(
        "bake", baked / "ball high.ply", baked / "ball.obj", "-o", tmp_path / "b", "--size", "16",
        "--name-pattern", "{asset}.{ext}", "--maps", "normal,position",
    )  # fmt: skip
    assert result.exit_code == 2
    assert "two maps the same name" in result.output


def test_the_report_lists_the_colors_of_ids(baked, tmp_path):
    result = run(
        "remap", baked / "a.npz", "-o", tmp_path, "--maps", "material-id",
        "--report", tmp_path / "a.json",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    report = json.loads((tmp_path / "a.json").read_text())
    (table,) = [file["metadata"] for file in report["files"].values()]
    ((key, name),) = table.items()
    assert name == "image.png"
    color = [int(key[-6:][i : i + 2], 16) for i in (0, 2, 4)]
    pixels = read_image(tmp_path / "material-id.png", color=False).pixels
    codes = np.unique(np.rint(pixels.reshape(-1, 3) * 255).astype(int), axis=0).tolist()
    assert codes == [color]  # the low-poly ball's charts fill the square


def test_a_map_of_rays_that_were_not_kept_is_one_line(baked, tmp_path):
    result = run("remap", baked / "a.npz", "-o", tmp_path / "maps", "--maps", "ao")
    assert result.exit_code == 2
    assert "ao: the kept hits lack the rays for it" in result.output
    assert not (tmp_path / "maps").exists()
