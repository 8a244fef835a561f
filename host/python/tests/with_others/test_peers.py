"""The same numbers as pyFRF and pyFBS, and the forms in which other packages hold FRFs."""

import sys

import numpy as np
import pandas
import polars
import pyFRF
import pytest
from pyfbs.interface import VPT

import jointrig as jr
from conftest import DATA
from test_signals import FS, hits


def test_frfs_are_pyfrfs() -> None:
    force, motion = hits(5)
    # without a window and with a force that is zero outside its pulse both average the same numbers
    force[np.abs(force) < 1.0] = 0.0
    peer = pyFRF.FRF(int(FS), force, motion, exc_type="f", resp_type="v")
    for name in ("H1", "H2"):
        theirs = peer.get_FRF(name, frf_form="mobility")[0, 0, 1:]
        ours, verdicts = jr.frf(fs_hz=FS, force_n=force, response=motion, quantity="velocity", sigma_per_s=0.0, estimator=name)
        assert verdicts == ["good"] * 5
        # windows begin where the pulse does: the phase at which a pulse lies is no part of either
        size = np.maximum(np.abs(theirs), np.abs(theirs).mean())
        assert np.abs((ours.frf[1:, 0, 0] - theirs) / size).max() < 1e-9, name
    assert ours.coherence is not None
    assert np.abs(ours.coherence[1:, 0, 0] - peer.get_coherence()[0, 1:]).max() < 1e-9


def virtual_points(name: str, groups: list[int]) -> np.ndarray:
    """pyFBS's virtual points of FRFs that were handed over, (line, motion, load), accelerance."""
    sheets = pandas.read_excel(DATA / "positions" / "positions.xlsx", sheet_name=None)
    tables = [f"Channels_{name}", f"Impacts_{name}", "VP_Channels", "VP_RefChannels"]
    # without the internal sensors and impacts, which pass through a virtual point transformation as they are
    at_interface = [sheets[table].Grouping.isin(groups).to_numpy() for table in tables]
    points = VPT(*(sheets[table][own] for table, own in zip(tables, at_interface, strict=True)))
    frequency, accelerance = jr.read_frf(DATA / "frf_rigid" / f"{name}.npz").to_pyfbs()
    points.apply_vpt(frequency, accelerance[:, at_interface[0]][:, :, at_interface[1]])
    return points.frf


def test_the_joint_is_what_pyfbss_virtual_points_give() -> None:
    joint = np.linalg.inv(virtual_points("AJB", [1, 2]))
    joint[:, :6, :6] -= np.linalg.inv(virtual_points("A", [1]))
    joint[:, 6:, 6:] -= np.linalg.inv(virtual_points("B", [2]))
    y = jr.read_frf(DATA / "frf_rigid" / "AJB.npz")
    s = y.sigma_per_s + 2j * np.pi * y.frequency_hz
    # a joint without mass is [K -K; -K K]; apparent mass times s^2 is dynamic stiffness
    blocks = [sign * joint[:, row, column] * s**2 for sign, row, column in [(1, 2, 2), (-1, 2, 8), (-1, 8, 2), (1, 8, 8)]]
    found = jr.identify(
        **{name.lower(): DATA / "frf_rigid" / f"{name}.npz" for name in ("A", "B", "AJB")},  # type: ignore[arg-type]
        geometry=DATA / "positions" / "positions.xlsx",
        method="inverse",
        idms=6,
        band_hz=(300, 600),
    )
    (row,) = found.results["joint"]
    band = (y.frequency_hz >= 300) & (y.frequency_hz <= 600)
    for theirs in blocks:
        assert abs(row["stiffness_n_per_m"]["z"]["mean"] / theirs.real[band].mean() - 1) < 1e-5


@pytest.mark.parametrize("package", [pandas, polars])
def test_a_data_frame_has_a_row_for_each_line_of_each_frf(package, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    if package is polars:
        monkeypatch.setitem(sys.modules, "pandas", None)
    y = jr.read_frf(DATA / "frf_rigid" / "A.npz")
    rows = y.to_dataframe()
    assert type(rows).__module__.startswith(package.__name__)
    assert len(rows) == y.frf.size
    if package is polars:
        one = rows.filter((polars.col("output") == y.outputs[1]) & (polars.col("input") == y.inputs[2]))
        values = one["re"].to_numpy() + 1j * one["im"].to_numpy()
    else:
        one = rows[(rows.output == y.outputs[1]) & (rows.input == y.inputs[2])]
        values = (one.re + 1j * one.im).to_numpy()
    assert np.array_equal(values, y.frf[:, 1, 2])
