"""EXR files whose headers have very many parts; for JPEG files see `tests/test_limits.py`."""

import struct

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest

from texbake.errors import FileFormatError
from texbake.texture.costly_images import require_few_attributes
from texbake.texture.image import read_image, write_image


def attribute(name, kind, data):
    return name + b"\0" + kind + b"\0" + struct.pack("<i", len(data)) + data


def exr_of(attributes, parts=1):
    """The head of a file with these attributes in each of its parts."""
    header = b"".join(attributes) + b"\0"
    return b"\x76\x2f\x31\x01" + struct.pack("<I", 2 if parts == 1 else 0x1002) + header * parts


@pytest.mark.parametrize("parts", [1, 5])
def test_very_many_attributes_are_an_error(tmp_path, parts):
    names = (f"a{i}".encode() for i in range(10_010 // parts))
    (tmp_path / "a.exr").write_bytes(exr_of([attribute(n, b"int", bytes(4)) for n in names], parts))
    with pytest.raises(FileFormatError, match="more than 10,000 attributes"):
        read_image(tmp_path / "a.exr", color=False)


def test_very_many_channels_are_an_error(tmp_path):
    channels = b"".join(f"c{i}".encode() + b"\0" + bytes(16) for i in range(20_000)) + b"\0"
    (tmp_path / "a.exr").write_bytes(exr_of([attribute(b"channels", b"chlist", channels)]))
    with pytest.raises(FileFormatError, match="too many channels"):
        read_image(tmp_path / "a.exr", color=False)


def test_a_header_of_many_bytes_and_attributes_is_read(tmp_path):
    image = np.random.default_rng(0).random((4, 5, 3), dtype=np.float32)
    write_image(image, tmp_path / "a.exr", bits=32)
    source = oiio.ImageBuf(str(tmp_path / "a.exr"))
    for i in range(300):
        source.specmod().attribute(f"note{i}", "x" * 2000)
    source.write(str(tmp_path / "b.exr"))
    assert (read_image(tmp_path / "b.exr", color=False).pixels == image).all()


def test_what_follows_the_header_is_none(tmp_path):
    """Pixels may look like attributes."""
    pixels = attribute(b"a", b"b", b"") * 20_000
    (tmp_path / "a.exr").write_bytes(exr_of([attribute(b"a", b"int", bytes(4))]) + pixels)
    require_few_attributes(tmp_path / "a.exr")


@pytest.mark.parametrize("content", [b"", b"\0" * 50, b"a\0int\0\xff\xff\xff\xff", b"a" * 5000])
def test_what_is_no_header_is_no_image(tmp_path, content):
    (tmp_path / "a.exr").write_bytes(b"\x76\x2f\x31\x01\x02\0\0\0" + content)
    with pytest.raises(FileFormatError, match="it is not an image"):
        read_image(tmp_path / "a.exr", color=False)
