"""Compile the core: with the compiler that is there, else with the one of `ziglang` from PyPI.

    python texbake/core/compile_core.py        into this folder, for this machine
    python texbake/core/compile_core.py --sanitize --folder build
                                               with AddressSanitizer and UndefinedBehaviorSanitizer
    python texbake/core/compile_core.py --strict --folder build
                                               with warnings as errors
    python texbake/core/compile_core.py --fuzz --folder build
                                               by clang, also counting branches for libFuzzer

The build backend (`backend.py`) calls it as well. It uses nothing but the standard library, since
it runs before anything is installed.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from builds import FOLDER, library_name, sources_checksum

# No fused multiply-adds and nothing reordered: every build gives the same bytes. Without errno and
# traps, loops with square roots and conditions can use vector instructions; no result changes.
# The compiler warns of large stack frames, because a thread may have only 256 KiB: use an arena.
FLAGS = (
    "-std=c17", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math", "-fPIC",
    "-fvisibility=hidden", "-Wall", "-Wextra", "-Wno-unknown-pragmas", "-Wframe-larger-than=16384",
    "-g0",  # zig writes symbols for a debugger otherwise, which are two thirds of a library
)  # fmt: skip
SANITIZER_FLAGS = (
    "-std=c17", "-O2", "-g", "-ffp-contract=off", "-fPIC", "-fvisibility=hidden",
    "-fsanitize=address,undefined", "-fno-sanitize=vla-bound", "-fno-sanitize-recover=undefined",
    "-fno-omit-frame-pointer",
)  # fmt: skip
# zig links these sanitizers into the library, where libFuzzer has its own; so by zig, none.
FUZZER_FLAGS = (*SANITIZER_FLAGS, "-fsanitize=fuzzer-no-link,float-cast-overflow")
FUZZER_FLAGS_OF_ZIG = (*FLAGS, "-g", "-fno-sanitize=undefined", "-fsanitize=fuzzer-no-link")


_DECLARATION = re.compile(r"^EXPORT (\w+ \w+\([^(){};]*\))", re.MULTILINE)


@dataclass(frozen=True)
class Target:
    """A machine to compile for: its processor, its system, and how its wheels are tagged."""

    machine: str
    system: str
    zig_target: str
    wheel_tag: str

    @property
    def levels(self) -> tuple[str, ...]:
        """Levels of instructions that are worth a build of their own, from the least."""
        return ("x86-64-v2", "x86-64-v3") if self.machine == "x86_64" else ("arm64",)

    @property
    def suffix(self) -> str:
        """Ending of a shared library's name."""
        return {"windows": ".dll", "macos": ".dylib"}.get(self.system, ".so")


TARGETS = (
    Target("x86_64", "linux", "x86_64-linux-gnu.2.17", "manylinux2014_x86_64"),
    Target("aarch64", "linux", "aarch64-linux-gnu.2.17", "manylinux2014_aarch64"),
    Target("x86_64", "windows", "x86_64-windows-gnu", "win_amd64"),
    Target("x86_64", "macos", "x86_64-macos.11.0", "macosx_11_0_x86_64"),
    Target("aarch64", "macos", "aarch64-macos.11.0", "macosx_11_0_arm64"),
)


def this_machine() -> Target:
    """Return the target that is the machine this runs on."""
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower())
    machine = machine or platform.machine().lower()
    system = {"win32": "windows", "darwin": "macos"}.get(sys.platform, "linux")
    for target in TARGETS:
        if (target.machine, target.system) == (machine, system):
            return target
    raise SystemExit(f"texbake: there is no build of the core for {machine} on {system}")


def find_compiler() -> list[str] | None:
    """Return the command of an installed compiler, or None."""
    named = os.environ.get("CC", "").split()
    if named and not shutil.which(named[0]):
        raise SystemExit(f"CC: there is no program '{named[0]}'; name a C compiler, or unset CC")
    if named:
        return named
    return next(([name] for name in ("cc", "gcc", "clang") if shutil.which(name)), None)


def zig_compiler() -> list[str]:
    """Return the command of the compiler in the package `ziglang`."""
    if importlib.util.find_spec("ziglang") is None:
        raise SystemExit("texbake: there is no C compiler, and the package ziglang is missing")
    return [sys.executable, "-m", "ziglang", "cc"]


def declarations() -> str:
    """Return the declarations of all functions that are marked EXPORT, one per line."""
    sources = (path.read_text(encoding="utf-8") for path in sorted(FOLDER.glob("*.c")))
    found = (" ".join(text.split()) for each in sources for text in _DECLARATION.findall(each))
    return "".join(f"{each};\n" for each in found)


