"""Reports made by hand: each figure and each warning as a user reads it."""

from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest

from texbake.baking.adaptive_texels.samples import BakeSampling
from texbake.baking.hits import Hits
from texbake.baking.options import BakeOptions
from texbake.baking.parts.low_parts import BakeTarget
from texbake.baking.parts.matching import Match, Matching, PartsOptions
from texbake.baking.parts.result import PartFigures, PartsReport, joined_reports
from texbake.baking.report import BakeReport, DistanceSummary
from texbake.baking.result import BakeResult, check_texels, unseen_faces
from texbake.baking.texture.canvas import PhotoShare, TextureReport
from texbake.baking.texture.options import SolidOptions
from texbake.baking.trace import TraceCounts
from texbake.errors import UvError
from texbake.mesh.shapes import plane
from texbake.progress import StageRecord
from texbake.raycast.orientation import OrientationReport
from texbake.raycast.rays import NO_HIT

STAGES = [StageRecord("cast rays", 1.25, 3_000_000_000), StageRecord("pad", 0.5, 2_000_000_000)]
PLAIN = BakeReport(
    high="a.ply", low="a.obj", cage=None, n_high_faces=123_456, n_low_faces=789,
    options=BakeOptions(size=(64, 32), samples=4), front=0.25, back=0.125, measured=True,
    caster="tile bundles", texels=2048, texels_covered=1500, texels_missed=0,
    texels_overlapping=0.0, faces_without_texel=0, padding_meets=0,
    counts=TraceCounts(rays_cast=6000, rays_past_back_faces=4),
    distance_percentiles={0: 0.0, 1: 0.01, 50: 0.02, 99: 0.03, 100: 0.04}, stages=STAGES,
    versions={},
)  # fmt: skip


def test_a_bake_without_faults_warns_of_nothing():
    assert (PLAIN.warnings, PLAIN.seconds) == ([], 1.75)
    assert PLAIN.table() == [
        ("meshes", "123,456 triangles onto 789"),
        ("size", "64 x 32, 4 samples per texel"),
        ("distances", "front 0.25, back 0.125 (measured)"),
        ("texels covered", "1,500 of 2,048"),
        ("texels missed", "0 (0.000 %)"),
        ("rays", "6,000 cast, 0 missed, 4 past back faces"),
        ("overlap, outside", "0 texels, 0 triangles"),
        ("surface distance", "least 0, median 0.02, greatest 0.04"),
    ]


@pytest.mark.parametrize(("changes", "row"), [
    ({"front": None, "cage": "c.obj", "measured": False},
     ("distances", "front from the cage, back 0.125")),
    ({"counts": TraceCounts(faces_limited=3)},
     ("distances", "front 0.25, back 0.125 (the most allowed, on 3 triangles)")),
    ({"median_reach": (0.5, 0.25)}, ("at each vertex", "median front 0.5, back 0.25")),
    ({"n_objects": 3}, ("objects", "3, each baked from the one with the matching name")),
    ({"texels_missed": 15}, ("texels missed", "15 (1.000 %)")),
    ({"counts": TraceCounts(rays_lengthened=1234)},
     ("longer rays", "1,234, where those of the vertices missed")),
    ({"counts": TraceCounts(rays_to_closest=7), "options": BakeOptions(on_miss="closest")},
     ("closest points", "7 for rays that missed")),
    ({"counts": TraceCounts(secondary_rays=4096)}, ("secondary rays", "4,096")),
    ({"counts": TraceCounts(secondary_rays=64), "options": BakeOptions(maps=("ao", "normal"))},
     ("secondary rays", "64; ao denoised")),
    ({"counts": TraceCounts(secondary_rays=64),
      "options": BakeOptions(maps=("ao",), denoise=False)}, ("secondary rays", "64")),
    ({"texels_overlapping": 2.4, "counts": TraceCounts(faces_outside_tile=1)},
     ("overlap, outside", "2 texels, 1 triangle")),
    ({"distance_percentiles": {}}, ("surface distance", "least 0, median 0, greatest 0")),
    ({"options": BakeOptions(size=8)}, ("size", "8 x 8, 1 sample per texel")),
])  # fmt: skip
def test_a_figure_changes_its_row_and_no_other(changes, row):
    table = replace(PLAIN, **changes).table()
    before = dict(PLAIN.table())
    assert row in table and before.get(row[0]) != row[1]
    others = [label for label, figure in table if before.get(label) != figure and label != row[0]]
    assert set(others) <= {"size", "rays"}


