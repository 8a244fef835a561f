"""How the files of this folder were made: pyuff 2.5.8 writes them, as a front end's own software would.

    python make.py ../../host/tests/data

FRFs of A, B and the assembly are those of the simulated rig of jointrig's tests, at the interfaces, 300 to 600 Hz; the records are hits on an oscillator of 1 kg,
200 Hz and 1 %.
"""

import shutil
import sys
from pathlib import Path

import numpy as np
import pyuff

DATA, HERE = Path(sys.argv[1]), Path(__file__).parent
AXES = {"x": 1, "y": 2, "z": 3}


def axis(direction: np.ndarray) -> int:
    """UFF's code of a direction along an axis: 1 to 3, negative against it."""
    place = int(np.argmax(np.abs(direction)))
    return int(np.sign(direction[place])) * (place + 1)


def rows(table: str) -> dict[str, np.ndarray]:
    """Names and directions of what a table has at the interfaces."""
    lines = [line.split(",") for line in (DATA / "positions" / "csv" / f"{table}.csv").read_text().splitlines()]
    columns = [lines[0].index(f"Direction_{n}") for n in (1, 2, 3)]
    name, group = lines[0].index("Name"), lines[0].index("Grouping")
    return {line[name]: np.array([float(line[c]) for c in columns]) for line in lines[1:] if line[group] in ("1", "2")}


def write_frfs(name: str) -> None:
    data = np.load(DATA / "frf_default" / f"{name}.npz")
    impacts, sensors = rows(f"Impacts_{name}"), rows(f"Channels_{name}")
    frequency = data["frequency"]
    # mobility, as a laser vibrometer gives it
    frf = data["frf"] * (2j * np.pi * frequency)[:, None, None]
    band = (frequency >= 300) & (frequency <= 600) & (frequency % 20 == 0)
    step = float(np.diff(frequency[band])[0])
    path = HERE / "frfs" / f"{name}.uff"
    path.unlink(missing_ok=True)
    file = pyuff.UFF(str(path))
    for o, output in enumerate(data["outputs"]):
        sensor, along = str(output).split(":")
        for i, impact in enumerate(data["inputs"]):
            if str(impact) not in impacts or not any(name.startswith(sensor) for name in sensors):
                continue
            set_ = pyuff.prepare_58(
                binary=1, func_type=4, rsp_node=o + 1, rsp_dir=AXES[along], rsp_ent_name=sensor,
                ref_node=i + 1, ref_dir=axis(impacts[str(impact)]), ref_ent_name=str(impact), ord_data_type=6, num_pts=int(band.sum()), abscissa_spacing=1,
                abscissa_min=float(frequency[band][0]), abscissa_inc=step,
                abscissa_spec_data_type=18, ordinate_spec_data_type=11, orddenom_spec_data_type=13,
            )  # fmt: skip
            file.write_sets(set_ | {"data": frf[band, o, i], "x": frequency[band]}, mode="add")


def write_records() -> None:
    fs, rng = 10_240, np.random.default_rng(5)
    t = np.arange(fs) / fs
    pulse = np.where((t >= 0.005) & (t < 0.0065), 1 - np.cos(2 * np.pi * (t - 0.005) / 0.0015), 0.0)
    omega, zeta = 2 * np.pi * 200.0, 0.01
    damped = omega * np.sqrt(1 - zeta**2)
    kernel = np.exp(-zeta * omega * t) * (np.cos(damped * t) - zeta * omega / damped * np.sin(damped * t))
    kernel[0] *= 0.5
    velocity = np.fft.irfft(np.fft.rfft(pulse, 2 * fs) * np.fft.rfft(kernel, 2 * fs), 2 * fs)[:fs] / fs
    path = HERE / "hits.uff"
    path.unlink(missing_ok=True)
    file = pyuff.UFF(str(path))
    for gain in (24.0, 25.0, 26.0):
        signals = [("AZ1", -3, 13, gain * pulse + 0.01 * rng.standard_normal(fs))]
        signals.append(("A1", 3, 11, gain * velocity + 1e-6 * rng.standard_normal(fs)))
        for name, along, quantity, signal in signals:
            set_ = pyuff.prepare_58(
                binary=1, func_type=1, rsp_node=1, rsp_dir=along, rsp_ent_name=name, ref_node=0, ref_dir=0, ref_ent_name="NONE",
                ord_data_type=2, num_pts=fs, abscissa_spacing=1, abscissa_min=0.0, abscissa_inc=1 / fs,
                abscissa_spec_data_type=17, ordinate_spec_data_type=quantity, orddenom_spec_data_type=0, id1="hit",
            )  # fmt: skip
            file.write_sets(set_ | {"data": signal, "x": t}, mode="add")


for structure in ("A", "B", "AJB"):
    write_frfs(structure)
write_records()
shutil.rmtree(HERE / "positions", ignore_errors=True)
shutil.copytree(DATA / "positions" / "csv", HERE / "positions")
