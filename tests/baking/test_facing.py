"""High-poly meshes that face inwards, in whole or in part, are baked as if they did not."""

from dataclasses import replace

import numpy as np
import pytest

from tests.models import moved
from texbake import BakeOptions, bake, bake_parts
from texbake.mesh.compose import join_meshes, turned_over
from texbake.mesh.shapes import uv_sphere

OPTIONS = BakeOptions(maps=("normal", "displacement", "ao"), size=64, secondary_rays=4)


def dented():
    return uv_sphere(40, 60, lambda a, b: 1 + 0.03 * np.sin(11 * a) * np.sin(9 * b))


def flipped(mesh):
    return turned_over(mesh, np.ones(mesh.n_faces, dtype=bool))


def values(result):
    return {name: baked.values for name, baked in result.maps.items()}


@pytest.mark.parametrize("share", [1.0, 0.3])
def test_faces_that_face_inwards_are_flipped(share):
    """Whole shells, and faces of one shell that disagree with their neighbors."""
    low, high = uv_sphere(8, 12), dented()
    turned = np.random.default_rng(5).random(high.n_faces) < share
    right, wrong = bake(high, low, OPTIONS), bake(turned_over(high, turned), low, OPTIONS)
    for name, expected in values(right).items():
        np.testing.assert_allclose(values(wrong)[name], expected, atol=2e-6)
    assert wrong.report.texels_missed == right.report.texels_missed == 0
    assert right.report.warnings == []
    (warning,) = wrong.report.warnings
    assert f"flipped {int(turned.sum()):,} triangles, which faced inwards" in warning


@pytest.mark.parametrize("scale", [0.97, 1.03])
def test_faces_inside_and_outside_the_low_poly_mesh_are_flipped(scale):
    high = flipped(moved(dented(), scale=scale))
    report = bake(high, uv_sphere(24, 36), OPTIONS).report
    assert report.orientation is not None and report.orientation.n_faces == high.n_faces


def test_one_part_of_several():
    apart = moved(uv_sphere(8, 12), by=(4.0, 0.0, 0.0))
    low = uv_sphere(8, 12)
    high = join_meshes([flipped(dented()), apart])
    report = bake(high, low, OPTIONS).report
    assert (report.orientation.n_parts, report.orientation.n_faces) == (1, dented().n_faces)
    assert report.texels_missed == 0


def test_keep_leaves_it_as_it_is():
    report = bake(flipped(dented()), uv_sphere(8, 12), replace(OPTIONS, orientation="keep")).report
    assert report.orientation is None or report.orientation.n_faces == 0
    assert report.counts.rays_past_back_faces > 0


def test_a_room_that_is_seen_from_within_stays_one():
    room = flipped(uv_sphere(8, 12))
    result = bake(room, room, OPTIONS)
    assert (result.report.texels_missed, result.report.warnings) == (0, [])
    # Even if an object in it faces inwards.
    ball = moved(uv_sphere(8, 12), scale=0.2)
    report = bake(join_meshes([room, flipped(ball)]), join_meshes([room, ball]), OPTIONS).report
    assert report.orientation is not None and report.orientation.n_faces == 0


def test_parts_are_turned_over_one_by_one():
    low, high = uv_sphere(8, 12), dented()
    right = bake_parts([high], [low], OPTIONS)
    wrong = bake_parts([flipped(high)], [low], OPTIONS)
    for one, other in zip(right.targets.values(), wrong.targets.values(), strict=True):
        np.testing.assert_allclose(values(other)["normal"], values(one)["normal"], atol=2e-6)
    assert any("flipped" in warning for warning in wrong.report.warnings)