@pytest.mark.parametrize(("changes", "line"), [
    ({"texels_missed": 15}, "the rays of 15 texels (1.00 %) missed the high-poly mesh, and "
     "these texels are left neutral; texbake bake --miss-map shows where"),
    ({"texels_missed": 750}, "the rays of 750 texels (50.00 %) missed the high-poly mesh, and "
     "these texels are left neutral; texbake bake --miss-map shows where"),
    ({"texels_missed": 751}, "the rays of 751 texels (50.07 %) missed the high-poly mesh, and "
     "these texels are left neutral; is the mesh turned inside out, or are the ray distances "
     "too short?"),
    ({"texels_overlapping": 1.2, "counts": TraceCounts(samples_overlapping=5)},
     "texture coordinates overlap on 1 texel; the first face wins"),
    ({"counts": TraceCounts(faces_outside_tile=2)},
     "2 triangles extend beyond the unit square; what lies outside is not baked, "
     "unless {udim} is in `name_pattern`"),
    ({"faces_without_texel": 9, "counts": TraceCounts(faces_without_uv_area=4)},
     "9 of 789 triangles own no texel, 4 of them without area in texture space"),
    ({"padding_meets": 1}, "the padding of two charts meets on 1 texel; use less `padding` or "
     "leave more space between charts"),
    ({"counts": TraceCounts(islands_sharing=2)},
     "stacked islands share texels, and 2 of them show what is baked for others; choose which "
     "to bake with `bake_island`"),
    ({"why_missed": ("far away",)}, "far away"),
    ({"of_objects": ("lid: lost",)}, "lid: lost"),
])  # fmt: skip
def test_each_fault_is_one_warning(changes, line):
    report = replace(PLAIN, **changes)
    assert report.warnings == [line]
    values = report.to_json()
    assert values["warnings"] == [line] and values["size"] == [64, 32]
    assert values["miss_percent"] == pytest.approx(report.texels_missed / 15.0)


@pytest.mark.parametrize("bounds", [[0, 1000], [0, 1, 9, 500, 1000], [0, 333, 334, 1000]])
def test_distances_do_not_depend_on_how_hits_are_divided(bounds):
    rng = np.random.default_rng(3)
    n = 1000
    offsets = rng.normal(size=(n, 3)).astype(np.float32)
    faces = np.where(rng.random(n) < 0.2, NO_HIT, 0).astype(np.int32)
    ids, weights = np.zeros(n, np.int32), np.zeros((n, 2), np.float32)
    hits = Hits(ids, ids, weights, faces, weights, offsets)
    summary = DistanceSummary()
    for start, stop in pairwise(bounds):
        summary.add(hits.where(slice(start, stop)), threads=1)
    lengths = np.linalg.norm(offsets[faces != NO_HIT].astype(float), axis=1)
    wanted = [lengths.min(), *np.percentile(lengths[::8], (1, 5, 50, 95, 99)), lengths.max()]
    found = summary.percentiles()
    assert list(found) == [0, 1, 5, 50, 95, 99, 100]
    np.testing.assert_allclose(list(found.values()), wanted, rtol=1e-12)
    assert DistanceSummary().percentiles() == {}


