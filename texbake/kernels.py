"""How kernels are compiled: without the GIL, once for each machine, whatever the disk allows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import cfunc, njit


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function with numba when it is first called, and keep the machine code on disk.

    It runs without the GIL, so that `run_bands` can run it on several threads, and never in
    numba's own parallel mode, which takes several times longer to compile. Where no folder for the
    machine code can be written to, or its disk is full, it is compiled again in each process.
    """
    try:
        compiled = njit(nogil=True, cache=True, error_model="numpy")(function)
    except RuntimeError:  # numba: no locator available
        return njit(nogil=True, error_model="numpy")(function)
    save = compiled._cache.save_overload

    def save_if_possible(*arguments: Any) -> None:
        try:
            save(*arguments)
        except OSError:
            return

    compiled._cache.save_overload = save_if_possible
    return compiled


def callback(signature: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function that native code calls back, at once; kept on disk where that can be."""

    def compile_callback(function: Callable[..., Any]) -> Any:
        try:
            return cfunc(signature, cache=True)(function)
        except (RuntimeError, OSError):
            return cfunc(signature)(function)

    return compile_callback
