"""What all tests share. The kernels are compiled once a machine: numba caches them beside the modules."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("few", settings.get_profile("repeatable"), max_examples=5)
settings.load_profile("repeatable")


@pytest.fixture(scope="session")
def repository() -> Path:
    """The folder that holds README.md, scenarios/ and the package."""
    return Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def scenarios(repository: Path) -> Path:
    """The folder of scenario files."""
    return repository / "scenarios"


@pytest.fixture(scope="session", autouse=True)
def _compiled_kernels() -> None:
    """Compile once, so that no test waits for it or meets the message about it."""
    from cbrrt_ompl.ompl_plugin.availability import has_ompl
    from cbrrt_ompl.planning import warm_up_planner

    warm_up_planner("cb-rrt" if has_ompl() else "cb-rrt-compiled")


@pytest.fixture
def quiet_ompl() -> Iterator[None]:
    """Keep OMPL's log out of the tests' output."""
    from cbrrt_ompl.ompl_plugin import run

    with run.quiet_ompl():
        yield


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Where there is no OMPL, skip what is marked so and what is given a planner that OMPL runs, and say why."""
    from cbrrt_ompl.errors import OmplMissingError
    from cbrrt_ompl.ompl_plugin.availability import has_ompl
    from cbrrt_ompl.planners.registry import PLANNERS
    from cbrrt_ompl.planning import available_planners

    given = item.callspec.params.get("planner") if hasattr(item, "callspec") else None
    unavailable = isinstance(given, str) and given in set(PLANNERS) - set(available_planners())
    if unavailable or (item.get_closest_marker("needs_ompl") and not has_ompl()):
        pytest.skip(str(OmplMissingError("this test")))
