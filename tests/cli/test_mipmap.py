"""`texbake mipmap`: levels as files and as a picture, of colors and of normals; wrong usage."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result

from texbake import read_image, write_image

Invoke = Callable[..., Result]


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A current folder with colors, normals and a gray image."""
    codes = np.random.default_rng(0).integers(0, 256, (8, 12, 3)).astype(np.uint8)
    write_image(codes, tmp_path / "wood.png", color=True)
    write_image(codes, tmp_path / "normal.png")
    write_image(codes[..., 0], tmp_path / "gray.png")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_level_is_written(workplace: Path, invoke: Invoke) -> None:
    result = invoke("mipmap wood.png -o levels")
    assert result.stdout.splitlines() == [f"wrote levels/wood_{index}.png" for index in range(4)]
    sizes = [read_image(f"levels/wood_{i}.png", color=True).pixels.shape[:2] for i in range(4)]
    assert sizes == [(8, 12), (4, 6), (2, 3), (1, 1)]
    first = read_image("levels/wood_0.png", color=True).pixels
    np.testing.assert_array_equal(first, read_image("wood.png", color=True).pixels)


def test_levels_in_one_picture(workplace: Path, invoke: Invoke) -> None:
    assert invoke("mipmap wood.png -o all.png --filter kaiser --wrap clamp -q").stdout == ""
    assert read_image("all.png", color=True).pixels.shape == (8, 18, 3)


def test_roughness_of_normals(workplace: Path, invoke: Invoke) -> None:
    invoke("mipmap normal.png -o levels.tif --kind normal --roughness rough")
    rough = [read_image(f"rough/normal_roughness_{i}.png", color=False).pixels for i in range(4)]
    assert rough[0].max() < 0.05  # every texel alone is smooth
    assert rough[3].min() > 0.9  # noise in all directions is not
