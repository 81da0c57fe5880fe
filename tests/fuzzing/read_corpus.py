"""Read every input of the corpus, and mutants, by the reader of the format or by its target.

    python tests/fuzzing/read_corpus.py [FORMAT ...] [--input FILE] [--bytes N] [--seed N]
        [--skip FORMAT]

An input must be read, or refused with a TexbakeError of one line, within `SECONDS` of processor
time and `MEMORY`. `--bytes` also reads that many bytes of mutants of each format. Prints what is
wrong with an input, and exits with 1 if anything is. `fuzz-findings` keeps inputs that fail.
Formats are read in as many processes as there are processors. If all formats are read, every
function of the core must have been called in the end.
"""

import argparse
import faulthandler
import os
import resource
import shutil
import sys
import tempfile
import time
import warnings
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from itertools import chain, count
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
CORPUS = HERE / "corpus"
FINDINGS = Path("fuzz-findings")
sys.path.insert(0, str(HERE))

from formats import FORMATS, READ, UNREACHED, unreached  # noqa: E402
from mutants import changed, mutant  # noqa: E402

from texbake.errors import ReadWarning, TexbakeError  # noqa: E402

SECONDS = 10  # of processor time for one input
SLOWDOWN = 10  # of a core with sanitizers
STUCK = 12 * SECONDS  # of the clock: the machine may do other things as well
MEMORY = 2 << 30  # bytes of address space beyond those of the process with all readers loaded


def folder_of(name):
    """Return the folder with the inputs of a format."""
    return CORPUS / name.replace(" ", "_")


def fault_of(read, path):
    """Read one file; return what went wrong, or that it took too long, or None."""
    limit = SECONDS * (SLOWDOWN if "asan" in os.environ.get("LD_PRELOAD", "") else 1)
    start = time.process_time()
    faulthandler.dump_traceback_later(
        limit * STUCK // SECONDS, exit=True, file=sys.__stderr__ or sys.stderr
    )
    try:
        read(path)
    except TexbakeError as error:
        if "\n" in str(error):
            return f"several lines: {error!r}"
    except BaseException as error:  # any other exception is a fault
        frame = error.__traceback__
        while frame is not None and frame.tb_next is not None:
            frame = frame.tb_next
        where = f"{frame.tb_frame.f_code.co_filename}:{frame.tb_lineno}" if frame else "?"
        return f"{type(error).__name__}: {str(error)[:200]} at {where}"
    finally:
        faulthandler.cancel_dump_traceback_later()
    elapsed = time.process_time() - start
    return f"it took more than {limit} s of processor time" if elapsed > limit else None


@contextmanager
def bounded_memory(n_bytes=MEMORY):
    """Limit the address space to its present size and `n_bytes` more."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + n_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def mutants_of(name, inputs, n_bytes, seed):
    """Change the inputs of a format, until there are `n_bytes`."""
    for number in count():
        if n_bytes <= 0:
            return
        rng = np.random.default_rng([seed, number, *name.encode()])
        data = changed(inputs[number % len(inputs)], partial(mutant, rng=rng), rng)
        n_bytes -= len(data)
        yield data


def wrong_with_inputs(name, inputs=None, *, n_bytes=0, seed=0):
    """Read the inputs of a format and mutants; yield what is wrong with those that fail."""
    suffix, make, read = READ[name]
    with tempfile.TemporaryDirectory() as folder:
        seed_file = Path(folder) / f"seed{suffix}"
        make(seed_file)  # and the files that it names
        with nullcontext() if name in FORMATS else suppress(TexbakeError):
            read(seed_file)  # loads all that is needed, and shows that the seed is valid
        contents = [path.read_bytes() for path in inputs or sorted(folder_of(name).glob("*"))]
        candidate = Path(folder) / f"mutant{suffix}"
        mutated = mutants_of(name, [seed_file.read_bytes(), *contents], n_bytes, seed)
        with bounded_memory():
            for number, data in enumerate(chain(contents, mutated)):
                candidate.write_bytes(data)
                fault = fault_of(read, candidate)
                if fault is not None:
                    FINDINGS.mkdir(exist_ok=True)
                    copy = FINDINGS / f"{name.replace(' ', '_')}-{number}{suffix}"
                    shutil.copy(candidate, copy)
                    yield f"{name}: {copy.name}: {fault}"


def read_format(name, options):
    """Read a format in a process of a pool; return what is wrong, and what was never called."""
    warnings.simplefilter("error")
    warnings.simplefilter("ignore", ReadWarning)
    inputs = [options.input] if options.input else None
    found = wrong_with_inputs(name, inputs, n_bytes=int(options.bytes), seed=options.seed)
    return list(found), unreached()


def main():
    """Read all, or the formats that are named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("formats", nargs="*", help=", ".join(READ))
    parser.add_argument("--input", type=Path, help="one input, instead of those of the corpus")
    parser.add_argument("--bytes", type=float, default=0.0, help="of mutants, of each format")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--skip", action="append", default=[], help="a format to leave out")
    options = parser.parse_args()
    names = [name for name in options.formats or READ if name not in options.skip]
    never, n_faults = unreached(), 0
    with ProcessPoolExecutor() as pool:
        for lines, unread in pool.map(partial(read_format, options=options), names):
            print(*lines, sep="\n", end="\n" * bool(lines), flush=True)
            never &= unread
            n_faults += len(lines)
    if not options.formats:
        for function in sorted(never - set(UNREACHED)):
            print(f"core: {function}: no target calls it; add one, or name it in UNREACHED")
            n_faults += 1
    print(f"{len(names)} formats read, {n_faults} at fault")
    return 1 if n_faults else 0


if __name__ == "__main__":
    sys.exit(main())
