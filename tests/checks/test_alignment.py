"""Pairs that fit once one is scaled, rotated or moved stop a bake; other pairs do not."""

from dataclasses import replace

import numpy as np
import pytest

from texbake import BakeOptions, check, write_mesh
from texbake.checks.pair import require_alignment
from texbake.errors import MeshError
from texbake.jobs.maps import bake_files
from texbake.jobs.parts import bake_parts_files
from texbake.mesh.compose import join_meshes
from texbake.mesh.shapes import plane, uv_sphere
from texbake.verbs.meshes import cage_file

SIDES = np.array([1.0, 0.7, 0.4])


def high():
    sphere = uv_sphere(60, 120, lambda a, b: 1 + 0.02 * np.sin(40 * a) * np.sin(30 * b))
    return sphere.replace(positions=sphere.positions * SIDES)


def low(scale=1.0, move=(0.0, 0.0, 0.0), axes=((1, 0, 0), (0, 1, 0), (0, 0, 1))):
    sphere = uv_sphere(12, 24)
    moved = scale * sphere.positions * SIDES @ np.array(axes, dtype=float).T + np.array(move)
    return sphere.replace(positions=moved)


UPRIGHT = ((1, 0, 0), (0, 0, -1), (0, 1, 0))


@pytest.mark.parametrize(("changes", "finding"), [
    ({"scale": 0.1}, "differing-scale"),
    ({"scale": 1000.0, "axes": UPRIGHT}, "differing-scale"),
    ({"move": (3.0, 0.0, 0.0)}, "differing-place"),
    ({"axes": UPRIGHT}, "differing-axes"),
])  # fmt: skip
def test_a_misfit_stops_with_the_words_of_check(changes, finding):
    found = {one.name: one for one in check(high(), low(**changes)).findings}
    with pytest.raises(MeshError) as stop:
        require_alignment(high(), low(**changes))
    assert f"{found[finding].problem} {found[finding].remedy}" in str(stop.value)


@pytest.mark.parametrize("pair", [
    (high(), low()),
    (high(), low(1.3)),
    (high(), low(0.0)),  # a point, which fits at no scale
    (high(), plane().replace(positions=3.0 * plane().positions - np.array([0.0, 0.0, 1.0]))),
    (
        join_meshes(
            [high(), high().replace(positions=high().positions + np.array([5.0, 0, 0]))]
        ),
        low(),
    ),
    (plane(), plane().replace(positions=plane().positions + np.array([0.0, 0.0, 0.1]))),
])  # fmt: skip
def test_pairs_that_may_be_meant_so(pair):
    assert require_alignment(*pair) is None  # it raises otherwise


def test_files(tmp_path):
    write_mesh(high(), tmp_path / "high.ply")
    write_mesh(low(0.1), tmp_path / "low.obj")
    for job in (
        lambda: bake_files(
            tmp_path / "high.ply", tmp_path / "low.obj", tmp_path / "maps", BakeOptions(size=16)
        ),
        lambda: cage_file(tmp_path / "high.ply", tmp_path / "low.obj", tmp_path / "cage.obj"),
    ):
        with pytest.raises(MeshError, match=r"low\.obj: The high-poly mesh is 10"):
            job()
    assert {path.name for path in tmp_path.iterdir()} == {"high.ply", "low.obj"}


def test_a_low_poly_mesh_that_faces_inwards(tmp_path):
    write_mesh(high(), tmp_path / "high.ply")
    write_mesh(low().replace(faces=low().faces[:, ::-1]), tmp_path / "low.obj")
    options = BakeOptions(size=16, front=0.1, back=0.1)
    with pytest.raises(MeshError, match=r"low\.obj: Most of the low-poly mesh faces against"):
        bake_files(tmp_path / "high.ply", tmp_path / "low.obj", tmp_path / "maps", options)
    kept = replace(options, orientation="keep")
    done = bake_files(tmp_path / "high.ply", tmp_path / "low.obj", tmp_path / "maps", kept)
    assert any("Most of the low-poly mesh faces against" in warning for warning in done.warnings)


def test_parts_that_face_inwards(tmp_path):
    write_mesh(high(), tmp_path / "high.ply")
    write_mesh(low().replace(faces=low().faces[:, ::-1]), tmp_path / "low.obj")
    options = BakeOptions(size=16, front=0.1, back=0.1)
    meshes = [tmp_path / "high.ply"], [tmp_path / "low.obj"]
    with pytest.raises(MeshError, match="Most of the low-poly mesh faces against"):
        bake_parts_files(*meshes, tmp_path / "maps", options)
    assert not (tmp_path / "maps").exists()


def test_the_low_poly_mesh_is_not_to_blame_for_a_high_poly_mesh_that_was_turned_over(tmp_path):
    """The rays are too short; that is all."""
    inside_out = high().replace(faces=high().faces[:, ::-1])
    write_mesh(inside_out.replace(positions=1.05 * inside_out.positions), tmp_path / "high.ply")
    write_mesh(low(), tmp_path / "low.obj")
    options = BakeOptions(size=16, front=1e-4, back=1e-4)
    done = bake_files(tmp_path / "high.ply", tmp_path / "low.obj", tmp_path / "maps", options)
    assert done.report.miss_percent > 50.0
    assert not any("faces against" in warning for warning in done.warnings)


@pytest.mark.parametrize("height", [0.1, -0.25])
@pytest.mark.parametrize("unit", [1.0, 1000.0])
def test_faces_far_from_the_other_mesh_are_named_with_the_greatest_distance(height, unit):
    """Squares over a plane that only one of the two meshes has; one is not quite far enough."""
    ground = plane(8, 8)
    limit = 0.03 * ground.diagonal
    squares = [
        plane().replace(positions=plane().positions * 0.1 + [0.1 + 0.2 * i, 0.4, level])
        for i, level in enumerate((height, 0.6 * height, 1.1 * limit, 0.9 * limit))
    ]
    more = join_meshes([ground, *squares])
    one, other = (mesh.replace(positions=unit * mesh.positions) for mesh in (ground, more))
    for pair, name in (((one, other), "far-from-high"), ((other, one), "far-from-low")):
        far = check(*pair).finding(name)
        assert (far.count, set(far.faces)) == (6, set(range(128, 134)))
        assert set(far.faces[:2]) == {128, 129}  # the worst first
        assert f"at most {unit * abs(height):.3g} model units" in far.problem
        assert "farther from them than 3 % of the size" in far.problem
        assert "one of every" not in far.problem
        other_name = {"far-from-high": "far-from-low", "far-from-low": "far-from-high"}[name]
        assert check(*pair).finding(other_name) is None
