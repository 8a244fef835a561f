"""Latency and processor load of a campaign over the bridge, in real time.

19 channels of 24 bits at 51.2 kHz.

    JOINTRIG_BIN=… JOINTRIG_HIL_SIM_BIN=… python benches/bridge_load.py [SECONDS]

Needs Linux, the wheel and an idle computer. A Python program reads the simulated rig's volts, which
come as a recorder delivers them (blocks of 50 ms, never waiting), and writes them with
jointrig.bridge. Printed are
- the latency of each hit: from the write of the block with the last sample of its record to the
  moment when the record, which contains its verdict, can be read from the campaign file;
- the time that the host's process takes on the processor, per second, and that of its threads. The
  program is not in it.
"""

from __future__ import annotations

import os
import re
import signal
import sqlite3
import struct
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

JOINTRIG, SIM = os.environ["JOINTRIG_BIN"], os.environ["JOINTRIG_HIL_SIM_BIN"]
ROOT = Path(__file__).parents[1]
PLACE, CHANNELS = "B/BZ1/NB1", 19


def relay(folder: Path) -> None:
    """The program: writes the rig's volts, and notes when each block was written."""
    from jointrig import bridge  # takes standard output for the samples

    import json

    import numpy as np

    play = [SIM, "play", "--rig", folder / "rig.toml", "--visit", PLACE, "--hits", "1000", "--volts", "--paced"]
    rig = subprocess.Popen(play, stdout=subprocess.PIPE)
    assert rig.stdout
    header = json.loads(rig.stdout.readline())
    channels = [bridge.Channel(**own) for own in header["channels"]]
    # the simulated rig has 16 channels
    more = list(range(1, 1 + CHANNELS - len(channels)))
    columns = [*range(len(channels)), *more]
    channels += [replace(channels[own], name=f"{channels[own].name}_2", role="auxiliary") for own in more]
    stated = {"serial": header["serial"], "rate_hz": header["rate_hz"], "sample": header["sample"], "bits": header["bits"]}
    written = 0
    with (
        bridge.Source(header["board"], channels=channels, **stated) as out,
        (folder / "written").open("w", buffering=1) as log,
    ):
        while out.wanted():
            scans = struct.unpack("<4sIQII", rig.stdout.read(24))[1]
            volts = np.frombuffer(rig.stdout.read(4 * scans * (len(channels) - len(more))), "<f4")
            out.write(volts.reshape(scans, -1)[:, columns])
            written += scans
            log.write(f"{written} {time.monotonic()}\n")
    rig.stdout.close()
    rig.wait()


def threads(pid: int) -> dict[str, float]:
    """Time on the processor of each thread, s."""
    tick = os.sysconf("SC_CLK_TCK")
    times: dict[str, float] = {}
    for task in Path(f"/proc/{pid}/task").iterdir():
        # the name is in parentheses and may contain blanks
        name, rest = re.fullmatch(r"\d+ \((.*)\) (.*)", (task / "stat").read_text().strip(), re.S).groups()  # type: ignore[union-attr]
        user, system = rest.split()[11:13]
        times[name] = times.get(name, 0.0) + (int(user) + int(system)) / tick
    return times


def main(seconds: float) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        text = (ROOT / "hil-sim/rigs/accelerometers.toml").read_text()
        text = text.replace("[sensors]\n", "[sensors]\nbits = 24\n")
        (folder / "rig.toml").write_text(text)
        plan = (ROOT / "docs/plans/contact-by-hand.toml").read_text()
        plan = plan.replace("wanted = 10", "wanted = 1000").replace("most = 25", "most = 1000")
        (folder / "plan.toml").write_text(plan)
        file = folder / "lab.jrig"
        subprocess.run([JOINTRIG, "campaign", "new", file, "--plan", folder / "plan.toml"], check=True, stdout=subprocess.DEVNULL)
        device = f"bridge:{sys.executable} {Path(__file__).resolve()} --relay {folder}"
        host = subprocess.Popen(
            [JOINTRIG, "campaign", "run", "--yes", file, "--device", device], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL
        )
        seen: dict[int, float] = {}
        base = sqlite3.connect(f"file:{file}?mode=ro", uri=True)
        begun, first = time.monotonic(), None
        while host.poll() is None and time.monotonic() < begun + seconds:
            for (record,) in base.execute("SELECT id FROM records WHERE id > ?", (max(seen, default=0),)):
                seen[record] = time.monotonic()
            if seen and first is None:
                first = time.monotonic(), threads(host.pid)
            time.sleep(0.005)
        if first is None or host.poll() is not None:
            raise SystemExit("the host measured nothing, or ended")
        span, last = time.monotonic() - first[0], threads(host.pid)
        written = [(int(a), float(b)) for a, b in map(str.split, (folder / "written").read_text().splitlines())]
        rows = base.execute("SELECT id, first_scan + scans, channels, verdict FROM records ORDER BY id").fetchall()
        base.close()
        host.send_signal(signal.SIGINT)
        host.wait()
        latencies = []
        for record, end, channels, verdict in rows:
            at = next(at for scan, at in written if scan >= end)
            if record in seen:
                latencies.append(seen[record] - at)
                print(f"hit {record}: {verdict}, {channels} channels, {1e3 * latencies[-1]:.0f} ms after its last sample")
        print(f"latency: {1e3 * min(latencies):.0f} to {1e3 * max(latencies):.0f} ms ({len(latencies)} hits)")
        used = {own: (at - first[1].get(own, 0.0)) / span for own, at in last.items()}
        each = ", ".join(f"{own} {load:.3f}" for own, load in sorted(used.items(), key=lambda own: -own[1]))
        print(f"host: {sum(used.values()):.3f} of a core over {span:.0f} s ({each})")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--relay"]:
        relay(Path(sys.argv[2]))
    else:
        main(float(sys.argv[1]) if len(sys.argv) > 1 else 60.0)
