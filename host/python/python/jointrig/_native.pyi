import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str
__all__ = ["__version__", "Lab", "Record", "Frf", "Analysis", "new", "frf", "identify", "modes", "hysteresis"]

@final
class Lab:
    def __new__(cls, path: str | os.PathLike[str]) -> Lab: ...
    @property
    def path(self) -> Path: ...
    def status(self) -> dict[str, Any]: ...
    def records(
        self,
        *,
        configuration: str | None = None,
        impact: str | None = None,
        response: str | None = None,
        kept: bool | None = None,
    ) -> list[Record]: ...
    def frf(self, configuration: str, *, band_hz: tuple[float, float] = ...) -> Frf: ...
    def analyse(self, progress: Callable[[int, int], object] | None = None, *, bootstrap: int = 0) -> Analysis: ...
    def add_hits(
        self,
        configuration: str,
        impact: str,
        response: str | None = None,
        *,
        fs_hz: float,
        channels: dict[str, Any],
        force_n: ArrayLike | None = None,
        units: dict[str, str] | None = None,
        scale: dict[str, float] | None = None,
        delay_s: dict[str, float] | None = None,
        calibrate: str = "",
        trigger_index: int | None = None,
        source: str = "python",
        replace: bool = False,
    ) -> dict[str, Any]:
        """Adds hits of one cell, judged and stored like measured ones.

        channels: name -> (hit, sample), int16, int32, float32 or float64, stored as they are. The name says what a channel
        is, as in the plan or in exports: force, x, y, z of the response location, LDV_A, LDV_B, LC1 ..., or a fixed sensor's
        channel; an unknown name is refused. force_n: the hammer's force in N, the same as channels={"force": ...}.
        units: name -> N, m/s, mm/s, g, V ...; scale: name -> units per sample, for codes; delay_s: name -> how late, s.
        calibrate: sensitivities of voltages and other names, as the command's --calibrate: "ai0=hammer:2.25 mV/N,ai3=-".
        trigger_index: the sample at which the recorder was triggered; hits whose pulse begins elsewhere are refused. Left out,
        each record is aligned by its pulse. response may be left out where all locations have fixed sensors. Returns hits, kept, already (stored by an earlier call
        with the same arrays) and verdicts, a list of (verdict, sentence). source names the origin in the file; replace drops
        the good hits that came from another content with this name. Raises Refused, and stores nothing then.
        """
    def cut(
        self,
        *,
        fs_hz: float,
        channels: dict[str, Any],
        configuration: str | None = None,
        impact: str | None = None,
        response: str | None = None,
        order: str | None = None,
        marker: str | None = None,
        table: str | None = None,
        units: dict[str, str] | None = None,
        scale: dict[str, float] | None = None,
        delay_s: dict[str, float] | None = None,
        calibrate: str = "",
        source: str = "python",
        replace: bool = False,
        dry_run: bool = False,
    ) -> dict[str, Any]:
        """Finds the hits of one continuous recording and stores them at their places.

        The rules are those of `jointrig import --cut`. channels: as for add_hits, but (sample,). The
        places: configuration, impact and response name one; order="plan" says that they were struck
        in the plan's order; marker="CHANNEL:STEP" names a channel whose level is STEP times the
        place's number in the plan, from 1; table is the text of a CSV table with the columns hit (or
        time_s), configuration, impact, response. Returns report (what was found, line by line),
        hits, kept, already and verdicts, a list of (place, hit, verdict, sentence). Raises Refused,
        with what was found and what to state, where a place is not certain, and stores nothing then;
        dry_run stores nothing in any case.
        """
    def add_level(
        self,
        frequency_hz: float,
        amplitude: float,
        *,
        fs_hz: float,
        channels: dict[str, Any],
        units: dict[str, str] | None = None,
        scale: dict[str, float] | None = None,
        delay_s: dict[str, float] | None = None,
        calibrate: str = "",
        end_hz: float | None = None,
        held: str = "displacement",
        when: str = "before",
        source: str = "python",
    ) -> dict[str, Any]:
        """Adds one level of the shaker: channels as for add_hits, but (sample,), with LDV_A, LDV_B and the load cells.

        amplitude: what was asked for, m, N or V as held says ("displacement", "force", "drive"); end_hz for a sweep; when:
        "before" or "after" the hits. Returns level (its number), reached (the measured amplitude) and already.
        """
    def report(self, folder: str | os.PathLike[str]) -> None: ...
    def _repr_svg_(self) -> str | None: ...
    def __reduce__(self) -> tuple[type[Lab], tuple[Path]]: ...

