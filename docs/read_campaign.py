#!/usr/bin/env python3
"""Reads the records of a jointrig campaign. Needs numpy and pcodec. `python3 docs/read_campaign.py FILE.jrig` lists them."""
import sqlite3, struct, sys, zlib
import numpy as np
from pcodec import standalone

def codes(blob, channels, scans, crc32):
    """Raw codes (channel, scan) as int16. SI value = code * units_per_volt * range_v / 32768 (table `channels`,
    and what a row of `calibrations` says instead)."""
    out, at = np.empty((channels if scans else 0, scans), "<i2"), 0
    for row in out:
        size, = struct.unpack_from("<I", blob, at)
        row[:] = standalone.simple_decompress(blob[at + 4:at + 4 + size])
        at += 4 + size
    assert zlib.crc32(out.tobytes()) == crc32, "the record is damaged"
    return out

if __name__ == "__main__":
    file = sqlite3.connect(f"file:{sys.argv[1]}?mode=ro", uri=True)
    query = "SELECT id, verdict, samples, channels, scans, crc32 FROM records ORDER BY id"
    for record, verdict, *stored in file.execute(query):
        print(record, verdict, zlib.crc32(codes(*stored).tobytes()))
