"""Child processes end with the process that started them, however that ends."""

from __future__ import annotations

import ctypes
import signal
import sys

_PARENT_DEATH = 1  # PR_SET_PDEATHSIG of Linux


def end_with_parent() -> None:
    """End this process when the thread that started it ends, also if its process is killed.

    Elsewhere than on Linux, it ends when it next reads from its parent.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PARENT_DEATH, signal.SIGKILL)
