"""Several reflections in the channels of arrays and under two-way patterns: each is the echo of its own antennas."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl

CENTER, BANDWIDTH = 9.6e9, 40e6
CORNER = 0.3 * np.array(
    [[(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 0, 0), (0, 1, 0), (0, 0, 1)], [(0, 0, 0), (0, 0, 1), (1, 0, 0)]], float
)
SCENE = sarcl.Scene.facets(CORNER)
TRACK = sarcl.Trajectory.line(start=(1e3, 998, 1e3), velocity=(0, 1, 0), prf=1.0, n_pulses=2)
OPTIONS = {"reference": (0, 0, 0), "range_window": (-12, 12), "tolerance": 1e-3, "bounces": 3}


def chirp(center: float = CENTER) -> sarcl.Waveform:
    return sarcl.Waveform.chirp(center=center, bandwidth=BANDWIDTH, duration=1e-9)


@pytest.mark.parametrize(
    ("receive", "edges", "step", "gate"),
    [
        ("own", False, 0.0, 1e-5),
        ("all", True, 0.0, 1e-5),
        ("all", False, 2 * BANDWIDTH, 1e-3),  # facets are cut for the band of all channels
    ],
)
def test_a_channel_of_an_array_is_the_echo_of_its_own_antennas_and_carrier(receive, edges, step, gate):
    array = sarcl.AntennaArray.linear(2, spacing=0.5, frequency_step=step)
    options = OPTIONS | {"polarization": ("HH", "HV"), "edges": edges}
    raw = sarcl.echo(SCENE, chirp(), TRACK, array=array, channels="separated", receive=receive, check=True, **options)
    assert 0 < raw.report.measured_error <= raw.report.predicted_error <= 1e-3
    pairs = [(n, n) for n in range(2)] if receive == "own" else [(1, 0)]
    for sent, received in pairs:
        rows = (raw.tx_channel == sent) & (raw.rx_channel == received)
        tx, rx = (sarcl.Trajectory(None, TRACK.positions + array.positions[n]) for n in (sent, received))
        wave = chirp(CENTER + float(array.offsets_at(0)[sent]))
        own = sarcl.echo(SCENE, wave, tx, receiver=rx, check=False, **options)
        assert np.linalg.norm(raw.samples[rows] - own.samples) <= gate * np.linalg.norm(own.samples)


def test_simultaneous_channels_are_the_sum_of_the_separated_ones():
    array = sarcl.AntennaArray.linear(2, spacing=0.5, frequency_step=0.0)
    both, apart = (
        sarcl.echo(SCENE, chirp(), TRACK, array=array, channels=c, **OPTIONS) for c in ("simultaneous", "separated")
    )
    path = 2 * (apart.reference_range - np.repeat(both.reference_range, 2))
    f = both.frequency[0] + both.frequency_step[0] * np.arange(both.n_samples)
    turned = apart.samples * np.exp(-2j * np.pi * f * path[:, None] / 299_792_458.0)
    assert np.linalg.norm(both.samples - turned[::2] - turned[1::2]) <= 1e-5 * np.linalg.norm(both.samples)


AIMED = sarcl.pointing.spotlight(TRACK, (0.1, 0.3, 0.1))
WIDTH = 6e-4  # rad: the corner is as wide as half the beam


def two_way(table: bool) -> sarcl.Antenna:
    """Gaussian patterns that are the square of `ONE_WAY`."""
    angle = np.linspace(-1e-3, 1e-3, 41)
    if not table:
        return sarcl.Antenna.gaussian(width=(WIDTH, WIDTH), gain_db=10, two_way=True)
    power = np.exp(-2 * np.log(2) * (angle[:, None] ** 2 + angle**2) / WIDTH**2)
    return sarcl.Antenna.table(angle, angle, power, gain_db=10, two_way=True)


ONE_WAY = sarcl.Antenna.gaussian(width=(np.sqrt(2) * WIDTH, np.sqrt(2) * WIDTH), gain_db=5)


@pytest.mark.parametrize("table", [False, True])
def test_a_two_way_pattern_weighs_each_way_by_its_root(table):
    """A product of gains that are equal: once as the pattern of one way, once as their product."""
    radar = sarcl.Radar(power=1.0)
    one, two = (
        sarcl.echo(SCENE, chirp(), AIMED, antenna=a, radar=radar, check=False, **OPTIONS)
        for a in (ONE_WAY, two_way(table))
    )
    assert np.linalg.norm(two.samples - one.samples) <= 1e-3 * np.linalg.norm(one.samples)
    plain = sarcl.echo(SCENE, chirp(), AIMED, radar=radar, check=False, **OPTIONS)
    share = np.vdot(plain.samples, one.samples) / np.vdot(plain.samples, plain.samples)
    assert 10 ** (10 / 20) * 0.5 < abs(share) < 10 ** (10 / 20) * 0.99  # the beam does weigh
