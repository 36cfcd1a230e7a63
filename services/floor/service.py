"""Says where the camera sees floor, and where something stands on it: also behind what hides it from the laser."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from runtime import topics
from runtime.messages import CompressedImage, SeenFloor, Vector2
from runtime.service import Effects, Input, Output, on
from runtime.time import Time, nanoseconds
from services.floor.config import FloorConfig
from services.floor.stretches import Fan, stretches
from services.vision.appearance import FloorModel, unlike
from services.vision.beams import passed
from services.vision.camera import Camera, Mount
from services.vision.derived import Derived
from services.vision.floor_view import Body, FloorView
from services.vision.rising import DepthEye, rising
from services.vision.seeing import BadPicture, SeeingService, decoded, taken

_ASIDE = 8
"""beams beside one that have to pass as far for the floor to be learned there: camera and laser see from elsewhere"""


@dataclass
class FloorState:
    """What the service goes on from.

    Attributes:
        model: how the floor looks.
        stamp: ns, of the picture that was looked at last; None before.
        unreadable: pictures that were none.
    """

    model: FloorModel = field(default_factory=FloorModel)
    stamp: Time | None = None
    unreadable: int = 0


class FloorService(SeeingService):
    """Publishes what pictures show of the floor, in the base's frame; mapping puts it on the map."""

    name = "floor"
    Config = FloorConfig

    image = Input(topics.IMAGE)
    depth = Input(topics.DEPTH)
    status = Input(topics.STATUS)
    scan = Input(topics.SCAN)
    floor = Output(topics.SEEN_FLOOR)

    config: FloorConfig
    state: FloorState

    def __init__(self, config: FloorConfig) -> None:
        super().__init__(config)
        self.state = FloorState()
        self._eyes = Derived(self._made)

    @on(image)
    def see(self, image: CompressedImage, now: Time) -> Effects:
        """Look at a picture."""
        if self.config.sees == "appearance":
            yield from self._look(image, now)

    @on(depth)
    def feel(self, depth: CompressedImage, now: Time) -> Effects:
        """Look at depths."""
        if self.config.sees == "depth":
            yield from self._look(depth, now)

    def _look(self, image: CompressedImage, now: Time) -> Effects:
        state, camera, mount = self.state, self._camera, self._mount
        stamp = taken(image)
        if camera is None or mount is None or self.status is None:
            return
        if state.stamp is not None and stamp < state.stamp + nanoseconds(self.config.period):
            return
        state.stamp = stamp
        fan, eye = self._eyes.of(camera, mount, self.status.diameter)
        others: NDArray[np.bool_] | None
        try:
            if self.config.sees == "depth":
                picture = decoded(image, camera, cv2.IMREAD_UNCHANGED, (np.dtype(np.uint16),))
                others, shown = rising(fan.view, eye, np.asarray(picture, np.float64) / 1000.0)
            else:
                picture = decoded(image, camera, cv2.IMREAD_COLOR, (3, np.dtype(np.uint8)))
                rgb = np.ascontiguousarray(np.asarray(picture, np.uint8)[..., ::-1])
                others, shown = unlike(fan.view, state.model, rgb, passed(self.scan, _ASIDE)), fan.view.looked
        except BadPicture as error:
            state.unreadable += 1
            yield self.say(str(error), now, "WARNING")
            return
        if others is None:
            return  # how the floor looks is not known yet
        found = stretches(fan, others, shown)
        below = fan.view.below
        yield self.floor(
            SeenFloor(
                stamp=stamp,
                position=Vector2(x=below[0], y=below[1]),
                bearing=found.bearing.tolist(),
                first=found.first.tolist(),
                last=found.last.tolist(),
                met=found.met.tolist(),
            )
        )

    def _made(self, camera: Camera, mount: Mount, diameter: float) -> tuple[Fan, DepthEye]:
        """Return what the pixels look at; d_r in m."""
        body = Body(0.5 * diameter, self.config.base_height)
        view = FloorView.of(camera, mount, body, self.config.furthest)
        return Fan.of(view, self.config.furthest), DepthEye.of(camera)
