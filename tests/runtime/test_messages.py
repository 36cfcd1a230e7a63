from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.support import ROOT

PROTOS = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "runtime" / "messages").glob("*.proto"))


@pytest.fixture(scope="module")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("generated")
    protoc = [sys.executable, "-m", "grpc_tools.protoc", "-I", "."]
    subprocess.run([*protoc, f"--python_out={out}", f"--pyi_out={out}", *PROTOS], cwd=ROOT, check=True)
    return out / "runtime" / "messages"


def test_generated_code_is_what_protoc_makes_of_the_definitions(generated: Path) -> None:
    fresh = {path.name: path.read_bytes() for path in generated.iterdir()}
    kept = {path.name: path.read_bytes() for path in (ROOT / "runtime" / "messages").glob("*_pb2.py*")}
    assert len(fresh) == 2 * len(PROTOS) > 0
    assert fresh.keys() == kept.keys()
    assert [name for name in fresh if fresh[name] != kept[name]] == []
