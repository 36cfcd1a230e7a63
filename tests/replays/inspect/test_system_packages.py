"""deploy/system-packages: reads the machine's own sources, and adds backports beside them once."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[3] / "deploy" / "system-packages"

DEB822 = """\
Types: deb
# a comment
URIs: http://mirror.example/debian
Suites: bookworm bookworm-updates
Components: main
Signed-By: /usr/share/keyrings/d.gpg

Types: deb
URIs: http://mirror.example/debian-security
Suites: bookworm-security
Components: main
"""
ONE_LINE = "# old\ndeb [arch=amd64 signed-by=/k.gpg] http://mirror.example/debian bookworm-updates main\n"
PLAIN = "deb http://mirror.example/debian bookworm-updates main contrib\n"
OTHER = "deb http://third.example/apt cloud-bookworm main\n"


def run(call: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["bash", "-c", f"source {SCRIPT}; {call}"], capture_output=True, text=True, check=False)


def folder(tmp_path: Path, **files: str) -> Path:
    (tmp_path / "sources.list.d").mkdir()
    for name, text in files.items():
        (tmp_path / "sources.list.d" / name.replace("_", ".")).write_text(text)
    return tmp_path


@pytest.mark.parametrize(
    ("name", "text", "key"),
    [("debian_sources", DEB822, "/usr/share/keyrings/d.gpg"), ("d_list", ONE_LINE, "/k.gpg"), ("d_list", PLAIN, "")],
)
def test_backports_come_from_the_machines_own_source(tmp_path: Path, name: str, text: str, key: str) -> None:
    apt = folder(tmp_path, third_list=OTHER, **{name: text})
    for _ in range(2):
        assert run(f"add_backports bookworm {apt}").returncode == 0
    added = (apt / "sources.list.d" / "bookworm-backports.sources").read_text()
    expected = "Types: deb\nURIs: http://mirror.example/debian\nSuites: bookworm-backports\nComponents: main\n"
    assert added == expected + (f"Signed-By: {key}\n" if key else "")


def test_backports_that_are_there_are_left_alone(tmp_path: Path) -> None:
    apt = folder(tmp_path, d_list=PLAIN, b_list="deb http://mirror.example/debian bookworm-backports main\n")
    assert run(f"add_backports bookworm {apt}").returncode == 0
    assert not (apt / "sources.list.d" / "bookworm-backports.sources").exists()


def test_without_a_debian_source_nothing_is_added(tmp_path: Path) -> None:
    apt = folder(tmp_path, third_list=OTHER)
    assert run(f"add_backports bookworm {apt}").returncode == 1
    assert len(list((apt / "sources.list.d").iterdir())) == 1


@pytest.mark.parametrize(
    ("have", "expected"),
    [
        ("", "mesa-vulkan-drivers libvulkan1 libudev1 openssl systemd"),
        ("22.3.6-1+deb12u1", "mesa-vulkan-drivers"),
        ("25.0.7-2~bpo12+1", ""),
    ],
)
def test_what_is_missing_is_named(have: str, expected: str) -> None:
    got = run(f'installed_version() {{ echo "{have}"; }}; missing')
    assert got.stdout.split() == expected.split()


def test_elsewhere_it_says_so_in_one_line_and_succeeds() -> None:
    got = run("missing() { echo libvulkan1; }; os() { echo plan9; }; main")
    assert got.returncode == 0
    assert got.stdout.count("\n") == 1
    assert "pictures will be missing" in got.stdout
    assert "libvulkan1" in got.stdout


def test_check_fails_with_what_is_missing() -> None:
    got = run("missing() { echo libvulkan1; }; main --check")
    assert got.returncode == 1
    assert got.stdout.startswith("missing: libvulkan1")


def test_no_host_is_named() -> None:
    assert "://" not in SCRIPT.read_text()
