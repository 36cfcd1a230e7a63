"""What a simulated camera sees: the scene in three dimensions, drawn by SAPIEN. Nothing in it moves by itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, pi, sin
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.sapien.engine import sapien
from drivers.sapien.objects import ObjectBody
from drivers.sapien.optics import CameraModel, quaternion
from drivers.sapien.scene import BoxObstacle, DiscObstacle, Scene, outer_walls
from drivers.sapien.shapes import Box, Colour, Shape
from runtime.errors import PushlaneError

Array = NDArray[np.float64]
Pose = tuple[float, float, float]

BASE_HEIGHT = 0.25
"""m, of the base's body"""
TAG_CUBE = 0.14
"""m, side of the cube of tags that stands on an object"""
TAGS = "DICT_4X4_50"
_TAG_PIXELS, _TAG_CELLS = 32, 8
"""pixels of a tag's module in its texture; modules along it with its quiet zone"""

_FITTING = 1
"""beside the seed: of what is drawn about how things sit"""
_WALL_HEIGHT, _WALL_COLOUR = 2.2, "#cfcabf"
_FLOOR, _FLOOR_TILE = "#a58d6f", 1.6
_AWAY = -100.0
_ROUND = (0.5**0.5, 0.0, -(0.5**0.5), 0.0)
"""SAPIEN's cylinders lie along x: upright"""


class NoCamera(PushlaneError):
    """Pictures cannot be drawn here."""

    exit_code = 3


@dataclass(frozen=True)
class Sight:
    """What there is to see.

    Attributes:
        robot, object: (x, y, theta), map frame, m and rad; the object's of o.
        time: s since the world began: obstacles come and go.
    """

    robot: Pose
    object: Pose
    time: float


@dataclass(frozen=True)
class Fitted:
    """How camera and tags really sit.

    Attributes:
        place, turn: (3,), m and a rotation vector, rad, base frame: of the camera, from where its model has it.
        tags: x, y, yaw, m and rad, object's frame, of their cube; None: there are none.
    """

    place: Array
    turn: Array
    tags: Pose | None

    @classmethod
    def drawn(cls, camera: CameraModel, tags: Pose | None, errors: tuple[float, float], seed: int) -> Fitted:
        """Return how they sit in one world.

        Args:
            tags: where the cube was meant to stand; errors: deviations along each axis, m, and of its yaw, rad.
        """
        random = np.random.Generator(np.random.PCG64([seed, _FITTING]))
        place, turn = camera.off * random.standard_normal(3), camera.turned * random.standard_normal(3)
        x, y, yaw = random.standard_normal(3) * (errors[0], errors[0], errors[1])
        return cls(place, turn, None if tags is None else (tags[0] + x, tags[1] + y, tags[2] + yaw))


