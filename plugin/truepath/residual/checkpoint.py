"""What has been learnt so far, in a file: an interrupted run goes on where it was, and ends as if it had not been.

Plain JSON with a checksum, checked when it is read; entries belong to what was to be learnt (its hash is their name),
so a file of other data or other settings is never mistaken for one of these. ``SCHEMA`` counts up when an evolution
would go on in another way than it began.
"""

from __future__ import annotations

import hashlib
import json
import time
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field, ValidationError

from truepath.calibration_parts import Part
from truepath.calibration_residual import LARGEST, NetworkPart
from truepath.checksum import checksum
from truepath.errors import InputError
from truepath.files import write_atomically

if TYPE_CHECKING:
    from truepath.residual.evolution import State
    from truepath.residual.learning import Lesson
    from truepath.residual.limits import Settings
    from truepath.residual.network import Network
    from truepath.residual.options import Options

SCHEMA: Literal["truepath.evolution/2"] = "truepath.evolution/2"
MAX_BYTES = 1 << 30
SECONDS_BETWEEN = 2.0


Error = Annotated[float, Field(ge=0, le=LARGEST)]


class StatePart(Part):
    """An evolution under way."""

    individuals: Annotated[list[NetworkPart], Field(min_length=3)]
    error: list[Error]
    generation: Annotated[int, Field(ge=0)]
    stale: Annotated[int, Field(ge=0)]
    reference: Error


class Content(Part):
    schema_: Literal["truepath.evolution/2"] = Field(alias="schema")
    finished: dict[str, NetworkPart]
    under_way: dict[str, StatePart]


class Checkpoint:
    """A file that holds finished networks and evolutions under way.

    Args:
        path: the file; read if it is there.

    Raises:
        InputError: it is there and is no such file.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._lock, self._written = Lock(), time.monotonic()
        self._finished: dict[str, NetworkPart] = {}
        self._read: dict[str, StatePart] = {}
        self._states: dict[str, State] = {}
        self._asked: set[str] = set()
        if self.path.exists():
            content = _load(self.path)
            self._finished, self._read = dict(content.finished), dict(content.under_way)

    @staticmethod
    def key(lesson: Lesson, options: Options) -> str:
        """Name of what is to be learnt."""
        digest = hashlib.sha256()
        for values in (lesson.x, lesson.target, lesson.validation):
            digest.update(np.ascontiguousarray(values).tobytes())
        how = {
            "seed": lesson.seed,
            "device": options.device,
            "evolution": asdict(options.evolution),
            "limits": asdict(options.limits),
        }
        digest.update(json.dumps(how, sort_keys=True).encode())
        return digest.hexdigest()

    def finished(self, key: str, lesson: Lesson, options: Options) -> Network | None:
        """The network, if it was finished."""
        self._asked.add(key)
        part = self._finished.get(key)
        return None if part is None else self._fitting([part], lesson, options.evolution)[0]

    def state(self, key: str, lesson: Lesson, options: Options) -> State | None:
        """Where its evolution was interrupted, if it was."""
        part = self._read.get(key)
        if part is None:
            return None
        import torch

        from truepath.residual.evolution import State
        from truepath.residual.population import Population

        settings = options.evolution
        networks = self._fitting(part.individuals, lesson, settings)
        if not len(networks) == len(part.error) == settings.individuals or part.generation > settings.generations:
            raise _refused(self.path, "individuals or generations in another number than this evolution has")
        device = torch.device(options.device)
        population = Population.of(networks, settings.largest, device, torch.float32)
        error = torch.tensor(part.error, dtype=torch.float32, device=device)
        return State(population, error, part.generation, part.stale, part.reference)

    def _fitting(self, parts: list[NetworkPart], lesson: Lesson, settings: Settings) -> list[Network]:
        networks = [part.network() for part in parts]
        inputs, outputs = lesson.x.shape[1], lesson.target.shape[1]
        if any(network.hidden.shape[1] != inputs + 1 or len(network.bias) != outputs for network in networks):
            raise _refused(self.path, f"networks that have not {inputs} inputs and {outputs} outputs")
        if any(not settings.smallest <= network.neurons <= settings.largest for network in networks):
            raise _refused(self.path, "networks of other sizes than this evolution has")
        return networks

    def keep_state(self, key: str, state: State) -> None:
        """Remembers how far an evolution is; the file is written every few seconds."""
        with self._lock:
            self._states[key] = state
            if time.monotonic() - self._written > SECONDS_BETWEEN:
                self._write()

    def keep_network(self, key: str, network: Network) -> None:
        """Remembers a finished network."""
        with self._lock:
            self._finished[key] = NetworkPart.of(network)
            self._states.pop(key, None)
            self._read.pop(key, None)
            self._write()

    def save(self) -> None:
        """Writes all that is known now."""
        with self._lock:
            self._write()

    def remove(self) -> None:
        """When everything is done, nothing is left of it; what belongs to another run stays."""
        with self._lock:
            for key in self._asked:
                for entries in (self._finished, self._read, self._states):
                    entries.pop(key, None)
            if self._finished or self._read or self._states:
                self._write()
                return
        with suppress(FileNotFoundError):
            self.path.unlink()

    def _write(self) -> None:
        under_way = self._read | {key: _part(state) for key, state in self._states.items()}
        content = Content(schema=SCHEMA, finished=self._finished, under_way=under_way).model_dump(by_alias=True)
        write_atomically(self.path, json.dumps({**content, "checksum": checksum(content)}, allow_nan=False))
        self._written = time.monotonic()


def _refused(path: Path, found: str) -> InputError:
    return InputError("this is no checkpoint of a network", file=path, expected=f"schema {SCHEMA!r}", found=found)


def _load(path: Path) -> Content:
    try:
        if path.stat().st_size > MAX_BYTES:
            raise _refused(path, "a file larger than 1 GiB")
        content = json.loads(path.read_bytes())
    except OSError as error:
        raise _refused(path, error.strerror or "the system refuses to read it") from None
    except (ValueError, RecursionError):
        raise _refused(path, "it is cut off or no JSON") from None
    if not isinstance(content, dict) or content.pop("checksum", None) != checksum(content):
        raise _refused(path, "its checksum is not that of its content: it was changed, or begun by another version")
    try:
        return Content.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise _refused(path, f"at {place or 'top level'}: {first['msg']}") from None


def _part(state: State) -> StatePart:
    population = state.population
    return StatePart(
        individuals=[NetworkPart.of(population.network(number)) for number in range(len(population))],
        error=state.error.double().tolist(),
        generation=state.generation,
        stale=state.stale,
        reference=state.reference,
    )
