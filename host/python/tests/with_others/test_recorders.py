"""The adapters of jointrig.bridge against the real libraries."""

import json
import sys
from pathlib import Path

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
