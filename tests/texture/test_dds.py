"""DDS files, decoded by OpenImageIO, which shares no code with the encoder."""

import sys

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
from skimage.data import astronaut

from texbake.errors import DependencyError, FileFormatError, OptionError
from texbake.texture.dds import BLOCK_FORMATS, write_dds
from texbake.texture.encoding import decode_srgb
from texbake.texture.mipmaps import mip_chain


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.dds"


@pytest.fixture(scope="module")
def photo():
    return decode_srgb(astronaut()[:256, :128] / 255.0).astype(np.float32)


def decoded_levels(path):
    """Codes of every level, decoded by OpenImageIO."""
    source = oiio.ImageInput.open(str(path))
    levels = []
    while source.seek_subimage(0, len(levels)):
        levels.append(source.read_image(0, len(levels), 0, source.spec().nchannels, "uint8"))
    return levels


def psnr(codes, others):
    return 10 * np.log10(255**2 / np.mean((codes.astype(float) - others) ** 2))


# dB that the encoders reach on a photograph, less 1: 4, 8 and 8 bits per texel.
@pytest.mark.parametrize(("block_format", "least"), [("bc1", 31), ("bc3", 31), ("bc7", 42)])
def test_colors_come_back(path, photo, block_format, least):
    write_dds(photo, path, block_format=block_format)
    codes = decoded_levels(path)[0][..., :3]
    assert psnr(codes, astronaut()[:256, :128]) > least


def test_every_level_is_that_of_the_mip_chain(path, photo):
    write_dds(photo, path, block_format="bc7")
    chain = mip_chain(photo, wrap="clamp")
    levels = decoded_levels(path)
    assert [level.shape[:2] for level in levels] == [tuple(size) for size in chain.sizes]
    for i, level in enumerate(levels):
        linear = decode_srgb(level[..., :3] / 255.0)
        assert np.abs(linear.mean(axis=(0, 1)) - chain.level(i).mean(axis=(0, 1))).max() < 0.01


@pytest.mark.parametrize("block_format", ["bc4", "bc7"])
def test_a_constant_comes_back_exactly(path, block_format):
    for code in 0, 1, 127, 128, 254, 255:
        values = np.full((8, 8, 1), code / 255, np.float32)
        write_dds(values, path, block_format=block_format, kind="data")
        for level in decoded_levels(path):
            # BC7's end points have 7 bits and one that all channels share, with an opaque alpha.
            assert np.abs(level[..., 0].astype(int) - code).max() <= (block_format == "bc7")


def test_normals_keep_x_and_y_in_either_convention(path):
    y, x = np.mgrid[:64, :64] / 64 * 2 * np.pi
    normals = np.stack([0.4 * np.cos(x), 0.3 * np.sin(y), np.ones_like(x)], -1).astype(np.float32)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    for convention, sign in (("opengl", 1), ("directx", -1)):
        write_dds(normals, path, block_format="bc5", kind="normal", convention=convention)
        found = decoded_levels(path)[0] / 127.5 - 1.0
        # Of a block's 8 steps, here at most 0.02 wide each.
        assert np.abs(found[..., :2] - normals[..., :2] * [1, sign]).max() < 0.02


@pytest.mark.parametrize("block_format", BLOCK_FORMATS)
def test_sizes_of_files_are_those_of_their_blocks(path, block_format):
    form = BLOCK_FORMATS[block_format]
    kind = "color" if form.dxgi_srgb else "data"
    write_dds(np.zeros((8, 16, 1), np.float32), path, block_format=block_format, kind=kind)
    # 16 x 8, 8 x 4, 4 x 2, 2 x 1 and 1 x 1 texels: 8, 2, 1, 1, 1 blocks behind 148 bytes.
    assert path.stat().st_size == 148 + 13 * form.block_bytes
    header = np.frombuffer(path.read_bytes()[:148], "<u4")
    assert (header[0], header[3], header[4], header[7]) == (0x20534444, 8, 16, 5)
    assert header[32] == (form.dxgi_srgb if kind == "color" else form.dxgi)


def test_values_that_blocks_cannot_hold_are_an_error(tmp_path, path, monkeypatch):
    pixels = np.zeros((6, 8, 3), np.float32)
    with pytest.raises(OptionError, match="8 x 6 cannot be block-compressed"):
        write_dds(pixels, path, block_format="bc7")
    with pytest.raises(OptionError, match="bc5 cannot store colors"):
        write_dds(pixels[:4], path, block_format="bc5")
    with pytest.raises(OptionError, match="'astc' is not known"):
        write_dds(pixels[:4], path, block_format="astc")
    with pytest.raises(FileFormatError, match=r"give a \.dds name"):
        write_dds(pixels[:4], tmp_path / "a.png", block_format="bc7")
    monkeypatch.setitem(sys.modules, "etcpak", None)
    with pytest.raises(DependencyError, match=r"texbake\[dds\]"):
        write_dds(pixels[:4], path, block_format="bc7")
    assert not list(tmp_path.iterdir())
