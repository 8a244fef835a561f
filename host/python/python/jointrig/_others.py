"""FRFs as other packages hold them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._errors import Refused
from ._native import Frf


def to_pyfbs(y: Frf) -> tuple[np.ndarray, np.ndarray]:
    """(frequency, accelerance) as pyFBS takes them: (line,) Hz and (line, output, input) m/s^2 per N, multiplied by s."""
    s = y.sigma_per_s + 2j * np.pi * y.frequency_hz
    times = {"receptance": 2, "mobility": 1, "accelerance": 0}[y.quantity]
    return y.frequency_hz, y.frf * s[:, None, None] ** times


def to_dataframe(y: Frf) -> Any:
    """A row for each line of each FRF, as pandas' DataFrame, or polars' where there is no pandas."""
    lines, outputs, inputs = y.frf.shape
    columns: dict[str, Any] = {
        "output": np.tile(np.repeat(y.outputs, inputs), lines),
        "input": np.tile(y.inputs, lines * outputs),
        "frequency_hz": np.repeat(y.frequency_hz, outputs * inputs),
        "re": y.frf.real.ravel(),
        "im": y.frf.imag.ravel(),
    }
    for name, values in [("coherence", y.coherence), ("variance", y.variance)]:
        if values is not None:
            columns[name] = values.ravel()
    try:
        import pandas
    except ImportError:
        pass
    else:
        return pandas.DataFrame(columns)
    try:
        import polars
    except ImportError:
        raise Refused("a data frame needs pandas or polars, and neither is installed: pip install pandas") from None
    return polars.DataFrame(columns)
