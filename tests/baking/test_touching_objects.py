"""Objects that touch, as people model them: beveled crates, bricks, a lid, a knob, a cloth."""

import itertools
import re

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from tests.models import moved
from texbake import BakeOptions, Mesh, RunOptions, bake, make, read_mesh, run, unwrap, write_mesh
from texbake.baking.parts.bake_parts import bake_objects
from texbake.jobs.maps import BakeFiles, bake_files
from texbake.mesh.compose import join_meshes
from texbake.mesh.objects import joined_objects
from texbake.mesh.shapes import icosphere

BEVEL = 0.04
# Percent of texels; rays at the very edge of a low-poly mesh may pass the high-poly one.
MOST_MISSED = 0.2


def box(center, size, bevel=0.0):
    """Box around a center, with chamfered edges: the convex hull of the ends of its faces."""
    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    insets = bevel * (1.0 - np.eye(3))
    ends = np.concatenate([signs * (np.array(size) / 2.0 - inset) for inset in insets])
    points = np.unique(ends, axis=0)
    faces = ConvexHull(points).simplices
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (normals * corners.mean(axis=1)).sum(axis=1) < 0.0
    faces[inward] = faces[inward, ::-1]
    return Mesh(positions=points + center, faces=faces)


def boxes(*places):
    return [box(*place, BEVEL) for place in places], [box(*place) for place in places]


def knob(sides):
    cylinder = make("cylinder", sides=sides, caps=True, height=0.5)
    return moved(cylinder, scale=0.6, by=(0.0, 0.35, 0.0))


def cloth(levels):
    return [icosphere(levels), moved(icosphere(levels), scale=1.01)]


PLATE = ((0.0, 0.0, 0.0), (4.0, 0.4, 4.0))
SCENES = {
    "crates": boxes(((0, 0, 0), (1, 1, 1)), ((1, 0, 0), (1, 1, 1))),
    "bricks": boxes(((0, 0, 0), (2, 1, 1)), ((2, 0, 0), (2, 1, 1)), ((1, 1, 0), (2, 1, 1))),
    "lid": boxes(((0, 0, 0), (2, 1, 2)), ((0, 0.65, 0), (2, 0.3, 2))),
    "screw": ([box(*PLATE, BEVEL), knob(64)], [box(*PLATE), knob(16)]),
    "cloth": (cloth(5), cloth(3)),
}


@pytest.mark.parametrize("name", SCENES)
def test_rays_of_objects_that_touch_hit(name):
    high, low = SCENES[name]
    low = unwrap(join_meshes(low), size=128)
    assert len(set(low.group_objects)) == len(high)
    report = bake(join_meshes(high), low, BakeOptions(size=128)).report
    assert report.miss_percent <= MOST_MISSED


def named(meshes, ending):
    return join_meshes([mesh.replace(name=f"{i}{ending}") for i, mesh in enumerate(meshes)])


@pytest.mark.parametrize("name", SCENES)
def test_objects_whose_names_pair_up_are_each_baked_from_their_match(name):
    high, low = named(SCENES[name][0], "_high"), unwrap(named(SCENES[name][1], "_low"), size=128)
    mixed = np.arange(low.n_faces)[::-1]
    low = low.replace(
        faces=low.faces[mixed], uv_faces=low.uv_faces[mixed], face_groups=low.face_groups[mixed]
    )
    options = BakeOptions(size=128)
    paired = bake_objects(high, low, options)
    assert paired.report.n_objects == len(SCENES[name][0])
    assert paired.report.miss_percent <= MOST_MISSED
    assert np.array_equal(paired.texel_faces, bake(high, low, options).texel_faces)
    assert bake_objects(joined_objects(high), low, options).report.n_objects == 0


@pytest.mark.parametrize(
    ("place", "warning"),
    [(lambda uvs: uvs + 5.0, "1_low covers no texel of the maps"),
     (lambda uvs: uvs * 0.0 + 0.5, "1_low covers no texel of the maps"),
     (lambda uvs: 0.1 + 0.8 * (uvs - uvs.min(0)) / np.ptp(uvs, 0),
      "texels are covered by more than one part")],
    ids=["outside", "point", "overlap"],
)  # fmt: skip
def test_coordinates_of_one_object_that_are_at_fault_are_named(place, warning):
    high, low = named(SCENES["lid"][0], "_high"), unwrap(named(SCENES["lid"][1], "_low"), size=64)
    uvs, lid = low.uvs.copy(), np.unique(low.uv_faces[low.face_groups == 1])
    uvs[lid] = place(uvs[lid])
    report = bake_objects(high, low.replace(uvs=uvs), BakeOptions(size=64)).report
    assert report.n_objects == 2 and len([w for w in report.warnings if warning in w]) == 1


@pytest.mark.parametrize(("name", "join"), [("screw", False), ("lid", True)])
def test_run_keeps_objects_that_touch_apart(tmp_path, name, join):
    high = named(SCENES[name][0], "_high")
    options = RunOptions(
        n_faces=min(high.n_faces * 3 // 4, 2000), size=128, samples=1, compare="off",
        join_objects=join,
    )  # fmt: skip
    result = run(high.replace(name="high.obj"), tmp_path, options)
    low = read_mesh(result.files["mesh"])
    assert result.baked.report.n_objects == (0 if join else len(SCENES[name][0]))
    assert join or result.baked.report.miss_percent <= MOST_MISSED
    assert join or bake_objects(high, low, BakeOptions(size=128)).report.n_objects > 1


def lifted(low):
    """The lid, away from the box."""
    is_lid = np.zeros(low.n_vertices, bool)
    is_lid[low.faces[low.face_groups == 1]] = True
    return low.replace(positions=low.positions + is_lid[:, None] * [0.0, 0.3, 0.0])


SHORT = {"back": 0.001}


@pytest.mark.parametrize(("change", "settings", "cause"), [
    (lambda low: low, {"join_objects": True}, "^join_objects: "),
    (lambda low: low, {"front": 0.001, **SHORT}, "^front, back: "),
    (lambda low: low, {"cage": True, **SHORT}, "the cage is below"),
    (lifted, {}, "far from the high-poly mesh"),
    (lambda low: moved(low, scale=1.3), {"front": 0.001, **SHORT}, "times as large"),
    (lambda low: low.replace(faces=low.faces[:, ::-1], uv_faces=low.uv_faces[:, ::-1]),
     {"orientation": "keep"}, "faces against"),
])  # fmt: skip
def test_a_bake_names_the_cause_of_missed_texels(tmp_path, change, settings, cause):
    high, low = (named(meshes, "") for meshes in SCENES["lid"])
    low = change(unwrap(low, size=128))
    files = [tmp_path / name for name in ("high.obj", "low.obj", "cage.obj")]
    wider = low.replace(positions=low.positions * 1.01, normals=None, normal_faces=None)
    for mesh, path in zip((high, low, wider), files, strict=True):
        write_mesh(mesh, path)
    more = {name: settings[name] for name in settings if name == "join_objects"}
    others = BakeFiles(cage=files[2] if "cage" in settings else None)
    bake_settings = {k: settings[k] for k in settings if k not in ("join_objects", "cage")}
    options = BakeOptions(size=128, **bake_settings)
    done = bake_files(files[0], files[1], tmp_path, options, others, **more)
    assert len([line for line in done.warnings if re.search(cause, line)]) == 1
