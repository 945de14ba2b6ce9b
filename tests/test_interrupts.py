"""Ctrl-C while a kernel is compiled."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

COMPILE = """
import os, signal, threading
from numba import njit
from numba.core.compiler_lock import global_compiler_lock
from cbrrt_ompl.kernels.interrupts import hold_interrupts

hold_interrupts()

@njit
def slow(x):
    for _ in range(3):
        x = {0: x}[0] + len([i for i in range(int(x))]) + sorted([x, 1.0])[0]
    return x

def press():
    # Ctrl-C as soon as the main thread compiles
    while global_compiler_lock._lock.acquire(blocking=False):
        global_compiler_lock._lock.release()
    os.kill(os.getpid(), signal.SIGINT)

threading.Thread(target=press).start()
try:
    slow(2.0)
except KeyboardInterrupt:
    print("interrupted", len(slow.signatures))
print(slow(2.0) == slow.py_func(2.0))
print(signal.getsignal(signal.SIGINT) is signal.default_int_handler)
"""


def test_an_interrupted_compilation_is_finished_first() -> None:
    """Or else numba says 'no compiled object yet', or crashes, the next time."""
    run = subprocess.run([sys.executable, "-c", COMPILE], capture_output=True, text=True, check=False, timeout=120)
    assert run.stderr == ""
    assert run.stdout.splitlines() == ["interrupted 1", "True", "True"]


@pytest.mark.parametrize("delay", [2.0, 5.0])
def test_the_command_line_ends_at_once_in_a_first_compilation(tmp_path: Path, delay: float) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-m", "cbrrt_ompl", "plan", "office", "--planner", "cb-rrt-compiled"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment) as process:
        time.sleep(delay)
        process.send_signal(signal.SIGINT)
        start = time.monotonic()
        _, errors = process.communicate(timeout=60.0)
    assert (process.returncode, errors) == (130, "cbrrt: interrupted\n")
    assert time.monotonic() - start < 5.0
