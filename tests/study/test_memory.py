"""Peak memory of work whose size is known."""

import numpy as np

from texbake.study.memory import with_peak_memory

MB = 1 << 20


def test_peak_memory_is_what_the_work_took_at_most():
    def work():
        large = np.ones(64 * MB, np.uint8)
        total = int(large[:: 64 * MB - 1].sum())
        del large
        return total

    result, peak = with_peak_memory(work)
    assert result == 2
    # Where Linux tells it: the array, and little beside it.
    assert peak is None or 60 * MB < peak < 80 * MB


def test_an_earlier_peak_is_forgotten():
    _, large = with_peak_memory(lambda: np.ones(64 * MB, np.uint8).sum())
    _, small = with_peak_memory(lambda: np.ones(4 * MB, np.uint8).sum())
    if large is not None:
        assert small < large / 4
