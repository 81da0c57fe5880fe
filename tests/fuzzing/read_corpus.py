"""Reads every input of the corpus by the reader of its format, or by its target.

    python tests/fuzzing/read_corpus.py [FORMAT ...] [--input FILE]

Prints what is wrong with an input, and exits with 1 if anything is. If all formats are read, every
function of the core must have been called in the end. `.ci/sanitize` runs this on a core with
sanitizers.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

HERE = Path(__file__).parent
CORPUS = HERE / "corpus"
sys.path.insert(0, str(HERE))

from core_targets import READ, UNREACHED, unreached  # noqa: E402
from fuzz_files import fault_of  # noqa: E402
from fuzz_formats import Reader  # noqa: E402

from texbake.errors import ReadWarning  # noqa: E402

SECONDS = 10  # of processor time for one input
SLOWDOWN = 10  # of a core with sanitizers


def folder_of(name: str) -> Path:
    """Return the folder with the inputs of a format."""
    return CORPUS / name.replace(" ", "_")


def timed_fault_of(read: Reader, path: Path) -> str | None:
    """Read one file; return what went wrong or that it took too long, or None."""
    limit = SECONDS * (SLOWDOWN if "asan" in os.environ.get("LD_PRELOAD", "") else 1)
    start = time.process_time()
    fault = fault_of(read, path)
    taken = time.process_time() - start
    if fault is None and taken > limit:
        return f"it took more than {limit} s of processor time"
    return fault


def wrong_with_inputs(name: str, inputs: list[Path] | None = None) -> Iterator[str]:
    """Read the inputs of a format; say of each that is at fault what is wrong with it."""
    suffix, make, read = READ[name]
    with tempfile.TemporaryDirectory() as folder:
        make(Path(folder) / f"seed{suffix}")  # and the files that it names
        candidate = Path(folder) / f"mutant{suffix}"
        for path in sorted(folder_of(name).glob("*")) if inputs is None else inputs:
            shutil.copy(path, candidate)
            fault = timed_fault_of(read, candidate)
            if fault is not None:
                yield f"{name}: {path.name}: {fault}"


def main() -> int:
    """Read all, or the formats that are named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("formats", nargs="*", help=", ".join(READ))
    parser.add_argument("--input", type=Path, help="one input, instead of those of the corpus")
    options = parser.parse_args()
    warnings.simplefilter("error")
    warnings.simplefilter("ignore", ReadWarning)
    if options.input is not None:  # and end it where Python cannot
        resource.setrlimit(resource.RLIMIT_CPU, (6 * SECONDS, resource.RLIM_INFINITY))
    n_inputs = n_faults = 0
    for name in options.formats or READ:
        inputs = [options.input] if options.input else sorted(folder_of(name).glob("*"))
        n_inputs += len(inputs)
        for line in wrong_with_inputs(name, inputs):
            print(line, flush=True)
            n_faults += 1
    if not options.formats:
        for function in sorted(unreached() - set(UNREACHED)):
            print(f"core: {function}: no target calls it; add one, or name it in UNREACHED")
            n_faults += 1
    print(f"{n_inputs} inputs read, {n_faults} at fault")
    return 1 if n_faults else 0


if __name__ == "__main__":
    sys.exit(main())
