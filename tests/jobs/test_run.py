"""`run`: the files that it writes to its folder, and those that it leaves alone."""

import json
import re
import runpy
import sys
from dataclasses import replace
from unittest.mock import MagicMock

import numpy as np
import pytest

import texbake.jobs.run as run_module
from tests.conftest import draw_small
from tests.glb import read_glb
from texbake import (
    FileError,
    Mesh,
    OptionError,
    RunOptions,
    TexbakeError,
    check,
    finish,
    read_image,
    read_mesh,
    run,
    write_image,
)
from texbake.errors import UvError
from texbake.jobs.export.export import share_elsewhere
from texbake.jobs.run_files import write_mask_map
from texbake.mapping.options import fitting_padding
from texbake.mesh.compose import turned_over
from texbake.mesh.files.gltf_document import read_document
from texbake.mesh.normals import angles_between, face_normals, smooth_normals
from texbake.mesh.shapes import cube, icosphere
from texbake.mesh.topology import face_components
from texbake.mesh.weld import weld_rows
from texbake.metadata import CONVENTION
from texbake.targets import PROGRAMS

FILES = {
    "ball_low.obj", "ball_low.glb", "ball_normal.png", "ball_displacement.exr", "ball_preview.png",
    "ball_compare.png", "ball_report.json",
}  # fmt: skip
OPTIONS = RunOptions(n_faces=200, size=256, padding=2, convention="directx", compare="full")
# For what the maps and the pictures do not show, and for texts alone.
QUICK = replace(OPTIONS, size=64, compare="off")
TEXTS = replace(QUICK, n_faces=100, quality="fast")


@pytest.fixture(scope="module")
def high():
    """A ball of 5,120 triangles with waves all over."""
    ball = icosphere(4)
    waves = np.sin(9.0 * ball.positions).prod(axis=1, keepdims=True)
    return ball.replace(positions=ball.positions * (1.0 + 0.03 * waves), name="ball.ply")


@pytest.fixture(scope="module")
def small():
    return icosphere(2).replace(name="ball.ply")


