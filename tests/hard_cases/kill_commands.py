"""Commands that are killed at any moment: what is left, and what does the next run make of it?

    python tests/hard_cases/kill_commands.py [--kills 1000] [--only NAME] [--rows FILE.jsonl]
        [--patience 1]

Every command that writes is stopped by KILL, TERM or INT, sent to it, to its process group or to
one of its children, at a random moment, or, with strace, as it enters one of the calls that sync,
rename or remove files. It had older outputs or none. Afterwards

- each output is wholly old or wholly new, and all of a set are one of these; KILL within the
  renames may divide a set, which is counted;
- TERM and INT end it within a second, with one line and the exit code 143 or 130, and leave
  neither temporary files nor folders;
- no process of it lives on after two seconds;
- the next run ends well, with the bytes of an undisturbed one, and nothing else is left.

Linux only. Prints a table in Markdown, and exits with 1 if anything was wrong.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from stopped_commands import (
    Case,
    Running,
    contents,
    folders_in,
    is_inside,
    orphans,
    prepared,
    same,
    start,
)
from writing_commands import LINES

SIGNALS = {"KILL": signal.SIGKILL, "TERM": signal.SIGTERM, "INT": signal.SIGINT}
CODES = {"TERM": 143, "INT": 130}
SAYS = {"TERM": ["texbake: terminated"], "INT": ["texbake: interrupted"]}
MOST_ATTEMPTS = 4  # to stop a command before it ends by itself
PROMPT = 1.0  # seconds in which a signal ends a command
# Python tries whether it can write to TMPDIR: for some microseconds there is a file of four bytes.
PROBE = re.compile("[a-z0-9_]{8}")
CALLS = {
    "rename": "?rename,renameat,renameat2",
    "fsync": "fsync",
    "unlink": "?unlink,unlinkat",
    "mkdir": "?mkdir,mkdirat",
}


class Kill:
    """One command that is stopped once."""

    def __init__(self, case: Case, luck: random.Random, patience: float) -> None:
        self.case = case
        self.patience = patience
        self.state = luck.choice(["new", "older", "older"])
        self.signal = luck.choice(list(SIGNALS))
        self.victim = luck.choice(["process", "process", "group"])
        if case.has_children and luck.random() < 0.4:
            self.victim = "child"  # a terminal sends INT to the whole group, never to a child alone
            self.signal = luck.choice(["KILL", "TERM"])
        self.call = luck.choice(["rename", "rename", *CALLS]) if luck.random() < 0.25 else ""
        if not shutil.which("strace") or case.words[0] == "watch":
            self.call = ""
        if self.call:
            self.victim = "process"
        self.forked = not self.call and luck.random() < 0.75
        most = {"rename": len(case.outputs), "fsync": len(case.outputs)}
        self.which = luck.randint(1, most.get(self.call, 1))
        self.moment = luck.uniform(0.0, 0.9)
        self.other = luck.random() < 0.25
        self.faults: list[str] = []
        self.late = 0.0
        self.ended_before = self.early = self.divided = False

    def run(self) -> None:
        """Stop the command, look, run it again and look again."""
        case = self.case
        case.reset(self.state)
        running = self._stopped()
        try:
            self._look(running)
        finally:
            running.kill()
        self._look_after_the_next()

    def _stopped(self) -> Running:
        case, number = self.case, SIGNALS[self.signal]
        if self.call:
            calls = CALLS[self.call]
            trace = [
                "strace", "-f", "-qqq", "-o", "/dev/null", "-e", "signal=none",
                "-e", f"trace={calls}",
                "-e", f"inject={calls}:signal={self.signal}:when={self.which}",
            ]  # fmt: skip
            running = start(case.folder, case.words, forked=False, before=trace)
            running.wait(300.0)
            return running
        running = start(case.folder, case.words, forked=self.forked)
        until = running.began + self.moment * case.seconds[self.forked]
        while not running.ended() and time.monotonic() < until:
            time.sleep(0.0005)
        victims = [running.process]
        if self.victim == "child":
            while not running.ended() and not (victims := running.children()):
                time.sleep(0.0005)
        if running.ended():
            case.seconds[self.forked] *= 0.8  # the machine was busier before
            return running
        sent = time.monotonic()
        with suppress(ProcessLookupError):
            if self.victim == "group":
                os.killpg(running.process, number)
            else:
                os.kill(random.Random(self.moment).choice(victims), number)
        if case.words[0] == "watch" and self.victim == "child":
            running.wait(case.seconds[True] / 4)
            os.kill(running.process, signal.SIGTERM)
        running.wait(300.0)
        self.late = time.monotonic() - sent
        return running

    def _look(self, running: Running) -> None:
        self._look_at_the_end(running)
        until = time.monotonic() + 2.0 * self.patience
        while (living := orphans(self.case.folder)) and time.monotonic() < until:
            time.sleep(0.02)
        if living:
            self.faults.append(f"{len(living)} processes live on")
            for process in living:
                with suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)
        found = contents(self.case.work)
        for files in self.case.sets():
            self._look_at_a_set(files, found)
        if running.code in CODES.values() and not self.early:
            self._look_for_leftovers(found)

    def _look_at_the_end(self, running: Running) -> None:
        code, said = running.code, running.said()
        self.ended_before = code == 0 and self.victim != "child"
        if self.victim == "child":
            fine = (code == 0 and not said) or (code == 1 and len(said) == 1)
            if self.case.words[0] == "watch":
                fine = code == 143 and said[-1:] == SAYS["TERM"]
        elif self.signal == "KILL":
            fine = code in (-signal.SIGKILL, 0) and not said
        elif not self.forked and _in_the_start_of_python(code, said):
            self.early = fine = True
        else:
            fine = (code == 0 and not said) or (
                code == CODES[self.signal] and said == SAYS[self.signal]
            )
            if self.late > PROMPT * self.patience and code:
                self.faults.append(f"it ended after {self.late:.1f} s")
        if not fine:
            self.faults.append(f"exit code {code}, with {said[-3:]}")

    def _look_at_a_set(self, files: list[str], found: dict[str, bytes]) -> None:
        before, after = self.case.starts[self.state], self.case.ends[self.state]
        kinds = set()
        for name in files:
            content = found.get(name)
            if content == before.get(name):
                kinds.add("old")
            elif content is not None and _same(name, content, after[name], self.case):
                kinds.add("new")
            else:
                self.faults.append(f"{name} is neither old nor new")
        if len(kinds) > 1 and not any(before.get(name) == after[name] for name in files):
            if self.signal == "KILL" and self.victim != "child":
                self.divided = True
            else:
                self.faults.append("a set is old and new")

    def _look_for_leftovers(self, found: dict[str, bytes]) -> None:
        """Look for what a command must remove that ends by itself."""
        case = self.case
        known = {*case.starts[self.state], *case.ends[self.state]}
        left = [name for name in found if name not in known and not is_inside(name)]
        left += [path.name for path in (case.folder / "tmp").iterdir()]
        if left:
            self.faults.append(f"it left {left[:3]}")

    def _look_after_the_next(self) -> None:
        case = self.case
        if self.other and "/" in case.outputs[0]:
            self._look_after_another()
        again = case.run()
        took = max(0.05, time.monotonic() - again.began)
        case.seconds[True] = (case.seconds[True] + took) / 2
        if again.code or again.said():
            self.faults.append(f"next run: exit code {again.code}, with {again.said()[-3:]}")
            return
        found, expected = contents(case.work), case.ends[self.state]
        if odd := found.keys() ^ expected.keys():
            self.faults.append(f"next run: {sorted(odd)[:3]} differ")
        wrong = [
            name
            for name in found.keys() & expected.keys()
            if not is_inside(name) and not _same(name, found[name], expected[name], case)
        ]
        if wrong:
            self.faults.append(f"next run: other bytes in {wrong[:3]}")
        if odd := folders_in(case.work) ^ case.folders[self.state]:
            self.faults.append(f"next run: the folders {sorted(odd)[:3]} differ")
        left = [path.name for path in (case.folder / "tmp").iterdir()]
        if left := [name for name in left if not PROBE.fullmatch(name)]:
            self.faults.append(f"next run: {left[:3]} in TMPDIR")

    def _look_after_another(self) -> None:
        """Run another command into the folder of the outputs; it clears what was left there."""
        folder = (self.case.work / self.case.outputs[0]).parent
        if not folder.is_dir():
            return
        self.case.run(["make", "plane", "-o", f"{folder}/another.stl"])
        if left := [path.name for path in folder.iterdir() if path.name.startswith(".texbake-")]:
            self.faults.append(f"another command leaves {left[:3]}")
        (folder / "another.stl").unlink()


def _in_the_start_of_python(code: int | None, said: list[str]) -> bool:
    """Whether a command was stopped before the first line of texbake ran."""
    if code in (-signal.SIGTERM, -signal.SIGINT):
        return not said or said[-1] == "KeyboardInterrupt"
    return said[-1:] == ["KeyboardInterrupt"] and not any(", in run" in line for line in said)


def _same(name: str, one: bytes, other: bytes, case: Case) -> bool:
    try:
        return same(name, one, other, case)
    except (ValueError, KeyError, OSError):
        return False


def shares(cases: list[Case], kills: int) -> list[Case]:
    """Return the case of each kill, more of those that take little time."""
    weights = [1 / max(0.4, case.seconds[True] + case.seconds[False] / 4) for case in cases]
    least = min(8, max(1, kills // len(cases)))
    rest = max(0, kills - least * len(cases))
    total = sum(weights)
    turns = [
        case
        for case, weight in zip(cases, weights, strict=True)
        for _ in range(least + round(rest * weight / total))
    ]
    random.Random(kills).shuffle(turns)
    return turns


def report(kills: list[Kill]) -> None:
    """Print the table."""
    print("| command | kills | KILL | TERM | INT | at a call | of a child | old outputs there"
          " | too late | divided by KILL | faults |")  # fmt: skip
    print("|---" * 11 + "|")
    names = sorted({kill.case.name for kill in kills})
    for name in [*names, "all"]:
        tried = [kill for kill in kills if name in (kill.case.name, "all")]
        of = [kill for kill in tried if not kill.ended_before]
        signals = Counter(kill.signal for kill in of)
        figures = [
            len(of), *(signals[name] for name in SIGNALS), sum(bool(kill.call) for kill in of),
            sum(kill.victim == "child" for kill in of),
            sum(kill.state == "older" for kill in of), len(tried) - len(of),
            sum(kill.divided for kill in of), sum(bool(kill.faults) for kill in tried),
        ]  # fmt: skip
        print(f"| {name} | {' | '.join(f'{figure:,}' for figure in figures)} |")


def main() -> int:
    """Prepare all commands, kill them and report."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--kills", type=int, default=1000)
    parser.add_argument("--only", action="append", choices=LINES, help="a command; repeatable")
    parser.add_argument("--seed", type=int, default=16)
    parser.add_argument("--patience", type=float, default=1.0, help="a factor of both times")
    parser.add_argument("--rows", type=Path, help="file for all kills, one JSON object per line")
    arguments = parser.parse_args()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # not ignored in the background
    luck = random.Random(arguments.seed)
    root = Path(tempfile.mkdtemp(prefix="texbake-kills-"))
    kills: list[Kill] = []
    try:
        cases = [prepared(name, root) for name in arguments.only or LINES]
        for case in shares(cases, arguments.kills):
            for _ in range(MOST_ATTEMPTS):
                kills.append(Kill(case, luck, arguments.patience))
                kills[-1].run()
                _say(kills[-1], len(kills), arguments.rows)
                if not kills[-1].ended_before:
                    break
    except KeyboardInterrupt:
        pass
    finally:
        shutil.rmtree(root, ignore_errors=True)
    report(kills)
    return any(kill.faults for kill in kills)


def _say(kill: Kill, number: int, rows: Path | None) -> None:
    values = {name: value for name, value in vars(kill).items() if name != "case"}
    line = json.dumps({"number": number, "command": kill.case.name, **values})
    if kill.faults:
        print(line, flush=True)
    if rows is not None:
        with rows.open("a") as file:
            file.write(line + "\n")


if __name__ == "__main__":
    sys.exit(main())