def test_reports_of_parts_add_up():
    counts = TraceCounts(**{field.name: i for i, field in enumerate(fields(TraceCounts), start=1)})
    first = replace(PLAIN, counts=counts, texels_missed=3, faces_without_texel=2, front=0.5)
    second = replace(PLAIN, counts=counts, low="b.obj", n_high_faces=7, back=0.75, front=None,
                     texels_overlapping=1.5, distance_percentiles={})  # fmt: skip
    third = replace(second, high="b.ply", n_high_faces=10)
    found = joined_reports([first, second, third])
    assert (found.high, found.low) == ("a.ply, b.ply", "a.obj, b.obj")
    assert (found.n_high_faces, found.n_low_faces) == (7 + 10, 3 * 789)
    assert (found.front, found.back) == (0.5, 0.75)
    assert joined_reports([second]).front is None
    assert (found.texels_covered, found.texels_missed) == (4500, 3)
    assert (found.texels_overlapping, found.faces_without_texel) == (3.0, 2)
    assert list(vars(found.counts).values()) == [3 * i for i in vars(counts).values()]
    assert found.distance_percentiles == {}
    adaptive = replace(PLAIN, sampling=BakeSampling(
        max_error="1deg", sample_percents={1: 100.0}, within_percent=100.0, n_checked=1,
        samples_of_check=13, errors=(), rays_per_texel=1.0, rays_of_check=13,
    ))  # fmt: skip
    assert joined_reports([adaptive]).sampling is adaptive.sampling
    assert joined_reports([adaptive, adaptive]).sampling is None
    assert ("samples per texel", "1: 100.0 %; 1.00 rays per texel") in adaptive.table()
    assert ("size", "64 x 32, adaptive samples") in adaptive.table()


MATCHING = Matching(
    ("a_high", "b_high", "c_high", "x_ignore"), ("a_low", "d_low", "y_ignore"),
    (Match("a", 0, (0, 1)),), (2,), (1,), (3,), (2,),
)  # fmt: skip


def test_parts_are_listed_with_what_is_left_over():
    assert MATCHING.table() == [
        ("a_low", "from a_high, b_high"),
        ("d_low", "low-poly part without a high-poly part: not baked"),
        ("c_high", "high-poly part without a low-poly part: not used"),
        ("y_ignore", "low-poly part, ignored"),
        ("x_ignore", "high-poly part, ignored"),
    ]
    assert MATCHING.warnings == [
        "d_low: no high-poly part of that name, so not baked",
        "c_high: no low-poly part of that name, so not used",
    ]
    many = replace(MATCHING, low_names=tuple("abcdefg"), low_left=tuple(range(7)), high_left=())
    assert many.warnings == [
        "a, b, c, d, e and 2 more: no high-poly part of that name, so not baked"
    ]


def test_the_report_of_parts_names_each_on_each_set():
    ones = [BakeTarget("skin", 1001), BakeTarget("", 1002)]
    parts = [
        PartFigures(ones[0], "a_low", ("a_high", "b_high"), 12, 1000, 5, 0.1, 0.2),
        PartFigures(ones[1], "d_low", ("d_high",), 1, 0, 0, None, 0.2),
    ]
    missed = replace(PLAIN, texels_missed=15)
    report = PartsReport(
        PartsOptions(), MATCHING, parts, {ones[0]: PLAIN, ones[1]: missed}, n_crossing=1,
        n_outside=2, n_overlapping=1000, without_texel=("e covers no texel of skin 1001",),
        orientations={"a": OrientationReport(mesh="a")}, stages=STAGES,
    )  # fmt: skip
    assert report.is_paired
    assert not replace(report, options=PartsOptions(match_by_name=True)).is_paired
    assert not replace(report, matching=None).is_paired
    assert report.table() == [
        ("parts", "2 objects, each baked from the one with the matching name"),
        ("  a_low", "from a_high, b_high on skin 1001: 12 triangles, 1,000 texels, 0.500 % missed"),
        ("  d_low", "from d_high on 1002: 1 triangle, 0 texels, 0.000 % missed"),
        ("sets of maps", "skin 1001, 1002"),
    ]
    alone = replace(report, matching=None, targets={ones[0]: PLAIN})
    assert alone.table()[0] == ("parts", "") and ("sets of maps", "1") in alone.table()
    assert report.warnings == [
        *MATCHING.warnings,
        "1 triangle crosses borders of tiles; each tile gets its share",
        "2 triangles lie in no tile and are not baked",
        "1,000 texels are covered by more than one part; the first part with a hit is used",
        "e covers no texel of skin 1001; use a larger `size` or new coordinates",
        f"1002: {missed.warnings[0]}",
    ]
    assert replace(alone, targets={ones[1]: missed}).warnings[-1] == missed.warnings[0]
    values = report.to_json()
    assert values["parts"][0]["target"] == {"texture_set": "skin", "udim": 1001}
    assert [target["texels_missed"] for target in values["targets"]] == [0, 15]
    figures = ("faces_crossing_tiles", "faces_in_no_tile", "texels_of_several_parts")
    assert [values[name] for name in figures] == [1, 2, 1000]
    assert values["matching"]["matches"] == [
        {"base": "a", "low": "a_low", "high": ["a_high", "b_high"]}
    ]


