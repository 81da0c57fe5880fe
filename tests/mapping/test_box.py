"""Box mapping: six upright pictures at one scale, and the side that each face goes to."""

import numpy as np
import pytest

from texbake import Mesh, OptionError, UnwrapOptions
from texbake.mapping.classical.box import box, box_sides
from texbake.mapping.corner_uvs import signed_areas, surface_areas
from texbake.mapping.seams import connected_faces
from texbake.mesh.normals import face_normals
from texbake.mesh.shapes import cube, icosphere, plane
from texbake.mesh.topology import edge_ids

# Directions of the sides in their order, and what is to the right and up in their pictures.
SIDES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
RIGHTS = np.array([[0, 0, -1], [0, 0, 1], [1, 0, 0], [1, 0, 0], [1, 0, 0], [-1, 0, 0]])
UPS = np.array([[0, 1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1], [0, 1, 0], [0, 1, 0]])


def mapped(mesh, **choices):
    return box(mesh, UnwrapOptions(method="box", **choices))


def ellipsoid(radii=(3.0, 2.0, 1.0), level=4):
    sphere = icosphere(level)
    return sphere.replace(positions=sphere.positions * radii)


def noisy_slope(noise):
    """A plane at 45 degrees between +y and +z, with noise along its normal."""
    rng = np.random.default_rng(5)
    mesh = plane(40, 40, lambda x, y: noise / 40 * rng.normal(size=x.shape))
    x, y, z = mesh.positions.T
    return mesh.replace(positions=np.stack([x, y - z, -y - z], axis=1) * (1, -(0.5**0.5), 0.5**0.5))


@pytest.mark.parametrize("size", [1024, (2048, 512), (300, 700)])
@pytest.mark.parametrize("padding", [0, 4])
def test_sides_are_upright_in_one_scale_and_apart(size, padding):
    mesh = ellipsoid()
    options = UnwrapOptions(method="box", size=size, padding=padding)
    pixels = box(mesh, options).corners * (options.width_px, options.height_px)
    sides = box_sides(mesh)[0]
    points = mesh.positions[mesh.faces]
    scales, boxes = [], []
    for side in range(6):
        s, t = points[sides == side] @ RIGHTS[side], points[sides == side] @ UPS[side]
        shown = pixels[sides == side]
        scale = np.ptp(shown[..., 0]) / np.ptp(s)
        middle = shown[0, 0] - scale * np.array([s[0, 0], t[0, 0]])
        assert np.abs(shown - middle - scale * np.stack([s, t], axis=2)).max() < 1e-9
        scales.append(scale)
        boxes.append((shown.reshape(-1, 2).min(axis=0), shown.reshape(-1, 2).max(axis=0)))
    assert scales == pytest.approx([scales[0]] * 6, rel=1e-12)
    for i, (low, high) in enumerate(boxes):
        assert (low >= padding - 1e-9).all()
        assert (high <= np.array([options.width_px, options.height_px]) - padding + 1e-9).all()
        for other_low, other_high in boxes[:i]:
            apart = np.maximum(low - other_high, other_low - high).max()
            assert apart >= padding - 1e-9
    # As large as fits: a row of the widths 2, 6 and 6, or two of the height 4, fill the texture.
    free = np.array([options.width_px - 4 * padding, options.height_px - 3 * padding])
    assert scales[0] == pytest.approx((free / (14.0, 8.0)).min(), rel=1e-3)  # at triangles' tips


def test_no_face_is_mirrored_or_stretched_beyond_its_bound():
    for mesh in ellipsoid(), noisy_slope(0.3):
        found = mapped(mesh)
        areas = signed_areas(found.corners)
        ratios = areas / surface_areas(mesh.positions[mesh.faces])
        sides = box_sides(mesh)[0]
        cosines = (face_normals(mesh) * SIDES[sides]).sum(axis=1)
        assert cosines.min() >= 0.25
        assert ratios / ratios[0] == pytest.approx(cosines / cosines[0], rel=1e-9)


