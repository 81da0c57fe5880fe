"""One quick bench of all tasks on one case, for all tests that look at what the bench gives."""

import pytest

from texbake.study.bench.options import BenchOptions
from texbake.study.bench.run import run_bench


@pytest.fixture(scope="session")
def quick_bench():
    options = BenchOptions(
        quick=True, cases=("two-parts",), programs=("texbake", "xatlas", "blender"), blender="none"
    )
    return run_bench(options=options)
