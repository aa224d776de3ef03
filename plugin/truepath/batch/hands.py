"""Who corrects the parcels: this process, or the workers of a Dask cluster."""

from __future__ import annotations

import signal
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any, Protocol

import truepath
from truepath.batch.parcels import one_by_one
from truepath.batch.work import Outcome, Parcel, correct_parcel, worker_version
from truepath.errors import InputError, TruepathError

if TYPE_CHECKING:
    from distributed import Client, Future

INSTALL = "pip install 'truepath[batch]' (Dask), or --workers 1"
ANSWER_S = 20
FIRST_WORKER_S = 60
DEATHS_TOLERATED = 1  # of workers while they hold a parcel, before it is looked at program by program


class LostClusterError(TruepathError):
    """The cluster is gone before everything was done."""


class Hands(Protocol):
    """Somebody who corrects parcels."""

    workers: int

    def correct(self, parcels: Iterator[Parcel]) -> Iterator[tuple[Parcel, list[Outcome]]]:
        """Outcomes of all parcels, each program once, in the order in which they are done.

        A parcel that comes back without outcomes is handed out again, one program at a time.
        """


class OwnHands:
    """This process, one parcel after the other."""

    workers = 1

    def correct(self, parcels: Iterator[Parcel]) -> Iterator[tuple[Parcel, list[Outcome]]]:
        for parcel in parcels:
            for single in one_by_one(parcel):  # nothing travels: what is done is written at once
                yield single, correct_parcel(single)


class DaskHands:
    """Workers of a cluster. A parcel whose worker dies is done again by another."""

    def __init__(self, client: Client) -> None:
        """Raises InputError where no worker comes, or one without this version of truepath."""
        self.client = client
        try:
            client.wait_for_workers(1, timeout=FIRST_WORKER_S)
        except TimeoutError:
            raise InputError("the cluster has no worker", expected=f"one within {FIRST_WORKER_S} s") from None
        versions = client.run(worker_version, on_error="return")
        for worker, version in versions.items():
            if version != truepath.__version__:
                raise InputError(
                    f"the worker {worker} cannot correct programs",
                    expected=f"truepath {truepath.__version__}",
                    found=repr(version)[:300],
                )
        self.workers = max(1, sum(client.nthreads().values()))

    def correct(self, parcels: Iterator[Parcel]) -> Iterator[tuple[Parcel, list[Outcome]]]:
        from distributed import as_completed

        ahead = 4 * self.workers + 8  # enough for the workers to stay busy, and for a cluster that grows with its work
        at_work: dict[Any, Parcel] = {}
        done = as_completed()
        suspects: list[Parcel] = []

        def hand_out() -> None:
            parcel = next(parcels, None)
            if parcel is not None:
                future = self._submit(parcel)
                at_work[future.key] = parcel
                done.add(future)

        for _ in range(ahead):
            hand_out()
        for future in done:
            parcel = at_work.pop(future.key)
            outcomes = self._outcomes(future, parcel)
            if outcomes is None:
                suspects.append(parcel)
            yield parcel, outcomes or []
            hand_out()
        # A worker takes all that it holds with it. One program at a time tells which of them it was.
        for suspect in suspects:
            for parcel in one_by_one(suspect):
                outcomes = self._outcomes(self._submit(parcel), parcel)
                yield parcel, outcomes or [_killer(parcel)]

    def _submit(self, parcel: Parcel) -> Future:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Sending large graph")  # a large program is one
            return self.client.submit(correct_parcel, parcel, pure=False)

    def _outcomes(self, future: Future, parcel: Parcel) -> list[Outcome] | None:
        """None where workers died over it.

        Raises:
            LostClusterError: there is nobody to ask any more.
        """
        from distributed import CancelledError, KilledWorker

        try:
            return future.result()
        except KilledWorker:
            return None
        except (CancelledError, OSError) as error:
            raise LostClusterError("the cluster is gone before everything was done") from error
        except Exception as error:  # a worker without a module, or with another version: known to no program
            return [Outcome(item.number, "failed", f"a worker broke: {error!r}") for item in parcel.items]
        finally:
            future.release()


def _killer(parcel: Parcel) -> Outcome:
    (item,) = parcel.items
    return Outcome(item.number, "failed", "every worker that took this program died over it (out of memory?)")


@contextmanager
def local_hands(workers: int) -> Iterator[Hands]:
    """This many processes of this machine, one thread each; this process itself if it is one."""
    if workers == 1:
        yield OwnHands()
        return
    dask, distributed = require_dask()
    with tempfile.TemporaryDirectory(prefix="truepath-batch-") as scratch:
        # A worker that takes too much is ended; one that only paused would wait for ever for its memory.
        memory = dict.fromkeys((f"distributed.worker.memory.{what}" for what in ("target", "spill", "pause")), False)
        settings = {"distributed.scheduler.allowed-failures": DEATHS_TOLERATED, **memory}
        threads = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
        with ExitStack() as stack:
            with _children_deaf_to_interrupts(), dask.config.set(settings):
                cluster = stack.enter_context(
                    distributed.LocalCluster(
                        n_workers=workers,
                        threads_per_worker=1,
                        processes=True,
                        memory_limit=distributed.system.MEMORY_LIMIT // workers,
                        dashboard_address="127.0.0.1:0",
                        local_directory=scratch,
                        silence_logs="CRITICAL",
                        env={**threads, "TMPDIR": scratch},
                    )
                )
                client = stack.enter_context(distributed.Client(cluster))
            yield DaskHands(client)


@contextmanager
def _children_deaf_to_interrupts() -> Iterator[None]:
    """A terminal sends Ctrl-C to all processes; this one hears it and ends the others, which need not say a word.

    The thread that starts workers, also later when one has died, is made in here: threads and processes inherit what
    is blocked. An interrupt that comes meanwhile is heard at the end.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    resource_tracker.ensure_running()  # would unblock it in the thread that is the first to start a process
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def remote_hands(scheduler: str) -> Iterator[Hands]:
    """The workers of a cluster that is there already.

    Args:
        scheduler: address, such as ``tcp://host:8786``. Whoever answers there is trusted as much as this machine:
            Dask exchanges Python objects.

    Raises:
        InputError: nobody answers.
    """
    _, distributed = require_dask()
    try:
        client = distributed.Client(scheduler, timeout=ANSWER_S)
    except (OSError, ValueError) as error:
        raise InputError(
            "no scheduler answers", expected="--scheduler tcp://HOST:PORT", found=str(error)[:300]
        ) from None
    with client:
        yield DaskHands(client)


def require_dask() -> tuple[Any, Any]:
    """The modules ``dask`` and ``distributed``; raises InputError that says how to install them."""
    try:
        import dask
        import distributed
    except ImportError as error:
        raise InputError("Dask is not installed", expected=INSTALL, found=str(error)) from None
    return dask, distributed