def test_the_report_of_a_texture_is_read_as_that_of_maps():
    report = TextureReport(
        mesh="a.obj", n_faces=1, options=SolidOptions(size=(64, 32), samples=4), source="marble",
        scale=(2.0, 2.0, 2.0), texels=2048, texels_covered=1000, texels_unseen=0,
        texels_overlapping=0.0, faces_outside_tile=0, padding_meets=0, photos=(),
        stages=tuple(STAGES),
    )  # fmt: skip
    assert report.warnings == []
    assert report.table() == [
        ("texture", "marble onto 1 face"),
        ("size", "64 x 32, 4 samples"),
        ("scale", "2"),
        ("texels covered", "1,000 of 2,048"),
        ("texels unseen", "0 (0.00 %)"),
    ]
    photos = (PhotoShare("a.jpg", 12, 75.0), PhotoShare("b.jpg", 0, 0.0))
    other = replace(
        report, scale=(1.0, 2.0, 3.0), texels_unseen=250, texels_overlapping=3.0,
        faces_outside_tile=1, padding_meets=2, photos=photos,
        options=replace(report.options, fill="none"),
    )  # fmt: skip
    table = dict(other.table())
    assert table["scale"] == "1,2,3" and table["texels unseen"] == "250 (25.00 %)"
    assert table["  a.jpg"] == "12 texels, 75.0 % of the color"
    assert "scale" not in dict(replace(report, scale=None).table())
    assert other.warnings == [
        "no photograph shows 250 texels (25.00 %), left black; see them with `unseen_map`",
        "texture coordinates overlap on 3 texels; the first face wins",
        "1 face extends outside the unit square; the parts outside are not baked",
        "the padding of two charts meets on 2 texels; use less `padding` or leave more room "
        "between charts",
        "b.jpg: it shows no texel; check its camera",
    ]
    filled = replace(report, texels_unseen=1)
    assert "filled from the colors around them;" in filled.warnings[0]
    assert other.to_json()["unseen_percent"] == 25.0 and other.to_json()["seconds"] == 1.75


@pytest.mark.parametrize("seed", range(4))
def test_faces_that_own_no_texel_are_those_that_no_texel_names(seed):
    n = 12
    texels = np.random.default_rng(seed).integers(-1, n, (2, 3 + seed)).astype(np.int32)
    wanted = ~np.isin(np.arange(n), texels)
    np.testing.assert_array_equal(unseen_faces(n, texels), wanted)
    assert unseen_faces(n, np.full((2, 2), -1, np.int32)).all()


@pytest.mark.parametrize(("padding", "remedy"), [(1, "larger `size`$"), (2, "or less `padding`$")])
def test_faces_without_a_texel_are_an_error_beyond_a_hundredth_of_the_area(padding, remedy):
    low = plane(16, 8).replace(name="low.obj")
    report = replace(PLAIN, options=BakeOptions(size=(64, 32), padding=padding))
    for n_unseen in (0, 2, 3, 256):
        seen = np.arange(n_unseen, 256, dtype=np.int32) if n_unseen < 256 else np.int32(-1)
        texels = np.resize(seen, (16, 16))
        baked = BakeResult({}, report, None, texels, texels >= 0)
        if n_unseen <= 2:
            check_texels(low, baked)
        else:
            share = f"low.obj: {n_unseen} of 256 faces, {n_unseen / 2.56:.1f} % of the area"
            words = f"^{share}, own no texel at 64 x 32 .* {padding}; .*{remedy}"
            with pytest.raises(UvError, match=words):
                check_texels(low, baked)
