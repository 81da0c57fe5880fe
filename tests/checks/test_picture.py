"""Pictures show the faces of a finding, where they are, and no others."""

import numpy as np
import pytest

from texbake.checks.check import check
from texbake.checks.picture import COLORS
from texbake.errors import OptionError, UvError
from texbake.jobs.side_pictures import render_findings
from texbake.mapping.layout import linear


def share_of(picture, severity):
    """(H, W) bool: pixels of the color of a severity."""
    return np.abs(picture - linear(COLORS[severity])).max(axis=2) < 1e-6


def test_faces_are_colored_where_they_lie(case_of):
    case = case_of("mirrored-coordinates")  # one of two squares of 0.2 x 0.2
    picture = check(case.mesh, options=case.options).picture(500)
    rows, columns = np.nonzero(share_of(picture, "warning"))
    caption, gap = len(picture) - 500 - 2 * (500 // 40), 500 // 40
    # u from 0.6 to 0.8, v from 0.1 to 0.3; the caption has the same color.
    below = rows >= gap + caption
    assert (rows[below].min() - gap - caption, rows[below].max() - gap - caption) == (350, 449)
    assert (columns[below].min() - gap, columns[below].max() - gap) == (300, 399)
    # All but what the two rings cover.
    assert 0.95 * 100 * 100 < below.sum() <= 100 * 100


def test_a_face_too_small_to_be_seen_gets_a_dot(case_of):
    case = case_of("faces-without-texel")
    picture = check(case.mesh, options=case.options).picture(200)
    assert share_of(picture[40:], "note").sum() >= 9


def test_nothing_found_is_a_layout_alone(clean):
    report = check(*clean)
    if report.low is None:
        with pytest.raises(UvError, match="no low-poly mesh"):
            report.picture()
    else:
        assert not share_of(report.picture(64), "error").any()


def test_sides_show_the_faces_in_space(case_of):
    case = case_of("inconsistent-winding")
    picture = render_findings(check(case.mesh, options=case.options))
    # One face of twenty is red, and it is seen from some side.
    red = (picture[..., 0] > 3.0 * picture[..., 1]) & (picture[..., 0] > 0.05)
    assert 100 < red.sum() < 0.1 * red.size


def test_nothing_to_see_from_any_side(case_of):
    with pytest.raises(OptionError, match="nothing to draw"):
        render_findings(check(case_of("no-normals").mesh))
