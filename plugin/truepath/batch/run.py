"""A batch from its tasks to its summary."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from truepath.batch.hands import Hands
from truepath.batch.parcels import tie_up
from truepath.batch.results import Result, finished, keep, key_of
from truepath.batch.tasks import Task
from truepath.batch.work import Item, Outcome
from truepath.errors import InputError


@dataclass(eq=False)
class Batch:
    """What is known of the tasks of a batch, while it runs and after.

    Attributes:
        tasks: all of them, by number.
        results: of those that are done.
        resumed: numbers of those that an earlier batch has done.
        attempts: how often each task was handed to a worker, by number.
        writes: how often the result of each task was written, by number.
        workers: that did the work.
        seconds: that it took.
    """

    tasks: Sequence[Task]
    results: dict[int, Result] = field(default_factory=dict)
    resumed: set[int] = field(default_factory=set)
    attempts: dict[int, int] = field(default_factory=dict)
    writes: dict[int, int] = field(default_factory=dict)
    workers: int = 0
    seconds: float = 0.0

    @property
    def open(self) -> list[Task]:
        """Tasks without a result."""
        return [task for task in self.tasks if task.number not in self.results]

    def look_for_finished(self) -> None:
        """Takes over what an earlier batch has done."""
        for task in self.tasks:
            try:
                result = finished(task)
            except InputError:  # unreadable: refused when its turn comes
                continue
            if result is not None:
                self.results[task.number] = result
                self.resumed.add(task.number)

    def run(self, hands: Hands, say: Callable[[Result], None] = lambda result: None) -> None:
        """Does all open tasks and writes each result as soon as it is there.

        Args:
            hands: who works.
            say: is told every result.

        Raises:
            InputError: a result cannot be written.
            LostClusterError: the workers are gone.
        """
        start = time.perf_counter()
        self.workers = hands.workers

        def end(outcome: Outcome, content: bytes) -> None:
            task = self.tasks[outcome.number]
            if outcome.number in self.results:  # nobody hands in twice; if it happened, the first one counts
                return
            attempts = self.attempts.get(outcome.number, 1)
            result = keep(task, outcome, key_of(task, content), attempts)
            self.writes[outcome.number] = self.writes.get(outcome.number, 0) + 1
            self.results[outcome.number] = result
            say(result)

        def refuse(task: Task, error: InputError) -> None:
            end(Outcome(task.number, "refused", str(error)), b"")

        try:
            for parcel, outcomes in hands.correct(tie_up(self.open, hands.workers, refuse)):
                sent: dict[int, Item] = {item.number: item for item in parcel.items}
                for number in sent:
                    self.attempts[number] = self.attempts.get(number, 0) + 1
                for outcome in outcomes:
                    end(outcome, sent[outcome.number].content)
        finally:
            self.seconds = time.perf_counter() - start
