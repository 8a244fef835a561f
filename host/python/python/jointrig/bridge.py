"""A recorder as a device of jointrig: a program that writes its samples.

    # jointrig campaign run lab.jrig --device "bridge:python my_daq.py"
    from jointrig import bridge
    channels = [bridge.Channel("force", "N", full_scale=5, sensitivity_v=0.00225, role="hammer_force"),
                bridge.Channel("acc_z", "m/s^2", full_scale=5, sensitivity_v=0.0102)]
    with bridge.Source("NI cDAQ", serial="1A2B3C", rate_hz=25_600, channels=channels) as out:
        task.start()
        while out.wanted():
            out.write(np.array(task.read(1280)).T)        # (n, channels)

Import this module first. While the program runs under `jointrig`, the import takes standard output for the samples, and
whatever the program prints goes to standard error: jointrig logs it, and shows the last line where the program ends.
This module is pure Python and opens no device itself. The format is described in docs/bridge.md.
"""

from __future__ import annotations

import argparse
import json
import os
import queue
import socket
import struct
import sys
import threading
import time
import wave
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

__all__ = [
    "Channel",
    "Hammer",
    "Source",
    "from_callable",
    "from_ldaq",
    "from_nidaqmx",
    "from_opendaq",
    "from_sounddevice",
    "from_wav",
]

_TYPES = {"i16": np.dtype("<i2"), "i32": np.dtype("<i4"), "f32": np.dtype("<f4"), "f64": np.dtype("<f8")}
_OVERRUN = 1
# set by the host for the programs that it starts
_UNDER_THE_HOST = "JOINTRIG_BRIDGE"
_claimed: int | None = None


def _claim_stdout() -> int:
    """The file descriptor of the samples: the former standard output. File descriptor 1 becomes standard error, so that
    neither `print` nor a library written in C puts text between the samples."""
    global _claimed
    if _claimed is None:
        if sys.stdout is not None:
            sys.stdout.flush()
        _claimed = os.dup(1)
        os.dup2(2, 1)
        if sys.platform == "win32":
            import msvcrt

            msvcrt.setmode(_claimed, os.O_BINARY)
    return _claimed


if os.environ.get(_UNDER_THE_HOST):
    _claim_stdout()


@dataclass(frozen=True)
class Channel:
    """A channel of the recorder.

    unit: N, kN, lbf, m/s, mm/s, m, mm, um, m/s^2, g, V or mV. With sensitivity_v (V per unit; negative for a reversed
    sensor), samples and full_scale are in V, otherwise in the unit. role: hammer_force, response_x, response_y,
    response_z, specimen_a, specimen_b, load_cell, excitation or auxiliary. delay_s: how late the
    samples are. bits: those of this channel, if they are not the source's.
    """

    name: str
    unit: str
    full_scale: float
    sensitivity_v: float | None = None
    role: str = "auxiliary"
    delay_s: float = 0.0
    bits: int | None = None


@dataclass(frozen=True)
class Hammer:
    """A digital output that may fire a hammer, read docs/safety.md first.

    fire(pulse_us) starts one pulse of so many µs, which the device's own hardware times and ends (a
    counter output), and returns. Never switch an output on and later off instead: a PC may stop in
    between. release() switches the output off; it is called whenever the hammer is disarmed. Both
    run in a thread of their own. longest_us: 100 to 8000. shortest_pause_s: from the end of one
    pulse to the next, 0.6 to 60 s. Write blocks of 10 to 20 ms: without samples for 0.1 s jointrig
    disarms the hammer.
    """

    fire: Callable[[int], object]
    longest_us: int
    shortest_pause_s: float = 0.6
    release: Callable[[], object] | None = None


# without a line from jointrig for so long, s, the hammer is disarmed
_SILENCE_S = 1.0


