"""Coverage-guided fuzzing of the readers and of the core, in children with bounded time and memory.

    python tests/fuzzing/fuzz.py [FORMAT ...] [--core LIBRARY] [--seconds 60] [--inputs 0]
        [--jobs 1] [--corpus FOLDER] [--findings fuzz-findings] [--skip FORMAT]
    python tests/fuzzing/fuzz.py [FORMAT ...] --minimize --corpus FOLDER

atheris makes the inputs. An input must be read, or refused with a TexbakeError of one line, within
`SECONDS` of processor time and `MEMORY`. What is not is kept in the folder of findings, and a text
beside it says why. New inputs go to the folder given as corpus, in a folder for each format.
`--core` names a core with counted branches, from `compile_core.py --fuzz`; without it, only those
of Python are counted. `--minimize` makes the corpus of the repository from a folder of inputs: the
smallest that reach all that is reached. Prints a line of JSON for each format.
"""

import argparse
import faulthandler
import hashlib
import json
import mmap
import os
import re
import shlex
import shutil
import struct
import subprocess
import sys
import tempfile
import time
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from formats import READ
from read_corpus import CORPUS, STUCK, bounded_memory, fault_of, folder_of

from texbake.errors import ReadWarning

MEMORY = 1 << 30  # bytes beyond those of the process with all readers loaded
MAX_FAULTS = 5
COVERED = ["texbake", "trimesh.exchange", "collada"]
AGAIN = "again"  # a script that runs a child; libFuzzer runs it to choose inputs
COUNT = "inputs"  # a file of eight bytes, so that the count outlives a child
LONGEST_KEPT = 4 << 10  # bytes of an input of the repository's corpus, if the seed is not longer
MOST_KEPT = 32 << 10  # bytes of the inputs of a format there
SLOWEST_KEPT = 0.3  # seconds of processor time that an input there may take
SANITIZERS = {
    "ASAN_OPTIONS": "detect_leaks=0:allocator_may_return_null=1:quarantine_size_mb=16",
    "UBSAN_OPTIONS": "print_stacktrace=1",
}
_REASON = re.compile(r"SUMMARY: .*|.*: runtime error: .*|Fatal Python error: .*")


def fuzz(name, options):
    """Read inputs that libFuzzer makes, until its flags say that it is enough; in the child."""
    import atheris
    from mutants import changed

    home = options.home
    suffix, make, read = READ[name]
    candidate = home / f"mutant{suffix}"
    with atheris.instrument_imports(include=COVERED):
        make(home / f"seed{suffix}")
        for path in [home / f"seed{suffix}", *folder_of(name).glob("*")]:
            shutil.copy(path, candidate)
            fault_of(read, candidate)  # loads what the reader needs, with its branches counted
    with (home / COUNT).open("r+b") as file:
        count = mmap.mmap(file.fileno(), 8)

    def read_one(data):
        count[:] = struct.pack("<q", struct.unpack("<q", count)[0] + 1)
        candidate.write_bytes(data)
        start = time.process_time()
        fault = fault_of(read, candidate)
        if options.minimize:
            if time.process_time() - start > SLOWEST_KEPT:
                (home / "slow" / short_hash(data)).touch()
        elif fault is not None:
            keep(data, fault, name, options.findings)

    def mutate(data, longest, seed):
        def change(piece):
            return bytes(atheris.Mutate(piece, len(piece) + 64))

        return changed(data, change, np.random.default_rng(seed))[:longest]

    with bounded_memory(MEMORY):
        atheris.Setup([str(home / AGAIN), *options.flags], read_one, custom_mutator=mutate)
        atheris.Fuzz()


def keep(data, fault, name, findings):
    """Keep an input at fault, unless one with the same fault is there already."""
    # One input for each place in the code.
    place = short_hash(fault.rpartition(" at ")[2].encode())
    stem = findings / f"{name.replace(' ', '_')}-{place}"
    if stem.with_suffix(".txt").exists():
        return
    findings.mkdir(parents=True, exist_ok=True)
    stem.with_suffix(READ[name][0]).write_bytes(data)
    stem.with_suffix(".txt").write_text(fault + "\n")


