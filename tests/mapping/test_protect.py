import numpy as np
import pytest

import texbake as tb
from texbake.errors import FileFormatError, OptionError
from texbake.jobs.painted_faces import protected_at
from texbake.mapping.overlap import find_overlaps
from texbake.mapping.seams import seam_edges
from texbake.mapping.unwrap import unwrap_with_report
from texbake.mesh.shapes import icosphere
from texbake.study.bench.solids import beveled_box


def cap(mesh):
    return np.flatnonzero(mesh.positions[mesh.faces].mean(axis=1)[:, 1] > 0.4)


def inner_seams(mesh, faces):
    """Edges of some faces, toward others of them, that are seams."""
    whole = np.zeros(mesh.n_faces, dtype=bool)
    whole[faces] = True
    seams = seam_edges(mesh)
    keys = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2), axis=2)
    keys = keys[..., 0] * mesh.n_vertices + keys[..., 1]
    ids, counts = np.unique(keys[whole], return_counts=True)
    return np.count_nonzero(seams & np.isin(keys, ids[counts == 2]) & whole[:, None])


@pytest.mark.parametrize("quality", ["fast", "good", "best"])
def test_no_seam_cuts_protected_faces(quality):
    mesh = icosphere(3)
    faces = cap(mesh)
    free, _ = unwrap_with_report(mesh, quality=quality)
    kept, report = unwrap_with_report(mesh, quality=quality, protect=faces)
    assert inner_seams(free, faces) > 0
    assert inner_seams(kept, faces) == 0
    assert not report.notes
    assert not find_overlaps(kept.corner_uvs()).overlapping.any()


@pytest.mark.parametrize("quality", ["fast", "good"])
def test_a_plane_leaves_protected_faces_whole(quality):
    mesh = beveled_box(3_000)
    centers = mesh.positions[mesh.faces].mean(axis=1)
    faces = np.flatnonzero((centers[:, 0] > 0.35) & (centers[:, 2] > 0.35))  # along a bevel
    _, report = unwrap_with_report(mesh, quality=quality, protect=faces)
    assert len(faces) and not report.notes


def test_protected_faces_that_cannot_be_laid_flat_are_cut_and_named():
    mesh = icosphere(3)
    _, report = unwrap_with_report(mesh, protect=np.arange(mesh.n_faces))
    assert "edges between protected faces are cut to lay them flat" in " ".join(report.notes)
    _, report = unwrap_with_report(mesh, protect=cap(mesh), max_stretch=1.0001)
    assert "are cut to lay them flat within `max_stretch`" in " ".join(report.notes)


def test_seams_that_protected_faces_keep_are_counted():
    mesh = icosphere(3)
    faces = cap(mesh)
    kept, report = unwrap_with_report(tb.unwrap(mesh), protect=faces, keep_seams=True)
    n_cut = inner_seams(kept, faces) // 2
    assert n_cut
    (note,) = report.notes
    assert note.startswith(f"{n_cut} edges between protected faces are at a marked seam")


def test_faces_of_a_file_are_found_where_they_are(tmp_path):
    mesh = icosphere(3)
    faces = cap(mesh)
    tb.write_mesh(mesh.replace(faces=mesh.faces[faces]), tmp_path / "some.obj")
    moved = mesh.replace(positions=mesh.positions + 5.0)
    found = protected_at(tmp_path / "some.obj", [moved, mesh])
    assert len(found[0]) == 0 and np.array_equal(found[1], faces)
    with pytest.raises(FileFormatError, match="none of its faces is a face of"):
        protected_at(tmp_path / "some.obj", [moved])


@pytest.mark.parametrize(("protect", "changes", "message"), [
    ([0.5], {}, "pass numbers of faces"),
    ([-1], {}, "a face is -1"),
    ([0], {"charts": "xatlas"}, "use charts texbake"),
    ([0], {"symmetry": "overlap"}, "cannot overlap; use auto or off"),
    ([0], {"method": "planar"}, "has no seams"),
])  # fmt: skip
def test_what_is_wrong_with_protected_faces_is_said(protect, changes, message):
    with pytest.raises(OptionError, match=message):
        tb.unwrap(icosphere(1), protect=protect, **changes)
