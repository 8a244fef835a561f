"""Arrays from anywhere: any shape, type and order gives the answer of a contiguous copy, or a refusal."""

import itertools

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
        (lambda f, r: (f * 0, r), "no hit is good"),
    ],
)
def test_what_makes_no_sense_is_refused_in_words(change, said: str) -> None:  # type: ignore[no-untyped-def]
    force, motion = change(*hits())
    with pytest.raises(jr.Error, match=said):
        jr.frf(fs_hz=FS, force_n=force, response=motion, quantity="velocity")
    with pytest.raises(jr.Refused, match="quantity is `speed`"):
        jr.frf(fs_hz=FS, force_n=force if force.ndim == 2 else hits()[0], response=motion, quantity="speed")


def test_a_loop_has_its_stiffness_and_its_refusals() -> None:
    t = np.arange(51_200) / FS
    omega, k = 2 * np.pi * 160.0, 180e6
    x, rng = 1e-7 * np.sin(omega * t), np.random.default_rng(3)
    velocity = omega * 1e-7 * np.cos(omega * t) + 1e-7 * rng.standard_normal(len(t))
    found = jr.hysteresis(
        fs_hz=FS, velocity_a=velocity, velocity_b=0 * t, force_n=k * x + 0.01 * rng.standard_normal(len(t)), excitation_hz=160.0
    )
    (loop,) = found["hysteresis"]
    assert loop["shape"] == "stuck" and abs(loop["k_t_n_per_m"]["mean"] / k - 1) < 0.01
    with pytest.raises(jr.Refused):
        jr.hysteresis(fs_hz=FS, velocity_a=velocity[:10], velocity_b=t[:10], force_n=t[:10])
    with pytest.raises(jr.Refused, match="velocity_a has 2 axes"):
        jr.hysteresis(fs_hz=FS, velocity_a=[velocity], velocity_b=t, force_n=t)
