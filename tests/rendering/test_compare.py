import math
from dataclasses import replace

import numpy as np
import pytest
from skimage.metrics import structural_similarity

from tests.models import PAIRS, pair
from texbake import BakeOptions, RenderOptions, bake, compare, write_image
from texbake.core import core, portable_math as pm
from texbake.mesh.materials import UNPLACED, ChannelImage, ChannelSource, Materials, MeshMaterial
from texbake.mesh.normals import with_flat_normals
from texbake.mesh.shapes import icosphere, plane, uv_sphere
from texbake.rendering.closeness import structural_similarities
from texbake.rendering.compare import compare_shapes
from texbake.rendering.draw import draw
from texbake.rendering.panels import MAX_ANGLE_DEG, color_angles

SMALL = RenderOptions(width=120, height=90)
FRONT = RenderOptions(width=100, height=100, view=(0.0, 0.0))


@pytest.mark.parametrize("shape", [(70, 90, 3), (9, 8, 3), (4, 5, 1)])
@pytest.mark.parametrize("window", [3, 5, 7])
def test_the_similarity_is_that_of_scikit_image(shape, window):
    window = min(window, shape[0] - 1 + shape[0] % 2)
    random = np.random.default_rng(1)
    first = random.random(shape, np.float32)
    second = np.clip(first + random.normal(0.0, 0.1, shape), 0.0, 1.0).astype(np.float32)
    _, expected = structural_similarity(
        first, second, data_range=1.0, channel_axis=2, full=True, win_size=window
    )
    found = structural_similarities(first, second, window)
    assert found.dtype == np.float32 and np.abs(found - expected).max() < 1e-6


def test_angles_are_those_of_vectors_of_any_length():
    random = np.random.default_rng(2)
    shape = (40, 30, 3)
    first = random.normal(size=shape)
    # Columns: from equal vectors to independent ones, then opposite ones, and none at all.
    second = first + 10.0 ** np.linspace(-30.0, 0.0, 30)[:, None] * random.normal(size=shape)
    second[:, 25:27] = -first[:, 25:27]
    second[:, 28:] = 0.0
    first, second = (
        np.float32(v / np.maximum(np.linalg.norm(v, axis=2, keepdims=True), 1e-9))
        for v in (first, second)
    )
    first[:, 29] = 0.0
    depths, covered = np.ones(shape[:2], np.float32), np.ones(shape[:2], np.float32)
    angles, counts = np.empty(shape[:2], np.float32), np.empty((len(first), 2), np.int64)
    core.measure_angles(
        first, second, depths, depths, covered, covered, 0.0, angles, counts, 0, len(first)
    )
    one, other = first.astype(np.float64), second.astype(np.float64)
    chords = [pm.norm(v, axis=2) for v in (one - other, one + other)]
    np.testing.assert_array_equal(angles, np.float32(np.degrees(2.0 * pm.arctan2(*chords))))
    assert (angles[:, 0] == 0.0).all() and (angles[:, 25:27] == 180.0).all()
    assert (counts == shape[1]).all()


def test_several_surfaces_are_compared_at_once():
    high, low = icosphere(4), icosphere(1)
    found = compare_shapes(high, [high, low, icosphere(2)], SMALL)
    bare = compare(high, with_flat_normals(low), options=SMALL).bare
    assert found[1] == pytest.approx(
        (bare.mean_deg, bare.outline_mismatch + bare.depth_mismatch), rel=1e-3
    )
    assert found[0][1] == 0.0
    for least, more in ((found[0], found[2]), (found[2], found[1])):
        assert least[0] < more[0] and least[1] < more[1]


