"""`measure` on exact images: a float64 sum over pulses and frequencies, no kernel, no float32.

The lobes expected of the exact sum are not quite those of a sinc. Across range every frequency makes its own
sinc, as wide as its wavelength: 6 % of bandwidth spreads them by +-3.1 %, which blurs the outer lobes (ISLR
-10.22 -> -10.33, PSLR -13.26 -> -13.285 dB; `cross_range_cut` is that mean in closed form). Along range the
arc's sagitta, 1 % of the band at 4 degrees, changes PSLR by 0.003 dB. A tenth of band and arc has 1/100 of that.
"""

from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import quick_of

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.numerics.windows import weights
from sarcl.reference.quality import measure as brute_force

N = 128  # pulses, and samples
HALF = 0.8859  # width of sinc^2 at half power
TAYLOR = ("taylor", 35, 5)


class Pass:
    """A spotlight pass about `place`, and the exact image of the points seen from it."""

    def __init__(self, *, distance=10e3, grazing=35, bandwidth=600e6, arc=4, window=None, baseline=(0, 0, 0)):
        self.grazing, self.arc = np.deg2rad(grazing), np.deg2rad(arc)
        angle = self.arc * (np.arange(N) / (N - 1) - 0.5)
        flat, up = np.cos(self.grazing), np.full(N, np.sin(self.grazing))
        self.tx = distance * np.stack([flat * np.cos(angle), flat * np.sin(angle), up], axis=1)
        self.rx = self.tx + np.array(baseline)
        self.frequency, self.bandwidth = 9.6e9, bandwidth
        self.weights = weights(window, N)

    def cells(self, plane):
        """Half-power widths of a uniform aperture on the plane, m, from N df and N dtheta."""
        seen = np.cos(self.grazing)
        across = HALF * SPEED_OF_LIGHT / self.frequency / (2 * self.arc * N / (N - 1) * seen)
        return np.array([HALF * SPEED_OF_LIGHT / (2 * self.bandwidth) / (seen if plane == "ground" else 1), across])

    def path(self, x):
        return sum(np.linalg.norm(x - end[:, None], axis=-1) for end in (self.tx, self.rx))

    def value(self, points):
        """sum_p w_p sum_n w_n a exp(j 2 pi f_n (tau - tau_0)) (n,) of {place: a}, by Horner's rule, 16 terms a step."""
        step = self.bandwidth / N
        first = self.frequency - self.bandwidth / 2 + step / 2

        def part(x):
            out = np.zeros(len(x), np.complex128)
            for place, amplitude in points.items():
                delay = (self.path(x) - self.path(np.array([place]))) / SPEED_OF_LIGHT
                powers = np.ones((17, *delay.shape), np.complex128)
                powers[1:] = np.exp(2j * np.pi * step * delay)
                powers = np.cumprod(powers, axis=0)
                total = np.zeros(delay.shape, np.complex128)
                for terms in self.weights.reshape(-1, 16)[::-1]:
                    total = total * powers[16] + np.tensordot(terms, powers[:16], 1)
                out += amplitude * (self.weights @ (np.exp(2j * np.pi * first * delay) * total))
            return out

        return lambda x: np.concatenate([part(x[i : i + 64]) for i in range(0, len(x), 64)])  # that a cache holds

    def grid(self, center, plane="ground", turned=0, shape=80, oversample=1.5):
        """A grid whose columns run `turned` degrees from range, its centre between pixels of `center`."""
        turned, slope = np.deg2rad(turned), 0 if plane == "ground" else self.grazing
        along, across = np.array([np.cos(slope), 0, np.sin(slope)]), np.array([0, 1, 0])
        x_axis = np.cos(turned) * along + np.sin(turned) * across
        spacing = self.cells(plane).min() / HALF / oversample
        off = spacing * (0.3 * x_axis - 0.37 * np.cross(np.cross(along, across), x_axis))
        return sarcl.ImageGrid.plane(
            center=center + off,
            shape=shape,
            spacing=spacing,
            normal=np.cross(along, across),
            x_axis=x_axis,
        )

    def image(self, grid, points):
        data = self.value(points)(grid.positions.reshape(-1, 3)).reshape(grid.shape)
        middle, gain = self.middle(), self.weights.sum() ** 2
        return sarcl.Image(data, grid, gain=gain, frequency=self.frequency, tx=middle[0], rx=middle[1])

    def middle(self):
        """Positions of both antennas at mid-aperture, m."""
        return [(end[N // 2 - 1] + end[N // 2]) / 2 for end in (self.tx, self.rx)]

    def axes(self, grid, place, ends=None):
        """Unit vectors of range and cross-range on a plane grid, at a place on it, m, of antennas at `ends`, m."""
        ends = self.middle() if ends is None else ends
        gradient = sum((np.array(place) - end) / np.linalg.norm(np.array(place) - end) for end in ends)
        along = gradient - (gradient @ grid.normal) * grid.normal
        along /= np.linalg.norm(along)
        return along, np.cross(grid.normal, along)


CENTRE, AWAY = (0.0, 0.0, 0.0), (28.0, 28.5, 0.0)  # the second 40 m off


def test_figures_are_those_of_a_uniform_aperture():
    """IRW 1 %, PSLR 0.1 dB, ISLR 0.15 dB, position 1 % of a cell: of the figures of sin(x)/x."""
    for distance, grazing, place, plane, turned in (
        (10e3, 30, CENTRE, "ground", 0),
        (10e3, 45, AWAY, "ground", 30),
        (10e3, 35, AWAY, "slant", 0),
        (800e3, 35, CENTRE, "slant", 30),
        (800e3, 40, AWAY, "ground", 0),
    ):
        seen = Pass(distance=distance, grazing=grazing)
        # turned by 30 degrees, the band's corners reach further along rows and columns
        grid = seen.grid(place, plane, turned, oversample=1.9 if turned else 1.5)
        if plane == "slant" and place is AWAY:
            place = tuple(grid.at(40.37, 39.7))  # a point on the plane
        got = sarcl.measure(seen.image(grid, {place: 1.0}), near=place)
        cells = seen.cells(plane)
        np.testing.assert_allclose(got.irw, cells, rtol=0.01)
        np.testing.assert_allclose(got.pslr, -13.26, atol=0.1)
        np.testing.assert_allclose(got.islr, -10.22, atol=0.15)
        assert np.linalg.norm(got.position - place) < 1e-3 * cells.min()
        assert abs(got.peak / got.gain - 1) < 5e-3  # the phase at the true position, too
        assert got.reach == (10, 10)


@pytest.mark.parametrize(
    "case, window",
    [  # each pass and each window once; the other six pairs are slow
        pytest.param(case, window, marks=[] if i == j else [pytest.mark.slow])
        for i, case in enumerate([{}, {"baseline": (-3e3, 2e3, 1e3)}, {"distance": 800e3}])
        for j, window in enumerate(["hamming", None, TAYLOR])
    ],
)
def test_figures_are_those_of_brute_force_on_the_exact_image(case, window):
    seen = Pass(window=window, **case)
    place = AWAY
    grid = seen.grid(place, turned=20, oversample=2)
    image = seen.image(grid, {place: 2.0})
    got = sarcl.measure(image)
    want = brute_force(
        seen.value({place: 2.0}),
        place,
        seen.axes(grid, place),
        seen.cells("ground"),
    )
    np.testing.assert_allclose(got.irw, want["irw"], rtol=2e-4)
    # an interpolation error of 2e-5 of the peak is 0.03 dB of a lobe at -44.5 dB, 0.001 dB at -13
    loose = 0.03 if window else 0.002
    np.testing.assert_allclose(got.pslr, want["pslr"], atol=loose)
    np.testing.assert_allclose(got.islr, want["islr"], atol=loose)
    np.testing.assert_allclose(got.position, want["position"], atol=1e-3 * min(got.irw))
    assert abs(got.peak) == pytest.approx(abs(want["peak"]), rel=1e-4)


@pytest.mark.parametrize(
    ("window", "width", "lobe"), [(None, 0.886, -13.26), ("hamming", 1.303, -42.67), (TAYLOR, 1.188, -35.22)]
)
def test_windows_widen_and_lower_as_published(window, width, lobe):
    """A tenth of the band and of the arc, where the two cuts are those of the windows alone."""
    seen = Pass(bandwidth=60e6, arc=0.4, window=window)
    got = sarcl.measure(seen.image(seen.grid(CENTRE), {CENTRE: 1.0}))
    np.testing.assert_allclose(got.irw, width / HALF * seen.cells("ground"), rtol=1e-3)
    np.testing.assert_allclose(got.pslr, lobe, atol=0.05)


@pytest.mark.parametrize(("window", "lobe"), [("hamming", -42.67), (TAYLOR, -35.22)])
def test_windows_hold_at_full_bandwidth(window, lobe):
    """600 MHz and 4 degrees blur the far lobes across range: Hamming's highest, its fourth, by 0.1 dB."""
    seen = Pass(window=window)
    got = sarcl.measure(seen.image(seen.grid(CENTRE), {CENTRE: 1.0}))
    np.testing.assert_allclose(got.pslr, lobe, atol=0.15)


def cross_range_cut(u, fraction):
    """Mean over the band of sinc(u f/fc), u in cells 1/B: the cut across range of a uniform arc."""
    return np.mean([np.sinc(u * f) for f in 1 + fraction * ((np.arange(N) + 0.5) / N - 0.5)], axis=0)


def test_the_lobes_across_range_are_the_mean_of_every_frequencys_sinc():
    seen = Pass()
    got = sarcl.measure(seen.image(seen.grid(CENTRE), {CENTRE: 1.0}))
    u = np.linspace(-10 * HALF, 10 * HALF, 20001)
    p = cross_range_cut(u, seen.bandwidth / seen.frequency) ** 2
    main = np.abs(u) < 1.0
    assert got.pslr[1] == pytest.approx(10 * np.log10(p[~main].max()), abs=0.01)
    assert got.islr[1] == pytest.approx(10 * np.log10(p[~main].sum() / p[main].sum()), abs=0.02)
    p = cross_range_cut(u, 0.0) ** 2  # a single frequency: sin(x)/x
    assert 10 * np.log10(p[~main].sum() / p[main].sum()) == pytest.approx(-10.22, abs=0.01)


def sinc_image(seen, grid, middle, index):
    """Values at positions, m (..., 3), of sinc(0.8 i) sinc(0.78 j) on a carrier of 5 cycles per pixel about a pixel
    index (row, column); and their image, of an antenna at `middle`."""

    def value(x):
        row, column = np.moveaxis(grid.index(x), -1, 0)
        path = np.linalg.norm(x - middle, axis=-1) - np.linalg.norm(middle)
        carrier = np.exp(4j * np.pi * seen.frequency / SPEED_OF_LIGHT * path)
        return np.sinc(0.8 * (row - index[0])) * np.sinc(0.78 * (column - index[1])) * carrier

    return value, sarcl.Image(value(grid.positions), grid, frequency=seen.frequency, tx=middle)


def test_the_interpolator_follows_a_sinc_just_above_its_nyquist_rate():
    seen = Pass()
    grid, middle = seen.grid(CENTRE, shape=70), seen.middle()[0]
    _, image = sinc_image(seen, grid, middle, (34.6, 35.1))
    got = sarcl.measure(image)
    np.testing.assert_allclose(grid.index(got.position), [34.6, 35.1], atol=1e-4)
    np.testing.assert_allclose(got.irw, HALF / np.array([0.78, 0.8]) * grid.spacing[0], rtol=1e-4)
    np.testing.assert_allclose(got.pslr, -13.26, atol=0.005)
    np.testing.assert_allclose(got.islr, -10.22, atol=0.01)


def test_cuts_in_all_directions_through_random_places_are_interpolated_to_1e_4():
    """Cuts run along the range: antennas in 12 directions, and a peak at a random place between the pixels for each."""
    seen, random, places = Pass(), np.random.default_rng(0), []
    grid = seen.grid(CENTRE, shape=70)
    for angle in np.deg2rad(np.arange(5, 365, 30)):
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        middle = turn @ seen.middle()[0]
        value, image = sinc_image(seen, grid, middle, random.uniform(31, 39, 2))
        got = sarcl.measure(image)
        for cut, axis in zip(got.cuts, seen.axes(grid, got.position, [middle]), strict=True):
            at = got.position + cut.distance[:, None] * axis
            places.append(grid.index(at))
            assert np.abs(cut.values - value(at)).max() < 1e-4
    rows, columns = np.concatenate(places).T
    assert len(rows) >= 2000
    assert min(np.ptp(rows), np.ptp(columns)) > 25  # pixels


@pytest.mark.parametrize("oversample", quick_of([1.3, 8], [1.3, 2, 4, 8]))
def test_figures_do_not_depend_on_the_spacing(oversample):
    """From just finer than the resolution to far finer; the cut of the coarsest is 3.6 IRW at least."""
    seen = Pass()
    got = sarcl.measure(seen.image(seen.grid(CENTRE, shape=100, oversample=oversample), {CENTRE: 1.0}))
    np.testing.assert_allclose(got.irw, seen.cells("ground"), rtol=5e-4)
    np.testing.assert_allclose(got.pslr, (-13.263, -13.285), atol=0.005)
    assert np.linalg.norm(got.position) < 1e-3 * min(got.irw)


@pytest.mark.parametrize(("window", "oversample"), [(None, 1.65), ("hamming", 1.3), (TAYLOR, 1.5)])
def test_a_turned_band_that_is_accepted_is_measured_right(window, oversample):
    """At 45 degrees the band ends in corners, thin under a window: what is not refused must be within 1 %."""
    seen = Pass(window=window)
    straight = sarcl.measure(seen.image(seen.grid(CENTRE), {CENTRE: 1.0}))
    turned = sarcl.measure(seen.image(seen.grid(CENTRE, turned=45, oversample=oversample), {CENTRE: 1.0}))
    np.testing.assert_allclose(turned.irw, straight.irw, rtol=2e-3)
    np.testing.assert_allclose(turned.pslr, straight.pslr, atol=0.4 if window == "hamming" else 0.1)


def test_float32_pixels_cost_nothing_that_shows():
    seen = Pass()
    image = seen.image(seen.grid(CENTRE), {CENTRE: 1.0})
    exact, got = sarcl.measure(image), sarcl.measure(replace(image, data=image.data.astype(np.complex64)))
    np.testing.assert_allclose(got.irw, exact.irw, rtol=1e-5)
    np.testing.assert_allclose(got.position, exact.position, atol=1e-4 * min(exact.irw))


@pytest.fixture(scope="module")
def pair():
    """A point at the centre, and one of a tenth of its amplitude 3 m away in range and in cross-range."""
    seen = Pass()
    grid = seen.grid(CENTRE, shape=130)
    return seen, seen.image(grid, {CENTRE: 1.0, (3.0, 3.0, 0.0): 0.1j})


def test_near_chooses_the_point_and_none_the_brightest(pair):
    seen, image = pair
    cell = seen.cells("ground").min()
    assert np.linalg.norm(sarcl.measure(image).position) < 0.01 * cell
    weak = sarcl.measure(image, near=(3.0, 3.1, 5.0))  # the height is projected away
    # sidelobes of the strong point, -53 dB where the cuts cross, displace the weak one by some 1e-2 of a cell
    assert np.linalg.norm(weak.position - (3, 3, 0)) < 0.03 * cell
    assert abs(weak.peak / weak.gain) == pytest.approx(0.1, abs=0.002)


@pytest.mark.parametrize("cells_off", [(1.5, 0), (-1, 1), (0, -1.5)])
def test_near_may_be_a_cell_and_a_half_off(pair, cells_off):
    """Its nearest peak may be a side lobe; the main lobe beside it is found."""
    seen, image = pair
    off = np.array([*(np.array(cells_off) * seen.cells("ground")), 0])
    assert np.linalg.norm(sarcl.measure(image, near=off).position) < 0.01 * seen.cells("ground").min()


def test_a_side_lobe_is_refused_and_its_source_named(pair):
    seen, image = pair
    with pytest.raises(ValueError, match=r"dB stronger, .* m away in range; measure that with near=\("):
        sarcl.measure(image, near=(5.5 / HALF * seen.cells("ground")[0], 0, 0))


class File:
    """Pixels in a file: counts how many were read at once and in all."""

    def __init__(self, data):
        self.data, self.shape, self.dtype = data, data.shape, data.dtype
        self.most = self.all = 0

    def __getitem__(self, at):
        part = self.data[at]
        self.most, self.all = max(self.most, part.size), self.all + part.size
        return part


def test_of_a_file_only_the_surroundings_are_read(pair):
    _, image = pair
    data = np.zeros((3000, 2001), np.complex64)
    data[1435:1565, 935:1065] = image.data
    file = File(data)
    grid = replace(image.grid, shape=data.shape)
    want = sarcl.measure(image)
    got = sarcl.measure(replace(image, data=file, grid=grid), near=(0, 0, 0))
    assert file.most < 80**2 and file.all < 100 * 80**2
    np.testing.assert_allclose(got.position, want.position, atol=1e-4)
    got = sarcl.measure(replace(image, data=file, grid=grid))
    assert file.most <= 2**22  # a block of rows
    np.testing.assert_allclose(got.position, want.position, atol=1e-4)


def test_a_small_image_is_measured_as_far_as_it_reaches():
    seen = Pass()
    image = seen.image(seen.grid(CENTRE, shape=34, oversample=1.7), {CENTRE: 1.0})
    got = sarcl.measure(image)
    assert 3 <= min(got.reach) < 10
    np.testing.assert_allclose(got.irw, seen.cells("ground"), rtol=0.01)
    np.testing.assert_allclose(got.pslr, -13.26, atol=0.1)
    assert (np.array(got.islr) < -10.22).all()  # fewer lobes are counted, and the table says so
    assert f"{got.reach[0]:.1f}" in str(got)


def test_a_cut_ends_before_the_border_of_a_grid_whose_rows_are_not_even():
    """Terrain: rows of a range-Doppler image lie closer or farther apart, so that the border comes sooner or later."""
    rows, columns = np.arange(120), np.arange(90)
    y, x = rows + 0.004 * (rows - 40.0) ** 2, columns - 45.0
    positions = np.stack([*np.broadcast_arrays(x, y[:, None]), np.zeros((120, 90))], axis=-1)
    grid = sarcl.ImageGrid.zero_doppler(rows * 1e-3, 1e5 + columns, positions)
    data = (np.sinc((rows[:, None] - 40) / 4) * np.sinc((columns - 45) / 4)).astype(np.complex64)
    got = sarcl.measure(sarcl.Image(data, grid, frequency=1e3, tx=(-1e5, 0, 1e5)))  # no ValueError
    assert 15 < got.cuts[1].distance.max() < 10 * got.irw[1] - 2  # y = 6.4 m ... 40 m


def test_the_response_prints_as_a_table_with_units(pair):
    text = str(sarcl.measure(pair[1]))
    for part in ("position", " m\n", "IRW, half power", "PSLR", "-13.26", "ISLR", "dB", "RCS", "cross-range"):
        assert part in text


@pytest.mark.parametrize("turned", [0, 45])
@pytest.mark.parametrize("oversample", [0.25, 0.5, 0.9, 1.05])
def test_a_grid_coarser_than_the_resolution_is_refused_with_a_spacing(oversample, turned):
    seen = Pass()
    grid = seen.grid(CENTRE, turned=turned, oversample=oversample)
    message = rf"coarser than the resolution: .* spacing of at most {grid.spacing[0] / 2:g} m"
    with pytest.raises(ValueError, match=message):
        sarcl.measure(seen.image(grid, {CENTRE: 1.0}), near=CENTRE)


def test_what_cannot_be_measured_is_refused(pair):
    _, image = pair

    def refused(message, broken, near=None):
        with pytest.raises(ValueError, match=message):
            sarcl.measure(broken, near=near)

    refused(r"multilooked\), without phase", image.multilook(2))
    points = sarcl.ImageGrid.points(image.grid.positions.reshape(-1, 3))
    refused("ImageGrid.plane", replace(image, grid=points, data=np.ravel(image.data)))
    refused("image.frequency is None.*centre frequency", replace(image, frequency=None))
    refused("image.tx is None.*mid-aperture", replace(image, tx=None))
    refused("zero everywhere", replace(image, data=np.zeros(image.grid.shape, complex)))
    refused("zero around near", replace(image, data=np.zeros(image.grid.shape, complex)), near=CENTRE)
    refused(r"outside the image of \(130, 130\)", image, near=(100, 0, 0))
    refused("near", image, near=(0, 0))
    refused("near.*is nan", image, near=(0, np.nan, 0))
    data = image.data.copy()
    data[60, 61] = np.nan
    refused(r"image data\[60, 61\]", replace(image, data=data))
    refused("NaN or Inf near", replace(image, data=data), near=CENTRE)
    overhead = replace(image, tx=(0, 0, 1e4), rx=None)
    refused("straight above the grid", replace(overhead, tx=image.grid.at(65, 65) + np.array([0, 0, 1e4])))


@pytest.mark.parametrize("shape", [(1, 1), (1, 80), (16, 80)])
def test_an_image_too_small_for_a_cut_is_refused(shape):
    seen = Pass()
    image = seen.image(seen.grid(CENTRE, shape=shape), {CENTRE: 1.0})
    with pytest.raises(ValueError, match=r"focus a larger grid|focus a grid that reaches"):
        sarcl.measure(image)


def test_a_point_at_the_border_is_refused(pair):
    _, image = pair
    for pixels in (0, 7, 12):
        part = replace(image.grid, shape=(130, 66 + pixels), center=image.grid.at(65, 33 + pixels // 2))
        with pytest.raises(ValueError, match="focus a"):
            sarcl.measure(replace(image, data=image.data[:, : 66 + pixels], grid=part), near=CENTRE)


def test_a_place_without_a_peak_is_refused(pair):
    """An image that rises steadily: nothing near is a maximum."""
    _, image = pair
    row, column = np.indices(image.grid.shape)
    ramp = replace(image, data=np.exp(0.02 * (row + column)).astype(complex))
    with pytest.raises(ValueError, match=r"no peak lies within two resolution cells of near|focus a larger grid"):
        sarcl.measure(ramp, near=CENTRE)
