"""The sections of the configuration that say which system runs, and what is pushed where."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

DEFAULT_SCENE = "living-room"


class SystemConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The [system] section: which base is driven."""

    base: Annotated[
        Literal["simulated", "robotino-serial", "robotino-rest"],
        Meta(description="simulated, as [sim] says; else a real one, and [sim] says nothing"),
    ] = "simulated"
    map: Annotated[
        str,
        Meta(
            description="a real base's map, made before: map_server's YAML file; empty: it is made while pushing, and "
            "the base starts at its origin"
        ),
    ] = ""


class SimConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The [sim] section: what to push where. Empty texts and zeros leave it to the scene and to [task]."""

    scene: Annotated[str, Meta(description="a scene of `pushlane sim --list`")] = DEFAULT_SCENE
    object: Annotated[str, Meta(description="an object of `pushlane sim --list`; empty: the scene's own")] = ""
    goal: Annotated[
        tuple[float, float] | None, Meta(description="m, where the object is to go; absent: the scene's own")
    ] = None
    yaw: (
        Annotated[float, Meta(ge=-6.3, le=6.3, description="rad, the object's orientation at the goal; absent: any")]
        | None
    ) = None
    yaw_precision: Annotated[float, Meta(ge=0, le=3.15, description="rad, of yaw; 0: as [task] says")] = 0.0
    strategy: Annotated[str, Meta(description="empty: as [task] says")] = ""
    controller: Annotated[str, Meta(description="empty: as [task] says")] = ""
    precision: Annotated[float, Meta(ge=0, le=5, description="m; 0: as [task] says")] = 0.0
    time_limit: Annotated[float, Meta(ge=0, le=36000, description="s; 0: as [task] says")] = 0.0
    seed: Annotated[int, Meta(ge=0, lt=2**53, description="of everything drawn")] = 1
    start: Annotated[
        Literal["scene", "behind", "beside", "front"],
        Meta(description="where the base starts, seen along the first push; scene: where the scene puts it"),
    ] = "scene"
    distance: Annotated[
        float, Meta(ge=0, le=20, description="m from the base to the object at the start; 0: as `start` says")
    ] = 0.0
    width: Annotated[
        float,
        Meta(gt=0.3, le=4, description="times the pushing corridor's half width; 1 except in corridor-1 to corridor-3"),
    ] = 1.0
    object_diameter: Annotated[
        float, Meta(ge=0, le=2, description="d_o, m: the object scaled to this, its mass kept; 0: its own")
    ] = 0.0
    object_mass: Annotated[float, Meta(ge=0, le=100, description="kg; 0: drawn from the object's range")] = 0.0
    object_friction: Annotated[
        float, Meta(ge=0, le=2, description="between floor and an object that slides; 0: drawn from its range")
    ] = 0.0
    perception: Annotated[
        Literal["truth", "sensors"],
        Meta(
            description="sensors: from camera, laser, infra-red and odometry; truth: positions from the simulation, "
            "with noise and delay"
        ),
    ] = "truth"
    link: Annotated[
        Literal["direct", "serial", "rest"],
        Meta(description="what lies between the simulated base and its driver: nothing, or a Robotino's own interface"),
    ] = "direct"
    map: Annotated[
        str,
        Meta(
            description="a map made before, for perception from sensors: map_server's YAML file, or `plan` for the "
            "scene's floor plan; empty: the map is made while pushing"
        ),
    ] = ""
    changing: Annotated[
        bool, Meta(description="while pushing, two things are put into the corridor and one is taken away")
    ] = False
    tagged: Annotated[bool, Meta(description="whether the object bears tags for the camera")] = True
    depth: Annotated[
        bool, Meta(description="whether the camera measures depth, as well as where the scene says so")
    ] = False