def child(name, home, options, flags):
    """Let a child run libFuzzer with these flags; return how it ended."""
    command = [sys.executable, __file__, name, "--child", "--home", str(home)]
    command += ["--findings", str(options.findings)]
    if options.minimize:
        command += ["--minimize"]
    again = home / AGAIN
    again.write_text(f'#!/bin/sh\nexec {shlex.join(command)} --flags "$@"\n')
    again.chmod(0o755)
    with (home / "log").open("ab") as file:
        return subprocess.run(
            [again, *flags], stdout=file, stderr=file, check=False, env=environment(options.core)
        ).returncode


def environment(core):
    """Variables with which a child loads a core whose branches are counted, its sanitizer first."""
    if core is None:
        return dict(os.environ)
    import atheris

    kind = "asan" if b"__asan_init" in core.read_bytes() else "ubsan"
    runtime = Path(atheris.path()) / f"{kind}_with_fuzzer.so"
    return os.environ | SANITIZERS | {"LD_PRELOAD": str(runtime), "TEXBAKE_CORE": str(core)}


def n_read(home):
    return int(struct.unpack("<q", (home / COUNT).read_bytes())[0])


def faults_of(name, findings):
    found = findings.glob(f"{name.replace(' ', '_')}-{'?' * 12}.txt")
    return [path.read_text().strip() for path in sorted(found)]


def take_artifacts(name, home, options, code):
    """Move inputs that ended a child to the findings, slow ones if again; return how many."""
    found = [each for each in home.iterdir() if each.name.startswith(("crash", "timeout", "oom"))]
    reasons = _REASON.findall((home / "log").read_text(errors="replace"))
    for path in found:
        fault: str | None = f"it ended the process ({code}) at {(*reasons, path.name)[0]}"
        if path.name.startswith("timeout"):
            fault = read_again(name, path, home)
        if fault is not None:
            keep(path.read_bytes(), fault, name, options.findings)
        path.unlink()
    (home / "log").write_text("")
    return len(found)


def read_again(name, path, home):
    """Read an input in a process of its own, by the core as it is; say if it takes too long."""
    copy = home / f"again{READ[name][0]}"
    shutil.copy(path, copy)
    command = [sys.executable, str(Path(__file__).with_name("read_corpus.py")), name]
    finished = subprocess.run(
        [*command, "--input", str(copy)], capture_output=True, text=True, check=False
    )
    if finished.returncode == 0:
        return None
    lines = [*finished.stdout.splitlines(), f"it was ended ({finished.returncode})"]
    return f"it takes too long: {lines[0]}"


def run_format(name, options):
    """Fuzz one format in children, a new one after each that an input ends; in the parent."""
    start = time.monotonic()
    with tempfile.TemporaryDirectory(dir=options.scratch) as scratch:
        home = Path(scratch)
        (home / COUNT).write_bytes(bytes(8))
        made = (options.corpus or home / "corpus") / name.replace(" ", "_")
        made.mkdir(parents=True, exist_ok=True)
        suffix, make, _ = READ[name]
        make(home / f"seed{suffix}")
        seed = (home / f"seed{suffix}").read_bytes()
        (made / "seed").write_bytes(seed)
        n_ended = 0
        while n_ended < MAX_FAULTS and len(faults_of(name, options.findings)) < MAX_FAULTS:
            left = start + options.seconds - time.monotonic() if options.seconds else 86400.0
            inputs = options.inputs - n_read(home) if options.inputs else -1
            if inputs == 0 or (options.inputs and inputs < 0) or (left < 1.0 and n_read(home)):
                break
            known = [str(made), str(folder_of(name))] if folder_of(name).is_dir() else [str(made)]
            flags = [
                *known, f"-max_total_time={max(1, int(left))}", f"-runs={inputs}",
                f"-timeout={STUCK}", "-rss_limit_mb=4096", f"-artifact_prefix={home}/",
                "-print_final_stats=1", f"-max_len={max(4096, 2 * len(seed))}", "-len_control=0",
                "-verbosity=0", "-reload=0", f"-seed={options.seed + n_ended}",
            ]  # fmt: skip
            code = child(name, home, options, flags)
            if code == 0:
                break
            n_ended += 1
            tail = (home / "log").read_text(errors="replace")[-2000:]
            if not take_artifacts(name, home, options, code):
                raise RuntimeError(f"{name}: the child ended with {code}:\n{tail}")
        nothing = [] if n_read(home) else ["no input was read"]
        return {
            "format": name, "inputs": n_read(home), "seconds": round(time.monotonic() - start),
            "corpus": len(list(made.iterdir())),
            "faults": faults_of(name, options.findings) + nothing,
        }  # fmt: skip


