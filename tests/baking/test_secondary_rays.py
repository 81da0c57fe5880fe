"""Hemispheres of rays against closed forms, and the two ray casters against each other."""

import dataclasses

import numpy as np
import pytest
from embreex_oracle import EmbreexScene

from texbake import BakeOptions, Mesh, OptionError, bake, remap
from texbake.baking import scenes
from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import INNER, OUTER
from texbake.baking.scenes import BakeScenes
from texbake.baking.secondary_rays import SecondaryRays
from texbake.mesh.compose import join_meshes
from texbake.mesh.frame import LocalFrame
from texbake.mesh.normals import flat_normals
from texbake.mesh.shapes import cube, icosphere, plane, uv_sphere
from texbake.metadata import THICKNESS_SCALE
from texbake.raycast.rays import DEPTH, N_COLUMNS, OPEN, OPEN_DIRECTION
from texbake.raycast.scene import RayScene

CASTERS = [RayScene.build, EmbreexScene]


def hits_on(mesh, faces, *, seed=0, weights=None):
    """Random points of faces, or the points that have the given weights of three corners."""
    n = len(faces)
    if weights is None:
        weights = np.random.default_rng(seed).dirichlet([1, 1, 1], n)
    weights = np.ascontiguousarray(np.asarray(weights)[:, 1:], dtype=np.float32)
    faces = np.asarray(faces, dtype=np.int32)
    nothing = np.zeros((n, 3), dtype=np.float32)
    return Hits(np.arange(n, dtype=np.int32), faces, weights, faces, weights, nothing)


def rays_on(mesh, *, caster=RayScene.build, flat=True, needs=(OUTER, INNER), **options):
    """The secondary rays of a bake of a mesh; all lengths are in model units."""
    shading = "flat" if flat else "smooth"
    inputs = BakeInputs.of(mesh, mesh, BakeOptions(size=64, high_shading=shading, **options))
    scenes = BakeScenes(caster(mesh, LocalFrame.around(mesh)), mesh)
    return SecondaryRays(inputs, scenes, frozenset(needs))


def look(mesh, hits, *, n_rays=64, outer=None, inner=None, **options):
    rays = rays_on(mesh, secondary_rays=n_rays, occluder_distance=outer, thickness_distance=inner,
                   **options)  # fmt: skip
    return rays.cast(hits, 1)[0].secondary


def random_faces(mesh, n, *, chosen=None, seed=1):
    corners = mesh.positions[mesh.faces]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    if chosen is not None:
        areas = np.where(chosen, areas, 0.0)
    return np.random.default_rng(seed).choice(mesh.n_faces, n, p=areas / areas.sum())


def turned_inside_out(mesh):
    return mesh.replace(faces=mesh.faces[:, ::-1], uvs=None, uv_faces=None)


def sheet(center, a, b):
    """Parallelogram about a center that spans it with plus or minus a and b; faces a x b."""
    center, a, b = (np.asarray(v, dtype=float) for v in (center, a, b))
    corners = np.stack([center - a - b, center + a - b, center + a + b, center - a + b])
    return Mesh(positions=corners, faces=[[0, 1, 2], [0, 2, 3]])


def disk(height, n=512):
    """Unit disk at a height, as triangles about its middle."""
    angles = np.arange(n) * 2 * np.pi / n
    positions = np.full((n + 1, 3), float(height))
    positions[0, :2] = 0.0
    positions[1:, :2] = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    k = np.arange(n)
    return Mesh(
        positions=positions, faces=np.stack([np.zeros(n), 1 + k, 1 + (k + 1) % n], 1).astype(int)
    )


def spots(points):
    """Tiny triangles on the ground, facing up, one about each of the points (x, y)."""
    triangle = 1e-3 * np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0]])
    points = np.column_stack([points, np.zeros(len(points))])
    positions = (points[:, np.newaxis] + triangle).reshape(-1, 3)
    return Mesh(positions=positions, faces=np.arange(3 * len(points)).reshape(-1, 3))


