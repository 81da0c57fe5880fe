import os
import sys
from pathlib import Path

import pytest

from texbake.child import ChildError
from texbake.mapping.atlas.cutting.xatlas_charts import WorkerRequest, run_in_workers

# A worker that answers with its process id and the request, or runs the request as code.
WORKER = """
import os, sys, time
from texbake.child import serve

out = os.dup(1)

def answer(request):
    exec(request)
    return os.getpid(), request

serve(answer)
"""


@pytest.fixture(autouse=True)
def worker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A module of a worker in the import path."""
    (tmp_path / "exec_worker.py").write_text(WORKER)
    monkeypatch.syspath_prepend(tmp_path)


def answers_to(
    bodies: list[str], *, timeout: float = 60.0, threads: int = 1
) -> list[tuple[int, str] | ChildError]:
    def read(answer: tuple[int, str]) -> tuple[int, str]:
        number, body = answer
        return int(number), body

    requests = [WorkerRequest(body=body.__str__, read=read, timeout=timeout) for body in bodies]
    return run_in_workers("exec_worker", requests, threads=threads)


def reasons(answers: list[tuple[int, str] | ChildError]) -> list[str]:
    return [answer.reason for answer in answers if isinstance(answer, ChildError)]


def test_one_worker_answers_request_after_request() -> None:
    bodies = [f"x = {number}" for number in range(5)]
    answers = answers_to(bodies)
    assert [body for _, body in answers] == bodies  # type: ignore[misc]
    assert len({pid for pid, _ in answers}) == 1  # type: ignore[misc]


def test_answers_come_in_the_order_of_requests_for_any_number_of_workers() -> None:
    bodies = [f"time.sleep({0.2 - 0.05 * number})" for number in range(4)]
    answers = answers_to(bodies, threads=4)
    assert [body for _, body in answers] == bodies  # type: ignore[misc]
    assert len({pid for pid, _ in answers}) == 4  # type: ignore[misc]


def test_without_requests_no_worker_starts(tmp_path: Path) -> None:
    assert answers_to([]) == []


def test_a_worker_that_crashes_is_replaced(tmp_path: Path) -> None:
    answers = answers_to(["", "print('oh', file=sys.stderr); os._exit(7)", ""])
    first, _, last = answers
    assert reasons(answers) == ["crashed (exit code 7, oh)"]
    assert isinstance(first, tuple) and isinstance(last, tuple)
    assert first[0] != last[0]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")
@pytest.mark.parametrize("name", ["SIGKILL", "SIGTERM"])
def test_a_request_whose_worker_is_killed_is_sent_once_more(tmp_path: Path, name: str) -> None:
    been = tmp_path / "been"
    end = f"import signal; os.kill(os.getpid(), signal.{name})"
    once = f"if not os.path.exists({str(been)!r}): open({str(been)!r}, 'w'); {end}"
    answers = answers_to([once, end, ""])
    assert isinstance(answers[0], tuple) and isinstance(answers[2], tuple)
    assert reasons(answers) == [f"crashed ({name})"]


def test_hanging_is_not_waited_for_again_and_again(tmp_path: Path) -> None:
    answers = answers_to(["time.sleep(100)"] * 20, timeout=0.5)
    slow = ["took longer than 0.5 s"] * 3
    assert reasons(answers) == slow + ["took too long on others"] * 17


@pytest.mark.parametrize("garbage", [b"\xff" * 100, (3).to_bytes(8, "little") + b"abc"])
def test_invalid_output_is_not_an_answer(garbage: bytes) -> None:
    answers = answers_to([f"os.write(out, {garbage!r})", ""])
    assert reasons(answers) == ["gave an invalid answer"]
    assert isinstance(answers[1], tuple)


def test_no_worker_is_left(tmp_path: Path) -> None:
    answers = answers_to(["time.sleep(0.1)"] * 4, threads=2)
    for answer in answers:
        assert isinstance(answer, tuple)
        with pytest.raises(ProcessLookupError):
            os.kill(answer[0], 0)


def test_an_error_in_this_process_leaves_no_worker(tmp_path: Path) -> None:
    slow = f"open({str(tmp_path / 'slow')!r}, 'w').write(str(os.getpid())); time.sleep(100)"
    requests = [
        WorkerRequest(body=slow.__str__, read=str, timeout=99.0),
        WorkerRequest(body="time.sleep(0.5)".__str__, read=lambda answer: 1 / 0, timeout=99.0),
    ]
    with pytest.raises(ZeroDivisionError):
        run_in_workers("exec_worker", requests, threads=2)
    process = int((tmp_path / "slow").read_text() or 0)
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)
