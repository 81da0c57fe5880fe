"""The library that is loaded: which build, and what happens without one."""

import os
import subprocess
import sys
from functools import cache

import numpy as np
import pytest

from texbake.core import builds, core, library
from texbake.core.builds import SUFFIX, find_builds
from texbake.core.library import load_library
from texbake.errors import DependencyError


def test_an_unknown_function_is_an_attribute_error():
    with pytest.raises(AttributeError, match=r"the core has no function 'nothing_of_the_kind'"):
        getattr(core, "nothing_of_the_kind")  # noqa: B009


def test_every_declared_function_is_exported_by_every_build():
    for path in find_builds().values():
        loaded = library._load(path)
        missing = [name for name in core._prototypes if not hasattr(loaded, name)]
        assert missing == [], path.name


def test_without_a_library_the_message_says_what_to_do(monkeypatch, tmp_path):
    monkeypatch.setattr(builds, "FOLDER", tmp_path)
    monkeypatch.setattr(builds, "sources_checksum", lambda: "")
    monkeypatch.delenv("TEXBAKE_CORE", raising=False)
    with pytest.raises(DependencyError, match="install texbake again with: pip install"):
        load_library()


def test_a_level_that_was_not_built_is_an_error(monkeypatch):
    monkeypatch.setenv("TEXBAKE_CORE", "x86-64-v9")
    with pytest.raises(DependencyError, match="there is no build 'x86-64-v9'"):
        load_library()


def test_a_broken_library_is_an_error_of_one_line(monkeypatch, tmp_path):
    broken = tmp_path / f"core-broken{SUFFIX}"
    broken.write_bytes(b"not a library")
    monkeypatch.setenv("TEXBAKE_CORE", str(broken))
    with pytest.raises(DependencyError, match="the compiled core does not load"):
        load_library()


def test_too_much_memory_is_an_error_and_no_crash():
    """An arena that cannot grow goes back to the caller, and the next call works."""
    faces, components = np.array([[0, 1, 2], [3, 4, 5]], np.int32), np.empty(2, np.int32)
    with pytest.raises(MemoryError, match="number_components: not enough memory"):
        core.number_components(1 << 50, faces, components)
    assert core.number_components(6, faces, components) == 2


WHOLE_JOB = """
import hashlib
import sys
import numpy as np
import texbake

threads = int(sys.argv[1])
high = texbake.make("torus", resolution=(96, 48))
low = texbake.unwrap(texbake.make("torus", resolution=(12, 8)), method="atlas", threads=threads)
maps = ("normal", "displacement", "ao")
result = texbake.bake(high, low, texbake.BakeOptions(size=64, maps=maps, threads=threads))
digest = hashlib.sha256(np.ascontiguousarray(low.uvs))
for baked in result.maps.values():
    digest.update(np.ascontiguousarray(baked.values))
print(digest.hexdigest())
"""


@cache
def digest_of_the_whole_job(threads=2, **environment):
    finished = subprocess.run(
        [sys.executable, "-P", "-c", WHOLE_JOB, str(threads)], env={**os.environ, **environment},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert finished.returncode == 0, finished.stderr
    return finished.stdout


@pytest.mark.skipif(not core.has_x86_64_v3(), reason="the processor has a single level")
def test_both_levels_of_instructions_give_the_same_bytes():
    least = digest_of_the_whole_job(TEXBAKE_CORE="x86-64-v2")
    assert least == digest_of_the_whole_job()


def test_any_number_of_threads_gives_the_same_bytes():
    assert len({digest_of_the_whole_job(threads) for threads in (1, 2, 7)}) == 1


IN_A_THREAD = """
import sys
import threading

threading.stack_size(256 << 10)
thread = threading.Thread(target=exec, args=(sys.argv.pop(1), {}))
thread.start()
thread.join()
"""


def test_a_job_runs_in_threads_with_small_stacks():
    command = [sys.executable, "-P", "-c", IN_A_THREAD, WHOLE_JOB, "2"]
    finished = subprocess.run(command, capture_output=True, text=True)
    assert (finished.returncode, finished.stderr) == (0, "")
    assert finished.stdout == digest_of_the_whole_job()
