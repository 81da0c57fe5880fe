"""Builds of the core: in this folder, in the installed package, or in a cache.

The name of a build has the level of instructions and the checksum of its sources:
`core-x86-64-v3-0123abcd.so`. A checkout uses no build of other sources, because their results could
differ: it looks in its own folder, then in the installed package, and otherwise compiles one into
the cache.

`compile_core.py` imports this before anything is installed.
"""

from __future__ import annotations

import os
import sys
import zlib
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

FOLDER = Path(__file__).resolve().parent
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
_COMPILERS = ("builds.py", "compile_core.py")
_KEPT = 16  # files in the cache: the builds of the eight checkouts used last


class BuildError(Exception):
    """The core does not compile; the message is one line."""


def sources_checksum(folder: Path = FOLDER) -> str:
    """Return a checksum of all files that a build is made from; "" if there are no sources."""
    sources = sorted(folder.glob("*.[ch]"))
    if not sources:
        return ""
    checksum = 0
    for path in [*sources, *(folder / name for name in _COMPILERS)]:
        checksum = zlib.crc32(path.read_bytes(), zlib.crc32(path.name.encode(), checksum))
    return f"{checksum:08x}"


def library_name(level: str, checksum: str, suffix: str = SUFFIX) -> str:
    """Return the file name of a build."""
    return f"core-{level}-{checksum}{suffix}"


def find_builds() -> dict[str, Path]:
    """Return the builds of these sources by level; empty in a damaged installation."""
    checksum = sources_checksum()
    if not checksum:
        return _builds_in(FOLDER, "*")
    installed = [Path(entry) / "texbake" / "core" for entry in sys.path]
    for folder in (FOLDER, *installed):
        if built := _builds_in(folder, checksum):
            return built
    try:
        return _cached_builds(cache_folder(), checksum)
    except OSError as error:
        raise BuildError(f"{cache_folder()}: {error.strerror}") from error


def cache_folder() -> Path:
    """Return the folder in which builds of checkouts are kept."""
    home = Path.home()
    if sys.platform == "win32":
        caches = Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    elif sys.platform == "darwin":
        caches = home / "Library" / "Caches"
    else:
        caches = Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache")
    return caches / "texbake"


def _builds_in(folder: Path, checksum: str) -> dict[str, Path]:
    built = folder.glob(library_name("*", checksum))
    return {path.stem.removeprefix("core-").rpartition("-")[0]: path for path in built}


def _cached_builds(folder: Path, checksum: str) -> dict[str, Path]:
    """Return builds in the cache; the first process that needs them compiles them."""
    if not _builds_in(folder, checksum):
        from filelock import FileLock

        folder.mkdir(parents=True, exist_ok=True)
        with FileLock(folder / "lock"):
            if not _builds_in(folder, checksum):
                _compile(folder)
                _remove_oldest(folder)
    built = _builds_in(folder, checksum)
    for path in built.values():
        with suppress(OSError):
            os.utime(path)  # marks it as used now
    return built


def _compile(folder: Path) -> None:
    import subprocess  # takes 1 % of the processor time of a short command

    print(f"texbake: compiling the core for {FOLDER.parents[1]}, once", file=sys.stderr)
    with TemporaryDirectory(dir=folder) as unfinished:  # all levels appear together
        command = [sys.executable, str(FOLDER / "compile_core.py"), "--folder", unfinished]
        done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        if done.returncode:
            first, _, more = done.stderr.strip().partition("\n")
            if more:
                print(more, file=sys.stderr)
            raise BuildError(first.removeprefix("texbake: "))
        for path in Path(unfinished).iterdir():
            path.replace(folder / path.name)


def _remove_oldest(folder: Path) -> None:
    built = sorted(folder.glob("core-*"), key=lambda path: path.stat().st_mtime, reverse=True)
    for path in built[_KEPT:]:
        with suppress(OSError):  # on Windows, a build may be in use
            path.unlink()
