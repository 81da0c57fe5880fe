"""Child processes end with their parent, also while they cannot run Python."""

import subprocess
import sys

import pytest

# A loop in C that keeps the interpreter, as a library does that hangs.
CHILD = """
import collections, itertools, sys
from texbake.core.signal_watch import end_with_parent

end_with_parent()
print("ready", flush=True)
collections.deque(itertools.repeat(0), maxlen=0)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there, pipes do not tell")
@pytest.mark.parametrize("sent", [b"", b"a request that nobody reads"])
def test_a_child_ends_with_the_pipe_from_its_parent(sent: bytes) -> None:
    pipe = subprocess.PIPE
    child = subprocess.Popen([sys.executable, "-P", "-c", CHILD], stdin=pipe, stdout=pipe)
    try:
        assert child.stdin is not None and child.stdout is not None
        child.stdin.write(sent)
        child.stdin.flush()
        assert child.stdout.readline() == b"ready\n"
        with pytest.raises(subprocess.TimeoutExpired):
            child.wait(0.5)
        child.stdin.close()
        assert child.wait(30) == 1
    finally:
        child.kill()
        child.wait()
        child.stdout.close()
