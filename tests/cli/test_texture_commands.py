"""Baking, packing and converting textures, as a person runs the commands."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result

from texbake import read_image, read_mesh, write_image, write_mesh
from texbake.mesh.shapes import plane
from texbake.metadata import CONVENTION, DISPLACEMENT_SCALE

Invoke = Callable[..., Result]


@pytest.fixture
def shop(workplace: Path) -> Path:
    """The workplace with images, a plane and cameras."""
    write_image(np.full((16, 24, 3), (1.0, 0.0, 0.0)), "red.png", color=True)
    y, x = np.mgrid[:32, :32] / 32
    hill = 0.5 + 0.25 * np.sin(2 * np.pi * x) * np.cos(2 * np.pi * y)
    write_image(hill, "hill.png", bits=16)
    write_image(np.full((16, 16, 3), (0.5, 0.5, 1.0)), "normal.png", bits=16)
    write_mesh(plane(), "plane.obj")
    Path("front.toml").write_text("position = [0, 0, 4]\ntarget = [0, 0, 0]\nfov = 45\n")
    # Looks along +z, in parallel: s = (1 - x) / 2, t = (y + 1) / 2.
    Path("back.txt").write_text("-0.5 0 0 0.5  0 0.5 0 0.5  0 0 1 1  0 0 0 1")
    return workplace


def test_a_photograph_covers_the_faces_in_view(shop: Path, invoke: Invoke) -> None:
    invoke(
        "bake-texture low.obj -o t.png --photo red.png --camera front.toml --size 64 --fill none "
        "--feather 0 --report r.json"
    )
    figures = json.loads(Path("r.json").read_text())
    assert 0 < figures["texels_unseen"] < figures["texels_covered"]
    colors = read_image("t.png", color=True).pixels
    assert set(map(tuple, colors.reshape(-1, 3))) == {(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)}


def test_colors_are_srgb(shop: Path, invoke: Invoke) -> None:
    invoke("bake-texture low.obj -o t.png --procedure noise --colors #336699 --size 16")
    codes = read_image("t.png", color=False).pixels * 255
    np.testing.assert_allclose(codes, np.broadcast_to((0x33, 0x66, 0x99), codes.shape), atol=1e-4)


def test_packed_texels_keep_their_codes(shop: Path, invoke: Invoke) -> None:
    rng = np.random.default_rng(0)
    deep = rng.integers(0, 65536, (20, 12, 3)).astype(np.uint16)
    for name, codes in (
        ("deep", deep),
        ("flat", rng.integers(0, 256, (9, 30, 3)).astype(np.uint8)),
    ):
        write_image(codes, f"{name}.png", color=True)
    invoke("pack-textures deep.png -o a.png --padding 3")
    codes = np.rint(read_image("a.png", color=False).pixels * 65535).astype(int)
    np.testing.assert_array_equal(codes[3:23, 3:15], deep)
    invoke("pack-textures flat.png -o b.png --padding 0 --size 30x9")
    flat = (read_image(name, color=False).pixels for name in ("flat.png", "b.png"))
    np.testing.assert_array_equal(*flat)


def test_packed_meshes_are_moved(shop: Path, invoke: Invoke) -> None:
    invoke(
        "pack-textures red.png hill.png -o a.png --mesh plane.obj --mesh low.obj --meshes-to out"
    )
    moved = read_mesh("out/plane.obj")
    assert moved.uvs is not None
    extent = np.ptp(moved.uvs, axis=0) * read_image("a.png", color=True).pixels.shape[1::-1]
    np.testing.assert_allclose(extent, (24, 16), atol=1e-4)


def test_heights_come_back_through_files(shop: Path, invoke: Invoke) -> None:
    """Heights to normals to heights: each file records how the next command must read it."""
    invoke("height-to-normal hill.png -o n.png --scale 0.2 --width 1 --convention directx")
    assert read_image("n.png", color=False).metadata[CONVENTION] == "directx"
    invoke("normal-to-height n.png -o h.png --width 1")
    found = read_image("h.png", color=False)
    scale = found.metadata[DISPLACEMENT_SCALE]
    assert isinstance(scale, float)
    y, x = np.mgrid[:32, :32] / 32
    hill = 0.2 * 0.25 * np.sin(2 * np.pi * x) * np.cos(2 * np.pi * y)
    # The wave of 32 texels comes back as cos²(pi / 32) = 0.990 of itself.
    kept = np.cos(np.pi / 32) ** 2
    heights = found.pixels[..., 0] * scale
    np.testing.assert_allclose(heights - heights.mean(), kept * hill, atol=2e-5)
    invoke("height-to-normal h.png -o again.png --convention directx")
    first, again = (read_image(f"{name}.png", color=False).pixels for name in ("n", "again"))
    assert np.abs(first - again).max() < 0.01


def test_a_photograph_lies_where_the_mesh_unwrapped_onto_it_says(
    shop: Path, invoke: Invoke
) -> None:
    """A photograph that is red as it goes right and green as it goes up, at (v, 1 - u)."""
    steps = (np.arange(32) + 0.5) / 32
    s, t = np.meshgrid(steps, steps[::-1])
    write_image(np.stack([s, t, np.zeros_like(s)], axis=2), "photo.png", color=True)
    mesh = plane()
    assert mesh.uvs is not None
    turned = np.stack([mesh.uvs[:, 1], 1.0 - mesh.uvs[:, 0]], axis=1)
    write_mesh(mesh.replace(uvs=turned), "turned.obj")
    invoke("bake-texture plane.obj -o t.png --photo photo.png --photo-uvs turned.obj --size 32")
    baked = read_image("t.png", color=True).pixels[1:-1, 1:-1, :3]
    u, v = (part[1:-1, 1:-1] for part in np.meshgrid(steps, steps[::-1]))
    # Two roundings to codes, which lie at most 0.009 of linear light apart.
    np.testing.assert_allclose(baked, np.stack([v, 1.0 - u, 0.0 * u], axis=2), atol=0.01)
