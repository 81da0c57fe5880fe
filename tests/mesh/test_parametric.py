"""Parametric surfaces: options, planes, height fields, range images, Möbius strips, lattices."""

import math
from dataclasses import fields

import numpy as np
import pytest

from tests.mesh.test_shapes import areas_in_texture
from texbake import MakeOptions, OptionError, make
from texbake.errors import MeshError
from texbake.mesh.normals import face_normals
from texbake.mesh.parametric.grid import circle_points, part_way, triangulate
from texbake.mesh.parametric.options import MAX_TRIANGLES, SHAPE_DEFAULTS, SHAPES
from texbake.mesh.remeshing.boundary import Loops
from texbake.mesh.topology import euler_characteristic, face_components, find_edges
from texbake.texture.lookup import lookup

X, Y = np.meshgrid(np.arange(4.0), np.arange(4.0))
SOURCES = {
    "revolution": {"profile": [(1, 0), (1, 1)]},
    "bezier": {"patches": [np.stack([X, Y, np.sin(X + Y)], axis=-1)]},
    "height-field": {"image": np.zeros((3, 4))},
    "cylindrical-range": {"image": np.ones((3, 4))},
    "depth-image": {"image": np.ones((3, 4))},
}


@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_has_defaults_and_faces_where_its_normals_point(shape):
    mesh = make(shape, **SOURCES.get(shape, {}))
    assert mesh.name == shape.replace("-", " ")
    assert (mesh.normals is None) == (shape in ("height-field", "cylindrical-range", "depth-image"))
    if mesh.normals is not None:
        corners = mesh.normals[mesh.normal_faces]
        assert np.einsum("fi,fci->fc", face_normals(mesh), corners).min() > 0.9
    assert areas_in_texture(mesh).min() > 0.0


def test_the_table_has_every_option_and_no_other():
    read = {name for defaults in SHAPE_DEFAULTS.values() for name in defaults}
    assert read == {field.name for field in fields(MakeOptions)}


@pytest.mark.parametrize("shape", SHAPES)
def test_an_option_that_a_shape_does_not_read_is_named(shape):
    values = {
        **dict.fromkeys(("radius", "height", "width", "minor_radius", "turns", "crease"), 1.0),
        **{"sides": 6, "caps": False, "twists": 1, "profile": "a", "patches": "a", "image": "a"},
    }
    for name in values.keys() - SHAPE_DEFAULTS[shape].keys():
        with pytest.raises(OptionError, match=f"^{name}: the shape {shape} "):
            make(shape, **SOURCES.get(shape, {}), **{name: values[name]})


@pytest.mark.parametrize("shape", SOURCES)
def test_a_missing_source_is_named(shape):
    (name,) = SOURCES[shape]
    with pytest.raises(OptionError, match=f"^{name}: the shape {shape} needs it"):
        make(shape)


@pytest.mark.parametrize(("shape", "options", "message"), [
    ("sphere", {"resolution": 10**9}, "makes 2,000,000,000,000,000,000 triangles; 20,000,000"),
    ("sphere", {"resolution": (8, 1)}, "resolution: 8x1 is too small"),
    ("torus", {"resolution": 2}, "resolution: 2x2 is too small"),
    ("cylinder", {"sides": 10**9}, "triangles"),
    ("height-field", {**SOURCES["height-field"], "resolution": 10**5}, "20,000,000,000 tri"),
    ("torus", {"minor_radius": 1.0}, "minor_radius: 1.0 is not below the radius"),
])  # fmt: skip
def test_values_out_of_range(shape, options, message):
    with pytest.raises(OptionError) as caught:
        make(shape, **options)
    assert message in str(caught.value)


def test_the_limit_of_triangles_is_that_of_the_message():
    side = int((MAX_TRIANGLES / 2) ** 0.5)
    MakeOptions(resolution=side).settings("plane")
    with pytest.raises(OptionError, match="are the most"):
        MakeOptions(resolution=side + 1).settings("plane")


