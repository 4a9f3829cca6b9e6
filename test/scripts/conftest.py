"""Makes scripts/ importable and gives the tests a way to run a script as a user does."""

import subprocess
import sys
from pathlib import Path
from typing import Callable, List

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(REPOSITORY / "scripts"))
sys.path.insert(0, str(Path(__file__).resolve().parent))


@pytest.fixture
def run_script() -> Callable[..., subprocess.CompletedProcess]:
    """Runs `scripts/NAME ARG...` and returns code, stdout and stderr."""

    def run(name: str, *arguments: object) -> subprocess.CompletedProcess:
        command: List[str] = ["/usr/bin/python3", str(REPOSITORY / "scripts" / name)] + [
            str(a) for a in arguments
        ]
        return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)

    return run


@pytest.fixture
def shared_data() -> Path:
    """The folder with real recordings, or a skip where it does not exist."""
    folder = REPOSITORY.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no real recordings at {folder}")
    return folder
