"""Each fault is found exactly as often as it is there, where it is, and nothing else with it."""

import json
import re
from collections import Counter, defaultdict

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as hnp

from tests.models import PAIRS, model, pair, real
from texbake.checks.bake_kinds import SEVERITIES
from texbake.checks.check import check, check_files
from texbake.checks.kinds import KINDS, CheckOptions
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import with_flat_normals
from texbake.mesh.shapes import icosphere, plane, uv_sphere


def counts(report):
    return {finding.name: finding.count for finding in report.findings}


def test_a_fault_is_found_as_often_as_it_is_there_and_no_other(faulty):
    name, case = faulty
    report = check(case.mesh, case.low, case.options)
    assert counts(report) == {name: case.count}
    (finding,) = report.findings
    assert set(finding.faces.tolist()) == case.faces
    assert len(finding.faces) == len(case.faces)
    of_kind = KINDS[name].severity
    assert finding.severity == (
        KINDS[name].in_high or of_kind if finding.mesh == "high" else of_kind
    )
    assert not re.search(r"{|\b(inf|nan)\b", finding.problem + finding.remedy)


def test_clean_meshes_have_nothing(clean):
    report = check(*clean, CheckOptions(size=128))
    assert report.findings == ()
    assert not report.fails("note")


def plain_counts(faces):
    """Topology counted with dictionaries, one face after the other."""
    seen, kept, n_duplicates = set(), [], 0
    for face in faces:
        if len(set(face)) < 3:
            continue
        n_duplicates += frozenset(face) in seen
        if frozenset(face) not in seen:
            kept.append(face)
        seen.add(frozenset(face))
    walks = Counter((f[k], f[(k + 1) % 3]) for f in kept for k in range(3))
    edges = Counter(tuple(sorted(walk)) for walk in walks.elements())
    n_pinched = 0
    for vertex in {v for face in kept for v in face}:
        groups = []  # of the other corners, joined by faces
        for face in kept:
            if vertex in face:
                merged = set(face) - {vertex}
                for group in [g for g in groups if g & merged]:
                    groups.remove(group)
                    merged |= group
                groups.append(merged)
        n_pinched += len(groups) > 1
    return {
        "duplicate-faces": n_duplicates,
        "non-manifold-edges": sum(n > 2 for n in edges.values()),
        "inconsistent-winding": sum(n == 2 and walks[e] != 1 for e, n in edges.items()),
        "pinched-vertices": n_pinched,
        "zero-area-faces": sum(len(set(face)) < 3 for face in faces) if kept else 0,
        "no-surface": not kept,
    }


@settings(max_examples=100)
@given(hnp.arrays(np.int32, st.tuples(st.integers(1, 30), st.just(3)), elements=st.integers(0, 8)))
def test_topology_of_soups_against_counting_one_by_one(faces):
    # On a parabola in space no three points lie on one line.
    t = np.arange(9.0)
    mesh = Mesh(positions=np.stack([t, t**2, t**3], axis=1), faces=faces)
    found = defaultdict(int, counts(check(mesh)))
    expected = plain_counts([tuple(face) for face in faces.tolist()])
    assert {name: found[name] for name in expected} == expected


@settings(max_examples=30)
@given(st.sets(st.integers(0, 79), min_size=1, max_size=25))
def test_the_faces_turned_over_are_named(turned):
    faces = icosphere(1).faces.copy()
    faces[list(turned)] = faces[list(turned)][:, ::-1]
    found = check(icosphere(1).replace(faces=faces)).finding("inconsistent-winding")
    assert set(found.faces.tolist()) == turned


def test_a_mobius_strip_is_torn_somewhere():
    n = 8
    quads = [(2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1) for i in range(n - 1)]
    quads.append((2 * n - 2, 1, 0, 2 * n - 1))  # the ends joined with half a turn
    angle = np.repeat(np.arange(n), 2) * 2.0 * np.pi / n
    side = np.tile([-0.3, 0.3], n)
    radius = 1.0 + side * np.cos(angle / 2)
    positions = np.stack(
        [radius * np.cos(angle), radius * np.sin(angle), side * np.sin(angle / 2)], axis=1
    )
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    found = check(Mesh(positions=positions, faces=faces)).finding("inconsistent-winding")
    assert found.count == 1
    assert len(found.faces) > 0


