"""Parts baked together equal the parts baked alone."""

import numpy as np
import pytest

from tests.artist_models import bumpy, write_model
from texbake import BakeOptions, Mesh, OptionError, PartsOptions, bake, bake_parts, read_mesh
from texbake.baking.parts.high_parts import match_objects
from texbake.baking.parts.low_parts import BakeTarget
from texbake.baking.rays import RayMaps
from texbake.errors import CageError, MeshError, MissError, UvError
from texbake.mesh.compose import join_meshes
from texbake.mesh.materials import Materials, MeshMaterial
from texbake.mesh.shapes import plane, uv_sphere
from texbake.mesh.tangents import corner_tangents

MATCH = PartsOptions(match_by_name=True, occluders="match")
ONLY = BakeTarget("", 1001)
MAPS = ("normal", "displacement", "position", "opacity", "curvature", "ao", "thickness")


def wavy(theta, phi):
    return 1 + 0.02 * np.sin(7 * theta) * np.cos(9 * phi)


def ball(name, x, *, is_high=False, u=0.0):
    """A sphere at x; a low-poly one fills the half of the texture that begins at u."""
    mesh = uv_sphere(40, 80, wavy) if is_high else uv_sphere(12, 24)
    uvs = mesh.uvs * [0.46, 0.92] + np.array([u + 0.02, 0.04])
    return mesh.replace(positions=mesh.positions + np.array([x, 0, 0]), uvs=uvs, name=name)


# The spheres overlap, so that rays of one can hit the other.
LOWS = [ball("left_low", 0.0), ball("Right_low", 1.9, u=0.5)]
HIGHS = [ball("LEFT_high", 0.0, is_high=True), ball("right_high_01", 1.9, is_high=True)]
HIGH, LOW = join_meshes(HIGHS), join_meshes(LOWS)


def options(**changes):
    return BakeOptions(**{"size": 64, "maps": MAPS, "secondary_rays": 16, **changes})


@pytest.mark.parametrize(
    ("as_files", "tile"), [(False, 0), (False, 1), (True, 0)], ids=["groups", "tiles", "files"]
)
@pytest.mark.parametrize("named", [(), ("Right_low",)])
def test_parts_that_share_texels_are_baked_in_order_after_those_named(as_files, tile, named):
    lows = [LOWS[0], ball("Right_low", 1.9)]
    as_one = join_meshes([LOWS[0], ball("Right_low", 1.9, u=tile)])
    high, low = (HIGHS, lows) if as_files else ([HIGH], [as_one])
    baked = bake_parts(high, low, options(maps=("position",), bake_island=named), MATCH)
    one = len(named)
    alone = bake(HIGHS[one], lows[one], options(maps=("position",)))
    found, wanted = (each.maps["position"].values for each in (baked.targets[ONLY], alone))
    # A move by a tile rounds coordinates.
    near = np.isclose(found, wanted, rtol=0.0, atol=1e-5 * tile)
    assert near[alone.has_data].all() and baked.report.without_texel == []
    with pytest.raises(OptionError, match="no part that is baked is called 'middle'"):
        bake_parts(high, low, options(bake_island=("middle",)), MATCH)


def assert_same(found, wanted):
    """One set of maps is another one, byte for byte."""
    assert np.array_equal(found.texel_faces, wanted.texel_faces)
    for name, baked in wanted.maps.items():
        assert found.maps[name].values.tobytes() == baked.values.tobytes(), name


def assert_shows(whole, alone):
    """Where a bake without padding has a texel, the whole has the same; return where that is."""
    mine = alone.texel_faces >= 0
    assert np.array_equal(whole.has_data[mine], alone.has_data[mine])
    for name, baked in alone.maps.items():
        assert np.array_equal(whole.maps[name].values[mine], baked.values[mine]), name
    return mine


@pytest.mark.parametrize(
    "changes",
    [{"samples": 1}, {"samples": 4}, {"samples": "adaptive", "maps": ("normal",)},
     {"maps": ("normal", "ao"), "back": 0.1, "padding": 0}],
    ids=["1", "4", "adaptive", "cage"],
)  # fmt: skip
@pytest.mark.parametrize("as_files", [False, True], ids=["groups", "files"])
def test_each_part_equals_a_bake_of_it_alone(changes, as_files):
    """Also on a cage of both spheres, each grown about its center, of which each gets its own."""
    high, low = (HIGHS, LOWS) if as_files else ([HIGH], [LOW])
    grown = [mesh.replace(positions=1.1 * (mesh.positions - [x, 0, 0]) + [x, 0, 0])
             for mesh, x in zip(LOWS, (0.0, 1.9), strict=True)]  # fmt: skip
    caged = "back" in changes and not as_files
    cage = LOW.replace(positions=join_meshes(grown).positions) if caged else None
    whole = bake_parts(high, low, options(**changes), MATCH, cage=cage).targets[ONLY]
    covered = np.zeros(whole.texel_faces.shape, int)
    for i in range(2):
        alone = options(**{**changes, "padding": 0})
        one = bake(HIGHS[i], LOWS[i], alone, cage=grown[i] if caged else None)
        covered += assert_shows(whole, one)
    assert np.array_equal(whole.texel_faces >= 0, covered == 1) and covered.max() == 1


