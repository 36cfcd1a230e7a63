"""deploy/certificates: what it makes openssl believes, keys are private, and nothing is overwritten."""

from __future__ import annotations

import stat
import subprocess
from pathlib import Path

import pytest

from tests.authority import certificates


def openssl(*arguments: str | Path) -> str:
    return subprocess.run(["openssl", *arguments], capture_output=True, text=True, check=True).stdout


def test_a_host_gets_all_that_it_needs_and_nothing_that_it_must_not_have(tmp_path: Path) -> None:
    made = certificates(
        tmp_path / "c", "host", "robot", "--address", "robotino", "--address", "192.168.0.1", "--days", "30"
    )
    assert made.returncode == 0, made.stderr
    own = tmp_path / "c" / "robot"
    assert {path.name for path in own.iterdir()} == {"ca.crt", "own.crt", "own.key", "made-as"}
    assert openssl("verify", "-x509_strict", "-CAfile", own / "ca.crt", own / "own.crt").endswith("OK\n")
    for purpose in ("sslserver", "sslclient"):
        openssl("verify", "-purpose", purpose, "-CAfile", own / "ca.crt", own / "own.crt")
    for option, name in (
        ("-verify_hostname", "robot"),
        ("-verify_hostname", "robotino"),
        ("-verify_ip", "192.168.0.1"),
    ):
        openssl("verify", option, name, "-CAfile", own / "ca.crt", own / "own.crt")
    with pytest.raises(subprocess.CalledProcessError):
        openssl("verify", "-verify_hostname", "laptop", "-CAfile", own / "ca.crt", own / "own.crt")
    assert "CN = robot\n" in openssl("x509", "-in", own / "own.crt", "-noout", "-subject")
    openssl("x509", "-in", own / "own.crt", "-noout", "-checkend", str(29 * 86400))
    with pytest.raises(subprocess.CalledProcessError):
        openssl("x509", "-in", own / "own.crt", "-noout", "-checkend", str(31 * 86400))


def test_an_operator_is_no_server(tmp_path: Path) -> None:
    assert certificates(tmp_path, "operator", "anna").returncode == 0
    files = ("-CAfile", tmp_path / "ca" / "ca.crt", tmp_path / "anna" / "own.crt")
    openssl("verify", "-purpose", "sslclient", *files)
    with pytest.raises(subprocess.CalledProcessError):
        openssl("verify", "-purpose", "sslserver", *files)


def test_keys_are_readable_by_their_owner_alone(tmp_path: Path) -> None:
    certificates(tmp_path / "c", "host", "robot")
    certificates(tmp_path / "c", "operator", "anna")
    keys = list((tmp_path / "c").rglob("*.key"))
    assert len(keys) == 3
    assert {stat.S_IMODE(key.stat().st_mode) for key in keys} == {0o600}


def content(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_again_keeps_what_is_there_and_otherwise_refuses(tmp_path: Path) -> None:
    certificates(tmp_path, "host", "robot", "--address", "robotino")
    certificates(tmp_path, "operator", "anna")
    before = content(tmp_path)
    again = certificates(tmp_path, "host", "robot", "--address", "robotino")
    assert (again.returncode, again.stdout[:4]) == (0, "kept")
    assert certificates(tmp_path, "ca").returncode == 0
    for arguments in (["host", "robot"], ["operator", "robot"], ["host", "anna"]):
        refused = certificates(tmp_path, *arguments)
        assert refused.returncode == 1
        assert "remove it first" in refused.stderr
    (tmp_path / "notes").mkdir()
    assert certificates(tmp_path, "host", "notes").returncode == 1
    assert content(tmp_path) == before


def test_two_authorities_do_not_believe_each_other(tmp_path: Path) -> None:
    certificates(tmp_path / "a", "host", "robot")
    certificates(tmp_path / "b", "host", "robot")
    with pytest.raises(subprocess.CalledProcessError):
        openssl("verify", "-CAfile", tmp_path / "a" / "ca" / "ca.crt", tmp_path / "b" / "robot" / "own.crt")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "expected a folder"),
        (["host"], "'' is no name"),
        (["host", "../robot"], "'../robot' is no name"),
        (["host", "ca"], "the authority's own name"),
        (["host", "robot", "--days", "0"], "--days '0': expected a number of days"),
        (["host", "robot", "--days"], "--days '': expected a number of days"),
        (["host", "robot", "--address", "a b"], "--address 'a b': expected a host name"),
        (["operator", "anna", "--address", "x"], "--address is for hosts"),
        (["king", "anna"], "expected ca, host, operator or list"),
        (["host", "robot", "--force"], "'--force' is no option of host"),
    ],
)
def test_what_makes_no_sense_is_refused_with_the_usage(tmp_path: Path, arguments: list[str], says: str) -> None:
    refused = certificates(tmp_path / "c", *arguments)
    assert refused.returncode == 2
    assert says in refused.stderr
    assert "usage: deploy/certificates" in refused.stderr
    assert not (tmp_path / "c").exists()


def test_an_address_that_cannot_be_leaves_nothing_behind(tmp_path: Path) -> None:
    refused = certificates(tmp_path, "host", "robot", "--address", "999.1.1.1")
    assert refused.returncode == 1
    assert "openssl refused" in refused.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["ca"]


def test_the_list_says_when_they_end(tmp_path: Path) -> None:
    certificates(tmp_path, "host", "robot", "--days", "5")
    found = certificates(tmp_path, "list").stdout.splitlines()
    assert [line.split()[0] for line in found] == ["ca", "robot"]
    assert all(" until " in line and line.endswith("GMT") for line in found)
