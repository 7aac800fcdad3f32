"""Workers that attack, each in a process of its own, and whoever watches them."""

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Timer

from benchmarks.attack.material import Material
from benchmarks.attack.outcome import Outcome

_SERVE = "from benchmarks.attack.worker import serve; serve()"
# A worker watches its own cases; one that does not answer at all is ended after this, s.
_SILENCE = 600.0


class Worker:
    """A process that answers for one case after the other."""

    def __init__(self, home: Path, material: Material, limit: float, seed: int) -> None:
        self.home = home
        self._arguments = str(home), str(material.folder), str(limit), str(seed)
        self._process: subprocess.Popen[str] | None = None

    def attack(self, kind: str, index: int) -> Outcome:
        """Return what a case comes to."""
        self.start()
        if answer := self._answer(f"{kind} {index}"):
            return Outcome(**json.loads(answer))
        self.close()
        return Outcome(kind, index, "", [], faults={"hang": "the process that ran it had to be ended"})

    def _answer(self, question: str = "") -> str:
        """Return the next line that the process says; empty if it ends, or says nothing for too long."""
        process = self._process
        assert process is not None
        assert process.stdin is not None
        assert process.stdout is not None
        timer = Timer(_SILENCE, process.kill)
        timer.start()
        try:
            if question:
                print(question, file=process.stdin, flush=True)
            return process.stdout.readline()
        except BrokenPipeError:
            return ""
        finally:
            timer.cancel()

    def start(self) -> None:
        """Start the process, unless there is one; the first makes the material as well."""
        if self._process is not None:
            return
        path = os.pathsep.join(filter(None, [os.environ.get("PYTHONPATH"), str(Path(__file__).parents[2])]))
        one = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", _SERVE, *self._arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | one | {"PYTHONPATH": path},
            # Ctrl-C is for who watches.
            start_new_session=True,
        )
        if not self._answer():
            self.close()
            raise SystemExit("the process that attacks does not start")

    def close(self) -> None:
        """End the process and all that it started."""
        if self._process is not None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.communicate()
        self._process = None


def attack(
    cases: list[tuple[str, int]],
    material: Material,
    home: Path,
    seed: int,
    limit: float,
    processes: int,
    keep: Callable[[Outcome, Path], None],
) -> Iterator[Outcome]:
    """Yield the outcomes of cases, as they come; `keep` sees those that failed with the folder they left."""
    waiting: SimpleQueue[tuple[str, int]] = SimpleQueue()
    for case in cases:
        waiting.put(case)
    done: SimpleQueue[Outcome | None] = SimpleQueue()

    workers = [Worker(home / f"worker-{number}", material, limit, seed) for number in range(processes)]
    workers[0].start()

    def work(worker: Worker) -> None:
        try:
            while True:
                outcome = worker.attack(*waiting.get_nowait())
                if outcome.faults:
                    keep(outcome, worker.home)
                done.put(outcome)
        except Empty:
            pass
        finally:
            worker.close()
            shutil.rmtree(worker.home, ignore_errors=True)
            done.put(None)

    with ThreadPoolExecutor(processes) as threads:
        futures = [threads.submit(work, worker) for worker in workers]
        ended = 0
        try:
            while ended < processes:
                if (outcome := done.get()) is None:
                    ended += 1
                else:
                    yield outcome
        finally:
            while not waiting.empty():
                waiting.get()
        for future in futures:
            future.result()
