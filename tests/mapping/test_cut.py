import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from texbake.errors import DependencyError, UnwrapError
from texbake.mapping.atlas import cut
from texbake.mapping.atlas.cut import cut_charts, snapped_points
from texbake.mapping.seams import chart_ids
from texbake.mesh.files import read_mesh
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, grid_sphere, plane


def worker(folder: Path, monkeypatch: pytest.MonkeyPatch, code: str) -> None:
    """Let a script of the test take the place of the worker."""
    script = folder / "worker.py"
    script.write_text(f"import os, sys, time\n{code}\n")
    monkeypatch.setattr(cut, "_WORKER", script)


def test_a_flat_mesh_is_one_chart_with_its_own_lengths() -> None:
    mesh = plane(8, 8)
    cut = cut_charts(mesh)
    assert cut.n_charts == 1
    flat, space = (
        np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        for corners in (cut.uvs[cut.faces], mesh.positions[mesh.faces])
    )
    assert flat == pytest.approx(space, rel=1e-5)  # xatlas works in float32


def test_a_cube_comes_apart_in_squares() -> None:
    cut = cut_charts(cube())
    assert np.abs(np.diff(np.sort(np.ptp(cut.uvs[cut.faces], axis=1)))).max() < 1e-5
    assert cut.n_ignored == 0


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 0.7, 1e3, 1e6])
def test_scale_changes_no_bit(scale: float) -> None:
    mesh = grid_sphere(24, 48)
    whole = cut_charts(mesh)
    scaled = cut_charts(mesh.replace(positions=mesh.positions * scale))
    assert np.array_equal(scaled.faces, whole.faces)
    assert np.array_equal(scaled.uvs, whole.uvs)


@pytest.mark.parametrize("direction", [(1, 1, 1), (-1, 0.3, 0), (0, 0, 1)])
def test_place_changes_nothing_but_what_positions_lose(direction: tuple[float, ...]) -> None:
    mesh = grid_sphere(24, 48)
    moved = mesh.replace(positions=mesh.positions + 2e6 * np.array(direction))
    # A point may fall into the next cell of the grid.
    assert np.abs(snapped_points(moved) - snapped_points(mesh)).max() <= 2.0**-20
    whole, cut = cut_charts(mesh), cut_charts(moved)
    assert np.array_equal(cut.faces, whole.faces)
    assert np.abs(cut.uvs - whole.uvs).max() < 4.0 * 2.0**-20


@pytest.mark.realdata
@pytest.mark.parametrize("name", ["spot", "koala", "skull"])
def test_real_meshes_have_the_same_charts_at_any_scale_and_place(name: str, data_dir: Path) -> None:
    mesh = read_mesh(data_dir / "pairs" / name / "low.obj")
    whole = cut_charts(mesh)
    for scale in (1e-6, 1e6):
        assert np.array_equal(
            cut_charts(mesh.replace(positions=mesh.positions * scale)).uvs, whole.uvs
        )
    size = np.ptp(mesh.positions, axis=0).max()
    moved = cut_charts(mesh.replace(positions=mesh.positions + 1e6 * size))
    assert np.array_equal(moved.faces, whole.faces)
    assert np.abs(moved.uvs - whole.uvs).max() < 4.0 * 2.0**-20


def test_points_that_no_face_uses_do_not_matter() -> None:
    mesh = plane(2, 2)
    stray = np.concatenate([mesh.positions, [[1.7e308, -1.7e308, 0.0]]])
    assert np.array_equal(cut_charts(mesh.replace(positions=stray)).uvs, cut_charts(mesh).uvs)


def test_charts_agree_with_what_the_coordinates_say() -> None:
    mesh = grid_sphere(16, 32)
    cut = cut_charts(mesh)
    found = chart_ids(mesh.replace(uvs=cut.uvs, uv_faces=cut.faces))
    pairs = np.unique(np.stack([found, cut.chart_ids[cut.faces[:, 0]]], axis=1), axis=0)
    assert len(pairs) == cut.n_charts == found.max() + 1


@pytest.mark.parametrize(
    "positions",
    [
        [[0, 0, 0], [0, 0, 0], [0, 0, 0]],
        [[0, 0, 0], [1, 1, 1], [2, 2, 2]],
        [[0, 0, 0], [1, 0, 0], [0.5, 1e-9, 0]],
    ],
)
def test_a_mesh_without_area_is_one_clear_error(positions: list[list[float]]) -> None:
    mesh = Mesh(positions=positions, faces=[[0, 1, 2]], name="thread.obj")
    with pytest.raises(UnwrapError, match=r"thread\.obj: none of its 1 faces has an area"):
        cut_charts(mesh)


def test_a_crash_of_the_worker_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    worker(tmp_path, monkeypatch, "os.abort()")
    with pytest.raises(UnwrapError, match=r"cube: xatlas crashed \(exit code -?\d+\)"):
        cut_charts(cube())


def test_an_error_in_the_worker_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    worker(tmp_path, monkeypatch, "raise MemoryError('of no use')")
    with pytest.raises(UnwrapError, match="MemoryError: of no use"):
        cut_charts(cube())


def test_a_worker_that_hangs_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    worker(tmp_path, monkeypatch, "time.sleep(100)")
    start = time.perf_counter()
    with pytest.raises(UnwrapError, match="has not cut it into charts in 1 s"):
        cut_charts(cube(), timeout=1.0)
    assert time.perf_counter() - start < 20.0


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="the system has no timers")
def test_an_interrupt_takes_the_worker_along(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = tmp_path / "pid"
    worker(
        tmp_path, monkeypatch, f"open({str(told)!r}, 'w').write(str(os.getpid())); time.sleep(100)"
    )

    def interrupt(*_: object) -> None:
        if told.exists() and told.read_text():
            raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.05, 0.05)
    try:
        with pytest.raises(KeyboardInterrupt):
            cut_charts(cube())
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    with pytest.raises(ProcessLookupError):
        os.kill(int(told.read_text()), 0)


def test_without_xatlas(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cut, "find_spec", lambda name: None)
    with pytest.raises(DependencyError, match="pip install xatlas"):
        cut_charts(cube())
