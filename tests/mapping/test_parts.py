import numpy as np
import pytest

from texbake.mapping.atlas.cutting.parts import (
    Part,
    connected_parts,
    divide_parts,
    face_batches,
    split_parts,
)
from texbake.mapping.seams import merged_labels
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import _geodesic_sphere, plane
from texbake.mesh.topology import opposite_half_edges
from texbake.mesh.weld import weld_rows


def opposite_of(faces):
    return opposite_half_edges(faces)


def divided(mesh, part_faces):
    faces = weld_rows(mesh.positions)[mesh.faces]
    opposite = opposite_of(faces)
    labels = divide_parts(
        mesh.positions, faces, opposite, connected_parts(opposite), part_faces=part_faces,
        whole_faces=part_faces,
    )  # fmt: skip
    return labels, opposite


def sphere(n, noise=0.0):
    positions, faces = _geodesic_sphere(n)
    radii = 1.0 + noise * np.random.default_rng(1).standard_normal(len(positions))
    return Mesh(positions=positions * radii[:, None] / 2.0, faces=faces)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_parts_are_connected_and_of_like_size(noise):
    mesh = sphere(24, noise)  # 11,520 faces
    labels, opposite = divided(mesh, 1000)
    sizes = np.bincount(labels)
    assert 10 <= len(sizes) <= 14 and sizes.min() >= 500
    assert sizes.max() <= 1600  # 1.5 times as many as requested, and teeth of the borders
    inside = np.flatnonzero(labels[opposite // 3] == np.repeat(labels, 3)).astype(np.int32)
    assert merged_labels(len(labels), inside // 3, opposite[inside] // 3).max() + 1 == len(sizes)


def test_borders_lie_on_creases():
    # A strip with a right angle in it, four tenths along.
    mesh = plane(40, 20)
    folded = mesh.positions.copy()
    folded[:, 2] = np.maximum(mesh.positions[:, 0] - 0.4, 0.0)
    folded[:, 0] = np.minimum(mesh.positions[:, 0], 0.4)
    labels, _ = divided(mesh.replace(positions=folded), mesh.n_faces // 2)
    sides = (mesh.positions[mesh.faces].mean(axis=1)[:, 0] > 0.4).astype(int)
    assert labels.max() == 1
    assert np.bincount(labels * 2 + sides, minlength=4).min() == 0  # none is on both sides


def test_parts_do_not_depend_on_rounding():
    mesh = sphere(24)
    labels, _ = divided(mesh, 1000)
    moved = mesh.positions + 2.0**-20 * np.random.default_rng(2).choice(
        [-1, 0, 1], mesh.positions.shape, p=[0.001, 0.998, 0.001]
    )
    assert np.array_equal(divided(mesh.replace(positions=moved), 1000)[0], labels)


def test_split_parts_hang_together_as_the_whole_did():
    mesh = sphere(6)
    opposite = opposite_of(mesh.faces)
    labels = (np.arange(mesh.n_faces) % 3 - 1).astype(np.int32)  # a third is left out
    parts = split_parts(opposite, labels)
    assert len(parts) == 2
    for label, part in enumerate(parts):
        assert np.array_equal(part.face_ids, np.flatnonzero(labels == label))
        assert np.array_equal(part.opposite, opposite_of(mesh.faces[part.face_ids]))


def whole(faces):
    return Part(face_ids=np.arange(len(faces), dtype=np.int32), opposite=opposite_of(faces))


def test_thousands_of_small_pieces_share_batches():
    faces = np.arange(30_000, dtype=np.int32).reshape(-1, 3)
    points = np.random.default_rng(3).random((30_000, 3))
    regions = np.zeros(len(faces), dtype=np.int32)
    batches = face_batches(points, faces, whole(faces), part_faces=1000, regions=regions)
    assert [len(batch) for batch in batches] == [1000] * 10
    assert np.array_equal(np.sort(np.concatenate(batches)), np.arange(len(faces)))


def test_batches_hold_one_region_and_one_part_of_a_large_piece():
    mesh = sphere(16)  # 5,120 faces
    faces = np.concatenate([mesh.faces, np.arange(300).reshape(-1, 3) + mesh.n_vertices])
    points = np.concatenate([mesh.positions, np.random.default_rng(3).random((300, 3))])
    regions = np.repeat([0, 1, 2], [len(mesh.faces), 50, 50]).astype(np.int32)
    batches = face_batches(
        points, faces.astype(np.int32), whole(faces.astype(np.int32)), part_faces=1000,
        regions=regions,
    )  # fmt: skip
    assert all(len(np.unique(regions[batch])) == 1 for batch in batches)
    assert sorted(len(batch) for batch in batches)[:2] == [50, 50]
    assert max(len(batch) for batch in batches) <= 1600
    assert np.array_equal(np.sort(np.concatenate(batches)), np.arange(len(faces)))
