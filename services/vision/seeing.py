"""What services that look through the robot's camera have in common: the camera, where it sits, and pictures."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from runtime import topics
from runtime.errors import PushlaneError
from runtime.messages import CameraCalibration, CompressedImage, FrameTransform
from runtime.service import Effects, Input, Service, on
from runtime.time import SECOND, Time
from services.vision.camera import BadCalibration, Camera, Mount

Picture = NDArray[np.uint8] | NDArray[np.uint16]


class BadPicture(PushlaneError):
    """The bytes of a picture are none, or none of this camera's."""


class SeeingService(Service):
    """Knows the camera and its mount, as they were said last; None where they were refused."""

    calibration = Input(topics.CALIBRATION)
    mount = Input(topics.CAMERA_MOUNT)

    def __init__(self, config: Any) -> None:
        super().__init__(config)
        self._camera: Camera | None = None
        self._mount: Mount | None = None

    def thaw(self) -> None:
        """Take up calibration and mount."""
        with suppress(BadCalibration):
            self._camera = None if self.calibration is None else Camera.of(self.calibration)
        with suppress(BadCalibration):
            self._mount = None if self.mount is None else Mount.of(self.mount)

    @on(calibration)
    def calibrated(self, calibration: CameraCalibration, now: Time) -> Effects:
        """Take up the camera's intrinsics."""
        try:
            self._camera = Camera.of(calibration)
        except BadCalibration as error:
            self._camera = None
            yield self.say(f"calibration refused: {error}", now, "ERROR")

    @on(mount)
    def mounted(self, mount: FrameTransform, now: Time) -> Effects:
        """Take up where the camera is."""
        try:
            self._mount = Mount.of(mount)
        except BadCalibration as error:
            self._mount = None
            yield self.say(f"mount refused: {error}", now, "ERROR")


def taken(image: CompressedImage) -> Time:
    """Return when a picture was taken, ns."""
    return image.timestamp.seconds * SECOND + image.timestamp.nanos


def decoded(image: CompressedImage, camera: Camera, decoding: int, kind: tuple[object, ...]) -> Picture:
    """Return the pixels of a picture, (H, W, ...).

    Args:
        decoding: OpenCV's flag.
        kind: channels, if there are several, and the type of its numbers.

    Raises:
        BadPicture: it is damaged, or of another size or kind; the message says both.
    """
    picture = cv2.imdecode(np.frombuffer(image.data, np.uint8), decoding) if image.data else None
    expected = (camera.height, camera.width, *kind)
    if picture is None or (*picture.shape, picture.dtype) != expected:
        what = "unreadable" if picture is None else _kind(picture.shape, picture.dtype)
        raise BadPicture(f"picture {what}, expected {_kind(expected[:-1], expected[-1])}")
    return picture  # type: ignore[return-value]  # as `kind` says


def _kind(shape: tuple[object, ...], of: object) -> str:
    """Return in words what picture has this shape and is of these numbers."""
    channels = f", {shape[2]} channels" if len(shape) > 2 else ""
    return f"{shape[1]} x {shape[0]}{channels} of {of}"
