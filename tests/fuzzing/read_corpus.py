"""Reads every input of the corpus by the reader of its format.

    python tests/fuzzing/read_corpus.py [FORMAT ...]

Prints what is wrong with an input, and exits with 1 if anything is. `.ci/sanitize` runs this on a
core with sanitizers.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

HERE = Path(__file__).parent
CORPUS = HERE / "corpus"
sys.path.insert(0, str(HERE.parent / "hard_cases"))

from fuzz_files import fault_of  # noqa: E402
from fuzz_formats import FORMATS  # noqa: E402

SECONDS = 10  # for one input


def folder_of(name: str) -> Path:
    """Return the folder with the inputs of a format."""
    return CORPUS / name.replace(" ", "_")


def wrong_with_inputs(name: str) -> Iterator[str]:
    """Read the inputs of a format; say of each that is at fault what is wrong with it."""
    suffix, make, read = FORMATS[name]
    with tempfile.TemporaryDirectory() as folder:
        make(Path(folder) / f"seed{suffix}")  # and the files that it names
        candidate = Path(folder) / f"mutant{suffix}"
        for path in sorted(folder_of(name).glob("*")):
            shutil.copy(path, candidate)
            start = time.process_time()
            fault = fault_of(read, candidate)
            taken = time.process_time() - start
            if fault is None and taken > SECONDS:
                fault = f"it took {taken:.1f} s"
            if fault is not None:
                yield f"{name}: {path.name}: {fault}"


def main() -> int:
    """Read all, or the formats that are named."""
    warnings.simplefilter("error")
    n_inputs = n_faults = 0
    for name in sys.argv[1:] or FORMATS:
        n_inputs += len(list(folder_of(name).glob("*")))
        for line in wrong_with_inputs(name):
            print(line)
            n_faults += 1
    print(f"{n_inputs} inputs read, {n_faults} at fault")
    return 1 if n_faults else 0


if __name__ == "__main__":
    sys.exit(main())
