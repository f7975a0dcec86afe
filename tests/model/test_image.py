"""Images: decibels, multilooking with pixels in the right places, and what is refused."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

import sarcl

TOLERANCE = {
    "decibels": 1e-5,  # dB; float32 near 100 dB
    "mean": 1e-6,  # mean of some ten float32 intensities, relative
    "position": 1e-9,  # m; float64
}
SHAPE = (11, 14)
GRID = sarcl.ImageGrid.plane(center=(1, -2, 3), shape=SHAPE, spacing=(0.3, 0.7), normal=(1, 2, 5), x_axis=(0, 1, 0))


def noise(dtype=np.complex64, seed=0):
    random = np.random.default_rng(seed)
    return (random.standard_normal(SHAPE) + 1j * random.standard_normal(SHAPE)).astype(dtype)


def noise_of(shape):
    random = np.random.default_rng(1)
    return (random.standard_normal(shape) + 1j * random.standard_normal(shape)).astype(np.complex64)


# decibels


def test_a_unit_point_stands_at_zero_decibels():
    data = np.full(SHAPE, 250 * np.exp(0.3j), np.complex64)
    assert np.abs(sarcl.Image(data, GRID, gain=250).decibels()).max() <= TOLERANCE["decibels"]


def test_decibels_are_20_log10_of_amplitude_and_10_log10_of_intensity():
    data = noise()
    db = sarcl.Image(data, GRID, gain=3).decibels()
    assert db.dtype == np.float32
    assert np.abs(db - 20 * np.log10(np.abs(data) / 3)).max() <= TOLERANCE["decibels"]
    detected = sarcl.Image(np.abs(data) ** 2, GRID, gain=3).decibels()
    assert np.abs(detected - db).max() <= TOLERANCE["decibels"]


@pytest.mark.parametrize("dtype", [np.complex64, np.complex128, np.float32, int])
def test_nothing_is_minus_infinity(dtype):
    assert (sarcl.Image(np.zeros(SHAPE, dtype), GRID).decibels() == -np.inf).all()


def test_a_negative_intensity_is_named():
    data = np.ones(SHAPE)
    data[2, 5] = -3
    with pytest.raises(ValueError, match=r"image data\[2, 5\] is -3; an intensity is not negative"):
        sarcl.Image(data, GRID).decibels()


# multilook


@pytest.mark.parametrize("looks", [(1, 1), (2, 2), (3, 4), (5, 1), (1, 14), (11, 14), 4])
def test_multilook_is_the_mean_intensity_of_blocks_and_cuts_the_remainder(looks):
    data = noise()
    image = sarcl.Image(data, GRID, gain=7).multilook(looks)
    a, b = looks if isinstance(looks, tuple) else (looks, looks)
    assert image.data.shape == image.grid.shape == (SHAPE[0] // a, SHAPE[1] // b)
    assert not image.is_complex and image.gain == 7
    for i in range(image.data.shape[0]):
        for j in range(image.data.shape[1]):
            block = data[i * a : (i + 1) * a, j * b : (j + 1) * b]
            assert image.data[i, j] == pytest.approx((np.abs(block) ** 2).mean(), rel=TOLERANCE["mean"])


@pytest.mark.parametrize("looks", [(1, 1), (2, 2), (3, 4), (5, 1), (4, 5), (11, 14)])
def test_a_looked_pixel_lies_at_the_mean_position_of_its_block(looks):
    a, b = looks
    grid = sarcl.Image(noise(), GRID).multilook(looks).grid
    n, m = grid.shape
    wanted = GRID.positions[: n * a, : m * b].reshape(n, a, m, b, 3).mean(axis=(1, 3))
    assert np.abs(grid.positions - wanted).max() <= TOLERANCE["position"]
    assert grid.spacing == pytest.approx((0.3 * a, 0.7 * b))


def test_a_ramp_stays_the_same_ramp():
    # intensity linear in position: its mean over a block is its value at the block's centre
    slope = np.array([0.1, 0.2, -0.05])
    image = sarcl.Image(10 + GRID.positions @ slope, GRID)
    for looks in ((2, 3), (3, 2), (4, 4)):
        looked = image.multilook(looks)
        assert np.abs(looked.data - (10 + looked.grid.positions @ slope)).max() <= TOLERANCE["position"]


def test_looking_twice_is_looking_once_with_more():
    image = sarcl.Image(noise(), GRID)
    twice, once = image.multilook((2, 2)).multilook((2, 3)), image.multilook((4, 6))
    assert twice.data == pytest.approx(once.data, rel=TOLERANCE["mean"])
    assert np.abs(twice.grid.positions - once.grid.positions).max() <= TOLERANCE["position"]


# images by range_doppler


def by_time_and_range(shape=(12, 15)):
    """Rows 2 m apart along the track, columns 1 m in slant range, on the ground 4 km below a straight track."""
    t, r = 5 + 0.02 * np.arange(shape[0]), 5e3 + np.arange(shape[1])
    x = np.sqrt(r**2 - 4e3**2)
    positions = np.stack(np.broadcast_arrays(x, 100 * t[:, None], 0.0), axis=-1)
    return sarcl.ImageGrid.zero_doppler(t, r, positions)


@pytest.mark.parametrize("looks", [(2, 3), (4, 1), (1, 5), (12, 15)])
def test_multilook_keeps_times_ranges_and_positions_of_range_doppler(looks, tmp_path):
    grid, (a, b) = by_time_and_range(), looks
    data = noise_of(grid.shape)
    image = sarcl.Image(data, grid).multilook(looks)
    n, m = image.grid.shape
    assert (n, m) == (12 // a, 15 // b)
    block = (np.abs(data[: n * a, : m * b]) ** 2).reshape(n, a, m, b)
    assert image.data == pytest.approx(block.mean(axis=(1, 3)), rel=TOLERANCE["mean"])
    assert image.grid.times == pytest.approx(grid.times[: n * a].reshape(n, a).mean(axis=1))
    assert image.grid.ranges == pytest.approx(grid.ranges[: m * b].reshape(m, b).mean(axis=1))
    # the position belongs to the mean time and range, on the same ground
    position = image.grid.positions
    assert np.abs(position[..., 1] - 100 * image.grid.times[:, None]).max() <= 1e-6
    assert np.abs(np.hypot(position[..., 0], 4e3) - image.grid.ranges).max() <= 1e-6
    image.save(tmp_path / "looked.h5")
    again = sarcl.read(tmp_path / "looked.h5")
    assert np.array_equal(again.grid.positions, position) and np.array_equal(again.grid.ranges, image.grid.ranges)
    assert np.array_equal(again.grid.times, image.grid.times) and np.array_equal(again.data, image.data)


def test_a_picture_of_range_doppler_has_axes_in_metres(monkeypatch):
    from sarcl.figures import decibels

    asked = []
    real = decibels.picture
    monkeypatch.setattr(decibels, "picture", lambda *a, **k: asked.append((a, k)) or real(*a, **k))
    grid = by_time_and_range()
    sarcl.Image(noise_of(grid.shape), grid).show()
    (_, axes, _, _), _ = asked[0]
    assert axes.spacing == pytest.approx((2.0, 1.0)) and axes.origin == (0.0, 0.0)
    assert axes.names == ("along the track", "slant range less 5007 m")


def test_multilook_leaves_speckle_of_one_over_root_n():
    random = np.random.default_rng(1)
    data = (random.standard_normal((400, 400)) + 1j * random.standard_normal((400, 400))) / np.sqrt(2)
    looked = sarcl.Image(data, sarcl.ImageGrid.plane(shape=400, spacing=1)).multilook(4).data
    # mean 1, deviation 1/4 over 10^4 blocks: three standard errors of each
    assert looked.mean() == pytest.approx(1, abs=3 * 0.25 / 100)
    assert looked.std() == pytest.approx(0.25, abs=3 * 0.25 / 100)


def test_multilook_reads_a_dataset_and_leaves_it_alone(tmp_path):
    data = noise()
    with h5py.File(tmp_path / "image.h5", "w") as file:
        image = sarcl.Image(file.create_dataset("data", data=data), GRID)
        assert image.multilook(2).data == pytest.approx(sarcl.Image(data, GRID).multilook(2).data)
        assert (file["data"][...] == data).all()


# what an image holds


def test_geometry_is_kept_as_read_only_copies():
    tx = np.array([1.0, 2, 3])
    image = sarcl.Image(noise(), GRID, frequency=9600000000, tx=tx, rx=[4, 5, 6])
    tx += 1
    assert (image.tx == (1, 2, 3)).all() and (image.rx == (4, 5, 6)).all() and image.frequency == 9.6e9
    with pytest.raises(ValueError, match="read-only"):
        image.tx[0] = 0


def test_lists_are_images_too():
    grid = sarcl.ImageGrid.plane(shape=(1, 2), spacing=1)
    assert sarcl.Image([[1j, 2]], grid).is_complex and not sarcl.Image([[1, 2]], grid).is_complex


def test_a_line_and_a_volume_are_images_without_a_picture():
    for shape in ((4,), (2, 3, 4)):
        image = sarcl.Image(np.ones(shape, complex), sarcl.ImageGrid.points(np.zeros((*shape, 3))))
        assert image.decibels().shape == shape
        with pytest.raises(ValueError, match="a picture needs two axes; this image has shape"):
            image.show()


def test_show_and_save_give_a_picture(tmp_path):
    image = sarcl.Image(noise(), GRID)
    assert image.show(floor_db=-40).size[0] > 100
    for name in ("a.png", "A.PNG"):
        image.save(tmp_path / name, title="noise")
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["a.h5", "a.hdf5"])
def test_a_saved_image_reads_back(tmp_path, name):
    image = sarcl.Image(noise(), GRID, gain=3, frequency=9.6e9, tx=(1, 2, 3), rx=(4, 5, 6))
    image.save(tmp_path / name)
    again = sarcl.read(tmp_path / name)
    assert (np.asarray(again.data) == image.data).all() and (again.grid.positions == GRID.positions).all()
    assert (again.gain, again.frequency) == (3, 9.6e9) and (again.tx == image.tx).all()


def test_a_one_pixel_image_works(tmp_path):
    image = sarcl.Image([[1j]], sarcl.ImageGrid.plane(shape=1, spacing=1))
    assert image.multilook(1).data.tolist() == [[1]] and image.decibels().tolist() == [[0]]
    image.save(tmp_path / "a.png")


def image(data=None, **options):
    return sarcl.Image(noise() if data is None else data, GRID, **options)


BAD = {
    "other shape": (
        lambda: image(np.ones((11, 13))),
        r"image data has shape \(11, 13\) but its grid \(11, 14\); give one value per pixel",
    ),
    "no shape": (lambda: image(3), r"image data has shape \(\) but its grid"),
    "truths": (lambda: image(np.ones(SHAPE, bool)), "image data has type bool, wanted complex or real"),
    "no gain": (lambda: image(gain=0), "image gain is 0; it must be greater than 0"),
    "gain not finite": (lambda: image(gain=np.inf), "image gain is inf"),
    "gain of another shape": (lambda: image(gain=np.ones(3)), r"image gain has shape \(3,\), wanted"),
    "gain negative": (lambda: image(gain=-np.ones(GRID.shape)), "image gain is -1 to -1; it is a sum of weights"),
    "gain zero": (lambda: image(gain=np.zeros(GRID.shape)), "image gain is 0 to 0; it is a sum of weights"),
    "frequency a word": (lambda: image(frequency="X band"), "image frequency must be a number"),
    "flat antenna": (lambda: image(tx=(1, 2)), r"tx has shape \(2,\), wanted \(3,\)"),
    "antenna not finite": (lambda: image(rx=(1, np.nan, 2)), r"rx\[1\] is nan"),
    "no looks": (lambda: image().multilook(0), r"looks\[0\] is 0; it must be at least 1"),
    "half a look": (lambda: image().multilook((1, 1.5)), r"looks\[1\] must be a whole number, got 1.5"),
    "three looks": (lambda: image().multilook((1, 2, 3)), r"looks is \(1, 2, 3\); wanted \(row, column\)"),
    "too many looks": (lambda: image().multilook((12, 1)), r"looks \(12, 1\) is larger than the image \(11, 14\)"),
    "looks at a list of points": (
        lambda: sarcl.Image(np.ones(4), sarcl.ImageGrid.points(np.zeros((4, 3)))).multilook(2),
        "multilook is for images on a plane or a map, or by range_doppler",
    ),
    "floor above zero": (lambda: image().show(floor_db=5), "floor_db is 5"),
    "pixel not finite": (
        lambda: image(np.where(np.arange(11 * 14).reshape(SHAPE) == 14, np.nan, 1.0)).show(),
        r"image data\[1, 0\] is nan; a picture needs finite pixels",
    ),
    "floor not finite": (lambda: image().show(floor_db=np.nan), "floor_db is nan"),
    "unknown suffix": (lambda: image().save("a.bmp"), r"image path 'a.bmp' ends in '.bmp'; choose '.png', '.h5', "),
    "no suffix": (lambda: image().save("picture"), "image path 'picture' has no ending; choose"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_images_say_what_was_wanted(name):
    make, message = BAD[name]
    with pytest.raises(ValueError, match=message):
        make()


def plane_image(shape=(6, 9), spacing=(0.5, 0.25)):
    grid = sarcl.ImageGrid.plane(center=(3, -2, 1), shape=shape, spacing=spacing)
    random = np.random.default_rng(3)
    data = (random.standard_normal((*shape, 2)) @ (1, 1j)).astype(np.complex64)
    return sarcl.Image(data, grid, gain=2.0, window="hamming", time=(0.0, 2.0))


def test_numpy_takes_an_image_for_its_pixels():
    image = plane_image()
    data = image.data
    assert np.asarray(image) is data and np.array(image) is not data and np.asarray(image, np.complex128).dtype == "c16"
    for made, wanted in (
        (np.abs(image), np.abs(data)), (2 * image, 2 * data), (image - image, 0 * data), (image / data, data / data),
        (np.add(data, image), 2 * data), (-image, -data), (np.mean(image), np.mean(data)), (image**2, data**2),
        (np.fft.fft(image), np.fft.fft(data)), (np.abs(image) > 1, np.abs(data) > 1),
    ):  # fmt: skip
        assert isinstance(made, (np.ndarray, np.generic)) and np.allclose(made, wanted, rtol=1e-6)
    assert image == image and image != plane_image() and len({image, image}) == 1 and len(image) == 6


def test_slices_of_an_image_lie_on_their_part_of_the_grid():
    image = plane_image()
    for rows, columns in (
        (slice(1, 5), slice(2, 9, 3)),
        (slice(None, None, 2), slice(-4, None)),
        (slice(3, 4), slice(7, 8)),
    ):
        part = image[rows, columns]
        assert isinstance(part, sarcl.Image) and np.array_equal(part.data, image.data[rows, columns])
        assert np.abs(part.grid.positions - image.grid.positions[rows, columns]).max() <= 1e-14
        assert part.gain == 2.0 and part.window == "hamming" and (part.time == [0, 2]).all()
    assert image[2:].grid.shape == (4, 9)
    assert image[2, 3] == image.data[2, 3] and (image[1] == image.data[1]).all()
    assert (image[np.abs(image) > 1] == image.data[np.abs(image.data) > 1]).all()
    with pytest.raises(IndexError, match="step of -1; steps are positive"):
        image[::-1]
    with pytest.raises(IndexError, match="no pixel is left of the 6 of axis 0"):
        image[7:]


def test_slices_of_listed_points_and_of_files_keep_their_positions(tmp_path):
    image = plane_image()
    listed = sarcl.Image(image.data, sarcl.ImageGrid.points(image.grid.positions))
    assert (listed[1:4, ::2].grid.positions == image.grid.positions[1:4, ::2]).all()
    times, ranges = np.arange(6.0), 100 + np.arange(9.0)
    made = sarcl.Image(image.data, sarcl.ImageGrid.zero_doppler(times, ranges, image.grid.positions))[2:, 1:5]
    assert (made.grid.times == times[2:]).all() and (made.grid.ranges == ranges[1:5]).all()
    image.save(tmp_path / "a.h5")
    stored = sarcl.read(tmp_path / "a.h5")
    assert (np.asarray(stored) == image.data).all() and (stored[1:3, 2:4].data == image.data[1:3, 2:4]).all()
    assert (2 * stored == 2 * image.data).all() and stored[2, 3] == image.data[2, 3]


def test_axes_and_extent_of_a_plane():
    grid = plane_image().grid
    assert (grid.x == grid.positions[0, :, 0]).all() and (grid.y == grid.positions[:, 0, 1]).all()
    left, right, bottom, top = plane_image().extent
    assert (left, right) == (grid.x[0] - 0.125, grid.x[-1] + 0.125) and (bottom, top) == (
        grid.y[0] - 0.25,
        grid.y[-1] + 0.25,
    )
    with pytest.raises(ValueError, match="x, y or extent is for planes"):
        print(sarcl.ImageGrid.points(grid.positions).extent)


def test_an_image_keeps_what_products_need_of_its_data(tmp_path):
    chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=100e6, duration=1e-6)
    track = sarcl.Trajectory.line(start=(-3e3, -8, 3e3), velocity=(0, 100, 0), prf=100.0, n_pulses=17)
    raw = sarcl.echo(sarcl.Scene.points([[0, 0, 0]]), chirp, track)
    grid = sarcl.ImageGrid.plane(shape=(8, 8), spacing=1.0)
    for made in (
        sarcl.backproject(raw, grid, window=("taylor", 35, 5)),
        sarcl.backproject(raw, grid, window=("taylor", 35, 5), out=tmp_path / "a.h5"),
        sarcl.polar_format(raw, grid, window=("taylor", 35, 5), tolerance=1e-1),
    ):
        assert (made.tx_velocity == [0, 100, 0]).all() and (made.rx_velocity == [0, 100, 0]).all()
        assert made.time == pytest.approx([0, 0.16]) and made.band == pytest.approx([9.55e9, 9.65e9])
        assert (made.window, made.polarization, made.frame) == ("taylor 35 5", "HH", "local")
        made.save(tmp_path / "b.h5")
        again = sarcl.read(tmp_path / "b.h5")
        for name in ("tx", "tx_velocity", "rx_velocity", "time", "band"):
            assert (getattr(again, name) == getattr(made, name)).all()
        assert (again.window, again.polarization, again.frame) == (made.window, made.polarization, made.frame)
    with pytest.raises(ValueError, match="image frame is 'moon'; choose one of 'local', 'earth-fixed'"):
        sarcl.Image(np.ones((8, 8)), grid, frame="moon")


def test_a_gain_that_varies_goes_with_its_pixels(tmp_path):
    data, gain = noise(), np.random.default_rng(3).uniform(1, 9, GRID.shape).astype(np.float32)
    gain[0, :2], data[0, :2] = 0, 0  # pixels that no row saw
    image = sarcl.Image(data, GRID, gain=gain)
    assert not image.gain.flags.writeable and "gain 0 to " in repr(image)
    db = image.decibels()
    assert np.isneginf(db[0, :2]).all()
    clear = gain > 0
    assert db[clear] == pytest.approx(20 * np.log10(np.abs(data[clear]) / gain[clear]), abs=1e-4)
    assert image.normalized()[clear] == pytest.approx(data[clear] / gain[clear]) and not image.normalized()[0, :2].any()
    part = image[1:5, ::2]
    assert np.array_equal(part.gain, gain[1:5, ::2])
    looked = image.multilook((2, 3))
    blocks = (gain[: looked.data.shape[0] * 2, : looked.data.shape[1] * 3] ** 2).reshape(
        looked.data.shape[0], 2, looked.data.shape[1], 3
    )
    assert looked.gain == pytest.approx(np.sqrt(blocks.mean(axis=(1, 3))), rel=1e-5)
    image.save(tmp_path / "a.h5")
    again = sarcl.read(tmp_path / "a.h5")
    assert again.gain.dtype == np.float32 and np.array_equal(again.gain, gain)
    assert np.array_equal(again.decibels(), db)
    image.show()
    # damage: the gain has a checksum of its own
    whole = bytearray((tmp_path / "a.h5").read_bytes())
    at = whole.find(gain[3].tobytes())
    whole[at + 5] ^= 1
    (tmp_path / "b.h5").write_bytes(whole)
    with pytest.raises(ValueError, match="gain is not as it was written"):
        sarcl.read(tmp_path / "b.h5")
