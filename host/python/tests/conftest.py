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


def plan_of_one_place(path: Path, changes: list[tuple[str, str]]) -> Path:
    """FRFs of one accelerometer at one place: the template `frf-only` with these replacements."""
    command("plan", "new", path, "--template", "frf-only")
    head, geometry = path.read_text().split("[geometry]")
    away = ('"AY1"', '"AX1"', '"NB2"')
    points = [line for line in geometry.splitlines() if not any(name in line for name in away)]
    one = [
        ('impacts = ["AZ1", "AY1", "AX1"]', 'impacts = ["AZ1"]'),
        ('responses = ["NA1", "NB2"]', 'responses = ["NA1"]'),
    ]
    for old, new in [*changes, *one]:
        assert old in head, old
        head = head.replace(old, new)
    text = head + "[geometry]" + "\n".join(points) + "\n"
    axes = 'channels = ["na1_x", "na1_y", "na1_z"]'
    path.write_text(text.replace(axes, 'axes = [[0, 0, 1]], channels = ["acc_z"]'))
    return path


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