@pytest.mark.parametrize("corner", [(0, 0), (1, 0), (0, 1), (1, 1)])
def test_a_part_of_any_outline_is_there_to_its_last_texel(corner):
    """A triangle is widest at its first or last row, and highest at its first or last column."""
    ends = np.abs(np.array([[0.02, 0.02], [0.72, 0.02], [0.02, 0.62]]) - corner)
    faces = [[0, 1, 2] if corner[0] == corner[1] else [0, 2, 1]]
    triangle = Mesh(
        positions=np.insert(ends, 2, 3.0, axis=1), faces=faces, uvs=ends, uv_faces=faces
    )
    square = plane().replace(uvs=np.abs(0.25 * plane().uvs + 0.72 - corner))
    parts = {"a": square, "b": triangle}
    lows, highs = (
        [mesh.replace(name=f"{name}_{end}") for name, mesh in parts.items()]
        for end in ("low", "high")
    )
    chosen = BakeOptions(size=40, maps=("position",), padding=0, front=0.1, back=0.1)
    whole = bake_parts(highs, lows, chosen, MATCH).targets[ONLY]
    seen = [assert_shows(whole, bake(*both, chosen)) for both in zip(highs, lows, strict=True)]
    assert np.array_equal(whole.has_data, seen[0] | seen[1]) and seen[1].sum() > 250


def renamed(mesh, *names):
    return mesh.replace(group_names=names, group_objects=mesh.group_objects)


@pytest.mark.parametrize(("high_names", "low_names", "are_paired"), [
    (("LEFT_high", "right_high_01"), ("left_low", "Right_low"), True),
    (("a", "b_high"), ("a_low", "b"), True),
    (("a", "b"), ("a", "b"), True),
    (("a", "b", "c"), ("a", "b"), False),
    (("a", "c"), ("a", "b"), False),
    (("a", "b"), ("a", "a_low"), False),
])  # fmt: skip
def test_objects_are_matched_if_all_names_pair_up(high_names, low_names, are_paired):
    chosen = options(maps=("normal",), front=0.2, back=0.1, cull_back_faces=False)
    highs = [*HIGHS, ball("far", 9.0)][: len(high_names)]
    high, low = renamed(join_meshes(highs), *high_names), renamed(LOW, *low_names)
    result = bake_parts([high], [low], chosen)
    assert (result.report.matching is not None) == are_paired == result.report.is_paired
    expected = bake_parts([HIGH], [LOW], chosen, MATCH) if are_paired else bake(high, low, chosen)
    expected = expected.targets[ONLY] if are_paired else expected
    assert_same(result.targets[ONLY], expected)
    assert (
        bake_parts([high], [low], chosen, PartsOptions(join_objects=True)).report.matching is None
    )


def test_a_surface_of_several_groups_is_not_matched_by_itself():
    """Rays at the border of one group would miss what the next group has there."""
    groups = np.arange(LOWS[0].n_faces, dtype=np.int32) % 2
    fields = {"face_groups": groups, "group_names": ("a", "b"), "group_objects": (0, 1)}
    low = LOWS[0].replace(**fields)
    assert match_objects([renamed(HIGH, "a", "b")], [low], PartsOptions()) is None