@pytest.fixture(scope="module")
def bowl():
    sphere = uv_sphere(192, 384)
    low = sphere.positions[sphere.faces].mean(axis=1)[:, 2] < 0
    return turned_inside_out(sphere.replace(faces=sphere.faces[low], uvs=None, uv_faces=None))


@pytest.mark.parametrize("caster", CASTERS)
def test_a_hemispherical_bowl_is_half_open_everywhere(bowl, caster):
    # Seen from a sphere's inside, the open part of it covers its share of the sphere's area.
    hits = hits_on(bowl, random_faces(bowl, 3000))
    open_share = look(bowl, hits, caster=caster)[:, OPEN]
    # Within a standard error of 64 rays by chance, and much closer than that.
    assert open_share.std() < 0.4 * np.sqrt(0.25 / 64)
    # 5 standard errors, and a facet of 1/384 turn that lies that much below the sphere
    assert abs(open_share.mean() - 0.5) < 5 * open_share.std() / np.sqrt(3000) + 2e-4


@pytest.mark.parametrize("caster", CASTERS)
def test_surfaces_beyond_the_distance_do_not_occlude(caster):
    # A ceiling at height 1 is met within d where cos > 1 / d: open is the share 1 / d^2.
    mesh = join_meshes([spots([[0, 0]]), sheet([0, 0, 1], [50, 0, 0], [0, -50, 0])])
    hits = hits_on(mesh, [0], weights=[[1 / 3] * 3])
    for distance, share in ((0.9, 1.0), (1.25, 0.64), (2.0, 0.25), (4.0, 1 / 16)):
        met = look(mesh, hits, caster=caster, n_rays=4096, outer=distance)
        assert abs(met[0, OPEN] - share) < 5e-3  # as under the disk


def test_light_bends_away_from_a_wall():
    # Half of the hemisphere is open: its mean direction is (2 / 3 pi, 0, 1 / 3), to the far side.
    wall = sheet([-1e-2, 0, 0], [0, 500, 0], [0, 0, 500])
    mesh = join_meshes([spots([[0, 0]]), wall])
    met = look(mesh, hits_on(mesh, [0], weights=[[1 / 3] * 3]), n_rays=4096)[0]
    assert abs(met[OPEN] - 0.5) < 2e-3
    np.testing.assert_allclose(met[OPEN_DIRECTION], [2 / (3 * np.pi), 0, 1 / 3], atol=2e-3)


@pytest.mark.parametrize("caster", CASTERS)
def test_in_a_closed_room_nothing_is_open_and_light_comes_along_the_normal(caster):
    room = turned_inside_out(cube())
    met = look(room, hits_on(room, random_faces(room, 500)), caster=caster)
    assert (met[:, OPEN] == 0).all()
    normals, corners = flat_normals(room)
    faces = random_faces(room, 500)
    np.testing.assert_array_equal(met[:, OPEN_DIRECTION], normals[corners[faces, 0]])


@pytest.mark.parametrize("caster", CASTERS)
@pytest.mark.parametrize("flat", [True, False])
@pytest.mark.parametrize("shape", [cube, lambda: icosphere(2), lambda: uv_sphere(6, 9)])
def test_convex_shapes_are_open_all_around_to_the_last_ray(shape, flat, caster):
    # Turned, so that no coordinate is exact, small, and far away; smooth normals lean over faces.
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    mesh = shape()
    mesh = mesh.replace(positions=1e-3 * mesh.positions @ turn.T + 10.0, uvs=None, uv_faces=None)
    hits = hits_on(mesh, random_faces(mesh, 4000))
    met = look(mesh, hits, caster=caster, flat=flat)
    assert (met[:, OPEN] == 1).all()
    # No ray into the surface ends where it starts: the least way is that of a grazing one.
    assert (met[:, DEPTH] > 1e-2 * mesh.diagonal / np.sqrt(64)).all()


