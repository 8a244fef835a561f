"""Hits and levels that Python adds are judged and stored as the command's."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import command

import jointrig as jr

UNITS = {"force": "N", "excitation": "N", **{name: "m/s" for name in ("vib_x", "vib_y", "vib_z", "ldv_a", "ldv_b")}}
UNITS |= {f"lc_{cell}": "N" for cell in (1, 2, 3)}


def empty(folder: Path) -> jr.Lab:
    command("plan", "new", folder / "plan.toml", "--template", "small")
    return jr.new(folder / "new.jrig", folder / "plan.toml")


def arrays(records: list[jr.Record], *, codes: bool) -> dict[str, np.ndarray]:
    names = records[0].channels
    return {name: np.stack([record.samples(name) if codes else record.signal(name) for record in records]) for name in names}


@pytest.mark.parametrize("codes", [True, False])
def test_a_campaign_can_be_written_again(small_file: Path, tmp_path: Path, codes: bool) -> None:
    measured, lab = jr.open(small_file), empty(tmp_path)
    cells: dict[tuple[str, str, str], list[jr.Record]] = {}
    for record in measured.records():
        if record.verdict != "mistimed":
            cells.setdefault((record.configuration, record.impact, record.response), []).append(record)
    for cell, records in cells.items():
        channels = arrays(records, codes=codes)
        first = records[0]
        scale = {name: first.scale(name) for name in channels} if codes else None
        added = lab.add_hits(*cell, fs_hz=first.fs_hz, channels=channels, units=UNITS, scale=scale,
                             delay_s={name: first.delay_s(name) for name in channels},
                             trigger_index=first.trigger_index)  # fmt: skip
        assert [verdict for verdict, _ in added["verdicts"]] == [record.verdict for record in records], cell
        assert (added["hits"], added["already"]) == (len(records), 0)
        again = lab.add_hits(*cell, fs_hz=first.fs_hz, channels=channels, units=UNITS, scale=scale,
                             delay_s={name: first.delay_s(name) for name in channels},
                             trigger_index=first.trigger_index)  # fmt: skip
        assert again["already"] == len(records)
        stored = lab.records(configuration=cell[0], impact=cell[1], response=cell[2])
        assert len(stored) == len(records)
        for ours, theirs in zip(stored, records, strict=True):
            for name in channels:
                assert ours.samples(name).dtype == (np.int16 if codes else np.float64)
                # a scale is stored in single precision
                assert np.allclose(ours.signal(name), theirs.signal(name), rtol=1e-7 if codes else 0, atol=0), name
    assert lab.status()["kept"] == measured.status()["kept"] > 0
    written, original = lab.frf("AJB"), measured.frf("AJB")
    assert (written.outputs, written.inputs) == (original.outputs, original.inputs)
    # imported records are used from their pulse on, so their lines lie a little closer: 0.003 Hz at the end of a line
    common = original.frequency_hz[::20]
    for output, input_ in np.ndindex(original.frf.shape[1:]):
        one, other = (np.interp(common, y.frequency_hz, y.frf[:, output, input_]) for y in (written, original))
        assert np.abs(one - other).max() < 0.01 * np.abs(other).max(), (output, input_)
    command("campaign", "verify", lab.path, "--deep")


def test_what_cannot_be_used_is_refused_and_nothing_is_stored(small_file: Path, tmp_path: Path) -> None:
    records = jr.open(small_file).records(configuration="B", kept=True)
    lab, first = empty(tmp_path), records[0]
    channels = arrays(records, codes=False)
    cell = (first.configuration, first.impact, first.response)

    def refused(sentence: str, **changed: object) -> None:
        given: dict[str, object] = {"fs_hz": first.fs_hz, "channels": channels, "units": UNITS} | changed
        with pytest.raises(jr.Refused, match=sentence):
            lab.add_hits(*cell, **given)  # type: ignore[arg-type]

    refused("channel `typo` .* is not known", channels=channels | {"typo": channels["ldv_a"]}, units=UNITS | {"typo": "m/s"})
    refused("a scale of 0", scale={"force": 0.0})
    refused("sensitivity is not known", units=UNITS | {"excitation": "V"})
    refused("channel `ldv_a` has no unit", units={name: unit for name, unit in UNITS.items() if name != "ldv_a"})
    refused("`bananas` is not a known unit", units=UNITS | {"vib_x": "bananas"})
    refused("units names `vib_q`", units=UNITS | {"vib_q": "m/s"})
    refused("sign is the wrong way round", channels=channels | {"force": -channels["force"]})
    refused("has 1 axes", channels=channels | {"force": channels["force"][0]})
    refused("int16, int32, float32 or float64", channels=channels | {"force": channels["force"].astype(complex)})
    refused("is not a number", channels=channels | {"vib_z": channels["vib_z"] * np.nan})
    refused("differ in length", channels=channels | {"vib_z": channels["vib_z"][:, 1:]})
    refused("no channel is the hammer's force", channels={name: own for name, own in channels.items() if name != "force"},
            units={name: unit for name, unit in UNITS.items() if name != "force"})  # fmt: skip
    with pytest.raises(jr.Refused, match="no impact `QZ1`"):
        lab.add_hits("A", "QZ1", fs_hz=first.fs_hz, channels=channels, units=UNITS)
    with pytest.raises(jr.Refused, match="response= one of A1, A2"):
        lab.add_hits("A", "AZ1", fs_hz=first.fs_hz, channels=channels, units=UNITS)
    with pytest.raises(jr.FileError, match="exist"):
        jr.new(lab.path, tmp_path / "plan.toml")
    assert lab.records() == []


def test_a_continuous_recording_is_cut_as_by_the_command(small_file: Path, tmp_path: Path) -> None:
    lab, measured = empty(tmp_path), jr.open(small_file)
    cells: dict[tuple[str, str, str], list[jr.Record]] = {}
    for record in measured.records(kept=True):
        cells.setdefault((record.configuration, record.impact, record.response), []).append(record)
    (one, first), (two, second) = list(cells.items())[:2]
    hits, names = [*first, *second], first[0].channels
    # a second of silence between the records
    quiet = np.zeros(int(first[0].fs_hz))
    channels = {name: np.concatenate([part for hit in hits for part in (quiet, hit.signal(name))] + [quiet]) for name in names}
    given: dict[str, Any] = {"fs_hz": first[0].fs_hz, "channels": channels, "units": UNITS}
    with pytest.raises(jr.Refused, match='order="plan" .* marker="CHANNEL:STEP"'):
        lab.cut(**given)
    with pytest.raises(jr.Refused, match='order is `time`: "plan" is the only one'):
        lab.cut(**given, order="time")
    with pytest.raises(jr.Refused, match="CHANNEL:STEP"):
        lab.cut(**given, marker="ai7")
    rows = [",".join((str(number + 1), *(one if number < len(first) else two))) for number in range(len(hits))]
    table = "\n".join(["hit,configuration,impact,response", *rows]) + "\n"
    listed = lab.cut(**given, table=table, dry_run=True)
    assert f"{len(hits)} hits" in listed["report"][0] and listed["hits"] == 0 and lab.records() == []
    added = lab.cut(**given, table=table)
    assert (added["hits"], added["kept"], added["already"]) == (len(hits), len(hits), 0)
    assert [verdict for _, _, verdict, _ in added["verdicts"]] == ["good"] * len(hits)
    assert lab.cut(**given, table=table)["already"] == len(hits)
    for cell, own in ((one, first), (two, second)):
        stored = lab.records(configuration=cell[0], impact=cell[1], response=cell[2])
        assert [record.signal("force").max() for record in stored] == [record.signal("force").max() for record in own]
    command("campaign", "verify", lab.path, "--deep")


def test_a_level_is_measured_from_its_samples(tmp_path: Path) -> None:
    lab, fs_hz = empty(tmp_path), 51_200.0
    t = np.arange(51_200) / fs_hz
    omega = 2 * np.pi * 100
    # 2 um between the specimens
    channels = {"LDV_A": 1.5e-3 * omega * np.cos(omega * t), "LDV_B": -0.5e-3 * omega * np.cos(omega * t),
                **{f"LC{cell}": 10 * np.sin(omega * t) for cell in (1, 2, 3)}}  # fmt: skip
    units = {"LDV_A": "mm/s", "LDV_B": "mm/s", "LC1": "N", "LC2": "N", "LC3": "N"}
    added = lab.add_level(100, 2e-6, fs_hz=fs_hz, channels=channels, units=units)
    assert abs(added["reached"] / 2e-6 - 1) < 1e-3 and not added["already"]
    assert lab.add_level(100, 2e-6, fs_hz=fs_hz, channels=channels, units=units)["already"]
    command("campaign", "verify", lab.path, "--deep")
    with pytest.raises(jr.Refused, match="velocities of both specimens"):
        lab.add_level(100, 2e-6, fs_hz=fs_hz, channels={"LC1": channels["LC1"]}, units={"LC1": "N"})
    with pytest.raises(jr.Refused, match="held is `speed`"):
        lab.add_level(100, 2e-6, fs_hz=fs_hz, channels=channels, units=units, held="speed")