def test_occluders_are_all_or_the_match():
    """A lid darkens the plate below it, unless only its match occludes; rays hit the plate in both.

    In the middle of a unit square under another at height h, the lid is seen under the form factor
    of four rectangles that meet above the point: 4 (2 / 2 pi) a atan(a), a = s / sqrt(1 + s^2),
    s = 1 / (2 h) (Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", B-3).
    """
    low = plane(4, 4).replace(name="plate_low")
    plate = plane(4, 4).replace(name="plate_high")
    height = 0.5
    lid = plane().replace(name="lid_high", positions=plane().positions + np.array([0, 0, height]))
    chosen = BakeOptions(size=33, maps=("ao", "normal"), secondary_rays=4096, padding=0)
    found = {
        occluders: bake_parts(
            [plate, lid], [low], chosen, PartsOptions(match_by_name=True, occluders=occluders)
        ).targets[ONLY]
        for occluders in ("all", "match")
    }
    assert (found["match"].maps["ao"].values == 1.0).all()
    s = 0.5 / height
    a = s / np.sqrt(1 + s * s)
    middle = found["all"].maps["ao"].values[16, 16, 0]
    # 4096 rays of a scrambled net: noise well below 1 / sqrt(4096).
    assert middle == pytest.approx(1 - 4 / np.pi * a * np.arctan(a), abs=1 / 64)
    for result in found.values():
        assert (result.maps["normal"].values == [0, 0, 1]).all()


@pytest.mark.parametrize("samples", [1, 16])
@pytest.mark.parametrize("tile", [(1, 0), (3, 2)])
def test_tiles_are_shifted_bakes(samples, tile):
    """A tile is, byte for byte, what a bake of the mesh moved by hand makes of the unit square.

    Its tangents are those of the mesh where it lies: that is what a renderer computes them from, in
    float32, and far from the origin they are a little coarser.
    """
    column, row = tile
    lows = [LOWS[0], LOWS[1].replace(uvs=LOWS[1].uvs + tile)]
    low = join_meshes(lows)
    chosen = options(samples=samples, maps=("normal", "displacement", "ao"), fill="push-pull")
    result = bake_parts([HIGH], [low], chosen, PartsOptions(udim=True))
    number = 1001 + column + 10 * row
    assert list(result.targets) == [ONLY, BakeTarget("", number)]
    assert result.report.n_crossing == 0
    for udim, shift in ((1001, (0, 0)), (number, tile)):
        moved = low.replace(uvs=low.uvs - np.array(shift), tangents=corner_tangents(low))
        alone = bake(HIGH, moved, chosen)
        assert_same(result.targets[BakeTarget("", udim)], alone)


def test_faces_that_coincide_are_equal_on_their_tiles():
    """A patch above the plane lengthens the rays of the copy that it is closest to."""
    patch = plane(2, 2).replace(name="patch")
    patch = patch.replace(positions=patch.positions * 0.1 + np.array([0.4, 0.4, 0.1]))
    low = plane(8, 8)
    moved = low.replace(uvs=low.uvs * 0.98 + np.array([1.01, 0.01]))
    low = join_meshes([low.replace(uvs=low.uvs * 0.98 + 0.01), moved])
    chosen = options(maps=("displacement",))
    tiles = bake_parts(
        [join_meshes([plane(16, 16), patch])], [low], chosen, PartsOptions(udim=True)
    )
    first, second = (baked.maps["displacement"].values for baked in tiles.targets.values())
    assert first.max() > 0.09
    assert second == pytest.approx(first, abs=1e-6)


def test_integer_files_of_tiles_share_one_scale(tmp_path):
    moved = plane().replace(
        positions=plane().positions + np.array([2, 0, 0]), uvs=plane().uvs + np.array([1, 0])
    )
    low = join_meshes([plane(), moved])
    lift = np.repeat([0.1, 0.4], 4)[:, np.newaxis] * [0, 0, 1]
    chosen = BakeOptions(size=8, maps=("displacement",))
    high = low.replace(positions=low.positions + lift)
    result = bake_parts([high], [low], chosen, PartsOptions(udim=True))
    written = result.write(
        {target: {"displacement": tmp_path / f"{target.udim}.png"} for target in result.targets}
    )
    assert [file.path.name for file in written] == ["1001.png", "1002.png"]
    assert written[0].metadata == written[1].metadata


def test_sets_of_groups_together_cover_what_one_set_covers():
    chosen = options(maps=("normal",), padding=0)
    plain = bake(HIGH, LOW, chosen)
    by_group = PartsOptions(texture_sets="groups", join_objects=True)
    result = bake_parts([HIGH], [LOW], chosen, by_group)
    assert [target.texture_set for target in result.targets] == ["left_low", "Right_low"]
    left, right = result.targets.values()
    assert not ((left.texel_faces >= 0) & (right.texel_faces >= 0)).any()
    for one in (left, right):
        assert_shows(plain, one)
    assert np.array_equal(np.maximum(left.texel_faces, right.texel_faces), plain.texel_faces)
    named = bake_parts(
        [HIGH], [LOW], chosen, PartsOptions(texture_sets="groups", match_by_name=True)
    )
    assert [target.texture_set for target in named.targets] == ["left", "Right"]