@pytest.mark.parametrize("caster", CASTERS)
def test_a_ball_is_four_thirds_of_its_radius_thick(caster):
    ball = icosphere(5)
    met = look(ball, hits_on(ball, random_faces(ball, 2000)), caster=caster)
    # Chords 2 r cos over the cosine lobe; facets are within 1e-3 of the ball.
    np.testing.assert_allclose(met[:, DEPTH].mean(), 4 / 3, rtol=2e-3)
    np.testing.assert_allclose(met[:, DEPTH], 4 / 3, rtol=0.03)  # 64 rays, a smooth integrand


@pytest.mark.parametrize("caster", CASTERS)
def test_a_ray_that_meets_no_far_side_counts_as_long_as_it_goes(caster):
    # A slab of thickness 1 and rays of length L: 2 - 1 / L. One of its sides alone: L.
    top = sheet([0, 0, 0], [50, 0, 0], [0, 50, 0])
    slab = join_meshes([top, sheet([0, 0, -1], [50, 0, 0], [0, -50, 0])])
    weights = np.tile([0.5, 0.1, 0.4], (64, 1))  # near the middle
    weights += np.linspace(0, 0.05, 64)[:, np.newaxis] * [1, 0, -1]
    for length in (0.5, 2.0, 8.0):
        hits = hits_on(slab, [0] * 64, weights=weights)
        found = look(slab, hits, caster=caster, inner=length, n_rays=1024)
        expected = 2 - 1 / length if length > 1 else length
        # Smooth but for a kink: the error of a net falls faster than 1 / sqrt(1024), 3 %.
        np.testing.assert_allclose(found[:, DEPTH], expected, rtol=0.01)
        alone = look(top, hits, caster=caster, inner=length)
        np.testing.assert_allclose(alone[:, DEPTH], length, rtol=1e-6)


def test_threads_and_the_order_of_hits_change_nothing():
    mesh = join_meshes([icosphere(3), disk(1.2)])
    hits = hits_on(mesh, random_faces(mesh, 5000))
    one, three = (look(mesh, hits, n_rays=16, threads=threads) for threads in (1, 3))
    assert one.tobytes() == three.tobytes()
    odd = np.arange(5000) % 2 == 1
    np.testing.assert_array_equal(look(mesh, hits.where(odd), n_rays=16), one[odd])


@pytest.mark.parametrize("caster", CASTERS)
def test_rays_that_no_map_needs_are_not_cast(caster):
    mesh = icosphere(1)
    hits = hits_on(mesh, [0, 1, 2])
    for needs, missing in (((OUTER,), [DEPTH]), ((INNER,), [OPEN, 1, 2, 3])):
        found, n_rays = rays_on(mesh, caster=caster, needs=needs).cast(hits, 1)
        assert found.secondary.shape == (3, N_COLUMNS) and n_rays == 3 * 64
        assert np.flatnonzero(np.isnan(found.secondary).all(axis=0)).tolist() == missing
        assert np.isnan(found.secondary).any(axis=0).sum() == len(missing)


def test_a_hemisphere_stands_on_the_side_of_the_shading_normal():
    # A face wound the wrong way with a normal that is right, and one that has no area.
    mesh = Mesh(
        positions=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces=[[0, 2, 1], [0, 1, 1]],
        normals=[[0.6, 0, 0.8]], normal_faces=[[0, 0, 0], [0, 0, 0]],
    )  # fmt: skip
    hemispheres = rays_on(mesh, flat=False).hemispheres(hits_on(mesh, [0, 1]), 1)
    np.testing.assert_allclose(hemispheres.axes, [[0.6, 0, 0.8]] * 2, rtol=1e-6)
    np.testing.assert_allclose(hemispheres.planes, [[0, 0, 1], [0.6, 0, 0.8]], rtol=1e-6)


SHORT = {"front": 0.05, "back": 0.05, "padding": 0}


