"""Commands killed at any moment: files are old or new, and the next run gives the same bytes."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from writing_commands import LINES, contents, make_inputs

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")

N_KILLS = int(os.environ.get("TEXBAKE_KILLS", "4"))
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)


def start(script: Path, line: str, scratch: Path) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [script, *line.split(), "--quiet"],
        env={**os.environ, "TMPDIR": str(scratch)},
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


@pytest.mark.parametrize("name", ["split-channels", "unwrap several"])
def test_killed_commands(name: str, workplace: Path, script: Path, tmp_path_factory) -> None:  # type: ignore[no-untyped-def]
    """`TEXBAKE_KILLS=100` kills each command that often."""
    make_inputs(workplace)
    inputs = contents(workplace)
    (line,) = LINES[name]
    scratch = tmp_path_factory.mktemp("scratch")
    began = time.monotonic()
    assert start(script, line, scratch).wait() == 0
    seconds = time.monotonic() - began
    new = contents(workplace)
    old = {**dict.fromkeys(new, b"older"), **inputs}
    luck = random.Random(16)
    for kill in range(N_KILLS):
        for file in new.keys() - inputs.keys():
            (workplace / file).write_bytes(b"older")
        process = start(script, line, scratch)
        time.sleep(luck.uniform(0.2, 1.0) * seconds)
        number = SIGNALS[kill % len(SIGNALS)]
        process.send_signal(number)
        code = process.wait(timeout=60)
        found = contents(workplace)
        if code == 0:  # it was over before
            assert found == new
        elif number == signal.SIGKILL:
            assert all(found[file] in (old[file], new[file]) for file in new)
        else:
            assert found == old and not list(scratch.iterdir())
    assert start(script, line, scratch).wait() == 0
    assert contents(workplace) == new
    assert not list(scratch.iterdir())