def test_changes_go_on_top_of_options():
    options = MakeOptions(radius=3, resolution=8)
    assert make("sphere", options).bounds[1, 1] == 3
    assert make("sphere", options, radius=2).bounds[1, 1] == 2
    assert options.radius == 3


@pytest.mark.parametrize("scale", [2.0**-20, 2.0**20])
@pytest.mark.parametrize("shape", ["sphere", "cylinder", "cone", "torus", "mobius", "plane"])
def test_size_changes_only_the_size(shape, scale):
    lengths = {"radius": 1.5, "height": 0.7, "width": 0.3, "minor_radius": 0.2}
    lengths = {name: length for name, length in lengths.items() if name in SHAPE_DEFAULTS[shape]}
    one = make(shape, **lengths)
    other = make(shape, **{name: scale * length for name, length in lengths.items()})
    np.testing.assert_array_equal(other.positions, scale * one.positions)
    np.testing.assert_array_equal(other.uvs, one.uvs)
    np.testing.assert_array_equal(other.normals, one.normals)


# Planes, height fields and Möbius strips.


@pytest.mark.parametrize("resolution", [1, 3, (7, 2)])
def test_a_plane_is_exact(resolution):
    mesh = make("plane", resolution=resolution, width=3, height=0.5)
    n_u, n_v = resolution if isinstance(resolution, tuple) else (resolution, resolution)
    assert (mesh.n_vertices, mesh.n_faces) == ((n_u + 1) * (n_v + 1), 2 * n_u * n_v)
    assert mesh.bounds.tolist() == [[-1.5, -0.25, 0], [1.5, 0.25, 0]]
    expected = (mesh.uvs - 0.5) * [3, 0.5]
    np.testing.assert_allclose(mesh.positions[:, :2], expected, atol=4e-16)
    np.testing.assert_array_equal(mesh.faces, mesh.uv_faces)
    assert mesh.normals.tolist() == [[0, 0, 1]]
    assert (face_normals(mesh) == [0, 0, 1]).all()
    # Opposite borders lie opposite, bit by bit.
    np.testing.assert_array_equal(
        np.sort(mesh.positions[:, 0]), -np.sort(mesh.positions[:, 0])[::-1]
    )


def test_a_height_field_has_a_vertex_a_pixel():
    image = np.random.default_rng(0).uniform(-1, 2, (5, 7)).astype(np.float32)
    mesh = make("height-field", image=image, width=7, height=0.3)
    assert (mesh.n_vertices, mesh.n_faces) == (35, 2 * 6 * 4)
    for x, y, z in mesh.positions:
        column, row = x + 3, 2 - y  # pixels of side 1 about the origin, row 0 at the top
        assert z == 0.3 * np.float64(image[round(row), round(column)])
    # A lookup at the vertices' coordinates finds their own pixels.
    found = lookup(image[..., None], mesh.uvs)[:, 0]
    heights = np.empty(len(mesh.uvs))
    heights[mesh.uv_faces] = mesh.positions[mesh.faces, 2]
    np.testing.assert_allclose(heights, 0.3 * found, rtol=1e-5)  # float32


def test_another_resolution_is_bilinear():
    x, y = np.meshgrid(np.arange(4.0), np.arange(3.0))
    image = 1 + 2 * x + 5 * y + x * y  # bilinear everywhere
    mesh = make("height-field", image=image, width=4, height=1, resolution=(9, 10))
    assert mesh.n_faces == 2 * 9 * 10
    x, y, z = mesh.positions.T
    x, y = x + 1.5, 1 - y
    np.testing.assert_allclose(z, 1 + 2 * x + 5 * y + x * y, rtol=1e-14)
    coarse = make("height-field", image=image, resolution=1)
    assert sorted(coarse.positions[:, 2].tolist()) == [1 / 4, 7 / 4, 11 / 4, 23 / 4]