def build_for_fuzzer(folder: Path) -> Path:
    """Compile the core with branches counted, by clang or else by zig; return the library."""
    is_there = shutil.which("clang") is not None
    compiler = ["clang"] if is_there else zig_compiler()
    flags = list(FUZZER_FLAGS if is_there else FUZZER_FLAGS_OF_ZIG)
    library = folder / f"core-fuzz{this_machine().suffix}"
    return _build_library(library, this_machine(), compiler, flags, link_sanitizers=False)


def build(
    folder: Path, target: Target | None = None, *, sanitize: bool = False, strict: bool = False
) -> list[Path]:
    """Compile the core into a folder; return its libraries, one per level of instructions.

    Parameters
    ----------
    target
        A machine to cross-compile for, with zig; None for this one, with its own compiler.

    Raises
    ------
    SystemExit
        A file does not compile.
    """
    here = target is None
    target = target or this_machine()
    compiler = (find_compiler() if here else None) or [
        *zig_compiler(),
        "-target",
        target.zig_target,
    ]
    if sanitize:
        library = folder / f"core-sanitized{target.suffix}"
        return [_build_library(library, target, compiler, list(SANITIZER_FLAGS))]
    checksum = sources_checksum()
    libraries = []
    for level in target.levels:
        flags = [*FLAGS, *_tuning(compiler, level), *(["-Werror"] if strict else [])]
        library = folder / library_name(level, checksum, target.suffix)
        libraries.append(_build_library(library, target, compiler, flags))
    return libraries


def remove_others(libraries: list[Path]) -> None:
    """Remove builds of other sources or for other machines from the folder of these."""
    for stale in set(libraries[0].parent.glob("core-*")) - set(libraries):
        with suppress(OSError):  # on Windows, a build may be in use
            stale.unlink()


def _tuning(compiler: list[str], level: str) -> list[str]:
    """Options for a level; without FMA, as GCC 12 fuses in spite of `-ffp-contract=off`."""
    if level == "arm64":
        return []
    tuned = f"-mcpu={level.replace('-', '_')}" if "ziglang" in compiler else f"-march={level}"
    return [tuned, "-mno-fma"]


def _build_library(
    library: Path,
    target: Target,
    compiler: list[str],
    flags: list[str],
    *,
    link_sanitizers: bool = True,
) -> Path:
    with tempfile.TemporaryDirectory() as scratch:
        table = Path(scratch) / "declarations.c"
        lines = "\n".join(f'"{line}\\n"' for line in declarations().splitlines())
        table.write_text(f'#include "core.h"\nEXPORT const char declarations[] =\n{lines};\n')
        sources = [*sorted(FOLDER.glob("*.c")), table]
        objects = [Path(scratch) / f"{source.stem}.o" for source in sources]
        commands = [
            [*compiler, *flags, f"-I{FOLDER}", "-c", str(source), "-o", str(made)]
            for source, made in zip(sources, objects, strict=True)
        ]
        with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
            list(pool.map(_run, commands))
        # Linked beside its place and renamed, so that a process that has it loaded keeps its own.
        unfinished = Path(scratch) / library.name
        sanitizers = [flag for flag in flags if flag.startswith("-fsanitize=") and link_sanitizers]
        maths = [] if target.system == "windows" else ["-lm"]
        names = [str(path) for path in objects]
        _run([*compiler, "-shared", *sanitizers, *names, *maths, "-o", str(unfinished)])
        beside = library.with_suffix(f"{library.suffix}.new")
        shutil.copy(unfinished, beside)
        beside.replace(library)
    return library


def _run(command: list[str]) -> None:
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    if finished.returncode:
        raise SystemExit(
            f"texbake: the core does not compile: {' '.join(command)}\n{finished.stderr}"
        )
    if finished.stderr:
        print(finished.stderr, file=sys.stderr)


def main() -> None:
    """Compile the core for this machine, beside its sources."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--sanitize", action="store_true", help="with sanitizers, for the tests")
    parser.add_argument("--strict", action="store_true", help="with warnings as errors")
    parser.add_argument("--fuzz", action="store_true", help="with counted branches, for a fuzzer")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where the library goes")
    options = parser.parse_args()
    if options.fuzz:
        print(build_for_fuzzer(options.folder))
        return
    libraries = build(options.folder, sanitize=options.sanitize, strict=options.strict)
    print(*libraries, sep="\n")
    if options.folder == FOLDER:
        remove_others(libraries)


if __name__ == "__main__":
    main()
