"""What random legal tasks (test_legal_tasks.py) have found to be wrong: each is right now, or refused in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import image_error, noise_on, planned_within, straight

import sarcl
from sarcl.base.tolerances import reachable
from sarcl.imaging import choose_method
from sarcl.reference.polar_format import polar_format as plane_waves

GRID = sarcl.ImageGrid.plane(shape=(5, 4), spacing=0.4)


@pytest.mark.filterwarnings("ignore:the grid reaches")
def test_polar_format_takes_reference_ranges_below_zero():
    raw = noise_on(straight(6, distance=700.0), n_samples=24)
    raw = replace(raw, reference_range=raw.reference_range - 2500)
    assert raw.reference_range.max() < -700
    image = sarcl.polar_format(raw, GRID, tolerance=1e-4, check=False)
    wanted, scale = plane_waves(raw, GRID.positions.reshape(-1, 3), GRID.at(2, 2))
    assert np.linalg.norm(np.ravel(image.data) - wanted) <= 1e-4 * max(scale, np.linalg.norm(wanted))


def test_echoes_with_noise_are_focused_by_every_method():
    raw = noise_on(straight(64, aperture=10.0), n_samples=48, time=np.linspace(0, 0.1, 64))
    noisy = sarcl.add_noise(raw, variance=0.5, seed=3)
    loaded = replace(noisy, samples=np.asarray(noisy.samples[:]))
    for focus in (
        lambda raw: sarcl.polar_format(raw, GRID, check=False),
        lambda raw: sarcl.range_doppler(raw, side="right", check=False),
    ):
        assert np.array_equal(focus(noisy).data, focus(loaded).data)


@pytest.mark.parametrize("shape", [(1,), (300,)])
def test_sub_apertures_of_one_place_alone(shape):
    raw = noise_on(straight(64, aperture=3.0), n_samples=32)
    image = sarcl.backproject(
        raw, sarcl.ImageGrid.points(np.zeros((*shape, 3))), tolerance=1e-2, method="factorized", check=False
    )
    assert image_error(image, raw, most=20) <= image.report.predicted_error <= 1e-2


@pytest.mark.parametrize("method", ["direct", "factorized"])
@pytest.mark.parametrize("spacing", [30.0, 1e3, 13e3])
def test_pixels_far_apart_lie_in_a_narrow_beam_or_outside(spacing, method, device):
    # tiles of 32 such pixels are far larger than the distance: float32 did not tell the sides of the beam's edge
    tx = 303.0 * np.stack([-0.8 + 0 * (t := np.linspace(-0.2, 0.2, 8)), t, 0.6 + 0 * t], axis=1)
    raw = noise_on(tx, center=17e9, bandwidth=6e5, n_samples=64)
    grid = sarcl.ImageGrid.plane(shape=(3, 3), spacing=spacing)
    for angle in (0.003, 0.05, 1.0):
        try:
            image = sarcl.backproject(
                raw, grid, wrap=True, beam=angle, tolerance=1e-2, method=method, check=False, device=device
            )
        except sarcl.ToleranceUnreachable as exc:
            assert "beam is narrower than float32 resolves" in str(exc) or method == "factorized"
            assert method == "factorized" or not device.info.fp64
            continue
        error = image_error(image, raw, wrap=True, beam=(angle, -tx / np.linalg.norm(tx, axis=1)[:, None]))
        assert error <= image.report.predicted_error <= 1e-2, angle


def test_a_beam_that_a_short_track_sees_far_from_its_peak_is_refused_or_right():
    # a track of 14 mm sees each point at one aspect, where the beam's slope is steep: 0.32 was measured at 0.11
    track = sarcl.Trajectory.line(start=(-95, -0.007, 95), velocity=(0, 1, 0), prf=437.0, n_pulses=6)
    track = sarcl.pointing.stripmap(track, np.pi / 4, squint=-0.3)
    antenna = sarcl.Antenna.gaussian(width=(0.038, 0.5))
    chirp = sarcl.Waveform.chirp(center=3.6e9, bandwidth=21e6, duration=3e-5)
    random = np.random.default_rng(0)
    refused = 0
    for seed in range(3):
        places = random.uniform(-1, 1, (9, 3)) * (7, 10, 0)
        scene = sarcl.Scene.points(places, random.normal(size=9) + 1j * random.normal(size=9))
        for tolerance in (0.1, 0.02):
            try:
                sarcl.spectral_echo(scene, chirp, track, antenna=antenna, tolerance=tolerance, check=True)
            except sarcl.ToleranceUnreachable as exc:
                refused += 1
                assert "use echo" in str(exc) or "aim at the scene" in str(exc), seed
    assert refused


def test_points_of_no_amplitude_are_told_as_such_with_a_radar_and_an_antenna_without_a_beam():
    track = sarcl.Trajectory.line(start=(-700, -5, 700), velocity=(0, 10, 0), prf=16.0, n_pulses=4)
    chirp = sarcl.Waveform.chirp(center=1e10, bandwidth=1e8, duration=1e-6)
    options = {"radar": sarcl.Radar(power=100.0), "antenna": sarcl.Antenna.isotropic(gain_db=3.0)}
    nothing = sarcl.Scene.points([[0.0, 0, 0]], 0.0)
    assert not sarcl.echo(nothing, chirp, track, skip=False, **options).samples.any()
    with pytest.raises(ValueError, match="zero reflectivity"):
        sarcl.echo(nothing, chirp, track, **options)
    for antenna in (None, options["antenna"]):
        with pytest.raises(ValueError, match=r"polarization is \('HV',\), in which points send back nothing"):
            sarcl.echo(
                sarcl.Scene.points([[0.0, 0, 0]]), chirp, track, polarization="HV", **{**options, "antenna": antenna}
            )


def test_spectral_echo_refuses_tracks_within_a_few_wavelengths():
    track = sarcl.Trajectory.line(start=(-3, -0.5, 3), velocity=(0, 1, 0), prf=8.0, n_pulses=8)
    chirp = sarcl.Waveform.chirp(center=2e7, bandwidth=1e6, duration=1e-4)
    with pytest.raises(ValueError, match=r"a Fresnel zone is so wide that spectral_echo would continue.*use echo"):
        sarcl.spectral_echo(sarcl.Scene.points([[0.0, 0, 0]]), chirp, track)


def test_cross_polarised_echoes_that_are_rounding_alone_are_refused():
    track = sarcl.Trajectory.line(start=(-700, -5, 700), velocity=(0, 10, 0), prf=16.0, n_pulses=4)
    chirp = sarcl.Waveform.chirp(center=1e10, bandwidth=1e8, duration=1e-6)
    plate = sarcl.shapes.plate((0.02, 0.03), rotation=(0.3, -0.7, 0.1))
    with pytest.raises(
        sarcl.ToleranceUnreachable, match=r"in HV, in which these facets send back \d+ dB less than in HH"
    ):
        sarcl.echo(plate, chirp, track, polarization="HV", vertical=(1, -0.7, 0.2))
    both = sarcl.echo(plate, chirp, track, polarization=["HH", "HV"], vertical=(1, -0.7, 0.2), check=True)
    assert np.abs(both.select(polarization="HV").samples).max() < 1e-5 * np.abs(both.samples).max()
    away = sarcl.Trajectory.line(start=(300, -5, 900), velocity=(0, 10, 0), prf=16.0, n_pulses=4)  # bistatic: not zero
    report = sarcl.echo(
        plate, chirp, track, receiver=away, polarization="HV", vertical=(1, -0.7, 0.2), check=True
    ).report
    assert report.measured_error <= report.predicted_error <= 1e-3


def test_a_peak_without_pixels_beside_its_cut_is_refused():
    """Interpolation needs 13 pixels above and below the peak, and the image has 13 and 12: nowhere on a cut along
    columns is there a value, however short it is."""
    grid = sarcl.ImageGrid.plane(shape=(27, 86), spacing=1.0)
    response = np.outer(np.sinc(0.5 * (np.arange(27) - 13)), np.sinc(0.74 * (np.arange(86) - 43)))
    image = sarcl.Image(response.astype(np.complex64), grid, frequency=1e6, tx=np.array([-1000.0, 0, 1000]))
    with pytest.raises(ValueError, match=r"in range the image holds less than 3 IRW on each side of the peak"):
        sarcl.measure(image)


@pytest.mark.slow
def test_far_off_broadside_range_doppler_keeps_its_error():
    """At 44 degrees from broadside the phases of the secondary range compression are 150 cycles at the ends of the
    band: in float32 rounded by up to 1e-4 rad, of which the predicted error has a tenth."""
    wavelength, n = 299792458 / 6.4e9, 11
    y = 0.19 * wavelength * (np.arange(n) - n / 2)
    tx = np.stack([np.full(n, -14e3), y, np.full(n, 14e3)], axis=1)
    random = np.random.default_rng(1)
    raw = sarcl.PhaseHistory(
        (random.normal(size=(n, 16)) + 1j * random.normal(size=(n, 16))).astype(np.complex64),
        frequency=6.304e9, frequency_step=12e6, tx=tx, reference_range=np.linalg.norm(tx, axis=1)[5], time=y / 100,
    )  # fmt: skip
    doppler = -0.69 * 2 * 100 / wavelength
    report = sarcl.range_doppler(raw, side="left", doppler=doppler, tolerance=3e-5, check=True).report
    assert report.measured_error <= report.predicted_error <= 3e-5


def test_bands_too_wide_for_their_squint_are_refused_by_range_doppler():
    """The Doppler frequency of 1.089 GHz at 61 degrees is one that no wave of 0.9 GHz has: such bins were left out."""
    wavelength, n = 0.3, 11
    y = 0.4 * wavelength * (np.arange(n) - n / 2)
    tx = np.stack([np.full(n, -19e3), y, np.full(n, 3e3)], axis=1)
    raw = sarcl.PhaseHistory(
        np.ones((n, 64), np.complex64), frequency=0.9e9, frequency_step=3e6, tx=tx, time=y / 100,
        reference_range=np.linalg.norm(tx, axis=1)[5],
    )  # fmt: skip
    with pytest.raises(ValueError, match=r"too near to the direction of flight.* 0\.9 to 1\.089 GHz; use backproject"):
        sarcl.range_doppler(raw, side="left", doppler=-0.85 * 2 * 100 / wavelength, tolerance=0.05)


def test_the_largest_modulus_of_a_sampled_spectrum_is_1():
    """Between the points of an FFT 8 times as fine as the signal it was up to 1.02."""
    random = np.random.default_rng(0)
    for n in (1, 2, 3, 12, 31):
        signal = random.normal(size=n) + 1j * random.normal(size=n)
        pulse = sarcl.Waveform.sampled(signal, rate=1e8, center=1e10)
        f = pulse.center + 1e8 * np.linspace(-0.5, 0.5, 256 * n)
        largest = np.abs(pulse.pulse_spectrum(f)).max()
        assert 1 - 3e-5 < largest < 1 + 1e-12
        energy = np.abs(np.fft.fft(signal / np.abs(signal).max(), 4096 * n)).max() ** 2 / 1e16
        assert pulse.peak_energy_density == pytest.approx(energy, rel=1e-6)
    tone = sarcl.Waveform.sampled(np.exp(2j * np.pi * 0.3 * np.arange(50)), rate=1e8, center=1e10)
    assert tone.peak_energy_density == pytest.approx((50 / 1e8) ** 2, rel=1e-12)


@pytest.mark.slow
def test_gains_in_tiles_that_reach_far_beyond_the_grid_keep_their_error():
    """Columns 616 m apart, of which the grid has one: a tile has 32, and its middle lies 9.5 km from the pixels. Seen
    from 15 m, their directions are differences of such positions in float32: off by 2e-5 rad."""
    tx = np.linspace([-11.4, -5.3, 8.6], [-11.0, -4.8, 11.1], 3)
    raw = noise_on(tx, n_samples=6)
    grid = sarcl.ImageGrid.plane(shape=(4, 1), spacing=(2, 616))
    beam = sarcl.Antenna.gaussian(width=(0.084, 1.8), two_way=True)
    with pytest.raises(sarcl.ToleranceUnreachable, match="gains of the antenna have") as said:
        sarcl.backproject(raw, grid, beam=beam, tolerance=1e-5, wrap=True)
    assert said.value.best > 1e-4  # which is measured with a larger tolerance
    report = sarcl.backproject(raw, grid, beam=beam, tolerance=0.02, wrap=True, check=True).report
    assert report.measured_error <= report.predicted_error <= 0.02
    near = replace(grid, spacing=(2, 0.5))
    report = sarcl.backproject(raw, near, beam=beam, tolerance=1e-4, wrap=True, check=True).report
    assert report.measured_error <= report.predicted_error <= 1e-4


def test_needles_have_the_normals_of_their_corners():
    """Facets 3000 times as long as wide, listed from their sharp corner: two long edges in float32 leave their normal
    off by 2e-4 rad, the short edge does not."""
    random = np.random.default_rng(2)
    along = 0.03 * random.normal(size=(20, 3))
    across = np.cross(along, [-0.7, 0.1, 0.7]) / 3000  # so that they face the track
    scene = sarcl.Scene.facets(np.stack([0 * along, along - across, along + across], axis=1))
    track = sarcl.Trajectory.line(start=(-4000, -5, 6000), velocity=(0, 10, 0), prf=4.0, n_pulses=4)
    chirp = sarcl.Waveform.chirp(center=2e9, bandwidth=6e7, duration=6e-6)
    report = sarcl.echo(scene, chirp, track, tolerance=1e-5, check=True).report
    assert report.measured_error <= report.predicted_error <= 1e-5


def test_a_receiver_that_its_polynomial_continues_faster_than_light_is_refused():
    """The cubic through these pulses of 3 ms is at 1e9 m/s when echoes arrive, 60 ms later: positions overflowed."""
    chirp = sarcl.Waveform.chirp(center=1e9, bandwidth=1e6, duration=1e-4)
    positions = np.array([[-6e6, y, 6.5e6] for y in (0.0, 5, 10, 15)])
    track = sarcl.Trajectory([0, 1e-3, 1.01e-3, 3e-3], positions)
    with pytest.raises(ValueError, match=r"would move at .* m/s when echoes arrive.* 4 pulses ends at 0\.003 s"):
        sarcl.stop_and_go.stop_and_go_error(track, np.zeros((1, 3)), chirp)
    speed = 0.4 * 299792458.0  # away from the point: c tau = 2 r + speed tau
    away = sarcl.Trajectory([2e9], [[0, 0, 3e5]], velocities=[[0, 0, speed]])
    found = sarcl.stop_and_go.stop_and_go_error(away, np.zeros((1, 3)), chirp)
    assert found.flight[0, 0] == pytest.approx(3e5 * (1 / (1 - 0.4) - 1), rel=1e-4)  # times of 2e9 s have 2e-7 s


def test_a_tolerance_that_cannot_be_asked_for_is_not_named_as_the_best():
    """The beam looks aside, 400 dB below its peak: 1e14 was named as the best tolerance, which nobody may ask for."""
    raw = noise_on(straight(6, distance=700.0), n_samples=24)
    beam = sarcl.Antenna.gaussian(width=(0.1, 0.1)), raw.tx.mean(axis=0) * (-1, 1, -1) + (0, 300, 0)
    with pytest.raises(sarcl.ToleranceUnreachable, match=r"gains of the antenna have .*; aim it at the grid") as said:
        sarcl.backproject(raw, GRID, beam=beam, tolerance=0.1)
    assert said.value.best is None

    def needs(least):
        def plan(tolerance):
            if tolerance < least:
                raise sarcl.ToleranceUnreachable(tolerance, None, "it")

        return plan

    assert reachable(needs(0.4), 0.02, choose_method.STEP_OF_SEARCH) is None  # 0.46 was named for sub-apertures
    assert 0.22 <= reachable(needs(0.22), 0.02, choose_method.STEP_OF_SEARCH) <= 0.3


def test_refusals_without_a_best_tolerance_have_a_remedy(device):
    raw = noise_on(straight(6, distance=700.0), n_samples=24)
    with pytest.raises(sarcl.ToleranceUnreachable, match=r"method='direct' cannot either: (choose device=|no device)"):
        sarcl.backproject(raw, GRID, tolerance=1e-8, method="factorized", device=device.without_fp64())


def test_facets_refused_for_their_number_are_told_so():
    """Where even the largest pieces were too many, float32 was blamed, whose rounding had not been looked at."""
    track = sarcl.Trajectory.line(start=(-700, -5, 700), velocity=(0, 10, 0), prf=4.0, n_pulses=4)
    chirp = sarcl.Waveform.chirp(center=1e10, bandwidth=1e8, duration=1e-6)
    with pytest.raises(sarcl.ToleranceUnreachable, match="without cutting these facets into more than 1; take a small"):
        planned_within({"facets": 1}, sarcl.echo, sarcl.shapes.plate((0.3, 0.2)), chirp, track).run()


@pytest.mark.slow
def test_an_antenna_that_sees_no_pixel_makes_an_image_of_zero(caplog):
    """As an angle does: it was refused, for the gain of an Image that nobody had given."""
    raw = noise_on(straight(6, distance=700.0), n_samples=24)
    width = np.linspace(-0.01, 0.01, 5)  # 0 beyond it
    table = sarcl.Antenna.table(width, width, np.full((5, 5), 2.0), two_way=True)
    outside = sarcl.ImageGrid.plane(shape=(3, 2), spacing=0.4, center=(3e3, 0, 0))
    aside = sarcl.ImageGrid.points([[0, 0, 0], [3e3, 0, 0]])  # out of the beam; out of the range window
    to_outside = table, np.array([3e3, 0, 0]) - raw.tx.mean(axis=0)
    for grid, beam in ((outside, sarcl.Antenna.isotropic(gain_db=3.0)), (aside, to_outside)):
        caplog.clear()
        image = sarcl.backproject(raw, grid, beam=beam, check=True)
        assert not image.data.any() and np.ptp(image.gain) == 0 < image.gain and not image.normalized().any()
        assert len(caplog.messages) == 1 and "the image is zero; check the grid's center" in caplog.messages[0]


@pytest.mark.parametrize(
    ("rate", "options", "says"),
    [
        (
            2e8,
            {"kind": "compressed"},
            "row 1 would have frequencies from -4.* the band reaches half the bandwidth below",
        ),
        (1e5, {"kind": "dechirped", "beat": "positive", "sweep_rate": -1e12}, "row 1 would .* start= and scene_range="),
    ],
)
def test_time_records_below_zero_hertz_are_refused_in_the_words_of_their_arguments(rate, options, says):
    """frequency[0] was named, which is no argument of from_time."""
    samples, tx = np.ones((2, 16), complex), np.array([[-700, 0, 700], [-700, 1, 700.0]])
    with pytest.raises(ValueError, match=says):
        sarcl.PhaseHistory.from_time(samples, rate=rate, start=1e-6, carrier=[1e8, 5e7], tx=tx, **options)


@pytest.mark.parametrize("tolerance", [3e-2, 1e-3, 1e-4])
def test_errors_that_add_up_in_phase_over_few_rows_are_planned_for(tolerance, device):
    """All rows from one place have the same two samples, which cancel at the pixel, beside noise of their own: errors
    of interpolation are those of one row, times their number. The estimate took them for as random as the noise."""
    n, n_samples = 40, 8
    tx = np.repeat([[-700.0, 20.0, 700.0]], n, axis=0)
    raw = noise_on(tx, n_samples=n_samples, bandwidth=1e9)
    raw = replace(raw, samples=np.where(np.arange(n_samples) % 4, 0.2 * raw.samples, 0))
    cell = 299792458 / 2e9
    for away in np.linspace(0, 1.5, 7):  # in resolution cells, towards the antenna: pixels at places between samples
        place = away * cell * tx[0] / np.linalg.norm(tx[0])
        waves = np.exp(2j * np.pi * away * np.array([-4, 0]) / n_samples)  # of the samples 0 and 4 at the pixel
        common = np.zeros(n_samples, complex)
        common[[0, 4]] = waves.conj() * (1, -1)
        grid = sarcl.ImageGrid.points(np.repeat(place[None], 3, axis=0))
        raw_here = replace(raw, samples=raw.samples + common)
        image = sarcl.backproject(raw_here, grid, tolerance=tolerance, method="direct", check=False, device=device)
        assert image_error(image, raw_here) <= image.report.predicted_error <= tolerance, away


@pytest.mark.parametrize("n_samples", [3, 4, 5])
def test_range_doppler_takes_rows_shorter_than_its_interpolation(n_samples):
    """Rows of fewer samples than an interpolation reads on both sides ended in an IndexError of NumPy."""
    tx = np.stack([np.full(32, -7e3), np.arange(32) - 16.0, np.full(32, 7e3)], axis=1) * [1, 0.05, 1]
    raw = noise_on(tx, n_samples=n_samples, bandwidth=3e8, time=np.arange(32) * 1e-3)
    report = sarcl.range_doppler(raw, side="right", tolerance=1e-2, check=True).report
    assert report.measured_error <= report.predicted_error <= 1e-2


def test_random_heights_of_partly_lit_facets_shift_no_shadow_when_echoes_are_checked():
    """check=True clipped a facet where its random height had moved it: the difference counted as an error."""
    corners = [
        [[0.0102, 0.0014, -0.0073], [-0.0176, 0.0041, -0.0167], [0.0426, -0.016, -0.021]],
        [[0.0029, 0.0092, 0.003], [0.0066, 0.0011, 0.0112], [-0.0273, -0.0103, -0.0124]],
    ]
    scene = sarcl.Scene.facets(corners, roughness=3e-5, two_sided=False)
    chirp = sarcl.Waveform.chirp(center=14.6e9, bandwidth=17e6, duration=3e-6)
    track = sarcl.Trajectory.line(start=(-738, 0, 738), velocity=(0, 1, 0), prf=100, n_pulses=4)
    report = sarcl.echo(scene, chirp, track, tolerance=6e-4, check=True).report
    assert report.plan["partly lit facets"] > 0
    assert report.measured_error <= report.predicted_error <= 6e-4