@pytest.fixture(scope="module")
def result(high, tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        draw_small(patch)
        return run(high, tmp_path_factory.mktemp("run") / "made" / "for it", OPTIONS)


def test_every_file_is_there_and_nothing_else(result):
    folder = result.files["mesh"].parent
    assert {path.name for path in folder.iterdir()} == FILES
    assert set(result.files.values()) == {folder / name for name in FILES}


def test_the_low_poly_mesh_has_few_faces_and_an_atlas_with_padding(result):
    low = read_mesh(result.files["mesh"])
    assert low.n_faces <= OPTIONS.n_faces
    assert result.unwrapped.distortion.n_overlapping == 0
    np.testing.assert_array_equal(low.corner_uvs(), result.low.corner_uvs())
    assert (result.baked.report.padding_meets, result.baked.report.texels_missed) == (0, 0)


def test_maps_bring_the_high_poly_mesh_back(result):
    comparison = result.comparison
    assert comparison is not None and comparison.displaced is not None
    bare, mapped, displaced = comparison.bare, comparison.mapped, comparison.displaced
    assert mapped.mean_deg < 0.2 * bare.mean_deg
    assert displaced.mean_deg < mapped.mean_deg
    assert displaced.psnr_db > mapped.psnr_db > bare.psnr_db + 1
    assert displaced.outline_mismatch < mapped.outline_mismatch


def test_the_map_in_the_glb_is_opengl(result, tmp_path):
    document, binary = read_glb(result.files["glb"])
    (image,) = document["images"]
    view = document["bufferViews"][image["bufferView"]]
    start = view.get("byteOffset", 0)
    embedded = tmp_path / "embedded.png"
    embedded.write_bytes(binary[start : start + view["byteLength"]])
    directx = read_image(result.files["normal"], color=False).pixels
    opengl = read_image(embedded, color=False).pixels
    # Half a step of 8 bits and one of 16.
    tolerance = 0.5 / 255 + 0.5 / 65535 + 1e-7
    assert np.abs(opengl[..., 1] - (1 - directx[..., 1])).max() <= tolerance
    assert np.abs(opengl[..., [0, 2]] - directx[..., [0, 2]]).max() <= tolerance


def test_the_report_agrees_with_the_result(result):
    report = json.loads(result.files["report"].read_text())
    assert report["compare"]["mapped"]["mean_deg"] == result.comparison.mapped.mean_deg
    assert report["bake"]["texels_covered"] == result.baked.report.texels_covered
    assert report["simplify"]["n_faces"] == result.low.n_faces
    assert [stage["name"] for stage in report["stages"]] == [
        "simplify", "unwrap", "bake", "write maps", "compare",
    ]  # fmt: skip
    assert all(stage["peak_memory_bytes"] > 0 for stage in report["stages"])


def test_the_table_is_for_a_person(result):
    rows = dict(result.table())
    compared = list(rows)[list(rows).index("Compared with the high-poly mesh") + 1 :][:4]
    # The first row is for what the GLB file shows.
    uses = ["  with its normal map", "  displaced as well", "  without maps"]
    assert compared == [*uses, "  distance of the surfaces"]
    assert next(iter(rows)) == "faces" and rows["faces"].endswith(f" to {result.low.n_faces:,}")
    for use in uses:
        assert rows[use].startswith("normals ") and "PSNR" in rows[use] and "SSIM" in rows[use]


@pytest.mark.parametrize("compare", ["off", "quick"])
def test_the_comparison_can_be_short_or_left_out(high, result, tmp_path, small_pictures, compare):
    made = run(high, tmp_path, replace(OPTIONS, compare=compare))
    pictures = {"ball_preview.png", "ball_compare.png"}
    expected = FILES - (pictures if compare == "off" else set())
    assert {path.name for path in tmp_path.iterdir()} == expected
    rows, report = dict(made.table()), json.loads(made.files["report"].read_text())
    if compare == "off":
        assert made.comparison is None and report["compare"] is None
        assert not any("map" in row for row in rows)
        assert "compare" not in [stage["name"] for stage in report["stages"]]
    else:
        assert made.comparison is not None and result.comparison is not None
        assert made.comparison.displaced is None and "displaced" not in report["compare"]
        # The same picture as in the full comparison.
        assert made.comparison.mapped.psnr_db == result.comparison.mapped.psnr_db
        assert "SSIM" not in rows["  with its normal map"]


def test_a_failed_stage_keeps_all_earlier_files(high, tmp_path, monkeypatch):
    for name in FILES:
        (tmp_path / name).write_text("earlier")

    def fail(*args, **options):
        raise TexbakeError("ball.ply: it cannot be baked")

    monkeypatch.setattr(run_module, "bake_objects", fail)
    with pytest.raises(TexbakeError, match="cannot be baked"):
        run(high, tmp_path, OPTIONS)
    for name in FILES:  # also those of stages that had succeeded
        assert (tmp_path / name).read_text() == "earlier"
    assert {path.name for path in tmp_path.iterdir()} == FILES


def test_an_impossible_folder_is_refused_before_the_work(high, tmp_path, monkeypatch):
    monkeypatch.setattr(run_module, "LowPolyMaker", None)  # must not be reached
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match="file/folder: the folder cannot be made"):
        run(high, tmp_path / "file" / "folder")
    (tmp_path / "ball_compare.png").mkdir()
    with pytest.raises(FileError, match=r"ball_compare\.png: it is a folder"):
        run(high, tmp_path)


def test_a_mesh_that_faces_inwards_gives_the_same_asset_as_its_outside(high, tmp_path):
    inwards = turned_over(high, np.ones(high.n_faces, dtype=bool))
    result = run(inwards, tmp_path, QUICK)
    assert result.warnings[0].startswith("ball.ply: flipped 5,120 triangles")
    report = json.loads(result.files["report"].read_text())
    assert report["orientation"]["n_faces"] == high.n_faces
    np.testing.assert_array_equal(result.high.faces[:, ::-1], inwards.faces)
    a, b, c = np.moveaxis(result.low.positions[result.low.faces], 1, 0)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0.0  # six times the volume
    kept = run(inwards, tmp_path, replace(QUICK, orientation="keep"))
    assert kept.orientation.n_faces == 0
    np.testing.assert_array_equal(kept.high.faces, inwards.faces)


def test_seams_of_the_high_poly_mesh_do_not_hinder(high, result, tmp_path):
    cut = high.replace(
        uvs=np.random.default_rng(0).uniform(size=(3 * high.n_faces, 2)),
        uv_faces=np.arange(3 * high.n_faces).reshape(-1, 3),
    )
    found = run(cut, tmp_path, QUICK)
    np.testing.assert_array_equal(found.low.positions, result.low.positions)
    assert not any("too few faces" in note for note in found.warnings)


