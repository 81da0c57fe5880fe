import os
import signal
import sys
import time
from pathlib import Path

import pytest

from texbake.mapping.atlas.cutting import workers
from texbake.mapping.atlas.cutting.workers import WorkerFailure, WorkerRequest, ask_workers

# A worker that answers with its process id and the request, or runs the request as code.
SCRIPT = """
import os, sys, time
requests = sys.stdin.buffer
while head := requests.read(8):
    request = requests.read(int.from_bytes(head, "little"))
    exec(request)
    answer = str(os.getpid()).encode() + b" " + request
    sys.stdout.buffer.write(len(answer).to_bytes(8, "little") + answer)
    sys.stdout.buffer.flush()
"""


def answers_to(
    folder: Path, bodies: list[str], *, timeout: float = 60.0, threads: int = 1
) -> list[tuple[int, str] | WorkerFailure]:
    script = folder / "worker.py"
    script.write_text(SCRIPT)

    def read(answer: bytes) -> tuple[int, str]:
        number, _, body = answer.partition(b" ")
        return int(number), body.decode()

    requests = [
        WorkerRequest(body=body.encode, read=read, timeout=timeout, most_bytes=1000)
        for body in bodies
    ]
    return ask_workers(script, requests, threads=threads)


def test_one_worker_answers_request_after_request(tmp_path: Path) -> None:
    bodies = [f"x = {number}" for number in range(5)]
    answers = answers_to(tmp_path, bodies)
    assert [body for _, body in answers] == bodies  # type: ignore[misc]
    assert len({pid for pid, _ in answers}) == 1  # type: ignore[misc]


def test_answers_come_in_the_order_of_requests_for_any_number_of_workers(tmp_path: Path) -> None:
    bodies = [f"time.sleep({0.2 - 0.05 * number})" for number in range(4)]
    answers = answers_to(tmp_path, bodies, threads=4)
    assert [body for _, body in answers] == bodies  # type: ignore[misc]
    assert len({pid for pid, _ in answers}) == 4  # type: ignore[misc]


def test_without_requests_no_worker_starts(tmp_path: Path) -> None:
    assert answers_to(tmp_path, []) == []


def test_a_worker_that_crashes_is_replaced(tmp_path: Path) -> None:
    first, crash, last = answers_to(tmp_path, ["", "print('oh', file=sys.stderr); os._exit(7)", ""])
    assert crash == WorkerFailure("crashed (exit code 7, oh)", 7)
    assert isinstance(first, tuple) and isinstance(last, tuple)
    assert first[0] != last[0]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")
@pytest.mark.parametrize("name", ["SIGKILL", "SIGTERM"])
def test_a_request_whose_worker_is_killed_is_sent_once_more(tmp_path: Path, name: str) -> None:
    been = tmp_path / "been"
    end = f"import signal; os.kill(os.getpid(), signal.{name})"
    once = f"if not os.path.exists({str(been)!r}): open({str(been)!r}, 'w'); {end}"
    answered, killed, last = answers_to(tmp_path, [once, end, ""])
    assert isinstance(answered, tuple) and isinstance(last, tuple)
    number = getattr(signal, name)
    assert killed == WorkerFailure(f"crashed (exit code {-number})", -number)


def test_a_worker_that_talks_much_to_stderr_does_not_hang(tmp_path: Path) -> None:
    request = "sys.stderr.write('x' * 1_000_000)"
    ((_, answer),) = answers_to(tmp_path, [request])  # type: ignore[misc]
    assert answer == request


def test_a_worker_that_hangs_is_killed_and_replaced(tmp_path: Path) -> None:
    start = time.perf_counter()
    hang, after = answers_to(tmp_path, ["time.sleep(100)", ""], timeout=1.0)
    assert hang == WorkerFailure("took longer than 1 s")
    assert isinstance(after, tuple)
    assert time.perf_counter() - start < 20.0


def test_hanging_is_not_waited_for_again_and_again(tmp_path: Path) -> None:
    answers = answers_to(tmp_path, ["time.sleep(100)"] * 20, timeout=0.5)
    slow = [WorkerFailure("took longer than 0.5 s")] * 3
    assert answers == slow + [WorkerFailure("took too long on others")] * 17


@pytest.mark.parametrize(
    "garbage",
    [
        "os.write(1, b'\\xff' * 100)",  # a length beyond all bounds
        "os.write(1, (3).to_bytes(8, 'little') + b'abc')",  # not a number
    ],
)
def test_invalid_output_is_not_an_answer(tmp_path: Path, garbage: str) -> None:
    nonsense, after = answers_to(tmp_path, [garbage, ""])
    assert nonsense == WorkerFailure("gave an invalid answer")
    assert isinstance(after, tuple)


def test_no_worker_is_left(tmp_path: Path) -> None:
    answers = answers_to(tmp_path, ["time.sleep(0.1)"] * 4, threads=2)
    for answer in answers:
        assert isinstance(answer, tuple)
        with pytest.raises(ProcessLookupError):
            os.kill(answer[0], 0)


def test_an_error_in_this_process_leaves_no_worker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[workers._Worker] = []
    start = workers._Worker.__init__

    def noted(self: workers._Worker, script: Path) -> None:
        start(self, script)
        started.append(self)

    monkeypatch.setattr(workers._Worker, "__init__", noted)
    script = tmp_path / "worker.py"
    script.write_text(SCRIPT)
    slow = WorkerRequest(body=lambda: b"time.sleep(100)", read=bytes, timeout=99.0, most_bytes=9)
    wrong = WorkerRequest(body=lambda: b"", read=lambda answer: 1 / 0, timeout=99.0, most_bytes=99)
    with pytest.raises(ZeroDivisionError):
        ask_workers(script, [slow, wrong], threads=2)
    assert len(started) == 2
    assert all(worker.process.poll() is not None for worker in started)
