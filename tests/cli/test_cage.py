"""`texbake cage` on files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from texbake_cli.main import texbake

from texbake.baking.cage import fit_cage
from texbake.mesh.compose import join_meshes, transformed
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, orange, plane, uv_sphere
from texbake.verbs.cage import cage_file


@pytest.fixture
def pair(tmp_path: Path) -> tuple[str, str]:
    """Files of a high-poly and a low-poly mesh."""
    high, low = tmp_path / "high.ply", tmp_path / "low.obj"
    write_mesh(orange(2_000), high)
    write_mesh(uv_sphere(6, 8), low)
    return str(high), str(low)


def test_a_bake_accepts_the_cage(pair: tuple[str, str], tmp_path: Path) -> None:
    cage, normal = str(tmp_path / "cage.obj"), str(tmp_path / "normal.png")
    result = CliRunner().invoke(texbake, ["cage", *pair, "-o", cage])
    assert result.exit_code == 0, result.output
    assert "moved by" in result.output
    assert read_mesh(cage).n_faces == read_mesh(pair[1]).n_faces
    words = ["bake-normals", *pair, "-o", normal, "--size", "32", "--cage", cage]
    result = CliRunner().invoke(texbake, [*words, "--fail-on-miss", "0"])
    assert result.exit_code == 0, result.output


def test_objects_that_are_baked_apart_have_cages_of_their_own(tmp_path: Path) -> None:
    """The ball bulges toward the cube, which is no reason for the cube's cage to be larger."""
    beside = np.eye(4)
    beside[0, 3] = 1.52
    box = transformed(cube(), beside).replace(name="box")
    highs, lows = ([mesh.replace(name="ball"), box] for mesh in (orange(2_000), uv_sphere(6, 8)))
    files = [tmp_path / f"{name}.obj" for name in ("high", "low", "cage")]
    for path, meshes in zip(files, (highs, lows), strict=False):
        write_mesh(join_meshes(meshes), path)
    report = cage_file(*files, margin=0.01).report
    alone = [fit_cage(*pair, margin=0.01) for pair in zip(highs, lows, strict=True)]
    distances = np.concatenate([cage.distances for cage in alone])
    assert np.allclose(report.distances, distances, rtol=0.0, atol=1e-6)
    joined = fit_cage(join_meshes(highs), join_meshes(lows), margin=0.01)
    assert joined.distances[-8:].max() > 2.0 * distances[-8:].max()


def test_parts_outside_any_cage_are_reported(tmp_path: Path) -> None:
    high, low = tmp_path / "high.ply", tmp_path / "low.obj"
    wide = plane(9, 9)
    write_mesh(wide.replace(positions=2.0 * wide.positions + [0.0, 0.0, 0.1]), high)
    write_mesh(plane(2, 2), low)
    result = CliRunner().invoke(
        texbake, ["cage", str(high), str(low), "-o", str(tmp_path / "c.obj")]
    )
    assert result.exit_code == 0
    assert "border" in result.output


@pytest.mark.parametrize("inside_out", ["high", "low"])
def test_only_a_low_poly_mesh_that_is_inside_out_gets_a_warning(
    pair: tuple[str, str], tmp_path: Path, inside_out: str
) -> None:
    files = dict(zip(("high", "low"), pair, strict=True))
    straight = CliRunner().invoke(texbake, ["cage", *pair, "-o", str(tmp_path / "straight.obj")])
    mesh = read_mesh(files[inside_out])
    turned = Mesh(positions=mesh.positions, faces=mesh.faces[:, ::-1].copy())
    files[inside_out] = str(tmp_path / f"turned{Path(files[inside_out]).suffix}")
    write_mesh(turned, files[inside_out])
    cage = tmp_path / "cage.obj"
    result = CliRunner().invoke(texbake, ["cage", *files.values(), "-o", str(cage)])
    assert straight.exit_code == result.exit_code == 0, result.output
    assert "faces against" not in straight.output
    assert ("faces against the high-poly surface" in result.output) is (inside_out == "low")
    if inside_out == "high":
        words = ["bake-normals", *files.values(), "-o", str(tmp_path / "n.png"), "--size", "32"]
        baked = CliRunner().invoke(texbake, [*words, "--cage", str(cage), "--fail-on-miss", "0"])
        assert baked.exit_code == 0, baked.output
