"""Assets of many parts on the command line."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from texbake_cli.main import texbake

from texbake import read_image, write_mesh
from texbake.mesh.compose import join_meshes
from texbake.mesh.shapes import plane


def square(name: str, x: float, *, z: float = 0.0, u: float = 0.0):
    mesh = plane(3, 3)
    return mesh.replace(
        positions=mesh.positions + np.array([x, 0.0, z]),
        uvs=mesh.uvs * [0.4, 0.9] + np.array([u + 0.05, 0.05]),
        name=name,
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Meshes of two parts, once in one file and once in folders; one with tiles."""
    folder = tmp_path_factory.mktemp("parts")
    high = [square("arm_high", 0, z=0.1), square("leg_high.001", 2, z=0.2), square("x_high", 9)]
    low = [square("arm_low", 0), square("LEG_low", 2, u=0.5), square("y_low", 30, u=0.5)]
    write_mesh(join_meshes(high), folder / "high.obj")
    write_mesh(join_meshes(low), folder / "low.obj")
    write_mesh(join_meshes([low[0], square("LEG_low", 2, u=1.5)]), folder / "tiles.obj")
    for side, meshes in (("high", high), ("low", low[:2])):
        (folder / side).mkdir()
        for mesh in meshes:
            write_mesh(mesh, folder / side / f"{mesh.name}.obj")
    return folder


@pytest.fixture
def run(tmp_path):
    def run(*words):
        return CliRunner().invoke(
            texbake, ["bake", *map(str, words), "-o", str(tmp_path / "maps"), "--size", "32"]
        )

    return run


def heights(path):
    return read_image(path, color=False).pixels[:, :, 0]


def test_a_dry_run_prints_the_matches_and_bakes_nothing(run, folder, tmp_path):
    report = tmp_path / "report.json"
    result = run(
        folder / "high.obj", folder / "low.obj", "--match-by-name", "--dry-run", "--report", report
    )
    assert result.exit_code == 0, result.output
    assert "arm_low  from arm_high" in result.output
    assert "LEG_low  from leg_high.001" in result.output
    assert "warning: y_low: no high-poly part of that name, so not baked" in result.output
    assert "warning: x_high: no low-poly part of that name, so not used" in result.output
    assert not (tmp_path / "maps").exists()
    matching = json.loads(report.read_text())["matching"]
    assert matching["matches"] == [
        {"base": "arm", "low": "arm_low", "high": ["arm_high"]},
        {"base": "LEG", "low": "LEG_low", "high": ["leg_high.001"]},
    ]
    assert (matching["low_left_over"], matching["high_left_over"]) == (["y_low"], ["x_high"])


