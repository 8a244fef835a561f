"""A small campaign on the simulated rig, measured once by the command."""

import os
import subprocess
from pathlib import Path

import pytest

JOINTRIG = os.environ["JOINTRIG_BIN"]
# FRFs and records that the command's own tests use
DATA = Path(__file__).parents[2] / "tests" / "data"


def command(*arguments: object, code: int = 0) -> subprocess.CompletedProcess[str]:
    """Runs `jointrig`; what it printed."""
    done = subprocess.run([JOINTRIG, *map(str, arguments)], capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    return done


def measured(folder: Path, template: str) -> Path:
    """A campaign of one of the plans that come with jointrig."""
    file = folder / "lab.jrig"
    command("plan", "new", folder / "plan.toml", "--template", template)
    command("campaign", "new", file, "--plan", folder / "plan.toml")
    command("campaign", "run", file, "--device", "sim:", "--yes")
    return file


@pytest.fixture(scope="session")
def lab_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return measured(tmp_path_factory.mktemp("contact"), "contact")


@pytest.fixture(scope="session")
def small_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return measured(tmp_path_factory.mktemp("small"), "small")
