"""Keep Ctrl-C out of a compilation: numba and LLVM do not survive an exception in their midst."""

from __future__ import annotations

import signal
import threading
from types import FrameType

from numba.core import event


def hold_interrupts() -> None:
    """Let no Ctrl-C into a compilation from now on: it is raised when what is being compiled is ready."""
    event.register("numba:compiler_lock", _HeldInterrupts())


class _HeldInterrupts(event.Listener):
    """Hold Ctrl-C back while the main thread compiles; a second one is not held."""

    def __init__(self) -> None:
        """Nothing is compiled yet."""
        self._depth = 0
        self._is_held = False

    def on_start(self, _: event.Event) -> None:
        """Take Python's handler away; one that the user has set is left to itself."""
        if threading.current_thread() is not threading.main_thread():
            return
        self._depth += 1
        if self._depth == 1 and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self._hold)

    def on_end(self, _: event.Event) -> None:
        """Give the handler back, and raise what came in between.

        Raises:
            KeyboardInterrupt: where Ctrl-C was pressed.
        """
        if threading.current_thread() is not threading.main_thread():
            return
        self._depth -= 1
        if self._depth == 0:
            if signal.getsignal(signal.SIGINT) == self._hold:
                signal.signal(signal.SIGINT, signal.default_int_handler)
            if self._is_held:
                self._is_held = False
                raise KeyboardInterrupt

    def _hold(self, number: int, frame: FrameType | None) -> None:
        if self._is_held:
            self._is_held = False
            signal.default_int_handler(number, frame)
        self._is_held = True
