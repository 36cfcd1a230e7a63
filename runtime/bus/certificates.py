"""Certificates at the edge: are the files there, and why does a handshake fail?

Zenoh says "timeout" for a certificate that the other side refused. So before a session the files are looked at, and
after a failure one handshake is made by ourselves, which has a reason.
"""

from __future__ import annotations

import socket
import ssl
from pathlib import Path

from runtime.bus.config import TlsConfig
from runtime.errors import PushlaneError

_HANDSHAKE_LIMIT = 1.0
_OTHERS = 0o007


class BadCertificate(PushlaneError):
    """A file of [bus.tls] is missing, is not what it should be, or may be read by everybody."""


def check(tls: TlsConfig) -> None:
    """Look at the files.

    Raises:
        BadCertificate: naming the setting and the file.
    """
    for name in ("ca", "certificate", "key"):
        path = Path(getattr(tls, name))
        try:
            text = path.read_bytes()
        except OSError as error:
            raise BadCertificate(f"bus.tls.{name}: cannot read {path}: {error.strerror}; see docs/deploy.md") from error
        kind = b"PRIVATE KEY-----" if name == "key" else b"-----BEGIN CERTIFICATE-----"
        if kind not in text:
            raise BadCertificate(f"bus.tls.{name}: {path} is no PEM {'key' if name == 'key' else 'certificate'}")
    mode = Path(tls.key).stat().st_mode
    if mode & _OTHERS:
        raise BadCertificate(f"bus.tls.key: everybody may read {tls.key} (mode {mode & 0o777:o}): expected 600")
    try:
        _context(tls)
    except ssl.SSLError as error:
        raise BadCertificate(
            f"bus.tls: {tls.certificate}, {tls.key} and {tls.ca} do not fit together: {error.reason or error}"
        ) from error


def why_refused(place: str, tls: TlsConfig) -> str:
    """Return why a TLS endpoint does not take us, in a few words; empty if nothing is wrong with the handshake."""
    host, _, port = place.partition("/")[2].partition("?")[0].rpartition(":")
    try:
        with (
            socket.create_connection((host.strip("[]"), int(port)), timeout=_HANDSHAKE_LIMIT) as plain,
            _context(tls).wrap_socket(plain, server_hostname=host.strip("[]")) as secure,
        ):
            # What the other side thinks of our certificate comes after the handshake.
            secure.recv(1)
    except ssl.SSLCertVerificationError as error:
        return f"its certificate is not to be believed: {error.verify_message}"
    except ssl.SSLError as error:
        reason = (error.reason or str(error)).lower().replace("_", " ").rpartition("alert ")[2]
        return f"it refused our certificate {tls.certificate}: {reason}"
    except TimeoutError:
        return ""  # it waits for us to speak Zenoh: the handshake was good
    except (OSError, ValueError) as error:
        return str(error)
    return ""


def _context(tls: TlsConfig) -> ssl.SSLContext:
    context = ssl.create_default_context(ssl.Purpose.SERVER_AUTH, cafile=tls.ca)
    context.load_cert_chain(tls.certificate, tls.key)
    return context
