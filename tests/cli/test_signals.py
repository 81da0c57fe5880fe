"""A signal ends the process with one line: while a library works, and before and after the work."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

# `deaf` takes minutes without the interpreter, which hears no signal meanwhile; `holding` keeps it
# for ever, as some functions of NumPy do for seconds, so that no other thread has it either.
PROGRAM = """
import collections, hashlib, itertools, subprocess, sys, threading
from pathlib import Path
from texbake.parallel import run_bands
from texbake_cli.signals import end_cleanly_on_signals, raised_signals
from texbake.files import appearing_together, replacing, scratch_folder

def deaf():
    hashlib.pbkdf2_hmac("sha512", b"", b"", 1_000_000_000)

def holding():
    with raised_signals():
        subprocess.Popen("sleep 0.5; echo ready", shell=True)
        threading.Event().wait(0.2)
        collections.deque(itertools.repeat(0), maxlen=0)

def work(start, stop):
    if threading.current_thread() is not threading.main_thread():
        deaf()
    while True:
        threading.Event().wait(0.01)

end_cleanly_on_signals()
with scratch_folder() as scratch, appearing_together():
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
    "no thread": "holding()",
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
# A signal after a folder was made, and before anybody knows of it.
FORGOTTEN = """
import os, sys, texbake
from texbake.files import new_scratch_folder
from texbake_cli import run

def info_file(*arguments, **options):
    new_scratch_folder()
    os.kill(os.getpid(), number)

texbake.info_file = info_file
number = int(sys.argv[1])
sys.argv[1:] = ["info", "mesh.obj"]
run()
"""
# A signal in a finalizer, where Python drops exceptions.
DROPPED = """
import os, sys, texbake, time
from texbake_cli import run

class Sent:
    def __del__(self):
        os.kill(os.getpid(), number)

def info_file(*arguments, **options):
    Sent()
    time.sleep(60)

texbake.info_file = info_file
number = int(sys.argv[1])
sys.argv[1:] = ["info", "mesh.obj"]
run()
"""
# A signal after the command has ended: to a function that is called at exit, to one that keeps the
# interpreter there, and to a finalizer when Python hears no signals any more.
LATE = """
import atexit, builtins, collections, itertools, os, sys
from texbake_cli import run
from texbake_cli.signals import end_cleanly_on_signals

class Sent:
    def __del__(self):
        os.kill(os.getpid(), number)

def hold():
    os.kill(os.getpid(), number)
    collections.deque(itertools.repeat(0), maxlen=0)

number = int(sys.argv[1])
end_cleanly_on_signals()  # what is registered now is called before what this has registered
{late}
sys.argv[1:] = {words}
run()
"""
ENDINGS = {
    "called": "atexit.register(os.kill, os.getpid(), number)",
    "holding": "atexit.register(hold)",
    "finalizer": "builtins.sent = Sent()",
}

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")


@pytest.mark.parametrize("hears", WORKS)
@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT", "SIGHUP"])
def test_it_ends_and_leaves_only_the_older_files(name: str, hears: str, tmp_path: Path) -> None:
    outputs, scratch = tmp_path / "outputs", tmp_path / "scratch"
    outputs.mkdir()
    scratch.mkdir()
    (outputs / "map.png").write_bytes(b"older")
    number = getattr(signal, name)
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", PROGRAM.replace("{work}", WORKS[hears]), str(outputs)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "TMPDIR": str(scratch)},
    )
    try:
        assert process.stdout is not None
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


@pytest.mark.parametrize("code", [EARLY, FORGOTTEN, DROPPED], ids=["early", "forgotten", "dropped"])
@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT"])
def test_it_ends_at_any_moment(name: str, code: str, tmp_path: Path) -> None:
    number = getattr(signal, name)
    done = subprocess.run(
        [sys.executable, "-P", "-c", code, str(int(number))],
        capture_output=True,
        text=True,
        env={**os.environ, "TMPDIR": str(tmp_path)},
    )
    assert not list(tmp_path.iterdir())
    said = "interrupted" if name == "SIGINT" else "terminated"
    assert (done.returncode, done.stderr) == (128 + number, f"texbake: {said}\n")


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("name", ["SIGINT", "SIGHUP"])
def test_the_exit_code_of_a_command_that_has_ended_stands(ending: str, name: str) -> None:
    for words, code, said in (
        (["schema", "scene"], 0, ""),
        (["info", "none.obj"], 1, "texbake: none.obj: there is no such file; check its name\n"),
    ):
        program = LATE.format(late=ENDINGS[ending], words=words)
        done = subprocess.run(
            [sys.executable, "-P", "-c", program, str(int(getattr(signal, name)))],
            capture_output=True,
            text=True,
            timeout=60,
        )
        assert (done.returncode, done.stderr) == (code, said)
        assert bool(done.stdout) == (code == 0)


# A thread that was started and had no memory for its first line, as `threading` sees it.
NEVER_BEGINS = """
import _thread, threading
_thread.start_new_thread = threading._start_new_thread = lambda function, arguments: 1
from texbake_cli.progress_lines import Lines
from texbake_cli.signals import _raise_again, end_cleanly_on_signals
from texbake.core.signal_watch import end_with_parent
import types

end_cleanly_on_signals()
end_with_parent()
_raise_again(types.SimpleNamespace(exc_type=KeyboardInterrupt, exc_value=KeyboardInterrupt()))
with Lines(print):
    print("all of it")
"""


def test_a_thread_that_never_begins_is_not_waited_for() -> None:
    done = subprocess.run(
        [sys.executable, "-P", "-c", NEVER_BEGINS], capture_output=True, text=True, timeout=20
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "all of it\n", "")
