"""What is said of walls and gaps is what a bake then does."""

import numpy as np
import pytest

from texbake import BakeOptions, CheckOptions, Mesh, bake, check
from texbake.checks import walls
from texbake.mesh.shapes import plane


def heights(high, low, faces, **options):
    """Displacements that a bake finds at the texels of some faces of the low-poly mesh."""
    result = bake(high, low, BakeOptions(size=128, maps=("displacement",), padding=0, **options))
    there = np.isin(result.texel_faces, faces) & ~result.missed
    return result.maps["displacement"].values[..., 0][there]


def test_the_bake_takes_the_wrong_part_just_where_it_is_said(case_of):
    case = case_of("other-parts")
    found = check(case.mesh, case.low, case.options).finding("other-parts")
    # A float32 map of a model 4 units across.
    np.testing.assert_allclose(heights(case.mesh, case.low, [0, 1]), 0.05, atol=1e-6)
    np.testing.assert_allclose(heights(case.mesh, case.low, [2, 3, 4, 5]), 0.0, atol=1e-6)
    # The remedy: the distance of the nearest part is named, and a shorter front is right.
    assert "0.03 model units" in found.problem
    np.testing.assert_allclose(heights(case.mesh, case.low, [0, 1], front=0.029), 0.0, atol=1e-6)


def test_a_ray_that_misses_its_side_of_a_thin_wall_takes_the_other(case_of):
    case = case_of("thin-walls")
    found = check(case.mesh, case.low, case.options).finding("thin-walls")
    assert "0.05 thick" in found.problem
    torn = case.mesh.replace(
        faces=case.mesh.faces[2:], uv_faces=case.mesh.uv_faces[2:], normals=None, normal_faces=None
    )
    through = heights(torn, case.low, [0, 1], cull_back_faces=False)
    np.testing.assert_allclose(through, -0.05, atol=1e-6)
    assert len(heights(torn, case.low, [0, 1])) == 0  # culled, nothing is found


def shell(n, outer_only=False):
    """A hemisphere of two walls 0.002 apart, or the outer one alone."""
    sheet = plane(2 * n, n)
    around, down = sheet.uvs.T * [[2.0 * np.pi], [0.5 * np.pi]]
    directions = [np.cos(around) * np.cos(down), np.sin(around) * np.cos(down), np.sin(down)]
    outer = np.stack(directions, axis=1)
    inner = sheet.faces[:, ::-1] + sheet.n_vertices
    faces = sheet.faces if outer_only else np.concatenate([sheet.faces, inner])
    return Mesh(positions=np.concatenate([outer, 0.998 * outer]), faces=faces)


@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize("outer_only", [False, True])
@pytest.mark.parametrize("n", [4, 16])
def test_thin_walls_do_not_face_opposite_ways_unless_flipped(n, outer_only, flip):
    """The faces of the low-poly mesh bulge less than the shell by up to ten times its thickness."""
    low = shell(n, outer_only)
    low = low.replace(faces=low.faces[:, ::-1]) if flip else low
    found = check(shell(50), low).finding("opposite-sides")
    n_flat = 2 * n * (1 if outer_only else 2)  # triangles at the pole without area
    assert (found.count if found else 0) == (low.n_faces - n_flat if flip else 0)


def test_a_limit_on_checked_faces_is_reported(monkeypatch, case_of):
    monkeypatch.setattr(walls, "_MAX_FACES", 4)
    case = case_of("thin-walls")
    found = check(case.mesh, case.low, CheckOptions(size=128)).finding("thin-walls")
    assert found.faces.tolist() == [0]
    assert "Only one of every 2 faces was checked" in found.problem