def test_a_shell_inside_out_within_another():
    """The wall of a hollow is none, but the wall of a hollow in a hollow flipped is."""
    sphere = icosphere(1)
    shells = [sphere.faces, sphere.faces[:, ::-1] + 42, sphere.faces[:, ::-1] + 84]
    sizes = np.repeat([4.0, 3.0, 2.0], 42)[:, None]
    positions = np.tile(sphere.positions, (3, 1)) * sizes
    mesh = Mesh(positions=positions, faces=np.concatenate(shells))
    found = check(mesh).finding("inside-out-shells")
    assert found.count == 1
    assert set(found.faces.tolist()) == set(range(160, 240))
    # A vertex without faces may lie anywhere, and so may the whole mesh.
    mesh = mesh.replace(positions=np.append(positions, [[1e30, 0.0, 0.0]], axis=0))
    for other in mesh, mesh.replace(positions=positions + 1e5):
        again = check(other).finding("inside-out-shells")
        assert sorted(again.faces) == sorted(found.faces)


def test_threads_change_nothing():
    mesh = uv_sphere(40, 40)
    one, three = (
        check(mesh.replace(name="low"), mesh, CheckOptions(threads=n)).to_json() for n in (1, 3)
    )
    assert one["findings"] == three["findings"]


@pytest.mark.parametrize("size", [1e-310, 1e-150, 1e-12, 1e12, 1e150, 1e300])
@pytest.mark.parametrize("offset", [0.0, 1e7])
def test_any_size_and_place(size, offset):
    """Nothing overflows, and what is found is what is there."""
    sphere = uv_sphere(8, 8)
    mesh = sphere.replace(positions=(sphere.positions + offset) * size)
    computable = 1e-75 < size < 1e75
    expected = {"extreme-size" if computable else "unmeasurable-size", "no-normals"}
    expected |= {"far-from-origin"} if offset else set()
    assert set(counts(check(mesh, mesh))) == expected


def test_the_worst_come_first(case_of):
    heights = np.array([0.0, 0.2, 0.9, 0.4, 0.1])
    mesh = plane(5, 1)
    uvs = mesh.uvs.copy()
    uvs[:, 1] += 1.0 + np.append(heights, 0.0)[np.arange(12) % 6]
    found = check(with_flat_normals(mesh).replace(uvs=uvs)).finding("outside-tile")
    farthest = np.abs(uvs[mesh.uv_faces][found.faces] - 0.5).max(axis=(1, 2))
    assert (np.diff(farthest) <= 0.0).all()
    assert found.worst_faces == found.faces[:10].tolist()


def test_report_says_when_a_build_fails(case_of):
    def fails(name):
        case = case_of(name)
        report = check(case.mesh, case.low, case.options)
        return [report.fails(severity) for severity in SEVERITIES]

    assert fails("overlapping-coordinates") == [True, True, True]
    assert fails("thin-charts") == [False, True, True]
    assert fails("unused-vertices") == [False, False, True]


def test_report_as_json(case_of):
    case = case_of("far-from-high")
    written = json.loads(json.dumps(check(case.mesh, case.low, case.options).to_json()))
    assert (written["n_errors"], written["n_warnings"], written["n_notes"]) == (0, 1, 0)
    (finding,) = written["findings"]
    assert (finding["name"], finding["mesh"]) == ("far-from-high", "low")
    assert sorted(finding["worst_faces"]) == [6, 7]
    assert "2" in finding["problem"]  # model units that the farthest lies away
    assert written["options"]["size"] == 128


def test_a_texel_density_asked_for():
    sheet = plane(2, 2)  # 128 texels a unit
    assert "low-texel-density" in counts(
        check(sheet, options=CheckOptions(size=128, min_texel_density=129.0))
    )
    enough = check(sheet, options=CheckOptions(size=128, min_texel_density=127.0))
    assert "low-texel-density" not in counts(enough)


@pytest.mark.parametrize(("turn", "words"), [
    ([[1, 0, 0], [0, 0, -1], [0, 1, 0]], "y becomes z and z becomes -y"),
    ([[-1, 0, 0], [0, 1, 0], [0, 0, -1]], "x becomes -x and z becomes -z"),
])  # fmt: skip
@pytest.mark.parametrize("moved", [0.0, 0.3])
def test_turned_axes_are_named_where_the_boxes_do_not_tell(turn, words, moved):
    """A cube that narrows to a ridge beside its middle keeps its box, however it is turned."""
    ball = icosphere(3)
    x, y, z = (np.sign(ball.positions) * np.abs(ball.positions) ** 0.3).T
    width = 0.6 + 0.4 * y
    low = ball.replace(positions=np.column_stack([x * width + 0.8 * (1 - width), y, z * width]))
    high = low.replace(positions=low.positions @ np.array(turn).T + moved)
    found = {item.name: item for item in check(high, low).findings}
    assert "differing-place" not in found
    assert words in found["differing-axes"].problem