@final
class Record:
    @property
    def id(self) -> int: ...
    @property
    def configuration(self) -> str: ...
    @property
    def impact(self) -> str: ...
    @property
    def response(self) -> str: ...
    @property
    def attempt(self) -> int: ...
    @property
    def verdict(self) -> str: ...
    @property
    def standing(self) -> str: ...
    @property
    def kept(self) -> bool: ...
    @property
    def measure(self) -> float: ...
    @property
    def limit(self) -> float: ...
    @property
    def sentence(self) -> str: ...
    @property
    def utc(self) -> str: ...
    @property
    def peak_n(self) -> float: ...
    @property
    def trigger_index(self) -> int: ...
    @property
    def fs_hz(self) -> float: ...
    @property
    def channels(self) -> list[str]: ...
    @property
    def codes(self) -> NDArray[np.int16] | NDArray[np.int32] | NDArray[np.float32] | NDArray[np.float64]: ...
    def samples(
        self, channel: str
    ) -> NDArray[np.int16] | NDArray[np.int32] | NDArray[np.float32] | NDArray[np.float64]: ...
    def scale(self, channel: str) -> float: ...
    def signal(self, channel: str) -> NDArray[np.float64]: ...
    def delay_s(self, channel: str) -> float: ...
    def unit(self, channel: str) -> str: ...

@final
class Frf:
    def __new__(
        cls,
        *,
        frequency_hz: NDArray[np.float64],
        frf: NDArray[np.complex128],
        quantity: str,
        outputs: list[str],
        inputs: list[str],
        sigma_per_s: float = 0.0,
        variance: NDArray[np.float64] | None = None,
        coherence: NDArray[np.float64] | None = None,
    ) -> Frf: ...
    @staticmethod
    def read(path: str | os.PathLike[str]) -> tuple[Frf, list[str]]: ...
    @property
    def frequency_hz(self) -> NDArray[np.float64]: ...
    @property
    def frf(self) -> NDArray[np.complex128]: ...
    @property
    def coherence(self) -> NDArray[np.float64] | None: ...
    @property
    def variance(self) -> NDArray[np.float64] | None: ...
    @property
    def hits(self) -> NDArray[np.int64] | None: ...
    @property
    def outputs(self) -> list[str]: ...
    @property
    def inputs(self) -> list[str]: ...
    @property
    def quantity(self) -> str: ...
    @property
    def sigma_per_s(self) -> float: ...
    def to_receptance(self) -> Frf: ...
    def band(self, low_hz: float, high_hz: float) -> Frf: ...
    def select(self, outputs: list[str], inputs: list[str]) -> Frf: ...
    def save(self, path: str | os.PathLike[str]) -> None: ...
    def to_pyfbs(self) -> tuple[NDArray[np.float64], NDArray[np.complex128]]: ...
    def to_dataframe(self) -> Any: ...
    def _repr_svg_(self) -> str | None: ...

@final
class Analysis:
    @property
    def results(self) -> dict[str, Any]: ...
    @property
    def spectra(self) -> dict[str, Frf]: ...
    @property
    def figures(self) -> list[str]: ...
    def svg(self, figure: str) -> str: ...
    def report(self, folder: str | os.PathLike[str]) -> None: ...
    def _repr_svg_(self) -> str | None: ...

def new(path: str | os.PathLike[str], plan: str | os.PathLike[str]) -> Lab: ...
def frf(
    *,
    fs_hz: float,
    force_n: NDArray[np.float64],
    response: NDArray[np.float64],
    quantity: str,
    estimator: str = "H1",
    sigma_per_s: float | None = None,
    delay_s: list[float] | None = None,
    outputs: list[str] | None = None,
    input: str = "impact",
) -> tuple[Frf, list[str]]: ...
def identify(
    *,
    a: Frf,
    b: Frf,
    ajb: Frf,
    geometry: str | os.PathLike[str],
    method: list[str],
    idms: list[str],
    band_hz: list[tuple[float, float]],
    position_error_m: float | None = None,
    aim_error_m: float | None = None,
    angle_error_rad: float | None = None,
    mounting_error: float | None = None,
    full_joint: bool = False,
    noise: float | None = None,
) -> tuple[Analysis, list[str]]: ...
def modes(*, frf: Frf, band_hz: tuple[float, float] | None, frf_error: float) -> dict[str, Any]: ...
def hysteresis(
    *,
    fs_hz: float,
    velocity_a: NDArray[np.float64],
    velocity_b: NDArray[np.float64],
    force_n: NDArray[np.float64],
    excitation_hz: float | None = None,
    normal_load_n: float | None = None,
) -> Analysis: ...
