"""Opens the serial device of a Robotino 3 or 4, and says in words why it cannot."""

from __future__ import annotations

import fcntl
import os
import termios
from contextlib import suppress
from errno import EACCES, EAGAIN, EBUSY, EINVAL, EIO, ENODEV, ENOENT, ENOTTY, ENXIO, EPERM
from pathlib import Path

from serial import Serial, SerialException
from serial.tools import list_ports

VENDOR, PRODUCT = 0x1E29, 0x040D
"""of the board on USB (reference 2.1)"""
AUTO = "auto"
_BAUD = 115200
"""nominal: over USB it means nothing"""

FAILURES = (OSError, termios.error)
"""what a device raises that fails; pyserial's errors are the first"""


class NoLine(Exception):
    """The line cannot be opened, in words.

    Attributes:
        absent: there is no such device, as opposed to one that does not let itself be opened.
    """

    def __init__(self, words: str, absent: bool) -> None:
        super().__init__(words)
        self.absent = absent


def opened(device: str) -> Serial:
    """Return the line, raw, held against other programs, and never waiting.

    Args:
        device: a path; empty or "auto": the one device that says it is a Robotino.

    Raises:
        NoLine: it cannot be opened.
    """
    path = found() if device in ("", AUTO) else device
    try:
        port = Serial(path, _BAUD, timeout=0, write_timeout=0, exclusive=True)
    except FAILURES as error:
        raise NoLine(_refused(error, path), _number(error) in (ENOENT, ENODEV, ENXIO)) from error
    # pyserial's lock is for those who ask for it; who does not, as controld3 may, is kept out by the kernel, or was
    # here first.
    with suppress(*FAILURES):
        fcntl.ioctl(port.fileno(), termios.TIOCEXCL)
    others = holders(path)
    if others:
        shut(port)
        raise NoLine(f"{path} is busy: {', '.join(others)} has it open, which has to be stopped first", False)
    return port


def holders(path: str) -> list[str]:
    """Return the names of other programs that have a device open, of those that may be looked at: as root, of all."""
    found, real, own = set(), os.path.realpath(path), str(os.getpid())
    for folder in Path("/proc").glob("[0-9]*"):
        if folder.name == own:
            continue
        with suppress(OSError):
            if any(os.path.realpath(one) == real for one in (folder / "fd").iterdir()):
                found.add(f"{(folder / 'comm').read_text().strip()} (process {folder.name})")
    return sorted(found)


def found() -> str:
    """Return the path of the one device that says it is a Robotino.

    Raises:
        NoLine: there is none, or more than one.
    """
    try:
        paths = sorted(one.device for one in list_ports.comports() if (one.vid, one.pid) == (VENDOR, PRODUCT))
    except FAILURES as error:
        raise NoLine(f"serial devices cannot be listed: {error}; name the device", True) from error
    if not paths:
        raise NoLine(
            f"no serial device is a Robotino 3 or 4: expected one with USB id {VENDOR:04x}:{PRODUCT:04x}, "
            "switched on and plugged in, or the name of the device",
            True,
        )
    if len(paths) > 1:
        raise NoLine(f"{', '.join(paths)} are all Robotinos: expected one, or the name of the device", False)
    return paths[0]


def gone(error: Exception, path: str) -> str:
    """Return in words that an open line failed."""
    return f"{path} is gone: expected a Robotino that stays switched on and plugged in ({error})"


def shut(port: Serial) -> None:
    """Close the line, and throw away what it has not taken: the kernel would wait 30 s for it."""
    with suppress(*FAILURES):
        if port.out_waiting:
            port.reset_output_buffer()
    with suppress(*FAILURES):
        port.close()


def _number(error: Exception) -> int | None:
    number = error.args[0] if error.args else None
    return number if isinstance(number, int) else None


def _refused(error: Exception, path: str) -> str:
    number = _number(error)
    if number in (ENOENT, ENODEV, ENXIO):
        return f"{path} is not there: expected the serial device of a Robotino, switched on and plugged in"
    if number in (EACCES, EPERM):
        return f"no permission for {path}: put the user into the group dialout (usermod -aG dialout USER), log in again"
    if number in (EAGAIN, EBUSY):
        return f"{path} is busy: another program holds it, perhaps controld3, which has to be stopped first"
    if number == EIO:
        return f"{path} has nobody at its other end: expected a Robotino"
    if number in (ENOTTY, EINVAL) or (isinstance(error, SerialException) and "configure" in str(error)):
        return f"{path} is no serial device: expected one such as /dev/ttyACM0"
    return f"{path} cannot be opened: {error}; expected the serial device of a Robotino"
