"""Radar cross sections of scenes against closed forms, laws, the float64 formulas, and echoes from far away."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

import sarcl
from sarcl import shapes
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.reference.facet import facet_amplitude
from sarcl.reference.lit_part import lit_part
from sarcl.reference.mie import conducting_sphere

FREQUENCY = 9.6e9
DIRECTIONS = np.radians([[10, 70, 200, 300], [20, 55, -30, 75]])  # azimuth, elevation
TOLERANCE = {
    "plane facet": 1e-9,  # sums of a few terms in float64, relative
    "sphere": 0.02,  # dB: facets of 80 000
    "Mie": 0.1,  # dB: physical optics of a sphere of ka 100
    "lit part": 1e-6,  # complex64
    "moved": 1e-7,  # relative: phases of 1e4 rad in float64
}


def towards(azimuth, elevation):
    return np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation) + 0 * azimuth],
        axis=-1,
    )


def difference(a, b):
    return np.linalg.norm(a - b) / np.linalg.norm(b)


def wavenumber(frequency=FREQUENCY):
    return 2 * np.pi * frequency / SPEED_OF_LIGHT


def test_a_plate_has_its_closed_form_at_all_angles():
    """k/(2 sqrt(pi)) 2 cos(t) A sinc(k a sin t): real and positive about its centre."""
    side, tilt = 0.1016, np.radians([0, 5, 10, 20, 40, 60])
    frequency = SPEED_OF_LIGHT / 0.0325
    s = sarcl.rcs(shapes.plate((side, side)), 0.0, np.pi / 2 - tilt, frequency, polarization=("HH", "VV", "HV"))
    argument = wavenumber(frequency) * side * np.sin(tilt) / np.pi
    wanted = wavenumber(frequency) / np.sqrt(np.pi) * np.cos(tilt) * side**2 * np.sinc(argument)
    assert s.shape == (6, 3)
    for column in (0, 1):
        assert s[:, column] == pytest.approx(wanted, abs=TOLERANCE["plane facet"] * wanted[0])
    assert np.abs(s[:, 2]).max() < TOLERANCE["plane facet"] * wanted[0]
    printed = [1.0302, -3.7595, -21.2624, -23.5638, -47.8401, -29.9208]  # dBsm
    assert 20 * np.log10(np.abs(s[:, 0])) == pytest.approx(printed, abs=0.01)


@pytest.mark.parametrize("ka", [50, 100])
def test_a_sphere_has_that_of_physical_optics_in_all_directions(ka):
    ball, b = shapes.sphere(1.0, facets=80_000), 2 * ka
    s = sarcl.rcs(ball, DIRECTIONS[0], DIRECTIONS[1], ka * SPEED_OF_LIGHT / (2 * np.pi), shadows=False)
    wanted = np.pi * abs(1 + 1j / b * (1 - np.exp(-1j * b))) ** 2
    assert 10 * np.log10(np.abs(s) ** 2 / wanted) == pytest.approx(0, abs=TOLERANCE["sphere"])
    # the phase is that of its nearest point, about the origin
    mie = conducting_sphere(1.0, ka)[0]
    assert 20 * np.log10(np.abs(s / mie)) == pytest.approx(0, abs=TOLERANCE["Mie"])
    assert np.angle(s / mie) == pytest.approx(0, abs=0.02)


def test_points_have_their_amplitudes_and_the_phase_about_the_origin():
    places, a = np.array([[1.0, 2, 3], [-4, 0, 1]]), np.array([2.0, 1j])
    receiver = (DIRECTIONS[0] + 0.3, DIRECTIONS[1] / 2)
    f = np.array([5e9, 9.6e9, 10e9])
    scene = sarcl.Scene.points(places, a)
    s = sarcl.rcs(scene, *DIRECTIONS, f, receiver=receiver, polarization=("VV", "HV"))
    both = towards(*DIRECTIONS) + towards(*receiver)
    wanted = np.exp(1j * wavenumber(f)[None, :, None] * (both @ places.T)[:, None]) @ a
    assert s.shape == (4, 3, 2) and difference(s[..., 0], wanted) < TOLERANCE["plane facet"]
    assert not s[..., 1].any()
    lens = sarcl.rcs(shapes.luneburg(0.15), 0.0, 0.0, f)
    assert np.abs(lens) ** 2 == pytest.approx(shapes.luneburg_rcs(0.15, (1, 0, 0), f))


def test_a_shift_turns_the_phase_and_cutting_facets_changes_nothing():
    scene, shift = shapes.box((0.5, 0.3, 0.4), material="concrete"), np.array([3.0, -2.0, 5.0])
    s = sarcl.rcs(scene, *DIRECTIONS, FREQUENCY, polarization="all")
    turn = np.exp(2j * wavenumber() * towards(*DIRECTIONS) @ shift)[:, None]
    assert (
        difference(sarcl.rcs(scene.moved(shift), *DIRECTIONS, FREQUENCY, polarization="all"), s * turn)
        < (TOLERANCE["moved"])
    )
    cut = sarcl.rcs(scene.split(0.1), *DIRECTIONS, FREQUENCY, polarization="all")
    assert difference(cut, s) < TOLERANCE["lit part"]


def test_two_plates_are_the_sum_less_the_shadow():
    """A small plate above a large one: both, less the large one's part in the small one's shadow."""
    large, small, height = 1.0, 0.3, 0.2
    azimuth, elevation = np.radians([20.0, 75.0, 140.0]), np.radians([70.0, 60.0, 80.0])
    both = shapes.plate((large, large)) + shapes.plate((small, small)).moved((0, 0, height))
    s = sarcl.rcs(both, azimuth, elevation, FREQUENCY, polarization=("HH", "VV"))
    for i, u in enumerate(towards(azimuth, elevation)):
        parts = [
            shapes.plate((large, large)),
            shapes.plate((small, small)).moved((0, 0, height)),
            shapes.plate((small, small)).moved(-height / u[2] * np.array([u[0], u[1], 0])),
        ]
        values = [sarcl.rcs(p, azimuth[i], elevation[i], FREQUENCY, polarization=("HH", "VV")) for p in parts]
        assert difference(s[i], values[0] + values[1] - values[2]) < TOLERANCE["lit part"]


def direct_sum(scene, u_t, u_r, frequency):
    """(2, 2), m: every facet against all others, in float64."""
    k, out = wavenumber(frequency), np.zeros((2, 2), complex)
    antennas = [1e12 * u for u in ([u_t] if np.array_equal(u_t, u_r) else [u_t, u_r])]
    for i, given in enumerate(scene.triangles):
        normal = np.cross(given[1] - given[0], given[2] - given[0])
        is_back = scene.two_sided[i] and normal @ (u_t + u_r) < 0
        facet = given[::-1] if is_back else given
        eps = scene.materials[scene.material[i]].permittivity(frequency)
        whole = facet_amplitude(facet[None], eps, frequency, u_t, u_r)[0]
        if not whole.any():
            continue
        others = np.delete(scene.triangles, i, axis=0)
        lit = lit_part(facet, others, antennas, np.array([k]), 1e-7)[1][0]
        unshaded = lit_part(facet, others[:0], antennas, np.array([k]))[1][0]
        center = facet.mean(axis=0)
        out += scene.reflectivity[i] * whole * lit / unshaded * np.exp(1j * k * (u_t + u_r) @ center)
    return out


@pytest.mark.parametrize(
    "receiver",
    [None, pytest.param((np.radians([50, 100, 170, 280]), np.radians([40, 30, -10, 60])), marks=pytest.mark.slow)],
)
def test_a_scene_with_shadows_is_the_sum_over_its_facets(receiver):
    scene = shapes.box((1, 0.6, 0.5), material="concrete") + shapes.plate((2, 2), material="metal").moved((0, 0, -0.1))
    scene = scene + sarcl.Scene.facets(
        np.random.default_rng(3).uniform(-1, 1, (12, 3, 3)), material="wood", reflectivity=0.5
    )
    frequencies = np.array([1e9, 3e9])
    s = sarcl.rcs(scene, *DIRECTIONS, frequencies, receiver=receiver, polarization="all", check=True)
    looks = towards(*DIRECTIONS), towards(*(DIRECTIONS if receiver is None else receiver))
    for i, (u_t, u_r) in enumerate(zip(*looks, strict=True)):
        for j, f in enumerate(frequencies.tolist()):
            assert difference(s[i, j].reshape(2, 2), direct_sum(scene, u_t, u_r, f)) < TOLERANCE["lit part"]


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3])
def test_a_car_has_the_echo_that_it_has_from_far_away(data_folder, tolerance):
    car = sarcl.Scene.from_mesh(data_folder / "meshes" / "car_of_boxes" / "car_mm.stl", scale=1e-3)
    azimuth, elevation = np.radians(np.arange(0, 360, 9.0)), np.radians(20.0)
    track = sarcl.Trajectory(None, 1e6 * towards(azimuth, elevation))
    chirp = sarcl.Waveform.chirp(center=FREQUENCY, bandwidth=400e6, duration=1e-6)
    raw = sarcl.echo(car, chirp, track, reference=(0, 0, 0), tolerance=tolerance, polarization="VV")
    frequencies = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)
    s = sarcl.rcs(car, azimuth, elevation, frequencies[::8], tolerance=tolerance, polarization="VV")
    assert difference(raw.samples[:, ::8], s) <= 2 * tolerance


def test_results_have_the_shape_of_their_arguments():
    point, f = sarcl.Scene.points([[0.0, 0, 0]], 2.0), np.array([1e9, 2e9, 3e9])
    assert sarcl.rcs(point, 0.0, 0.0, 1e9) == 2 and sarcl.rcs(point, 0.0, 0.0, 1e9).shape == ()
    assert sarcl.rcs(point, 0.0, 0.0, f).shape == (3,)
    assert sarcl.rcs(point, np.zeros((4, 1)), np.zeros(5), f, polarization=["HH"]).shape == (4, 5, 3, 1)
    assert sarcl.rcs(point, 0.0, np.zeros(5), 1e9, receiver=(np.zeros((2, 1)), 0.1)).shape == (2, 5)
    assert sarcl.rcs(point, 0.0, 0.0, 1e9, polarization="all").tolist() == [2, 0, 0, 2]


def test_a_plan_forecasts_and_runs_it(device):
    calls = []
    box = shapes.box((1, 1, 1))
    options = {"device": device, "progress": lambda *stage: calls.append(stage)}
    forecast = sarcl.plan(sarcl.rcs, box, np.linspace(0, 6, 50), 0.3, FREQUENCY, **options)
    assert not calls and 0 < forecast.seconds < 10
    assert 0 < forecast.predicted_error < 1e-6 and len(forecast.error_terms) == 3
    s = forecast.run()
    assert np.array_equal(s, sarcl.rcs(box, np.linspace(0, 6, 50), 0.3, FREQUENCY, device=device))
    assert {stage for stage, _, _ in calls} == {"shadows", "facets"}


@pytest.mark.parametrize(
    ("scene", "n", "options"),
    [
        (sarcl.Scene.points(np.random.default_rng(0).normal(size=(1000, 3))), 8, {}),
        (shapes.plate((1, 1)), 100, {"polarization": "all"}),
        (shapes.box((1, 1, 1)) + shapes.plate((3, 3), position=(0, 0, -0.6)), 8, {"bounces": 2}),
        (shapes.sphere(0.2, facets=2000), 4, {}),
    ],
    ids=["points", "plate", "bounces", "sphere"],
)
def test_bytes_of_a_forecast_are_the_peak_of_its_run_to_a_factor_of_two(scene, n, options):
    frequencies = np.linspace(0.95, 1.05, 16) * 1e9
    forecast = sarcl.plan(sarcl.rcs, scene, np.linspace(0, 6, n), 0.3, frequencies, **options)
    forecast.run()  # fills caches
    tracemalloc.start()
    forecast.run()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak / 2 < forecast.bytes < 2 * peak


def test_facets_too_flat_for_a_curve_cause_a_warning():
    with pytest.warns(sarcl.SarclWarning, match="mesh too coarse"):
        sarcl.rcs(shapes.sphere(1.0, facets=320), np.linspace(0, 6, 8), 0.1, 3e9)


def test_a_missed_tolerance_keeps_the_numbers(monkeypatch):
    box = shapes.box((1, 1, 1)) + shapes.box((0.2, 0.2, 0.2)).moved((0, 0, 1.2))
    exact = sarcl.rcs(box, 0.4, 0.9, FREQUENCY)
    from sarcl.scattering.facets import FacetSet

    light = FacetSet.light
    monkeypatch.setattr(FacetSet, "light", lambda *args: type(one := light(*args))(one.index, one.share, 0 * one.mean))
    with pytest.raises(sarcl.ToleranceMissed, match=r"this error's \.values") as missed:
        sarcl.rcs(box, 0.4, 0.9, FREQUENCY, check=True, tolerance=1e-4)
    assert missed.value.values.shape == () and missed.value.values != exact


POINT, BOX = sarcl.Scene.points([[0.0, 0, 0]]), shapes.box((1, 1, 1))
BAD = {
    "degrees": (lambda: sarcl.rcs(POINT, 0, 45, 1e9), ValueError, "elevation reaches 45 rad, .*give np.radians"),
    "azimuth in degrees": (lambda: sarcl.rcs(POINT, [0, 359.0], 0, 1e9), ValueError, "azimuth reaches 359 rad"),
    "receiver in degrees": (
        lambda: sarcl.rcs(POINT, 0, 0, 1e9, receiver=(0, 30)), ValueError, "receiver elevation reaches 30"
    ),
    "one receiver angle": (lambda: sarcl.rcs(POINT, 0, 0, 1e9, receiver=0.3), ValueError, "give .azimuth, elevation"),
    "shapes": (lambda: sarcl.rcs(POINT, [0, 1], [0, 0, 0], 1e9), ValueError, r"\(2,\), \(3,\), which do not broadcast"),
    "no frequency": (lambda: sarcl.rcs(POINT, 0, 0, 0), ValueError, "frequency reaches 0 Hz"),
    "table of frequencies": (lambda: sarcl.rcs(POINT, 0, 0, [[1e9]]), ValueError, r"frequency has shape \(1, 1\)"),
    "nothing": (lambda: sarcl.rcs(POINT, [], 0, 1e9), ValueError, "no directions"),
    "nan": (lambda: sarcl.rcs(POINT, [0, np.nan], 0, 1e9), ValueError, r"azimuth\[1\]"),
    "no scene": (lambda: sarcl.rcs(BOX.triangles, 0, 0, 1e9), TypeError, "scene is a ndarray"),
    "rough": (lambda: sarcl.rcs(shapes.box((1, 1, 1), roughness=0.1), 0, 0, 1e9), ValueError, "use echo"),
    "moss": (
        lambda: sarcl.rcs(shapes.plate((1, 1), material=sarcl.Material(4.0, diagram="cos")), 0, 0, 1e9),
        ValueError, "facet 0 has a random echo",
    ),
    "terrain": (
        lambda: sarcl.rcs(
            sarcl.Scene.from_heights([0, 1, 2], [0, 1, 2], np.zeros((3, 3)), point_roughness=0.1), 0, 1, 1e9
        ),
        ValueError, r"scene.realized\(seed\) first",
    ),
    "polarization": (lambda: sarcl.rcs(POINT, 0, 0, 1e9, polarization="RR"), ValueError, "polarization is 'RR'"),
    "tolerance": (lambda: sarcl.rcs(BOX, 0, 0, 1e9, tolerance=1e-10), ValueError, "lit parts; the best here"),
    "no option": (lambda: sarcl.rcs(POINT, 0, 0, 1e9, method="direct"), TypeError, "unknown option .method"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_what_does_not_fit_is_named(name):
    call, kind, message = BAD[name]
    with pytest.raises(kind, match=message):
        call()
