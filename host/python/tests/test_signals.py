"""Arrays from anywhere: any shape, type and order gives the answer of a contiguous copy, or a refusal."""

import itertools
from pathlib import Path

import numpy as np
import pytest

import jointrig as jr

FS = 51_200.0


def hits(count: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Hits of an oscillator of 1 kg, 200 Hz and 1 %: force (hit, sample), velocity (hit, 1, sample)."""
    rng = np.random.default_rng(7)
    t = np.arange(102_400) / FS
    pulse = np.where((t >= 0.005) & (t < 0.0055), 25.0 * (1 - np.cos(2 * np.pi * (t - 0.005) / 0.0005)), 0.0)
    omega, zeta = 2 * np.pi * 200.0, 0.01
    damped = omega * np.sqrt(1 - zeta**2)
    kernel = np.exp(-zeta * omega * t) * (np.cos(damped * t) - zeta * omega / damped * np.sin(damped * t))
    size = 2 * len(t)
    # the integral's first value counts half
    kernel[0] *= 0.5
    velocity = np.fft.irfft(np.fft.rfft(pulse, size) * np.fft.rfft(kernel, size), size)[: len(t)] / FS
    force = np.array([pulse * g for g in 1 + 0.02 * rng.standard_normal(count)])
    motion = np.array([velocity * f.max() / pulse.max() for f in force])[:, None, :]
    return force + 0.01 * rng.standard_normal(force.shape), motion + 1e-6 * rng.standard_normal(motion.shape)


def test_an_oscillators_mobility_comes_out() -> None:
    force, motion = hits()
    y, verdicts = jr.frf(fs_hz=FS, force_n=force, response=motion, quantity="velocity")
    assert verdicts == ["good"] * 3 and y.quantity == "mobility"
    s = y.sigma_per_s + 2j * np.pi * y.frequency_hz
    omega = 2 * np.pi * 200.0
    exact = s / (s**2 + 2 * 0.01 * omega * s + omega**2)
    band = (y.frequency_hz > 50) & (y.frequency_hz < 600)
    assert np.abs(y.frf[band, 0, 0] / exact[band] - 1).max() < 0.03
    assert y.coherence is not None and y.coherence[band].min() > 0.99


def test_order_and_type_of_arrays_change_nothing() -> None:
    force, motion = hits()
    plain, _ = jr.frf(fs_hz=FS, force_n=force, response=motion, quantity="velocity")
    wide = np.zeros((force.shape[0], 2 * force.shape[1]))
    wide[:, ::2] = force
    for own, other in itertools.product([np.asfortranarray(force), wide[:, ::2], force.tolist()], [np.asfortranarray(motion)]):
        again, _ = jr.frf(fs_hz=FS, force_n=own, response=other, quantity="velocity")
        assert np.array_equal(again.frf, plain.frf)
    single, _ = jr.frf(fs_hz=FS, force_n=force.astype("f4"), response=motion.astype(">f8"), quantity="velocity")
    assert np.allclose(single.frf, plain.frf, rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda f, r: (f[0], r), "force_n has 1 axes"),
        (lambda f, r: (f[:, :-1], r), "has shape"),
        (lambda f, r: (f[:0], r[:0]), "has shape"),
        (lambda f, r: (f, r[:, :0]), "has shape"),
        (lambda f, r: (f * np.nan, r), "not a number"),
        (lambda f, r: (f * 1j, r), "complex128, and real"),
        (lambda f, r: (f.astype(str), r), "real numbers are needed"),
        (lambda f, r: (f * 0, r), "no hit is good"),
    ],
)
def test_what_makes_no_sense_is_refused_in_words(change, said: str) -> None:  # type: ignore[no-untyped-def]
    force, motion = change(*hits())
    with pytest.raises(jr.Error, match=said):
        jr.frf(fs_hz=FS, force_n=force, response=motion, quantity="velocity")


def test_a_quantity_that_is_none_is_refused() -> None:
    force, motion = hits()
    with pytest.raises(jr.Refused, match="quantity is `speed`"):
        jr.frf(fs_hz=FS, force_n=force, response=motion, quantity="speed")


def test_a_loop_has_its_stiffness_and_its_refusals() -> None:
    t = np.arange(51_200) / FS
    omega, k = 2 * np.pi * 160.0, 180e6
    x, rng = 1e-7 * np.sin(omega * t), np.random.default_rng(3)
    velocity = omega * 1e-7 * np.cos(omega * t) + 1e-7 * rng.standard_normal(len(t))
    found = jr.hysteresis(
        fs_hz=FS, velocity_a=velocity, velocity_b=0 * t, force_n=k * x + 0.01 * rng.standard_normal(len(t)), excitation_hz=160.0
    )
    (loop,) = found.results["hysteresis"]
    assert loop["shape"] == "stuck" and abs(loop["k_t_n_per_m"]["mean"] / k - 1) < 0.01
    with pytest.raises(jr.Refused):
        jr.hysteresis(fs_hz=FS, velocity_a=velocity[:10], velocity_b=t[:10], force_n=t[:10])
    with pytest.raises(jr.Refused, match="velocity_a has 2 axes"):
        jr.hysteresis(fs_hz=FS, velocity_a=[velocity], velocity_b=t, force_n=t)


def test_estimators_lie_in_their_order_and_names_and_window_are_taken() -> None:
    force, motion = hits()
    arguments = {"fs_hz": FS, "force_n": force, "response": motion, "quantity": "velocity"}
    h1, h2, hv = (np.abs(jr.frf(**arguments, estimator=e)[0].frf[1:]) for e in ("H1", "H2", "Hv"))  # type: ignore[arg-type]
    assert (h1 <= h2 * (1 + 1e-12)).all() and np.allclose(hv, np.sqrt(h1 * h2), rtol=1e-9)
    y, _ = jr.frf(**arguments, sigma_per_s=0.0, outputs=["A1:x"], input="AZ1", delay_s=[1e-4])  # type: ignore[arg-type]
    on_time, _ = jr.frf(**arguments, sigma_per_s=0.0)  # type: ignore[arg-type]
    assert (y.sigma_per_s, y.outputs, y.inputs) == (0.0, ["A1:x"], ["AZ1"])
    turned = np.exp(2j * np.pi * y.frequency_hz * 1e-4)[:, None, None]
    assert np.allclose(y.frf, on_time.frf * turned, rtol=1e-9)
    with pytest.raises(jr.Refused, match="estimator is `H3`"):
        jr.frf(**arguments, estimator="H3")  # type: ignore[arg-type]
    with pytest.raises(jr.Refused):
        jr.frf(**arguments, outputs=["a", "b"])  # type: ignore[arg-type]


def some_frf(**changed: object) -> jr.Frf:
    """Two lines, two outputs, one input, and what a test changes of it."""
    arguments: dict[str, object] = {
        "frequency_hz": [10.0, 20.0],
        "frf": np.arange(4.0).reshape(2, 2, 1) * (1 + 2j),
        "quantity": "mobility",
        "outputs": ["A1:x", "A1:y"],
        "inputs": ["AZ1"],
    }
    return jr.make_frf(**(arguments | changed))  # type: ignore[arg-type]


def test_frfs_from_arrays_are_what_they_were(tmp_path: Path) -> None:
    values = np.arange(4.0).reshape(2, 2, 1) * (1 + 2j)
    y = some_frf(sigma_per_s=3.0, variance=np.ones((2, 2, 1)), coherence=np.full((2, 2, 1), 0.5))
    assert np.array_equal(y.frf, values) and y.sigma_per_s == 3.0
    assert y.variance is not None and (y.variance == 1).all() and y.coherence is not None and (y.coherence == 0.5).all()
    y.save(tmp_path / "y.npz")
    again = jr.read_frf(tmp_path / "y.npz")
    assert np.array_equal(again.frf, values) and again.outputs == y.outputs and again.quantity == "mobility"
    s = 3.0 + 2j * np.pi * y.frequency_hz
    assert np.allclose(y.to_receptance().frf, values / s[:, None, None], rtol=1e-14)
    assert y.band(15.0, 25.0).frequency_hz.tolist() == [20.0]
    assert np.array_equal(y.select(["A1:y"], ["AZ1"]).frf, values[:, 1:])
    with pytest.raises(jr.Refused, match="nothing"):
        y.select(["nothing"], ["AZ1"])
    frequency, accelerance = y.to_pyfbs()
    assert np.allclose(accelerance, values * s[:, None, None], rtol=1e-14) and frequency.tolist() == [10.0, 20.0]
    assert "2 outputs, 1 inputs, 2 lines" in repr(y)


@pytest.mark.parametrize(
    "changed",
    [
        {"frf": np.zeros((2, 2))},
        {"frf": np.zeros((3, 2, 1))},
        {"frf": np.zeros((2, 2, 2))},
        {"frf": np.array([["x"]])},
        {"frequency_hz": [20.0, 10.0]},
        {"frequency_hz": []},
        {"frequency_hz": [np.nan, 10.0]},
        {"quantity": "compliance"},
        {"outputs": ["A1:x"]},
        {"outputs": ["A1:x", "A1:x"]},
        {"variance": np.ones((2, 2, 2))},
        {"variance": -np.ones((2, 2, 1))},
        {"coherence": np.ones((1, 2, 1))},
        {"sigma_per_s": float("nan")},
    ],
)
def test_arrays_that_make_no_frfs_are_refused(changed: dict[str, object]) -> None:
    with pytest.raises(jr.Error):
        some_frf(**changed)


def test_any_shape_and_order_agrees_with_a_contiguous_copy_or_is_refused() -> None:
    rng = np.random.default_rng(11)
    agreed = refused = 0
    for _ in range(400):
        lines, outputs, inputs = rng.integers(0, 4, 3)
        shape = [int(n) for n in (lines, outputs, inputs)]
        if rng.random() < 0.2:
            shape = shape[: rng.integers(1, 4)]
        values = rng.standard_normal(shape) + 1j * rng.standard_normal(shape)
        seen = [values, np.asfortranarray(values), np.repeat(values, 2, axis=0)[::2], values[::-1][::-1]][rng.integers(4)]
        seen = seen.astype(["c16", "c8", ">c16"][rng.integers(3)])
        arguments = {
            "frequency_hz": 10.0 * np.arange(1, lines + 1),
            "outputs": [f"o{n}" for n in range(outputs)],
            "inputs": [f"i{n}" for n in range(inputs)],
        }
        try:
            y = some_frf(frf=seen, **arguments)
        except jr.Refused:
            refused += 1
            with pytest.raises(jr.Refused):
                some_frf(frf=np.ascontiguousarray(seen, dtype=complex), **arguments)
        else:
            agreed += 1
            assert np.array_equal(y.frf, np.ascontiguousarray(seen, dtype=complex))
    assert agreed > 50 and refused > 20