class _Guard:
    """Passes jointrig's orders on to a hammer, as far as they are allowed.

    One pulse for each arming, no longer and no sooner than the hammer allows, none without a line
    for 1 s, and none that is late.
    """

    def __init__(self, hammer: Hammer) -> None:
        self._hammer = hammer
        self._bytes: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._armed, self._spent = False, False
        self._last_line_s, self._free_s, self._sequence = 0.0, float("-inf"), 0
        self.error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def put(self, data: bytes) -> None:
        """Takes bytes from jointrig; none at their end."""
        self._bytes.put(data)

    def end(self) -> None:
        """Disarms. The thread may be in fire() for ever if a driver hangs."""
        self.put(b"")
        self._thread.join(2.0)

    def _run(self) -> None:
        rest, ended = b"", False
        try:
            while not ended:
                try:
                    left_s = max(0.0, self._last_line_s + _SILENCE_S - time.monotonic())
                    parts = [self._bytes.get(timeout=left_s if self._armed else None)]
                except queue.Empty:
                    self._disarm("jointrig is silent")
                    continue
                # everything that has come, because an order that others follow is late
                while not self._bytes.empty():
                    parts.append(self._bytes.get())
                now_s = time.monotonic()
                stale = self._armed and now_s - self._last_line_s > _SILENCE_S
                if stale:
                    self._disarm("this program stood still")
                self._last_line_s = now_s
                ended = b"" in parts
                *lines, rest = (rest + b"".join(parts)).split(b"\n")
                for place, line in enumerate(lines):
                    self._obey(json.loads(line), late=stale or ended or bool(rest) or place + 1 < len(lines))
        except BaseException as error:
            # the output is released in any case, and the program ends with this error
            self.error = error
        finally:
            self._armed = False
            if self._hammer.release is not None:
                self._hammer.release()

    def _obey(self, order: dict[str, Any], late: bool) -> None:
        if order.get("armed") is True:
            self._armed, self._spent = True, False
        elif order.get("armed") is False:
            self._disarm()
        elif "fire_us" in order:
            self._fire(order["fire_us"], order["sequence"], late)

    def _fire(self, pulse_us: int, sequence: int, late: bool) -> None:
        now_s, longest_us = time.monotonic(), self._hammer.longest_us
        if not self._armed or self._spent:
            why = "it is not armed"
        elif late:
            why = "the order comes late"
        elif type(pulse_us) is not int or not 0 < pulse_us <= longest_us:
            why = f"a pulse of 1 to {longest_us} µs is possible"
        elif now_s < self._free_s:
            why = f"{self._hammer.shortest_pause_s} s between two pulses are needed"
        elif sequence <= self._sequence:
            why = "the order is repeated"
        else:
            self._sequence, self._spent = sequence, True
            self._free_s = now_s + 1e-6 * pulse_us + self._hammer.shortest_pause_s
            self._hammer.fire(pulse_us)
            return
        print(f"the hammer is not fired with {pulse_us} µs: {why}", file=sys.stderr, flush=True)

    def _disarm(self, why: str | None = None) -> None:
        if self._armed:
            self._armed = False
            if why is not None:
                print(f"the hammer is disarmed: {why}", file=sys.stderr, flush=True)
            if self._hammer.release is not None:
                self._hammer.release()