def test_the_ends_of_a_short_open_edge_are_no_crack():
    points = [[0, 0, 0], [1e-8, 0, 0], [0, 1, 0], [1, 0, 0], [-1, 0, 0]]
    fan = Mesh(positions=points, faces=[[0, 1, 2], [1, 3, 2], [4, 0, 2]])
    assert "cracks" not in counts(check(fan))


TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\n"


@pytest.fixture
def files(tmp_path):
    (tmp_path / "good.obj").write_text(TRIANGLE + "f 1//1 2//1 3//1\n")
    (tmp_path / "nan.obj").write_text(TRIANGLE.replace("v 1 0 0", "v 1 nan 0") + "f 1 2 3\n")
    (tmp_path / "index.obj").write_text(TRIANGLE + "f 1 2 4\n")
    (tmp_path / "empty.obj").write_text("")
    (tmp_path / "noise.glb").write_bytes(bytes(range(256)))
    return tmp_path


@pytest.mark.parametrize("name", ["nan.obj", "index.obj", "empty.obj", "noise.glb"])
def test_a_file_that_is_not_a_mesh_is_a_finding(files, name):
    report = check_files(files / name)
    (finding,) = report.findings
    assert (finding.name, finding.severity, finding.count) == ("unreadable", "error", 1)
    assert name in finding.problem
    assert "\n" not in finding.problem


def test_the_other_mesh_is_checked_all_the_same(files):
    report = check_files(files / "good.obj", files / "nan.obj")
    assert [f.name for f in report.findings] == ["unreadable"]
    assert report.findings[0].mesh == "low"
    report = check_files(files / "nan.obj", files / "good.obj")
    assert {f.name for f in report.findings} == {"unreadable", "no-coordinates"}


def test_one_mesh_without_coordinates_is_a_high_poly_one(files):
    report = check_files(files / "good.obj")
    assert report.low is None
    assert report.findings == ()


# Counted for each object with dictionaries over the file's indices, k-d trees, trimesh's volumes.


@pytest.mark.parametrize(
    "name", ["crossing figures", *real("broken/self_intersectA.obj", "broken/cycloidal.ply")]
)
def test_intersecting_faces_are_those_that_meshlab_finds(name):
    import pymeshlab

    mesh = model(name)
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(mesh.positions, mesh.faces))
    meshes.apply_filter("compute_selection_by_self_intersections_per_face")
    theirs = set(np.flatnonzero(meshes.current_mesh().face_selection_array()).tolist())
    finding = check(mesh.replace(uvs=None, uv_faces=None)).finding("self-intersections")
    ours = set() if finding is None else set(finding.faces.tolist())
    assert ours <= theirs
    # It counts those that touch by less than a millionth of the size as well.
    assert len(ours) >= 0.97 * len(theirs) > 0


@pytest.mark.parametrize("name", PAIRS)
def test_pairs_fit_together(name):
    report = check(*pair(name))
    assert not report.fails("error")
    assert not any(finding.name.startswith(("differing", "far")) for finding in report.findings)


def test_a_vertex_that_no_face_uses_may_lie_anywhere():
    mesh = plane()
    tiny = mesh.positions * 2.0**-900
    report = check(Mesh(positions=np.vstack([tiny, [1e300, 0.0, 0.0]]), faces=mesh.faces))
    assert counts(report)["unused-vertices"] == 1


@pytest.mark.parametrize(("n", "size"), [(60, 64), (95, 128), (250, 256)])
def test_the_size_that_is_named_is_the_least_that_shows_the_detail(n, size):
    """2 n² faces on a whole texture: at most four a texel from n / √2 texels on."""
    high, low = plane(n, n), plane(2, 2)
    found = check(high, low, CheckOptions(size=32)).finding("detail-below-texels")
    assert f"{2 * n * n / 32**2:.1f} high-poly faces per texel" in found.problem
    assert f"Bake {size} x {size} texels" in found.remedy
    for width, is_there in ((size // 2, True), (size, False)):
        again = check(high, low, CheckOptions(size=width)).finding("detail-below-texels")
        assert (again is not None) == is_there