def test_sets_of_materials_may_overlap():
    """Two materials over the whole square each, as many meshes have them."""
    low = join_meshes(
        [plane(2, 2), plane(2, 2).replace(positions=plane(2, 2).positions + np.array([0, 0, 1]))]
    )
    high = low.replace(positions=low.positions + np.array([0, 0, 0.1]))
    materials = Materials(
        face_materials=low.face_groups,
        materials=(MeshMaterial(name="skin"), MeshMaterial(name="cloth")),
    )
    chosen = BakeOptions(size=16, maps=("displacement",), front=0.2, back=0.2)
    result = bake_parts(
        [high], [low], chosen, PartsOptions(texture_sets="materials"), low_materials=[materials]
    )
    assert [target.texture_set for target in result.targets] == ["skin", "cloth"]
    assert not result.report.warnings
    for found in result.targets.values():
        assert found.report.texels_covered == 256
        np.testing.assert_allclose(found.maps["displacement"].values, 0.1, rtol=1e-6)
    with pytest.raises(MeshError, match="no materials"):
        bake_parts([high], [low], chosen, PartsOptions(texture_sets="materials"))


def test_rays_at_the_border_of_a_set_are_those_of_the_whole():
    """A sphere divided through the middle has no seam in its rays or tangents."""
    low = ball("low", 0.0)
    middles = low.positions[low.faces].mean(axis=1)[:, 2]
    low = low.replace(face_groups=(middles > 0).astype(int), group_names=("down", "up"))
    high = ball("high", 0.0, is_high=True)
    chosen = options(maps=("normal",), padding=0, samples=1)
    plain = bake(high, low, chosen)
    result = bake_parts([high], [low], chosen, PartsOptions(texture_sets="groups"))
    for found in result.targets.values():
        assert_shows(plain, found)


def test_overlaps_of_meshes_that_share_an_atlas_are_counted():
    left = plane(2, 2).replace(name="a.obj", uvs=plane(2, 2).uvs * [0.5, 1])
    other = plane(2, 2).replace(
        name="b.obj", uvs=plane(2, 2).uvs * [0.75, 1] + np.array([0.25, 0]),
        positions=plane(2, 2).positions + np.array([2, 0, 0]),
    )  # fmt: skip
    highs = [
        mesh.replace(positions=mesh.positions + np.array([0, 0, height]))
        for mesh, height in ((left, 0.1), (other, 0.2))
    ]
    chosen = BakeOptions(size=32, maps=("displacement",), front=0.3, back=0.3)
    result = bake_parts(highs, [left, other], chosen)
    heights = result.targets[ONLY].maps["displacement"].values[:, :, 0]
    np.testing.assert_allclose(heights[:, :16], 0.1, rtol=1e-6)
    np.testing.assert_allclose(heights[:, 16:], 0.2, rtol=1e-6)
    assert result.report.n_overlapping == 8 * 32
    assert any("256 texels are covered by more than one part" in w for w in result.report.warnings)
    assert result.targets[ONLY].report.texels_covered == 32 * 32


def test_matched_halves_that_are_stacked_on_purpose_are_no_overlap(tmp_path):
    low = read_mesh(write_model("head", tmp_path / "head.obj"))
    high = bumpy(low, 2).replace(group_names=("left_high", "right_high"))
    low = low.replace(group_names=("left_low", "right_low"))
    report = bake_parts([high], [low], BakeOptions(size=64), MATCH).report
    assert (report.n_overlapping, len(report.parts)) == (0, 2)


def test_a_hit_of_another_part_replaces_a_miss():
    first = plane().replace(name="a_low")
    second = plane().replace(name="b_low", positions=plane().positions + np.array([3, 0, 0]))
    far = plane().replace(name="a_high", positions=plane().positions + np.array([0, 9, 0]))
    near = second.replace(name="b_high")
    chosen = BakeOptions(size=8, front=0.1, back=0.1)
    result = bake_parts([far, near], [first, second], chosen, MATCH)
    assert result.targets[ONLY].has_data.all()
    assert result.report.n_overlapping == 64


def test_maps_that_are_kept_in_files_are_the_same(tmp_path):
    low = join_meshes([LOWS[0], LOWS[1].replace(uvs=LOWS[1].uvs + np.array([1, 0]))])
    chosen, parts = options(maps=("normal", "displacement")), PartsOptions(udim=True)
    kept = bake_parts([HIGH], [low], chosen, parts)
    waiting = bake_parts([HIGH], [low], chosen, parts, folder=tmp_path)
    assert len(list(tmp_path.rglob("*.npy"))) == 4
    for target, found in waiting.targets.items():
        assert_same(found, kept.targets[target])


