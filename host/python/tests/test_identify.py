"""`jr.identify` is `jointrig identify`."""

import json
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from conftest import DATA, command

import jointrig as jr

GEOMETRY = DATA / "positions" / "positions.xlsx"


def files(case: str) -> dict[str, Path]:
    return {name.lower(): DATA / case / f"{name}.npz" for name in ("A", "B", "AJB")}


def by_command(case: str, *further: object, code: int = 0) -> dict[str, object]:
    """What the command finds, without the names of the files that it read."""
    words = [word for name, path in files(case).items() for word in (f"--{name}", path)]
    told = command("identify", *words, "--geometry", GEOMETRY, "--json", *further, code=code).stdout
    found: dict[str, object] = json.loads(told)
    return without_source(found)


def without_source(found: dict[str, object]) -> dict[str, object]:
    return {name: value for name, value in found.items() if name != "source"}


@pytest.mark.parametrize("case", ["frf_default", "frf_rigid"])
def test_the_answer_is_the_commands(case: str) -> None:
    told = by_command(case, "--method", "inverse,fit", "--idms", "6", "--band", "300:600", "--noise", "0.001")
    found = jr.identify(**files(case), geometry=GEOMETRY, method=["inverse", "fit"], idms=6, band_hz=(300, 600), noise=0.001)  # type: ignore[arg-type]
    assert without_source(found.results) == told
    read = {name: jr.read_frf(path) for name, path in files(case).items()}
    again = jr.identify(**read, geometry=GEOMETRY, method="inverse", idms=["6"], band_hz=[(300, 600)])  # type: ignore[arg-type]
    inverse = by_command(case, "--method", "inverse", "--idms", "6", "--band", "300:600")
    assert without_source(again.results) == inverse
    assert {name: frf.frf.shape for name, frf in again.spectra.items()} == {name.upper(): frf.frf.shape for name, frf in read.items()}


def test_all_of_it_is_asked_for_where_nothing_is_named() -> None:
    found = jr.identify(**files("frf_rigid"), geometry=GEOMETRY)  # type: ignore[arg-type]
    assert without_source(found.results) == by_command("frf_rigid")
    assert repr(found).startswith("Analysis: ")


def test_pictures_are_whole_vectors(tmp_path: Path) -> None:
    found = jr.identify(**files("frf_rigid"), geometry=GEOMETRY)  # type: ignore[arg-type]
    assert found.figures
    for text in [found._repr_svg_(), *(found.svg(name) for name in found.figures)]:
        assert text is not None and ElementTree.fromstring(text).tag.endswith("svg")
        assert "prefers-color-scheme" in text, "light and dark"
    with pytest.raises(jr.Refused, match="there is no figure `nothing`"):
        found.svg("nothing")
    found.report(tmp_path / "out")
    assert json.loads((tmp_path / "out" / "results.json").read_text()) == found.results
    drawn = jr.read_frf(files("frf_rigid")["a"])._repr_svg_()
    assert drawn is not None and ElementTree.fromstring(drawn).tag.endswith("svg")


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"method": "guess"}, "guess"),
        ({"idms": 3}, "2, 4 or 6"),
        ({"idms": "x,x"}, "twice"),
        ({"band_hz": (600, 300)}, "is no band"),
        ({"band_hz": 300}, "band_hz is 300"),
        ({"band_hz": (5e6, 6e6)}, "no line"),
        ({"noise": -1.0}, "noise: a standard deviation"),
        ({"position_error_m": float("nan")}, "position_error_m"),
        ({"method": "fit"}, "variance"),
        ({"geometry": "gone.xlsx"}, "gone.xlsx"),
        ({"a": "gone.npz"}, "gone.npz"),
    ],
)
def test_what_cannot_be_identified_is_refused_in_words(changed: dict[str, object], said: str) -> None:
    arguments: dict[str, object] = {**files("frf_rigid"), "geometry": GEOMETRY, "band_hz": (300, 600)}
    with pytest.raises(jr.Error, match=said):
        jr.identify(**(arguments | changed))  # type: ignore[arg-type]


def test_a_refusal_of_the_command_is_the_same_sentence() -> None:
    arguments: dict[str, object] = {**files("frf_rigid"), "geometry": GEOMETRY}
    words = [word for name, path in files("frf_rigid").items() for word in (f"--{name}", path)]
    said = command("identify", *words, "--geometry", GEOMETRY, "--method", "fit", "--json", code=1).stderr
    with pytest.raises(jr.Refused) as raised:
        jr.identify(**arguments, method="fit")  # type: ignore[arg-type]
    assert said.strip().splitlines()[-1].removeprefix("jointrig: ") == str(raised.value)
