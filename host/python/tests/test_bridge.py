"""Programs that write a recorder's samples, read by the command."""

import json
import os
import struct
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import command

# two channels, a second of them; the program prints before, between and after
PROGRAM = """
from jointrig import bridge
import os
import numpy as np

print("a print")
os.system("echo a print of another program")
channels = [
    bridge.Channel("force", "N", full_scale=200, role="hammer_force"),
    bridge.Channel("acc", "g", full_scale=5, sensitivity_v=0.1, delay_s=1e-5),
]
with bridge.Source("a box", serial="7", rate_hz=51_200 / 3, channels=channels, held=True) as out:
    scan = 0
    while out.wanted():
        out.write(np.stack([np.sin(0.01 * (scan + np.arange(100))), np.zeros(100)], axis=1))
        scan += 100
        if scan == 300:
            print("another print")
            out.lost(5)
            out.overrun()
print("the end")
"""


def started(program: Path) -> subprocess.Popen[bytes]:
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen([sys.executable, program], env={**os.environ, "JOINTRIG_BRIDGE": "1"}, **pipes)


@pytest.fixture
def program(tmp_path: Path) -> Path:
    path = tmp_path / "my_daq.py"
    path.write_text(PROGRAM)
    return path


def test_a_print_goes_to_standard_error_and_the_stream_stays_whole(program: Path) -> None:
    run = started(program)
    assert run.stdin and run.stdout and run.stderr
    header = json.loads(run.stdout.readline())
    assert header["rate_hz"] == 51_200 / 3 and header["channels"][1]["sensitivity_v"] == 0.1
    assert "sensitivity_v" not in header["channels"][0]
    heads = []
    for _ in range(20):
        heads.append(struct.unpack("<4sIQII", run.stdout.read(24)))
        assert len(run.stdout.read(100 * 2 * 4)) == 800
    assert heads == [(b"JRBK", 100, 5 if i == 3 else 0, 1 if i == 3 else 0, 0) for i in range(20)]
    # the host has ended: so does the program
    run.stdin.close()
    run.stdout.read()
    assert run.wait(10) == 0
    said = run.stderr.read().decode()
    assert said.split("\n")[:4] == ["a print", "a print of another program", "another print", "the end"]


def test_the_command_reads_it(program: Path) -> None:
    told = json.loads(command("info", "--json", "--device", f"bridge:{sys.executable} {program}").stdout)
    assert (told["name"], told["serial"], told["coil_cap_us"]) == ("a box", "7", 0)
    force, acc = told["channels"]
    assert (force["name"], force["role"], force["range"]) == ("force", "HammerForce", 200)
    assert (acc["unit"], acc["delay_s"]) == ("m/s^2", 1e-5)
    # 50 g, stored in single precision
    assert abs(acc["range"] - 490.3325) < 1e-3


def test_samples_of_another_shape_or_type_are_refused() -> None:
    code = (
        "from jointrig import bridge\n"
        "out = bridge.Source('b', serial='s', rate_hz=1000, channels=[bridge.Channel('a', 'V', 5)], sample='i16')\n"
        "for wrong in ([[1, 2]], [1], [[0.5]]):\n"
        "    try:\n"
        "        out.write(wrong)\n"
        "    except (ValueError, TypeError) as error:\n"
        "        print(error)\n"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stderr.splitlines()
    assert "(n, 1) is needed" in said[0] and "(n, 1) is needed" in said[1], said
    assert "they would be rounded" in said[2], said


def test_integers_that_do_not_fit_are_refused() -> None:
    code = """
from jointrig import bridge
import numpy as np
out = bridge.Source("a box", serial="7", rate_hz=1000, channels=[bridge.Channel("force", "N", full_scale=1)], sample="i16")
out.write(np.array([[32767], [-32768]]))
for values in ([[40_000]], np.array([[40_000]], dtype=np.uint16)):
    try:
        out.write(values)
    except ValueError as error:
        assert "reach 40000" in str(error), error
    else:
        raise SystemExit("40000 was written as i16")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    # the header, and the one block of two scans
    assert len(done.stdout.split(b"\n", 1)[1]) == 24 + 4
