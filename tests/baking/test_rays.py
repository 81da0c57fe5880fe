"""Rays start where they should, every sample has a direction or none, and images change rays."""

import numpy as np
import pytest

from texbake import BakeOptions, Mesh, OptionError, bake
from texbake.baking.rays import RayField, RayMaps, UnobstructedRays
from texbake.baking.texels import SampleGrid, Samples
from texbake.mesh.compose import join_meshes
from texbake.mesh.frame import LocalFrame
from texbake.mesh.shapes import cube, plane, uv_sphere
from texbake.raycast.scene import RayScene


def samples_on(mesh, n=500, seed=0):
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet([1, 1, 1], n)
    faces = rng.integers(0, mesh.n_faces, n).astype(np.int32)
    points = np.einsum("ni,nij->nj", weights, mesh.positions[mesh.faces[faces]])
    return Samples(np.zeros(n, dtype=np.int32), faces, weights[:, 1:].copy()), points


@pytest.mark.parametrize("kind", ["smooth", "vertex", "face"])
def test_rays_go_through_their_sample_from_front_to_back(kind):
    mesh = uv_sphere(8, 12)
    frame = LocalFrame.around(mesh)
    samples, points = samples_on(mesh)
    rays = RayField(mesh, frame, kind=kind, front=0.3, back=0.2).rays(samples)
    np.testing.assert_allclose(np.linalg.norm(rays.directions, axis=1), 1, atol=1e-14)
    np.testing.assert_allclose(frame.length_to_model(rays.lengths), 0.5, rtol=1e-14)
    through = rays.origins + rays.fronts[:, np.newaxis] * rays.directions
    np.testing.assert_allclose(frame.to_model(through), points, atol=1e-14)
    # Inward: towards the middle of the sphere.
    assert (np.einsum("ij,ij->i", rays.directions, points) < -0.9 * 0.9).all()


def test_a_ray_stands_in_the_cell_of_its_sample():
    """Rays are cast together cell by cell; a wrong cell would only cost time."""
    mesh = plane(4, 3)
    samples, points = samples_on(mesh)
    field = RayField(mesh, LocalFrame.around(mesh), kind="face", front=0.1, back=0.1)
    cells = field.places(samples, SampleGrid(30, 20, 1)).cells
    np.testing.assert_array_equal(cells[:, 0], np.floor(30 * points[:, 0]))
    np.testing.assert_array_equal(cells[:, 1], np.floor(20 * (1.0 - points[:, 1])))


def test_smooth_rays_leave_no_gap_at_a_hard_edge():
    """Two faces of a cube that share an edge send the same ray from each of its points."""
    mesh = cube()
    frame = LocalFrame.around(mesh)
    normals = np.repeat(np.eye(3), [0, 0, 1], axis=0)
    split = mesh.replace(normals=normals, normal_faces=np.zeros((mesh.n_faces, 3), dtype=int))
    field = RayField(split, frame, kind="smooth", front=0.1, back=0.1)
    along = np.linspace(0, 1, 11)
    starts = {}
    for face, corners in enumerate(mesh.faces):
        for k in range(3):
            edge = (corners[k], corners[(k + 1) % 3])
            weights = np.zeros((11, 3))
            forward = edge[0] < edge[1]
            weights[:, k] = 1 - along if forward else along
            weights[:, (k + 1) % 3] = along if forward else 1 - along
            faces = np.full(11, face, dtype=np.int32)
            samples = Samples(np.zeros(11, dtype=np.int32), faces, weights[:, 1:].copy())
            starts.setdefault(tuple(sorted(edge)), []).append(field.rays(samples).origins)
    assert len(starts) == 18
    for both in starts.values():
        np.testing.assert_allclose(both[0], both[1], atol=1e-15)


def test_normals_that_cancel_fall_back_to_the_face():
    """Two triangles back to back: their smooth normals cancel at every vertex."""
    positions = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    normals = [[0, 0, 1], [0, 0, -1], [0, 0, 0]]
    # At the middle of the first edge the corners' normals cancel.
    mesh = Mesh(
        positions=positions, faces=[[0, 1, 2]], normals=normals[:2], normal_faces=[[0, 1, 0]]
    )
    samples = Samples(np.zeros(1, np.int32), np.zeros(1, np.int32), np.array([[0.5, 0.0]]))
    rays = RayField(mesh, LocalFrame.around(mesh), kind="vertex", front=0.1, back=0.1).rays(samples)
    np.testing.assert_allclose(rays.directions, [[0, 0, -1]], atol=1e-15)


def test_a_face_without_a_direction_sends_no_ray():
    mesh = Mesh(positions=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], faces=[[0, 1, 2]])
    samples = Samples(np.zeros(1, np.int32), np.zeros(1, np.int32), np.array([[0.3, 0.3]]))
    for kind in "smooth", "vertex", "face":
        rays = RayField(mesh, LocalFrame.around(mesh), kind=kind, front=0.1, back=0.1).rays(samples)
        assert rays.lengths[0] == 0
        assert np.isfinite(rays.origins).all()
        np.testing.assert_array_equal(rays.directions, 0)


