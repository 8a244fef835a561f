"""pyuff's times for writing and reading, s, as one JSON document on stdout."""

import json
import os
import sys
import tempfile

import numpy as np
import pyuff

from stopwatch import times

# to write text takes it ten seconds
RUNS = 5


def universal(functions, lines, binary, folder):
    rng = np.random.default_rng(2)
    x = 0.25 * np.arange(lines)
    sets = [
        pyuff.prepare_58(
            binary=binary, func_type=4, rsp_node=1, rsp_dir=1, ref_node=1 + i, ref_dir=3,
            data=rng.standard_normal(lines) + 1j * rng.standard_normal(lines), x=x, id1="speed",
            rsp_ent_name="A1", ref_ent_name="AZ1", abscissa_spacing=1, abscissa_spec_data_type=18,
            ordinate_spec_data_type=11, orddenom_spec_data_type=13,
        )
        for i in range(functions)
    ]
    path = os.path.join(folder, "speed.uff")

    def remove():
        if os.path.exists(path):
            os.remove(path)

    write = times(lambda: pyuff.UFF(path).write_sets(sets, mode="add"), before=remove, runs=RUNS)
    read = times(lambda: pyuff.UFF(path).read_sets(), runs=RUNS)
    return write, read


job = json.loads(sys.argv[1])
with tempfile.TemporaryDirectory() as folder:
    ascii_write, ascii_read = universal(job["functions"], job["lines"], 0, folder)
    binary_write, binary_read = universal(job["functions"], job["lines"], 1, folder)
print(json.dumps({
    "ascii write": ascii_write, "ascii read": ascii_read,
    "binary write": binary_write, "binary read": binary_read,
}))
