"""Starts the programs of a benchmark and stops them when it is interrupted."""

import subprocess
import threading
from dataclasses import dataclass
from typing import List, Optional, Sequence, Set

from .benchmark_cells import Record

STDERR_LINES_KEPT = 8


class Stopped(Exception):
    """The benchmark was interrupted while a program ran: its result must not be stored."""


@dataclass(frozen=True)
class Outcome:
    """How a program ended."""

    exit_code: Optional[int]
    stderr: List[str]

    def failure(self, stage: str) -> Record:
        """The part of a record that says what went wrong."""
        return failure(stage, self.stderr[-1] if self.stderr else "no message", self.exit_code, self.stderr)


def failure(stage: str, message: str, exit_code: Optional[int] = None, stderr: Sequence[str] = ()) -> Record:
    """The part of a failed cell's record that differs from a finished one."""
    return {"ok": False, "failed_at": stage, "exit_code": exit_code, "error": message, "stderr": list(stderr)}


class Programs:
    """Starts programs, several at a time if asked, and can stop all that it started."""

    def __init__(self, timeout_s: float) -> None:
        self._timeout_s = timeout_s
        self._lock = threading.Lock()
        self._running: Set[subprocess.Popen] = set()
        self._stopped = False

    def run(self, command: Sequence[object]) -> Outcome:
        """Waits for the program. Raises Stopped if `stop` was called meanwhile."""
        with self._lock:
            if self._stopped:
                raise Stopped
            # A session of its own: Ctrl-C reaches this script only, which then stops the programs. Otherwise a
            # program that died from Ctrl-C would be taken for a failed cell.
            process = subprocess.Popen(
                [str(part) for part in command], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE, text=True, errors="replace", start_new_session=True
            )
            self._running.add(process)
        try:
            _, text = process.communicate(timeout=self._timeout_s)
        except subprocess.TimeoutExpired:
            process.kill()
            _, text = process.communicate()
            text += f"\nstopped after {self._timeout_s:g} s (--timeout)"
        finally:
            with self._lock:
                self._running.discard(process)
        if self._stopped:
            raise Stopped
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        return Outcome(process.returncode, lines[-STDERR_LINES_KEPT:])

    def stop(self) -> None:
        """Ends what runs; nothing can be started afterwards."""
        with self._lock:
            self._stopped = True
            for process in self._running:
                process.kill()