def test_each_set_has_its_own_images_for_rays():
    low = join_meshes([LOWS[0], LOWS[1].replace(uvs=LOWS[1].uvs + np.array([1, 0]))])
    chosen = options(maps=("normal",), front=0.1, back=0.1)
    masks = {1001: np.zeros((2, 2)), 1002: np.ones((2, 2))}
    result = bake_parts(
        [HIGH], [low], chosen, PartsOptions(udim=True),
        ray_maps=lambda target: RayMaps.of(skew_mask=masks[target.udim]),
    )  # fmt: skip
    kinds = {}
    for kind in ("smooth", "face"):
        changed = options(maps=("normal",), front=0.1, back=0.1, rays=kind)
        kinds[kind] = bake_parts([HIGH], [low], changed, PartsOptions(udim=True)).targets
    for udim, kind in ((1001, "smooth"), (1002, "face")):
        target = BakeTarget("", udim)
        assert_same(result.targets[target], kinds[kind][target])


BARE = LOWS[0].replace(uvs=None, uv_faces=None)


@pytest.mark.parametrize(("arguments", "changes", "error", "message"), [
    (([], [LOW]), {}, OptionError, "high, low: give at least one"),
    (([HIGH], [LOW]), {"options": BakeOptions(time_budget="1s")}, OptionError, "time_budget"),
    (([HIGH], [LOW]), {"options": BakeOptions(keep_hits=True)}, OptionError, "hits"),
    (([HIGHS[0]], [LOW]), {"parts": PartsOptions(occluders="match")}, OptionError, "by_name"),
    (([HIGH], [BARE]), {}, UvError, "no texture coordinates"),
    (([HIGH], [LOW, LOW]), {"cage": LOW}, OptionError, "cage: it belongs to one"),
    (([HIGH], [LOW]), {"cage": HIGH}, CageError, "a cage must have the faces"),
    (([HIGHS[1]], [LOWS[0]]), {"parts": MATCH}, MeshError, "no low-poly part"),
    ((HIGHS, LOWS), {"parts": MATCH, "options": BakeOptions(maps=("vertex-color",))}, MeshError,
     "LEFT_high: it has no vertex colors"),
    (([HIGHS[1].replace(name="left_high")], [LOWS[0]]),
     {"parts": MATCH, "options": BakeOptions(size=16, front=0.01, back=0.01, fail_on_miss=1.0)},
     MissError, "left_low: .* missed left_high"),
])  # fmt: skip
def test_wrong_input_is_one_line(arguments, changes, error, message):
    with pytest.raises(error, match=message):
        bake_parts(*arguments, **changes)


def test_colors_of_glb_and_ply_files_are_joined():
    colored = [
        mesh.replace(colors=np.full((mesh.n_vertices, 3), 0.25), name=name)
        for mesh, name in zip(HIGHS, ("a.glb", "b.ply"), strict=True)
    ]
    values = bake_parts(colored, LOWS, options(maps=("vertex-color",))).targets[ONLY]
    found = values.maps["vertex-color"].values[values.has_data]
    np.testing.assert_allclose(found, 0.25, rtol=1e-6)


def test_primitives_of_one_object_are_one_part():
    """glTF has a primitive per material of an object; the groups are called NAME 0, NAME 1."""
    half = np.arange(LOWS[0].n_faces) % 2
    cut = LOWS[0].replace(
        name="asset.glb", face_groups=half, group_names=("left_low 0", "left_low 1")
    )
    chosen = options(maps=("normal",))
    result = bake_parts([HIGHS[0]], [cut], chosen, MATCH)
    assert [part.low for part in result.report.parts] == ["left_low"]
    assert_same(result.targets[ONLY], bake(HIGHS[0], LOWS[0], chosen))
    # In other formats a number is part of the name, which is then not that of a low-poly part.
    with pytest.raises(MeshError, match="no low-poly part"):
        bake_parts([HIGHS[0]], [cut.replace(name="asset.obj")], chosen, MATCH)


def test_groups_of_one_name_are_one_set():
    low = LOW.replace(group_names=("body", "body"))
    result = bake_parts(
        [HIGH], [low], options(maps=("normal",)), PartsOptions(texture_sets="groups")
    )
    assert list(result.targets) == [BakeTarget("body", 1001)]
    (found,) = result.targets.values()
    assert_same(found, bake(HIGH, LOW, options(maps=("normal",))))
