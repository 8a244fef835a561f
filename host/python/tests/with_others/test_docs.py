"""Every Python block of the manual runs, one after the other, as a reader would run them."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import duckdb

from conftest import DATA, HITS, command

DOCS = Path(__file__).parents[4] / "docs"


def fenced(page: str, language: str) -> list[str]:
    found = re.findall(rf"^```{language}\n(.*?)^```", (DOCS / page).read_text(), re.M | re.S)
    assert found, f"{page} has no {language}"
    return found


def blocks(page: str) -> str:
    return "\n".join(fenced(page, "python"))


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
    shutil.copy(DOCS / "plans" / "small.toml", tmp_path)
    told = run(blocks("python.md"), tmp_path)
    assert (tmp_path / "frf.png").stat().st_size > 10_000
    assert (tmp_path / "results" / "report.html").exists() and (tmp_path / "receptance.npz").exists()
    assert "['good', 'good', 'good']" in told and "gone.jrig" in told


def test_the_page_for_users_of_pyfbs(tmp_path: Path) -> None:
    for name in ("A", "B", "AJB"):
        shutil.copy(DATA / "frf_rigid" / f"{name}.npz", tmp_path)
    shutil.copy(DATA / "positions" / "positions.xlsx", tmp_path)
    told = run("\n".join(fenced("coming-from-pyfbs.md", "python")), tmp_path).splitlines()
    sensors, impacts = map(float, told[0].split())
    # a rigid clamp: sensors and impacts fit the virtual point's motions
    assert sensors > 0.999 and impacts > 0.999
    assert abs(float(re.findall(r"'mean': ([0-9.e+]+)", told[1])[0]) / 180e6 - 1) < 1e-5


def test_the_queries_on_columns(lab_file: Path, tmp_path: Path, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    command("export", lab_file, "--format", "parquet", "--out", tmp_path / "columns")
    monkeypatch.chdir(tmp_path)
    peaks, verdicts, frf = (duckdb.sql(query).fetchall() for query in fenced("columns.md", "sql"))
    assert len(peaks) == HITS and all(5 < peak < 500 for _, peak in peaks)
    assert verdicts[0][:2] == ("good", HITS) and verdicts[0][2]
    assert len(frf) > 1000 and all(magnitude > 0 for _, magnitude, _ in frf)
    told = run(blocks("columns.md"), tmp_path)
    assert "AZ1" in told and "peak_n" in told
