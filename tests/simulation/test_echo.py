"""Echoes: the exact sum of the same model, within the tolerance asked for, and the laws it must obey."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.cases import thinned

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.numerics.pulse_geometry import PulseGeometry
from sarcl.reference.equations import point_echo as exact_echo

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=600e6, duration=2e-6)


def circle(distance=10e3, n_pulses=9, **options):
    return sarcl.Trajectory.circle(radius=0.8 * distance, height=0.6 * distance, arc=0.07, n_pulses=n_pulses, **options)


def cloud(n=500, extent=15.0, seed=0):
    random = np.random.default_rng(seed)
    amplitudes = random.standard_normal(n) + 1j * random.standard_normal(n)
    return sarcl.Scene.points(random.uniform(-extent, extent, (n, 3)), amplitudes)


def frequencies(raw):
    return raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)


def echo_error(raw, positions, amplitudes):
    """L2 error of all samples against the exact sum; amplitudes (n,) or a function of (tx, rx)."""
    wrong = right = 0.0
    for p in range(raw.n_rows):
        a = amplitudes(raw.tx[p], raw.rx[p]) if callable(amplitudes) else amplitudes
        wanted = exact_echo(positions, a, frequencies(raw), raw.tx[p], raw.rx[p], raw.reference_range[p])
        wrong += np.linalg.norm(raw.samples[p] - wanted) ** 2
        right += np.linalg.norm(wanted) ** 2
    return np.sqrt(wrong / right)


@pytest.mark.parametrize(
    "bistatic, distance, tolerance",
    thinned(
        [(False, 50.0), (True, 10e3), (False, 800e3), (True, 50.0), (False, 10e3), (True, 800e3)],
        [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6],
        every=6,
        slow=(1, 2),  # with the quick ones: every distance, and every kind of track, with every tolerance
    ),
)
def test_error_is_below_prediction_and_prediction_below_tolerance(device, distance, tolerance, bistatic):
    scene = cloud()
    receiver = circle(1.2 * distance, start=0.2) if bistatic else None
    raw = sarcl.echo(scene, CHIRP, circle(distance), receiver=receiver, tolerance=tolerance, device=device)
    assert echo_error(raw, scene.positions, scene.amplitudes) <= raw.report.predicted_error <= tolerance


def test_a_square_metre_of_metal_at_normal_incidence_has_41_101_dbsm(device):
    plate = sarcl.Scene.from_heights([-0.5, 0.5], [-0.5, 0.5], np.zeros((2, 2)))
    above = sarcl.Trajectory([0.0], [[0, 0, 2e6]])
    raw = sarcl.echo(plate, CHIRP, above, max_edge=0.02, shadows=False, tolerance=1e-5, device=device)
    # 4 pi A^2/lambda^2 at 9.6 GHz, to 1e-3 dB; amplitude is taken at the carrier
    assert 20 * np.log10(np.abs(raw.samples).mean()) == pytest.approx(41.101, abs=1e-3)


def test_a_unit_point_under_a_chirp_gives_modulus_one(device):
    raw = sarcl.echo(sarcl.Scene.points([[3, 4, 5]]), CHIRP, circle(), tolerance=1e-5, device=device)
    assert np.abs(np.abs(raw.samples) - 1).max() < 1e-4
    # f_n = fc - B/2 + (n + 1/2) df with n_samples df = B
    assert raw.frequency[0] == pytest.approx(9.3e9 + raw.frequency_step[0] / 2, abs=1)
    assert raw.n_samples * raw.frequency_step[0] == pytest.approx(600e6)


def test_the_reference_point_has_zero_phase(every_device):
    point = [3.0, -2.0, 1.0]
    raw = sarcl.echo(sarcl.Scene.points([point]), CHIRP, circle(), reference=point, tolerance=1e-5, device=every_device)
    assert np.abs(raw.samples - 1).max() < 1e-4


def test_phase_falls_with_delay_as_exp_minus_j_2_pi_f_tau(device):
    track = sarcl.Trajectory([0.0], [[10e3, 0, 0]])
    raw = sarcl.echo(
        sarcl.Scene.points([[-1.0, 0, 0]]), CHIRP, track, reference=(0, 0, 0), tolerance=1e-6, device=device
    )
    # one metre farther: two metres of path
    wanted = np.exp(-2j * np.pi * frequencies(raw) * 2 / SPEED_OF_LIGHT)
    assert np.abs(raw.samples[0] - wanted).max() < 1e-4


def test_tone_and_sampled_pulses_carry_their_matched_spectrum(device):
    tone = sarcl.Waveform.tone(center=9.6e9, duration=20e-9)
    signal = np.exp(1j * np.pi * np.linspace(-1, 1, 400) ** 2 * 40) * np.hanning(400)
    for waveform in (tone, sarcl.Waveform.sampled(signal, 400e6, 9.6e9)):
        scene = sarcl.Scene.points([[0, 0, 0]])
        raw = sarcl.echo(scene, waveform, circle(), tolerance=1e-5, device=device)
        wanted = waveform.matched_spectrum(frequencies(raw))
        assert np.abs(raw.samples - wanted).max() < 1e-4


@pytest.mark.costly
def test_backprojection_is_the_adjoint_of_echo(device):
    random = np.random.default_rng(2)
    positions = random.uniform(-12, 12, (400, 3))
    x = random.standard_normal(400) + 1j * random.standard_normal(400)
    options = {"tolerance": 1e-6, "device": device}
    for receiver in (None, circle(8e3, start=0.3)):
        echoes = sarcl.echo(sarcl.Scene.points(positions, x), CHIRP, circle(), receiver=receiver, **options)
        y = random.standard_normal(echoes.samples.shape) + 1j * random.standard_normal(echoes.samples.shape)
        back = sarcl.PhaseHistory(
            y.astype(np.complex64),
            frequency=echoes.frequency,
            frequency_step=echoes.frequency_step,
            tx=echoes.tx,
            rx=echoes.rx,
            reference_range=echoes.reference_range,
        )
        image = sarcl.backproject(back, sarcl.ImageGrid.points(positions), **options)
        forward, backward = np.vdot(y, echoes.samples), np.vdot(image.data, x)
        # the image is the adjoint of the echoes: |<Ax, y> - <x, A'y>| <= 1e-5 |Ax| |y|
        assert abs(forward - backward) <= 1e-5 * np.linalg.norm(echoes.samples) * np.linalg.norm(y)


def test_scatterers_outside_the_range_window_are_gated_out_and_counted(device):
    track = sarcl.Trajectory([0.0, 1.0], [[10e3, 0, 0], [10e3, 1, 0]])
    scene = sarcl.Scene.points([[0.0, 0, 0], [-30.0, 0, 0], [40.0, 0, 0]])
    raw = sarcl.echo(scene, CHIRP, track, reference=(0, 0, 0), range_window=(-20, 35), tolerance=1e-4, device=device)
    assert np.abs(raw.samples).max() == pytest.approx(2, abs=1e-3)  # the points at 0 and at +30 m
    only = sarcl.echo(
        sarcl.Scene.points([[0.0, 0, 0], [-30.0, 0, 0]]),
        CHIRP, track, reference=(0, 0, 0), range_window=(-20, 35), tolerance=1e-4, device=device,
    )  # fmt: skip
    assert np.abs(raw.samples - only.samples).max() < 1e-3


def test_points_outside_the_window_are_counted_one_by_one(device):
    track = sarcl.Trajectory.line(start=(8e3, 0, 6e3), velocity=(0, 1, 0), prf=1, n_pulses=2)
    for n, outside in ((300, 44), (257, 256)):
        positions = np.zeros((n, 3))
        positions[:outside, 0] = 100
        for skip in (True, False):
            options = {"reference": (0, 0, 0), "range_window": (-20, 20), "skip": skip, "device": device}
            report = sarcl.echo(sarcl.Scene.points(positions), CHIRP, track, **options).report
            assert report.contributions_skipped["range window"] == 2 * outside
            assert report.contributions_done == 2 * (n - outside)
    both_sides = sarcl.Scene.points([[100.0, 0, 0], [-100.0, 0, 0]])
    with pytest.raises(ValueError, match="every scatterer is outside"):
        sarcl.echo(both_sides, CHIRP, track, **options)


def test_a_million_equal_echoes_add_up_within_tolerance(device):
    if device.info.vector_width == 1:
        pytest.skip("minutes with one lane on a CPU; sums are the same code")
    track = circle(n_pulses=1)
    for tolerance in (1e-3, 1e-5):
        raw = sarcl.echo(
            sarcl.Scene.points(np.tile([[1.0, 2, 3]], (1_000_000, 1)), 0.1),
            CHIRP, track, reference=(0, 0, 0), range_window=(-10, 10), tolerance=tolerance, device=device,
        )  # fmt: skip
        assert echo_error(raw, np.array([[1.0, 2, 3]]), np.array([1e5])) <= tolerance


def test_default_window_holds_the_scene(device):
    scene = cloud(extent=80.0)
    raw = sarcl.echo(scene, CHIRP, circle(), device=device)
    assert raw.report.contributions_skipped["range window"] == 0
    assert raw.swath[0] >= 2 * 80 * 0.8
    assert echo_error(raw, scene.positions, scene.amplitudes) <= 1e-3


@pytest.mark.filterwarnings("ignore:mesh too coarse")
@pytest.mark.costly
def test_the_back_of_a_body_is_dark(device):
    import trimesh

    ball = sarcl.Scene.from_mesh(trimesh.creation.icosphere(subdivisions=4, radius=3.0))
    raw = sarcl.echo(ball, CHIRP, circle(), device=device)
    delay, signal = raw.time_signal(oversample=4)
    power = (np.abs(signal) ** 2).sum(axis=0)
    depth = delay * SPEED_OF_LIGHT / 2
    # the ball's centre is the reference: everything lit lies before it, 0 to 3 m, to a resolution cell
    assert power[depth > 0.5].sum() < 0.02 * power.sum()
    assert power[(depth > -3.5) & (depth < 0.5)].sum() > 0.9 * power.sum()


@pytest.mark.costly
def test_random_heights_follow_the_seed_and_nothing_else(device):
    axis = np.linspace(-5, 5, 30)
    ground = sarcl.Scene.from_heights(axis, axis, np.zeros((30, 30)), roughness=0.05)
    first = sarcl.echo(ground, CHIRP, circle(), seed=1, device=device)
    again = sarcl.echo(ground, CHIRP, circle(), seed=1, max_bytes=2e6, device=device)
    other = sarcl.echo(ground, CHIRP, circle(), seed=2, device=device)
    norm = np.linalg.norm(first.samples)
    assert np.linalg.norm(first.samples - again.samples) <= 1e-6 * norm
    assert np.linalg.norm(first.samples - other.samples) > 0.5 * norm
    assert first.report.seed == 1


def test_random_heights_are_normal_and_depend_on_place_and_seed_alone():
    from sarcl.base.counter_rng import gaussian as random_heights

    random = np.random.default_rng(0)
    places = random.uniform(-100, 100, (200_000, 3))
    heights = random_heights(places, 3)
    # four standard errors of mean, variance and fourth moment, and of the correlation with another seed
    error = 4 / np.sqrt(len(places))
    assert abs(heights.mean()) < error
    assert abs(heights.var() - 1) < error * np.sqrt(2)
    assert abs((heights**4).mean() - 3) < error * np.sqrt(96)
    assert abs((heights * random_heights(places, 4)).mean()) < error
    assert abs((heights[1:] * heights[:-1]).mean()) < error
    assert np.array_equal(random_heights(places[::-1], 3)[::-1], heights)


def test_a_black_facet_leaves_the_rest_of_a_rough_scene_as_it_was(device):
    axis = np.linspace(-5, 5, 30)
    ground = sarcl.Scene.from_heights(axis, axis, np.zeros((30, 30)), roughness=0.05)
    black = sarcl.Scene.facets([[[0, 0, 1], [0.1, 0, 1], [0, 0.1, 1]]], material=0.0)
    options = {"reference": (0, 0, 0), "range_window": (-10, 10), "shadows": False, "device": device}
    alone = sarcl.echo(ground, CHIRP, circle(), **options)
    beside = sarcl.echo(black + ground, CHIRP, circle(), **options)
    assert np.linalg.norm(alone.samples - beside.samples) <= 1e-6 * np.linalg.norm(alone.samples)


def test_facets_are_cut_below_half_a_resolution_cell():
    axis = np.array([-4.0, 4.0])
    flat = sarcl.Scene.from_heights(axis, axis, np.zeros((2, 2)))
    raw = sarcl.echo(flat, CHIRP, circle())
    # 0.25 m in range, 0.223 m across (0.07 rad): edges of at most 0.11 m make at least 64/0.0061 facets
    cell = SPEED_OF_LIGHT / (2 * 9.6e9 * 0.07 * 0.8) / 2
    pairs = raw.report.contributions_done + sum(raw.report.contributions_skipped.values())
    assert pairs / 9 >= 2 * 64 / cell**2


def test_memory_limit_does_not_change_the_echoes(device):
    scene = cloud(3000)
    whole = sarcl.echo(scene, CHIRP, circle(n_pulses=50), device=device)
    parts = sarcl.echo(scene, CHIRP, circle(n_pulses=50), max_bytes=1e6, device=device)
    assert np.linalg.norm(parts.samples - whole.samples) <= 1e-6 * np.linalg.norm(whole.samples)


@pytest.mark.costly
def test_one_pulse_one_point_and_points_with_facets_work(device):
    one = sarcl.Trajectory([0.0], [[8e3, 0, 6e3]])
    both = sarcl.Scene.points([[0, 0, 2]]) + sarcl.Scene.from_heights([-1, 1], [-1, 1], np.zeros((2, 2)))
    assert np.isfinite(sarcl.echo(both, CHIRP, one, device=device).samples).all()
    single = sarcl.echo(sarcl.Scene.points([[0, 0, 2]]), CHIRP, one, device=device)
    delay, signal = single.time_signal()
    assert abs(delay[np.argmax(np.abs(signal[0]))]) < 1e-9


def test_an_antenna_on_a_scatterer_is_finite(device):
    scene = cloud(20)
    track = sarcl.Trajectory([0.0], scene.positions[:1])
    raw = sarcl.echo(scene, CHIRP, track, tolerance=1e-4, device=device)
    assert echo_error(raw, scene.positions, scene.amplitudes) <= 1e-4


def test_points_and_facets_together_keep_the_tolerance(device):
    random = np.random.default_rng(5)
    triangles = random.uniform(-10, 10, (300, 1, 3)) + random.uniform(-0.02, 0.02, (300, 3, 3))
    both = cloud(200) + sarcl.Scene.facets(triangles)
    report = sarcl.echo(both, CHIRP, circle(), tolerance=1e-3, shadows=False, check=True, device=device).report
    assert report.measured_error <= report.predicted_error <= 1e-3


def test_measured_error_is_what_the_report_says(device):
    report = sarcl.echo(cloud(), CHIRP, circle(), tolerance=1e-3, check=True, device=device).report
    assert 0 < report.measured_error <= report.predicted_error <= 1e-3


BAD = {
    "polarization": ({"polarization": "HX"}, "'HH', 'HV', 'VH', 'VV'"),
    "tolerance": ({"tolerance": 1e-8}, "best here is 1"),
    "receiver length": ({"receiver": circle(n_pulses=3)}, "receiver has 3 positions but track has 9"),
    "window empty": ({"range_window": (5, 5)}, "near must be less than far"),
    "window shape": ({"range_window": 5}, "give \\(near, far\\)"),
    "window misses everything": ({"range_window": (100, 200)}, "every scatterer is outside"),
    "reference": ({"reference": (0, np.nan, 0)}, r"reference\[1\] is nan"),
    "skip": ({"skip": {"fog"}}, "facing away"),
    "max_bytes": ({"max_bytes": -1}, "max_bytes is -1"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_options_say_what_was_wanted(name):
    options, message = BAD[name]
    with pytest.raises(ValueError, match=message):
        sarcl.echo(cloud(), CHIRP, circle(), **options)


def test_a_scene_whose_facets_all_face_away_is_an_error():
    below = sarcl.Trajectory([0.0], [[0, 0, -5e3]])
    ground = sarcl.Scene.from_heights([-1, 1], [-1, 1], np.zeros((2, 2)))
    with pytest.raises(ValueError, match="nothing is left to reflect: facing away"):
        sarcl.echo(sarcl.Scene.facets(ground.triangles, two_sided=False), CHIRP, below)


def test_antennas_inside_a_box_have_distance_zero():
    inside = PulseGeometry(np.zeros((1, 3)), np.zeros((1, 3)))
    assert inside.distance(np.array([[-1.0] * 3, [1.0] * 3])) == 0
    assert inside.distance(np.array([[3.0, 0, 0], [4.0, 1, 1]])) == 3


def test_wrong_kinds_of_argument_are_named():
    with pytest.raises(TypeError, match=r"track\[0\] is a int; wanted a sarcl\.Trajectory"):
        sarcl.echo(cloud(), CHIRP, [1, 2, 3])
    with pytest.raises(TypeError, match=r"receiver is a int; wanted a sarcl\.Trajectory"):
        sarcl.echo(cloud(), CHIRP, circle(), receiver=3)
    with pytest.raises(ValueError, match="seed is -1"):
        sarcl.echo(cloud(), CHIRP, circle(), seed=-1)


def test_amplitudes_beyond_complex64_and_endless_windows_are_refused():
    with pytest.raises(ValueError, match=r"amplitudes reach 1e\+38"):
        sarcl.echo(sarcl.Scene.points([[0, 0, 0]], 1e38), CHIRP, circle())
    with pytest.raises(MemoryError, match="narrow range_window"):
        wide = sarcl.Waveform.chirp(center=9e9, bandwidth=9e9, duration=1e-6)
        sarcl.echo(cloud(), wide, circle(), range_window=(-4.9e7, 4.9e7))
    with pytest.raises(ValueError, match=r"range_window reaches 1e\+15 m on .* 1e\+08 m at most: give \(near, far\)"):
        sarcl.echo(cloud(), CHIRP, circle(), range_window=(-1e15, 1e15))
