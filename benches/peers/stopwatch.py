"""How long a peer's job takes: at least as many runs as ours and for as long, see benches/src/row.rs."""

import time

RUNS = 15
SPELL_S = 15


def times(job, before=lambda: None, runs=RUNS):
    """Seconds of every run of `job`; `before` runs before each and is not counted."""
    begun, seconds = time.perf_counter(), []
    while len(seconds) < runs or time.perf_counter() - begun < SPELL_S:
        before()
        start = time.perf_counter()
        job()
        seconds.append(time.perf_counter() - start)
    return seconds
