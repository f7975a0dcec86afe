"""The transfer function of SARAS against the exact sum; its ripples against a numerical transform."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.devices import opened, variants

import sarcl
from sarcl import pointing
from sarcl.simulation.spectral._aspect_window import KnownPhase
from sarcl.simulation.spectral._stationary_phase import chirp_ripple


@pytest.fixture(scope="module")
def device():
    return opened(variants(names=())[0].values[0])


CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=50e6, duration=2e-6)
TRACK = pointing.stripmap(
    sarcl.Trajectory.line(start=(0, -60, 6e3), velocity=(0, 100, 0), prf=300, n_pulses=360),
    look=float(np.arctan2(8e3, 6e3)), side="right",
)  # fmt: skip


def points():
    random = np.random.default_rng(0)
    places = random.uniform(-0.5, 0.5, (60, 3)) * (60, 60, 1) + (8e3, 0, 0)
    return sarcl.Scene.points(places, random.normal(size=60) + 1j * random.normal(size=60))


def test_its_error_is_predicted_and_refused_where_it_is_too_large(device):
    wide, narrow = (sarcl.Antenna.gaussian(width=(width, 0.1)) for width in (0.008, 0.002))
    raw = sarcl.spectral_echo(
        points(), CHIRP, TRACK, variant="saras", antenna=wide, tolerance=3e-2, check=True, device=device
    )
    assert raw.report.measured_error <= raw.report.predicted_error <= 3e-2
    assert raw.report.measured_error > 3e-3 and "saras" in raw.report.plan["method"]
    exact = sarcl.spectral_echo(points(), CHIRP, TRACK, antenna=wide, tolerance=1e-3, device=device)
    off = np.linalg.norm(raw.samples - exact.samples) / np.linalg.norm(exact.samples)
    assert off == pytest.approx(raw.report.measured_error, rel=0.3)
    # a narrow beam has a small time-bandwidth product: stationary phase is wrong
    with pytest.raises(sarcl.ToleranceUnreachable, match=r"variant='saras'.*variant='exact', or echo") as refused:
        sarcl.spectral_echo(points(), CHIRP, TRACK, variant="saras", antenna=narrow, tolerance=3e-2, device=device)
    assert refused.value.best > 3e-2


def test_the_printed_sign_of_the_azimuth_terms_is_wrong():
    # (27) prints -xi^2/4a^2; at xi = u X the phase of the transform is +u^2 r/4 k, as it is of sqrt(4 k^2 - u^2)
    k, u = np.array([200.0]), np.array([2.0])
    exact, paraxial = KnownPhase(8e3), KnownPhase(8e3, 200.0)
    assert paraxial.at_middle(u, k) == pytest.approx(exact.at_middle(u, k), rel=1e-4) and exact.at_middle(u, k) > 0
    assert paraxial.kappa(u, k) == pytest.approx(exact.kappa(u, k), rel=1e-9)


def test_ripples_are_those_of_a_rectangular_chirp(device):
    bandwidth, duration = 50e6, 2e-6
    f = np.linspace(-0.5, 0.5, 9) * bandwidth
    t = (np.arange(200_000) + 0.5) / 200_000 * duration - duration / 2
    rate = bandwidth / duration
    wanted = np.array([(np.exp(1j * np.pi * (rate * t**2 - 2 * x * t))).mean() * duration for x in f])
    stationary = np.exp(0.25j * np.pi) / np.sqrt(rate) * CHIRP.pulse_spectrum(CHIRP.center + f)
    assert np.allclose(chirp_ripple(CHIRP, CHIRP.center + f) * stationary, wanted, rtol=1e-6, atol=1e-9 * duration)
    options = {"tolerance": 1e-2, "compressed": False, "device": device}
    antenna = sarcl.Antenna.gaussian(width=(0.008, 0.1))
    plain = sarcl.spectral_echo(points(), CHIRP, TRACK, antenna=antenna, **options)
    rippled = sarcl.spectral_echo(points(), CHIRP, TRACK, antenna=antenna, ripple=True, **options)
    ratio = chirp_ripple(CHIRP, plain.frequency[0] + plain.frequency_step[0] * np.arange(plain.n_samples))
    assert np.allclose(rippled.samples, plain.samples * ratio, rtol=1e-4)
    with pytest.raises(ValueError, match="waveform is a tone"):
        sarcl.spectral_echo(points(), sarcl.Waveform.tone(center=9e9, duration=1e-7), TRACK, ripple=True, device=device)