def test_a_mesh_with_an_inside_is_wrapped_first(tmp_path):
    ball = icosphere(2)
    doubled = Mesh(
        positions=np.concatenate([ball.positions, 0.8 * ball.positions]),
        faces=np.concatenate([ball.faces, ball.faces[:, ::-1] + ball.n_vertices]),
        name="ball.ply",
    )
    result = run(doubled, tmp_path, replace(QUICK, n_faces=100))
    low = result.low
    assert face_components(weld_rows(low.positions)[low.faces], low.n_vertices)[1] == 1
    (reason,) = [note for note in result.warnings if "of its surface lies inside" in note]
    assert result.to_json()["remesh"] == [reason]


def boxes(n_per_side):
    places = np.stack(np.meshgrid(*[np.arange(n_per_side)] * 3), axis=-1).reshape(-1, 1, 3)
    sizes = np.random.default_rng(0).uniform(0.1, 0.8, (len(places), 1, 1))
    box = cube()
    positions = (places + sizes * box.positions).reshape(-1, 3)
    starts = box.n_vertices * np.arange(len(places))[:, None, None]
    return Mesh(
        positions=positions, faces=(starts + box.faces).reshape(-1, 3).astype(np.int32), name="b"
    )


@pytest.mark.parametrize(("n_per_side", "size"), [(2, 512), (4, 256)])
def test_the_padding_follows_from_the_size_and_the_charts(tmp_path, n_per_side, size):
    high = boxes(n_per_side)
    options = RunOptions(n_faces=high.n_faces, size=size, samples=1, remesh="never", compare="off")
    made = run(high, tmp_path, options)
    padding = fitting_padding((size, size), made.unwrapped.n_charts)
    assert made.baked.report.options.padding == made.unwrapped.options.padding == padding
    assert dict(made.table())["  charts"].endswith(f", padding {padding}")
    report = json.loads(made.files["report"].read_text())
    assert report["unwrap"]["options"]["padding"] == padding
    assert made.baked.report.padding_meets == 0
    wider = run(high, tmp_path, replace(options, padding=padding + 1))
    assert wider.baked.report.options.padding == padding + 1


@pytest.mark.parametrize(
    ("n_per_side", "size", "padding", "hint"),
    [(6, 64, None, "$"), (4, 96, 2, " or less `padding`$")],
)
def test_too_fine_an_atlas_names_the_size(tmp_path, n_per_side, size, padding, hint):
    high = boxes(n_per_side)
    shape = {"n_faces": high.n_faces, "remesh": "never", "normals": "smooth"}
    options = RunOptions(size=size, padding=padding, **shape)
    words = rf"would own no texel at {size} x {size}; use `size` (\d+)x\1{hint}"
    with pytest.raises(UvError, match=words) as error:
        run(high, tmp_path, options)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(UvError, match=words):
        finish(high.positions, high.faces, options=options)
    larger = int(re.search(words, str(error.value))[1])
    run(high, tmp_path, replace(options, size=larger, samples=1, compare="off"))


@pytest.mark.parametrize(
    ("normals", "is_hard"),
    [("auto", True), ("angle", True), ("uv", True), ("keep", False), ("smooth", False)],
)
def test_sharp_edges_are_hard_in_every_file(tmp_path, normals, is_hard):
    """Boxes of flat sides: with hard edges and seams there, nothing is left for the map."""
    options = RunOptions(n_faces=96, size=256, compare="off", remesh="never", normals=normals)
    made = run(boxes(2), tmp_path, options)
    low = read_mesh(made.files["mesh"])
    sides = face_normals(low)[:, None]
    turns = angles_between(
        low.normals[low.normal_faces].reshape(-1, 3), np.repeat(sides, 3, 1).reshape(-1, 3)
    )
    assert (len(low.normals) > low.n_vertices) == is_hard
    assert (turns.max() < 1e-6) == (normals in ("auto", "angle"))
    found = [finding.kind for finding in check(low).findings]
    assert ("hard-edges-without-seam" in found) is False
    in_glb = read_mesh(made.files["glb"])
    np.testing.assert_allclose(
        in_glb.normals[in_glb.normal_faces], low.normals[low.normal_faces], atol=1e-6
    )
    if normals == "auto":
        codes = read_image(made.files["normal"], color=False).pixels
        assert np.abs(codes - codes[0, 0]).max() < 1e-4


