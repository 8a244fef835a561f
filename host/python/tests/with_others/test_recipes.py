"""Every recipe of docs/recipes.md, on a file that its library wrote, gives the hits that were written."""

import re
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pandas
import pytest
import pyuff
import soundfile
from conftest import command
from nptdms import ChannelObject, TdmsWriter
from scipy.io import savemat

import jointrig as jr

PAGE = (Path(__file__).parents[4] / "docs" / "recipes.md").read_text()
UNITS = {"force": "N", "x": "m/s", "y": "m/s", "z": "m/s", "LDV_A": "m/s", "LDV_B": "m/s", "LC1": "N", "LC2": "N", "LC3": "N"}
OURS = dict(zip(UNITS, ["force", "vib_x", "vib_y", "vib_z", "ldv_a", "ldv_b", "lc_1", "lc_2", "lc_3"], strict=True))
FULL = dict(zip(UNITS, [500.0, 0.05, 0.05, 0.05, 0.01, 0.01, 200.0, 200.0, 200.0], strict=True))
FS = 51_200


def section(title: str) -> str:
    """The Python blocks of a section; of the beginning for an empty title."""
    sections = re.split(r"^## ", PAGE, flags=re.M)
    own = next(text for text in (sections[1:] if title else sections) if text.startswith(title))
    blocks = re.findall(r"^```python\n(.*?)^```", own, re.M | re.S)
    assert blocks, title
    return "\n".join(blocks)


def tdms(hits: dict[str, np.ndarray], folder: Path) -> None:
    with TdmsWriter(folder / "hits.tdms") as writer:
        for hit in range(len(hits["force"])):
            writer.write_segment([
                ChannelObject(f"hit {hit}", name, own[hit], properties={"wf_increment": 1 / FS, "unit_string": UNITS[name]})
                for name, own in hits.items()
            ])  # fmt: skip


def mat(hits: dict[str, np.ndarray], folder: Path) -> None:
    savemat(folder / "hits.mat", {"fs": FS, **{name: own.T for name, own in hits.items()}})


def hdf5(hits: dict[str, np.ndarray], folder: Path) -> None:
    with h5py.File(folder / "hits.h5", "w") as file:
        file.attrs["fs_hz"] = FS
        for name, own in hits.items():
            file.create_dataset(f"signals/{name}", data=own).attrs["unit"] = UNITS[name]


def lvm(hits: dict[str, np.ndarray], folder: Path) -> None:
    """No library writes LVM: as LabVIEW documents it (LabVIEW Measurement File, version 2)."""
    names, count = list(hits), len(hits["force"])
    with (folder / "hits.lvm").open("w", newline="") as file:

        def line(*cells: object) -> None:
            file.write("\t".join(map(str, cells)) + "\n")

        line("LabVIEW Measurement")
        for key, value in [("Writer_Version", 2), ("Reader_Version", 2), ("Separator", "Tab"), ("Decimal_Separator", "."),
                           ("Multi_Headings", "Yes"), ("X_Columns", "No"), ("Time_Pref", "Absolute"), ("Operator", "lab"),
                           ("Date", "2026/11/27"), ("Time", "10:00:00.0")]:  # fmt: skip
            line(key, value)
        line("***End_of_Header***")
        line()
        for hit in range(count):
            samples = np.stack([own[hit] for own in hits.values()], axis=1)
            line("Channels", len(names))
            line("Samples", *[len(samples)] * len(names))
            line("Date", *["2026/11/27"] * len(names))
            line("Time", *["10:00:00.0"] * len(names))
            line("Y_Unit_Label", *[UNITS[name] for name in names])
            line("X_Dimension", *["Time"] * len(names))
            line("X0", *["0.0"] * len(names))
            line("Delta_X", *[repr(1 / FS)] * len(names))
            line("***End_of_Header***")
            line("X_Value", *names, "Comment")
            for sample in samples:
                line("", *[repr(float(value)) for value in sample])
            line()


def csv(hits: dict[str, np.ndarray], folder: Path) -> None:
    frames = [
        pandas.DataFrame({"hit": hit, "time_s": np.arange(hits["force"].shape[1]) / FS}
                         | {f"{name} ({UNITS[name]})": own[hit] for name, own in hits.items()})
        for hit in range(len(hits["force"]))
    ]  # fmt: skip
    pandas.concat(frames).to_csv(folder / "hits.csv", index=False)


def wav(hits: dict[str, np.ndarray], folder: Path) -> None:
    for hit in range(len(hits["force"])):
        samples = np.stack([own[hit] / FULL[name] for name, own in hits.items()], axis=1)
        soundfile.write(folder / f"hit{hit}.wav", samples, FS, subtype="PCM_24")


def uff(hits: dict[str, np.ndarray], folder: Path) -> None:
    file = pyuff.UFF(folder / "hits.uff")
    for hit in range(len(hits["force"])):
        for name, own in hits.items():
            x = np.arange(len(own[hit])) / FS
            written = pyuff.prepare_58(
                binary=1, func_type=1, rsp_node=1, rsp_dir=3, ref_node=1, ref_dir=3, data=own[hit], x=x, id1=name, rsp_ent_name="A1",
                ref_ent_name="AZ1", abscissa_spacing=1, abscissa_spec_data_type=17, ordinate_spec_data_type=12, orddenom_spec_data_type=0,
                ordinate_axis_units_lab=UNITS[name],
            )  # fmt: skip
            file.write_sets(written, "add")


@pytest.mark.parametrize(
    ("title", "write", "within"),
    [
        ("TDMS", tdms, 0.0),
        ("MATLAB 5", mat, 0.0),
        ("MATLAB 7.3", hdf5, 0.0),
        ("LVM", lvm, 1e-12),
        ("Text tables", csv, 1e-12),
        # a step of 24 bits, of full scale
        ("WAV", wav, 2.0**-23),
        ("Universal", uff, 0.0),
    ],
)
def test_a_recipe(
    title: str, write: Callable[[dict[str, np.ndarray], Path], None], within: float, lab_file: Path, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    records = jr.open(lab_file).records(configuration="AJB", impact="AZ1", response="C1", kept=True)
    hits = {name: np.stack([record.signal(own) for record in records]) for name, own in OURS.items()}
    write(hits, tmp_path)
    command("plan", "new", tmp_path / "plan.toml", "--template", "contact")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(section(""), names)
    exec(section(title), names)
    stored = jr.open("lab.jrig").records(kept=True)
    assert len(stored) == len(records) and (stored[0].impact, stored[0].response) == ("AZ1", "C1")
    for ours, theirs in zip(stored, records, strict=True):
        for name, own in OURS.items():
            scale = FULL[name] if title == "WAV" else np.abs(theirs.signal(own)).max()
            # scales of codes are stored in single precision
            assert np.abs(ours.signal(name) - theirs.signal(own)).max() <= (within + (1e-7 if title == "WAV" else 0)) * scale, name


def test_the_level(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    command("plan", "new", tmp_path / "plan.toml", "--template", "contact")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(section(""), names)
    exec(section("Levels"), names)
    assert "'already': False" in capsys.readouterr().out
