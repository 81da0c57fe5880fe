"""Levels of detail of an export share one set of texture coordinates."""

import numpy as np
import pytest

from texbake.errors import OptionError, UvError
from texbake.jobs.export.export import export_asset, share_elsewhere
from texbake.jobs.export.programs import ExportOptions
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.unwrap import unwrap
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.options import QUALITIES, SimplifyOptions
from texbake.mesh.shapes import icosphere
from texbake.mesh.simplify import simplify
from texbake.verbs.export import export_files
from texbake.verbs.simplify import simplify_levels

ATLAS = UnwrapOptions(size=256, padding=2, quality="fast")
WEB = ExportOptions(to="threejs")


@pytest.fixture(scope="module")
def bare():
    """A ball with waves, stretched so that it fits itself in one way only."""
    ball = icosphere(4)
    waves = 1.0 + 0.1 * np.sin(5.0 * ball.positions).prod(axis=1, keepdims=True)
    return ball.replace(positions=ball.positions * waves * [1.0, 1.3, 0.8], name="ball.obj")


@pytest.fixture(scope="module")
def finest(bare):
    return unwrap(bare, ATLAS).replace(name="lod0.obj")


@pytest.mark.parametrize("quality", QUALITIES)
@pytest.mark.parametrize("n_faces", [1000, 100])
def test_simplified_levels_keep_the_layout(finest, quality, n_faces):
    level = simplify(finest, n_faces, quality=quality, seams="keep")
    assert level.n_faces <= n_faces
    # What is left are points near seams, whose closest point is in the chart beside theirs.
    assert share_elsewhere(level, finest) < 0.05


def test_another_atlas_of_the_same_surface_is_another_layout(finest, bare):
    other = unwrap(simplify(bare, 1000), ATLAS)
    assert share_elsewhere(other, finest) > 0.8
    turned = finest.replace(uvs=1.0 - finest.uvs)
    assert share_elsewhere(turned, finest) > 0.8
    assert share_elsewhere(finest, finest) < 0.01


def test_size_and_place_of_the_model_and_of_its_layout_change_nothing(finest):
    level = simplify(finest, 300, seams="keep")
    share = share_elsewhere(level, finest)
    moved = [m.replace(positions=1e-3 * m.positions + 7.0) for m in (level, finest)]
    assert share_elsewhere(*moved) == pytest.approx(share, abs=1e-3)
    tiled = [m.replace(uvs=8.0 * m.uvs) for m in (level, finest)]
    assert share_elsewhere(*tiled) == share


def test_an_export_takes_levels_of_one_layout_and_no_others(tmp_path, finest, bare):
    level = simplify(finest, 300, seams="keep")
    assert export_asset(finest, {}, tmp_path / "good", WEB, levels=[level]).mesh.exists()
    other = unwrap(simplify(bare, 300), ATLAS).replace(name="other.obj")
    with pytest.raises(UvError, match=r"other\.obj: .* laid out differently .* lod0") as caught:
        export_asset(finest, {}, tmp_path / "bad", WEB, levels=[level, other])
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "bad").exists()
    assert export_asset(
        bare, {}, tmp_path / "bare", WEB, levels=[simplify(bare, 300)]
    ).mesh.exists()


def test_levels_become_coarser(tmp_path, finest):
    one, two = (
        simplify(finest, n, seams="keep").replace(name=f"lod{i}.obj")
        for i, n in ((1, 400), (2, 200))
    )
    for levels, line in (
        ([two, one], r"levels: lod1\.obj has \d+ triangles, no fewer than lod2\.obj before it"),
        ([one, one], r"levels: lod1\.obj has .* no fewer than lod1\.obj before it.* each once"),
        ([finest], r"levels: lod0\.obj has .* no fewer than lod0\.obj before it"),
    ):
        with pytest.raises(OptionError, match=line):
            export_asset(finest, {}, tmp_path / "bad", WEB, levels=levels)
    assert not (tmp_path / "bad").exists()
    assert export_asset(finest, {}, tmp_path / "good", WEB, levels=[one, two]).mesh.exists()


def test_level_files_of_an_unwrapped_mesh_go_into_one_export(tmp_path, finest):
    write_mesh(finest, tmp_path / "lod0.obj")
    levels = [tmp_path / "lod1.obj", tmp_path / "lod2.obj"]
    options = SimplifyOptions(n_faces=400, seams="keep")
    simplify_levels(tmp_path / "lod0.obj", list(zip([400, 100], levels, strict=True)), options)
    assert [read_mesh(path).n_faces for path in levels] == [400, 100]
    export_files(tmp_path / "lod0.obj", tmp_path / "out", WEB, levels=levels)