@pytest.mark.parametrize("as_folders", [False, True], ids=["groups", "folders"])
def test_parts_are_baked_from_their_matches(run, folder, tmp_path, as_folders):
    end = "" if as_folders else ".obj"
    result = run(
        folder / f"high{end}", folder / f"low{end}", "--match-by-name", "--maps", "displacement",
        "--format", "exr",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    found = heights(tmp_path / "maps" / "displacement.exr")
    np.testing.assert_allclose(found[8:24, 4:12], 0.1, rtol=1e-5)
    np.testing.assert_allclose(found[8:24, 20:28], 0.2, rtol=1e-5)


def test_sets_have_files_of_their_own(run, folder, tmp_path):
    result = run(
        folder / "high.obj", folder / "low.obj", "--match-by-name", "--texture-sets", "groups",
        "--maps", "normal,displacement", "--miss-map", tmp_path / "miss.png",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    names = sorted(path.name for path in (tmp_path / "maps").iterdir())
    assert names == ["LEG_displacement.png", "LEG_normal.png", "arm_displacement.png",
                     "arm_normal.png"]  # fmt: skip
    assert sorted(path.name for path in tmp_path.glob("miss*")) == [
        "miss_LEG_1001.png",
        "miss_arm_1001.png",
    ]


def test_tiles_have_files_of_their_own(run, folder, tmp_path):
    report = tmp_path / "report.json"
    result = run(
        folder / "high.obj", folder / "tiles.obj", "--maps", "displacement", "--format", "exr",
        "--name-pattern", "{asset}_{map}_{udim}.{ext}", "--report", report,
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    first, second = (
        heights(tmp_path / "maps" / f"tiles_displacement_{udim}.exr") for udim in (1001, 1002)
    )
    np.testing.assert_allclose(first[8:24, 4:12], 0.1, rtol=1e-5)
    np.testing.assert_allclose(second[8:24, 20:28], 0.2, rtol=1e-5)
    assert [item["udim"] for item in json.loads(report.read_text())["targets"]] == [1001, 1002]


def test_one_tile_is_a_plain_bake(run, folder, tmp_path):
    """A pattern with one tile allows whatever a plain bake allows, such as a page or kept hits."""
    result = run(
        folder / "high.obj", folder / "low.obj", "--name-pattern", "{map}_{udim}.{ext}",
        "--hits", tmp_path / "hits.npz",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    assert (tmp_path / "maps" / "normal_1001.png").is_file()


def test_more_meshes_share_an_atlas(run, folder, tmp_path):
    result = run(
        folder / "low" / "arm_low.obj", "--low", folder / "low" / "LEG_low.obj",
        "--high", folder / "high", "--maps", "displacement", "--format", "exr",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    found = heights(tmp_path / "maps" / "displacement.exr")
    np.testing.assert_allclose(found[8:24, 4:12], 0.1, rtol=1e-5)
    np.testing.assert_allclose(found[8:24, 20:28], 0.2, rtol=1e-5)


def test_images_skew_and_offset_rays(run, folder, tmp_path):
    from texbake import write_image

    mask = tmp_path / "mask 1001.png"
    write_image(np.full((4, 4, 1), 255, np.uint8), mask, color=False)
    plain = [folder / "high.obj", folder / "tiles.obj", "--name-pattern", "{map}_{udim}.{ext}"]
    one = run(folder / "high.obj", folder / "low.obj", "--skew-mask", mask, "--offset-map", mask)
    assert one.exit_code == 0, one.output
    missing = run(*plain, "--skew-mask", tmp_path / "mask {udim}.png")
    assert missing.exit_code == 1
    assert "mask 1002.png" in missing.output
    assert not list((tmp_path / "maps").glob("*100*"))


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["high.obj", "low.obj", "--match-by-name", "--low-suffix", "_lp"], 1, "no low-poly part"),
        (["high.obj", "low.obj", "--match-by-name", "--hits", "h.npz"], 2, "hits: is for the bake"),
        (["high.obj", "low.obj", "--match-by-name", "--html", "h.html"], 2, "html: is for the"),
        (["high.obj", "low.obj", "--texture-sets", "materials"], 1, "no materials"),
        (
            ["high.obj", "low.obj", "--texture-sets", "groups", "--name-pattern", "{map}.x.{ext}"],
            2,
            "put {set} in it",
        ),
        (["low.obj", "--high", "empty"], 1, "no mesh in it"),
        (["--high", "high.obj"], 2, "LOW: it is missing"),
        (["high.obj"], 2, "LOW: it is missing"),
        (["high.obj", "low.obj", "--time-budget", "1s", "--match-by-name"], 2, "time-budget"),
    ],
)
def test_impossible_options_are_one_line(run, folder, words, code, message, monkeypatch):
    (folder / "empty").mkdir(exist_ok=True)
    monkeypatch.chdir(folder)
    result = run(*words)
    assert result.exit_code == code, result.output
    assert message in result.output
    assert "Traceback" not in result.output


def test_an_asset_in_other_units_is_refused(run, tmp_path):
    for side, scale in (("low", 1.0), ("high", 100.0)):
        (tmp_path / side).mkdir()
        for name, x, u in (("arm", 0, 0.0), ("leg", 2, 0.5)):
            mesh = square(f"{name}_{side}", x, z=1.0, u=u)
            mesh = mesh.replace(positions=scale * mesh.positions)
            write_mesh(mesh, tmp_path / side / f"{mesh.name}.obj")
    result = run(tmp_path / "high", tmp_path / "low", "--match-by-name")
    assert result.exit_code == 1
    assert "arm_low.obj and 1 more: The high-poly mesh is 100" in result.stderr
    assert "times as large" in result.stderr
    assert not (tmp_path / "maps").exists()


@pytest.mark.parametrize(
    ("words", "is_matched", "has_warning"),
    [
        ([], True, False),
        (["--join-objects"], False, False),
        (["--hits", "hits.npz"], False, True),
    ],
)
def test_objects_whose_names_pair_up_are_matched(
    run, tmp_path, monkeypatch, words, is_matched, has_warning
):
    monkeypatch.chdir(tmp_path)
    high, low = ([square("a", 0, z=z), square("b", 2, z=z, u=0.5)] for z in (0.1, 0.0))
    write_mesh(join_meshes(high), "high.obj")
    write_mesh(join_meshes(low), "low.obj")
    result = run("high.obj", "low.obj", *words)
    assert result.exit_code == 0, result.output
    own = "2 objects, each baked from the one with the matching name"
    assert (own in result.output) == is_matched
    assert ("have the same names" in result.output) == has_warning
