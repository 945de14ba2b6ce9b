"""Jobs on a cluster of dask.distributed: past one machine, or on workers of this one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from importlib import import_module
from typing import Any

from cbrrt_ompl.benchmark.job import J, Outcome, execute
from cbrrt_ompl.errors import CbrrtError

CONNECT_TIMEOUT = 15.0
"""Time that the scheduler may take to answer [s]."""

LOCAL = "local"
"""Address that stands for a cluster on this machine, made for the campaign."""


def run_on_cluster(waiting: Sequence[J], address: str, jobs: int = 1) -> Iterator[tuple[J, Outcome]]:
    """Run jobs on the workers of a cluster, each in a process of its own there.

    A job whose worker dies is run again by another one; one that has outlived several workers counts as crashed.

    Args:
        waiting: what to run.
        address: of the scheduler, such as ``tcp://host:8786``, or `LOCAL`.
        jobs: workers of a local cluster.

    Yields:
        Each job with its outcome when it is done. Closing the iterator gives the others up.

    Raises:
        CbrrtError: if there is no dask.distributed, or no scheduler at that address.
    """
    distributed = _import_distributed()
    with ExitStack() as stack:
        client = _connect(distributed, stack, address, jobs)
        futures = {client.submit(execute, job, key=job.name, pure=False): job for job in waiting}
        for future in distributed.as_completed(list(futures), raise_errors=False):
            yield futures.pop(future), _outcome(future)
            future.release()


def _import_distributed() -> Any:
    """The optional dependency."""
    try:
        return import_module("distributed")
    except ImportError:
        raise CbrrtError("a scheduler needs dask.distributed: pip install 'cbrrt-ompl[distributed]'") from None


def _connect(distributed: Any, stack: ExitStack, address: str, jobs: int) -> Any:
    """A client of the scheduler."""
    if address == LOCAL:
        address = stack.enter_context(
            distributed.LocalCluster(n_workers=jobs, threads_per_worker=1, processes=True, dashboard_address=None)
        )
    try:
        return stack.enter_context(distributed.Client(address, timeout=CONNECT_TIMEOUT))
    except (OSError, ValueError) as error:
        raise CbrrtError(f"no scheduler at {address}: {' '.join(str(error).split())}") from None


def _outcome(future: Any) -> Outcome:
    """The outcome of a job; an error where the cluster gave it up."""
    if future.status == "finished":
        outcome: Outcome = future.result()
        return outcome
    return Outcome(error=f"given up by the cluster: {future.exception()!r}")
