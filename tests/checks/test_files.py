"""Files that hold no mesh, and the real ones."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from texbake.checks.check import check, check_files
from texbake.errors import FileError
from texbake.mesh.files import read_mesh

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\n"


@pytest.fixture
def files(tmp_path: Path) -> Path:
    (tmp_path / "good.obj").write_text(TRIANGLE + "f 1//1 2//1 3//1\n")
    (tmp_path / "nan.obj").write_text(TRIANGLE.replace("v 1 0 0", "v 1 nan 0") + "f 1 2 3\n")
    (tmp_path / "index.obj").write_text(TRIANGLE + "f 1 2 4\n")
    (tmp_path / "empty.obj").write_text("")
    (tmp_path / "noise.glb").write_bytes(bytes(range(256)))
    return tmp_path


@pytest.mark.parametrize("name", ["nan.obj", "index.obj", "empty.obj", "noise.glb"])
def test_what_is_no_mesh_is_a_finding(files: Path, name: str) -> None:
    report = check_files(files / name)
    (finding,) = report.findings
    assert (finding.name, finding.severity, finding.count) == ("unreadable", "error", 1)
    assert name in finding.problem
    assert "\n" not in finding.problem


def test_the_other_mesh_is_checked_all_the_same(files: Path) -> None:
    report = check_files(files / "good.obj", files / "nan.obj")
    assert [f.name for f in report.findings] == ["unreadable"]
    assert report.findings[0].mesh == "low"
    assert report.high is not None
    report = check_files(files / "nan.obj", files / "good.obj")
    assert {f.name for f in report.findings} == {"unreadable", "no-coordinates"}


def test_one_mesh_without_coordinates_is_a_high_poly_one(files: Path) -> None:
    report = check_files(files / "good.obj")
    assert report.low is None
    assert report.high is not None
    assert report.findings == ()


def test_a_missing_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="no such file"):
        check_files(tmp_path / "none.obj")


# Counted with dictionaries over the files' own indices, k-d trees and trimesh's volumes.
BROKEN = {
    "broken/VH_M_Blood_Vasculature_Heart.glb": {
        "zero-area-faces": 24, "duplicate-faces": 14, "non-manifold-edges": 14,
        "pinched-vertices": 13, "cracks": 75, "zero-normals": 33,
    },
    "broken/VH_M_Heart.glb": {
        "zero-area-faces": 820, "duplicate-faces": 110, "non-manifold-edges": 136,
        "inconsistent-winding": 8, "pinched-vertices": 2, "cracks": 65, "zero-normals": 42,
    },
    "broken/cycloidal.ply": {"non-manifold-edges": 242, "pinched-vertices": 26},
    "broken/inverted_triangles.obj": {"inconsistent-winding": 23889},
    "broken/openscad-nonmanifold-crash.obj": {
        "zero-area-faces": 1, "duplicate-faces": 3, "non-manifold-edges": 18,
        "pinched-vertices": 34,
    },
    "broken/self_intersectA.obj": {},
    "meshes/featuretype.STL": {"cracks": 576},
}  # fmt: skip
COUNTED = sorted({name for counts in BROKEN.values() for name in counts})


@pytest.mark.realdata
@pytest.mark.parametrize("name", sorted(BROKEN))
def test_counts_of_real_broken_meshes(data_dir: Path, name: str) -> None:
    found = Counter({f.name: f.count for f in check_files(data_dir / name).findings})
    assert {kind: found[kind] for kind in COUNTED} == {
        kind: BROKEN[name].get(kind, 0) for kind in COUNTED
    }


@pytest.mark.realdata
@pytest.mark.parametrize(
    "name", ["broken/self_intersectA.obj", "broken/cycloidal.ply", "pairs/skull/low_uv.obj"]
)
def test_faces_through_one_another_are_those_that_meshlab_finds(data_dir: Path, name: str) -> None:
    import pymeshlab

    mesh = read_mesh(data_dir / name)
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(mesh.positions, mesh.faces))
    meshes.apply_filter("compute_selection_by_self_intersections_per_face")
    theirs = set(np.flatnonzero(meshes.current_mesh().face_selection_array()).tolist())
    finding = check(mesh.replace(uvs=None, uv_faces=None)).finding("self-intersections")
    ours = set() if finding is None else set(finding.faces.tolist())
    assert ours <= theirs
    # It counts those that touch by less than a millionth of the size as well.
    assert len(ours) >= 0.97 * len(theirs)


@pytest.mark.realdata
@pytest.mark.parametrize("name", ["koala", "skull", "spot", "penguin"])
def test_real_pairs_fit_together(data_dir: Path, name: str) -> None:
    folder = data_dir / "pairs" / name
    report = check_files(folder / "high.obj", folder / "low_uv.obj")
    assert not report.fails("error")
    assert not any(finding.name.startswith(("differing", "far")) for finding in report.findings)


@pytest.mark.realdata
def test_meshes_of_different_pairs_do_not(data_dir: Path) -> None:
    report = check_files(data_dir / "pairs/penguin/high.obj", data_dir / "pairs/skull/low_uv.obj")
    assert report.finding("differing-scale") is not None
