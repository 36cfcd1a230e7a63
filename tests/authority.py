"""Certificates for tests, made by the script that users run, and by openssl where the script would refuse."""

from __future__ import annotations

import subprocess
from pathlib import Path

from runtime.bus.config import TlsConfig

SCRIPT = Path(__file__).parents[1] / "deploy" / "certificates"


def certificates(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run deploy/certificates."""
    return subprocess.run([SCRIPT, *arguments], capture_output=True, text=True, check=False)


class Authority:
    """An authority in `folder` that gives out certificates."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def host(self, name: str, *addresses: str) -> TlsConfig:
        """Return the files of the host `name`."""
        return self._issued("host", name, *(word for one in addresses for word in ("--address", one)))

    def operator(self, name: str) -> TlsConfig:
        """Return the files of the operator `name`."""
        return self._issued("operator", name)

    def ending(self, name: str, start: str, end: str) -> TlsConfig:
        """Return the files of a host whose certificate holds from `start` to `end`, both as YYMMDDHHMMSSZ."""
        own = Path(self.host(f"{name}-seed").certificate).parent
        state = self.folder / f"state-{name}"
        state.mkdir()
        (state / "index").touch()
        (state / "config").write_text(
            f"[ca]\ndefault_ca = one\n[one]\ndatabase = {state}/index\nnew_certs_dir = {state}\nrand_serial = yes\n"
            "default_md = sha256\npolicy = any\n[any]\ncommonName = supplied\n"
        )
        _openssl("req", "-new", "-key", own / "own.key", "-subj", f"/CN={name}", "-out", state / "request")
        authority = ("-cert", self.folder / "ca" / "ca.crt", "-keyfile", self.folder / "ca" / "ca.key")
        extensions = ("-extfile", own / "made-as", "-notext", "-batch", "-out", state / "own.crt")
        dates = ("-startdate", start, "-enddate", end)
        _openssl("ca", "-config", state / "config", *authority, *dates, "-in", state / "request", *extensions)
        return TlsConfig(ca=str(own / "ca.crt"), certificate=str(state / "own.crt"), key=str(own / "own.key"))

    def _issued(self, role: str, name: str, *options: str) -> TlsConfig:
        made = certificates(self.folder, role, name, *options)
        assert made.returncode == 0, made.stderr
        own = self.folder / name
        return TlsConfig(ca=str(own / "ca.crt"), certificate=str(own / "own.crt"), key=str(own / "own.key"))


def _openssl(*arguments: str | Path) -> None:
    subprocess.run(["openssl", *arguments], capture_output=True, check=True)
