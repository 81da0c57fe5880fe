"""A signal ends the process with one line: while a kernel works, and before the work."""

import os
import signal
import subprocess
import sys

import pytest

# `deaf` takes minutes without the interpreter, as a kernel does, which hears no signal meanwhile.
PROGRAM = """
import hashlib, sys, threading
from pathlib import Path
from texbake.parallel import run_bands
from texbake_cli.signals import end_cleanly_on_signals, raised_signals
from texbake.files import appearing_together, replacing, scratch_folder

def deaf():
    hashlib.pbkdf2_hmac("sha512", b"", b"", 1_000_000_000)

class Finalized:
    def __del__(self):  # Python drops what is raised here
        threading.Event().wait(60)

def work(start, stop):
    if threading.current_thread() is not threading.main_thread():
        deaf()
    while True:
        threading.Event().wait(0.01)

end_cleanly_on_signals()
with raised_signals(), scratch_folder() as scratch, appearing_together():
    (scratch / "copy.bin").write_bytes(b"copy")
    (scratch / "deep" / "er").mkdir(parents=True)
    (scratch / "deep" / "er" / "away").symlink_to(Path(sys.argv[1]))
    with replacing(Path(sys.argv[1]) / "map.png") as temporary:
        temporary.write_bytes(b"newer")
    with replacing(Path(sys.argv[1]) / "mesh.obj") as temporary:
        {work}
"""
READY = "threading.Timer(0.3, print, ['ready'], {'flush': True}).start(); "
WORKS = {
    "nothing": READY + "deaf()",
    "only the main thread": READY + "run_bands(work, 2, band=1, threads=2)",
    "a finalizer": READY + "Finalized()",
}

# A signal while modules are imported.
EARLY = """
import os, sys
from texbake_cli import run

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "click":
            os.kill(os.getpid(), number)

number = int(sys.argv[1])
sys.meta_path.insert(0, Finder())
run()
"""

# A signal while Python takes its modules apart.
LATE = """
import os, sys
from texbake_cli.signals import end_cleanly_on_signals

class Late:
    def __del__(self, kill=os.kill, process=os.getpid(), number=int(sys.argv[1])):
        kill(process, number)

late = Late()
end_cleanly_on_signals()
"""
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")


@pytest.mark.parametrize(("name", "hears"), [
    *(("SIGTERM", hears) for hears in WORKS), ("SIGINT", "a finalizer"), ("SIGHUP", "nothing"),
])  # fmt: skip
def test_it_ends_and_leaves_only_the_older_files(name, hears, tmp_path):
    outputs, scratch = tmp_path / "outputs", tmp_path / "scratch"
    outputs.mkdir()
    scratch.mkdir()
    (outputs / "map.png").write_bytes(b"older")
    number = getattr(signal, name)
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", PROGRAM.replace("{work}", WORKS[hears]), str(outputs)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, env={**os.environ, "TMPDIR": str(scratch)},
    )  # fmt: skip
    try:
        assert process.stdout.readline() == b"ready\n"
        process.send_signal(number)
        _, said = process.communicate(timeout=30)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 128 + number
    assert said.decode() == f"texbake: {'interrupted' if name == 'SIGINT' else 'terminated'}\n"
    assert {file.name: file.read_bytes() for file in outputs.iterdir()} == {"map.png": b"older"}
    assert not list(scratch.iterdir())


@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT"])
def test_it_ends_while_modules_are_imported(name):
    number = getattr(signal, name)
    done = subprocess.run(
        [sys.executable, "-P", "-c", EARLY, str(int(number))], capture_output=True, text=True
    )
    said = "interrupted" if name == "SIGINT" else "terminated"
    assert (done.returncode, done.stderr) == (128 + number, f"texbake: {said}\n")


@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT"])
def test_the_exit_code_of_a_command_that_has_ended_stands(name):
    number = str(int(getattr(signal, name)))
    done = subprocess.run([sys.executable, "-P", "-c", LATE, number], capture_output=True)
    assert (done.returncode, done.stderr) == (0, b"")