@pytest.mark.parametrize("angle", [0.5, 10.0, 60.0])
def test_a_tilted_normal_map_is_off_by_its_tilt(angle):
    tilt = math.radians(angle)
    normal_map = np.full((2, 2, 3), (math.sin(tilt), 0, math.cos(tilt)), np.float32)
    comparison = compare(
        plane(), plane(), normal_map=normal_map, options=FRONT, views=[(0, 0), (20, 30)]
    )
    mapped = comparison.mapped
    # float32 normals: 6e-8 of an angle in radians.
    for figure in mapped.mean_deg, mapped.median_deg, mapped.p95_deg:
        assert figure == pytest.approx(angle, abs=1e-5)
    assert comparison.bare.mean_deg == 0.0
    assert mapped.psnr_db < 60 and mapped.ssim < 1
    seen = np.isfinite(comparison.angles_deg)
    np.testing.assert_array_equal(seen, comparison.high_frame.coverage > 0)
    np.testing.assert_allclose(comparison.angles_deg[seen], angle, atol=1e-5)


# Columns: an image as it is; turned by a quarter, moved and smaller.
@pytest.mark.parametrize(
    "placing", [UNPLACED, ((0.0, -0.5, 0.7), (0.5, 0.0, 0.2))], ids=["plain", "turned"]
)
def test_the_high_poly_mesh_has_its_own_normal_maps(tmp_path, placing):
    rng = np.random.default_rng(4)
    normals = rng.normal((0, 0, 1), (0.2, 0.2, 0), (8, 8, 3))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    write_image(0.5 + 0.5 * normals, tmp_path / "n.png", bits=8)
    image = ChannelImage(data=(tmp_path / "n.png").read_bytes(), placing=placing)
    source = ChannelSource((1.0, 1.0, 1.0), image)
    materials = Materials(
        face_materials=np.zeros(2, np.int32),
        materials=(MeshMaterial(name="bumpy", channels={"normal": source}),),
    )
    baked = bake(plane(), plane(), BakeOptions(size=512, padding=8), materials=materials)
    comparison = compare(
        plane(), plane(), normal_map=baked.maps["normal"].values, high_materials=materials,
        options=FRONT, views=[(0, 0)],
    )  # fmt: skip
    assert comparison.bare.median_deg > 5.0
    # Codes of 8 bits are half a degree apart.
    assert comparison.mapped.mean_deg < 0.3
    other = compare(plane(), plane(), high_materials=materials.only(()), options=FRONT)
    assert other.bare.mean_deg == 0.0
    # The same in two materials, which also have colors.
    paints = tuple(
        MeshMaterial(
            name=name, channels={"normal": source, "base-color": ChannelSource(color, None)}
        )
        for name, color in (("red", (1.0, 0.0, 0.0)), ("blue", (0.0, 0.0, 1.0)))
    )
    both = Materials(face_materials=np.array([0, 1], np.int32), materials=paints)
    colored = compare(
        plane(), plane(), high_materials=both, low_materials=both, options=FRONT, views=[(0, 0)]
    )
    assert colored.mapped.psnr_db == math.inf and colored.mapped.mean_deg == 0.0
    np.testing.assert_allclose(colored.bare.mean_deg, comparison.bare.mean_deg, rtol=1e-6)


def test_pixels_that_see_one_mesh_alone_are_counted_apart():
    whole = plane()
    quarter = whole.replace(positions=(whole.positions - 0.5) * (0.5, 0.5, 0) + (0.5, 0.5, 0))
    comparison = compare(whole, quarter, options=FRONT, views=[(0, 0)])
    # Where edges run between the centers of pixels, a row of 70 or so may go either way.
    assert comparison.bare.outline_mismatch == pytest.approx(0.75, abs=0.02)
    assert comparison.bare.mean_deg == 0.0


def test_other_parts_seen_past_an_outline_are_counted_apart():
    # The second plane stands 0.4 behind the first, where 2 % of the diagonal are 0.03.
    near = plane()
    far = near.replace(positions=near.positions - (0, 0, 0.4))
    comparison = compare(near, far, options=FRONT, views=[(0, 0)])
    assert comparison.bare.n_pixels == 0
    assert math.isnan(comparison.bare.mean_deg)
    assert comparison.bare.outline_mismatch + comparison.bare.depth_mismatch == 1.0
    assert comparison.bare.depth_mismatch > 0.7  # the far plane looks smaller
    assert not np.isfinite(comparison.angles_deg).any()


