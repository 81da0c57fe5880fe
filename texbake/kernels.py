"""How kernels are compiled: to run without the GIL, and once per machine if the disk allows it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import cfunc, njit


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function with numba when it is first called, and cache the machine code on disk.

    The function runs without the GIL, so that `run_bands` can run it on several threads. Numba's
    own parallel mode is not used, since it takes several times longer to compile. If the cache
    cannot be written, or the disk is full, the function is compiled again in each process.
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
    """Compile a function for native code to call back, at once; cached on disk if possible."""

    def compile_callback(function: Callable[..., Any]) -> Any:
        try:
            return cfunc(signature, cache=True)(function)
        except (RuntimeError, OSError):
            return cfunc(signature)(function)

    return compile_callback
