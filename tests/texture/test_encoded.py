"""Images as the bytes of a file."""

import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.mesh.files.conversion import media_type
from texbake.texture.image import decode_image
from texbake.texture.image_files import ENCODINGS, encode_image

RAMP = np.linspace(0, 255, 64)
SMOOTH = np.stack(np.broadcast_arrays(RAMP[:, None], RAMP, 255.0 - RAMP, RAMP[:, None]), axis=2)
CODES = np.rint(SMOOTH).astype(np.uint8)


@pytest.mark.parametrize("encoding", sorted(ENCODINGS))
@pytest.mark.parametrize("n", [3, 4])
def test_every_encoding_comes_back(encoding: str, n: int) -> None:
    data = encode_image(CODES[..., :n], encoding)
    has_alpha = n == 4 and encoding == "jpeg"
    assert media_type(data) == ("image/png" if has_alpha else f"image/{encoding}")
    back = np.rint(255 * decode_image(data, "image", color=False).pixels)
    apart = np.abs(back - CODES[..., :n])
    if media_type(data) == "image/png":
        assert not apart.any()
    assert apart.mean() < 1.5  # of 255, for a smooth picture at quality 90
    assert data == encode_image(CODES[..., :n], encoding)


def test_formats_that_are_not_written_are_named() -> None:
    with pytest.raises(OptionError, match="'ktx2' is not known; use webp, jpeg, png"):
        encode_image(CODES, "ktx2")