def painted(color):
    source = ChannelSource(color, None)
    return Materials(
        face_materials=np.zeros(2, np.int32),
        materials=(MeshMaterial(name="paint", channels={"base-color": source}),),
    )


def test_models_are_compared_in_their_own_colors():
    red, blue = painted((1.0, 0.0, 0.0)), painted((0.0, 0.0, 1.0))

    def figures(**changes):
        found = compare(plane(), plane(), options=FRONT, views=[(0, 0)], **changes)
        return found.maps, found.mapped.psnr_db, found.bare.psnr_db

    assert figures(high_materials=red, low_materials=red) == (("materials",), math.inf, math.inf)
    maps, other, bare = figures(high_materials=red, low_materials=blue)
    assert maps == ("materials",) and other < 10.0 and bare == math.inf
    # A color map is compared with the colors of the model, whose highlights are less sharp.
    image = np.full((2, 2, 3), (1.0, 0.0, 0.0), np.float32)
    maps, same, bare = figures(high_materials=red, albedo=image)
    assert (maps, bare) == (("color map",), math.inf) and same > 35.0
    assert figures(low_materials=blue) == ((), math.inf, math.inf)
    assert figures(high_materials=red) == ((), math.inf, math.inf)


@pytest.mark.parametrize("quick", [False, True])
def test_the_first_figure_is_for_a_glb_file_and_each_for_its_maps(quick):
    low = uv_sphere(8, 16)
    high = uv_sphere(48, 96).replace(positions=uv_sphere(48, 96).positions * 1.05)
    normals = np.full((4, 4, 3), (0.0, 0.6, 0.8), np.float32)
    heights = np.full((4, 4), 0.05, np.float32)

    def figures(**maps):
        return compare(high, low, **maps, options=SMALL, quick=quick)

    both = figures(normal_map=normals, displacement=heights)
    alone = figures(normal_map=normals)
    assert both.maps == alone.maps == ("normal map",)
    assert both.mapped == alone.mapped != both.displaced
    assert both.displaced.outline_mismatch < both.mapped.outline_mismatch
    assert (alone.displaced, alone.displaced_frame) == (None, None)
    raised = figures(displacement=heights)
    assert (raised.maps, raised.displaced) == (("displacement map",), None)
    assert raised.mapped.outline_mismatch == both.displaced.outline_mismatch
    nothing = figures()
    assert (nothing.maps, nothing.mapped) == ((), nothing.bare)
    # A panel for each picture, and one for the difference.
    widths = {made: made.side_by_side().shape[1] for made in (nothing, alone, both)}
    assert widths[both] > widths[alone] > widths[nothing]


def test_a_quick_comparison_draws_each_picture_once_and_measures_it(monkeypatch):
    drawn = []

    def counted(prepared, camera, **options):
        drawn.append((prepared.scene.name, prepared.options.supersampling))
        return draw(prepared, camera, **options)

    monkeypatch.setattr("texbake.rendering.compare.draw", counted)
    tilt = math.radians(10.0)
    normal_map = np.full((2, 2, 3), (math.sin(tilt), 0, math.cos(tilt)), np.float32)
    low = plane().replace(name="low")
    quick = compare(plane(), low, normal_map=normal_map, options=FRONT, quick=True)
    assert drawn == [("plane", 2), ("low", 2), ("low", 2)]
    assert quick.mapped.mean_deg == pytest.approx(10.0, abs=1e-5)
    assert quick.mapped.ssim is None
    assert quick.views == (FRONT.view,)
    full = compare(plane(), low, normal_map=normal_map, options=FRONT, views=[FRONT.view])
    for name in "psnr_db", "outline_mismatch", "depth_mismatch", "n_pixels":
        # An edge along pixel centers may add a row or a column to one of the two.
        assert getattr(quick.mapped, name) == pytest.approx(getattr(full.mapped, name), rel=0.05)


