"""Programs that write a recorder's samples, read by the command."""

import json
import os
import struct
import subprocess
import sys
import wave
from pathlib import Path

import jointrig as jr
import numpy as np
import pytest
from conftest import command, plan_of_one_place

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
    assert said.splitlines()[:4] == ["a print", "a print of another program", "another print", "the end"]


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


# a recording of 24 bits at 48 kHz: a mass on a spring, struck every three seconds
RATE, EVERY, HITS = 48_000, 3 * 48_000, 5
MASS_KG, AT_HZ, DAMPING = 2.0, 180.0, 0.01
FULL = (200.0, 500.0)


def accelerance(s: np.ndarray) -> np.ndarray:
    """m/s^2 per N at the complex frequencies s, 1/s."""
    w = 2 * np.pi * AT_HZ
    return s**2 / (MASS_KG * (s**2 + 2 * DAMPING * w * s + w**2))


def recording(path: Path, bits: int) -> None:
    """Force and acceleration, with noise of 100 dB below full scale."""
    rng = np.random.default_rng(3)
    t = np.arange(EVERY) / RATE
    # the campaign begins within the first seconds
    parts = [np.zeros((5 * RATE, 2))]
    for hit in range(HITS):
        # a pulse of 2 ms without edges, whose spectrum ends at 1 kHz
        force = (50 + hit) * np.where(np.abs(t - 0.5) < 1e-3, np.cos(500 * np.pi * (t - 0.5)) ** 2, 0.0)
        # periodic in 3 s, after which e^-28 of the motion is left
        line = 2j * np.pi * np.fft.rfftfreq(EVERY, 1 / RATE)
        parts.append(np.stack([force, np.fft.irfft(accelerance(line) * np.fft.rfft(force), EVERY)], axis=1))
    share = np.concatenate(parts) / FULL
    share += 10 ** (-100 / 20) / np.sqrt(2) * rng.standard_normal(share.shape)
    codes = np.round(share * 2 ** (bits - 1)).astype("<i4")
    frames = codes.view(np.uint8).reshape(-1, 4)[:, : bits // 8].tobytes()
    with wave.open(str(path), "wb") as file:
        file.setnchannels(2)
        file.setsampwidth(bits // 8)
        file.setframerate(RATE)
        file.writeframes(frames)


CHANGES = [("rate_hz = 51200", f"rate_hz = {RATE}"), ("wanted = 5", f"wanted = {HITS}")]


@pytest.mark.parametrize(("bits", "of"), [(16, np.int16), (24, np.int32)])
def test_a_stereo_recording_gives_the_frf_of_its_structure(tmp_path: Path, bits: int, of: type) -> None:
    wav, file = tmp_path / "run.wav", tmp_path / "lab.jrig"
    recording(wav, bits)
    command("campaign", "new", file, "--plan", plan_of_one_place(tmp_path / "plan.toml", CHANGES))
    device = f"bridge:{sys.executable} -m jointrig.bridge wav {wav} force:N:{FULL[0]}:hammer_force acc_z:m/s^2:{FULL[1]}"
    command("campaign", "run", "--yes", file, "--device", device)
    lab = jr.open(file)
    assert all(record.samples("acc_z").dtype == of for record in lab.records())
    found = lab.frf("AJB", band_hz=(50.0, 600.0)).to_receptance()
    s = found.sigma_per_s + 2j * np.pi * found.frequency_hz
    exact = accelerance(s) / s**2
    error = np.abs(found.frf[:, 0, 0] / exact - 1)
    # at the ends of the band noise leads
    assert np.median(error) < 2e-3 and error.max() < 0.02, (np.median(error), error.max())


def test_a_recording_that_is_no_plain_wav_is_refused(tmp_path: Path) -> None:
    recording(tmp_path / "run.wav", 24)
    (tmp_path / "text.wav").write_text("no recording")

    def said(name: str, *channels: str) -> str:
        arguments = [sys.executable, "-m", "jointrig.bridge", "wav", tmp_path / name, *channels]
        done = subprocess.run(arguments, capture_output=True, text=True, check=False)
        assert done.returncode != 0 and not done.stdout
        return done.stderr

    assert "has 2 channels of 24 bits: 1 channels" in said("run.wav", "force:N:200")
    assert "use soundfile" in said("text.wav", "force:N:200")
    assert "write NAME:UNIT:FULL_SCALE" in said("run.wav", "force:N")