def minimize(name, options):
    """Make the repository's corpus of a format from the folder of inputs."""
    with tempfile.TemporaryDirectory(dir=options.scratch) as scratch:
        home = Path(scratch)
        (home / COUNT).write_bytes(bytes(8))
        small, chosen, slow = (home / each for each in ("small", "chosen", "slow"))
        for folder in small, chosen, slow:
            folder.mkdir()
        given = [*(options.corpus / name.replace(" ", "_")).glob("*"), *folder_of(name).glob("*")]
        suffix, make, _ = READ[name]
        make(home / f"seed{suffix}")
        longest = max(LONGEST_KEPT, (home / f"seed{suffix}").stat().st_size)
        for path in [home / f"seed{suffix}", *given]:
            data = path.read_bytes()
            if len(data) <= longest:
                (small / short_hash(data)).write_bytes(data)
        flags = ["-set_cover_merge=1", "-use_counters=0", f"-timeout={STUCK}",
                 "-rss_limit_mb=4096", "-max_len=65536", str(chosen), str(small)]  # fmt: skip
        code = child(name, home, options, flags)
        if code:
            raise RuntimeError((home / "log").read_text(errors="replace")[-2000:])
        return {"format": name, "of": len(list(small.iterdir())), "faults": [],
                **take_chosen(name, chosen, {path.name for path in slow.iterdir()})}  # fmt: skip


def take_chosen(name, chosen, slow):
    """Make the corpus of a format from the chosen inputs: the smallest, as many as it may have."""
    target = folder_of(name)
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    inputs = sorted((path.read_bytes() for path in chosen.iterdir()), key=lambda d: (len(d), d))
    n_kept = n_bytes = 0
    for data in inputs:
        if short_hash(data) in slow:
            continue
        if n_kept == 0 or n_bytes + len(data) <= MOST_KEPT:
            (target / f"{short_hash(data)}{READ[name][0]}").write_bytes(data)
            n_kept, n_bytes = n_kept + 1, n_bytes + len(data)
    return {"chosen": len(inputs), "kept": n_kept, "bytes": n_bytes}


def short_hash(data):
    return hashlib.sha256(data).hexdigest()[:12]


def parsed():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("formats", nargs="*", help=", ".join(READ))
    parser.add_argument("--core", type=Path, help="a core with counted branches")
    parser.add_argument("--corpus", type=Path, help="where new inputs go; a temporary folder")
    parser.add_argument("--seconds", type=float, default=None, help="for each format")
    parser.add_argument("--inputs", type=int, default=0, help="of each format")
    parser.add_argument("--jobs", type=int, default=1, help="formats at once")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--findings", type=Path, default=Path("fuzz-findings"))
    parser.add_argument("--skip", action="append", default=[], help="a format to leave out")
    parser.add_argument("--minimize", action="store_true", help=f"write {CORPUS}")
    parser.add_argument("--scratch", type=Path, help="a folder for temporary files")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--home", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--flags", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.seconds is None:
        options.seconds = 0.0 if options.inputs else 60.0
    unknown = [name for name in options.formats + options.skip if name not in READ]
    if unknown:
        parser.error(f"no such format: {', '.join(unknown)}")
    return options


def main():
    """Fuzz or minimize the formats that are named; return 1 if anything is at fault."""
    options = parsed()
    if options.child:
        faulthandler.enable()
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", ReadWarning)
        fuzz(options.formats[0], options)
        return 0
    names = [name for name in options.formats or READ if name not in options.skip]
    work = minimize if options.minimize else run_format
    n_faults = 0
    with ThreadPoolExecutor(options.jobs) as pool:
        for row in pool.map(lambda name: work(name, options), names):
            print(json.dumps(row), flush=True)
            n_faults += len(row["faults"])
    return 1 if n_faults else 0


if __name__ == "__main__":
    sys.exit(main())
