"""Tasks tied up for their way to a worker: small programs travel together, so that ten thousand cost little each."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence

import truepath
from truepath.batch.results import read_program
from truepath.batch.tasks import Task
from truepath.batch.work import Item, Parcel
from truepath.errors import InputError
from truepath.rewriting.note import refuse_if_noted

MOST_PROGRAMS, MOST_BYTES = 32, 1 << 20
PARCELS_EACH = 8  # for every worker, so that none of them idles long at the end


def tie_up(tasks: Sequence[Task], workers: int, refuse: Callable[[Task, InputError], None]) -> Iterator[Parcel]:
    """Parcels in the order of the tasks; programs are read when their parcel is asked for.

    Args:
        tasks: to be done.
        workers: that share the work.
        refuse: is told of a program that cannot be read, or that is corrected already.
    """
    most = min(MOST_PROGRAMS, max(1, math.ceil(len(tasks) / (PARCELS_EACH * workers))))
    groups: dict[int, list[Task]] = {}
    for task in tasks:
        groups.setdefault(id(task.prepared), []).append(task)
    for group in groups.values():
        items: list[Item] = []
        size = 0
        for task in group:
            try:
                item = Item(task.number, task.name, read_program(task))
                refuse_if_noted(task.program, item.content)  # here, where its note is: workers get its content alone
            except InputError as error:
                refuse(task, error)
                continue
            if items and (len(items) == most or size + len(item.content) > MOST_BYTES):
                yield parcel_of(group[0], items)
                items, size = [], 0
            items.append(item)
            size += len(item.content)
        if items:
            yield parcel_of(group[0], items)


def parcel_of(task: Task, items: Iterable[Item]) -> Parcel:
    """A parcel with the calibration and the settings of a task."""
    prepared = task.prepared
    return Parcel(truepath.__version__, prepared.calibration, prepared.settings, prepared.controller_file, tuple(items))


def one_by_one(parcel: Parcel) -> Iterator[Parcel]:
    """A parcel for each of its programs."""
    for item in parcel.items:
        yield Parcel(parcel.version, parcel.calibration, parcel.settings, parcel.controller_file, (item,))
