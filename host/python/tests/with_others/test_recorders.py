"""The adapters of jointrig.bridge against the real libraries."""

import json
import os
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import command

LDAQ = """
from jointrig import bridge
import LDAQ
import numpy as np

acq = LDAQ.simulator.SimulatedAcquisition("simulator")
acq.set_simulated_data(lambda t: np.array([np.sin(50 * t), np.cos(50 * t)]).T, channel_names=["f", "a"], sample_rate=10_000)
channels = [bridge.Channel("f", "N", full_scale=2, role="hammer_force"), bridge.Channel("a", "m/s^2", full_scale=2)]
bridge.from_ldaq(acq, channels, serial="1")
"""
OPENDAQ = """
from jointrig import bridge
import opendaq

# devices end with their instance
instance = opendaq.Instance()
device = instance.add_device("daqref://device0")
device.set_property_value("GlobalSampleRate", 50_000)
signals = [own for own in device.signals_recursive if own.domain_signal]
bridge.from_opendaq(signals, board="reference", serial=device.info.serial_number)
"""


@pytest.mark.parametrize(
    ("program", "rate", "names"),
    [(LDAQ, 10_000, ["f", "a"]), (OPENDAQ, 50_000, ["AI0", "AI1"])],
    ids=["LDAQ", "openDAQ"],
)
def test_a_library_is_a_recorder(tmp_path: Path, program: str, rate: int, names: list[str]) -> None:
    path = tmp_path / "my_daq.py"
    path.write_text(program)
    told = json.loads(command("info", "--json", "--device", f"bridge:{sys.executable} {path}").stdout)
    assert told["scan_rate_hz"] == rate
    assert [own["name"] for own in told["channels"]] == names


# an input of ALSA that needs no sound card: it reads a file, faster than a card would
ASOUNDRC = """
</usr/share/alsa/alsa.conf>
pcm.recording {{
    type file
    slave.pcm "null"
    file "/dev/null"
    infile "{}"
    format "raw"
    hint {{ show on description "a recording" }}
}}
"""
SOUND = """
from jointrig import bridge
channels = [bridge.Channel("force", "N", full_scale=200, role="hammer_force"), bridge.Channel("acc", "m/s^2", full_scale=500)]
bridge.from_sounddevice(channels, device="recording")
"""


def test_a_sound_card_is_a_recorder(tmp_path: Path) -> None:
    try:
        import sounddevice  # noqa: F401
    except (ImportError, OSError) as error:
        pytest.skip(f"sounddevice or PortAudio is absent (on Debian: libportaudio2): {error}")
    if not Path("/usr/share/alsa/alsa.conf").exists():
        pytest.skip("ALSA's configuration is absent: no input without a sound card can be made")
    scan = np.arange(480_000)
    parts = np.stack([np.sin(0.01 * scan), 1e-6 * (scan % 100_000)], axis=1).astype("<f4")
    (tmp_path / "in.raw").write_bytes(parts.tobytes())
    (tmp_path / "asoundrc").write_text(ASOUNDRC.format(tmp_path / "in.raw"))
    (tmp_path / "my_daq.py").write_text(SOUND)
    run = subprocess.Popen(
        [sys.executable, tmp_path / "my_daq.py"],
        env={**os.environ, "JOINTRIG_BRIDGE": "1", "ALSA_CONFIG_PATH": str(tmp_path / "asoundrc")},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert run.stdin and run.stdout
    try:
        header = json.loads(run.stdout.readline())
        assert (header["board"], header["rate_hz"], header["sample"]) == ("recording", 48_000, "f32")
        blocks, lost = [], 0
        for _ in range(10):
            magic, scans, missing, flags, _ = struct.unpack("<4sIQII", run.stdout.read(24))
            assert (magic, missing) == (b"JRBK", 0)
            lost += flags
            blocks.append(np.frombuffer(run.stdout.read(8 * scans), "<f4").reshape(-1, 2))
    finally:
        # the host closes both when it ends
        run.stdin.close()
        run.stdout.close()
        run.wait(10)
    got = np.concatenate(blocks)
    assert len(got) == 10 * 2400
    # PortAudio may begin later than the file, and drop what does not fit its buffer: each block is a
    # part of the file
    for block in blocks[:1] if lost else [got]:
        first = int(np.rint(block[0, 1] / 500 * 1e6))
        np.testing.assert_allclose(block, parts[first : first + len(block)] * np.float32([200, 500]), rtol=1e-6, atol=1e-4)