class Eye:
    """Draws pictures of `scene` with `body` in it.

    Raises:
        NoCamera: there is no Vulkan that can draw.
    """

    def __init__(self, scene: Scene, body: ObjectBody, base_diameter: float, fitted: Fitted) -> None:
        self._model = scene.camera
        try:
            self._scene = sapien.Scene([sapien.render.RenderSystem()])
        except RuntimeError as error:
            raise NoCamera(
                f"the simulated camera cannot draw ({error}): install Vulkan's loader and a driver that can, such as "
                "Debian's libvulkan1 and mesa-vulkan-drivers (25 or newer, from bookworm-backports), or run with "
                "--set sim.perception=truth"
            ) from error
        self._scene.set_ambient_light([0.45, 0.45, 0.45])
        self._scene.add_directional_light([0.35, 0.2, -1.0], [0.6, 0.6, 0.6])
        self._floor(scene)
        for wall in outer_walls(scene.bounds):
            self._add([_form(wall, _WALL_HEIGHT, _WALL_COLOUR)])
        obstacles: list[BoxObstacle | DiscObstacle] = [*scene.boxes, *scene.discs]
        self._obstacles = [(one, self._add([_form(one.shape(), one.height, one.colour)])) for one in obstacles]
        rim = sapien.render.RenderShapeCylinder(base_diameter / 2, BASE_HEIGHT / 2, _material("#303238"))
        rim.set_local_pose(sapien.Pose([0.0, 0.0, BASE_HEIGHT / 2], _ROUND))
        self._robot = self._add([rim])
        self._object = self._add(_looks(body))
        self._plates = (
            [(_pose(*fitted.tags) * plate, self._plate(number)) for number, plate in enumerate(plates(body.height))]
            if fitted.tags is not None
            else []
        )
        # The same colours in half the time; depth is only there with all the rest.
        shader = "" if self._model.depth else str(Path(sapien.__file__).parent / "vulkan_shader" / "minimal")
        self._camera = sapien.render.RenderCameraComponent(self._model.width, self._model.height, shader)
        self._camera.set_fovy(self._model.field)
        self._camera.near, self._camera.far = 0.02, 30.0
        self._head = sapien.Entity()
        self._head.add_component(self._camera)
        self._scene.add_entity(self._head)
        place = np.array((self._model.x, self._model.y, self._model.z)) + fitted.place
        self._mount = sapien.Pose(place, _turned(cv2.Rodrigues(fitted.turn)[0] @ self._model.rotation()))

    def look(self, sight: Sight) -> tuple[Array, Array | None]:
        """Return the picture, (H, W, 3), 0 to 1, red first, and the depth along the optical axis, (H, W), m.

        No depth (0) where nothing is; None if the camera measures none.
        """
        robot, thing = _pose(*sight.robot), _pose(*sight.object)
        for obstacle, entity in self._obstacles:
            stands = obstacle.since <= sight.time < obstacle.until
            entity.set_pose(sapien.Pose([0.0, 0.0, 0.0 if stands else _AWAY]))
        self._robot.set_pose(robot)
        self._object.set_pose(thing)
        for plate, entity in self._plates:
            entity.set_pose(thing * plate)
        self._head.set_pose(robot * self._mount)
        self._scene.update_render()
        self._camera.take_picture()
        picture = np.asarray(self._camera.get_picture("Color")[..., :3], np.float64)
        if not self._model.depth:
            return picture, None
        return picture, -np.asarray(self._camera.get_picture("Position")[..., 2], np.float64)

    def _add(self, forms: Sequence[sapien.render.RenderShape]) -> sapien.Entity:
        component = sapien.render.RenderBodyComponent()
        for form in forms:
            component.attach(form)
        entity = sapien.Entity()
        entity.add_component(component)
        self._scene.add_entity(entity)
        return entity

    def _floor(self, scene: Scene) -> None:
        """Add a floor of boards, whose shades differ: a tracker must not need an even one."""
        generator = np.random.Generator(np.random.PCG64(1))
        boards = 1.0 + 0.06 * generator.standard_normal((16, 1, 1)).repeat(32, axis=0)
        grain = 1.0 + 0.03 * cv2.GaussianBlur(generator.standard_normal((512, 512)), (0, 0), 9.0, sigmaY=1.0)[..., None]
        shade = np.clip(np.array(_rgb(_FLOOR)) * boards * grain, 0.0, 1.0)
        bounds, beyond = scene.bounds, 1.0
        low, high = (bounds.min_x - beyond, bounds.min_y - beyond), (bounds.max_x + beyond, bounds.max_y + beyond)
        corners = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
        places = np.array([(x, y, 0.0) for x, y in corners])
        self._add([_sheet(places, places[:, :2] / _FLOOR_TILE, shade, 8)])

    def _plate(self, number: int) -> sapien.Entity:
        """Return a tag with its quiet zone, TAG_CUBE across, that lies at z = 0, its top towards y."""
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, TAGS))
        inner = cv2.aruco.generateImageMarker(dictionary, number, (_TAG_CELLS - 2) * _TAG_PIXELS)
        plate = np.pad(inner, _TAG_PIXELS, constant_values=255) / 255.0
        half = TAG_CUBE / 2
        places = np.array([(-half, -half, 0.0), (half, -half, 0.0), (half, half, 0.0), (-half, half, 0.0)])
        across = np.array([(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)])
        return self._add([_sheet(places, across, np.repeat(plate[..., None], 3, axis=2), 6)])


