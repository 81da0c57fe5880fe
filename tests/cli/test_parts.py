"""Assets of many parts on the command line."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from texbake_cli.main import texbake

from texbake import read_image, write_image, write_mesh
from texbake.mesh.compose import join_meshes
from texbake.mesh.shapes import plane


def square(name, x, *, z=0.0, u=0.0):
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
def run(folder, tmp_path, monkeypatch):
    """Bake in a current folder of the meshes; what is made lies in `tmp_path`."""
    monkeypatch.chdir(folder)

    def run(line, exit_code=0):
        words = line.replace("OUT", str(tmp_path)).split()
        done = CliRunner().invoke(
            texbake, ["bake", *words, "-o", f"{tmp_path}/maps", "--size", "32"]
        )
        assert done.exit_code == exit_code and "Traceback" not in done.output, done.output
        return done

    return run


def heights(path):
    return read_image(path, color=False).pixels[:, :, 0]


def test_a_dry_run_prints_the_matches_and_bakes_nothing(run, tmp_path):
    result = run("high.obj low.obj --match-by-name --dry-run --report OUT/report.json")
    assert "arm_low  from arm_high" in result.output
    assert "LEG_low  from leg_high.001" in result.output
    assert "warning: y_low: no high-poly part of that name, so not baked" in result.output
    assert "warning: x_high: no low-poly part of that name, so not used" in result.output
    assert not (tmp_path / "maps").exists()
    matching = json.loads((tmp_path / "report.json").read_text())["matching"]
    assert matching["matches"] == [
        {"base": "arm", "low": "arm_low", "high": ["arm_high"]},
        {"base": "LEG", "low": "LEG_low", "high": ["leg_high.001"]},
    ]
    assert (matching["low_left_over"], matching["high_left_over"]) == (["y_low"], ["x_high"])


HEIGHTS = "--maps displacement --format exr"


# Parts are matched by the names of groups or of files; more meshes share an atlas.
@pytest.mark.parametrize("line", [
    "high.obj low.obj --match-by-name",
    "high low --match-by-name",
    "low/arm_low.obj --low low/LEG_low.obj --high high",
])  # fmt: skip
def test_parts_are_baked_from_their_matches(run, tmp_path, line):
    run(f"{line} {HEIGHTS}")
    found = heights(tmp_path / "maps" / "displacement.exr")
    np.testing.assert_allclose(found[8:24, 4:12], 0.1, rtol=1e-5)
    np.testing.assert_allclose(found[8:24, 20:28], 0.2, rtol=1e-5)


def test_sets_have_files_of_their_own(run, tmp_path):
    run(
        "high.obj low.obj --match-by-name --texture-sets groups --maps normal,displacement "
        "--miss-map OUT/miss.png"
    )
    names = sorted(path.name for path in (tmp_path / "maps").iterdir())
    assert names == ["LEG_displacement.png", "LEG_normal.png", "arm_displacement.png",
                     "arm_normal.png"]  # fmt: skip
    assert sorted(path.name for path in tmp_path.glob("miss*")) == [
        "miss_LEG_1001.png",
        "miss_arm_1001.png",
    ]


def test_the_warning_gives_the_cause_of_the_misses_of_the_worst_set(run):
    """Rays that start 0.15 in front reach one part, and start below the other."""
    ends = "--front 0.15 --back 0.1"
    done = run(f"high.obj low.obj --match-by-name --texture-sets groups --maps normal {ends}")
    assert "low-poly faces far from the high-poly mesh" in done.output


def test_one_tile_is_a_plain_bake(run, tmp_path):
    """A pattern with one tile allows whatever a plain bake allows, such as a page or kept hits."""
    run("high.obj low.obj --name-pattern {map}_{udim}.{ext} --hits OUT/hits.npz")
    assert (tmp_path / "maps" / "normal_1001.png").is_file()


def test_images_skew_and_offset_rays(run, tmp_path):
    write_image(np.full((4, 4, 1), 255, np.uint8), tmp_path / "mask_1001.png", color=False)
    run("high.obj low.obj --skew-mask OUT/mask_1001.png --offset-map OUT/mask_1001.png")
    missing = run(
        "high.obj tiles.obj --name-pattern {map}_{udim}.{ext} --skew-mask OUT/mask_{udim}.png", 1
    )
    assert "mask_1002.png" in missing.output
    assert not list((tmp_path / "maps").glob("*100*"))


@pytest.mark.parametrize(("line", "code", "message"), [
    ("high.obj low.obj --match-by-name --low-suffix _lp", 1, "no low-poly part"),
    ("high.obj low.obj --match-by-name --hits h.npz", 2, "hits: is for the bake"),
    ("high.obj low.obj --match-by-name --html h.html", 2, "html: is for the"),
    ("high.obj low.obj --texture-sets materials", 1, "no materials"),
    ("high.obj low.obj --texture-sets groups --name-pattern {map}.x.{ext}", 2, "put {set} in"),
    ("low.obj --high empty", 1, "no mesh in it"),
])  # fmt: skip
def test_impossible_options_are_one_line(run, folder, line, code, message):
    (folder / "empty").mkdir(exist_ok=True)
    assert message in run(line, code).output


def test_an_asset_in_other_units_is_refused(run, tmp_path):
    for side, scale in (("low", 1.0), ("high", 100.0)):
        (tmp_path / side).mkdir()
        for name, x, u in (("arm", 0, 0.0), ("leg", 2, 0.5)):
            mesh = square(f"{name}_{side}", x, z=1.0, u=u)
            mesh = mesh.replace(positions=scale * mesh.positions)
            write_mesh(mesh, tmp_path / side / f"{mesh.name}.obj")
    result = run("OUT/high OUT/low --match-by-name", 1)
    assert "arm_low.obj and 1 more: The high-poly mesh is 100" in result.stderr
    assert "times as large" in result.stderr
    assert not (tmp_path / "maps").exists()


@pytest.mark.parametrize(
    ("words", "is_matched", "has_warning"),
    [("", True, False), ("--join-objects", False, False), ("--hits OUT/hits.npz", False, True)],
)
def test_objects_whose_names_pair_up_are_matched(run, tmp_path, words, is_matched, has_warning):
    high, low = ([square("a", 0, z=z), square("b", 2, z=z, u=0.5)] for z in (0.1, 0.0))
    write_mesh(join_meshes(high), tmp_path / "high.obj")
    write_mesh(join_meshes(low), tmp_path / "low.obj")
    result = run(f"OUT/high.obj OUT/low.obj {words}")
    own = "2 objects, each baked from the one with the matching name"
    assert (own in result.output) == is_matched
    assert ("have the same names" in result.output) == has_warning
