"""Whole FBX files: random scenes against their transforms, and real ones against OBJ files."""

import re

import numpy as np
import pytest
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from tests.fbx_writer import scene, shape, written
from texbake.mesh.files import read_mesh
from texbake.mesh.files.fbx_scene import read_scene, scene_axes

ORDERS = ("xyz", "xzy", "yzx", "yxz", "zxy", "zyx")
# A star of ten corners, which is not convex, a quad and a triangle below it.
ANGLES = np.arange(10) * np.pi / 5.0
STAR = np.where(np.arange(10) % 2, 0.4, 1.0) * np.array([np.cos(ANGLES), np.sin(ANGLES)])
POINTS = np.concatenate([np.append(STAR, [[0.3] * 10], 0).T, [[2, 0, 0], [0, 2, 0], [-2, 0, 1.0]]])
POLYGONS = [list(range(10)), [10, 11, 12, 3], [12, 10, 5]]

# Files whose OBJ shows what is not read: skins and shapes at work, subdivision, NURBS; or whose
# OBJ is in other axes and units.
OTHERWISE = re.compile(
    "half_skinned|subsurf|crease|blend_shape|skinned_pivot|dual_quaternion|maya_poses|nurbs"
    "|blender_340_._up"
)


def matrix_of(linear=None, by=(0.0, 0.0, 0.0)):
    matrix = np.eye(4)
    matrix[:3, :3] = np.eye(3) if linear is None else linear
    matrix[:3, 3] = by
    return matrix


def transforms(random):
    """Random properties of a model, and the (4, 4) matrices of it and of its geometry."""
    vectors = ("Lcl Translation", "RotationOffset", "RotationPivot", "ScalingOffset",
               "ScalingPivot", "GeometricTranslation")  # fmt: skip
    angles = ("Lcl Rotation", "PreRotation", "PostRotation", "GeometricRotation")
    values = {name: random.uniform(-2, 2, 3).tolist() for name in vectors}
    values |= {name: random.uniform(-180, 180, 3).tolist() for name in angles}
    for name in ("Lcl Scaling", "GeometricScaling"):
        values[name] = (random.uniform(0.5, 2, 3) * random.choice([-1, 1], 3)).tolist()
    order = int(random.integers(6))
    moves = {name: matrix_of(by=values[name]) for name in vectors}
    turns = {name: Rotation.from_euler("xyz", values[name], degrees=True) for name in angles}
    turns["Lcl Rotation"] = Rotation.from_euler(ORDERS[order], [
        values["Lcl Rotation"]["xyz".index(axis)] for axis in ORDERS[order]], degrees=True
    )  # fmt: skip
    rotation = turns["PreRotation"] * turns["Lcl Rotation"] * turns["PostRotation"].inv()
    pivot, center = moves["RotationPivot"], moves["ScalingPivot"]
    scaling, own = (np.diag(values[name]) for name in ("Lcl Scaling", "GeometricScaling"))
    model = np.linalg.multi_dot([
        moves["Lcl Translation"], moves["RotationOffset"], pivot, matrix_of(rotation.as_matrix()),
        np.linalg.inv(pivot), moves["ScalingOffset"], center, matrix_of(scaling),
        np.linalg.inv(center),
    ])  # fmt: skip
    geometry = moves["GeometricTranslation"] @ matrix_of(
        turns["GeometricRotation"].as_matrix() @ own
    )
    values |= {"RotationOrder": [order], "RotationActive": [1], "InheritType": [1]}
    return values, model, geometry


def directed_edges(mesh):
    corners = mesh.positions[mesh.faces]
    return np.concatenate([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 6)


@pytest.mark.parametrize("form", ["binary", "ascii"])
@pytest.mark.parametrize("version", [6100, 7100, 7400, 7500, 7700])
def test_a_random_scene_shows_what_its_transforms_say(tmp_path, version, form):
    """One geometry in nested models, mirrored or not, in the axes and units of the file."""
    random = np.random.default_rng(version)
    up, coord = random.permutation(3)[:2]
    front = 3 - up - coord
    signs = random.choice([-1, 1], 2)
    axes = np.zeros((3, 3))
    axes[0, coord], axes[1, up] = signs
    axes[2] = np.cross(axes[0], axes[1])
    settings = {
        "UpAxis": [int(up)], "UpAxisSign": [int(signs[1])], "CoordAxis": [int(coord)],
        "CoordAxisSign": [int(signs[0])], "FrontAxis": [int(front)],
        "FrontAxisSign": [int(axes[2, front])], "UnitScaleFactor": [2.54],
    }  # fmt: skip
    models, worlds, edges = {}, {None: matrix_of(0.0254 * axes)}, []
    for name, parent in (("a", None), ("b", "a"), ("c", "b"), ("d", "a"), ("e", None)):
        values, model, geometry = transforms(random)
        models[name] = (values, parent)
        worlds[name] = worlds[parent] @ model
        shown = worlds[name] @ geometry
        points = POINTS @ shown[:3, :3].T + shown[:3, 3]
        for polygon in POLYGONS:
            around = polygon if np.linalg.det(shown[:3, :3]) > 0.0 else polygon[::-1]
            edges.append(np.concatenate([points[around], np.roll(points[around], -1, 0)], axis=1))
    edges = np.concatenate(edges)
    ends = np.concatenate([[*polygon[:-1], ~polygon[-1]] for polygon in POLYGONS])
    geometry = shape(points=POINTS, polygons=ends.astype(np.int32))
    nodes = scene(version, models=models, settings=settings, geometry=geometry)
    (tmp_path / "a.fbx").write_bytes(written(nodes, version, form))
    mesh = read_mesh(tmp_path / "a.fbx")
    assert mesh.n_faces == 5 * sum(len(polygon) - 2 for polygon in POLYGONS)
    far, _ = KDTree(directed_edges(mesh)).query(edges)
    assert far.max() <= 1e-12 * np.abs(edges).max()


def polygon_edges(path, positions):
    """(E, 6) directed edges of the polygons of an OBJ file."""
    edges = []
    for line in path.read_text(errors="replace").splitlines():
        if line.startswith("f "):
            corners = [int(word.split("/")[0]) for word in line.split()[1:]]
            corners = [c - 1 if c > 0 else c for c in corners]
            edges += zip(corners, corners[1:] + corners[:1], strict=True)
    return positions[np.array(edges)].reshape(-1, 6)


def shown_by(file, shown):
    """Whether the polygons equal those of the OBJ, with the same winding; diagonals may differ."""
    expected, mesh = read_mesh(shown), read_mesh(file)
    settings = read_scene(file).settings
    axes = scene_axes({key: settings[key] for key in settings if "Axis" in key or "Unit" in key})
    edges = polygon_edges(shown, expected.positions @ axes[:3, :3].T)
    far, _ = KDTree(directed_edges(mesh)).query(edges)
    # OBJ files have six digits.
    return mesh.n_faces == expected.n_faces and far.max() <= 3e-5 * np.abs(edges).max()


@pytest.mark.realdata
def test_files_of_blender_and_maya_show_what_their_obj_shows(data_dir):
    files = sorted((data_dir / "fbx").glob("*.fbx"))
    pairs = [
        (file, shown)
        for shown in sorted((data_dir / "fbx").glob("*.obj"))
        if not OTHERWISE.search(shown.stem)
        for file in files
        if re.fullmatch(re.escape(shown.stem) + r"_\d{4}_(ascii|binary)\.fbx", file.name)
    ]
    assert len(pairs) > 50
    assert [file.name for file, shown in pairs if not shown_by(file, shown)] == []
