"""The command line: parse, call the library, print."""

import atexit
import gc
import os
import sys
import threading
from contextlib import suppress


def run() -> None:
    """Run the command line; from here on signals end it with one line, also while it imports."""
    from .signals import end_cleanly_on_signals

    # A command makes no garbage while it starts, and the collector takes a 15th of that time.
    gc.set_threshold(100_000)
    open_closed_streams()  # before pipes could take their numbers
    end_cleanly_on_signals()
    try:
        from .main import texbake
    except ModuleNotFoundError as error:
        sys.exit(f"texbake: {error.name} is missing; install it with: pip install click rich")

    try:
        texbake(prog_name="texbake")
    except SystemExit as end:
        close_stdout()
        end_at_once(end.code)
        raise
    finally:
        close_stdout()


def open_closed_streams() -> None:
    """Give closed standard streams the null device, or files would take their numbers."""
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


def end_at_once(code: object) -> None:
    """End the process with a numeric `code`, without unloading modules, which takes long."""
    if isinstance(code, int | None):
        threading._shutdown()  # type: ignore[attr-defined]
        atexit._run_exitfuncs()
        with suppress(OSError, ValueError):
            sys.stderr.flush()
        os._exit(code or 0)
