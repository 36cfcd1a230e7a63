"""Looks at what a machine can see without a running system: endpoints and certificates."""

from __future__ import annotations

import shutil
import socket
import subprocess
from datetime import UTC, datetime
from pathlib import Path

from runtime.bus import certificates
from runtime.bus.config import BusConfig, TlsConfig
from runtime.live.finding import Finding, Grade

_DAYS = 30
_PUBLIC = ("0.0.0.0", "[::]", "*", "")


def sockets(bus: BusConfig) -> list[Finding]:
    """Return whether somebody answers at the endpoints, and who else could reach them."""
    found = []
    for endpoint in bus.connect:
        protocol, _, place = endpoint.partition("/")
        trouble = _unreachable(protocol, place.partition("?")[0])
        if trouble is None:
            found.append(Finding(Grade.OK, f"endpoint {endpoint}", "somebody listens there"))
        else:
            remedy = "start the hub with pushlane run; on another machine check its bus.listen, cable and firewall"
            found.append(Finding(Grade.FAIL, f"endpoint {endpoint}", trouble, remedy))
    for endpoint in bus.listen:
        host = endpoint.partition("/")[2].partition("?")[0].rpartition(":")[0]
        if host in _PUBLIC and bus.tls is None and not endpoint.startswith("unixsock"):
            remedy = "listen at one address of the robot, or set bus.tls; see docs/live.md"
            text = "listens on every network, and everybody there may command the robot"
            found.append(Finding(Grade.WARN, f"endpoint {endpoint}", text, remedy))
    return found


def _unreachable(protocol: str, place: str) -> str | None:
    """Return why nobody answers at an endpoint, or None if somebody does."""
    try:
        if protocol.startswith("unixsock"):
            with socket.socket(socket.AF_UNIX) as probe:
                probe.settimeout(1.0)
                probe.connect(place)
        elif protocol in {"tcp", "tls", "ws"}:
            host, _, port = place.rpartition(":")
            socket.create_connection((host.strip("[]"), int(port)), timeout=1.0).close()
    except (OSError, ValueError) as error:
        return f"nobody answers: {error.strerror if isinstance(error, OSError) and error.strerror else error}"
    return None


def certificates_of(tls: TlsConfig | None) -> list[Finding]:
    """Return whether the certificates are good, and for how long."""
    if tls is None:
        return []
    try:
        certificates.check(tls)
    except certificates.BadCertificate as error:
        return [Finding(Grade.FAIL, "certificates", str(error), "make new ones: see docs/deploy.md")]
    if shutil.which("openssl") is None:
        text = f"{tls.certificate} and its key fit together; its end is not known"
        return [Finding(Grade.WARN, "certificates", text, "install openssl")]
    found = []
    verified = _openssl("verify", "-CAfile", tls.ca, tls.certificate)
    if verified.returncode != 0:
        reason = (verified.stderr or verified.stdout).strip().replace("\n", "; ")[:200]
        remedy = "sign it with the authority that the other machines have in bus.tls.ca"
        found.append(Finding(Grade.FAIL, "certificates", f"{tls.certificate} is not of {tls.ca}: {reason}", remedy))
    now = datetime.now(UTC)
    return [*found, *(lifetime(Path(path), now) for path in (tls.certificate, tls.ca))]


def lifetime(path: Path, now: datetime) -> Finding:
    """Return for how long the certificate in the file `path` is good."""
    said = _openssl("x509", "-in", str(path), "-noout", "-enddate").stdout.strip().partition("=")[2]
    try:
        end = datetime.strptime(said, "%b %d %H:%M:%S %Y GMT").replace(tzinfo=UTC)
    except ValueError:
        return Finding(Grade.FAIL, "certificates", f"{path} cannot be read", "make a new one: see docs/deploy.md")
    days = (end - now).total_seconds() / 86400.0
    text = f"{path} ends on {end:%Y-%m-%d}, in {days:.0f} days"
    if days < 0:
        return Finding(Grade.FAIL, "certificates", f"{path} ended on {end:%Y-%m-%d}", "renew it: see docs/deploy.md")
    if days < _DAYS:
        return Finding(Grade.WARN, "certificates", text, "renew it soon: links end with their certificate")
    return Finding(Grade.OK, "certificates", text)


def _openssl(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["openssl", *arguments], capture_output=True, text=True, check=False, timeout=10)
