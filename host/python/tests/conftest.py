"""A small campaign on the simulated rig, measured once by the command."""

import os
import re
import subprocess
from pathlib import Path

import pytest

JOINTRIG = os.environ["JOINTRIG_BIN"]
# FRFs and records that the command's own tests use
DATA = Path(__file__).parents[2] / "tests" / "data"
# good hits of `short_contact_plan`
HITS = 44


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


def short_contact_plan(path: Path) -> Path:
    """The plan for a contact's own stiffness with fewer cells and without the open joint.

    Two hits of one second in each cell: HITS in all.
    """
    command("plan", "new", path, "--template", "contact")
    text = path.read_text()
    text = re.sub(r'impacts = \["BZ1".*\]', 'impacts = ["BZ1", "BZ2", "BZ3"]', text)
    for impact, response in [("OPEN", "OPEN"), ("AZ3", "A3")]:
        block = f'[[configuration]]\nname = "AJB"\nimpacts = ["{impact}"]\nresponses = ["{response}"]\n'
        assert block in text, block
        text = text.replace(block, "")
    cells = 'impacts = ["AZ1", "AZ3"]\nresponses = ["C1", "C2", "C3", "B1", "B2", "BL"]'
    text = re.sub(r'impacts = \["AZ1".*\]\nresponses = .*', cells, text)
    text = text.replace("wanted = 6", "wanted = 2").replace("length_s = 2.0", "length_s = 1.0")
    path.write_text(text.replace("exponential_per_s = 2.3", "exponential_per_s = 4.6"))
    return path


def measured(folder: Path, plan: Path) -> Path:
    """A campaign on the simulated rig."""
    file = folder / "lab.jrig"
    command("campaign", "new", file, "--plan", plan)
    command("campaign", "run", file, "--device", "sim:", "--yes")
    return file


@pytest.fixture(scope="session")
def lab_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("contact")
    return measured(folder, short_contact_plan(folder / "plan.toml"))


@pytest.fixture(scope="session")
def small_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("small")
    command("plan", "new", folder / "plan.toml", "--template", "small")
    return measured(folder, folder / "plan.toml")
