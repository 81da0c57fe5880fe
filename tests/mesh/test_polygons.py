"""Triangles of polygons: they fill the polygon, whatever corner comes first, in every format."""

import warnings
from itertools import permutations

import numpy as np
import pytest

from tests.fbx_writer import scene, shape, written
from texbake import Mesh, ReadWarning, check, mesh_info, read_mesh, repair, write_mesh
from texbake.errors import MeshError
from texbake.mesh.compose import excerpt, join_meshes, transformed, turned_over
from texbake.mesh.mesh import UvSet
from texbake.mesh.polygons import outlines, triangulated
from texbake.mesh.shapes import cube

# The floor of an L: three squares.
L_SHAPE = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]


def areas(points, triangles):
    """(F,) areas of triangles of points (n, 2) of whole numbers, exact."""
    a, b, c = np.asarray(points)[triangles].transpose(1, 2, 0)
    return ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2


def area(points):
    """Area of a polygon (n, 2) of whole numbers."""
    x, y = np.asarray(points).T
    return (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2


def cut(points, *, first=0, axis=2):
    """Triangles of a polygon that begins with another corner, as numbers of its points."""
    flat = np.insert(np.asarray(points, float), 2, 0.0, axis=1)
    corners = np.roll(np.arange(len(flat)), -first)
    places = np.ascontiguousarray(np.roll(flat, axis - 2, axis=1))
    triangles, polygons = triangulated("it", places, corners, np.array([len(flat)]))
    assert triangles[0, :2].tolist() == [0, 1]
    assert polygons.tolist() == [0] * (len(flat) - 2)
    return corners[triangles]


def star(rng, n, size):
    """A polygon of whole numbers around a point, counter-clockwise; many corners are straight."""
    points = np.unique(rng.integers(-size, size + 1, (n, 2)), axis=0)
    points = points[(points != 0).any(axis=1)]
    turns = np.arctan2(points[:, 1], points[:, 0]).round(9)
    points = points[np.unique(turns, return_index=True)[1]]
    gaps = np.diff(np.sort(turns), append=turns.min() + 2 * np.pi)
    return points if len(points) > 3 and gaps.max() < 3 else star(rng, n, size)


@pytest.mark.parametrize("size", [2, 5, 1000, 2**25])
def test_triangles_fill_a_polygon_whatever_corner_comes_first(size):
    rng = np.random.default_rng(size)
    for _ in range(100):
        points = star(rng, int(rng.integers(6, 40)), size)
        first = int(rng.integers(len(points)))
        triangles = cut(points, axis=int(rng.integers(3)))
        assert areas(points, triangles).min() > 0
        assert areas(points, triangles).sum() == area(points)
        same = cut(points, first=first)
        assert {tuple(sorted(t)) for t in same.tolist()} == {
            tuple(sorted(t)) for t in cut(points).tolist()
        }


def test_a_corridor_and_a_hole_with_a_bridge():
    steps = np.arange(300)
    comb = [(299, 0), *zip(steps[::-1], 1 + 50 * (steps % 2), strict=True), (0, 0)]
    spiral = [(r, a) for r in (1, 2) for a in range(40)]
    turned = [
        (round(1e6 * (r + a / 9) * np.cos(a)), round(1e6 * (r + a / 9) * np.sin(a)))
        for r, a in [*spiral[40:], *spiral[:40][::-1]]
    ]
    hole = [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)]
    for points in (comb, turned, hole):
        for first in (0, 3, len(points) - 1):
            triangles = cut(points, first=first)
            assert areas(points, triangles).min() > 0
            assert areas(points, triangles).sum() == area(points)


def test_quadrilaterals_are_cut_along_the_shorter_diagonal_that_lies_inside():
    long = [(0, 0), (3, 0), (4, 2), (1, 2)]
    arrow = [(0, 0), (4, 1), (1, 1), (1, 4)]
    square = [(0, 0), (1, 0), (1, 1), (0, 1)]
    for points, diagonal in ((long, {1, 3}), (arrow, {0, 2}), (square, {0, 2})):
        for first in range(4):
            one, other = cut(points, first=first).tolist()
            assert set(one) & set(other) == diagonal


