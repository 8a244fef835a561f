"""Joint stiffness from impact campaigns and hysteresis loops.

    import jointrig as jr
    lab = jr.open("lab.jrig")              # read only; also while it is being measured
    y = lab.frf("AJB")                     # y.frf (line, output, input) complex128, SI per N
    found = lab.analyse()                  # found.results: what `jointrig analyse` writes to results.json

    lab = jr.new("own.jrig", "plan.toml")  # a campaign measured with other equipment:
    lab.add_hits("AJB", "AZ1", "C1", fs_hz=51_200, force_n=force, channels={...}, units={...})

All arrays are numpy's, all units SI unless stated. Hits and levels can be added to a campaign file; no device can be opened from here.
`jointrig.bridge` makes a program a recorder that the command measures with.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _native
from ._errors import DataError, Error, FileError, Refused
from ._native import Analysis, Frf, Lab, Record, __version__

__all__ = [
    "Analysis",
    "DataError",
    "Error",
    "FileError",
    "Frf",
    "Lab",
    "Record",
    "Refused",
    "__version__",
    "analyse",
    "frf",
    "hysteresis",
    "identify",
    "make_frf",
    "modes",
    "new",
    "open",
    "read_frf",
]

Path = str | os.PathLike[str]


def open(path: Path) -> Lab:  # noqa: A001
    """A campaign file; it may be measured meanwhile, and is opened for writing only while hits or levels are added. Raises FileError where it cannot be read."""
    return Lab(os.fspath(path))


def new(path: Path, plan: Path) -> Lab:
    """A new campaign file for a plan (TOML, as `jointrig plan new` writes it), for hits and levels that are added.

    Raises FileError where the file exists or cannot be written, DataError where the plan is wrong.
    """
    return _native.new(os.fspath(path), os.fspath(plan))


def analyse(lab: Lab | Path, progress: Callable[[int, int], object] | None = None, *, bootstrap: int = 0) -> Analysis:
    """The analysis of a campaign; `.results` is the dict of `results.json`.

    progress(done, total) is called with the cells done and the cells in all. bootstrap draws the hits anew so often.
    """
    lab = lab if isinstance(lab, Lab) else open(lab)
    return lab.analyse(progress, bootstrap=bootstrap)


def read_frf(path: Path) -> Frf:
    """FRFs of an npz or a universal file (58, 58b); what was left out of it is a warning.

    The npz holds frequency (line,) Hz, frf (line, output, input) complex, quantity, outputs, inputs: docs/own-data.md has all.
    """
    y, notes = Frf.read(os.fspath(path))
    _warn(notes)
    return y


def make_frf(
    frequency_hz: ArrayLike,
    frf: ArrayLike,
    quantity: str,
    outputs: Sequence[str],
    inputs: Sequence[str],
    *,
    sigma_per_s: float = 0.0,
    variance: ArrayLike | None = None,
    coherence: ArrayLike | None = None,
) -> Frf:
    """FRFs from arrays.

    frequency_hz (line,), Hz, rising; frf (line, output, input) complex, SI per N, NaN where not measured; quantity "receptance", "mobility" or
    "accelerance"; variance (line, output, input) of the real part (the imaginary part has as much), coherence likewise.
    sigma_per_s: the exponential window's damping, where one is part of s.
    """

    def beside(name: str, values: ArrayLike | None) -> np.ndarray | None:
        return None if values is None else _array(name, values, 3)

    return Frf(
        frequency_hz=_array("frequency_hz", frequency_hz, 1),
        frf=_array("frf", frf, 3, np.complex128),
        quantity=quantity,
        outputs=list(outputs),
        inputs=list(inputs),
        sigma_per_s=sigma_per_s,
        variance=beside("variance", variance),
        coherence=beside("coherence", coherence),
    )


def identify(
    *,
    a: Frf | Path,
    b: Frf | Path,
    ajb: Frf | Path,
    geometry: Path,
    method: str | Iterable[str] = (),
    idms: int | str | Iterable[int | str] = (),
    band_hz: tuple[float, float] | Iterable[tuple[float, float]] = (),
    position_error_m: float | None = None,
    aim_error_m: float | None = None,
    angle_error_rad: float | None = None,
    mounting_error: float | None = None,
    full_joint: bool = False,
    noise: float | None = None,
) -> Analysis:
    """The joint from FRFs of A, B and the assembly: what `jointrig identify` finds.

    a, b, ajb: Frf, or files of FRFs. geometry: the file of places and directions (.xlsx, a folder of .csv, .toml), metres.
    method: names, all that work line by line where none is given; "fit" where asked for. idms: 2, 4, 6, or modes by name
    ("x,z,ry"). band_hz: (low, high), or several. position_error_m, aim_error_m (m), angle_error_rad (rad), mounting_error and
    noise (fractions) are standard deviations, as the command has them. Raises Refused where what was named gave nothing.
    """
    found, notes = _native.identify(
        a=_matrix(a),
        b=_matrix(b),
        ajb=_matrix(ajb),
        geometry=os.fspath(geometry),
        method=[method] if isinstance(method, str) else list(method),
        idms=[str(idms)] if isinstance(idms, (int, str)) else [str(one) for one in idms],
        band_hz=_bands(band_hz),
        position_error_m=position_error_m,
        aim_error_m=aim_error_m,
        angle_error_rad=angle_error_rad,
        mounting_error=mounting_error,
        full_joint=full_joint,
        noise=noise,
    )
    _warn(notes)
    return found


def modes(y: Frf | Path, *, band_hz: tuple[float, float] | None = None, frf_error: float = 0.01) -> dict[str, Any]:
    """The modes of one structure's FRFs, without picking poles: what `jointrig modes FILE --json` prints.

    y: Frf, or a file of FRFs. band_hz: (low, high), all lines where none is given. frf_error: error of the FRFs beyond their variance,
    as a fraction. "modes" of the result is a list by rising frequency: frequency_hz and damping_ratio with mean and ci95, shape and
    participation by output and input; "modal" says how they were found, with warnings and the stabilisation chart. A campaign's modes are in
    `lab.analyse().results["modes"]`. Raises Refused where nothing can be identified. docs/modes.md has the method.
    """
    return _native.modes(frf=_matrix(y), band_hz=band_hz, frf_error=frf_error)


def frf(
    *,
    fs_hz: float,
    force_n: ArrayLike,
    response: ArrayLike,
    quantity: str,
    estimator: str = "H1",
    sigma_per_s: float | None = None,
    delay_s: Sequence[float] | None = None,
    outputs: Sequence[str] | None = None,
    input: str = "impact",  # noqa: A002
) -> tuple[Frf, list[str]]:
    """FRFs of the good hits of impact records, and the verdict on every hit.

    force_n (hit, sample), N; response (hit, channel, sample), SI; quantity "velocity", "acceleration" or "displacement";
    estimator "H1", "H2" or "Hv" (the geometric mean of both), the variance is H1's. sigma_per_s: the exponential window's
    damping, 1/s, 0 for none. delay_s (channel,): how late each response is against the force, s. outputs, input: names.
    The FRFs are on s = sigma + i 2 pi f: the exponential window's damping is part of s, not an error of the result.
    """
    force, motion = _array("force_n", force_n, 2), _array("response", response, 3)
    return _native.frf(
        fs_hz=fs_hz,
        force_n=force,
        response=motion,
        quantity=quantity,
        estimator=estimator,
        sigma_per_s=sigma_per_s,
        delay_s=None if delay_s is None else list(delay_s),
        outputs=None if outputs is None else list(outputs),
        input=input,
    )


def hysteresis(
    *,
    fs_hz: float,
    velocity_a: ArrayLike,
    velocity_b: ArrayLike,
    force_n: ArrayLike,
    excitation_hz: float | None = None,
    normal_load_n: float | None = None,
) -> Analysis:
    """Loops of a time record at the contact; `.results` is the dict that `jointrig hysteresis --json` prints.

    velocity_a, velocity_b (sample,), m/s; force_n (sample,), N. normal_load_n gives the friction coefficient.
    """
    return _native.hysteresis(
        fs_hz=fs_hz,
        velocity_a=_array("velocity_a", velocity_a, 1),
        velocity_b=_array("velocity_b", velocity_b, 1),
        force_n=_array("force_n", force_n, 1),
        excitation_hz=excitation_hz,
        normal_load_n=normal_load_n,
    )


def _array(name: str, values: ArrayLike, axes: int, of: Any = np.float64) -> np.ndarray:
    """As it is where it is contiguous and of the right type, else a copy."""
    given = np.asarray(values)
    if given.dtype.kind not in ("fiub" if of is np.float64 else "fiubc"):
        raise Refused(f"{name} holds {given.dtype}, and {'real' if of is np.float64 else 'complex'} numbers are needed")
    if given.ndim != axes:
        raise Refused(f"{name} has {given.ndim} axes, and {axes} are needed")
    array = np.ascontiguousarray(given, dtype=of)
    if array is not given and given is values and array.nbytes > 100_000_000:
        warnings.warn(
            f"{name} is copied ({array.nbytes / 1e6:.0f} MB): a C-contiguous {np.dtype(of)} array is read in place", stacklevel=3
        )
    return array


def _matrix(frf: Frf | Path) -> Frf:
    return frf if isinstance(frf, Frf) else read_frf(frf)


def _bands(given: Any) -> list[tuple[float, float]]:
    """One band or several."""
    try:
        listed = list(given)
        one = len(listed) == 2 and all(np.isscalar(end) for end in listed)
        return [(float(low), float(high)) for low, high in ([listed] if one else listed)]
    except (TypeError, ValueError):
        raise Refused(f"band_hz is {given!r}: give (low, high) in Hz, or a list of such pairs") from None


def _warn(notes: Iterable[str]) -> None:
    for note in notes:
        warnings.warn(note, stacklevel=3)
