"""How long a peer's job takes: as many runs and as long as the benches ask for, which run as long themselves (benches/src/row.rs)."""

import os
import time

RUNS = int(os.environ["JOINTRIG_BENCH_RUNS"])
SPELL_S = float(os.environ["JOINTRIG_BENCH_SECONDS"])


def times(job, before=lambda: None, runs=RUNS):
    """Seconds of every run of `job`; `before` runs before each and is not counted."""
    begun, seconds = time.perf_counter(), []
    while len(seconds) < runs or time.perf_counter() - begun < SPELL_S:
        before()
        start = time.perf_counter()
        job()
        seconds.append(time.perf_counter() - start)
    return seconds
