"""Coverage-guided fuzzing of the readers with atheris, in children with bounded time and memory.

    python tests/fuzzing/fuzz_readers.py [FORMAT ...] [--corpus FOLDER] [--seconds 60] [--inputs 0]
        [--findings fuzz-findings] [--skip FORMAT]
    python tests/fuzzing/fuzz_readers.py FORMAT --minimize --corpus FOLDER

An input must be read, or refused with a TexbakeError of one line, within `SECONDS` and `MEMORY`.
What is not is kept in the folder of findings, and a text beside it says why. New inputs go to the
folder given as corpus, in a folder for each format. `--minimize` makes the corpus of the repository
from it: the smallest inputs that reach all that is reached. Prints a line of JSON for each format.
"""

from __future__ import annotations

import argparse
import faulthandler
import hashlib
import json
import mmap
import shutil
import struct
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "hard_cases"))

from fuzz_files import bound_memory, fault_of  # noqa: E402
from fuzz_formats import FORMATS  # noqa: E402
from read_corpus import CORPUS, SECONDS, folder_of  # noqa: E402

MEMORY = 1 << 30  # bytes beyond those of the process with all readers loaded
MAX_FAULTS = 5
COVERED = ["texbake", "trimesh.exchange", "collada"]
COUNT = "inputs"  # a file of eight bytes, so that the count outlives a child
LONGEST_KEPT = 4 << 10  # bytes of an input of the repository's corpus, if the seed is not longer


def fuzz(name: str, options: argparse.Namespace) -> None:
    """Read inputs that libFuzzer makes, until its flags say that it is enough; in the child."""
    import atheris
    from containers import changed

    home = options.home
    suffix, make, read = FORMATS[name]
    candidate = home / f"mutant{suffix}"
    with atheris.instrument_imports(include=COVERED):
        make(home / f"seed{suffix}")
        for path in [home / f"seed{suffix}", *folder_of(name).glob("*")]:
            shutil.copy(path, candidate)
            fault_of(read, candidate)  # loads what the reader needs, with its branches counted
    bound_memory(MEMORY)
    with (home / COUNT).open("r+b") as file:
        count = mmap.mmap(file.fileno(), 8)

    def read_one(data: bytes) -> None:
        count[:] = struct.pack("<q", struct.unpack("<q", count)[0] + 1)
        candidate.write_bytes(data)
        fault = fault_of(read, candidate)
        if fault is not None and not options.minimize:
            keep(data, fault, name, options.findings)

    def mutate(data: bytes, longest: int, seed: int) -> bytes:
        def change(piece: bytes) -> bytes:
            return bytes(atheris.Mutate(piece, len(piece) + 64))

        return changed(data, change, np.random.default_rng(seed))[:longest]

    atheris.Setup([sys.argv[0], *options.flags], read_one, custom_mutator=mutate)
    atheris.Fuzz()


def keep(data: bytes, fault: str, name: str, findings: Path) -> None:
    """Keep an input at fault, unless as many of its format are there already."""
    label = name.replace(" ", "_")
    # One input for each place in the code.
    place = hashlib.sha256(fault.rpartition(" at ")[2].encode()).hexdigest()[:8]
    stem = findings / f"{label}-{place}"
    if stem.with_suffix(".txt").exists():
        return
    findings.mkdir(parents=True, exist_ok=True)
    stem.with_suffix(FORMATS[name][0]).write_bytes(data)
    stem.with_suffix(".txt").write_text(fault + "\n")


def child(name: str, home: Path, options: argparse.Namespace, flags: list[str]) -> int:
    """Let a child run libFuzzer with these flags; return how it ended."""
    command = [sys.executable, __file__, name, "--child", "--home", str(home)]
    command += ["--findings", str(options.findings)]
    if options.minimize:
        command += ["--minimize"]
    log = home / "log"
    with log.open("ab") as file:
        return subprocess.run(
            [*command, f"--flags={json.dumps(flags)}"], stdout=file, stderr=file, check=False
        ).returncode


def n_read(home: Path) -> int:
    return int(struct.unpack("<q", (home / COUNT).read_bytes())[0])


def faults_of(name: str, findings: Path) -> list[str]:
    label = name.replace(" ", "_")
    return [path.read_text().strip() for path in sorted(findings.glob(f"{label}-????????.txt"))]


def take_artifacts(name: str, home: Path, options: argparse.Namespace, code: int) -> int:
    """Move the inputs that ended a child to the findings; return how many there were."""
    found = [each for each in home.iterdir() if each.name.startswith(("crash", "timeout", "oom"))]
    for path in found:
        keep(path.read_bytes(), f"it ended the process ({code}) at {path.name}", name,
             options.findings)  # fmt: skip
        path.unlink()
    return len(found)


