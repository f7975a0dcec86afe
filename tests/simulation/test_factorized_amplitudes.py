"""Factorised echoes of scatterers whose amplitudes change along the track: facets, gains of antennas, spreading loss.

The oracle is the direct method at a far smaller tolerance, or, where facets are coherent and cut to the tolerance, the
exact sum over the facets as they were cut (check=True).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import thinned
from scipy.spatial.transform import Rotation

import sarcl
from sarcl.base.errors import NotApplicable
from sarcl.numerics.pulse_geometry import PulseGeometry
from sarcl.numerics.subapertures import decimated
from sarcl.scattering.antenna_weights import AntennaWeights
from sarcl.scattering.kept_amplitudes import SAFETY, AmplitudeSamples

pytestmark = pytest.mark.filterwarnings("ignore:too few facets for speckle")  # scenes are small
CASES = [1e-1, 1e-2, 1e-3, 1e-4]
CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=1e-6)
ROUGH = sarcl.Material(eps_r=4.0, conductivity=1e-3, height=np.inf, diagram="cos")


def terrain(n=30, size=24.0, height=2.0, material=ROUGH):
    axis = np.linspace(-size / 2, size / 2, n)
    return sarcl.Scene.from_heights(
        axis, axis, height * np.sin(axis / 5)[:, None] * np.cos(axis / 7), material=material
    )


def cloud(n=1500, size=30.0):
    random = np.random.default_rng(0)
    positions = random.uniform(-size, size, (n, 3)) * [1, 1, 0.05]
    return sarcl.Scene.points(positions, random.standard_normal(n) + 1j * random.standard_normal(n))


def line(n=200, aperture=100.0, away=7e3, height=7e3):
    start = (-away, -aperture / 2, height)
    return sarcl.Trajectory.line(start=start, velocity=(0, aperture, 0), prf=float(n), n_pulses=n)


def arc(angle, n, height=4e3):
    return sarcl.Trajectory.circle(radius=5e3, height=height, start=np.pi - angle / 2, arc=angle, n_pulses=n)


def plate(turn=0.0):
    triangles = sarcl.shapes.plate((4.0, 4.0)).triangles
    return sarcl.Scene.facets(triangles @ Rotation.from_euler("y", turn - np.pi / 4).as_matrix().T, material="metal")


TRACKS = {
    "line": line(),
    "near": line(400, aperture=40.0, away=150.0, height=150.0),
    "wide": arc(np.pi / 2, 1200),
    "orbit": line(200, aperture=4e5, away=3e7, height=2e7),
    "low": arc(0.5, 600, height=1e3),  # facets turn away on the way
}


def echoes(scene, track, tolerance, method="factorized", **options):
    options = {"check": False, "shadows": False, **options}
    return sarcl.echo(scene, CHIRP, track, tolerance=tolerance, method=method, **options)


def compared(scene, track, tolerance, *, finer=20, **options):
    """Factorised echoes, their error against direct ones, and what is predicted of both."""
    raw = echoes(scene, track, tolerance, **options)
    direct = echoes(scene, track, max(tolerance / finer, 4e-5), "direct", **options)
    assert raw.report.plan["method"] == "factorized" != direct.report.plan["method"]
    error = np.linalg.norm(raw.samples - direct.samples) / np.linalg.norm(direct.samples)
    assert raw.report.predicted_error <= tolerance
    assert error <= raw.report.predicted_error + direct.report.predicted_error
    return raw, direct, error


@pytest.mark.parametrize("track, tolerance", thinned([(t,) for t in TRACKS], CASES, every=4, slow=(1, 2)))
def test_rough_facets_on_every_kind_of_track(device, track, tolerance):
    raw, direct, error = compared(terrain(), TRACKS[track], tolerance, device=device)
    assert error <= 0.4 * tolerance
    away = [r.report.contributions_skipped["facing away"] for r in (raw, direct)]
    assert abs(away[0] - away[1]) <= 2e-3 * (raw.report.contributions_done + away[0])


@pytest.mark.costly
def test_polarisations_and_two_antennas(device):
    back = sarcl.Trajectory.line(start=(-6e3, 500, 8e3), velocity=(0, 80, 0), prf=200.0, n_pulses=200)
    for receiver in (None, back):
        options = {"polarization": ("HH", "VH", "HV", "VV"), "receiver": receiver, "device": device}
        raw, direct, _ = compared(terrain(), line(), 1e-2, **options)
        for i in range(4):  # cross-polarised echoes are weaker by far
            wrong = np.linalg.norm(raw.samples[i::4] - direct.samples[i::4])
            assert wrong <= 1e-2 * np.linalg.norm(direct.samples[i::4])


@pytest.mark.costly
def test_facets_with_a_coherent_part(device):
    compared(terrain(material=replace(ROUGH, height=0.01)), line(), 1e-2, device=device)


@pytest.mark.parametrize("turn", [0.0, 0.1])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-3])
def test_a_specular_flash_in_the_middle_of_the_track(device, turn, tolerance):
    raw = echoes(plate(turn), line(500, aperture=800.0), tolerance, check=True, device=device)
    assert raw.report.plan["method"] == "factorized"
    assert raw.report.measured_error <= raw.report.predicted_error <= tolerance


@pytest.mark.costly
def test_two_materials_at_once(device):
    both = terrain() + plate().moved((0, 0, 5))
    raw = echoes(both, line(300, aperture=400.0), 1e-2, check=True, device=device)
    assert raw.report.measured_error <= raw.report.predicted_error <= 1e-2


@pytest.mark.slow
def test_facets_that_moving_shadows_cross_are_added_directly(device):
    if device.info.vector_width == 1:
        pytest.skip("more than a minute with one lane on a CPU; shadows do not depend on lanes")
    raw, _, _ = compared(terrain(height=4.0), TRACKS["low"], 1e-2, finer=10, shadows=True, device=device)
    assert 0 < raw.report.plan["facets added pulse by pulse"] < raw.report.plan["facets"]


@pytest.mark.costly
def test_facets_at_the_edge_of_the_range_window_are_added_directly(device):
    options = {"range_window": (-5.0, 4.0), "reference": (0.0, 0.0, 0.0), "device": device}
    raw, direct, _ = compared(terrain(), line(), 1e-2, **options)
    assert raw.report.plan["facets added pulse by pulse"] > 0
    outside = [r.report.contributions_skipped["range window"] for r in (raw, direct)]
    assert outside[0] == outside[1] > 0


@pytest.mark.costly
def test_devices_with_one_lane_and_without_float64_and_little_memory(device):
    raw = echoes(terrain(), line(), 1e-3, device=device)
    for other, memory in ((device.one_lane(), None), (device.without_fp64(), None), (device, 3e6)):
        same = echoes(terrain(), line(), 1e-3, device=other, max_bytes=memory)
        assert np.linalg.norm(same.samples - raw.samples) <= 5e-5 * np.linalg.norm(raw.samples)


@pytest.mark.costly
def test_channels_of_an_array(device):
    options = {"array": sarcl.AntennaArray.linear(2, spacing=0.5), "channels": "separated", "device": device}
    compared(terrain(), line(), 1e-2, **options)


SPOT = sarcl.pointing.spotlight(line(), (0.0, 0.0, 0.0))
STRIP = sarcl.pointing.stripmap(line(400, aperture=300.0), np.pi / 4)
GAINS = {
    "spreading loss": (line(), {"radar": sarcl.Radar(power=1.0)}),
    "near": (TRACKS["near"], {"radar": sarcl.Radar(power=1.0)}),
    "spotlight": (SPOT, {"antenna": sarcl.Antenna.gaussian(width=(0.004, 0.004))}),
    "nulls": (SPOT, {"antenna": sarcl.Antenna.rectangular(size=(6.0, 1.0))}),
    "stripmap": (STRIP, {"antenna": sarcl.Antenna.rectangular(size=(2.0, 0.2)), "radar": sarcl.Radar(power=1.0)}),
}


@pytest.mark.parametrize("name", GAINS)
def test_points_under_gains_and_spreading_loss(device, name):
    track, options = GAINS[name]
    _, _, error = compared(cloud(), track, 1e-2, finer=8, device=device, **options)
    assert error <= 3e-3


@pytest.mark.costly
def test_facets_under_gains(device):
    compared(terrain(), SPOT, 1e-2, finer=8, antenna=sarcl.Antenna.gaussian(width=(0.004, 0.01)), device=device)


def test_gains_that_end_among_the_scatterers_are_applied_pulse_by_pulse(device):
    angle = np.linspace(-1.2e-3, 1.2e-3, 9)
    options = {"antenna": sarcl.Antenna.table(angle, angle, np.ones((9, 9))), "device": device}
    with pytest.raises(NotApplicable, match="tables end among the scatterers"):
        echoes(cloud(), SPOT, 1e-2, **options)
    assert echoes(cloud(), SPOT, 1e-2, "auto", **options).report.plan["method"] == "spread"


def test_facets_near_the_vertical_through_an_antenna_are_refused_with_the_reason(device):
    overhead = line(away=10.0, height=3e3)
    with pytest.raises(NotApplicable, match="antennas pass over the facets"):
        echoes(terrain(), overhead, 1e-2, device=device)
    assert echoes(terrain(), overhead, 1e-2, "auto", device=device).report.plan["method"] == "spread"


def test_auto_factorises_many_facets_and_the_forecast_says_so(device):
    if not device.info.fp64:
        pytest.skip("the host cuts the facets, and the forecast does not wait for that")
    if device.info.kind == "gpu":
        pytest.skip("a GPU adds so few pulses before the host has made cells")
    arguments = terrain(120, 100.0), CHIRP, line(1000)
    options = {"tolerance": 1e-2, "shadows": False, "check": False, "device": device}
    forecast = sarcl.plan(sarcl.echo, *arguments, **options)
    assert forecast.method == "factorized"
    raw = forecast.run()
    assert raw.report.plan["method"] == "factorized"
    assert raw.report.predicted_error == forecast.predicted_error
    assert echoes(terrain(10), line(), 1e-2, "auto", device=device).report.plan["method"] == "spread"


@pytest.fixture
def samples():
    positions = np.stack([np.full(96, -4e3), np.linspace(-40, 40, 96), np.full(96, 3e3)], axis=1)
    track = PulseGeometry(positions, positions, frequency=np.full(96, 9.6e9), runs=((0, 96),))
    places = np.random.default_rng(0).uniform(-5, 5, (300, 3))

    def of(cycles):
        def seen(by, i):  # cycles of change along the track
            return np.exp(2j * np.pi * cycles * by.geometry.tx[i, 1] / 80)[None] * np.ones((300, 1))

        bounds = np.array([[-5.0] * 3, [5.0] * 3])
        return AmplitudeSamples(places, np.ones(300), seen, AntennaWeights(track, 9.6e9), 9.6e9, bounds)

    return of, track


def test_the_error_of_changing_amplitudes_is_that_of_the_filter(samples):
    of, track = samples
    decimation = decimated(track, 8, 4, 2.0)
    weights = AntennaWeights(track, 9.6e9)
    assert of(0.0).change(weights, decimation, 1.0) <= 1e-12
    slow, fast = (of(cycles).change(weights, decimation, 1e-6) for cycles in (1.0, 4.0))
    assert slow < fast / 5
    at = np.arange(40, 48)  # a block in the middle, without a cell: what the filter makes of exp(j 2 pi cycles y/80)
    y, kept_y = track.tx[:, 1], decimation.kept.tx[:, 1]
    first, row = decimation.neighbours[at].T
    near = first[:, None] + np.arange(4)
    phasor, kept = (np.exp(2j * np.pi * 4.0 * v / 80) for v in (y[at], kept_y[near]))
    change = np.abs((decimation.filter[row] * (kept - phasor[:, None])).sum(axis=1))
    assert fast == pytest.approx(SAFETY * np.sqrt((change[[2, 4, 6]] ** 2).mean() / 0.9), rel=1e-3)


def test_antennas_turn_on_beyond_the_ends_of_a_track():
    angle = 0.01 * np.arange(64)
    axes = Rotation.from_euler("z", angle[:, None]).as_matrix()
    positions = np.stack([1e3 * np.cos(angle), 1e3 * np.sin(angle), 0 * angle], axis=1)
    track = PulseGeometry(positions, positions, frequency=np.full(64, 1e9), runs=((0, 64),))
    kept = AntennaWeights(track, 1e9, axes=(axes, axes)).decimated(decimated(track, 4, 4, 2.0))
    turned = Rotation.from_matrix(kept.axes[0]).as_euler("zyx")[:, 0]
    assert np.diff(turned) == pytest.approx(0.04, abs=1e-4)
