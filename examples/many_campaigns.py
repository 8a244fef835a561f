"""Analyses a folder of campaigns with Dask, and draws them as a funnel.

    pip install "dask[distributed]" matplotlib
    python many_campaigns.py FOLDER [--scheduler ADDRESS] [--out DIR]

Without --scheduler two workers are started on this machine; with it, the campaigns go to a cluster that sees the same folder. Writes
campaigns.csv (a row for each campaign: k_T with its interval, N/m), funnel.png, and the results of each campaign, from which `jointrig trend` tells
what the level, a drift and the scatter are. Any other scheduler does as well, with one command for each file: `jointrig analyse FILE.jrig --out DIR`.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
from pathlib import Path

import matplotlib.pyplot as plt
from dask.distributed import Client, LocalCluster, get_worker

import jointrig as jr


def analysed(lab: jr.Lab, folder: Path) -> dict[str, object]:
    """A row of the table, and the results as a file. It runs on a worker; a Lab is a path, so that sending it costs nothing."""
    row: dict[str, object] = {"campaign": lab.path.name, "worker": get_worker().name}
    try:
        results = lab.analyse().results
    except jr.Error as error:
        return row | {"why": str(error)}
    (folder / f"{lab.path.stem}.json").write_text(json.dumps(results))
    contact = results["answer"]["contact"]
    found = contact["k_t_n_per_m"]
    if found is None:
        return row | {"why": contact["why"]}
    low, high = found["ci95"]
    return row | {"k_t_n_per_m": found["mean"], "ci95_low": low, "ci95_high": high}


def pooled(rows: list[dict[str, float]]) -> tuple[float, float]:
    """Mean of log k_T weighted by precision, and its standard deviation: intervals of a stiffness are even in its logarithm."""
    weights = [1 / spread(row) ** 2 for row in rows]
    total = sum(weights)
    return sum(w * math.log(row["k_t_n_per_m"]) for w, row in zip(weights, rows, strict=True)) / total, total**-0.5


def spread(row: dict[str, float]) -> float:
    """Relative standard deviation, from the interval's width."""
    return math.log(row["ci95_high"] / row["ci95_low"]) / (2 * 1.96)


def funnel(rows: list[dict[str, float]], path: Path) -> None:
    """Each campaign's k_T against how well it is known; 95 of 100 lie within the funnel where all measure the same contact."""
    middle, _ = pooled(rows)
    widest = 1.1 * max(spread(row) for row in rows)
    figure, axes = plt.subplots(figsize=(6, 5), layout="constrained")
    for side in (-1.96, 1.96):
        axes.plot([math.exp(middle) / 1e6, math.exp(middle + side * widest) / 1e6], [0, 100 * widest], "k--", linewidth=0.8)
    axes.axvline(math.exp(middle) / 1e6, color="k", linewidth=0.8)
    axes.plot([row["k_t_n_per_m"] / 1e6 for row in rows], [100 * spread(row) for row in rows], "o", alpha=0.7)
    axes.set(xlabel="k_T of the contact, N/µm", ylabel="standard deviation, %", ylim=(100 * widest, 0))
    axes.set_title(f"{len(rows)} campaigns, together {math.exp(middle) / 1e6:.1f} N/µm")
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("folder", type=Path)
    options.add_argument("--scheduler", help="address of a Dask scheduler, such as tcp://host:8786")
    options.add_argument("--out", type=Path, default=Path("."))
    asked = options.parse_args()
    labs = [jr.open(path) for path in sorted(asked.folder.glob("*.jrig"))]
    if not labs:
        raise SystemExit(f"{asked.folder}: no campaign (*.jrig) is in this folder")
    if asked.scheduler:
        client = Client(asked.scheduler)
    else:
        client = Client(LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None))
    results = asked.out.resolve() / "results"
    results.mkdir(parents=True, exist_ok=True)
    with client:
        rows = client.gather(client.map(analysed, labs, folder=results))
    with (asked.out / "campaigns.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, ["campaign", "k_t_n_per_m", "ci95_low", "ci95_high", "worker", "why"])
        table.writeheader()
        table.writerows(rows)
    known = [row for row in rows if "k_t_n_per_m" in row]
    print(f"{len(known)} of {len(rows)} campaigns have a k_T")
    if known:
        middle, deviation = pooled(known)
        low, high = (math.exp(middle + side * deviation) / 1e6 for side in (-1.96, 1.96))
        print(f"together: {math.exp(middle) / 1e6:.1f} N/µm (95 % {low:.1f}…{high:.1f})")
        funnel(known, asked.out / "funnel.png")
        print(f"next: jointrig trend {results}/*.json --against time --out {asked.out / 'trend'}")


if __name__ == "__main__":
    main()
