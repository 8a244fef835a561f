#!/usr/bin/env python3
"""pco against zstd on a campaign's records: ratio and speed. Needs numpy, pcodec and zstandard.
`python3 docs/compare_codecs.py FILE.jrig [RECORDS]`; the figures in host/src/campaign/store/codec.rs are its output."""
import sqlite3, sys, time
import numpy as np
import zstandard
from pcodec import ChunkConfig, DeltaSpec, ModeSpec, standalone
from read_campaign import codes

file = sqlite3.connect(f"file:{sys.argv[1]}?mode=ro", uri=True)
some = int(sys.argv[2]) if len(sys.argv) > 2 else 40
query = "SELECT samples, channels, scans, crc32 FROM records WHERE scans > 0 ORDER BY (id * 7919) % 1009 LIMIT ?"
records = [codes(*stored) for stored in file.execute(query, [some])]
raw = sum(row.nbytes for record in records for row in record)
config = ChunkConfig(compression_level=6, mode_spec=ModeSpec.classic(), delta_spec=DeltaSpec.auto())


def planes(rows):
    """Second differences, low bytes apart from high bytes: what helps a byte-wise compressor most."""
    return [np.diff(row, n=2, prepend=row[:1].repeat(2)).astype("<i2").view("u1").reshape(-1, 2).T.tobytes() for row in rows]


def measure(name, encode, decode):
    begun = time.perf_counter()
    packed = [encode(record) for record in records]
    packing = time.perf_counter() - begun
    begun = time.perf_counter()
    for chunks in packed:
        for chunk in chunks:
            decode(chunk)
    unpacking = time.perf_counter() - begun
    size = sum(len(chunk) for chunks in packed for chunk in chunks)
    print(f"{name:<34} {raw / size:5.2f} : 1  {raw / packing / 1e6:6.0f} MB/s in  {raw / unpacking / 1e6:6.0f} MB/s out")


print(f"{len(records)} records, {raw / 1e6:.0f} MB of codes")
measure("pco, level 6, differences found", lambda rows: [standalone.simple_compress(row, config) for row in rows],
        standalone.simple_decompress)
for level in (3, 9, 19):
    press, open_ = zstandard.ZstdCompressor(level=level), zstandard.ZstdDecompressor()
    measure(f"zstd {level}, codes as they are", lambda rows: [press.compress(row.tobytes()) for row in rows], open_.decompress)
for level in (3, 9, 19):
    press, open_ = zstandard.ZstdCompressor(level=level), zstandard.ZstdDecompressor()
    measure(f"zstd {level}, differences in planes", lambda rows: [press.compress(plane) for plane in planes(rows)], open_.decompress)