class Source:
    """Writes a recorder's samples to jointrig.

    serial must be the same in every run: a campaign is continued only with the recorder that it was begun with.
    sample: type of the samples, i16, i32, f32 or f64. bits: of a full scale of i32, e.g. 24 for codes of ±2²³ (32 if absent);
    of f32 and f64, the resolution that is kept, 8 to 30 (24 if absent). held: the source can wait, as a file or a simulation;
    a recorder cannot. listen: "HOST:PORT", to wait there for a jointrig on another computer
    (`--device bridge:tcp:HOST:PORT`) instead of being started by it. hammer: an output that may fire one.
    """

    def __init__(
        self,
        board: str,
        *,
        serial: str,
        rate_hz: float,
        channels: Sequence[Channel],
        sample: str = "f32",
        bits: int | None = None,
        held: bool = False,
        listen: str | None = None,
        hammer: Hammer | None = None,
    ) -> None:
        self._type = _TYPES[sample]
        self._channels = len(channels)
        self._lost, self._flags = 0, 0
        self._gone = threading.Event()
        header: dict[str, Any] = {"jointrig_bridge": 1, "board": board, "serial": serial, "rate_hz": rate_hz}
        header |= {"sample": sample, "held": held} | ({} if bits is None else {"bits": bits})
        if hammer is not None:
            header["hammer"] = {"longest_us": hammer.longest_us, "shortest_pause_s": hammer.shortest_pause_s}
        header["channels"] = [{k: v for k, v in asdict(own).items() if v is not None} for own in channels]
        self._socket = _accept(listen) if listen else None
        self._file = -1 if self._socket else _claim_stdout()
        self._guard = None if hammer is None else _Guard(hammer)
        # the host keeps standard input open as long as it wants samples
        if os.environ.get(_UNDER_THE_HOST) if self._socket is None else hammer is not None:
            threading.Thread(target=self._read_orders, daemon=True).start()
        self._send(json.dumps(header, allow_nan=False).encode() + b"\n")

    def __enter__(self) -> Source:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Writes nothing more, and disarms the hammer."""
        self._gone.set()
        if self._guard is not None:
            self._guard.end()
        if self._socket is not None:
            self._socket.close()

    def wanted(self) -> bool:
        """Whether jointrig still reads: False once it has ended or the connection is closed."""
        self._check()
        return not self._gone.is_set()

    def write(self, samples: ArrayLike) -> None:
        """Writes scans: an array (n, channels) in V, or in the channels' units, or codes of i16 or i32.

        A sample that is not a number makes its scan count as lost.
        """
        array = np.asarray(samples)
        if array.ndim != 2 or array.shape[1] != self._channels:
            raise ValueError(f"samples have the shape {array.shape}: (n, {self._channels}) is needed, one scan per row")
        if not np.can_cast(array.dtype, self._type, "same_kind"):
            raise TypeError(f"samples are {array.dtype}, the source has {self._type}: they would be rounded")
        if array.size and array.dtype.kind in "iu" and self._type.kind == "i":
            # a larger integer would change its sign in silence
            bounds = np.iinfo(self._type)
            if array.min() < bounds.min or array.max() > bounds.max:
                raise ValueError(f"samples reach {array.min()} to {array.max()}, the source has {self._type}: use sample=\"i32\" or \"f64\"")
        self._block(array.shape[0], np.ascontiguousarray(array, dtype=self._type).tobytes())

    def lost(self, scans: int) -> None:
        """So many scans were lost before the next ones."""
        self._lost += int(scans)

    def overrun(self) -> None:
        """An unknown number of scans was lost before the next ones; jointrig estimates it from the clock."""
        self._flags |= _OVERRUN

    def _block(self, scans: int, data: bytes) -> None:
        head = struct.pack("<4sIQII", b"JRBK", scans, self._lost, self._flags, 0)
        self._lost, self._flags = 0, 0
        self._send(head + data)

    def _check(self) -> None:
        if self._guard is not None and self._guard.error is not None:
            raise RuntimeError("the hammer's output failed: switch its supply off before you go near it") from self._guard.error

    def _send(self, data: bytes) -> None:
        self._check()
        if self._gone.is_set():
            return
        try:
            if self._socket is not None:
                self._socket.sendall(data)
            else:
                rest = memoryview(data)
                while rest:
                    rest = rest[os.write(self._file, rest) :]
        except OSError as error:
            if not isinstance(error, ConnectionError) and error.errno != 22:  # EINVAL: Windows' pipe
                raise
            self._gone.set()

    def _read_orders(self) -> None:
        data = b"begun"
        while data:
            try:
                data = os.read(0, 4096) if self._socket is None else self._socket.recv(4096)
            except OSError:  # the connection is closed
                data = b""
            if self._guard is not None:
                self._guard.put(data)
        self._gone.set()


def _scans(rate_hz: float, source: dict[str, Any]) -> int:
    """Of a block: 50 ms, or 20 ms with a hammer."""
    return max(1, int(rate_hz / (20 if source.get("hammer") is None else 50)))


def _accept(listen: str) -> socket.socket:
    host, _, port = listen.rpartition(":")
    with socket.create_server((host, int(port))) as server:
        print(f"waiting for jointrig at {host}:{server.getsockname()[1]}", file=sys.stderr, flush=True)
        peer, _ = server.accept()
    return peer


def from_callable(read: Callable[[], ArrayLike | None], board: str, **source: Any) -> None:
    """Writes what `read()` returns, (n, channels) each time, until it returns None. source: the arguments of Source."""
    with Source(board, **source) as out:
        while out.wanted() and (samples := read()) is not None:
            out.write(samples)


def from_ldaq(acq: Any, channels: Sequence[Channel], *, serial: str, **source: Any) -> None:
    """Writes what an acquisition of LDAQ reads: NI, Dewesoft, Digilent, serial ports, a simulation.

    The channels stand in the order of acq.channel_names; name the same ones.
    """
    acq.set_data_source()
    # virtual channels follow the source's own, and are not read here
    names = list(acq.channel_names)[: len(channels)]
    if [own.name for own in channels] != names:
        raise ValueError(f"the acquisition's channels are {names}: describe these, in this order")
    try:
        rate_hz = float(acq.get_sample_rate())
        with Source(acq.acquisition_name, serial=serial, rate_hz=rate_hz, channels=channels, **source) as out:
            while out.wanted():
                samples = acq.read_data()
                if len(samples):
                    out.write(np.asarray(samples, dtype=float))
                else:
                    time.sleep(0.01)
    finally:
        acq.terminate_data_source()


def from_opendaq(
    signals: Sequence[Any], channels: Sequence[Channel] | None = None, *, board: str, serial: str, **source: Any
) -> None:
    """Writes signals of openDAQ (Dewesoft, HBK) that share one clock.

    Without channels, name, unit and range come from the signals' descriptors; full scale is the range.
    """
    import opendaq

    if channels is None:
        channels = [_described(own) for own in signals]
    reader = opendaq.MultiReader(list(signals), value_type=opendaq.SampleType.Float64)
    # the first read returns the descriptors only, and with them the common rate
    block, rate_hz = np.empty((len(signals), 0)), 0.0
    for _ in range(100):
        block = np.atleast_2d(reader.read(1, 100))
        rate_hz = float(reader.common_sample_rate)
        if block.size:
            break
    with Source(board, serial=serial, rate_hz=rate_hz, channels=channels, sample="f64", **source) as out:
        out.write(block.reshape(len(signals), -1).T)
        most = _scans(rate_hz, source)
        while out.wanted():
            block, status = reader.read(most, 200, return_status=True)
            if not status.valid:
                raise RuntimeError("openDAQ's signals changed or can no longer be aligned: start the measurement again")
            out.write(np.asarray(block).reshape(len(signals), -1).T)


def _described(signal: Any) -> Channel:
    descriptor = signal.descriptor
    high = descriptor.value_range.high_value if descriptor.value_range else None
    if high is None or descriptor.unit is None:
        raise ValueError(f"signal {signal.name} states no range or no unit: describe the channels yourself")
    return Channel(signal.name, descriptor.unit.symbol, full_scale=float(high))


def from_sounddevice(channels: Sequence[Channel], *, device: Any = None, rate_hz: float = 48_000, **source: Any) -> None:
    """Writes the inputs of a sound card. Samples are parts of full scale: give full_scale in V as measured with a known
    voltage (a sound card states none)."""
    import sounddevice

    scale = np.array([own.full_scale for own in channels])
    board = str(sounddevice.query_devices(device, "input")["name"])[:24].strip()
    source.setdefault("serial", board)
    with (
        Source(board, rate_hz=rate_hz, channels=channels, **source) as out,
        sounddevice.InputStream(
            samplerate=rate_hz, device=device, channels=len(channels), dtype="float32", latency="high"
        ) as stream,
    ):
        while out.wanted():
            samples, overflowed = stream.read(_scans(rate_hz, source))
            if overflowed:
                out.overrun()
            out.write(samples * scale.astype(np.float32))


def from_nidaqmx(task: Any, channels: Sequence[Channel], *, board: str, serial: str, **source: Any) -> None:
    """Writes a task of NI-DAQmx with continuous sampling; its channels in the order of `channels`.

    Channels of voltage give V: state sensitivity_v. Channels with a unit (IEPE accelerometer, force) give that unit.
    """
    rate_hz = float(task.timing.samp_clk_rate)
    most = _scans(rate_hz, source)
    # ten seconds: the driver reports an overrun as an error and stops
    task.in_stream.input_buf_size = int(10 * rate_hz)
    task.start()
    with Source(board, serial=serial, rate_hz=rate_hz, channels=channels, sample="f64", **source) as out:
        while out.wanted():
            out.write(np.asarray(task.read(most, timeout=10.0)).reshape(len(channels), -1).T)
    task.stop()


# Duration of the beginning of a recording that is written no faster than it was recorded, s.
_OPENING_S = 5.0


def from_wav(path: str | os.PathLike[str], channels: Sequence[Channel], *, serial: str | None = None, **source: Any) -> None:
    """Writes a recording from a WAV file of 16, 24 or 32 bits, as fast as jointrig measures.

    The largest code is full_scale. serial: the file's name if absent. For other formats: soundfile
    and from_callable.
    """
    try:
        file = wave.open(os.fspath(path))
    except wave.Error as error:
        raise ValueError(f"{path}: {error}; integers are read, for other formats use soundfile and from_callable") from None
    with file:
        bits, count, rate_hz = 8 * file.getsampwidth(), file.getnchannels(), file.getframerate()
        if bits not in (16, 24, 32) or count != len(channels):
            raise ValueError(f"{path} has {count} channels of {bits} bits: {len(channels)} channels of 16, 24 or 32 are needed")
        name = Path(path).name.encode()[:24].decode(errors="ignore")
        sample = "i16" if bits == 16 else "i32"
        source = {"sample": sample, "bits": bits, "held": True} | source
        with Source("WAV file", serial=serial or name, rate_hz=rate_hz, channels=channels, **source) as out:
            done = 0
            while out.wanted() and (frames := file.readframes(max(1, rate_hz // 20))):
                codes = _codes(frames, bits).reshape(-1, count)
                out.write(codes)
                done += len(codes)
                # until jointrig holds the source, nothing else keeps it from being read to its end
                if done < _OPENING_S * rate_hz:
                    time.sleep(len(codes) / rate_hz)


def _codes(frames: bytes, bits: int) -> np.ndarray:
    if bits != 24:
        return np.frombuffer(frames, f"<i{bits // 8}")
    # the three bytes above a byte of zeros, which then shifts out
    wide = np.zeros((len(frames) // 3, 4), np.uint8)
    wide[:, 1:] = np.frombuffer(frames, np.uint8).reshape(-1, 3)
    return wide.view("<i4")[:, 0] >> 8


def _stated(text: str) -> Channel:
    parts = text.split(":")
    try:
        name, unit, full_scale, *role = parts
        return Channel(name, unit, full_scale=float(full_scale), role=role[0] if role else "auxiliary")
    except ValueError:
        raise argparse.ArgumentTypeError(f"`{text}`: write NAME:UNIT:FULL_SCALE or NAME:UNIT:FULL_SCALE:ROLE") from None


def _main() -> None:
    parser = argparse.ArgumentParser(
        "python -m jointrig.bridge", description="Plays a recording as a device: --device \"bridge:python -m jointrig.bridge wav …\"."
    )
    wav = parser.add_subparsers(required=True).add_parser("wav", help="a WAV file of 16, 24 or 32 bits")
    wav.add_argument("file")
    wav.add_argument(
        "channels",
        nargs="+",
        type=_stated,
        metavar="NAME:UNIT:FULL_SCALE[:ROLE]",
        help="one for each channel; full scale is the value of the largest code: force:N:200:hammer_force acc_z:m/s^2:500",
    )
    given = parser.parse_args()
    from_wav(given.file, given.channels)


if __name__ == "__main__":
    _main()
