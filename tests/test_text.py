import numpy as np

from texbake.text import text_coverage


def test_a_line_is_cropped_to_its_ink() -> None:
    ink = text_coverage("1001", 32)
    assert ink.dtype == np.float32
    assert (ink.min(), ink.max()) == (0.0, 1.0)
    for border in ink[0], ink[-1], ink[:, 0], ink[:, -1]:
        assert border.max() > 0.0
    assert 16 < len(ink) < 32  # a digit is about 3/4 of the size
    assert ink.shape[1] > ink.shape[0]
