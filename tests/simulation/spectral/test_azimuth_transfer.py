"""Responses along the track against their closed form, amplitudes that are sums of products, and the time they take."""

from __future__ import annotations

import re

import numpy as np
import pytest
import scipy.special

import sarcl
from sarcl.simulation.spectral import _azimuth_transfer
from sarcl.simulation.spectral._aspect_expansion import AmplitudeSamples, AspectExpansion, expand
from sarcl.simulation.spectral._aspect_window import aspects, wavenumber
from sarcl.simulation.spectral._azimuth_transfer import response_error, transfer_tables
from sarcl.simulation.spectral._straight_track import straight_track, tangent
from sarcl.simulation.spectral.planning_time import PlanningTime


def ones(sines, frequency):
    return np.ones((1, len(sines)), np.complex128)


def test_without_an_antenna_the_transform_is_a_hankel_function():
    # the integral of exp(-j 2 k R) exp(-j u x) over an endless track is -pi r (2 k/kappa) H1^(2)(r kappa)
    r, f = 500.0, 1e9
    seen = aspects(-0.1, 0.1, (r, r * 1.0001), (0.98 * f, 1.02 * f), (-50.0, 50.0), 1e-5)
    made = transfer_tables(seen, ones, 1, 1, 4)
    k = float(wavenumber(made.frequencies[0]))
    ratio = made.start + made.step * np.arange(made.tables.shape[-1])
    inside = np.abs(ratio) < 0.08
    u = 2 * k * ratio[inside]
    kappa = np.sqrt(4 * k**2 - u**2)
    hankel = scipy.special.hankel2e(1, r * kappa)  # times exp(+j r kappa)
    wanted = -np.pi * r * (2 * k / kappa) * hankel * np.sqrt(seen.middle_range / r)
    assert np.abs(made.tables[0, 0, 0, inside] / wanted - 1).max() < 2e-4


@pytest.mark.parametrize("width", [0.004, 0.02])
def test_stationary_phase_is_0_38_over_the_time_bandwidth_product_off(width):
    # a Gaussian beam of full width at half maximum of `width` in sines; stationary phase: A = w(-u/2k) times a constant
    r, f = 2000.0, 9.6e9
    seen = aspects(-4 * width, 4 * width, (r, r * 1.0001), (f, 1.0001 * f), (-r, r), 1e-6)

    def gaussian(sines, frequency):
        return np.exp(-4 * np.log(2) * (sines / width) ** 2)[None].astype(complex)

    made = transfer_tables(seen, gaussian, 1, 1, 4)
    k = float(wavenumber(made.frequencies[0]))
    ratio = made.start + made.step * np.arange(made.tables.shape[-1])
    found = made.tables[0, 0, 0]
    kappa = 2 * k * np.sqrt(1 - np.minimum(ratio**2, 0.9))
    stationary = gaussian(-ratio, f)[0] * np.sqrt(2 * np.pi * seen.middle_range * 4 * k**2 / kappa**3)
    stationary = stationary * np.exp(-0.25j * np.pi)
    error = np.linalg.norm(stationary - found) / np.linalg.norm(found)
    time_bandwidth = width * r * 2 * k * width / (2 * np.pi)  # extent along the track times bandwidth along it
    assert error * time_bandwidth == pytest.approx(0.38, rel=0.1)


def test_the_error_of_tables_is_that_of_their_responses():
    line = straight_track(
        sarcl.Trajectory.line(start=(0, 0, 0), velocity=(0, 100, 0), prf=250, n_pulses=200), 10e9, 1e-3
    )
    errors = []
    for tolerance in (1e-2, 1e-3, 1e-4):
        seen = aspects(-0.01, 0.01, (9900.0, 10100.0), (9.5e9, 9.7e9), (-100.0, 100.0), tolerance)
        low, high = (10100.0 * float(tangent(s)) for s in seen.support)
        made = transfer_tables(seen, ones, 1, 1, 4)
        errors.append(response_error(made, ones, np.ones((1, 1)), line, (line.length - 100 + low, 100 + high)))
        assert errors[-1] < 2 * tolerance
    assert errors[2] < errors[0] / 10