def test_a_cube_fills_six_squares():
    corners = mapped(cube(), size=(300, 200), padding=0).corners
    sides = box_sides(cube())[0]
    for side in range(6):
        low = corners[sides == side].reshape(-1, 2).min(axis=0) * (3, 2)
        high = corners[sides == side].reshape(-1, 2).max(axis=0) * (3, 2)
        assert low == pytest.approx([side // 2, 1 - side % 2], abs=1e-12)
        assert high == pytest.approx(low + 1.0, abs=1e-12)


def test_overlap_lays_all_sides_over_the_whole_square():
    corners = mapped(cube(), overlap=True).corners
    for side in range(6):
        shown = corners[box_sides(cube())[0] == side].reshape(-1, 2)
        assert {tuple(p) for p in shown} == {(0, 0), (0, 1), (1, 0), (1, 1)}
    brick = cube().replace(positions=cube().positions * (3.0, 2.0, 1.0))
    shown = mapped(brick, overlap=True).corners.reshape(-1, 2)
    assert np.unique(shown[:, 0] * 6.0) == pytest.approx([0.0, 2.0, 4.0, 6.0], abs=1e-12)
    assert np.unique(shown[:, 1] * 6.0) == pytest.approx([1.0, 2.0, 4.0, 5.0], abs=1e-12)


def test_the_center_stays_in_the_middle_of_each_picture():
    mesh = cube()
    corners = mapped(mesh, overlap=True, center=(0.5, 0.0, 0.0)).corners
    # It extends 1 to the left of the center, which is half of the square.
    front = corners[box_sides(mesh)[0] == 4].reshape(-1, 2)
    assert front.min(axis=0) == pytest.approx([0.0, 0.25], abs=1e-12)
    assert front.max(axis=0) == pytest.approx([0.5, 0.75], abs=1e-12)


def test_faces_that_clearly_look_to_a_side_go_there():
    mesh = icosphere(4)
    cosines = face_normals(mesh) @ SIDES.T
    clear = np.sort(cosines, axis=1)[:, -2] < np.sort(cosines, axis=1)[:, -1] - 0.1
    assert clear.mean() > 0.8
    assert np.array_equal(box_sides(mesh)[0][clear], cosines.argmax(axis=1)[clear])


def test_noise_does_not_fleck():
    mesh = noisy_slope(0.2)
    by_normal = (face_normals(mesh) @ SIDES.T).argmax(axis=1)
    halves = np.bincount(by_normal, minlength=6)
    assert np.sort(halves)[-2] > 0.3 * mesh.n_faces  # it could hardly be more even
    sides, tallies = box_sides(mesh)
    n_joined = tallies["faces joined to the side of their neighbors"]
    assert n_joined == (sides != by_normal).sum()
    before, after = _region_sizes(mesh, by_normal), _region_sizes(mesh, sides)
    assert len(before) > 150
    assert len(after) < len(before) / 5 and min(after) > 1


def test_the_triangles_of_a_polygon_have_one_side():
    mesh = noisy_slope(0.2)
    quads = mesh.replace(polygon_of=np.arange(mesh.n_faces) // 2)
    apart, together = (box_sides(item)[0].reshape(-1, 2) for item in (mesh, quads))
    fits = (face_normals(mesh) @ SIDES.T).reshape(-1, 2, 6).min(axis=1).max(axis=1) >= 0.25
    assert (apart[:, 0] != apart[:, 1]).sum() > 100
    assert (together[fits, 0] == together[fits, 1]).all()
    assert (face_normals(mesh) * SIDES[together.ravel()]).sum(axis=1).min() >= 0.25


def test_an_exact_chamfer_goes_to_one_side():
    assert set(box_sides(noisy_slope(1e-6))[0]) == {2}  # as float32 would leave it


def test_a_fleck_in_a_field_follows_it_but_not_where_it_would_be_squashed():
    for height, joined in ((1.1, True), (4.0, False)):
        # One vertex stands out, and its six faces lean by up to 57 or by 80 degrees.
        mesh = plane(20, 20)
        positions = mesh.positions.copy()
        positions[10 * 21 + 10, 2] += height / 20.0
        bumped = mesh.replace(positions=positions)
        sides, _ = box_sides(bumped)
        assert (set(sides) == {4}) == joined
        cosines = (face_normals(bumped) * SIDES[sides]).sum(axis=1)
        assert cosines.min() >= 0.25


def test_faces_without_area_follow_their_neighbors():
    square = [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1], [0.5, 0, 0.5]]
    # Two halves that face down, and the needle of their diagonal between them.
    mesh = Mesh(positions=square, faces=[[0, 1, 2], [0, 4, 2], [0, 2, 3]])
    assert box_sides(mesh)[0].tolist() == [3, 3, 3]
    assert mapped(mesh).tallies == {"faces without area": 1}


def test_without_any_area_all_is_the_front():
    mesh = Mesh(positions=[[0, 0, 0], [1, 1, 1], [2, 2, 2]], faces=[[0, 1, 2], [1, 1, 1]])
    found = mapped(mesh)
    assert found.tallies == {"faces without area": 2}
    assert np.isfinite(found.corners).all()
    assert (box_sides(mesh)[0] == 4).all()


def test_padding_that_leaves_nothing_is_one_clear_error():
    with pytest.raises(OptionError, match=r"padding: 5 texels .* leave nothing of 20 x 20"):
        mapped(cube(), size=20, padding=5)


def _region_sizes(mesh, sides):
    """Faces of each connected region of one side, through edges that two faces share."""
    pairs = edge_ids(mesh.faces) * 6 + sides[:, None]  # an edge joins only faces of one side
    return np.bincount(connected_faces(np.unique(pairs, return_inverse=True)[1].reshape(-1, 3)))
