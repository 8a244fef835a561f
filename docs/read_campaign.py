#!/usr/bin/env python3
"""Reads the records of a jointrig campaign. Needs numpy and pcodec. `python3 docs/read_campaign.py FILE.jrig` lists them."""
import sqlite3, struct, sys, zlib
from pcodec import standalone

def codes(blob, channels, scans, crc32):
    """Each channel's samples. In SI: integers * units_per_volt * range_v / 2**(n - 1), n = 16 for int16 and `bits` for
    int32; floats * units_per_volt (table `channels`, and what a row of `calibrations` says instead)."""
    out, at = [], 0
    for _ in range(channels if scans else 0):
        size, = struct.unpack_from("<I", blob, at)
        out.append(standalone.simple_decompress(blob[at + 4:at + 4 + size]))
        at += 4 + size
    assert zlib.crc32(b"".join(own.tobytes() for own in out)) == crc32, "the record is damaged"
    return out

if __name__ == "__main__":
    file = sqlite3.connect(f"file:{sys.argv[1]}?mode=ro", uri=True)
    query = "SELECT id, verdict, samples, channels, scans, crc32 FROM records ORDER BY id"
    for record, verdict, *stored in file.execute(query):
        print(record, verdict, zlib.crc32(b"".join(own.tobytes() for own in codes(*stored))))
