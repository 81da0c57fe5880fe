"""One quick study of every knob, for all tests that look at what a study gives."""

import pytest

from texbake.study.options import StudyOptions
from texbake.study.study import run_study


@pytest.fixture(scope="session")
def quick_study():
    return run_study(options=StudyOptions(quick=True, repeats=1))
