"""Standard streams that are closed or full."""

from __future__ import annotations

import os
import sys
from types import TracebackType


def open_closed_streams() -> None:
    """Give closed standard streams the null device.

    Otherwise the next file that is opened takes the number of stderr, and messages go into it.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # The null device takes the lowest number that is free, which is this one.
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    if sys.stderr is None:
        sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115


def close_stdout() -> None:
    """Discard text that cannot be printed; Python would report the error once more at exit."""
    if sys.stdout is None:  # closed before the process began
        return
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def is_of_click(error: OSError) -> bool:
    """Whether click could not print, such as its help; commands print with lines of their own."""
    place: TracebackType | None = error.__traceback__
    while place is not None and place.tb_next is not None:
        place = place.tb_next
    return place is not None and place.tb_frame.f_globals["__name__"].startswith("click.")
