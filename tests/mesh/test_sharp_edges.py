"""Sharp edges of wrapped meshes: on the edges of the mesh, and the surface stays sound."""

import numpy as np
import pytest

from tests.models import joined
from texbake import Mesh, RemeshOptions, make, remesh, surface_distance
from texbake.mesh.hard_edges import with_normals
from texbake.mesh.normals import degenerate_faces, face_normals
from texbake.mesh.shapes import cube, icosphere, plane
from texbake.mesh.topology import duplicate_faces, find_edges
from texbake.mesh.triangle_tree import TriangleTree

N = 64


def turned(mesh, scale=(1.0, 1.0, 1.0)):
    """The mesh alone, scaled and turned so that no face lies along an axis."""
    axes, _ = np.linalg.qr(np.random.default_rng(8).normal(size=(3, 3)))
    axes[0] *= np.linalg.det(axes)
    return Mesh(positions=mesh.positions * scale @ axes.T, faces=mesh.faces)


def sharp(mesh, **options):
    """The wrapped mesh with sharp edges, whose surface is checked."""
    result = remesh(mesh, RemeshOptions(**{"resolution": N, "sharp_edges": True, **options}))
    edges = find_edges(result.faces)
    assert edges.closed and not edges.misoriented.any() and not edges.non_manifold.any()
    assert not duplicate_faces(result.faces).any() and not degenerate_faces(result).any()
    return result


def along_hard_edges(mesh, cosine=0.8, n=50):
    """Points along the edges of a closed mesh whose faces meet at an angle."""
    normals, points = face_normals(mesh), []
    for a, b in find_edges(mesh.faces).vertices:
        one, other = np.flatnonzero(((mesh.faces == a) | (mesh.faces == b)).sum(axis=1) == 2)
        if normals[one] @ normals[other] < cosine:
            at = np.linspace(0.02, 0.98, n)[:, None]
            points.append((1 - at) * mesh.positions[a] + at * mesh.positions[b])
    return np.concatenate(points)


BOX = turned(cube(), (1.0, 0.6, 0.35))
PRISM = turned(make("cylinder", resolution=(6, 1), caps=True))
BARREL = turned(make("cylinder", resolution=(96, 1), caps=True))
SHAPES = {"box": BOX, "prism": PRISM, "barrel": BARREL}


@pytest.mark.parametrize("name", SHAPES)
def test_edges_are_kept(name):
    mesh = SHAPES[name]
    voxel = np.ptp(mesh.positions, axis=0).max() / N
    points = along_hard_edges(mesh)

    def off(wrapped):
        tree = TriangleTree.build(wrapped.positions, wrapped.faces)
        return tree.closest_points(points)[0] / voxel

    plain, kept = off(remesh(mesh, RemeshOptions(resolution=N))), off(sharp(mesh))
    assert plain.mean() > 0.1
    assert kept.mean() < 0.3 * plain.mean() and np.mean(kept < 0.05) > 0.85
    assert kept.max() < 1.0


def test_normals_jump_at_edges():
    result = sharp(BOX)
    sides = np.unique(face_normals(BOX).round(9), axis=0)
    assert len(sides) == 6
    closest = (result.normals[result.normal_faces] @ sides.T).max(axis=2)
    assert np.mean(closest > np.cos(np.radians(3.0))) > 0.96
    smooth = with_normals(icosphere(4), "angle")
    assert len(smooth.normals) == icosphere(4).n_vertices


def test_what_has_no_sharp_edges_stays():
    ball = turned(icosphere(5))
    result, plain = sharp(ball), remesh(ball, RemeshOptions(resolution=N))
    np.testing.assert_array_equal(result.positions, plain.positions)
    np.testing.assert_array_equal(result.faces, plain.faces)


@pytest.mark.parametrize(
    "mesh",
    [
        joined(BOX, turned(cube(), (0.3, 0.9, 0.3))),
        BOX.replace(faces=BOX.faces[:, ::-1]),
        BOX.replace(faces=BOX.faces[1:]),
        BOX.replace(faces=np.where(np.arange(12)[:, None] % 3, BOX.faces, BOX.faces[:, ::-1])),
        joined(BOX, BOX),
        turned(plane(3, 3)),
        turned(cube(), (1.0, 1.0, 0.01)),
        Mesh(
            positions=np.random.default_rng(4).normal(size=(90, 3)),
            faces=np.arange(90, dtype=np.int32).reshape(-1, 3),
        ),
    ],
    ids=["crossing", "inwards", "torn", "mixed", "doubled", "sheet", "plate", "soup"],
)
def test_the_surface_stays_sound(mesh):
    result = sharp(mesh, resolution=40, surface="closed")
    plain = remesh(mesh, RemeshOptions(resolution=40, surface="closed"))
    assert result.n_vertices == plain.n_vertices
    voxel = np.ptp(mesh.positions, axis=0).max() / 40
    assert (
        surface_distance(result, mesh).a_to_b.max < surface_distance(plain, mesh).a_to_b.max + voxel
    )


@pytest.mark.parametrize("quality", ["fast", "best"])
def test_simplification_keeps_the_edges(quality):
    low = sharp(BOX, n_faces=100, quality=quality)
    assert low.n_faces <= 100
    distance = surface_distance(BOX, low)
    assert distance.rms / (np.ptp(BOX.positions, axis=0).max() / N) < 0.1