@pytest.fixture(scope="module")
def ground():
    """A finely divided unit square under a disk of radius 0.2 at height 0.2 over its middle."""
    angles = np.arange(256) * 2 * np.pi / 256
    positions = np.full((257, 3), [0.5, 0.5, 0.2])
    positions[1:, :2] += 0.2 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    k = np.arange(256)
    disk = Mesh(positions=positions, faces=np.stack([0 * k, 1 + k, 1 + (k + 1) % 256], axis=1))
    return join_meshes([plane(8, 8).replace(uvs=None, uv_faces=None), disk])


def below_the_disk(size):
    """Open share of the ground in closed form, at the centers of the texels."""
    at = (np.arange(size) + 0.5) / size
    d2 = (at - 0.5) ** 2 + (at[:, np.newaxis] - 0.5) ** 2
    h2, r2 = 0.04, 0.04
    return 0.5 + (h2 + d2 - r2) / (2 * np.sqrt((h2 + d2 + r2) ** 2 - 4 * d2 * r2))


def test_a_map_of_the_ground_under_a_disk_is_the_closed_form(ground):
    options = BakeOptions(size=64, maps=("ao",), **SHORT)
    result = bake(ground, plane(), options)
    errors = result.maps["ao"].values[..., 0] - below_the_disk(64)
    assert result.has_data.all()
    # 64 rays have half the noise of random ones, and their mean is off by no more than by chance.
    assert errors.std() < 0.5 * np.sqrt(0.25 / 64)
    assert abs(errors.mean()) < 5 * errors.std() / 64
    # 16 samples share the 64 rays as parts of one net; 16 nets of 4 rays have 1.6 times its noise.
    finer = bake(ground, plane(), dataclasses.replace(options, samples=16))
    rest = finer.maps["ao"].values[..., 0] - below_the_disk(64)
    assert rest.std() < 1.1 * errors.std()
    assert finer.report.counts.secondary_rays == 64 * 64**2
    # Each sample casts at least one.
    few = bake(ground, plane(), dataclasses.replace(options, size=8, samples=16, secondary_rays=4))
    assert few.report.counts.secondary_rays == 16 * 8**2


@pytest.mark.parametrize("space", ["tangent", "object"])
def test_normals_bend_away_from_the_disk(ground, space):
    options = BakeOptions(size=64, maps=("bent-normal",), space=space, secondary_rays=256, **SHORT)
    bent = bake(ground, plane(), options).maps["bent-normal"].values
    np.testing.assert_allclose(np.linalg.norm(bent, axis=2), 1, atol=1e-6)
    at = (np.arange(64) + 0.5) / 64 - 0.5
    # The plane's tangent space is its object space: u along x, v along y, which is up the image.
    outward = bent[..., 0] * at + bent[..., 1] * at[::-1, np.newaxis]
    radius = np.hypot(at, at[:, np.newaxis])
    assert (outward[(radius > 0.1) & (radius < 0.3)] > 0).all()
    # In the middle no direction is preferred, and far from the disk hardly any.
    assert np.abs(bent[31:33, 31:33, :2].mean(axis=(0, 1))).max() < 0.05
    assert bent[0, 0, 2] > 0.99


def test_a_closed_room_is_dark_and_its_bent_normals_are_its_normals():
    room = uv_sphere(16, 32)
    inside = room.replace(faces=room.faces[:, ::-1], uv_faces=room.uv_faces[:, ::-1])
    maps = ("normal", "ao", "bent-normal")
    result = bake(inside, inside, BakeOptions(size=64, maps=maps, space="object", front=0.1))
    data = result.has_data
    assert (result.maps["ao"].values[data] == 0).all()
    np.testing.assert_allclose(
        result.maps["bent-normal"].values[data], result.maps["normal"].values[data], atol=1e-6
    )


