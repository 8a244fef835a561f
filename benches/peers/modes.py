"""Modes with pyEMA and sdypy-EMA: argv[1] is an FRF file as host/analysis/examples/data/modes.csv (mobilities on the line of an exponential window of 2.3 1/s), argv[2] its input, argv[3:] the natural frequencies to pick near, in Hz, because both need them. Prints seconds, natural frequencies (Hz) and damping ratios of each."""

import contextlib
import csv
import io
import json
import sys

import numpy as np

from stopwatch import times

SIGMA = 2.3

with open(sys.argv[1]) as file:
    rows = [row for row in csv.DictReader(file) if row["input"] == sys.argv[2]]
frequency = sorted({float(row["frequency_hz"]) for row in rows})
outputs = sorted({row["output"] for row in rows})
mobility = np.zeros((len(outputs), len(frequency)), dtype=complex)
for row in rows:
    place = outputs.index(row["output"]), frequency.index(float(row["frequency_hz"]))
    mobility[place] = float(row["re"]) + 1j * float(row["im"])
frequency = np.array(frequency)
# both take the lines as those of the imaginary axis; so must the conversion be
receptance = mobility / (SIGMA + 2j * np.pi * frequency)
near = [float(value) for value in sys.argv[3:]]


def job(package):
    def run():
        model = package.Model(
            frf=receptance,
            freq=frequency,
            lower=frequency[0],
            upper=frequency[-1],
            pol_order_high=30,
            pyfrf=False,
            frf_type="receptance",
        )
        with contextlib.redirect_stderr(io.StringIO()):
            model.get_poles(show_progress=False)
        model.select_closest_poles(near)
        model.get_constants()
        return model

    return run


def found(package):
    model = job(package)()
    pole = np.array([[f, d] for f, d in zip(model.nat_freq, model.nat_xi)])
    # the window's share of the damping, which they do not know
    damping = pole[:, 1] - SIGMA / (2 * np.pi * pole[:, 0])
    return {
        "seconds": times(job(package)),
        "frequency_hz": pole[:, 0].tolist(),
        "damping_ratio": damping.tolist(),
    }


import pyEMA
from sdypy import EMA

print(json.dumps({"pyEMA": found(pyEMA), "sdypy-EMA": found(EMA)}))
