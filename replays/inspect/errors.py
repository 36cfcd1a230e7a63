"""Why a session could not be shown."""

from __future__ import annotations

from runtime.errors import PushlaneError


class Unreadable(PushlaneError):
    """The file is no MCAP session, or nothing in it could be decoded."""


class NoVulkan(PushlaneError):
    """This machine has no Vulkan that the viewer can draw with."""


class NoDisplay(PushlaneError):
    """A window was asked for where there is no screen."""


class ViewError(PushlaneError):
    """The viewer could not draw a view of the recording."""
