"""`texbake cubemap`: each layout to each, as a command and as a process; wrong usage."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result

from texbake import read_image, write_image

Invoke = Callable[..., Result]

FACES = [f"{name}.hdr" for name in ("nx", "ny", "nz", "px", "py", "pz")]


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A current folder with a bright panorama, a gray one and a square."""
    rng = np.random.default_rng(0)
    write_image(rng.random((32, 64, 3)).astype(np.float32) * 2, tmp_path / "sky.hdr", color=True)
    write_image(np.full((16, 32, 3), 100, np.uint8), tmp_path / "gray.png", color=True)
    write_image(np.full((4, 4, 3), 100, np.uint8), tmp_path / "square.png", color=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_to_six_faces_and_back(workplace: Path, invoke: Invoke) -> None:
    result = invoke("cubemap sky.hdr -o faces/")
    assert sorted(path.name for path in Path("faces").iterdir()) == FACES
    assert "to    faces of 16 px" in result.stdout
    assert result.stdout.count("wrote ") == 6
    result = invoke("cubemap faces/ -o pano.exr --size 64")
    assert "from  faces\nto    latlong of 64 px\nwrote pano.exr\n" in result.stdout
    assert result.stderr == ""
    back, sky = (read_image(name, color=True).pixels for name in ("pano.exr", "sky.hdr"))
    assert back.shape == (64, 128, 3)
    np.testing.assert_allclose(back.mean(axis=(0, 1)), sky.mean(axis=(0, 1)), rtol=0.05)


def test_one_image_is_a_cross_and_clipping_is_reported(workplace: Path, invoke: Invoke) -> None:
    result = invoke("cubemap sky.hdr -o cross.png --size 8 --convention inside")
    assert "warning: cross.png: " in result.stderr
    assert "were clipped; EXR and HDR files keep them" in result.stderr
    assert read_image("cross.png", color=True).pixels.shape == (24, 32, 3)
    result = invoke("cubemap cross.png -o again --convention inside --format tga --quiet")
    assert result.stdout == ""
    assert (workplace / "again" / "px.tga").is_file()


def test_a_constant_stays_its_code(workplace: Path, invoke: Invoke) -> None:
    invoke("cubemap gray.png -o faces")
    for path in Path("faces").iterdir():
        codes = read_image(path, color=False).pixels * np.float32(255)
        np.testing.assert_allclose(codes, 100, atol=1e-3)


def test_a_panorama_there_and_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, invoke: Invoke
) -> None:
    monkeypatch.chdir(tmp_path)
    y, x = np.mgrid[:256, :512] * (np.pi / 256)
    sky = 0.5 + 0.1 * sum(np.sin(y) ** 4 * np.sin(n * x) * np.sin(n * y) for n in (3, 8, 40, 100))
    write_image(np.repeat(sky[..., None], 3, axis=2).astype(np.float32), "sky.png", color=False)
    invoke("cubemap sky.png -o faces --size 256")
    invoke("cubemap faces -o back.png --size 256")
    earth, back = (read_image(path, color=False).pixels for path in ("sky.png", "back.png"))

    def error(down: int, right: int) -> float:
        moved = np.roll(back, (down, right), axis=(0, 1))
        return float(np.sqrt(np.mean((moved - earth) ** 2)))

    # Softened by two resamplings, but not moved: a texel to either side it is equally less similar.
    for step in (1, 0), (0, 1):
        there, here = error(*step), error(-step[0], -step[1])
        assert error(0, 0) < 0.8 * min(there, here)
        assert abs(there - here) < 0.02 * there
