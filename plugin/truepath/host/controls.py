"""Sliders, buttons and keys in a Meshcat by which an operator works a view of a program."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from truepath.host.live_view import LiveView

PATH, MAGNIFY = "Path, %", "Error, times"
PLAY, NEXT, PREVIOUS, COLOUR = "Play / stop (space)", "Next warning (N)", "Previous warning (B)", "Colour by error (C)"
SHOW = {  # label with its key, and the part of the view
    "Path as programmed (1)": "programmed",
    "Path of the real tool (2)": "real",
    "Path corrected (3)": "corrected",
    "Robot today, ghost (4)": "arm_uncorrected",
    "Robot corrected (5)": "arm_corrected",
    "Error vectors (6)": "error_vectors",
    "Tool frames (7)": "tool_frames",
    "Measured region (8)": "region",
}
STEP_PERCENT, LARGEST = 0.25, 200.0
FRAMES_PER_SECOND = 30.0
TEXT_EVERY_S, TEXT_AFTER_S = 1.0, 0.2  # while the arms move; after they stopped


class Controls:
    """Adds the controls of a view to its Meshcat, and does what is asked by them whenever ``poll`` is called.

    A host with a loop of its own calls ``poll`` in it, thirty times a second or so; one without calls ``run``.

    Args:
        view: what is worked.
        say: is told the text of each warning that is stepped to.
        clock: seconds, for playing.
    """

    def __init__(
        self, view: LiveView, say: Callable[[str], None] = lambda _: None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.view, self.playing = view, False
        self._say, self._clock = say, clock
        meshcat, spot = view.meshcat, view.spot
        self._meshcat = meshcat
        spot.remove_controls(meshcat)  # those of earlier ones of this view
        taken = (*meshcat.GetSliderNames(), *meshcat.GetButtonNames())  # of the host: they stay, and stay its own
        self._path, self._magnify = spot.label(PATH, taken), spot.label(MAGNIFY, taken)
        actions: dict[str, Callable[[], None]] = {
            PLAY: self._play_or_stop,
            NEXT: lambda: self._step(1),
            PREVIOUS: lambda: self._step(-1),
            COLOUR: lambda: view.colour_by_error(not view.by_error),
        }
        for label, part in SHOW.items():
            actions[label] = lambda part=part: view.show(part, not view.visible[part])  # type: ignore[misc]
        self._actions = {spot.label(label, taken): act for label, act in actions.items()}
        spot.sliders += [self._path, self._magnify]
        spot.buttons += self._actions
        arrows = ("ArrowLeft", "ArrowRight") if spot.has_keys else ("", "")
        self._percent = meshcat.AddSlider(self._path, 0.0, 100.0, STEP_PERCENT, 100.0 * view.place, *arrows)
        self._factor = self._add_magnifier()
        keys = ("Space", "KeyN", "KeyB", "KeyC", *(f"Digit{k + 1}" for k in range(len(SHOW))))
        for label, key in zip(self._actions, keys, strict=True):
            meshcat.AddButton(label, key if spot.has_keys else "")
        self._clicks = dict.fromkeys(self._actions, 0)
        self._now = self._written = self._moved = clock()
        self._to_write = False

    def poll(self) -> None:
        """Does what was asked for since the last time, and moves on if it plays; nothing once they are removed."""
        if self.is_removed:
            self._forget_what_is_gone()
            return
        now, before = self._clock(), self._now
        self._now = now
        for label, act in self._actions.items():
            clicks = self._meshcat.GetButtonClicks(label)
            for _ in range(clicks - self._clicks[label]):
                act()
            self._clicks[label] = clicks
        factor = self._meshcat.GetSliderValue(self._magnify)
        if factor != self._factor:
            self._factor = factor
            self.view.magnify(factor)
        asked = self._meshcat.GetSliderValue(self._path)
        if asked != self._percent:  # the operator's hand goes before what is played
            self._percent = asked
            self._go_to(asked / 100.0)
        elif self.playing and self.view.course.duration_s:
            share = self.view.place + (now - before) / self.view.course.duration_s
            self._go_to(share if share <= 1.0 else 0.0)
            self._percent = self._meshcat.SetSliderValue(self._path, 100.0 * self.view.place)
        rests = now - self._moved >= TEXT_AFTER_S
        if self._to_write and (rests or now - self._written >= TEXT_EVERY_S):
            self.view.write_place()
            self._written, self._to_write = now, False

    def run(self, seconds: float | None = None) -> None:
        """Polls until the time is over, or until they are removed; None: until somebody interrupts."""
        end = None if seconds is None else time.monotonic() + seconds
        while not self.is_removed and (end is None or time.monotonic() < end):
            begun = time.monotonic()
            self.poll()
            time.sleep(max(1.0 / FRAMES_PER_SECOND - (time.monotonic() - begun), 0.001))

    @property
    def is_removed(self) -> bool:
        """Whether they are no more: taken away by ``remove``, by another view in its place, or by the host itself."""
        if not self.view.is_removed:
            there = {*self._meshcat.GetSliderNames(), *self._meshcat.GetButtonNames()}
            if {self._path, self._magnify, *self._actions} <= there:
                return False
        return True

    def remove(self) -> None:
        """Takes the controls and the view away; those of the host and of other views stay."""
        self.view.remove()

    def _add_magnifier(self) -> float:
        """The slider, between bounds that hold the factor of the view; what it stands at."""
        factor = self.view.magnification
        step = 1.0 if factor >= 1.0 else factor
        largest = max(LARGEST, np.ceil(factor / step) * step)
        return self._meshcat.AddSlider(self._magnify, step, float(largest), step, factor)

    def _forget_what_is_gone(self) -> None:
        """What the host took away is not ours any more, should it put something of that name there."""
        spot = self.view.spot
        spot.sliders = [name for name in spot.sliders if name in self._meshcat.GetSliderNames()]
        spot.buttons = [name for name in spot.buttons if name in self._meshcat.GetButtonNames()]

    def _go_to(self, share: float) -> None:
        self.view.go_to(share)
        self._moved, self._to_write = self._now, True

    def _play_or_stop(self) -> None:
        self.playing = not self.playing

    def _step(self, by: int) -> None:
        self.playing = False
        text = self.view.step(by)
        self._say("no warnings" if text is None else text)
        self._percent = self._meshcat.SetSliderValue(self._path, 100.0 * self.view.place)
