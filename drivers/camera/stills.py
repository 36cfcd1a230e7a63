"""Stills over HTTP, one JPEG a request, as Robotino's /cam0 gives them.

Its camera sleeps when nobody asked for about 10 s, and the first request after that may be answered with 500: an
error that the next try mends.
"""

from __future__ import annotations

import http.client
from collections.abc import Callable
from contextlib import suppress
from urllib.parse import urlsplit

from drivers.camera import jpeg
from drivers.camera.picture import NoPicture, Picture
from runtime.errors import PushlaneError

_LARGEST = 16 << 20
_PIECE = 1 << 16


class BadAddress(PushlaneError):
    """This is no address of stills."""


class Stills:
    """A source of pictures behind an address, over one connection that is kept while it works.

    Args:
        url: http:// or https://.
        clock: gives s, steadily.
        patience: s without a word after which an answer is given up, and s after which it is if it has not ended.

    Raises:
        BadAddress: it is none.
    """

    def __init__(self, url: str, clock: Callable[[], float], patience: float = 2.0) -> None:
        parts = urlsplit(url)
        try:
            port = parts.port
        except ValueError:
            port = -1
        if parts.scheme not in ("http", "https") or not parts.hostname or port == -1:
            raise BadAddress(f"'{url}' is no address, expected http://HOST/cam0")
        kind = http.client.HTTPSConnection if parts.scheme == "https" else http.client.HTTPConnection
        self._connection = kind(parts.hostname, port, timeout=patience)
        self._path = f"{parts.path or '/'}?{parts.query}{'&' if parts.query else ''}stamp="
        self._url = url
        self._clock = clock
        self._patience = patience
        self._asked = 0

    def take(self) -> Picture:
        """Ask for a picture.

        Raises:
            NoPicture: no whole JPEG came in time.
        """
        self._asked += 1
        try:
            data = self._get()
            jpeg.size(data)
        except NoPicture:
            self.close()
            raise
        except jpeg.BadJpeg as error:
            self.close()
            raise NoPicture(f"{self._url} answered {error}") from error
        except (OSError, http.client.HTTPException) as error:
            self.close()
            raise NoPicture(f"{self._url}: {str(error) or type(error).__name__}") from error
        return Picture(f"{self._url} #{self._asked}", data)

    def advance(self) -> bool:
        """Return False: a still is taken when it is asked for."""
        return False

    def close(self) -> None:
        """Drop the connection; the next request makes a new one."""
        with suppress(OSError):
            self._connection.close()

    def _get(self) -> bytes:
        end = self._clock() + self._patience
        # A number that changes keeps caches on the way from answering.
        self._connection.request("GET", f"{self._path}{self._asked}", headers={"Accept": "image/jpeg"})
        with self._connection.getresponse() as response:
            if response.status != http.client.OK:
                raise NoPicture(f"{self._url} answered {response.status}: {_text(response)}")
            pieces, length = [], 0
            while piece := response.read1(_PIECE):
                pieces.append(piece)
                length += len(piece)
                if self._clock() > end:
                    raise NoPicture(f"{self._url}: {length} bytes came within {self._patience:g} s, and no end")
                if length > _LARGEST:
                    raise NoPicture(f"{self._url} answered more than {_LARGEST} bytes")
            if response.length:
                raise NoPicture(f"{self._url}: the answer broke off {response.length} bytes before its end")
        return b"".join(pieces)


def _text(response: http.client.HTTPResponse) -> str:
    """Return the first line of an answer."""
    return response.read1(200).decode(errors="replace").strip().partition("\n")[0] or response.reason
