import numpy as np
import pytest

from tests.mesh.test_symmetry import shape, turned
from tests.models import bracket
from texbake.errors import OptionError
from texbake.mapping.atlas.cutting.cut import surface_of
from texbake.mapping.atlas.halves import find_halves
from texbake.mapping.atlas.joining.counterparts import plan_join
from texbake.mapping.distortion import distortion
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.overlap import StackedIslands
from texbake.mapping.seams import seam_edges
from texbake.mapping.unwrap import unwrap, unwrap_with_report
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import icosphere, plane


def symmetric():
    """A closed mesh whose faces mirror each other about x = 0, with two horns."""
    mesh = icosphere(4)
    half = mesh.positions[mesh.faces].mean(axis=1)[:, 0] > 0.0
    faces = mesh.faces[half]
    points = mesh.positions.copy()
    points[np.abs(points[:, 0]) < 0.03, 0] = 0.0
    points[:, 0] = np.maximum(points[:, 0], 0.0)
    x, y, _ = points.T
    points = points * (1.0 + 1.5 * np.exp(-20.0 * ((x - 0.6) ** 2 + (y - 0.7) ** 2)))[:, None]
    points[:, 2] *= 1.5
    both = np.concatenate([points, points * [-1.0, 1.0, 1.0]])
    return Mesh(positions=both, faces=np.concatenate([faces, faces[:, ::-1] + len(points)]))


def mirrored_share(mesh, within):
    """Share of the length of seams whose mirror image about x = 0 is within a distance of one."""
    rows, columns = np.nonzero(seam_edges(mesh))
    starts = mesh.positions[mesh.faces[rows, columns]]
    ends = mesh.positions[mesh.faces[rows, (columns + 1) % 3]]
    lengths = np.linalg.norm(ends - starts, axis=1)
    middles = (starts + ends) / 2.0
    images = middles * [-1.0, 1.0, 1.0]
    apart = np.linalg.norm(images[:, None] - middles, axis=2).min(axis=1)
    return lengths[apart < within].sum() / lengths.sum()


@pytest.mark.parametrize(
    ("mesh", "quality", "within"),
    [
        (symmetric(), "fast", 0.05),
        (symmetric(), "good", 0.05),
        (shape(noise=0.003), "fast", 0.15),
        (shape(noise=0.003), "good", 0.15),
        (shape(noise=0.003), "best", 0.15),
    ],
)
def test_seams_mirror_each_other(mesh, quality, within):
    found = unwrap(mesh, quality=quality, size=256)
    assert mirrored_share(found, within) > 0.8
    figures = distortion(found)
    assert figures.n_overlapping == figures.n_mirrored == 0


@pytest.mark.parametrize("quality", ["fast", "good", "best"])
def test_what_lies_flat_is_not_cut_at_its_mirror_plane(quality):
    _, report = unwrap_with_report(plane(8, 8), quality=quality, size=128)
    assert report.distortion.n_charts == 1


def test_faces_find_their_mirror_images():
    mesh = symmetric()
    halves = find_halves(surface_of(turned(mesh)[0]))
    n = mesh.n_faces // 2
    assert (halves.sides[:n] == -halves.sides[n:]).all()
    twins = 3 * (np.arange(mesh.n_faces) + n)[:, None] % (3 * mesh.n_faces) + [2, 1, 0]
    np.testing.assert_array_equal(halves.twins, twins)


def test_the_halves_of_a_scan_meet_along_a_straight_line():
    surface = surface_of(shape())
    halves = find_halves(surface)
    assert halves.twins is None
    corners, _, opposite = surface.joints
    edges = np.flatnonzero(np.repeat(halves.sides, 3) > halves.sides[opposite // 3])
    tails, heads = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    steps = surface.points[heads] - surface.points[tails]
    steps /= np.linalg.norm(steps, axis=1)[:, None]
    leaving = dict(zip(tails[edges].tolist(), edges.tolist(), strict=True))
    following = [leaving[head] for head in heads[edges].tolist()]
    cosines = (steps[edges] * steps[following]).sum(axis=1)
    assert np.mean(cosines < 0.5) < 0.15  # 0.27 if each face goes to the side that it lies on


def test_overlap_lays_one_half_on_the_other():
    mesh = symmetric()
    found, report = unwrap_with_report(mesh, symmetry="overlap", size=256)
    corners, n = found.corner_uvs(), mesh.n_faces // 2
    np.testing.assert_array_equal(corners[:n], corners[n:, ::-1])
    assert report.tallies["faces that share the texels of their mirror images"] == n
    assert report.distortion.n_overlapping == 0
    assert report.fill < 1.0
    islands = StackedIslands.of(found)
    assert islands.stacked.all() and islands.shares.sum() == n


def test_overlap_of_other_meshes_is_noted():
    _, report = unwrap_with_report(shape(bump=0.9), symmetry="overlap", size=256)
    assert report.notes == ("no charts share texels, because it has no mirror plane",)
    _, report = unwrap_with_report(shape(noise=0.003), symmetry="overlap", size=256)
    assert "one by one" in report.notes[-1]


@pytest.mark.parametrize(
    ("mesh", "quality"), [(shape(bump=0.9), "good"), (shape(bump=0.9), "fast"), (bracket(), "fast")]
)
def test_other_meshes_are_cut_as_without_symmetry(mesh, quality):
    found, plain = (
        unwrap(mesh, quality=quality, symmetry=symmetry, size=256) for symmetry in ("auto", "off")
    )
    np.testing.assert_array_equal(found.uvs, plain.uvs)


def test_options_that_exclude_each_other():
    for options in ({"keep_seams": True}, {"charts": "xatlas"}):
        with pytest.raises(OptionError, match="symmetry"):
            UnwrapOptions(symmetry="overlap", **options)
    with pytest.raises(OptionError, match="symmetry"):
        UnwrapOptions(symmetry="off", keep=True)


def test_plans_of_joins_keep_counterparts():
    counterparts = {0: 1, 1: 0, 2: 3, 3: 2, 4: 4, 5: 5}  # 6 and 7 have none
    plans = {
        (0, 2): (((0, 2), (1, 3)), "other"),
        (0, 1): (((0, 1),), "self"),
        (4, 0): (((4, 0, 1),), "self"),
        (0, 4): (((4, 0, 1),), "self"),
        (4, 5): (((4, 5),), "self"),
        (4, 6): (((4, 6),), "self"),
        (6, 0): (((6, 0),), 1),
        (6, 7): (((6, 7),), "none"),
    }
    for (one, other), expected in plans.items():
        plan = plan_join(one, other, counterparts)
        assert (plan.groups, plan.counterpart) == expected
    assert plan_join(0, 2, counterparts).key == plan_join(3, 1, counterparts).key
