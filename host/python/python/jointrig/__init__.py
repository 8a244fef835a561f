"""Joint stiffness from impact campaigns and hysteresis loops.

    import jointrig as jr
    lab = jr.open("lab.jrig")              # read only; also while it is being measured
    y = lab.frf("AJB")                     # y.frf (line, output, input) complex128, SI per N
    results = lab.analyse()                # what `jointrig analyse` writes to results.json

All arrays are numpy's, all units SI. Nothing writes into a campaign file, and no device can be opened from here.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _native
from ._errors import DataError, Error, FileError, Refused
from ._native import Frf, Lab, Record, __version__

__all__ = [
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
    "open",
]


def open(path: str | os.PathLike[str]) -> Lab:  # noqa: A001
    """A campaign file, read only; it may be measured meanwhile. Raises FileError where it cannot be read."""
    return Lab(os.fspath(path))


def analyse(
    lab: Lab | str | os.PathLike[str],
    progress: Callable[[int, int], object] | None = None,
    *,
    bootstrap: int = 0,
) -> dict[str, Any]:
    """The analysis of a campaign: the dict of `results.json`.

    progress(done, total) is called with the cells done and the cells in all. bootstrap draws the hits anew so often.
    """
    lab = lab if isinstance(lab, Lab) else open(lab)
    return lab.analyse(progress, bootstrap=bootstrap)


def _signal(name: str, values: ArrayLike, axes: int) -> np.ndarray:
    array = np.ascontiguousarray(values, dtype=np.float64)
    if array.ndim != axes:
        raise Refused(f"{name} has {array.ndim} axes, and {axes} are needed")
    return array


def frf(*, fs_hz: float, force_n: ArrayLike, response: ArrayLike, quantity: str) -> tuple[Frf, list[str]]:
    """FRFs of the good hits of impact records, and the verdict on every hit.

    force_n (hit, sample), N; response (hit, channel, sample), SI; quantity "velocity", "acceleration" or "displacement".
    The FRFs are H1 on s = sigma + i 2 pi f: the exponential window's damping is part of s, not an error of the result.
    """
    force, motion = _signal("force_n", force_n, 2), _signal("response", response, 3)
    return _native.frf(fs_hz=fs_hz, force_n=force, response=motion, quantity=quantity)


def hysteresis(
    *,
    fs_hz: float,
    velocity_a: ArrayLike,
    velocity_b: ArrayLike,
    force_n: ArrayLike,
    excitation_hz: float | None = None,
    normal_load_n: float | None = None,
) -> dict[str, Any]:
    """Loops of a time record at the contact: the dict that `jointrig hysteresis --json` prints.

    velocity_a, velocity_b (sample,), m/s; force_n (sample,), N. normal_load_n gives the friction coefficient.
    """
    return _native.hysteresis(
        fs_hz=fs_hz,
        velocity_a=_signal("velocity_a", velocity_a, 1),
        velocity_b=_signal("velocity_b", velocity_b, 1),
        force_n=_signal("force_n", force_n, 1),
        excitation_hz=excitation_hz,
        normal_load_n=normal_load_n,
    )
