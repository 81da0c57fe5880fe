"""USD files are read by a process of its own: whatever happens to it is an error of one line."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from texbake.child import memory_allowed, seconds_allowed
from texbake.errors import FileFormatError
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.shapes import cube

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits are those of Linux")

# A library in the place of usd-core, whose first function does what a damaged file makes it do.
PXR = {
    "__init__": "",
    "Usd": "",
    "Tf": "class ErrorException(Exception): pass",
    "Sdf": """
import ctypes, os, resource, signal, sys, time
class Layer:
    def FindOrOpen(path):
        print("a warning of the library")
        print("an error of the library", file=sys.stderr)
        {damage}
""",
}
HANG = "open('pid', 'w').write(str(os.getpid())); signal.pause()"


@pytest.fixture
def damage(tmp_path, monkeypatch):
    def put(what):
        folder = tmp_path / "modules" / "pxr"
        folder.mkdir(parents=True)
        for name, text in PXR.items():
            (folder / f"{name}.py").write_text(text.replace("{damage}", what))
        monkeypatch.syspath_prepend(folder.parent)
        monkeypatch.setenv("PYTHONPATH", str(folder.parent))
        monkeypatch.chdir(tmp_path)
        (tmp_path / "a.usda").write_text("#usda 1.0\n")
        return tmp_path / "a.usda"

    return put


@pytest.mark.parametrize(("what", "said"), [
    ("ctypes.string_at(0)", r"the library that reads it stopped \(SIGSEGV\)"),
    ("os.abort()", r"the library that reads it stopped \(SIGABRT\)"),
    ("os._exit(3)", r"the library that reads it stopped \(exit code 3\)"),
    ("os.kill(os.getpid(), signal.SIGKILL)", "the process that reads it was ended twice"),
    ("bytearray(4 << 30)", "takes more memory than a file of its size may"),
    ("os.write(3, b'abc'); os._exit(0)", r"reads it stopped \(exit code 0\)"),
    ("resource.setrlimit(resource.RLIMIT_CPU, (1, 9))\n        while True: pass",
     "takes longer than a file of its size may"),
    ("signal.setitimer(signal.ITIMER_REAL, 0.1); signal.pause()",
     "takes longer than a file of its size may"),
])  # fmt: skip
def test_the_end_of_the_process_is_one_line(damage, what, said, capfd):
    path = damage(what)
    with pytest.raises(FileFormatError, match=said) as error:
        read_mesh(path)
    assert str(error.value).startswith(f"{path}: ") and "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")


def test_the_kernel_has_the_limits(damage):
    said = "; ".join(
        f"assert resource.getrlimit(resource.RLIMIT_{name})[0] {most}"
        for name, most in (("CPU", "== 10"), ("AS", f"< {5 << 30}"))
    )
    path = damage(f"{said}; assert 50 < signal.getitimer(signal.ITIMER_REAL)[0] <= 60; os._exit(7)")
    with pytest.raises(FileFormatError, match="exit code 7"):
        read_mesh(path)


def test_limits_grow_with_the_file():
    assert seconds_allowed(0) == 10
    assert seconds_allowed(400_000_000) == 110
    assert memory_allowed(1000) == 1 << 30
    assert memory_allowed(1 << 30) == 64 << 30


def test_a_fault_of_our_own_keeps_its_traceback(damage):
    path = damage("raise ZeroDivisionError('ours')")
    with pytest.raises(RuntimeError, match="ours"):
        read_mesh(path)


def _wait(condition):
    end = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def _is_gone(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except FileNotFoundError:
        return True


@pytest.mark.parametrize("sent", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_it_ends_with_the_process_that_asks(damage, tmp_path, sent):
    path = damage(HANG)
    asking = subprocess.Popen(
        [sys.executable, "-P", "-m", "texbake", "info", str(path)], stderr=subprocess.PIPE
    )
    pid_file = tmp_path / "pid"
    _wait(lambda: pid_file.exists() and pid_file.read_text())
    asking.send_signal(sent)
    _, said = asking.communicate(timeout=30)
    assert asking.returncode == (-9 if sent == signal.SIGKILL else 128 + sent)
    assert b"Traceback" not in said
    _wait(lambda: _is_gone(int(pid_file.read_text())))


def test_layers_in_the_folder_count_and_others_do_not(tmp_path, monkeypatch):
    pytest.importorskip("pxr", reason="usd-core is not installed")
    from texbake.mesh.files import usd_stage

    allowed = []
    monkeypatch.setattr(usd_stage.LIMITS, "allow", allowed.append)
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "a.usda").write_text("#usda 1.0\n(subLayers = [@b.usda@, @/etc/x.usda@])")
    (tmp_path / "sub" / "b.usda").write_text("#usda 1.0\n(subLayers = [@a.usda@, @none.usda@])  ")
    (tmp_path / "outside.usda").write_text("#usda 1.0\n")
    root = tmp_path / "sub" / "root.usda"
    root.write_text("#usda 1.0\n(subLayers = [@a.usda@, @../outside.usda@])")
    layers = list(usd_stage.layers_of_stage(str(root)))
    assert [Path(layer.realPath).stem for layer in layers] == ["root", "a", "b"]
    assert allowed == [(tmp_path / "sub" / f"{name}.usda").stat().st_size for name in "ab"]


def test_a_usd_file_in_a_folder_with_modules_runs_none_of_them(tmp_path, monkeypatch):
    pytest.importorskip("pxr", reason="usd-core is not installed")
    write_mesh(cube(), tmp_path / "a.usda")
    for name in ("pxr.py", "json.py", "numpy.py"):
        (tmp_path / name).write_text("open('ran', 'w')")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", ["", *sys.path])
    assert read_mesh("a.usda").n_faces == cube().n_faces
    assert not (tmp_path / "ran").exists()
    assert os.getcwd() == str(tmp_path)  # noqa: PTH109
