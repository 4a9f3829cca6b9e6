"""A progress bar with time to go, for work that takes longer than a few seconds."""

import sys
import time
from typing import Optional, TextIO

BAR_CELLS = 30
REDRAW_PERIOD_S = 0.2  # on a terminal
LOG_PERIOD_S = 10.0  # in a log file, where each line stays


def clock(seconds: float) -> str:
    """A duration as m:ss, or h:mm:ss from one hour on."""
    total = int(round(seconds))
    hours, minutes, rest = total // 3600, total // 60 % 60, total % 60
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


class Progress:
    """Counts finished items of `total` and shows share, rate and time to go on stderr.

    On a terminal the line is redrawn; elsewhere a line is written every ten seconds.
    """

    def __init__(self, total: int, what: str, stream: Optional[TextIO] = None) -> None:
        self._total = max(total, 1)
        self._what = what
        self._stream = stream if stream is not None else sys.stderr
        self._terminal = self._stream.isatty()
        self._done = 0
        self._start = time.monotonic()
        self._last_drawn = self._start
        self._drawn = False

    def __enter__(self) -> "Progress":
        return self

    def __exit__(self, *_: object) -> None:
        if self._terminal and self._drawn:
            self._draw()
            self._stream.write("\n")
            self._stream.flush()

    def step(self, count: int = 1) -> None:
        """Adds `count` finished items."""
        self._done += count
        now = time.monotonic()
        if now - self._last_drawn >= (REDRAW_PERIOD_S if self._terminal else LOG_PERIOD_S):
            self._last_drawn = now
            self._draw()

    def _draw(self) -> None:
        elapsed = max(time.monotonic() - self._start, 1e-9)
        share = min(self._done / self._total, 1.0)
        rate = self._done / elapsed
        to_go = clock((self._total - self._done) / rate) if rate > 0 else "?"
        filled = int(share * BAR_CELLS)
        line = (
            f"{self._what} [{'#' * filled}{'.' * (BAR_CELLS - filled)}] {100 * share:3.0f} % "
            f"{self._done}/{self._total}  {rate:.1f}/s  ETA {to_go}"
        )
        self._stream.write(f"\r{line}\033[K" if self._terminal else line + "\n")
        self._stream.flush()
        self._drawn = True
