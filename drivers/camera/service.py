"""The service of a real camera: takes pictures that a feeder gives it, checks and stamps them, and publishes them.

A service cannot read a device. So a feeder outside (`drivers.camera.feed`) reads it and gives every picture as the
request camera/frame, which is recorded like any request: the service can be executed again from a recording.
"""

from __future__ import annotations

from dataclasses import dataclass

from drivers.camera import describe, jpeg
from drivers.camera.config import CameraConfig
from runtime import topics
from runtime.messages import CompressedImage
from runtime.service import Effects, Output, RequestInput, Service, Timer, on
from runtime.time import SECOND, Time, nanoseconds

REQUEST = "camera/frame"

_TELL = 1.0
_COUNTED = 4
_SHORTEST = 1.0


@dataclass
class CameraState:
    """What the camera goes on from.

    Attributes:
        taken, refused: pictures so far; fault: why the last one was refused.
        taken_before, refused_before: what they were at the last check.
        slow: the log has said that pictures lack.
    """

    taken: int = 0
    refused: int = 0
    fault: str = ""
    taken_before: int = 0
    refused_before: int = 0
    slow: bool = False


class CameraService(Service):
    """Publishes image, calibration and mount of a real camera."""

    name = "opencv-camera"
    Config = CameraConfig

    image = Output(topics.IMAGE)
    calibration = Output(topics.CALIBRATION)
    mount = Output(topics.CAMERA_MOUNT)
    frame = RequestInput(REQUEST, CompressedImage)
    tell = Timer(_TELL)
    check = Timer(lambda config: max(_SHORTEST, _COUNTED / config.rate))

    config: CameraConfig
    state: CameraState

    def __init__(self, config: CameraConfig) -> None:
        super().__init__(config)
        self.state = CameraState()

    @on(frame)
    def take(self, frame: CompressedImage, now: Time) -> Effects:
        """Publish a picture, or refuse it with the reason.

        It is stamped by this service's time, less the camera's latency: a feeder's clock is another's.
        """
        fault = self._fault(frame)
        if fault:
            self.state.refused += 1
            self.state.fault = fault
            yield self.frame.refuse(fault)
            return
        self.state.taken += 1
        message = CompressedImage(frame_id=describe.FRAME, data=frame.data, format="jpeg")
        stamp = now - nanoseconds(self.config.latency)
        message.timestamp.seconds, message.timestamp.nanos = divmod(stamp, SECOND)
        yield self.image(message)
        yield self.frame.accept()

    @on(tell)
    def describe(self, now: Time) -> Effects:
        """Publish what the camera is, again and again: a service that was restarted does not know that it was."""
        yield self.calibration(describe.calibration(self.config.calibration, now))
        yield self.mount(describe.mount(self.config.mount, now))

    @on(check)
    def look_after(self, now: Time) -> Effects:
        """Say when pictures are refused or lack, and when they come again."""
        state = self.state
        refused = state.refused - state.refused_before
        if refused:
            yield self.say(f"{refused} pictures refused, the last: {state.fault}", now, "WARNING")
        rate = (state.taken - state.taken_before) / self.contract.timers["check"].seconds(self.config)
        slow = rate < self.config.rate / 2
        if slow != state.slow:
            words = f"{rate:.2g} pictures a second, expected {self.config.rate:g}"
            yield self.say(words, now, "WARNING" if slow else "INFO")
        state.slow = slow
        state.taken_before, state.refused_before = state.taken, state.refused

    def _fault(self, frame: CompressedImage) -> str:
        """Return what is wrong with a picture, or nothing."""
        if frame.format != "jpeg":
            return f"format is '{frame.format}', expected 'jpeg'"
        expected = self.config.calibration.width, self.config.calibration.height
        try:
            found = jpeg.size(frame.data)
            if found == expected:
                # As its users will see it: a decoder turns a picture as its EXIF data say.
                height, width = jpeg.grey(frame.data).shape
                found = width, height
        except jpeg.BadJpeg as error:
            return str(error)
        if found != expected:
            return (
                f"a picture of {found[0]} x {found[1]} pixels, expected {expected[0]} x {expected[1]} as in calibration"
            )
        return ""
