"""What is derived from the camera, its mount and the base, and dear enough to be kept."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from services.vision.camera import Camera, Mount

T = TypeVar("T")


class Derived(Generic[T]):
    """Something that is made of camera, mount and the base's diameter, m; anew only when one of them is another."""

    def __init__(self, make: Callable[[Camera, Mount, float], T]) -> None:
        self._make = make
        self._known: tuple[Camera, Mount, float, T] | None = None

    def of(self, camera: Camera, mount: Mount, diameter: float) -> T:
        """Return it."""
        known = self._known
        if known is None or known[0] is not camera or known[1] is not mount or known[2] != diameter:
            known = self._known = (camera, mount, diameter, self._make(camera, mount, diameter))
        return known[3]