@pytest.mark.parametrize(
    ("height", "faces_up", "front", "back"),
    [(0.3, False, 0.3, 0.7), (0.3, True, 0.8, 0.7), (-0.2, False, 0.8, 0.2), (-0.2, True, 0.8, 0.7),
     (0.9, False, 0.8, 0.7), (-0.75, False, 0.8, 0.7)],
)  # fmt: skip
def test_another_part_ends_rays_where_it_faces_their_own(height, faces_up, front, back):
    """Rays of a floor: what looks at it from above is another part, its underside is its end."""
    other = plane()
    other = other.replace(positions=other.positions + np.array([0.0, 0.0, height]))
    if not faces_up:
        other = other.replace(faces=other.faces[:, ::-1], uv_faces=other.uv_faces[:, ::-1])
    low = join_meshes([plane(), other])
    frame = LocalFrame.around(low)
    samples = samples_on(plane(), 20)[0]
    field = RayField(low, frame, kind="face", front=0.8, back=0.7)
    rays = UnobstructedRays(field, RayScene.build(low, frame)).rays(samples)
    np.testing.assert_allclose(rays.directions, [[0, 0, -1]] * 20, atol=1e-15)
    np.testing.assert_allclose(frame.length_to_model(rays.fronts), front, atol=1e-6)
    np.testing.assert_allclose(frame.length_to_model(rays.lengths), front + back, atol=2e-6)
    np.testing.assert_allclose(frame.to_model(rays.origins)[:, 2], front, atol=1e-6)


LOW = uv_sphere(8, 16)
HIGH = uv_sphere(48, 96, lambda theta, phi: 1 + 0.01 * np.sin(9 * phi) * np.sin(7 * theta))
REACH = {"front": 0.1, "back": 0.1}


def image(value):
    return np.full((5, 7), value, dtype=np.float32)


def same(one, other):
    return all(np.array_equal(one.maps[name].values, other.maps[name].values) for name in one.maps)


def baked(samples=4, **changes):
    images = {name: changes.pop(name) for name in ("skew_mask", "offset_map") if name in changes}
    cage = changes.pop("cage", None)
    reach = {"back": 0.1} if cage is not None else REACH
    options = BakeOptions(
        size=64, samples=samples, maps=("normal", "displacement"), **{**reach, **changes}
    )
    return bake(HIGH, LOW, options, cage=cage, **images)


@pytest.mark.parametrize("samples", [1, 16, "adaptive"])
def test_masks_of_0_and_1_are_smooth_and_face_rays(samples):
    smooth, face = baked(samples), baked(samples, rays="face")
    assert not same(smooth, face)
    assert same(baked(samples, skew_mask=image(0.0)), smooth)
    assert same(baked(samples, skew_mask=image(1.0)), face)
    half = baked(samples, skew_mask=image(0.5))
    assert not same(half, smooth) and not same(half, face)


def test_a_map_of_ones_changes_nothing():
    assert same(baked(offset_map=image(1.0)), baked())
    cage = LOW.replace(positions=LOW.positions * 1.2)
    assert same(baked(offset_map=image(1.0), cage=cage), baked(cage=cage))


def test_an_offset_is_a_factor_of_the_front_distance():
    assert same(baked(offset_map=image(0.5)), baked(front=0.05))
    assert same(baked(offset_map=image(2.0)), baked(front=0.2))


def test_a_blend_lies_between_both_directions():
    """A quarter of the way: the normalized sum of three parts of one and one of the other."""
    rng = np.random.default_rng(4)
    n = 200
    faces = rng.integers(0, LOW.n_faces, n).astype(np.int32)
    samples = Samples(np.zeros(n, np.int32), faces, rng.dirichlet([1, 1, 1], n)[:, 1:].copy())
    frame = LocalFrame.around(LOW)

    def field(kind, maps=None):
        return RayField(LOW, frame, kind=kind, front=0.2, back=0.1, maps=maps).rays(samples)

    smooth, face = field("smooth"), field("face")
    blend = field("smooth", RayMaps.of(skew_mask=image(0.25)))
    expected = 0.75 * smooth.directions + 0.25 * face.directions
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(blend.directions, expected, atol=1e-15)


def test_an_image_is_looked_up_at_texture_coordinates():
    """The left half of a mask of 0 and 1 is smooth, its right half straight, apart from between."""
    mask = np.zeros((1, 64), dtype=np.float32)
    mask[:, 32:] = 1.0
    both = baked(1, skew_mask=mask, padding=0).maps["normal"].values
    smooth = baked(1, padding=0).maps["normal"].values
    face = baked(1, padding=0, rays="face").maps["normal"].values
    assert np.array_equal(both[:, :32], smooth[:, :32])
    assert np.array_equal(both[:, 32:], face[:, 32:])


def test_an_offset_limits_the_front_distance():
    """A surface 0.15 above a plane: found from 0.2 above, and not from 0.1."""
    low = plane()
    high = low.replace(positions=low.positions + np.array([0, 0, 0.15]))
    offset = np.ones((1, 16), dtype=np.float32)
    offset[:, 8:] = 0.5
    options = BakeOptions(size=16, front=0.2, back=0.01, padding=0)
    result = bake(high, low, options, offset_map=offset)
    assert np.array_equal(result.has_data, np.broadcast_to(np.arange(16) < 8, (16, 16)))


@pytest.mark.parametrize(("images", "message"), [
    ({"skew_mask": image(1.5)}, "skew_mask: its values go from 1.5 to 1.5; .* 0 to 1"),
    ({"skew_mask": image(np.nan)}, "skew_mask"),
    ({"offset_map": image(-1.0)}, "offset_map: .* 0 or more"),
    ({"offset_map": np.zeros(3)}, "offset_map: the shape"),
    ({"offset_map": np.zeros((0, 4))}, "offset_map: the shape"),
])  # fmt: skip
def test_images_out_of_range_are_an_error(images, message):
    with pytest.raises(OptionError, match=message):
        bake(plane(), plane(), BakeOptions(size=8), **images)


def test_a_mask_with_rays_along_face_normals_is_an_error():
    with pytest.raises(OptionError, match="skew_mask, rays"):
        baked(skew_mask=image(0.5), rays="face")
    cage = LOW.replace(positions=LOW.positions * 1.2)
    assert not same(
        baked(skew_mask=image(1.0), rays="face", cage=cage), baked(rays="face", cage=cage)
    )
