"""Power cuts at every moment of every command: what may the disk hold, and can it go on from there?

    python tests/hard_cases/power_cuts.py [--states 100] [--runs 3] [--only NAME]

strace records what a command does to its folder, C libraries included. After each change, states
are made that the disk may hold if the power fails then; `traced_disk.py` says which. In all of them

- each output is whole: as it was before, or as the command wrote it;
- a stored result whose manifest can be read has the files of its checksums;
- and once the command has ended, all outputs are there.

In some of them the command runs again, and must give the bytes of an undisturbed run. Linux only.
Prints a table in Markdown, and exits with 1 if anything was wrong.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import shutil
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from stopped_commands import Case, contents, is_inside, prepared, same, start, write
from traced_disk import Call, Disk, State, calls, can_trace, tracing
from writing_commands import LINES

SHARES = (0.0, 1.0, 1.0, 0.5, 0.5, 0.2, 0.8)
READ_BY_BUILDS = ("/digests.json", "/last.json")


class PowerCuts:
    """The states after power cuts during one run of a command."""

    def __init__(self, case: Case, state: str, luck: random.Random) -> None:
        self.case, self.state, self.luck = case, state, luck
        self.faults: list[str] = []
        self.n_changes = self.n_states = self.n_runs = 0
        self.kept: list[tuple[State, set[str]]] = []

    def check(self, most_states: int, most_runs: int) -> None:
        """Make states and look at each; run the command again in some."""
        log = self.case.folder / "trace"
        self.case.reset(self.state)
        disk = Disk(self.case.work)
        before = disk.now()
        _run_traced(self.case, log)
        made = list(calls(log))
        log.unlink()
        after = contents(self.case.work)
        self._count(made)
        each = most_states / max(1, self.n_changes)
        seen: set[str] = set()
        for found in _states(disk, made, each, self.luck):
            name = _named(found)
            if name not in seen:
                seen.add(name)
                self._look(found[0], before, disk)
                self.kept.append(found)
        if disk.now() != after:
            odd = [name for name in after if disk.now().get(name) != after[name]]
            raise SystemExit(f"{self.case.name}: the trace does not give {odd[:3]}")
        for share in SHARES:
            self._look_at_the_end(disk.after_a_cut(self.luck, share)[0], after)
        self.n_states = len(seen)
        for found in self.luck.sample(self.kept, min(most_runs, len(self.kept))):
            self._run_in(*found)

    def _count(self, made: list[Call]) -> None:
        self.case.reset(self.state)
        disk = Disk(self.case.work)
        self.n_changes = sum(disk.replay(call) for call in made)

    def _look(self, found: State, before: State, disk: Disk) -> None:
        for name, content in found.items():
            if is_inside(name) and not name.endswith(READ_BY_BUILDS):
                continue
            if "/.texbake-" in f"/{name}" or content == before.get(name):
                continue
            if content not in disk.versions.get(name, ()):
                self.faults.append(f"{name} is not whole: {len(content)} bytes")
        self.faults += [f"{name} has gone" for name in before.keys() - found.keys()
                        if not is_inside(name) and name in self.case.outputs]  # fmt: skip
        self._look_at_the_store(found)

    def _look_at_the_store(self, found: State) -> None:
        for name, content in found.items():
            if not (name.endswith("/manifest.json") and "/tmp/" not in name):
                continue
            with suppress(ValueError):
                manifest = json.loads(content)
                for listed in manifest["outputs"].values():
                    for file in listed["files"]:
                        path = "/".join(filter(None, (listed["file"], file["path"])))
                        stored = found.get(name.replace("manifest.json", path), b"")
                        if hashlib.sha256(stored).hexdigest() != file["sha256"]:
                            self.faults.append(f"{path} of the store is damaged")

    def _look_at_the_end(self, found: State, after: State) -> None:
        for name in self.case.outputs:
            if found.get(name) != after[name]:
                self.faults.append(f"{name} is not on the disk at the end")

    def _run_in(self, files: State, folders: set[str]) -> None:
        """Run the command again after a power cut."""
        case = self.case
        case.reset(self.state)
        shutil.rmtree(case.work)
        case.work.mkdir()
        for folder in folders:
            (case.work / folder).mkdir(parents=True, exist_ok=True)
        write(case.work, files)
        again = start(case.folder, case.again, forked=True, in_process=True)
        again.wait(300.0)
        self.n_runs += 1
        if again.code or again.said():
            self.faults.append(f"next run: exit code {again.code}, with {again.said()[-3:]}")
            return
        found, expected = contents(case.work), case.ends[self.state]
        for name in case.outputs:
            if name not in found or not same(name, found[name], expected[name], case):
                self.faults.append(f"next run: other bytes in {name}")


def _run_traced(case: Case, log: Path) -> None:
    """Run a command and record what it does; `watch` gets Ctrl-C once it has built."""
    running = start(case.folder, case.words, forked=False, before=tracing(log))
    if case.words[0] != "watch":
        running.wait(300.0)
        fine = running.code == 0 and not running.said()
    else:
        said = case.folder / "stdout"
        while "watching" not in said.read_text() and not running.wait(0.1):
            pass
        os.kill(running.children()[0], signal.SIGINT)
        running.wait(30.0)
        fine = running.code == 130
    if not fine:
        raise SystemExit(f"{case.name}: {running.code}: {running.said()}")


def _states(
    disk: Disk, made: list[Call], each: float, luck: random.Random
) -> Iterator[tuple[State, set[str]]]:
    """Yield states after each change that is made, or after some of them."""
    for call in made:
        if disk.replay(call):
            for number in range(int(each + luck.random())):
                share = SHARES[number] if 1 < each <= len(SHARES) else luck.choice(SHARES)
                yield disk.after_a_cut(luck, share)


def _named(found: tuple[State, set[str]]) -> str:
    digest = hashlib.sha256()
    for name, content in sorted(found[0].items()):
        digest.update(f"{name} {len(content)} ".encode() + hashlib.sha256(content).digest())
    digest.update(" ".join(sorted(found[1])).encode())
    return digest.hexdigest()


def main() -> int:
    """Look at all commands and report."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--states", type=int, default=100, help="of each command, about")
    parser.add_argument("--runs", type=int, default=3, help="next runs of each command")
    parser.add_argument("--only", action="append", choices=LINES, help="a command; repeatable")
    parser.add_argument("--seed", type=int, default=16)
    arguments = parser.parse_args()
    if not can_trace():
        raise SystemExit("strace is missing, or may not trace here")
    signal.signal(signal.SIGINT, signal.default_int_handler)  # not ignored in the background
    luck = random.Random(arguments.seed)
    root = Path(tempfile.mkdtemp(prefix="texbake-cuts-"))
    n_faults = 0
    totals: Counter[str] = Counter()
    print("| command | changes | states | next runs | faults |\n|---|---|---|---|---|")
    try:
        for name in arguments.only or LINES:
            case = prepared(name, root, in_process=True)
            row: Counter[str] = Counter()
            for state in case.starts:
                cuts = PowerCuts(case, state, luck)
                cuts.check(arguments.states // 2, arguments.runs)
                row.update(changes=cuts.n_changes, states=cuts.n_states, runs=cuts.n_runs,
                           faults=len(cuts.faults))  # fmt: skip
                for fault, count in Counter(cuts.faults).most_common(8):
                    print(f"    {name}, {state}: {fault} ({count})")
            print(f"| {name} | {row['changes']:,} | {row['states']:,} | {row['runs']:,} |"
                  f" {row['faults']:,} |", flush=True)  # fmt: skip
            totals.update(row)
            n_faults += row["faults"]
            shutil.rmtree(case.folder)
    finally:
        shutil.rmtree(root, ignore_errors=True)
    print(f"| all | {totals['changes']:,} | {totals['states']:,} | {totals['runs']:,} |"
          f" {totals['faults']:,} |")  # fmt: skip
    return 1 if n_faults else 0


if __name__ == "__main__":
    sys.exit(main())