def test_thickness_is_a_length_and_the_files_name_its_scale(tmp_path):
    ball = uv_sphere(48, 96)
    ball = ball.replace(positions=5 * ball.positions)
    result = bake(ball, ball, BakeOptions(size=64, maps=("thickness",)))
    thickness = result.maps["thickness"]
    values = thickness.values[result.has_data]
    np.testing.assert_allclose(values.mean(), 20 / 3, rtol=5e-3)  # facets of 1/96 turn
    for suffix, scale in ("png", values.max()), ("exr", 1.0):
        written = thickness.write(tmp_path / f"thickness.{suffix}")
        assert written.metadata[THICKNESS_SCALE] == scale


def test_the_given_thickness_is_white_and_the_length_of_the_rays(tmp_path):
    ball = icosphere(3)
    low = uv_sphere(16, 32)
    options = BakeOptions(size=32, maps=("thickness",), thickness_distance=0.5, front=0.2, back=0.2)
    result = bake(ball, low, options)
    assert result.maps["thickness"].values.max() < 0.5  # 2 r cos, cut off at a quarter of it
    written = result.maps["thickness"].write(tmp_path / "thickness.png")
    assert written.metadata[THICKNESS_SCALE] == 0.5


def test_outer_and_inner_rays_are_cast_once_for_all_maps_that_need_them(ground):
    for maps, n in ((("ao", "bent-normal"), 1), (("thickness",), 1), (("ao", "thickness"), 2)):
        counts = bake(ground, plane(), BakeOptions(size=16, maps=maps, **SHORT)).report.counts
        assert counts.secondary_rays == n * 64 * 16**2


@pytest.mark.parametrize("scene", [RayScene, EmbreexScene])
def test_misses_and_hits_without_a_normal_cast_no_secondary_rays(scene, monkeypatch):
    monkeypatch.setattr(scenes, "RayScene", scene)
    options = BakeOptions(size=16, maps=("ao", "bent-normal", "thickness"), **SHORT)
    away = plane().replace(positions=plane().positions + np.array([0, 0, 5]))
    missed = bake(away, plane(), options)
    assert missed.report.texels_missed == 256
    # Two sheets back to back share their vertices, whose normals cancel.
    sheet = plane()
    both = Mesh(
        positions=sheet.positions, faces=np.concatenate([sheet.faces, sheet.faces[:, ::-1]])
    )
    found = bake(both, plane(), options)
    assert found.report.texels_missed == 0
    for result in (missed, found):
        assert all(np.isfinite(baked.values).all() for baked in result.maps.values())
    assert missed.report.counts.secondary_rays == 0


def test_kept_hits_make_no_maps_of_rays_that_were_not_cast(ground):
    options = BakeOptions(size=8, maps=("ao", "bent-normal"), keep_hits=True, **SHORT)
    result = bake(ground, plane(), options)
    with pytest.raises(OptionError, match=r"^thickness: .*; bake with it among the maps$"):
        remap(result, ground, plane(), dataclasses.replace(options, maps=("thickness",)))
    plain = bake(ground, plane(), dataclasses.replace(options, maps=("normal",)))
    with pytest.raises(OptionError, match=r"^ao: "):
        remap(plain, ground, plane(), options)


def test_adaptive_samples_cast_secondary_rays_too(ground):
    options = BakeOptions(
        size=32, maps=("normal", "ao", "bent-normal"), samples="adaptive", max_error="1deg", **SHORT
    )
    result = bake(ground, plane(), options)
    assert [summary.name for summary in result.report.sampling.errors] == ["normal"]
    assert result.report.sampling.unbounded == ("ao", "bent-normal")
    assert any("bounds nothing of ao, bent-normal" in warning for warning in result.report.warnings)
    # The check of errors casts more rays of the bake, but no secondary ones.
    covered = result.report.texels_covered
    assert result.report.counts.secondary_rays == 64 * covered
    with pytest.raises(OptionError, match=r"^max_error, .* bound nothing of ao"):
        bake(ground, plane(), dataclasses.replace(options, maps=("ao",)))
