"""The checks and the study on the whole catalog: both accept every mesh and report its faults."""

import json

import numpy as np
import pytest
from table import PAGE, document

import texbake
from texbake.errors import MeshError
from texbake.study.options import StudyOptions
from texbake.study.study import run_study

# What the checks must report, at least, for the case of this name.
SAID = {
    "zero-area faces": "zero-area-faces",
    "split vertices": "duplicate-vertices",
    "duplicate faces": "duplicate-faces",
    "duplicate faces turned": "duplicate-faces",
    "edge of five faces": "non-manifold-edges",
    "bow-tie vertex": "pinched-vertices",
    "inside out": "inside-out-shells",
    "every third face turned": "inconsistent-winding",
    "faces through one another": "self-intersections",
    "sheets that cross along edges": "non-manifold-edges",
    "unused vertex far away": "unused-vertices",
    "scale 1e-12": "extreme-size",
    "scale 1e12": "extreme-size",
    "offset 1e7 sizes": "far-from-origin",
    "Möbius strip": "inconsistent-winding",
    "vertices one step apart": "zero-area-faces",
    "zero and opposite normals": "zero-normals",
    "points on one line": "no-surface",
    "one index thrice": "no-surface",
    "zero-area coordinates": "collapsed-coordinates",
    "coordinates of area down to 1e-24": "faces-without-texel",
    "needle thinner than a texel": "thin-charts",
    "mirrored coordinates": "mirrored-coordinates",
    "coordinates three deep": "stacked-coordinates",
    "coordinates outside the tile": "outside-tile",
    "coordinates of 1e9": "outside-tile",
    "coordinates of 1e200": "outside-tile",
    "coordinates on a line": "nothing-covered",
    "all coordinates equal": "nothing-covered",
    "chart smaller than a texel": "nothing-covered",
}


def test_every_mesh_is_checked_and_its_fault_named(mesh_case):
    mesh = mesh_case.make()
    report = texbake.check(mesh, options=texbake.CheckOptions(size=32, threads=1))
    names = {finding.name for finding in report.findings}
    expected = SAID.get(mesh_case.name)
    assert expected is None or expected in names
    for finding in report.findings:
        assert finding.count >= 1 and np.isin(finding.faces, np.arange(mesh.n_faces)).all()
        assert len(np.unique(finding.faces)) == len(finding.faces)
        assert "nan" not in finding.problem and "{" not in finding.problem
    json.dumps(report.to_json(), allow_nan=False)
    if "solid" in mesh_case.traits:
        assert not names & {"inside-out-shells", "inconsistent-winding", "self-intersections"}
    if report.has_layout:
        picture = report.picture(48)
        assert np.isfinite(picture).all() and picture.min() >= 0.0 and picture.max() <= 1.0


def test_every_mesh_is_checked_against_itself(mesh_case, in_cells):
    mesh = in_cells(mesh_case)
    report = texbake.check(mesh, mesh, texbake.CheckOptions(size=32, threads=1))
    names = {finding.name for finding in report.findings}
    assert not names & {"differing-scale", "differing-place", "differing-axes", "opposite-sides"}
    assert not names & {"far-from-high", "far-from-low", "other-parts"}


def test_a_mesh_that_does_not_show_is_one_clear_error(case_named, in_cells):
    """A strip of 1 by 1e6 falls between the pixels, so that no picture of it has an error."""
    mesh = in_cells(case_named("strip of 1 by 1e6"))
    options = StudyOptions(knobs=("ray-direction",), quick=True, repeats=1, seconds=0.0, threads=1)
    with pytest.raises(MeshError, match=r"nothing of .* shows"):
        run_study(mesh, mesh, options=options)


def test_the_page_lists_every_case():
    assert PAGE.read_text(encoding="utf-8") == document(), "run: python tests/hard_cases/table.py"
