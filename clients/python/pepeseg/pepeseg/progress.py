"""Progress on the terminal: bars by tqdm if it is installed, else lines."""

from __future__ import annotations

import sys
import time
from typing import Any

_LINE_SECONDS = 5.0


class Bar:
    """Shows one bar at a time, on standard error. Another title begins a new bar."""

    def __init__(self, unit: str, scaled: bool = False) -> None:
        self._unit = unit
        self._scaled = scaled
        self._title = ""
        self._bar: Any = None
        self._line_time = 0.0
        try:
            from tqdm.auto import tqdm
        except ImportError:
            tqdm = None
        self._tqdm = tqdm

    def show(self, title: str, done: int, total: int, note: str = "") -> None:
        """Shows `done` of `total`, and a note."""
        if self._tqdm is None:
            self._show_line(title, done, total, note)
            return
        if title != self._title:
            self.close()
            self._title = title
            self._bar = self._tqdm(
                total=total, desc=title, unit=self._unit, unit_scale=self._scaled
            )
        self._bar.total = total
        self._bar.set_postfix_str(note, refresh=False)
        self._bar.update(done - self._bar.n)

    def say(self, text: str) -> None:
        """Prints a line above the bar."""
        if self._bar is not None:
            self._tqdm.write(text, file=sys.stderr)
        else:
            print(text, file=sys.stderr, flush=True)

    def close(self) -> None:
        """Ends the bar, which stays on the terminal as it is."""
        if self._bar is not None:
            self._bar.close()
        self._bar, self._title = None, ""

    def _show_line(self, title: str, done: int, total: int, note: str) -> None:
        now = time.monotonic()
        if title == self._title and done < total and now - self._line_time < _LINE_SECONDS:
            return
        self._title, self._line_time = title, now
        self.say(f"{title}: {done}/{total} {self._unit}  {note}".rstrip())