def test_of_colors_the_mean_counts_and_alpha_does_not():
    gray = np.random.default_rng(1).random((4, 5)).astype(np.float32)
    alpha = np.zeros((4, 5), dtype=np.float32)
    plain = make("height-field", image=gray).positions
    for channels in [gray], [gray, alpha], [gray] * 3, [gray, gray, gray, alpha]:
        image = np.stack(channels, axis=-1)
        np.testing.assert_array_equal(make("height-field", image=image).positions, plain)


@pytest.mark.parametrize(("image", "message"), [
    (np.zeros((1, 9)), r"the shape \(1, 9\) is not an image of 2 x 2 pixels or more"),
    (np.zeros(4), "is not an image"),
    (np.zeros((2, 2, 0)), "is not an image"),
    ([[0, np.nan], [np.inf, 0]], "some of its pixels are not finite"),
    ("hill.png", "not an array"),
])  # fmt: skip
def test_arrays_that_are_no_images(image, message):
    with pytest.raises(OptionError, match=message):
        make("height-field", image=image)


@pytest.mark.parametrize("twists", [-3, -1, 0, 1, 2, 3])
@pytest.mark.parametrize("resolution", [(3, 1), (24, 5)])
def test_topology(twists, resolution):
    mesh = make("mobius", twists=twists, resolution=resolution)
    n_u, n_v = resolution
    edges = find_edges(mesh.faces)
    odd = twists % 2 == 1
    assert (mesh.n_vertices, mesh.n_faces) == (n_u * (n_v + 1), 2 * n_u * n_v)
    assert euler_characteristic(mesh.faces, edges) == 0
    assert len(Loops.of(mesh.positions, mesh.faces).sizes) == (1 if odd else 2)
    assert edges.misoriented.sum() == (n_v if odd else 0)
    assert not edges.non_manifold.any()
    assert face_components(mesh.faces, mesh.n_vertices)[1] == 1


def strip(u, v, twists, radius=1.0, width=0.8):
    angle, turn = 2 * np.pi * (u - 0.5), np.pi * twists * (u - 0.5)
    across = width * (v - 0.5)
    r = radius + across * np.sin(turn)
    return np.stack([r * np.sin(angle), across * np.cos(turn), r * np.cos(angle)], axis=-1)


@pytest.mark.parametrize("twists", [1, 2, -5])
def test_corners_follow_the_closed_form(twists):
    mesh = make("mobius", twists=twists, resolution=(48, 6))
    u, v = mesh.corner_uvs().reshape(-1, 2).T
    points = mesh.positions[mesh.faces].reshape(-1, 3)
    # The cosine of an angle of up to 5 pi / 2, rounded: some 2^-51.
    assert np.abs(points - strip(u, v, twists)).max() < 3e-15
    # Central differences of step h are off by h^2 times third derivatives, of about (2 pi)^3.
    h = 1e-5
    du = strip(u + h, v, twists) - strip(u - h, v, twists)
    dv = strip(u, v + h, twists) - strip(u, v - h, twists)
    expected = np.cross(du, dv)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    normals = mesh.normals[mesh.normal_faces].reshape(-1, 3)
    assert np.abs(normals - expected).max() < 1e-7


@pytest.mark.parametrize("options", [{"width": 2.0}, {"twists": 200}, {"twists": 10**30}])
def test_strips_that_cannot_be(options):
    with pytest.raises(OptionError, match=r"width: 2\.0 is not|twists: .* raise the resolution"):
        make("mobius", **options)


# Range images of surfaces that have formulas: vertices lie on them, and holes stay.


def radii(n_rows=24, n_columns=40):
    """A cone of radius 1 at the bottom and 1/2 at the top, with waves around it."""
    v = 1.0 - (np.arange(n_rows) + 0.5) / n_rows
    angles = 2.0 * math.pi * (np.arange(n_columns) + 0.5) / n_columns
    return (1.0 - 0.5 * v[:, None]) * (1.0 + 0.1 * np.cos(3.0 * angles))


