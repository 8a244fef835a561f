"""Loops and their figures from raw codes with numpy: times and figures as one JSON document on stdout."""

import json
import sys

import numpy as np

from stopwatch import times


def cycles_of(x, period, points):
    """Every whole cycle, resampled to the same number of points (a period need not be whole samples)."""
    count = int(np.floor(len(x) / period + 1e-6))
    at = (np.arange(count)[:, None] + np.arange(points)[None, :] / points) * period
    cut = np.interp(at.ravel(), np.arange(len(x)), x).reshape(count, points)
    return cut - cut.mean(axis=1, keepdims=True)


def loops(velocity, force, rate, frequency):
    period = rate / frequency
    points = round(period)
    v, t = cycles_of(velocity, period, points), cycles_of(force, period, points)
    step = 1.0 / (frequency * points)
    x = np.zeros_like(v)
    x[:, 1:] = np.cumsum(0.5 * step * (v[:, 1:] + v[:, :-1]), axis=1)
    x -= x.mean(axis=1, keepdims=True)
    k_eq = (x * t).sum(axis=1) / (x * x).sum(axis=1)
    energy = (0.5 * (t + np.roll(t, -1, axis=1)) * (np.roll(x, -1, axis=1) - x)).sum(axis=1)
    mean_x, mean_t, mean_v = x.mean(axis=0), t.mean(axis=0), v.mean(axis=0)
    turn = np.exp(-2j * np.pi * np.arange(points) / points)
    # what the shape is told from: the residual of a spring and a damper, its scatter over the cycles
    basis = np.stack([mean_x, mean_v], axis=1)
    fitted = np.linalg.lstsq(basis, mean_t, rcond=None)[0]
    residual = t - fitted[0] * x - fitted[1] * v
    return {
        "k_eq": k_eq.mean(),
        "k_eq_std": k_eq.std(),
        "secant": np.ptp(mean_t) / np.ptp(mean_x),
        "fundamental": abs((mean_t @ turn) / (mean_x @ turn)),
        "energy": energy.mean(),
        "amplitude": 0.5 * np.ptp(mean_x),
        "nonlinearity": residual.mean(axis=0).std() / mean_t.std(),
        "noise": residual.std(axis=0).mean(),
    }


def job(codes, given):
    si = lambda place: codes[place] * given["units"][place]
    b = si(given["b"])
    relative = si(given["a"]) - b
    force = sum(si(place) for place in given["cells"])
    raw = loops(relative, force, given["rate"], given["frequency"])
    corrected = (1 + given["parallel"]) * force + given["mass"] * np.gradient(b, 1 / given["rate"])
    found = loops(relative, corrected, given["rate"], given["frequency"])
    return {**raw, "corrected_k_eq": found["k_eq"]}


def main():
    given = json.loads(sys.argv[1])
    codes = np.fromfile(given["path"], dtype="<i2").reshape(given["channels"], -1)
    figures = job(codes, given)
    seconds = times(lambda: job(codes, given))
    print(json.dumps({"seconds": seconds, "figures": {name: float(value) for name, value in figures.items()}}))


main()
