"""A campaign as columns: what DuckDB and Polars read from them is what the campaign file holds."""

import hashlib
import json
import shutil
import sqlite3
import subprocess
import zlib
from pathlib import Path

import duckdb
import numpy as np
import polars
import pytest

import jointrig as jr
from conftest import JOINTRIG, command


@pytest.fixture(scope="module")
def columns(lab_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("columns") / "out"
    command("export", lab_file, "--format", "parquet", "--out", folder, "--all")
    return folder


def query(folder: Path, text: str) -> list[tuple]:  # type: ignore[type-arg]
    return duckdb.sql(text.replace("DIR", str(folder))).fetchall()


def test_every_record_and_its_samples_are_there(lab_file: Path, columns: Path) -> None:
    records = {record.id: record for record in jr.open(lab_file).records()}
    table = polars.read_parquet(columns / "records.parquet")
    assert table["record"].to_list() == list(records)
    for row in table.iter_rows(named=True):
        own = records[row["record"]]
        for name in ("configuration", "impact", "response", "attempt", "verdict", "standing", "measure", "limit", "sentence", "peak_n"):
            assert row[name] == getattr(own, name), name
        assert row["utc"].isoformat().removesuffix("+00:00")[:19] == own.utc[:19]
    channels = next(iter(records.values())).channels
    sums = ", ".join(f'sum("{name}")' for name in channels)
    samples = "read_parquet('DIR/samples/**/*.parquet', hive_partitioning=true)"
    found = query(columns, f"SELECT record, configuration, count(*), min(scan), max(scan), {sums} FROM {samples} GROUP BY ALL")
    assert len(found) == len(records)
    for record, configuration, count, first, last, *own in found:
        codes = records[record].codes
        assert configuration == records[record].configuration
        assert (count, first, last) == (codes.shape[1], 0, codes.shape[1] - 1)
        assert own == [int(row.sum(dtype=np.int64)) for row in codes]


def test_codes_are_those_of_the_campaign_by_their_checksums(columns: Path) -> None:
    expected = dict(query(columns, "SELECT record, crc32 FROM 'DIR/records.parquet'"))
    checked = 0
    for part in sorted(columns.glob("samples/*/*.parquet")):
        frame = polars.read_parquet(part, hive_partitioning=False)
        for (record,), rows in frame.group_by("record", maintain_order=True):
            codes = rows.sort("scan").drop("record", "scan").to_numpy().astype("<i2")
            # channel after channel, as the campaign file has it
            assert zlib.crc32(np.ascontiguousarray(codes.T).tobytes()) == expected[record], record
            checked += 1
    assert checked == len(expected)


def test_scales_give_the_signals_and_si_writes_them(lab_file: Path, columns: Path, tmp_path: Path) -> None:
    command("export", lab_file, "--format", "parquet", "--out", tmp_path / "si", "--si")
    record = next(record for record in jr.open(lab_file).records() if record.kept)
    signal = record.signal("ldv_a")
    scaled = query(
        columns,
        f"""SELECT s.ldv_a * c.units_per_code FROM read_parquet('DIR/samples/**/*.parquet') s
            JOIN 'DIR/records.parquet' r USING (record)
            JOIN (SELECT * FROM 'DIR/channels.parquet' WHERE channel = 'ldv_a') c USING (session)
            WHERE s.record = {record.id} ORDER BY s.scan""",
    )
    assert np.allclose(np.array(scaled)[:, 0], signal, rtol=1e-12, atol=0)
    si = query(tmp_path / "si", f"SELECT ldv_a FROM read_parquet('DIR/samples/**/*.parquet') WHERE record = {record.id} ORDER BY scan")
    assert np.array_equal(np.array(si, dtype=np.float32)[:, 0], signal.astype(np.float32))


def test_frfs_and_estimates_are_those_of_the_analysis(lab_file: Path, columns: Path) -> None:
    lab = jr.open(lab_file)
    rows = 0
    for name in ("B", "AJB"):
        y = lab.frf(name)
        frame = polars.read_parquet(columns / "frf.parquet").filter(polars.col("configuration") == name)
        measured = np.isfinite(y.frf.real)
        assert len(frame) == measured.sum()
        rows += len(frame)
        total = complex(frame["re"].sum(), frame["im"].sum())
        assert abs(total - y.frf[measured].sum()) < 1e-9 * np.abs(y.frf[measured]).sum()
        assert y.coherence is not None and y.variance is not None
        for own, array in (("coherence", y.coherence), ("variance", y.variance)):
            known = frame[own].drop_nulls()
            assert len(known) == np.isfinite(array[measured]).sum()
            assert np.isclose(known.sum(), np.nansum(array[measured]), rtol=1e-9)
    assert query(columns, "SELECT count(*) FROM 'DIR/frf.parquet'") == [(rows,)]
    answer = lab.analyse().results["answer"]["contact"]["k_t_n_per_m"]
    (found,) = query(
        columns, "SELECT stiffness_n_per_m, ci95_low, ci95_high, identified FROM 'DIR/estimates.parquet' WHERE method = 'contact'"
    )
    assert found == (answer["mean"], *answer["ci95"], 1)


def test_the_same_campaign_gives_the_same_bytes_and_checksums_that_hold(lab_file: Path, columns: Path, tmp_path: Path) -> None:
    again = tmp_path / "again"
    command("export", lab_file, "--format", "parquet", "--out", again, "--all")
    document = json.loads((columns / "campaign.json").read_text())
    assert (again / "campaign.json").read_bytes() == (columns / "campaign.json").read_bytes()
    assert set(document["files"]) == {str(path.relative_to(columns)) for path in columns.rglob("*.parquet")}
    for name, told in document["files"].items():
        content = (columns / name).read_bytes()
        assert (len(content), hashlib.sha256(content).hexdigest()) == (told["bytes"], told["sha256"])
        assert query(columns, f"SELECT count(*) FROM 'DIR/{name}'") == [(told["rows"],)]
        assert (again / name).read_bytes() == content
    said = command("export", lab_file, "--format", "parquet", "--out", again, code=1).stderr
    assert "this folder contains an export already" in said


def test_a_damaged_record_is_named_and_a_killed_export_leaves_no_half_file(lab_file: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken.jrig"
    shutil.copy(lab_file, broken)
    with sqlite3.connect(broken) as file:
        for (trigger,) in file.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            file.execute(f'DROP TRIGGER "{trigger}"')
        file.execute("UPDATE records SET samples = zeroblob(length(samples)) WHERE id = 7")
    said = command("export", broken, "--format", "parquet", "--out", tmp_path / "broken", code=1).stderr
    assert "record 7" in said
    assert not list((tmp_path / "broken").rglob("part-0000.parquet*.part"))

    killed = tmp_path / "killed"
    export = subprocess.Popen([JOINTRIG, "export", lab_file, "--format", "parquet", "--out", killed], stderr=subprocess.DEVNULL)
    while not list(killed.rglob("*.part")):
        assert export.poll() is None, "it ended before it was killed"
    export.kill()
    export.wait()
    assert not (killed / "campaign.json").exists()
    for whole in killed.rglob("*.parquet"):
        duckdb.sql(f"SELECT count(*) FROM '{whole}'").fetchall()