def test_vertices_of_a_cylindrical_range_lie_on_the_surface():
    mesh = make("cylindrical-range", image=radii(), radius=2.0, height=3.0)
    assert (mesh.n_vertices, mesh.n_faces) == (24 * 40, 2 * 23 * 40)
    x, y, z = mesh.positions.T
    angles = np.arctan2(x, z) + math.pi
    v = y / 3.0 + 0.5
    np.testing.assert_allclose(
        np.hypot(x, z), 2.0 * (1.0 - 0.5 * v) * (1.0 + 0.1 * np.cos(3.0 * angles)), atol=1e-12
    )
    # Outwards, and closed around: each border edge is at the top or at the bottom.
    middles = mesh.positions[mesh.faces].mean(axis=1) * [1.0, 0.0, 1.0]
    assert (np.einsum("ij,ij->i", face_normals(mesh), middles) > 0.0).all()
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert (counts == 1).sum() == 2 * 40


def test_texture_coordinates_are_centers_of_pixels_and_repeat_across_the_seam():
    image = radii()
    mesh = make("cylindrical-range", image=image)
    corners = mesh.corner_uvs().reshape(-1, 2)
    column, row = corners[:, 0] * 40 - 0.5, (1.0 - corners[:, 1]) * 24 - 0.5
    np.testing.assert_allclose(column, np.round(column), atol=1e-9)
    at = image[np.round(row).astype(int), np.round(column).astype(int) % 40]
    x, _, z = mesh.positions[mesh.faces.ravel()].T
    np.testing.assert_allclose(np.hypot(x, z), at, atol=1e-12)
    assert np.ptp(mesh.corner_uvs()[..., 0], axis=1).max() < 1.5 / 40


def test_a_depth_image_of_a_ball_lies_on_the_ball():
    n, fov = 64, 30.0
    reach = math.tan(math.radians(fov / 2.0))
    grid = ((np.arange(n) + 0.5) / n * 2.0 - 1.0) * reach
    x, y = np.meshgrid(grid, -grid)
    # The ray (x, y, -1) t meets the ball of radius 1 about (0, 0, -5).
    a, b, c = x * x + y * y + 1.0, -10.0, 24.0
    inside = b * b - 4.0 * a * c
    depths = np.where(inside > 0.0, (-b - np.sqrt(np.maximum(inside, 0.0))) / (2.0 * a), 0.0)
    mesh = make("depth-image", image=depths / 10.0, distance=10.0, fov=fov)
    away = np.linalg.norm(mesh.positions - [0.0, 0.0, -5.0], axis=1)
    np.testing.assert_allclose(away, 1.0, atol=1e-12)
    assert mesh.n_vertices <= (depths > 0.0).sum()
    toward = -mesh.positions[mesh.faces].mean(axis=1)
    assert (np.einsum("ij,ij->i", face_normals(mesh), toward) > 0.0).all()


def test_holes_stay_and_large_steps_are_not_bridged():
    image = np.full((8, 10), 0.5)
    image[3, 4] = 0.0
    image[6, 6] = np.nan
    holed = make("depth-image", image=image)
    assert holed.n_vertices == 78
    assert holed.n_faces == 2 * 7 * 9 - 2 * 4  # each square around a hole keeps one
    image = np.full((8, 10), 0.5)
    image[:, 5:] = 0.8
    whole, parted = (make("depth-image", image=image, max_step=step) for step in (None, 0.1))
    assert whole.n_faces - parted.n_faces == 2 * 7
    cylinder = make("cylindrical-range", image=image, max_step=0.1)
    assert cylinder.n_faces == 2 * 7 * 8