def test_the_side_by_side_picture_holds_the_three_pictures():
    low = uv_sphere(8, 16)
    options = replace(SMALL, background=None)
    comparison = compare(uv_sphere(48, 96), low, options=options, quick=True)
    sheet = comparison.side_by_side()
    assert sheet.dtype == np.float32
    assert np.isfinite(sheet).all() and 0.0 <= sheet.min() < sheet.max() <= 1.0
    # It contains a row of the high-poly mesh's picture, on paper, but for 8-bit rounding.
    row = comparison.high_frame.color[45]
    start = int(row[:, 3].argmax()) - 1
    colors, opacity = np.split(row[start : start + 20], [3], axis=1)
    picture = colors * opacity + sheet[0, 0] * (1.0 - opacity)
    rows = np.lib.stride_tricks.sliding_window_view(sheet, 20, axis=1)
    distance = np.abs(np.moveaxis(rows, -1, 2) - picture).max(axis=(2, 3))
    # Half of the widest step of sRGB in linear light.
    assert distance.min() < 0.0046
    assert np.ptp(sheet[-12:], axis=2).max() > 0.1  # the scale of angles, below all pictures


def test_colors_of_angles_grow_brighter_to_the_end_of_the_scale():
    angles = np.linspace(0, MAX_ANGLE_DEG, 50, dtype=np.float32)[None]
    luminance = color_angles(angles)[0] @ (0.2126, 0.7152, 0.0722)
    assert (np.diff(luminance) > 0).all()
    ends = color_angles(np.array([[MAX_ANGLE_DEG, 90.0, np.nan, np.nan]], np.float32))[0]
    np.testing.assert_array_equal(ends[0], ends[1])
    np.testing.assert_array_equal(ends[2], ends[3])
    assert not np.array_equal(ends[1], ends[2])


# Where Blender hit back faces, its normals point into the object.
@pytest.mark.parametrize("name", [name for name, pair in PAIRS.items() if pair[-1] < 1000])
def test_a_normal_map_from_another_baker_halves_the_error(name):
    options = RenderOptions(width=320, height=240)
    comparison = compare(*pair(name), normal_map=PAIRS[name][2], options=options)
    assert comparison.mapped.mean_deg < comparison.bare.mean_deg / 2
    assert comparison.mapped.median_deg < comparison.bare.median_deg / 2
    assert comparison.mapped.ssim > comparison.bare.ssim


def test_pictures_share_one_exposure_and_white_does_not_clip():
    options = RenderOptions(width=64, height=64, base_color=(1.0, 1.0, 1.0))
    found = compare(uv_sphere(24, 48), uv_sphere(8, 16), options=options, views=[(0.0, 0.0)])
    frames = found.high_frame, found.bare_frame, found.mapped_frame
    assert len({frame.exposure for frame in frames}) == 1
    for frame in frames:
        assert (frame.color[frame.coverage == 1.0][:, :3] < 1.0).all()
    plain = replace(options, exposure="none")
    found = compare(uv_sphere(24, 48), uv_sphere(8, 16), options=plain, views=[(0.0, 0.0)])
    assert found.high_frame.exposure is None and found.high_frame.color.max() > 1.0


def test_an_open_mesh_is_compared_from_behind_too():
    flat = plane(8, 8)
    waves = 0.05 * np.sin(9 * flat.positions[:, :1]) * [0.0, 0.0, 1.0]
    high = flat.replace(positions=flat.positions + waves)
    below = replace(SMALL, view=(0.0, -60.0), up="z")
    culled = compare(high, flat, options=replace(below, back_faces="cull"), quick=True)
    assert culled.bare.n_pixels == 0
    assert compare(high, flat, options=below, quick=True).bare.n_pixels > 1000