@pytest.mark.parametrize("place", range(4))
def test_a_square_is_cut_at_its_least_vertex_wherever_it_lies(place):
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    for ring in permutations(range(4)):
        if ring[0] % 2 != ring[2] % 2:
            continue  # it would cross itself
        corners = np.array(ring, np.int32)
        found, _ = triangulated("it", np.roll(points, place, axis=0), corners, np.array([4]))
        assert (corners[found] == 0).sum() == 2


@pytest.mark.parametrize("axes", [(0, 1, 2), (0, 2, 1), (2, 0, 1)])
@pytest.mark.parametrize("n", [4, 5, 7])
def test_polygons_that_cross_themselves_are_counted(n, axes):
    turns = 2 * np.pi * 2 * np.arange(n) / n if n % 2 else np.array([0, 2, 1, 3]) * np.pi / 2
    star = np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1).take(axes, axis=1)
    with pytest.warns(ReadWarning, match="2 faces cross themselves"):
        triangulated("it", star, np.tile(np.arange(n), 2), np.array([n, n]))


def test_polygons_without_area_have_triangles_too():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for points in ([(i, 0) for i in range(6)], [(0, 0)] * 7, [(0, 0), (1, 0)] * 2):
            assert len(cut(points)) == len(points) - 2


@pytest.mark.parametrize("scale", [1e-6, 0.3, 0.7, 3.0, 1e6])
def test_size_breaks_no_ties(scale):
    """A regular star has equal diagonals, which differ by rounding."""
    for n in range(10, 40, 2):
        angles = 0.1 + np.arange(n) * (2.0 * np.pi / n)
        radii = np.where(np.arange(n) % 2 == 0, 1.0, 0.6)[:, None]
        points = radii * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        assert np.array_equal(cut(scale * points), cut(points))


def test_vertices_that_are_not_there_are_the_nearest_that_are():
    rng = np.random.default_rng(3)
    points = rng.normal(size=(20, 3))  # the polygons are of the first ten
    corners, sizes = rng.integers(-9, 20, 400), np.tile([3, 5], 50)
    found, _ = triangulated("it", points[:10], corners, sizes)
    known, _ = triangulated("it", points[:10], corners.clip(0, 9), sizes)
    np.testing.assert_array_equal(found, known)


def test_a_polygon_of_many_corners_is_cut_at_once():
    turns = 2 * np.pi * np.arange(100_000) / 100_000
    radii = np.random.default_rng(0).uniform(1, 2, len(turns))
    points = (radii * np.stack([np.cos(turns), np.sin(turns)])).T
    triangles = cut(points)
    assert areas(points, triangles).sum() == pytest.approx(area(points), rel=1e-12)
    assert areas(points, triangles).min() > 0


def l_prism():
    """Points and polygons of an L-shaped prism of height 1: area 14, volume 3."""
    points = [(x, y, z) for z in (0, 1) for x, y in L_SHAPE]
    sides = [[i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6] for i in range(6)]
    return points, [[2, 1, 0, 5, 4, 3], [9, 10, 11, 6, 7, 8], *sides]


def _obj(points, polygons):
    lines = [f"v {x} {y} {z}" for x, y, z in points]
    return "\n".join([*lines, *("f " + " ".join(str(i + 1) for i in p) for p in polygons)])


def _off(points, polygons):
    lines = [f"{x} {y} {z}" for x, y, z in points]
    lines += [" ".join(map(str, [len(p), *p])) for p in polygons]
    return "\n".join([f"OFF\n{len(points)} {len(polygons)} 0", *lines])


def _ply(points, polygons):
    body = _off(points, polygons).split("\n", 2)[2]
    axes = "".join(f"property double {axis}\n" for axis in "xyz")
    return (
        f"ply\nformat ascii 1.0\nelement vertex {len(points)}\n{axes}element face "
        f"{len(polygons)}\nproperty list uchar int vertex_indices\nend_header\n{body}\n"
    )


def _usda(points, polygons):
    corners = [i for p in polygons for i in p]
    return (
        f'#usda 1.0\ndef Mesh "L" {{\npoint3f[] points = {points}\n'
        f"int[] faceVertexCounts = {[len(p) for p in polygons]}\n"
        f"int[] faceVertexIndices = {corners}\n}}\n"
    )


