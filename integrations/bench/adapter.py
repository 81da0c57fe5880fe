"""What adapters share: do the jobs of a folder that `texbake bench --export` wrote.

An adapter gives a function from a job to a command, and the name and version of its program. Each
job is a process of its own, timed from its start to its end. The result file is in the folder,
beside the maps; `texbake bench --merge` measures their errors.
"""

import argparse
import datetime
import json
import os
import platform
import re
import subprocess
import sys
from pathlib import Path

RUNNERS = Path(__file__).parents[2] / "texbake" / "study" / "bench" / "runners"
FILES = ("high", "high_obj", "low", "mesh", "scene")  # keys of a job that name a file


def parser(about):
    """Return the options that all adapters have."""
    options = argparse.ArgumentParser(description=about)
    options.add_argument("folder", type=Path, help="folder that texbake bench --export wrote")
    options.add_argument("--repeats", type=int, default=3, help="timed runs of each job")
    options.add_argument(
        "--timeout", type=float, default=900.0, help="seconds after which one ends"
    )
    options.add_argument(
        "--dry-run", action="store_true", help="write what the program reads, and start nothing"
    )
    return options


def do_jobs(chosen, program, version, command_of):
    """Do all jobs, and write the result file.

    `chosen`: parsed options. `command_of(job, stem)` returns a command, the path of what it
    writes, and what its pixels are; None for a job that the program cannot do. Names of files that
    it makes begin with `stem`.
    """
    contests, is_quick = [], False
    for path in sorted(chosen.folder.glob("*/settings.json")):
        case = json.loads(path.read_text("utf-8"))
        is_quick |= case["quick"]
        for task in dict.fromkeys(job["task"] for job in case["jobs"]):
            contest = {"task": task, "case": case["case"], "triangles": case["triangles"]}
            contest |= {"settings": [], "left_out": []}
            for number, job in enumerate(job for job in case["jobs"] if job["task"] == task):
                stem = path.parent.resolve() / f"{program.lower()}-{task}-{number}"
                job |= {key: str(path.parent.resolve() / job[key]) for key in FILES if key in job}
                command = command_of(job, stem)
                if command is not None and chosen.dry_run:
                    print(*command[0])
                elif command is not None:
                    kind, entry = _done(chosen, *command)
                    contest[kind].append({"program": program, "setting": job["setting"], **entry})
                    print(f"{case['case']}, {task}, {job['setting']}: {entry}", flush=True)
            if contest["settings"] or contest["left_out"]:
                contests.append(contest)
    result = {
        "format": "texbake-bench",
        "version": 2,
        "date": datetime.date.today().isoformat(),
        "quick": is_quick,
        "programs": {program: {"version": version, "machine": machine_figures()}},
        "contests": contests,
    }
    if chosen.dry_run:
        return
    path = chosen.folder / f"{program.lower()}.json"
    path.write_text(json.dumps(result, indent=2) + "\n", "utf-8")
    print(f"wrote {path}")


def machine_figures():
    """Describe this machine as `texbake bench` does, without its name."""
    figures = {
        "system": platform.system(),
        "processor": platform.machine(),
        "processors": os.cpu_count() or 1,
        "python": platform.python_version(),
    }
    if platform.system() == "Linux":
        lines = Path("/proc/cpuinfo").read_text() + Path("/proc/meminfo").read_text()
        found = dict(re.findall(r"^(model name|MemTotal)\s*:\s*(.*)$", lines, re.MULTILINE))
        if "model name" in found:
            figures["model"] = found["model name"].strip()
        figures["memory_bytes"] = int(found["MemTotal"].split()[0]) * 1024
    return figures


def _done(chosen, command, output, form=None):
    """Run a command; return which list its entry belongs to, and the entry."""
    seconds, peak = [], None
    for _ in range(chosen.repeats):
        report = launched(command, chosen.timeout)
        if report["code"] != 0 or not output.exists():
            lines = [line for line in report["output"].splitlines() if line.strip()]
            reason = f"exit code {report['code']}: {lines[-1] if lines else 'it wrote no file'}"
            return "left_out", {"reason": reason}
        seconds.append(report["seconds"])
        peak = max(peak or 0, report.get("peak_bytes", 0)) or None
    entry = {"seconds": seconds, "peak_bytes": peak}
    entry["output"] = output.relative_to(chosen.folder.resolve()).as_posix()
    return "settings", entry | ({"form": form} if form else {})


def launched(command, timeout):
    """Run a command to its end, or to the timeout; return what `launcher.py` reports."""
    line = [sys.executable, "-I", str(RUNNERS / "launcher.py"), str(timeout), *map(str, command)]
    with subprocess.Popen(line, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        answer = process.stdout.read()  # the launcher ends its command when stdin is closed
    return json.loads(answer)
