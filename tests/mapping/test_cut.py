import os
import re
import signal
import sys
import time

import numpy as np
import pytest

from tests.models import BROKEN, model, of_cells, real
from texbake import Mesh, distortion
from texbake.errors import DependencyError, UnwrapError
from texbake.mapping.atlas.cutting import xatlas_charts
from texbake.mapping.atlas.cutting.cut import cut_charts as cut_surface, surface_of
from texbake.mapping.atlas.joining.pieces import pieces_of
from texbake.mapping.corner_uvs import signed_areas
from texbake.mapping.overlap import overlap_layers
from texbake.mesh.shapes import _geodesic_sphere, cube, grid_sphere, icosphere, plane


def cut_charts(mesh, regions=None, threads=None, **options):
    return cut_surface(mesh, surface_of(mesh, regions, threads), **options)


def worker(folder, monkeypatch, code):
    (folder / "own_worker.py").write_text(f"import os, sys, time\n{code}\n")
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setattr(xatlas_charts, "_WORKER", "own_worker")


@pytest.mark.parametrize("method", ["texbake", "xatlas"])
def test_a_flat_mesh_is_one_chart_with_its_own_lengths(method):
    mesh = plane(8, 8)
    cut = cut_charts(mesh, method=method)
    assert cut.n_charts == 1
    flat, space = (
        np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        for corners in (cut.uvs[cut.faces], mesh.positions[mesh.faces])
    )
    assert flat == pytest.approx(
        space, rel=1e-5 if method == "xatlas" else 1e-9
    )  # xatlas works in float32


@pytest.mark.parametrize("positions", [
    [[0, 0, 0], [0, 0, 0], [0, 0, 0]],
    [[0, 0, 0], [1, 1, 1], [2, 2, 2]],
])  # fmt: skip
def test_a_mesh_without_area_is_one_clear_error(positions):
    mesh = Mesh(positions=positions, faces=[[0, 1, 2]], name="thread.obj")
    with pytest.raises(UnwrapError, match=r"thread\.obj: no face has an area"):
        cut_charts(mesh)


def test_faces_too_thin_for_the_grid_are_distinguished_from_faces_without_area():
    far = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1e8, 0, 0], [1e8 + 1, 0, 0], [1e8, 1, 0]]
    mesh = Mesh(positions=far, faces=[[0, 1, 2], [3, 4, 5]], name="far.obj")
    with pytest.raises(UnwrapError, match=r"far\.obj: each of its 2 faces is narrower than 4 mill"):
        cut_charts(mesh)


ANSWERS = "from texbake.child import serve; serve(lambda mesh: {answer})"
FAILURES = {
    "os.abort()": r"xatlas crashed \((SIGABRT|exit code \d+)\)",
    "time.sleep(100)": "xatlas took longer than 3 s",
    "os.write(1, b'garbage' * 9)": "xatlas gave an invalid answer",
    ANSWERS.format(answer="mesh"): "xatlas gave an invalid answer",
    # A vertex without a chart.
    ANSWERS.format(answer="(mesh[0][:, :2], mesh[1][:7, 0], mesh[1])"): "xatlas gave an invalid",
    ANSWERS.format(answer="None"): "xatlas found no charts",
}


@pytest.mark.parametrize("code", FAILURES)
def test_parts_that_xatlas_fails_on_are_cut_by_normals(code, tmp_path, monkeypatch):
    worker(tmp_path, monkeypatch, f"{code}\ntime.sleep(100)")
    start = time.perf_counter()
    timeout = 3.0 if "longer" in FAILURES[code] else 90.0
    charts = cut_charts(cube(), method="xatlas", timeout=timeout)
    assert time.perf_counter() - start < 60.0  # no answer that is wrong is waited for
    assert charts.n_charts == 6
    assert np.ptp(charts.uvs[charts.faces], axis=1) == pytest.approx(np.ones((12, 2)))
    (note,) = charts.notes
    assert re.match(FAILURES[code], note)
    assert note.endswith("on a part of 12 faces; they were cut by their normals instead")


@pytest.mark.parametrize("threads", [1, 4])
def test_parts_beside_one_that_xatlas_fails_on_are_cut_by_it(threads, tmp_path, monkeypatch):
    real = (
        "from texbake.mapping.atlas.cutting.cut_worker import cut; from texbake.child import serve"
    )
    worker(
        tmp_path, monkeypatch, f"{real}\nserve(lambda m: cut(m) if len(m[1]) > 2 else os.abort())"
    )
    regions = np.array([0] * 2 + [1] * 4 + [2] * 6, dtype=np.int32)
    charts = cut_charts(cube(), regions, threads=threads, method="xatlas")
    (note,) = charts.notes
    assert "on a part of 2 faces" in note
    assert (charts.n_charts, charts.n_ignored) == (6, 0)


def test_a_library_that_hangs_is_not_waited_for_again_and_again(tmp_path, monkeypatch):
    worker(tmp_path, monkeypatch, "time.sleep(100)")
    regions = np.repeat(np.arange(6, dtype=np.int32), 2)
    charts = cut_charts(cube(), regions, threads=1, method="xatlas", timeout=0.3)
    assert [note.partition(" of")[0] for note in charts.notes] == [
        "xatlas took longer than 0.3 s on 3 parts", "xatlas took too long on others on 3 parts",
    ]  # fmt: skip


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="the system has no timers")
def test_an_interrupt_takes_the_worker_along(tmp_path, monkeypatch):
    pid_file = tmp_path / "pid"
    worker(
        tmp_path,
        monkeypatch,
        f"open({str(pid_file)!r}, 'w').write(str(os.getpid())); time.sleep(100)",
    )

    def interrupt(*_):
        if pid_file.exists() and pid_file.read_text():
            raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.05, 0.05)
    try:
        with pytest.raises(KeyboardInterrupt):
            cut_charts(cube(), method="xatlas")
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid_file.read_text()), 0)


