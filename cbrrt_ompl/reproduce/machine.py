"""Where and with what the numbers were measured."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from cbrrt_ompl.processes import available_cores

PACKAGES = ("cbrrt-ompl", "ompl", "python-fcl", "numpy", "numba", "scipy")


def processor() -> str:
    """The processor's name, as Linux tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor() or platform.machine())


def machine() -> str:
    """Processor, cores that may be used, system and Python, in one line."""
    cores = available_cores()
    return (
        f"{processor()}, {cores} core{'s' if cores > 1 else ''}, {platform.system()} {platform.machine()}, "
        f"Python {platform.python_version()}"
    )


def versions() -> str:
    """Versions of this package and of what it plans with, in one line."""
    return ", ".join(f"{name} {_version(name)}" for name in PACKAGES)


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