def test_sums_of_products_are_found_with_as_many_terms():
    random = np.random.default_rng(0)
    a = random.normal(size=(500, 3)) + 1j * random.normal(size=(500, 3))

    def amplitudes(some, sine, frequency):
        functions = np.stack([np.ones_like(sine + 0.0), np.asarray(sine) * 30, np.cos(np.asarray(sine) * frequency)])
        return (a[some] * functions.T)[..., None].sum(axis=1)

    def seen(some, random):
        return random.uniform(-0.1, 0.1, len(some))

    samples = AmplitudeSamples(amplitudes, np.ones(500), (9.0, 11.0), seen)
    found = expand(samples, (-0.1, 0.1), 1e-6, 1e-6)
    assert len(found) == 3 and found.error < 1e-9
    sines, some = np.linspace(-0.1, 0.1, 500), np.arange(500)
    made = sum(found.factors(some, j)[:, 0] * found.functions(sines, 10.0)[j] for j in range(3))
    assert np.allclose(made, amplitudes(some, sines, 10.0)[:, 0], atol=1e-9)
    noise = random.normal(size=(500, 1000, 1)).astype(complex)

    def unlike(some, sine, frequency):
        return noise[some, np.broadcast_to((np.asarray(sine) * 4999).astype(int), some.shape)]

    with pytest.raises(sarcl.ToleranceUnreachable, match="use echo"):
        expand(AmplitudeSamples(unlike, np.ones(500), (9.0, 11.0), seen), (-0.1, 0.1), 1e-3, 1e-3)


def test_errors_of_few_scatterers_of_one_kind_are_not_averaged_with_those_of_the_others():
    """20 of 1000 that change by a fifth over the band, and the others not at all: 20 in phase are as bright as 400."""
    kinds = (np.arange(1000) < 20).astype(int)

    def amplitudes(some, sine, frequency):
        faint = 1 - 0.2 * kinds[some, None]
        return (faint * (1 + 0.1 * kinds[some, None] * (frequency - 10)) + 0 * np.reshape(sine, (-1, 1))).astype(
            complex
        )

    def seen(some, random):
        return random.uniform(-0.1, 0.1, len(some))

    samples, apart = (AmplitudeSamples(amplitudes, np.ones(1000), (9.0, 11.0), seen, some) for some in (None, kinds))
    found = expand(samples, (-0.1, 0.1), 0.08, 0.08)
    assert len(found) == 1 and len(expand(apart, (-0.1, 0.1), 0.08, 0.08)) == 2
    assert samples.error(found) <= 0.08 and apart.error(found) > 0.16


@pytest.mark.parametrize("n", [200, 225, 250, 275, 300])
def test_amplitudes_that_change_along_the_band_are_predicted(n):
    """One term is exact at one frequency, and off by more, the farther a frequency is from it."""

    def amplitudes(some, sine, frequency):
        return 1 - 0.01 * (some[:, None] / n) * (frequency - 9) / 2 + 0j

    def seen(some, random):
        return random.uniform(-0.1, 0.1, len(some))

    sizes = np.random.default_rng(n).random(n)
    found = expand(AmplitudeSamples(amplitudes, sizes, (9.0, 11.0), seen), (-0.1, 0.1), 0.1, 0.1)
    some, factors = np.arange(n), found.factors(np.arange(n), 0)
    wrong = [factors * found.functions(np.zeros(1), f)[0] - amplitudes(some, 0.0, f) for f in np.linspace(9, 11, 101)]
    assert len(found) == 1
    assert np.sqrt(np.mean(np.abs(wrong) ** 2)) <= found.error


def size_of_terms(found, n, frequency):
    """Root mean square of the terms of an expansion of n amplitudes of 1, at one frequency."""
    some, psi = np.arange(n), found.functions(np.zeros(1), frequency)[:, 0]
    terms = np.stack([found.factors(some, j)[:, 0] * psi[j] for j in range(len(found))])
    return float(np.sqrt((np.abs(terms) ** 2).sum(axis=0).mean()))


