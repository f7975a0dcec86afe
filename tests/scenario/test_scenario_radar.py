"""Antennas, aims, the radar equation and noise in scenario files."""

import numpy as np
import pytest

import sarcl
from sarcl.model.antenna import Antenna
from sarcl.model.radar import Radar
from sarcl.scenario import scenario

TEXT = """
[waveform.chirp]
center = 9.6e9
bandwidth = 100e6
duration = 2e-6

[trajectory.line]
start = [-100, -5000, 3000]
velocity = [100, 0, 0]
prf = 10
n_pulses = 20

[pointing.spotlight]
point = [10, 0, 0]

[antenna.rectangular]
size = [1.2, 0.4]
gain_db = 33

[radar]
power = 1e3
losses_db = 3

[noise]
temperature = 300
seed = 3

[[scene.points]]
positions = [[0, 0, 0], [20, 10, 0]]

[grid.plane]
shape = [16, 16]
spacing = [1.0, 1.0]

[echo]
tolerance = 1e-3
"""


@pytest.mark.costly
def test_a_scenario_is_its_calls(device):
    from sarcl import pointing

    raw = scenario.loads(TEXT).simulate(device=device)
    track = sarcl.Trajectory.line(start=(-100, -5000, 3000), velocity=(100, 0, 0), prf=10, n_pulses=20)
    chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=100e6, duration=2e-6)
    made = sarcl.echo(
        sarcl.Scene.points([[0, 0, 0], [20, 10, 0]]), chirp, pointing.spotlight(track, (10, 0, 0)),
        antenna=Antenna.rectangular(size=(1.2, 0.4), gain_db=33), radar=Radar(power=1e3, losses_db=3),
        tolerance=1e-3, device=device,
    )  # fmt: skip
    assert np.array_equal(raw.read(0, 20), sarcl.add_noise(made, temperature=300, seed=3).read(0, 20))


def test_noise_at_an_nesz_takes_the_grid(device):
    text = TEXT.replace("temperature = 300", "nesz_db = -20").replace("[radar]\npower = 1e3\nlosses_db = 3\n", "")
    made = scenario.loads(text)
    raw = made.simulate(device=device)
    bare = scenario.loads(text.replace("[noise]\nnesz_db = -20\nseed = 3\n", "")).simulate(device=device)
    wanted = sarcl.add_noise(bare, nesz_db=-20, seed=3, grid=made.build_grid())
    assert np.array_equal(raw.read(0, 20), wanted.read(0, 20))


def test_a_receiver_of_its_own_kind(device):
    receiver = """
[receiver.line]
start = [900, -5000, 3000]
velocity = [100, 0, 0]
prf = 10
n_pulses = 20

[receiver_antenna.gaussian]
width = 0.1
"""
    made = scenario.loads(TEXT + receiver)
    sends, receives = made.build_antenna()
    assert (sends.kind, receives.kind) == ("aperture", "gaussian")
    assert made.simulate(device=device).report.plan["antennas"] == "aperture and gaussian"


@pytest.mark.parametrize(
    "antenna",
    [
        Antenna.isotropic(gain_db=3),
        Antenna.rectangular(size=(1, 2), taper=(0.1, 1)),
        Antenna.gaussian(width=0.1, gain_db=3, frequency=1e9, two_way=True),
        Antenna.table(np.linspace(-1, 1, 9), np.linspace(-1, 1, 8), np.arange(72.0).reshape(9, 8) + 1j, gain_db=10),
    ],
)
def test_antennas_go_to_files_and_back(antenna):
    text = sarcl.Scenario(antenna=antenna, radar=Radar(power=3.0, noise_temperature=290)).dumps()
    again = scenario.loads(text)
    found = again.build_antenna()
    for name in ("kind", "gain_db", "two_way", "frequency"):
        assert getattr(found, name) == getattr(antenna, name)
    for name in ("size", "taper", "width", "azimuth", "elevation", "values", "mount"):
        assert np.array_equal(getattr(found, name), getattr(antenna, name))
    assert again.build_radar() == Radar(power=3.0, noise_temperature=290)
    assert again.dumps() == text


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("spotlight", "spotligt", r":13: \[pointing\] unknown table 'spotligt'; did you mean 'spotlight'"),
        ("size =", "sizes =", r":17: \[antenna.rectangular\] unknown key 'sizes'; did you mean 'size'"),
        ("power = 1e3", "power = -1", r":21: \[radar\] radar power is -1; it must be greater than 0"),
        ("point = [10, 0, 0]", "point = [10, 0]", r":14: \[pointing.spotlight\] point has shape \(2,\)"),
        ("[antenna.rect", "[receiver_antenna.rect", r":16: \[receiver_antenna\] has no \[antenna\] to transmit"),
        ("[pointing.spotlight]\npoint = [10, 0, 0]\n", "", "the track has no attitude"),
        ("tolerance = 1e-3", "antenna = 3", r"\[echo\] unknown key 'antenna'"),
        ("temperature = 300", "nesz_db = -20\ntemperature = 300", r"\[noise\] noise has one level"),
    ],
)
def test_mistakes_name_their_line(old, new, said):
    assert TEXT.count(old) == 1
    with pytest.raises(ValueError, match=said):
        scenario.loads(TEXT.replace(old, new)).simulate()
