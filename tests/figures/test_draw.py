"""Pictures: position and grey level of pixels, labels of the axes, and refusals."""

import numpy as np
import pytest

import sarcl
from sarcl.figures import _axes as axes
from sarcl.figures import decibels


def data_of(picture):
    """Grey levels inside the frame, top row first."""
    return np.asarray(picture.convert("L").crop(picture.info["frame"]))


def speckle(shape, seed=0):
    rng = np.random.default_rng(seed)
    return 20 * np.log10(np.abs(rng.normal(size=shape) + 1j * rng.normal(size=shape)))


# Where pixels land and how bright they are -----------------------------------------------------------------


def test_row_0_is_drawn_at_the_bottom_and_column_0_at_the_left():
    db = np.full((4, 5), -np.inf)
    db[0, 1] = 0
    drawn = data_of(decibels.picture(db))
    at = np.argwhere(drawn == 255)
    rows, columns = drawn.shape
    assert at.min(axis=0).tolist() == [3 * rows // 4, columns // 5]
    assert at.max(axis=0).tolist() == [rows - 1, 2 * columns // 5 - 1]


def test_grey_is_linear_in_db_from_black_to_white():
    db = np.array([[6.0, 0.0, -10, -20, -40, -50, -70, -np.inf]]) + 33
    levels = decibels.grey_levels(np.vstack([db, db]), 33.0, -50, (2, 8))
    assert levels[0].tolist() == [255, 255, 204, 153, 51, 0, 0, 0]


# The level of white ----------------------------------------------------------------------------------------


def point(window=np.sinc, n=256):
    """A point at -3 dB in the middle, 4 pixels a resolution cell."""
    x = (np.arange(n) - n // 2) / 4
    return 20 * np.log10(np.maximum(np.abs(np.outer(window(x), window(x))), 1e-12)) - 3


@pytest.mark.parametrize("points_db", [5, 20, 38])
def test_a_few_bright_points_do_not_darken_a_scene(points_db):
    scene = speckle((300, 300))
    alone = decibels.white_level(scene)
    assert alone == pytest.approx(np.percentile(scene, 99.5), abs=0.01)
    scene[[20, 20, 21, 150], [30, 31, 30, 200]] = alone + points_db
    assert decibels.white_level(scene) == pytest.approx(alone, abs=0.1)


def tapered(x):
    """Response of a Hann taper."""
    return np.sinc(x) + np.sinc(x - 1) / 2 + np.sinc(x + 1) / 2


@pytest.mark.parametrize("window", [np.sinc, tapered])
def test_the_side_lobes_of_a_point_do_not_set_the_level(window):
    assert -6 < decibels.white_level(point(window)) <= -3


def test_faint_noise_does_not_set_the_level_of_a_point():
    assert -6 < decibels.white_level(np.maximum(point(), speckle((256, 256)) - 70)) <= -3


def test_shadows_and_empty_corners_leave_the_level_of_a_scene():
    scene = speckle((300, 300))
    alone = decibels.white_level(scene)
    scene[:140] -= 30
    assert decibels.white_level(scene) == pytest.approx(alone, abs=1.0)  # 0.5 % of all pixels is 1 % of the lit ones
    scene[:140] = -np.inf
    assert decibels.white_level(scene) == pytest.approx(alone, abs=0.1)


def test_what_has_no_scene_has_a_level_all_the_same():
    lone = np.full((200, 200), -np.inf)
    assert decibels.white_level(lone) == -np.inf
    lone[3, 4] = -12.0
    assert decibels.white_level(lone) == -12.0
    assert decibels.white_level(np.full((200, 200), 4.0)) == 4.0


def test_white_is_what_is_asked_for_and_said():
    db = speckle((100, 100))
    for options, white, words in (
        ({"percentile": 100}, db.max(), "(the brightest pixel)"),
        ({"percentile": 50}, np.median(db), "percentile 50 of the scene; the brightest pixel is"),
        ({"top_db": -2.5}, -2.5, "White: -2.5 dB (given"),
        ({}, decibels.white_level(db), "percentile 99.5 of the scene"),
    ):
        made = decibels.picture(db, floor_db=-30, zero="a unit point", **options)
        assert made.info["top_db"] == pytest.approx(white, abs=0.01) and made.info["floor_db"] == -30
        assert words in made.info["caption"] and made.info["caption"].endswith("0 dB: a unit point.")
        assert (data_of(made) == 255).mean() == pytest.approx((db >= white).mean(), abs=0.01)
    assert decibels.picture(np.full((3, 4), -np.inf)).info["caption"] == "No pixel has a signal."


def test_a_caption_is_broken_into_lines_that_fit():
    words = "White: 0.0 dB (percentile 99.5 of the scene). Black: -50.0 dB."
    lines = axes.wrapped(words, 20, len)
    assert " ".join(lines) == words and all(len(line) <= 20 for line in lines)
    assert axes.wrapped("unbreakable", 3, len) == ["unbreakable"]


def test_small_images_grow_by_a_whole_factor_to_500_pixels():
    for shape in [(64, 64), (1, 1), (7, 499), (333, 200)]:
        drawn = np.array(decibels.drawn_shape(shape, None))
        assert 500 <= drawn.max() < 1000
        if min(shape) > max(shape) * decibels.THINNEST:
            assert (drawn % shape == 0).all() and len(set(drawn // shape)) == 1
    assert decibels.drawn_shape((512, 700), None) == (512, 700)


def test_an_enlarged_image_repeats_its_pixels():
    db = speckle((20, 30))
    drawn = data_of(decibels.picture(db))
    k = drawn.shape[0] // 20
    assert (drawn == np.kron(drawn[::k, ::k], np.ones((k, k)))).all()


def test_pixels_are_as_wide_to_high_as_their_spacing():
    for shape, spacing in [((100, 100), (0.3, 0.1)), ((500, 300), (0.13, 0.1)), ((5000, 3000), (0.2, 0.7))]:
        rows, columns = decibels.drawn_shape(shape, spacing)
        true = shape[0] * spacing[0] / (shape[1] * spacing[1])
        assert rows / columns == pytest.approx(true, rel=0.01)  # one pixel in a few hundred


def test_a_long_strip_is_stretched_to_be_seen_and_says_so():
    assert decibels.drawn_shape((3, 6000), None) == (333, 2000)
    assert decibels.picture(np.zeros((3, 300))).size[1] > 80


def test_large_images_are_reduced_by_averaging_power():
    db = speckle((4900, 1000))
    shape = decibels.drawn_shape(db.shape, None)
    drawn = decibels.resampled(db, shape)
    levels = decibels.grey_levels(drawn, drawn.max(), -40, shape).astype(float)
    assert levels.shape == (1634, 334)
    shown = -40 * (1 - levels / 255)
    shown = 10 ** (shown / 10)
    # Nine-look speckle: power scatters by 1/sqrt(9) of its mean, where dropped pixels would scatter by 1.
    assert shown.std() / shown.mean() == pytest.approx(1 / 3, rel=0.02)


@pytest.mark.parametrize("shape", [(5, 7), (3, 7), (10, 4), (8, 20), (1, 1)])
def test_resampling_keeps_the_mean_power(shape):
    db = speckle((8, 10))
    mean = decibels.average_power(db, 0.0, shape).mean()
    assert mean == pytest.approx((10 ** (db / 10)).mean(), rel=1e-12)  # float64 sums


def test_an_average_of_whole_blocks_is_the_mean_of_the_block():
    db = speckle((600, 9))
    blocks = (10 ** (db / 10)).reshape(300, 2, 3, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(decibels.average_power(db, 0.0, (300, 3)), blocks, rtol=1e-11)


@pytest.mark.parametrize(("value", "level"), [(-np.inf, 0), (0.0, 255), (-300.0, 255), (7.5, 255)])
@pytest.mark.parametrize("shape", [(1, 1), (20, 30), (3000, 40)])
def test_an_empty_image_is_black_and_a_constant_one_white(value, level, shape):
    assert (data_of(decibels.picture(np.full(shape, value))) == level).all()


# Axes ------------------------------------------------------------------------------------------------------


def test_axes_count_metres_from_the_pixel_that_image_grids_count_from():
    grid = sarcl.ImageGrid.plane(shape=(5, 8), spacing=(0.5, 0.25))
    for along, n in enumerate(grid.shape):
        _, low, high, _ = decibels.PixelAxes(grid.spacing).axis(n, along)
        centres = low + (np.arange(n) + 0.5) * (high - low) / n
        xyz = grid.at(*(np.arange(n), 0)[:: 1 - 2 * along])
        np.testing.assert_allclose(centres, xyz[:, 1 - along], atol=1e-12)


def test_axes_without_spacing_count_pixels():
    assert decibels.PixelAxes().axis(10, 0)[:3] == ("row", -0.5, 9.5)
    assert axes.ticks_between(-0.5, 0.5, 5, least=1.0) == (1.0, [0.0])


@pytest.mark.parametrize(
    ("low", "high", "most", "ticks"),
    [
        (-50.1, 49.9, 8, ["-40", "-20", "0", "20", "40"]),
        (-1.6, 1.5, 6, ["-1", "0", "1"]),
        (-0.32, 0.31, 7, ["-0.3", "-0.2", "-0.1", "0.0", "0.1", "0.2", "0.3"]),
        (-50, 0, 5, ["-50", "-40", "-30", "-20", "-10", "0"]),
        (-3e6, 3e6, 3, ["-2e+06", "0", "2e+06"]),
    ],
)
def test_ticks_stand_at_round_values(low, high, most, ticks):
    step, values = axes.ticks_between(low, high, most)
    assert [axes.number(v, step) for v in values] == ticks


def test_title_and_scale_are_outside_the_data():
    plain = decibels.picture(speckle((64, 64)), decibels.PixelAxes((0.1, 0.1)))
    titled = decibels.picture(
        speckle((64, 64)), decibels.PixelAxes((0.1, 0.1)), title="A title – with a dash, " + "long " * 60
    )
    assert (data_of(plain) == data_of(titled)).all()
    assert titled.size[0] == plain.size[0] and titled.size[1] > plain.size[1]


# One row or one column -------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(1, 101), (101, 1)])
@pytest.mark.parametrize("spacing", [None, (0.1, 0.1)])
def test_a_profile_is_a_line_that_peaks_where_the_data_do(shape, spacing):
    x = np.arange(101) - 30
    picture = decibels.picture((-0.02 * x**2 + 12).reshape(shape), decibels.PixelAxes(spacing), floor_db=-50)
    left, top, right, bottom = picture.info["frame"]
    frame = np.asarray(picture.crop((left, top, right, bottom))).astype(int)
    blue = np.argwhere(frame[..., 2] - frame[..., 0] > 60)
    highest = blue[blue[:, 0] == blue[:, 0].min()].mean(axis=0)
    assert highest[1] / (right - left) == pytest.approx(30.5 / 101, abs=0.01)
    assert highest[0] / (bottom - top) == pytest.approx(0.04 / 1.04, abs=0.01)


def test_a_profile_is_relative_to_its_maximum_or_to_the_level_given():
    profile = np.array([[-3.0, -20, -50, -70]])
    made = decibels.picture(profile, decibels.PixelAxes((1, 0.1)))
    assert made.info["top_db"] == -3.0 and made.info["caption"] == "Maximum: -3.0 dB."
    given = decibels.picture(profile, decibels.PixelAxes((1, 0.1)), top_db=10.0)
    assert given.info["top_db"] == 10.0 and given.info["caption"] == made.info["caption"]


@pytest.mark.parametrize("n", [2, 3, 50_000])
@pytest.mark.parametrize("value", [-np.inf, 0.0])
def test_profiles_of_any_length_and_of_nothing_are_drawn(n, value):
    assert decibels.picture(np.full((1, n), value), decibels.PixelAxes((1, 0.1))).size[0] > 500


# Files and refusals ----------------------------------------------------------------------------------------


def test_an_image_shows_and_saves_its_picture(tmp_path):
    from PIL import Image

    grid = sarcl.ImageGrid.plane(shape=(6, 4), spacing=0.1)
    data = np.arange(24, dtype=np.complex64).reshape(6, 4)
    image = sarcl.Image(data, grid)
    image.save(tmp_path / "a.png", title="a")
    with Image.open(tmp_path / "a.png") as saved:
        assert saved.format == "PNG" and saved.size == image.show(title="a").size
        assert saved.text["Title"] == "a" and saved.text["Software"] == f"sarcl {sarcl.__version__}"
        assert saved.text["Description"] == image.show().info["caption"]
        assert float(saved.text["top_db"]) == pytest.approx(20 * np.log10(23)) and saved.text["floor_db"] == "-50.0"
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]
    assert image.show(floor_db=-30).size[0] > 300


def test_a_picture_that_cannot_be_written_leaves_nothing(tmp_path):
    picture = decibels.picture(np.zeros((2, 2)))
    with pytest.raises(FileNotFoundError, match="create it"):
        decibels.write_png(picture, tmp_path / "no" / "a.png")
    with pytest.raises(IsADirectoryError):
        decibels.write_png(picture, tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("db", "options", "words"),
    [
        (np.zeros(3), {}, r"shape \(3,\), wanted \(rows, columns\)"),
        (np.zeros((0, 3)), {}, "neither zero"),
        (np.zeros((2, 3), complex), {}, "wanted real decibels"),
        (np.array([[0, 1], [np.nan, 2]]), {}, r"db\[1, 0\] is nan"),
        (np.array([[0, np.inf], [1, 2]]), {}, r"db\[0, 1\] is inf"),
        (np.zeros((2, 2)), {"floor_db": 0}, "floor_db is 0"),
        (np.zeros((2, 2)), {"floor_db": 20}, "give e.g. -50"),
        (np.zeros((2, 2)), {"floor_db": np.nan}, "floor_db is nan"),
        (np.zeros((2, 2)), {"axes": decibels.PixelAxes((0.1, 0))}, r"spacing\[1\] is 0"),
        (np.zeros((2, 2)), {"top_db": np.inf}, "top_db is inf"),
        (np.zeros((2, 2)), {"percentile": 0}, "percentile is 0"),
        (np.zeros((2, 2)), {"percentile": 101}, "percentile is 101; give at most 100"),
        (np.zeros((2, 2)), {"top_db": 0.0, "percentile": 99}, "top_db and percentile both set the level of white"),
    ],
)
def test_what_cannot_be_drawn_is_refused(db, options, words):
    with pytest.raises(ValueError, match=words):
        decibels.picture(db, **options)