def test_the_smooth_low_poly_mesh_is_written_with_its_normals(result):
    low = read_mesh(result.files["mesh"])
    assert result.low.normals is None
    np.testing.assert_array_equal(low.normals[low.normal_faces], smooth_normals(low)[low.faces])


@pytest.mark.parametrize(("choices", "expected"), [
    ({"samples": "adaptive"}, ("adaptive", None, None)),
    ({"samples": 64}, (64, None, None)),
    ({"max_error": "1deg"}, (1, "1deg", None)),
    ({"time_budget": "9s"}, (1, None, "9s")),
    ({}, (4, None, None)),
])  # fmt: skip
def test_samples_are_four_without_an_error_and_a_time_budget(choices, expected):
    bake = RunOptions(**choices).bake_options()
    assert (bake.samples, bake.max_error, bake.time_budget) == expected
    assert bake.is_adaptive == (expected[0] == "adaptive" or expected[1] is not None)


@pytest.mark.parametrize(("options", "message"), [
    ({"samples": 4, "max_error": "1deg"}, "leave nothing to choose"),
    ({"size": 16, "padding": 8}, "padding: 8"),
    ({"up": "x"}, "up: x"),
    ({"base_color": (1.0, 2.0, 0.0)}, "base_color"),
])  # fmt: skip
def test_impossible_options_are_refused_before_the_work(options, message):
    with pytest.raises(OptionError, match=message):
        RunOptions(**options)


def test_a_preset_names_and_codes_the_files_as_export_does(high, tmp_path):
    options = RunOptions(preset="unreal", maps=("ao",), compare="off", n_faces=200, size=256)
    made = run(high, tmp_path, options)
    names = "SM_ball.glb T_ball_N.png T_ball_H.png T_ball_AO.png T_ball_ORM.png ball_report.json"
    others = {"import_ball.py", "SETTINGS.txt"}
    assert {path.name for path in tmp_path.iterdir()} == {*names.split(), *others}
    assert set(made.files.values()) == set(tmp_path.iterdir())
    normal = read_image(made.files["normal"], color=False)
    assert (normal.bits, normal.metadata[CONVENTION]) == (16, "directx")
    text = made.files["settings"].read_text()
    assert "T_ball_H.png" in text and "SM_ball.glb" in text and "{" not in text


@pytest.mark.parametrize("preset", PROGRAMS)
def test_occlusion_is_in_the_material_of_a_preset(high, tmp_path, preset):
    made = run(high, tmp_path, replace(QUICK, preset=preset, maps=("ao",), levels=(40,)))
    occlusion = read_image(made.files["ao"], color=False).pixels[..., 0]
    text = made.files["settings"].read_text()
    assert "no place of its own" not in text
    target = PROGRAMS[preset]
    if target.embeds:
        for key in ("glb", "lod1_glb"):
            (material,) = read_document(made.files[key]).content["materials"]
            assert {"normalTexture", "occlusionTexture"} <= set(material)
        assert "normal map, occlusion" in text
        return
    packed = read_image(made.files["orm"], color=False).pixels
    channel = 1 if target.packing == "mask-map" else 0
    assert np.abs(packed[..., channel] - occlusion).max() <= 1 / 255
    assert made.files["orm"].name in text and made.files["lod1_orm"].is_file()


def test_levels_of_a_preset_have_import_files_of_their_own(small, tmp_path):
    imports = {
        "unreal": ["import_ball_lod1.py"], "unity": ["Editor/ball_lod1Import.cs"],
        "godot": ["ball_lod1_normal.png.import", "ball_lod1_height.png.import"], "blender": [],
    }  # fmt: skip
    for preset, expected in imports.items():
        folder = tmp_path / preset
        made = run(small, folder, replace(TEXTS, preset=preset, levels=(40,)))
        found = [path for key, path in made.files.items() if key.startswith("lod1_import")]
        assert found == [folder / name for name in expected]
        main = made.files.get("lod1_glb") or made.files["lod1_mesh"]
        text = made.files["settings"].read_text()
        assert f"{main.name}: the level of detail of 40 triangles" in text
        if preset in ("unreal", "unity"):
            script = found[0].read_text()
            assert {main.name, made.files["lod1_normal"].name} <= set(re.findall(r"[\w.]+", script))


