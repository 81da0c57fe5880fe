"""The count of triangles that is asked for: reached by `simplify` and `run`, or a clear error."""

from pathlib import Path

import pytest

import texbake
from tests.models import bone, handles, model, real, sponge
from texbake import OptionError, RunOptions, surface_distance
from texbake.errors import MeshError
from texbake.jobs.low_poly import LowPolyMaker
from texbake.mesh.hard_edges import LowNormals
from texbake.mesh.topology import find_edges
from texbake.verbs.simplify import simplify_file


@pytest.fixture
def mesh(tmp_path, monkeypatch):
    """Menger's sponge of 81 tunnels, also as a file; at 200 triangles, 2 for each are left."""
    monkeypatch.chdir(tmp_path)
    made = sponge(2).replace(name="sponge.ply")
    texbake.write_mesh(made, "sponge.ply")
    return made


def test_simplify_stops_where_the_topology_needs_more(mesh):
    with pytest.raises(
        MeshError, match=r"200 triangles cannot be reached, because .* need [3-9]\d\d; request"
    ):
        simplify_file("sponge.ply", "low.ply", texbake.SimplifyOptions(n_faces=200))
    assert not Path("low.ply").exists()


def test_simplify_gives_the_topology_up_if_asked_to(mesh):
    done = simplify_file(
        "sponge.ply", "low.ply", texbake.SimplifyOptions(n_faces=200, topology="simplify")
    )
    low = texbake.read_mesh("low.ply")
    assert 198 <= low.n_faces <= 200
    assert handles(low) <= 200 / 20  # the widest tunnels, of a third of its side, stay
    assert "closed surface" in done.warnings[0]
    # Not from the closed surface, whose count of triangles is of no interest either.
    assert done.report.n_faces_before == mesh.n_faces
    assert done.report.distance.rms == pytest.approx(surface_distance(mesh, low).rms, rel=0.01)


def test_no_way_out_is_named_that_was_taken(tmp_path):
    torus = texbake.make("torus", resolution=(24, 12)).replace(name="torus.ply")
    texbake.write_mesh(torus, tmp_path / "torus.ply")
    options = texbake.SimplifyOptions(n_faces=12, topology="simplify")
    with pytest.raises(MeshError, match=r"12 triangles cannot be reached, .*; request more$"):
        simplify_file(tmp_path / "torus.ply", tmp_path / "low.ply", options)
    with pytest.raises(MeshError, match=r"12 triangles cannot be reached, .*; request more$"):
        texbake.run(torus, tmp_path / "asset", RunOptions(n_faces=12, size=64))


def test_colors_and_groups_stay_where_the_topology_is_given_up(mesh):
    size = mesh.positions.max(axis=0) - mesh.positions.min(axis=0)
    colors = (mesh.positions - mesh.positions.min(axis=0)) / size
    right = (colors[mesh.faces].mean(axis=1)[:, 0] > 0.5).astype("int32")
    halves = mesh.replace(colors=colors, face_groups=right, group_names=("left", "right"))
    texbake.write_mesh(halves, "halves.obj")
    options = texbake.SimplifyOptions(n_faces=200, topology="simplify")
    simplify_file("halves.obj", "low.obj", options)
    low = texbake.read_mesh("low.obj")
    assert low.group_names == ("left", "right") and low.colors is not None
    expected = (low.positions - mesh.positions.min(axis=0)) / size
    assert abs(low.colors - expected).mean() < 0.05


def test_seams_cannot_be_kept_where_the_topology_is_given_up(mesh):
    options = texbake.SimplifyOptions(n_faces=200, topology="simplify", seams="keep")
    with pytest.raises(OptionError, match=r"topology, seams: .* leave one of them out"):
        simplify_file("sponge.ply", "low.ply", options)


