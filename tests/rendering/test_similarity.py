import math

import numpy as np
import pytest
from skimage.metrics import peak_signal_noise_ratio, structural_similarity as of_skimage

from texbake.rendering.similarity import peak_signal_to_noise, structural_similarity


@pytest.mark.parametrize("shape", [(3, 3), (7, 9), (64, 81), (321, 200)])
@pytest.mark.parametrize("flat", [False, True])
def test_gives_the_bytes_of_scikit_image(shape, flat):
    rng = np.random.default_rng(shape[0])
    first = rng.random((*shape, 3)).astype(np.float32)
    second = np.clip(first + 0.1 * rng.normal(size=first.shape), 0, 1).astype(np.float32)
    if flat:
        first[: shape[0] // 2] = second[: shape[0] // 2] = 0.5
    window = min(7, shape[0])
    _, expected = of_skimage(
        first, second, data_range=1.0, channel_axis=2, full=True, win_size=window
    )
    found = structural_similarity(first, second, window)
    assert found.dtype == expected.dtype
    np.testing.assert_array_equal(found, expected)
    assert peak_signal_to_noise(first, second) == peak_signal_noise_ratio(
        first, second, data_range=1.0
    )


def test_equal_pictures_are_alike():
    picture = np.random.default_rng(1).random((20, 30, 3)).astype(np.float32)
    assert peak_signal_to_noise(picture, picture) == math.inf
    np.testing.assert_allclose(structural_similarity(picture, picture, 7), 1.0, rtol=1e-5)


def test_noise_of_a_known_size_has_a_known_ratio():
    picture = np.full((8, 8, 3), 0.5, np.float32)
    assert peak_signal_to_noise(picture, picture + np.float32(0.25)) == pytest.approx(
        20 * math.log10(4)
    )