def test_the_script_for_unreal_makes_one_mesh_of_all_levels(small, tmp_path, monkeypatch):
    unreal = MagicMock(StaticMesh=MagicMock, Texture=MagicMock)
    unreal.AssetImportTask().get_editor_property.return_value = ["/Game/ball/asset"]
    monkeypatch.setitem(sys.modules, "unreal", unreal)
    made = run(small, tmp_path, replace(TEXTS, preset="unreal", levels=(80, 40)))
    runpy.run_path(str(made.files["import"]))
    calls = unreal.get_editor_subsystem().set_lod_from_static_mesh.call_args_list
    assert [call.args[1] for call in calls] == [1, 2]
    assert "The script adds it" in made.files["settings"].read_text()


def test_programs_are_told_to_flip_a_green_channel_of_the_other_way(small, tmp_path):
    words = {
        "unreal": ("turn Flip Green Channel on.", "(False, True, 'TC_NORMALMAP'"),
        "unity": ("Flip Green Channel on", "flipGreenChannel = true;"),
        "godot": ("turn Normal Map Invert Y on.", "process/normal_map_invert_y=true"),
    }
    for preset, (setting, imported) in words.items():
        other = "directx" if PROGRAMS[preset].convention == "opengl" else "opengl"
        for convention in (other, PROGRAMS[preset].convention):
            options = replace(TEXTS, preset=preset, convention=convention)
            made = run(small, tmp_path / preset / convention, options)
            text = " ".join(made.files["settings"].read_text().split())
            script = " ".join(made.files["import"].read_text().split())
            assert (setting in text, imported in script) == (convention == other,) * 2, preset


@pytest.mark.parametrize("preset", PROGRAMS)
def test_options_that_are_given_win_over_a_preset(preset):
    given = {"size": 512, "padding": 3, "bits": 8, "convention": "directx"}
    target, own = PROGRAMS[preset], RunOptions(preset=preset, **given)
    assert {name: own.chosen(name) for name in given} == given
    for other in PROGRAMS:  # a preset may change in a copy
        changed = replace(RunOptions(preset=other, convention="opengl"), preset=preset)
        sizes = (target.size, target.padding, target.normal_bits, "opengl")
        assert tuple(map(changed.chosen, given)) == sizes
    # The padding of a preset is for its size.
    half = RunOptions(preset=preset, size=target.size // 2)
    assert half.chosen("padding") == target.padding // 2


def test_levels_share_the_layout_and_have_smaller_maps(high, tmp_path):
    options = replace(QUICK, size=128, levels=(90, 40), maps=("ao",))
    made = run(high, tmp_path, options)
    faces = [read_mesh(made.files[key]).n_faces for key in ("mesh", "lod1_mesh", "lod2_mesh")]
    assert faces[1] <= 90 and faces[2] <= 40 and faces == [
        made.low.n_faces, *(level.mesh.n_faces for level in made.levels)
    ]  # fmt: skip
    sizes = [read_image(made.files[f"{key}normal"], color=False).pixels.shape[0]
             for key in ("", "lod1_", "lod2_")]  # fmt: skip
    assert sizes == [128, 128, 64]
    for level, most in zip(made.levels, (0.03, 0.12), strict=True):
        assert share_elsewhere(level.mesh, made.low) < most
        assert level.baked.report.miss_percent == 0.0
        assert set(level.baked.maps) == {"normal", "displacement", "ao"}
    assert len(json.loads(made.files["report"].read_text())["levels"]) == 2
    with pytest.raises(OptionError, match="levels: each must have fewer triangles"):
        replace(options, levels=(90, 90))
    with pytest.raises(OptionError, match=r"levels: 2,000 triangles are not fewer than the"):
        run(high, tmp_path, replace(options, n_faces=None, error="3%", levels=(2000, 30)))


def test_an_orm_image_becomes_a_mask_map(tmp_path):
    codes = np.random.default_rng(0).integers(0, 256, (4, 4, 3), np.uint8)
    write_image(codes, tmp_path / "orm.png", color=False)
    orm = (tmp_path / "orm.png").read_bytes()
    write_mask_map(orm, tmp_path / "mask.png", RunOptions(preset="unity"))
    found = np.rint(255 * read_image(tmp_path / "mask.png", color=False).pixels)
    ao, roughness, metalness = np.moveaxis(codes.astype(int), 2, 0)
    expected = [metalness, ao, np.full_like(ao, 255), 255 - roughness]
    np.testing.assert_array_equal(found, np.stack(expected, axis=2))
