"""Every Python block of the manual runs, one after the other, as a reader would run them."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from conftest import DATA

DOCS = Path(__file__).parents[4] / "docs"


def blocks(page: str) -> str:
    found = re.findall(r"^```python\n(.*?)^```", (DOCS / page).read_text(), re.M | re.S)
    assert found, f"{page} has no code"
    return "\n".join(found)


def run(code: str, folder: Path) -> str:
    environment = {**os.environ, "MPLBACKEND": "agg"}
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_manual(lab_file: Path, tmp_path: Path) -> None:
    shutil.copy(lab_file, tmp_path / "lab.jrig")
    for name in ("A", "B", "AJB"):
        shutil.copy(DATA / "frf_rigid" / f"{name}.npz", tmp_path)
    shutil.copy(DATA / "positions" / "positions.xlsx", tmp_path)
    told = run(blocks("python.md"), tmp_path)
    assert (tmp_path / "frf.png").stat().st_size > 10_000
    assert (tmp_path / "results" / "report.html").exists() and (tmp_path / "receptance.npz").exists()
    assert "['good', 'good', 'good']" in told and "gone.jrig" in told
