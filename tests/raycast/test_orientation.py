"""Meshes turned outwards: made meshes whose right orientation is known face by face."""

import numpy as np
import pytest

from tests.models import flipped, joined, moved
from texbake.mesh.compose import turned_over
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import icosphere, plane
from texbake.raycast.orientation import oriented


def ball(scale=1.0, move=(0.0, 0.0, 0.0)):
    return moved(icosphere(3), scale=scale, by=move)


def cyclic(faces):
    """Each face from its least vertex on, so that only its winding and its vertices count."""
    shift = np.argmin(faces, axis=1)[:, None]
    return np.take_along_axis(faces, (np.arange(3) + shift) % 3, axis=1)


def hemisphere():
    sphere = ball()
    above = (sphere.positions[sphere.faces][:, :, 2] > -1e-9).all(axis=1)
    return Mesh(positions=sphere.positions, faces=sphere.faces[above])


def moebius(n=64):
    turn = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)
    rim = []
    for side in (-0.3, 0.3):
        r = 1.0 + side * np.cos(turn / 2.0)
        rim.append(np.stack([r * np.cos(turn), r * np.sin(turn), side * np.sin(turn / 2.0)], 1))
    a, b = np.arange(n), np.arange(n) + n
    c, d = np.roll(a, -1), np.roll(b, -1)
    c[-1], d[-1] = n, 0  # half a turn
    faces = np.concatenate([np.stack([a, c, b], 1), np.stack([b, c, d], 1)])
    return Mesh(positions=np.concatenate(rim), faces=faces.astype(np.int32))


SOLIDS = {
    "sphere": ball(),
    "three apart": joined(ball(), ball(0.5, (3, 0, 0)), ball(0.7, (0, 3, 1))),
    "cavity": joined(ball(), flipped(ball(0.5))),
    "solid in a cavity": joined(ball(), flipped(ball(0.6)), ball(0.3)),
    "hemisphere": hemisphere(),
    "shells": joined(ball(), *(flipped(ball(0.8 - 0.2 * i)) for i in range(4))),
    "two with cavities": joined(
        ball(), flipped(ball(0.5)), ball(2.0, (4, 0, 0)), flipped(ball(0.8, (4.5, 0, 0)))
    ),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_what_faces_outwards_stays_and_what_is_inside_out_is_turned_over(name):
    mesh, report = oriented(SOLIDS[name], "auto")
    np.testing.assert_array_equal(mesh.faces, SOLIDS[name].faces)
    assert report.n_faces == 0
    right = SOLIDS[name]
    mesh, report = oriented(flipped(right), "auto")
    np.testing.assert_array_equal(cyclic(mesh.faces), cyclic(right.faces))
    assert report.n_faces == right.n_faces
    assert f"flipped {right.n_faces:,} triangles" in report.notes[0]


# One of several parts, and a part with the wall of its cavity.
@pytest.mark.parametrize(("name", "parts"), [
    ("three apart", [1]), ("two with cavities", [0, 1]), ("two with cavities", [2, 3]),
])  # fmt: skip
def test_parts_are_turned_over_with_the_walls_of_their_cavities(name, parts):
    right = SOLIDS[name]
    chosen = np.isin(np.arange(right.n_faces) // icosphere(3).n_faces, parts)
    mesh, report = oriented(turned_over(right, chosen), "auto")
    np.testing.assert_array_equal(cyclic(mesh.faces), cyclic(right.faces))
    assert (report.n_parts, report.n_faces, report.n_unclear) == (len(parts), chosen.sum(), 0)


def test_open_shells_stay_where_that_is_asked_for():
    closed = flipped(ball())
    card = flipped(plane())
    behind = card.positions * 0.5 + (0.0, 0.0, 3.0)
    mesh = Mesh(
        positions=np.concatenate([closed.positions, behind]),
        faces=np.concatenate([closed.faces, card.faces + closed.n_vertices]),
    )
    turned, report = oriented(mesh, "auto", keep_open=True)
    np.testing.assert_array_equal(cyclic(turned.faces[:-2]), cyclic(ball().faces))
    np.testing.assert_array_equal(turned.faces[-2:], mesh.faces[-2:])
    assert (report.n_faces, report.n_unclear) == (closed.n_faces, 0)


def test_faces_wound_against_their_part_are_turned_over():
    right = ball()
    chosen = np.random.default_rng(0).random(right.n_faces) < 0.3
    mesh, report = oriented(turned_over(right, chosen), "auto")
    np.testing.assert_array_equal(cyclic(mesh.faces), cyclic(right.faces))
    assert (report.n_parts, report.n_faces) == (0, chosen.sum())


@pytest.mark.parametrize("make", [plane, moebius])
def test_what_is_seen_alike_from_both_sides_stays_with_a_warning(make):
    mesh, report = oriented(make(), "auto")
    np.testing.assert_array_equal(mesh.faces, make().faces)
    assert (report.n_faces, report.n_unclear) == (0, 1)
    assert "left 1 part as in the file" in report.notes[0]


def test_keep_leaves_all_as_it_is():
    wrong = flipped(ball())
    mesh, report = oriented(wrong, "keep")
    assert mesh is wrong
    assert report.notes == ()