@pytest.mark.parametrize("missing", [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_a_square_without_one_corner_keeps_the_triangle_of_the_others(missing):
    for value, options in (0.0, {}), (0.9, {"max_step": 0.1}):
        image = np.full((2, 2), 0.5)
        image[missing] = value
        mesh = make("depth-image", image=image, **options)
        assert (mesh.n_vertices, mesh.n_faces) == (3, 1)
        assert (face_normals(mesh)[:, 2] > 0.0).all()
        rows, columns = 2 * (1.0 - mesh.uvs[:, 1]) - 0.5, 2 * mesh.uvs[:, 0] - 0.5
        kept = set(zip(np.rint(rows).tolist(), np.rint(columns).tolist(), strict=True))
        assert kept == {(0, 0), (0, 1), (1, 0), (1, 1)} - {missing}


@pytest.mark.parametrize("shape", ["cylindrical-range", "depth-image"])
def test_what_is_no_range_image_is_one_clear_error(shape):
    with pytest.raises(MeshError, match="no three neighboring pixels have a distance"):
        make(shape, image=np.zeros((5, 5)))
    with pytest.raises(OptionError, match="is not an image of 2 x 2 pixels or more"):
        make(shape, image=np.ones(5))
    with pytest.raises(OptionError, match="a vertex for each pixel"):
        make(shape, image=np.ones((5, 5)), resolution=4)


# Lattices: seams and poles, and points of the circle.


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7, 8, 24, 100, 1001])
def test_circle_points_are_those_of_long_double(n):
    angles = 2 * np.arange(n, dtype=np.longdouble) * np.longdouble("3.14159265358979323846264") / n
    exact = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    # The angle is rounded once more than the cosine: two units in the last place of 1.
    assert np.abs(circle_points(n) - exact).max() <= 2 * 2.0**-53


def test_circle_points_are_exact_and_mirrored_bit_by_bit():
    for n in 8, 60, 1000:
        points = circle_points(n)
        x, y = points.T
        assert points[[0, n // 4, n // 2, 3 * n // 4]].tolist() == [
            [1, 0], [0, 1], [-1, 0], [0, -1],
        ]  # fmt: skip
        np.testing.assert_array_equal(points[1:], (points * [1, -1])[:0:-1])  # about the x axis
        np.testing.assert_array_equal(np.roll(points, -n // 2, axis=0), -points)
        np.testing.assert_array_equal(np.roll(x, n // 4), y)
        assert not np.signbit(points[points == 0]).any()


@pytest.mark.parametrize("ends", [(0.1, 0.7), (-1.3, 1.3), (0.3, 0.3), (5.0, 0.0)])
def test_part_way_has_exact_ends_and_the_same_way_back(ends):
    steps = np.arange(8)
    there, back = part_way(*ends, steps, 7), part_way(*ends[::-1], steps, 7)
    assert (there[0], there[-1]) == ends
    np.testing.assert_array_equal(there, back[::-1])
    np.testing.assert_allclose(there, np.linspace(*ends, 8), rtol=0, atol=2e-15)  # a few roundings
    if ends[0] == ends[1]:
        assert (there == ends[0]).all()


@pytest.mark.parametrize("side", range(4))
def test_a_square_with_a_side_that_is_a_point(side):
    ids = np.arange(4)
    ids[(side + 1) % 4] = ids[side]
    nodes = np.array([[0, 0], [2, 0], [2, 2], [0, 2]])
    grid = triangulate(nodes, ids, np.array([[0, 1, 2, 3]]))
    assert len(grid.faces) == 1
    corners = grid.nodes[grid.faces[0]]
    assert corners[0].tolist() == ((nodes[side] + nodes[(side + 1) % 4]) // 2).tolist()
    assert np.linalg.det(np.array([corners[1] - corners[0], corners[2] - corners[0]])) > 0


@pytest.mark.parametrize("ids", [[0, 0, 1, 1], [0, 1, 1, 0], [0, 0, 0, 1], [0, 0, 0, 0]])
def test_a_square_without_area_is_dropped(ids):
    nodes = np.array([[0, 0], [2, 0], [2, 2], [0, 2]])
    assert len(triangulate(nodes, np.array(ids), np.array([[0, 1, 2, 3]])).faces) == 0


def test_opposite_corners_in_one_vertex_leave_no_triangle_with_that_twice():
    nodes = np.array([[0, 0], [2, 0], [2, 2], [0, 2]])
    for ids in [0, 1, 0, 2], [0, 1, 2, 1]:
        faces = triangulate(nodes, np.array(ids), np.array([[0, 1, 2, 3]])).faces
        assert all(len({ids[node] for node in face}) == 3 for face in faces.tolist())
