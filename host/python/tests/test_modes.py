"""`jr.modes` is `jointrig modes`."""

import json
from pathlib import Path

import numpy as np
import pytest
from conftest import DATA, command

import jointrig as jr

AJB = DATA / "frf_default" / "AJB.npz"


def test_the_modes_are_the_commands(tmp_path: Path) -> None:
    whole = jr.read_frf(AJB)
    # a few of its FRFs, because all take a quarter of a minute
    few = whole.select(whole.outputs[:6], whole.inputs[:2])
    few.save(tmp_path / "few.npz")
    told = json.loads(command("modes", tmp_path / "few.npz", "--band", "50:600", "--json").stdout)
    assert told["modes"]
    assert jr.modes(tmp_path / "few.npz", band_hz=(50, 600)) == told
    assert jr.modes(few, band_hz=(50, 600)) == told


def test_an_oscillator_of_arrays_has_its_mode() -> None:
    frequency_hz = np.arange(50.0, 400.0)
    s = 2j * np.pi * frequency_hz
    omega = 2 * np.pi * 200
    mobility = s / (s * s + 0.02 * omega * s + omega * omega)
    y = jr.make_frf(frequency_hz, mobility[:, None, None], "mobility", ["A1:z"], ["A1"])
    (mode,) = jr.modes(y)["modes"]
    assert mode["frequency_hz"]["mean"] == pytest.approx(200, rel=1e-7)
    assert mode["damping_ratio"]["mean"] == pytest.approx(0.01, rel=1e-5)


@pytest.mark.parametrize(
    ("changed", "said"),
    [({"band_hz": (100, 101)}, "at least 16 are needed"), ({"band_hz": (600, 300)}, "low < high"), ({"frf_error": -1.0}, "frf_error")],
)
def test_what_has_no_modes_is_refused_in_words(changed: dict[str, object], said: str, tmp_path: Path) -> None:
    with pytest.raises(jr.Refused, match=said):
        jr.modes(AJB, **changed)  # type: ignore[arg-type]
    with pytest.raises(jr.FileError, match=r"gone\.npz"):
        jr.modes(tmp_path / "gone.npz")
