"""How the floor looks, learned where it is known to be free, and what in a picture does not look like it.

The model is a histogram of colours in CIE Lab that forgets. A floor may have many colours: boards, patterns, shadows,
a sheen. A colour belongs to the floor if it is among the most frequent that together make up nearly all of what was
seen of it. What else is among the pixels taken for known floor is learned as well: where 1 % of them lay on a thing of
one colour, its side went for floor. And of a thing as grey as the floor little is seen, or the wrong part: of things of
random colours on boards and on a grey carpet, in renderings with shadows, 58 of 60 were found within 8 cm, one 0.57 m
off.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vision.floor_view import SHRINK, FloorView

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]
Mask = NDArray[np.bool_]
Histogram = NDArray[np.float32]

LIGHTNESSES, CHROMAS = 32, 48
"""Bins of L, 8 levels of 256 each, and of a and b, 2 levels each and around no colour; beyond is the last bin."""
_SPREAD = 1.0
"""bins over which a colour seen makes its neighbours likely"""


@dataclass
class FloorModel:
    """What colours the floor has.

    Attributes:
        seen: (L, a, b), how many pixels, those of long ago fading; shares are what matters.
    """

    seen: Histogram = field(default_factory=lambda: np.zeros((LIGHTNESSES, CHROMAS, CHROMAS), np.float32))

    @property
    def known(self) -> bool:
        """Whether enough has been seen to tell the floor from something else."""
        return float(self.seen.sum()) >= 500.0


def colours(picture: Picture) -> NDArray[np.int32]:
    """Return the bins, (h, w), of the shrunken pixels of a picture, (H, W, 3), RGB."""
    h, w = picture.shape[0] // SHRINK, picture.shape[1] // SHRINK
    small = cv2.resize(picture, (w, h), interpolation=cv2.INTER_AREA)
    lab = cv2.cvtColor(small, cv2.COLOR_RGB2LAB).astype(np.int32)
    chroma = np.clip((lab[..., 1:] - (128 - CHROMAS)) >> 1, 0, CHROMAS - 1)
    return np.asarray(((lab[..., 0] >> 3) * CHROMAS + chroma[..., 0]) * CHROMAS + chroma[..., 1])


def learn(model: FloorModel, bins: NDArray[np.int32], at: NDArray[np.int64], memory: float = 20000.0) -> None:
    """Take what pixels that are floor, rows and columns (M, 2), show into the model.

    Args:
        memory: pixels that the model remembers at most: what came before fades.
    """
    size = model.seen.size
    new = np.bincount(bins[at[:, 0], at[:, 1]], minlength=size).astype(np.float32).reshape(model.seen.shape)
    total = float(model.seen.sum()) + float(new.sum())
    model.seen = (model.seen + new) * np.float32(min(1.0, memory / max(total, 1.0)))


def floor_colours(model: FloorModel, share: float = 0.985) -> Mask:
    """Return which bins, (L * a * b,), are the floor's: the most frequent ones that make up `share` of it."""
    smooth = (_kernel(LIGHTNESSES) @ model.seen.reshape(LIGHTNESSES, -1)).reshape(model.seen.shape)
    likely = (_kernel(CHROMAS) @ smooth @ _kernel(CHROMAS).T).ravel()
    seen = np.flatnonzero(likely > likely.max() * 1e-5)
    order = seen[np.argsort(-likely[seen], kind="stable")]
    mass = np.cumsum(likely[order], dtype=np.float64)
    chosen = np.zeros(likely.size, bool)
    if mass.size:
        chosen[order[: int(np.searchsorted(mass, share * mass[-1])) + 1]] = True
    return chosen


def standing(view: FloorView, bins: NDArray[np.int32], floor: Mask) -> Mask:
    """Return which pixels, (h, w), do not show floor, single ones mended.

    Args:
        floor: (L * a * b,), as floor_colours gives it.
    """
    other = (~floor[bins] & view.looked).astype(np.uint8)
    # A majority of the 5 x 5 pixels around moves no straight edge, unlike opening and closing.
    return np.asarray((cv2.medianBlur(other, 5) > 0) & view.looked)


def unlike(view: FloorView, model: FloorModel, picture: Picture, free: Array) -> Mask | None:
    """Return which of the view's pixels, (h, w), of a picture, (H, W, 3) RGB, do not show floor.

    None before it is known how that looks.

    Args:
        model: how the floor looks; it learns from this picture first.
        free: (N, 2), m, base frame, points of the floor that are known to be free and that nothing hides.
    """
    bins = colours(picture)
    learn(model, bins, view.pixels_of(free))
    return standing(view, bins, floor_colours(model)) if model.known else None


def _kernel(size: int) -> NDArray[np.float32]:
    """Return the (size, size) matrix that spreads a bin over its neighbours."""
    apart = np.arange(size)[:, None] - np.arange(size)
    kernel = np.exp(-0.5 * (apart / _SPREAD) ** 2)
    return np.asarray(kernel / kernel.sum(axis=0), np.float32)
