"""What in a Meshcat belongs to one view: names that no other view there has, and how all of it is given back."""

from __future__ import annotations

import weakref
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat

ROOT = "/truepath"


@dataclass(eq=False)
class Spot:
    """Names of one view, and what it put under them. Holds no Meshcat: a host may drop its own at any time.

    Attributes:
        name: of the arm, or that with a number where another view has it.
        number: 0 for the first view of a Meshcat, which has the keys of the keyboard.
        paths: what it draws; sliders, buttons: its controls; hidden: what of the host's it hid.
    """

    name: str
    number: int
    paths: list[str] = field(init=False)
    sliders: list[str] = field(default_factory=list)
    buttons: list[str] = field(default_factory=list)
    hidden: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.paths = [self.prefix]

    @property
    def prefix(self) -> str:
        """Path below which it draws."""
        return f"{ROOT}/{self.name}"

    @property
    def has_keys(self) -> bool:
        """Whether the keyboard works its controls: only those of one view at a time."""
        return self.number == 0

    def label(self, text: str, taken: Collection[str] = ()) -> str:
        """Of a control: plain for the first view, with the name of the arm for others.

        Args:
            taken: labels of controls of the host's own, which no other gets.
        """
        without_key = f"{text.split(' (')[0]} · {self.name}"
        label, k = text if self.has_keys else without_key, 1
        while label in taken:
            label, k = without_key if k == 1 else f"{without_key} {k}", k + 1
        return label

    def hide(self, meshcat: Meshcat, paths: list[str]) -> None:
        """Hides what the host drew, as far as it is there, until all is given back."""
        self.hidden = [path for path in paths if meshcat.HasPath(path)]
        for path in self.hidden:
            meshcat.SetProperty(path, "visible", False)

    def remove_controls(self, meshcat: Meshcat) -> None:
        """Takes its sliders and buttons away."""
        for name in self.sliders:
            meshcat.DeleteSlider(name, strict=False)
        for name in self.buttons:
            meshcat.DeleteButton(name, strict=False)
        self.sliders, self.buttons = [], []

    def clear(self, meshcat: Meshcat) -> None:
        """Leaves the Meshcat as if the view had not been there."""
        self.remove_controls(meshcat)
        for path in self.paths:
            meshcat.Delete(path)
        for path in self.hidden:
            meshcat.SetProperty(path, "visible", True)
        self.hidden = []


# Of each Meshcat the spots that are taken and who holds them. All references to holders are weak: they hold Meshcats.
_taken: weakref.WeakKeyDictionary[Meshcat, list[tuple[Spot, weakref.ref[Any]]]] = weakref.WeakKeyDictionary()


def take_spot(meshcat: Meshcat, name: str, holder: object) -> Spot:
    """The first free one; what a view left behind that nobody holds any more is cleared away.

    Args:
        name: of the arm.
        holder: the view. The spot is its own until ``free_spot``.
    """
    held = []
    for spot, ref in _taken.get(meshcat, []):
        if ref() is None:
            spot.clear(meshcat)
        else:
            held.append((spot, ref))
    name = name.replace("/", "_")
    names, numbers = {spot.name for spot, _ in held}, {spot.number for spot, _ in held}
    number = next(k for k in range(len(held) + 1) if k not in numbers)
    called = next(each for k in range(1, len(held) + 2) if (each := name if k == 1 else f"{name} {k}") not in names)
    taken = Spot(called, number)
    taken.clear(meshcat)  # should the host have something there
    _taken[meshcat] = [*held, (taken, weakref.ref(holder))]
    return taken


def free_spot(meshcat: Meshcat, spot: Spot) -> None:
    """Clears it, and lets others have it."""
    held = _taken.get(meshcat, [])
    if any(each is spot for each, _ in held):
        spot.clear(meshcat)
        _taken[meshcat] = others = [(each, ref) for each, ref in held if each is not spot]
        for other, _ in others:  # they may have hidden the same
            other.hide(meshcat, other.hidden)


def holds_spot(meshcat: Meshcat, spot: Spot) -> bool:
    """Whether it is taken still."""
    return any(each is spot for each, _ in _taken.get(meshcat, []))