def _fbx(points, polygons):
    ends = [i for p in polygons for i in (*p[:-1], ~p[-1])]
    geometry = shape(points=100 * np.array(points, float), polygons=np.array(ends, np.int32))
    return written(scene(geometry=geometry), 7400, "binary")


@pytest.mark.parametrize("write", [_obj, _off, _ply, _usda, _fbx], ids=lambda w: w.__name__[1:])
def test_a_concave_prism_has_its_area_in_every_format(write, tmp_path):
    data = write(*l_prism())
    path = tmp_path / f"prism.{write.__name__[1:]}"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    mesh = read_mesh(path)
    a, b, c = mesh.positions[mesh.faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    assert np.linalg.norm(normals, axis=1).sum() / 2 == pytest.approx(14)
    assert (a * normals).sum() / 6 == pytest.approx(3)


def polygons_of(mesh, rows=None):
    """The polygons of a mesh: vertices, or rows by corner, in order."""
    found = outlines(mesh)
    rows = mesh.faces if rows is None else rows
    values = rows.reshape(-1, *rows.shape[2:])[found.slots]
    return [part.tolist() for part in np.split(values, np.cumsum(found.sizes)[:-1])]


def turned(polygon):
    """A polygon that begins with its least vertex."""
    first = polygon.index(min(polygon))
    return polygon[first:] + polygon[:first]


def prism(*, uvs=True, normals=True, sets=False):
    """The L-shaped prism with two triangles more; each polygon is a chart of its own."""
    points, polygons = l_prism()
    polygons = [*polygons[:4], [0, 1, 13], *polygons[4:], [13, 1, 0]]
    points = np.array([*points, (9, 9, 9), (0, -1, -1)], float)
    sizes = np.array([len(p) for p in polygons])
    corners = np.concatenate(polygons)
    slots, numbers = triangulated("it", points, corners, sizes)
    ids = slots.astype(np.int32)
    values = np.random.default_rng(0).uniform(-1, 1, (len(corners), 3)).astype(np.float32)
    fields = {"uvs": abs(values[:, :2]), "uv_faces": ids} if uvs else {}
    if normals:
        fields |= {"normals": values, "normal_faces": ids}
    if sets:
        fields["uv_sets"] = {"light": UvSet(values[::-1, :2].astype(float), ids)}
    groups = (numbers >= 4).astype(np.int32)
    mesh = Mesh(
        positions=points, faces=corners[slots], polygon_of=numbers, name="prism",
        face_groups=groups, group_names=("ends", "sides"), **fields,
    )  # fmt: skip
    return mesh, polygons


@pytest.mark.parametrize("suffix", ["obj", "ply", "off", "usda", "usdc"])
@pytest.mark.parametrize("uvs", [False, True], ids=["bare", "uvs"])
def test_polygons_are_written_as_they_were_read(suffix, uvs, tmp_path):
    mesh, polygons = prism(uvs=uvs, normals=uvs)
    assert (mesh.n_faces, mesh.n_polygons) == (22, 10)
    assert polygons_of(mesh) == polygons
    path = tmp_path / f"prism.{suffix}"
    write_mesh(mesh, path)
    read = read_mesh(path)
    assert polygons_of(read) == polygons
    np.testing.assert_array_equal(read.positions, mesh.positions)
    np.testing.assert_array_equal(read.faces, mesh.faces)
    if suffix not in ("ply", "off"):
        assert read.group_names == mesh.group_names
        np.testing.assert_array_equal(read.face_groups, mesh.face_groups)
    if uvs and suffix != "off":
        np.testing.assert_array_equal(read.corner_uvs(), mesh.corner_uvs())
        tolerance = 0 if suffix in ("obj", "ply") else 1e-6  # USD holds float32
        ours, theirs = (item.normals[item.normal_faces] for item in (mesh, read))
        np.testing.assert_allclose(theirs, ours, atol=tolerance)


def test_what_is_made_of_a_mesh_keeps_its_polygons():
    mesh, polygons = prism()
    for moved in (transformed(mesh, np.diag([1.0, 2, 3, 1])), repair(mesh)[0]):
        assert [turned(p) for p in polygons_of(moved)][:4] == [turned(p) for p in polygons][:4]
    mirrored = transformed(mesh, np.diag([-1.0, 1, 1, 1]))
    assert [turned(p[::-1]) for p in polygons_of(mirrored)] == [turned(p) for p in polygons]
    joined = join_meshes([mesh, cube(), mesh])
    assert joined.n_polygons == 10 + 12 + 10
    assert polygons_of(joined)[:10] == polygons
    part = excerpt(mesh, np.arange(mesh.n_faces) % 4 > 0)
    assert 0 < part.n_faces - part.n_polygons < mesh.n_faces - mesh.n_polygons
    assert mesh.replace(faces=mesh.faces[:, ::-1]).polygon_of is None
    with pytest.raises(MeshError, match="polygon_of"):
        mesh.replace(polygon_of=mesh.polygon_of[::-1])


@pytest.mark.parametrize("what", ["uvs", "normals", "sets", "groups"])
def test_a_polygon_that_a_seam_crosses_is_written_as_triangles(what, tmp_path):
    mesh, polygons = prism(sets=True)
    faces = mesh.uv_faces.copy()
    faces[0] = faces[-1]  # the first polygon has six corners, the last three
    groups = mesh.face_groups.copy()
    groups[0] = 1
    changes = {
        "uvs": {"uv_faces": faces}, "normals": {"normal_faces": faces},
        "sets": {"uv_sets": {"light": UvSet(mesh.uvs, faces)}}, "groups": {"face_groups": groups},
    }[what]  # fmt: skip
    mesh = mesh.replace(**changes)
    with pytest.warns(ReadWarning, match="1 polygon is written as triangles"):
        write_mesh(mesh, tmp_path / "prism.obj")
    read = read_mesh(tmp_path / "prism.obj")
    np.testing.assert_array_equal(read.faces, mesh.faces)
    np.testing.assert_array_equal(read.corner_uvs(), mesh.corner_uvs())
    assert polygons_of(read)[4:] == polygons[1:]


def test_further_uv_sets_fit_polygons_that_begin_with_another_corner(tmp_path):
    mesh = transformed(prism(sets=True)[0], np.diag([-1.0, 1, 1, 1]))
    write_mesh(mesh, tmp_path / "prism.obj")
    read = read_mesh(tmp_path / "prism.obj")
    ours, theirs = (polygons_of(item, item.corner_uvs("light")) for item in (mesh, read))
    assert ours == theirs


def test_objects_of_an_obj_file_are_objects_again_and_groups_with_common_vertices_are_not(tmp_path):
    path = tmp_path / "it.obj"
    names = ("crate/lid", "crate", "ball", "a/a", "x/ y", "crate/hinge/pin")
    apart = join_meshes([cube().replace(name=name) for name in names])
    write_mesh(apart, path)
    lines = [line for line in path.read_text().splitlines() if line[0] in "og"]
    assert lines == [
        *("o crate", "g lid", "g", "o ball", "o a/a", "o x/ y", "o crate", "g hinge/pin")
    ]
    assert read_mesh(path).group_names == names
    groups = np.repeat(np.arange(6, dtype=np.int32), 2)
    write_mesh(cube().replace(face_groups=groups, group_names=names), path)
    assert [line[0] for line in path.read_text().splitlines() if line[0] in "og"] == ["g"] * 6
    np.testing.assert_array_equal(read_mesh(path).face_groups, groups)
    assert read_mesh(path).group_names == names


def test_faces_are_counted_as_in_the_file():
    mesh = prism(normals=False)[0]
    info = mesh_info(mesh)
    assert (info.n_faces, info.n_triangles) == (10, 22)
    assert [group.n_faces for group in info.groups] == [2 + 2, 6]
    solid = excerpt(mesh, ~np.isin(mesh.polygon_of, [4, 9]))
    wrong = turned_over(solid, solid.polygon_of == 1)
    fixed, report = repair(wrong)
    assert (report.n_faces, report.counts["faces turned"]) == (8, 1)
    assert [sorted(p) for p in polygons_of(fixed)] == [sorted(p) for p in polygons_of(solid)]
    found = {finding.name: finding for finding in check(wrong).findings}
    assert found["inconsistent-winding"].worst_faces == [1]
    assert found["overlapping-coordinates"].count == 8