def run_format(name: str, options: argparse.Namespace) -> dict[str, Any]:
    """Fuzz one format in children, a new one after each that an input ends; in the parent."""
    start = time.monotonic()
    with tempfile.TemporaryDirectory(dir=options.scratch) as scratch:
        home = Path(scratch)
        (home / COUNT).write_bytes(bytes(8))
        made = (options.corpus or home / "corpus") / name.replace(" ", "_")
        made.mkdir(parents=True, exist_ok=True)
        suffix, make, _ = FORMATS[name]
        make(home / f"seed{suffix}")
        seed = (home / f"seed{suffix}").read_bytes()
        (made / "seed").write_bytes(seed)
        n_ended = 0
        while n_ended < MAX_FAULTS and len(faults_of(name, options.findings)) < MAX_FAULTS:
            left = start + options.seconds - time.monotonic() if options.seconds else 86400.0
            inputs = options.inputs - n_read(home) if options.inputs else -1
            if left < 1.0 or inputs == 0 or (options.inputs and inputs < 0):
                break
            known = [str(made), str(folder_of(name))] if folder_of(name).is_dir() else [str(made)]
            flags = [
                *known, f"-max_total_time={int(left)}", f"-runs={inputs}", f"-timeout={SECONDS}",
                "-rss_limit_mb=4096", f"-artifact_prefix={home}/", "-print_final_stats=1",
                f"-max_len={max(4096, 2 * len(seed))}", "-len_control=0", "-verbosity=0",
                "-reload=0", f"-seed={1 + n_ended}",
            ]  # fmt: skip
            code = child(name, home, options, flags)
            if code == 0:
                break
            n_ended += 1
            if not take_artifacts(name, home, options, code):
                tail = (home / "log").read_text(errors="replace")[-2000:]
                raise RuntimeError(f"{name}: the child ended with {code}:\n{tail}")
        return {
            "format": name,
            "inputs": n_read(home),
            "seconds": round(time.monotonic() - start),
            "corpus": len(list(made.iterdir())),
            "faults": faults_of(name, options.findings),
        }


def minimize(name: str, options: argparse.Namespace) -> dict[str, Any]:
    """Make the repository's corpus of a format from the folder of inputs."""
    with tempfile.TemporaryDirectory(dir=options.scratch) as scratch:
        home = Path(scratch)
        (home / COUNT).write_bytes(bytes(8))
        small, chosen = home / "small", home / "chosen"
        small.mkdir()
        chosen.mkdir()
        given = [*(options.corpus / name.replace(" ", "_")).glob("*"), *folder_of(name).glob("*")]
        suffix, make, _ = FORMATS[name]
        make(home / f"seed{suffix}")
        longest = max(LONGEST_KEPT, (home / f"seed{suffix}").stat().st_size)
        for path in [home / f"seed{suffix}", *given]:
            data = path.read_bytes()
            if len(data) <= longest:
                (small / short_hash(data)).write_bytes(data)
        flags = ["-set_cover_merge=1", "-use_counters=0", f"-timeout={SECONDS}",
                 "-rss_limit_mb=4096", "-max_len=65536", str(chosen), str(small)]  # fmt: skip
        code = child(name, home, options, flags)
        if code:
            raise RuntimeError((home / "log").read_text(errors="replace")[-2000:])
        target = folder_of(name)
        shutil.rmtree(target, ignore_errors=True)
        target.mkdir(parents=True)
        for path in sorted(chosen.iterdir()):
            data = path.read_bytes()
            (target / f"{short_hash(data)}{suffix}").write_bytes(data)
        kept = list(target.iterdir())
        n_bytes = sum(path.stat().st_size for path in kept)
        return {"format": name, "of": len(list(small.iterdir())), "kept": len(kept),
                "bytes": n_bytes, "faults": []}  # fmt: skip


def short_hash(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:12]


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("formats", nargs="*", help=", ".join(FORMATS))
    parser.add_argument("--corpus", type=Path, help="where new inputs go; a temporary folder")
    parser.add_argument("--seconds", type=float, default=None)
    parser.add_argument("--inputs", type=int, default=0)
    parser.add_argument("--findings", type=Path, default=Path("fuzz-findings"))
    parser.add_argument("--skip", action="append", default=[], help="a format to leave out")
    parser.add_argument("--minimize", action="store_true", help=f"write {CORPUS}")
    parser.add_argument("--scratch", type=Path, help="a folder for temporary files")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--home", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--flags", type=json.loads, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.seconds is None:
        options.seconds = 0.0 if options.inputs else 60.0
    unknown = [name for name in options.formats if name not in FORMATS]
    if unknown:
        parser.error(f"no such format: {', '.join(unknown)}")
    return options


def main() -> int:
    """Fuzz or minimize the formats that are named; return 1 if anything is at fault."""
    options = parsed()
    if options.child:
        faulthandler.enable()
        warnings.simplefilter("error")
        fuzz(options.formats[0], options)
        return 0
    n_faults = 0
    for name in options.formats or FORMATS:
        if name not in options.skip:
            row = (minimize if options.minimize else run_format)(name, options)
            print(json.dumps(row), flush=True)
            n_faults += len(row["faults"])
    return 1 if n_faults else 0


if __name__ == "__main__":
    sys.exit(main())