def test_without_xatlas(monkeypatch):
    monkeypatch.setitem(sys.modules, "xatlas", None)
    with pytest.raises(DependencyError, match=r"pip install xatlas"):
        cut_charts(cube(), method="xatlas")
    assert cut_charts(cube()).n_charts == 6


def test_with_an_xatlas_that_does_not_load(tmp_path, monkeypatch):
    worker(tmp_path, monkeypatch, "sys.exit(3)")
    with pytest.raises(DependencyError, match="xatlas: it does not load"):
        cut_charts(cube(), method="xatlas")


def noisy_sphere(n, noise):
    positions, faces = _geodesic_sphere(n)
    radii = 1.0 + noise * np.random.default_rng(1).standard_normal(len(positions))
    return Mesh(positions=positions * radii[:, None], faces=faces)


def l2_stretch(mesh, charts):
    return distortion(mesh.replace(uvs=charts.uvs, uv_faces=charts.faces)).stretch.l2


@pytest.mark.parametrize("noise", [0.003, 0.01])
def test_a_rough_scan_comes_apart_in_few_charts_of_little_stretch(noise):
    # xatlas cuts it, in half a minute or more, into 34 charts of stretch 1.25, with the stronger
    # noise into 4,500 of 1.93.
    mesh = noisy_sphere(64, noise)
    charts = cut_charts(mesh, quality="fast")
    assert charts.n_charts <= 34
    assert l2_stretch(mesh, charts) < (1.005 if noise == 0.003 else 1.05)


def no_overlaps_in(charts):
    solid = (charts.faces != charts.faces[:, :1]).any(axis=1)
    corners = charts.uvs[charts.faces[solid]]
    face_charts = charts.chart_ids[charts.faces[solid, 0]]
    layers = overlap_layers(corners, face_charts, depth=2.0**-20)
    return bool((signed_areas(corners) > 0.0).all() and not layers.any())


@pytest.mark.parametrize("quality", ["fast", "good"])
@pytest.mark.parametrize(
    "name", [*BROKEN, "bracket", *real("meshes/ADIS16480.STL", "broken/self_intersectA.obj")]
)
def test_charts_of_parts_and_broken_meshes_neither_overlap_nor_mirror(name, quality):
    charts = cut_charts(model(name), quality=quality)
    assert no_overlaps_in(charts)
    assert charts.notes == ()


@pytest.mark.parametrize("n", [4, 24])
def test_faces_of_different_regions_share_no_chart(n):
    mesh = grid_sphere(n, 2 * n)
    regions = (mesh.positions[mesh.faces].mean(axis=1)[:, 0] > 0.1).astype(np.int32)
    charts = cut_charts(mesh, regions=regions)
    pairs = np.unique(np.stack([charts.chart_ids[charts.faces[:, 0]], regions], axis=1), axis=0)
    assert len(pairs) == charts.n_charts


def test_progress_tells_of_all_faces():
    for mesh in (cube(), noisy_sphere(12, 0.01)):
        steps: list[int] = []
        cut_charts(mesh, advance=steps.append)
        assert sum(steps) == mesh.n_faces


def test_a_face_in_no_chart_gets_a_point_of_a_neighbor():
    positions = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0.5, 0], [9, 9, 9]]
    mesh = Mesh(positions=positions, faces=[[4, 4, 4], [0, 1, 2], [1, 1, 2]])
    charts = cut_charts(mesh)
    assert charts.n_ignored == 2
    assert charts.faces[2].tolist() in ([charts.faces[1, 1]] * 3, [charts.faces[1, 2]] * 3)
    assert (len(set(charts.faces[0].tolist())), len(charts.uvs)) == (1, 3)


@pytest.mark.parametrize("shape", [(1, 11, 17), (17, 1, 11), (11, 17, 1)])
def test_no_chart_of_a_thin_plate_goes_around_an_edge(shape):
    plate = of_cells(np.ones(shape, dtype=bool))
    charts = cut_charts(plate, quality="fast")
    a, b, c = plate.positions[plate.faces].transpose(1, 0, 2)
    sides = np.column_stack([charts.chart_ids[charts.faces[:, 0]], np.cross(b - a, c - a)])
    assert len(np.unique(sides, axis=0)) == charts.n_charts


@pytest.mark.parametrize("seed", [2, 4])
def test_no_stretch_is_accepted_as_noise_on_a_smooth_surface(seed):
    mesh = icosphere(3)
    mesh = mesh.replace(positions=mesh.positions * np.array([2.0, 1.0, 0.5]))
    rng = np.random.default_rng(seed)
    along = mesh.positions @ rng.normal(size=3)
    ends = np.exp(3.0 * np.sin(along * rng.uniform(2.0, 8.0)))[mesh.faces]
    surface = surface_of(mesh)
    charts = cut_surface(mesh, surface, weights=(ends + np.roll(ends, -1, axis=1)) / 2.0)
    pieces = pieces_of(surface, charts, surface.opposite(charts.solid))
    assert max(piece.l2 for piece in pieces) <= 1.007