@pytest.mark.parametrize("n_faces", [200, 3_000])
def test_run_reaches_the_count(mesh, n_faces):
    options = RunOptions(n_faces=n_faces, size=128, compare="off")
    result = texbake.run(mesh, "asset", options)
    assert result.low.n_faces <= n_faces and handles(result.low) <= n_faces / 20
    why = "\n".join(result.why_closed)
    assert ("cannot show its tunnels (81)" in why) == (n_faces == 200)
    assert ("of its diagonal were closed" in why) == (n_faces == 200)
    if n_faces == 200:
        n = handles(result.low)
        assert f"and {n} tunnel{'s are' if n != 1 else ' is'} left" in why
    apart = surface_distance(result.high, result.low)
    assert result.simplified.distance.rms == pytest.approx(apart.rms, rel=0.05)


def test_a_porous_bone_keeps_its_look_at_any_count(tmp_path, small_pictures):
    options = RunOptions(n_faces=400, size=128, samples=1, compare="full")
    result = texbake.run(bone(), tmp_path, options)
    assert handles(result.high) > 60
    assert 396 <= result.low.n_faces <= 400 and handles(result.low) <= 400 / 20
    assert find_edges(result.low.faces).closed
    compared = result.comparison
    assert compared.mapped.mean_deg < 0.75 * compared.bare.mean_deg
    assert compared.displaced.mean_deg < 0.5 * compared.bare.mean_deg
    assert not any("further from" in note for note in result.warnings)


def test_rays_reach_as_far_as_few_faces_lie_from_the_mesh(tmp_path):
    options = RunOptions(n_faces=40, size=128, samples=1, compare="off")
    baked = texbake.run(texbake.make("torus"), tmp_path, options).baked.report
    assert baked.texels_missed < 0.03 * baked.texels_covered


def test_run_stops_where_the_count_cannot_be_reached(mesh):
    options = RunOptions(n_faces=200, remesh="never", size=128)
    with pytest.raises(MeshError, match=r"sponge\.ply: 200 triangles cannot .* `remesh` always"):
        texbake.run(mesh, "asset", options)
    assert list(Path("asset").glob("*")) == []


@pytest.mark.parametrize("name", real("broken/VH_M_Heart.glb", "broken/cycloidal.ply"))
def test_what_would_be_torn_is_wrapped(name):
    n_faces = 500 if "Heart" in name else 5_000
    rule = LowNormals("auto", 60.0)
    low = LowPolyMaker(high=model(name), n_faces=n_faces, quality="fast", rule=rule).make("auto")
    assert 0.99 * n_faces <= low.mesh.n_faces <= n_faces and low.report.is_whole
    assert "closed surface around it" in low.why[0]


@pytest.mark.parametrize("name", real("broken/VH_M_Prostate.glb"))
def test_parts_that_were_dropped_make_no_spikes(name, tmp_path, small_pictures):
    """Thin ducts are dropped, far away from all that is left."""
    options = RunOptions(n_faces=100, size=256, samples=1, compare="full")
    result = texbake.run(model(name), tmp_path, options)
    apart, front = result.simplified.distance, result.baked.report.front
    assert front is not None and front < 0.25 * apart.a_to_b.max
    compared = result.comparison
    assert compared.displaced.mean_deg < 0.3 * compared.bare.mean_deg
    assert compared.displaced.psnr_db > compared.bare.psnr_db + 3.0
    assert compared.displaced.outline_mismatch < 0.5 * compared.bare.outline_mismatch


def test_an_error_decides_alone_how_many_triangles_are_left(mesh):
    options = RunOptions(n_faces=200, error="0.1%", size=256, compare="off")
    result = texbake.run(mesh, "asset", options)
    assert result.low.n_faces > 202
    assert result.why_closed == () and result.simplified.distance.max_relative <= 0.001


def test_a_default_number_of_triangles_need_not_be_reached(mesh):
    rule = LowNormals("smooth", 60.0)
    maker = LowPolyMaker(high=mesh, n_faces=200, quality="fast", rule=rule, threads=1)
    made = maker.make("never", must_reach=False)
    assert made.mesh.n_faces > 202 and not made.report.is_whole
