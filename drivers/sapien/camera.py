"""The simulated camera as a service like any other: it sees the world and publishes pictures of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated

import cv2
import msgspec
import numpy as np
from google.protobuf.timestamp_pb2 import Timestamp
from numpy.typing import NDArray

from drivers.sapien.base import BaseModel
from drivers.sapien.config import Seed
from drivers.sapien.look import Eye, Fitted, Sight
from drivers.sapien.objects import ObjectBody
from drivers.sapien.optics import FRAME
from drivers.sapien.scene import Scene
from runtime import topics
from runtime.messages import CompressedImage, Pose2, Truth
from runtime.service import Effects, Input, Output, Service, Timer, on
from runtime.time import SECOND, Time, nanoseconds, seconds

_NOISE = 1 << 20
_LONGEST = 60


class SapienCameraConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the simulated camera; the camera itself is the scene's."""

    seed: Seed
    scene: Scene
    body: ObjectBody
    base: BaseModel = BaseModel()
    tagged: Annotated[bool, msgspec.Meta(description="whether a cube of tags stands on the object")] = True
    cube_at: Annotated[
        tuple[float, float, float], msgspec.Meta(description="x, y, yaw of that cube on the object, m and rad")
    ] = (0.0, 0.0, 0.0)
    cube_off: Annotated[
        float, msgspec.Meta(ge=0, le=1, description="m, standard deviation along each axis of where it really stands")
    ] = 0.002
    cube_turned: Annotated[
        float, msgspec.Meta(ge=0, le=1, description="rad, the same of its yaw: it was set up by hand")
    ] = math.radians(1.0)

    @property
    def fitted(self) -> Fitted:
        """Return how camera and tags sit in this world."""
        tags = self.cube_at if self.tagged else None
        return Fitted.drawn(self.scene.camera, tags, (self.cube_off, self.cube_turned), self.seed)


@dataclass
class CameraState:
    """What the camera goes on from.

    Attributes:
        began: when the first truth came, ns; None before.
        seen: what there was to see lately, oldest first.
        taken: stamp of the truth that the last picture shows, ns.
    """

    generator: np.random.Generator
    began: Time | None = None
    seen: list[Truth] = field(default_factory=list)
    taken: Time = -1


class SapienCamera(Service):
    """Publishes image, calibration and mount, and depth where the camera measures it."""

    name = "camera"
    sees_truth = True
    Config = SapienCameraConfig

    truth = Input(topics.TRUTH)
    image = Output(topics.IMAGE)
    depth = Output(topics.DEPTH)
    calibration = Output(topics.CALIBRATION)
    mount = Output(topics.CAMERA_MOUNT)
    tick = Timer(lambda config: 1.0 / config.scene.camera.rate)

    config: SapienCameraConfig
    state: CameraState

    def __init__(self, config: SapienCameraConfig) -> None:
        super().__init__(config)
        self.state = CameraState(np.random.Generator(np.random.PCG64(config.seed)))
        self._eye = Eye(config.scene, config.body, config.base.diameter, config.fitted)
        # Drawn once: a picture takes a stretch of it from a place drawn anew, which is ten times as fast.
        pool = np.random.Generator(np.random.PCG64(config.seed)).standard_normal(_NOISE, np.float32)
        self._noise: NDArray[np.float32] = pool

    @on(truth)
    def watch(self, truth: Truth, now: Time) -> Effects:
        """Keep what there is to see until the picture of it is due."""
        state = self.state
        state.seen = [*state.seen[-_LONGEST:], truth]
        if state.began is None:
            state.began = truth.stamp
            calibration, mount = self.config.scene.camera.calibration(), self.config.scene.camera.mount()
            for message in (calibration, mount):
                message.timestamp.CopyFrom(_timestamp(now))
            yield self.calibration(calibration)
            yield self.mount(mount)

    @on(tick)
    def shoot(self, now: Time) -> Effects:
        """Publish the picture of how it was `latency` s ago."""
        state, camera = self.state, self.config.scene.camera
        ripe = [one for one in state.seen if one.stamp <= now - nanoseconds(camera.latency)]
        if not ripe or ripe[-1].stamp <= state.taken or state.began is None:
            return
        truth = ripe[-1]
        state.seen = state.seen[len(ripe) :]
        state.taken = truth.stamp
        sight = Sight(_pose(truth.robot), _pose(truth.object), seconds(truth.stamp - state.began))
        picture, depth = self._eye.look(sight)
        bright = picture * (255.0 * camera.exposure) + camera.noise * self._drawn(picture.shape)
        grey_levels = np.clip(np.rint(bright), 0.0, 255.0).astype(np.uint8)
        _, data = cv2.imencode(".jpg", grey_levels[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, camera.quality])
        stamp = _timestamp(truth.stamp)
        yield self.image(CompressedImage(timestamp=stamp, frame_id=FRAME, data=data.tobytes(), format="jpeg"))
        if depth is not None:
            noisy = depth + camera.depth_noise * depth**2 * self._drawn(depth.shape)
            millimetres = np.clip(np.rint(1000.0 * np.where(depth > 0.0, noisy, 0.0)), 0, 65535).astype(np.uint16)
            _, data = cv2.imencode(".png", millimetres, [cv2.IMWRITE_PNG_COMPRESSION, 1])
            yield self.depth(CompressedImage(timestamp=stamp, frame_id=FRAME, data=data.tobytes(), format="png"))

    def _drawn(self, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """Return standard normal noise of this shape."""
        count = int(np.prod(shape))
        first = int(self.state.generator.integers(_NOISE))
        return np.resize(np.roll(self._noise, -first), count).reshape(shape)


def _pose(pose: Pose2) -> tuple[float, float, float]:
    return pose.x, pose.y, pose.theta


def _timestamp(time: Time) -> Timestamp:
    return Timestamp(seconds=time // SECOND, nanos=time % SECOND)
