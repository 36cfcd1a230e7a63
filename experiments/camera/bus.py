"""The camera service of a running system, as a feeder sees it."""

from __future__ import annotations

import time

import zenoh
from google.protobuf.message import DecodeError

from drivers.camera.service import REQUEST
from runtime import topics
from runtime.bus.keys import Keys
from runtime.live.operate import NoAnswer
from runtime.messages import CameraCalibration, CompressedImage, Reply

_ANSWER_LIMIT = 1.0


def expected_size(session: zenoh.Session, keys: Keys, patience: float) -> tuple[int, int]:
    """Return (width, height) of the pictures that the camera service takes, pixels.

    Args:
        patience: s to wait for the service.

    Raises:
        NoAnswer: there is none.
    """
    end = time.monotonic() + patience
    while True:
        for answer in session.get(keys.latched(topics.CALIBRATION.name), timeout=_ANSWER_LIMIT):
            if answer.ok is not None:
                found = CameraCalibration.FromString(bytes(answer.ok.payload))
                return found.width, found.height
        if time.monotonic() > end:
            raise NoAnswer(f"no camera service told its calibration within {patience:g} s: is the system running?")
        time.sleep(0.1)


def give(session: zenoh.Session, keys: Keys, picture: CompressedImage) -> str:
    """Give the service a picture. Returns nothing if it was taken, or why not."""
    try:
        answers = session.get(
            keys.request(REQUEST),
            payload=picture.SerializeToString(),
            timeout=_ANSWER_LIMIT,
            priority=zenoh.Priority.DATA_LOW,
        )
        for answer in answers:
            if answer.ok is None:
                return "refused: too many requests wait"
            reply = Reply.FromString(bytes(answer.ok.payload))
            return "" if reply.accepted else f"refused: {reply.reason or 'without a reason'}"
    except (zenoh.ZError, DecodeError) as error:
        return f"not given: {error}"
    return f"no camera service answered within {_ANSWER_LIMIT:g} s"