def test_terms_of_a_wide_band_do_not_cancel():
    """Phases of up to 4 rad over the band, 1e-3 rad over the aspects: rounding of terms grows as they cancel."""
    place = np.random.default_rng(0).uniform(-1, 1, 200)

    def amplitudes(some, sine, frequency):
        phase = place[some] * (4 * (frequency - 10) + np.sin(17 * place[some]) * np.asarray(sine))
        return np.exp(1j * phase)[:, None]

    def seen(some, random):
        return random.uniform(-1e-3, 1e-3, len(some))

    found = expand(AmplitudeSamples(amplitudes, np.ones(200), (9.0, 11.0), seen), (-1e-3, 1e-3), 2e-3, 2e-3)
    assert max(size_of_terms(found, 200, f) for f in np.linspace(9, 11, 33)) < 10


def test_rounding_of_terms_that_cancel_is_predicted():
    some = np.arange(50)

    def amplitudes(some, sine, frequency):
        return np.ones((len(some), 1), complex)

    samples = AmplitudeSamples(amplitudes, np.ones(50), (9.0, 11.0), lambda some, random: np.zeros(len(some)))
    # 1 = 5001 - 5000
    found = AspectExpansion(
        amplitudes, np.zeros(2), np.full(2, 10.0), some[:1], np.zeros(1, int), np.array([[5001.0], [-5000.0]]), 0.0
    )
    assert 7e-3 <= samples.error(found) <= 3e-2


def few_pulses_far_away():
    """7 pulses 0.1 mm apart and 1000 km from three points: half a kilometre of track is a Fresnel zone at 0.6 GHz."""
    track = sarcl.Trajectory.line(start=(-7e5, 0, 7e5), velocity=(0, 1, 0), prf=1e4, n_pulses=7)
    points = sarcl.Scene.points([[0, 0, 0], [30, 20, 0], [-40, 10, 0.0]])
    return points, sarcl.Waveform.chirp(center=6e8, bandwidth=1e7, duration=1e-5), track


def test_a_plan_of_spectral_echo_that_takes_longer_than_echo_is_refused(monkeypatch):
    """It compared responses over millions of pulse intervals, for minutes, of which the track has seven."""
    for name in ("response_error", "transfer_tables"):
        monkeypatch.setattr(_azimuth_transfer, name, lambda *given: pytest.fail("responses were transformed"))
    says = r"seen over \d{6,} pulse intervals, of which the track has 7; .* echo takes about .* in all: use echo"
    forecast = sarcl.plan(sarcl.echo, *few_pulses_far_away())
    assert forecast.plan["spectral_echo"].startswith("not planned: that takes long beside echo")
    for variant in ("exact", "saras"):
        with pytest.raises(ValueError, match=says):
            sarcl.spectral_echo(*few_pulses_far_away(), variant=variant)


def test_a_refusal_gives_about_the_seconds_of_the_forecast_of_echo():
    """Many points close together, which echo adds by levels: it said 80 times as many seconds."""
    points = sarcl.Scene.points(np.random.default_rng(0).uniform(-40, 40, (200_000, 3)), np.ones(200_000))
    track = sarcl.Trajectory.line(start=(-7e5, 0, 7e5), velocity=(0, 1, 0), prf=1e4, n_pulses=20_000)
    task = points, few_pulses_far_away()[1], track
    with pytest.raises(ValueError) as refused:
        sarcl.plan(sarcl.spectral_echo, *task)
    said = re.search(r"echo takes about ([\d.]+) (m?s) in all", str(refused.value))
    seconds = float(said[1]) * {"s": 1, "ms": 1e-3}[said[2]]
    assert 0.1 < seconds / sarcl.plan(sarcl.echo, *task).seconds < 10  # the forecast times pulses


def test_the_time_of_a_plan_is_that_of_all_its_steps():
    with pytest.raises(ValueError, match=r"more than 1\.2 s"):
        PlanningTime(7, lambda: 0.0, longest=1.0).spend(1e7, 5000)
    limit = PlanningTime(7, lambda: 0.0)
    limit.spend(3e7, 5000)  # 3.6 s
    with pytest.raises(ValueError, match=r"more than 7\.2 s, and echo takes about 0 s"):
        limit.spend(3e7, 5000)
    many = PlanningTime(100_000, lambda: 56.0)
    many.spend(4.6e8, 110_000)
    with pytest.raises(ValueError, match="more than 57 s, and echo takes about 56 s"):
        many.spend(1.5e7, 110_000)