def plates(height: float) -> list[sapien.Pose]:
    """Return the poses of the five tags of a cube that stands on an object `height` m high, in the object's frame.

    Of a tag: x to its right and y to its top as one reads it, z out of it. 0 lies on top, its top forward; 1 to 4 look
    along x, y, -x, -y.
    """
    half, middle = TAG_CUBE / 2, height + TAG_CUBE / 2
    top = sapien.Pose([0.0, 0.0, height + TAG_CUBE], _about_z(-pi / 2))
    upright = sapien.Pose(q=[cos(pi / 4), sin(pi / 4), 0.0, 0.0])  # z of the tag looks along -y, y up
    sides = []
    for turn in (0.0, pi / 2, pi, -pi / 2):
        outwards = sapien.Pose([half * cos(turn), half * sin(turn), middle], _about_z(turn + pi / 2))
        sides.append(outwards * upright)
    return [top, *sides]


def _looks(body: ObjectBody) -> list[sapien.render.RenderShape]:
    if body.rolls:
        ball = sapien.render.RenderShapeSphere(body.diameter / 2, _material(body.colour))
        ball.set_local_pose(sapien.Pose([0.0, 0.0, body.diameter / 2]))
        return [ball]
    return [_form(part, body.height, body.colour) for part in body.parts]


def _form(shape: Shape, height: float, colour: Colour) -> sapien.render.RenderShape:
    if isinstance(shape, Box):
        form = sapien.render.RenderShapeBox([shape.length / 2, shape.width / 2, height / 2], _material(colour))
        turn = _about_z(shape.yaw)
    else:
        form = sapien.render.RenderShapeCylinder(shape.radius, height / 2, _material(colour))
        turn = list(_ROUND)
    form.set_local_pose(sapien.Pose([shape.x, shape.y, height / 2], turn))
    return form


def _sheet(places: Array, across: Array, shade: Array, levels: int) -> sapien.render.RenderShape:
    """Return a flat sheet with corners `places`, (4, 3), m, that shows `shade`, (H, W, 3).

    across: (4, 2), where in the picture each corner is.
    """
    rgba = np.concatenate([shade, np.ones((*shade.shape[:2], 1))], axis=2)
    texture = sapien.render.RenderTexture2D(
        np.ascontiguousarray((rgba * 255).astype(np.uint8)), "R8G8B8A8Unorm", mipmap_levels=levels
    )
    material = _material("#ffffff")
    material.base_color_texture = texture
    normals = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (4, 1))
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    return sapien.render.RenderShapeTriangleMesh(
        places.astype(np.float32), triangles, normals, across.astype(np.float32), material
    )


def _material(colour: Colour) -> sapien.render.RenderMaterial:
    material = sapien.render.RenderMaterial()
    material.base_color = [*_rgb(colour), 1.0]
    material.roughness, material.specular, material.metallic = 1.0, 0.0, 0.0
    return material


def _rgb(colour: Colour) -> list[float]:
    """Return red, green, blue, 0 to 1, linear: SAPIEN's pictures are not gamma-corrected."""
    return [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]


def _pose(x: float, y: float, theta: float) -> sapien.Pose:
    return sapien.Pose([x, y, 0.0], _about_z(theta))


def _about_z(angle: float) -> list[float]:
    return [cos(angle / 2), 0.0, 0.0, sin(angle / 2)]


def _turned(rotation: Array) -> list[float]:
    x, y, z, w = quaternion(rotation)
    return [w, x, y, z]
