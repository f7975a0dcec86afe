"""Files: paths refused before the computation, no half-written files, lossless HDF5, Gotcha, refusals of `read`."""

import os
import struct
import sys
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from scipy.io import savemat

import sarcl
from sarcl.cli.parser import main
from sarcl.io import formats, output_paths, sarcl_hdf5
from sarcl.model import store
from sarcl.model.phase_history import PER_ROW

DATA = Path(os.environ.get("SARCL_DATA") or Path(__file__).parents[2] / "../shared/data")
GOTCHA = [DATA / "gotcha" / f"data_3dsar_pass1_az00{n}_HH.mat" for n in (1, 2)]
needs_gotcha = pytest.mark.skipif(
    not all(p.exists() for p in GOTCHA), reason=f"no Gotcha files in {DATA}; set SARCL_DATA"
)


def a_report():
    return sarcl.Report(
        plan={"window": ("taylor", 35, 5), "upsampling": np.int64(4), "ratio": float("nan"), "tile": [3, 4]},
        tolerance=1e-3,
        predicted_error=np.float64(0.1) + 0.2,
        measured_error=float("nan"),
        contributions_done=2**40 + 1,
        contributions_skipped={"outside the swath": 7},
        seconds={"kernel": 1 / 3},
        device="a device",
        seed=5,
        model_error=np.float64(0.1) / 3,
    )


def a_raw(n=7, m=5, dtype=np.complex64, bistatic=True, waveform="sampled", **more):
    rng = np.random.default_rng(1)
    wave = {
        None: None,
        "chirp": sarcl.Waveform.chirp(center=9.6e9, bandwidth=6e8, duration=2e-6),
        "sampled": sarcl.Waveform.sampled(rng.normal(size=9) + 1j * rng.normal(size=9), 1e8 / 3, 1e9),
    }[waveform]
    return sarcl.PhaseHistory(
        samples=(rng.normal(size=(n, m)) + 1j * rng.normal(size=(n, m))).astype(dtype),
        frequency=1e9 + rng.normal(size=n),
        frequency_step=1e6 / 3,
        tx=rng.normal(size=(n, 3)) * 1e4,
        rx=rng.normal(size=(n, 3)) if bistatic else None,
        reference_range=rng.normal(size=n) ** 2,
        waveform=wave,
        **more,
    )


def all_optional(n=7):
    rng = np.random.default_rng(2)
    return {
        "time": rng.normal(size=n),
        "tx_channel": np.arange(n),
        "rx_channel": 3,
        "polarization": ["HH", "HV", "V", "", "VV", "VH", "HH"][:n],
        "weight": rng.random(n),
        "tx_velocity": rng.normal(size=(n, 3)),
        "rx_velocity": rng.normal(size=(n, 3)),
        "compressed": False,
        "report": a_report(),
    }


def plain(value):
    """A value of a report as files keep it: plain numbers and lists in place of NumPy's, texts in place of the rest."""
    if isinstance(value, dict):
        return {str(key): plain(v) for key, v in value.items()}
    if isinstance(value, (list, tuple)):
        return type(value)(map(plain, value))
    if isinstance(value, (np.generic, np.ndarray)):
        return plain(value.tolist())
    return value if value is None or isinstance(value, (bool, int, float)) else str(value)


def same(a, b):
    """Equal to the bit, NaN included; nouns field by field."""
    if a is None or b is None:
        return a is b
    if isinstance(a, np.ndarray) or hasattr(a, "dtype"):
        a, b = np.asarray(a), np.asarray(b)
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, sarcl.Report):
        return repr(plain(a.to_dict())) == repr(plain(b.to_dict()))
    if hasattr(a, "__dataclass_fields__"):
        return all(same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    return type(a) is type(b) and repr(a) == repr(b)


def leftovers(folder):
    return [p.name for p in Path(folder).iterdir() if p.name.endswith(".part")]


# Output paths ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "error", "words"),
    [
        ("missing/a.h5", FileNotFoundError, "create it"),
        ("file/a.h5", NotADirectoryError, "not a folder"),
        ("folder", IsADirectoryError, "give the name of a file"),
        ("n" * 300, PermissionError, "too long"),
        ("/proc/a.h5", PermissionError, "/proc"),
        ("/dev/null", PermissionError, "a device"),
    ],
)
def test_a_path_that_cannot_be_written_is_refused_with_reason_and_remedy(tmp_path, name, error, words):
    (tmp_path / "file").write_text("x")
    (tmp_path / "folder").mkdir()
    with pytest.raises(error, match=words) as caught:
        output_paths.check_writable(tmp_path / name)
    assert name in str(caught.value)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_folders_and_files_without_write_permission_are_refused(tmp_path):
    (tmp_path / "a.h5").write_text("x")
    (tmp_path / "a.h5").chmod(0o444)
    with pytest.raises(PermissionError, match="write-protected"):
        output_paths.check_writable(tmp_path / "a.h5")
    tmp_path.chmod(0o555)
    try:
        with pytest.raises(PermissionError, match="choose a folder"):
            output_paths.check_writable(tmp_path / "b.h5")
    finally:
        tmp_path.chmod(0o755)


def test_a_full_disk_is_found_before_the_work(tmp_path):
    with pytest.raises(OSError, match="GB free"):
        output_paths.check_writable(tmp_path / "a.h5", n_bytes=10**18)


def test_checking_a_path_leaves_no_trace(tmp_path):
    (tmp_path / "old").write_text("kept")
    output_paths.check_writable(tmp_path / "old")
    output_paths.check_writable(tmp_path / "new")
    assert [p.name for p in tmp_path.iterdir()] == ["old"]
    assert (tmp_path / "old").read_text() == "kept"


@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit, ValueError, MemoryError])
def test_a_stopped_write_leaves_the_old_file_and_nothing_else(tmp_path, stop):
    target = tmp_path / "a.txt"
    target.write_text("old")
    with pytest.raises(stop), output_paths.atomic(target) as part:
        part.write_text("half")
        raise stop
    assert target.read_text() == "old" and leftovers(tmp_path) == []


def test_a_finished_write_replaces_the_file_and_keeps_links_and_permissions(tmp_path):
    (tmp_path / "a.txt").write_text("old")
    (tmp_path / "a.txt").chmod(0o640)
    (tmp_path / "link").symlink_to("a.txt")
    with output_paths.atomic(tmp_path / "link") as part:
        assert part.parent == tmp_path
        part.write_text("new")
    assert (tmp_path / "link").is_symlink() and (tmp_path / "a.txt").read_text() == "new"
    assert (tmp_path / "a.txt").stat().st_mode & 0o777 == 0o640 and leftovers(tmp_path) == []


# Phase histories in HDF5 -----------------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", [np.complex64, np.complex128])
@pytest.mark.parametrize("waveform", [None, "chirp", "sampled"])
@pytest.mark.parametrize("optional", [False, True])
def test_a_phase_history_returns_from_its_file_bit_by_bit(tmp_path, dtype, waveform, optional):
    raw = a_raw(dtype=dtype, waveform=waveform, **(all_optional() if optional else {}))
    raw.save(tmp_path / "a.h5")
    again = sarcl.read(tmp_path / "a.h5")
    for field in fields(raw):
        assert same(getattr(raw, field.name), getattr(again, field.name)), field.name


def test_a_report_returns_with_its_tuples_numbers_and_nan(tmp_path):
    a_raw(report=a_report()).save(tmp_path / "a.h5")
    report = sarcl.read(str(tmp_path / "a.h5")).report
    assert report.plan["window"] == ("taylor", 35, 5) and report.plan["tile"] == [3, 4]
    assert report.plan["upsampling"] == 4 and np.isnan(report.measured_error) and report.seed == 5
    assert report.predicted_error == 0.1 + 0.2 and report.contributions_done == 2**40 + 1


def test_a_monostatic_phase_history_stays_monostatic(tmp_path):
    a_raw(bistatic=False).save(tmp_path / "a.h5")
    again = sarcl.read(tmp_path / "a.h5")
    assert again.rx is again.tx


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1)])
def test_one_row_and_one_sample_are_kept(tmp_path, shape):
    raw = a_raw(*shape)
    raw.save(tmp_path / "a.h5")
    assert same(raw.samples, sarcl.read(tmp_path / "a.h5").samples)


def test_samples_are_copied_in_blocks_and_read_only_as_asked(tmp_path):
    raw, asked = a_raw(7, 2**18), []  # blocks of 2^22 bytes: two rows of complex64

    class Source:
        shape, dtype = raw.samples.shape, raw.samples.dtype

        def __getitem__(self, rows):
            asked.append((rows.start, rows.stop))
            return raw.samples[rows]

    replace(raw, samples=Source()).save(tmp_path / "a.h5")
    assert asked == [(0, 2), (2, 4), (4, 6), (6, 7)]
    again = sarcl.read(tmp_path / "a.h5")
    assert isinstance(again.samples, h5py.Dataset)
    assert same(again.read(3, 6), raw.samples[3:6])
    assert same(again[[5, 1]].read(0, 2), raw.samples[[5, 1]])


def test_a_phase_history_may_be_saved_over_the_file_it_is_read_from(tmp_path):
    path = tmp_path / "a.h5"
    raw = a_raw(**all_optional())
    raw.save(path)
    lazy = sarcl.read(path)
    lazy.save(path)
    lazy[[6, 2, 3]].save(path)
    assert same(lazy.samples, raw.samples)
    assert same(sarcl.read(path).samples, raw.samples[[6, 2, 3]])
    assert leftovers(tmp_path) == []


def test_a_nan_found_while_saving_leaves_the_old_file(tmp_path):
    path = tmp_path / "a.h5"
    a_raw().save(path)
    bad = np.lib.format.open_memmap(tmp_path / "bad.npy", "w+", np.complex64, (7, 5))
    bad[4, 2] = np.nan
    with pytest.raises(ValueError, match=r"samples\[4, 2\] is"):
        replace(a_raw(), samples=bad).save(path)
    assert same(sarcl.read(path).samples, a_raw().samples) and leftovers(tmp_path) == []


@pytest.mark.parametrize(
    "array",
    [
        sarcl.AntennaArray.linear(5, spacing=0.015, frequency_step=20e6).mirrored(3, 7),
        sarcl.AntennaArray.planar((2, 2), spacing=(0.1, 0.2), weights=[1, 1j, 0.5, -2]),
    ],
)
def test_an_array_comes_back_as_it_was(tmp_path, array):
    a_raw(array=array).save(tmp_path / "a.h5")
    found = sarcl.read(tmp_path / "a.h5").array
    for name in array.__dataclass_fields__:
        assert same(getattr(found, name), getattr(array, name)) or getattr(array, name) is None
    assert (found.plan is None) == (array.plan is None)


def test_what_is_no_array_is_refused():
    with pytest.raises(TypeError, match=r"array is a object; give a sarcl\.AntennaArray"):
        a_raw(array=object())


def test_every_optional_field_of_the_noun_is_in_the_tests():
    assert set(PER_ROW) <= set(all_optional())


# Images in HDF5 --------------------------------------------------------------------------------------------


def a_grid(kind="plane"):
    if kind == "plane":
        return sarcl.ImageGrid.plane(center=(1 / 3, 2, 3), shape=(6, 4), spacing=(0.1, 0.2), normal=(0.1, 0, 1))
    return sarcl.ImageGrid.points(np.random.default_rng(3).normal(size=(6, 4, 2, 3)))


@pytest.mark.parametrize("kind", ["plane", "points"])
@pytest.mark.parametrize("dtype", ["c8", "c16", "f4", "f8"])
@pytest.mark.parametrize("full", [False, True])
def test_an_image_returns_from_its_file_bit_by_bit(tmp_path, kind, dtype, full):
    grid = a_grid(kind)
    data = np.random.default_rng(4).normal(size=grid.shape).astype(dtype)
    data.flat[3] = np.nan
    more = {"gain": 1 / 3, "frequency": 9.6e9, "tx": (1, 2, 1 / 3), "rx": (4, 5, 6), "report": a_report()}
    image = sarcl.Image(data, grid, **(more if full else {}))
    image.save(tmp_path / "a.h5")
    again = sarcl.read(tmp_path / "a.h5")
    assert isinstance(again.data, h5py.Dataset) and same(image, again)
    assert same(again.grid.positions, grid.positions)
    arrays = [v for v in vars(again.grid).values() if isinstance(v, np.ndarray)]
    assert arrays and not any(v.flags.writeable for v in arrays)


def test_an_image_is_written_in_blocks_of_rows(tmp_path):
    data = np.arange(5 * 2**19, dtype=np.float32).astype(np.complex64).reshape(5, 2**19)  # blocks of four rows
    sarcl.Image(data, sarcl.ImageGrid.plane(shape=data.shape, spacing=0.1)).save(tmp_path / "a.h5")
    assert same(sarcl.read(tmp_path / "a.h5").data, data)


def image_writer(path, grid):
    return sarcl_hdf5.ImageWriter(path, formats.fields_of(grid))


def test_an_image_larger_than_memory_is_written_piece_by_piece(tmp_path):
    path, grid = tmp_path / "a.h5", a_grid()
    out = image_writer(path, grid)
    assert not path.exists()
    out.data[2:4] = 1 + 2j
    image = store.finish_image(out, grid, gain=2.0, frequency=1e9, tx=(1, 2, 3), rx=(1, 2, 3), report=a_report())
    assert (image.data[2:4] == 1 + 2j).all() and not image.data[:2].any() and image.gain == 2
    assert isinstance(image.data, h5py.Dataset) and same(image.grid, grid)
    assert leftovers(tmp_path) == [] and path.exists()
    out.abandon()  # too late to take back
    assert path.exists()


def test_an_abandoned_image_leaves_nothing(tmp_path):
    out = image_writer(tmp_path / "a.h5", a_grid())
    out.data[0] = 1
    out.abandon()
    out.abandon()
    with pytest.raises(KeyboardInterrupt), image_writer(tmp_path / "a.h5", a_grid()):
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ValueError, match="finished or abandoned already"):
        store.finish_image(out, a_grid())
    with pytest.raises(ValueError, match="finished or abandoned already"):
        out.close({"gain": 1.0})


def test_an_image_with_a_wrong_field_is_not_finished(tmp_path):
    out = image_writer(tmp_path / "a.h5", a_grid())
    with pytest.raises(ValueError, match="gain"):
        store.finish_image(out, a_grid(), gain=-1)
    assert list(tmp_path.iterdir()) == []


def test_an_image_file_is_refused_before_the_work_when_it_cannot_be_written(tmp_path):
    with pytest.raises(FileNotFoundError, match="missing"):
        image_writer(tmp_path / "missing" / "a.h5", a_grid())
    huge = sarcl.ImageGrid.plane(shape=(10**7, 10**7), spacing=1.0)
    with pytest.raises(OSError, match="GB free"):
        image_writer(tmp_path / "a.h5", huge)
    assert list(tmp_path.iterdir()) == []


# HDF5 files that are not what they should be ---------------------------------------------------------------


def test_a_newer_format_asks_for_a_newer_sarcl(tmp_path):
    a_raw().save(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file.attrs["format"] = 2
    with pytest.raises(ValueError, match=r"a\.h5.*format 2.*reads format 1; update"):
        sarcl.read(tmp_path / "a.h5")


@pytest.mark.parametrize("mark", [None, "recipe", 7, np.zeros(3)])
def test_a_foreign_hdf5_file_is_refused(tmp_path, mark):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["samples"] = np.zeros((2, 2))
        if mark is not None:
            file.attrs["sarcl_file"], file.attrs["format"] = mark, 1
    with pytest.raises(ValueError, match="HDF5 but not sarcl's"):
        sarcl.read(tmp_path / "a.h5")


@pytest.mark.parametrize("lost", ["samples", "tx", "frequency"])
def test_a_phase_history_without_a_part_is_damaged(tmp_path, lost):
    a_raw().save(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "a") as file:
        del file[lost]
    with pytest.raises(ValueError, match="damaged"):
        sarcl.read(tmp_path / "a.h5")


@pytest.mark.parametrize("lost", ["data", "grid", "grid/spacing"])
def test_an_image_without_a_part_is_damaged(tmp_path, lost):
    sarcl.Image(np.zeros((6, 4), "c8"), a_grid()).save(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "a") as file:
        del file[lost]
    with pytest.raises(ValueError, match="damaged"):
        sarcl.read(tmp_path / "a.h5")


@pytest.mark.parametrize("part", [0.01, 0.3, 0.6, 0.9, 0.999])
def test_a_truncated_hdf5_file_is_refused(tmp_path, part):
    a_raw(200, 50).save(tmp_path / "a.h5")
    whole = (tmp_path / "a.h5").read_bytes()
    (tmp_path / "b.h5").write_bytes(whole[: int(len(whole) * part)])
    with pytest.raises(
        ValueError, match=r"b\.h5' is (truncated|not an HDF5 file, or damaged)|b\.h5' is damaged: its list of"
    ):
        sarcl.read(tmp_path / "b.h5")


# Gotcha ----------------------------------------------------------------------------------------------------


def a_gotcha(n_frequencies=6, n_pulses=4, af=True):
    """A struct like the data set's, of small size."""
    rng = np.random.default_rng(5)
    n = n_pulses
    angle = np.arange(n) * 1e-4
    tx = np.stack([7089 * np.cos(angle), 7089 * np.sin(angle), np.full(n, 7275.0)]).astype(np.float32)
    fp = rng.normal(size=(n_frequencies, n)) + 1j * rng.normal(size=(n_frequencies, n))
    data = {
        "fp": fp.astype(np.complex64),
        "freq": (9.288e9 + 1.4713e6 * np.arange(n_frequencies)).astype(np.float32)[:, None],
        "x": tx[0],
        "y": tx[1],
        "z": tx[2],
        "r0": np.linalg.norm(tx.astype(float), axis=0).astype(np.float32),
        "th": np.zeros(n, np.float32),
        "phi": np.zeros(n, np.float32),
    }
    if af:
        data["af"] = {
            "r_correct": rng.normal(size=n).astype(np.float32) * 0.3,
            "ph_correct": rng.normal(size=n).astype(np.float32),
        }
    return data


def write_gotcha(folder, data, name="data_3dsar_pass1_az001_HH.mat"):
    savemat(folder / name, {"data": data})
    return folder / name


def test_a_gotcha_file_keeps_its_numbers(tmp_path):
    data = a_gotcha()
    raw = sarcl.read(write_gotcha(tmp_path, data), autofocus=False)
    assert raw.samples.dtype == np.complex64 and (raw.samples == data["fp"].T).all()
    assert (raw.tx == np.stack([data["x"], data["y"], data["z"]], axis=1)).all()
    assert raw.is_monostatic and set(raw.polarization) == {"HH"} and raw.compressed
    # The line through float32 values (spacing 1024 Hz) is nearer to the truth than they are.
    assert raw.frequency[0] == pytest.approx(9.288e9, abs=1024)
    assert raw.frequency_step[0] == pytest.approx(1.4713e6, abs=512)


def test_the_reference_range_is_the_length_of_the_position(tmp_path):
    raw = sarcl.read(write_gotcha(tmp_path, a_gotcha()))
    assert (raw.reference_range == np.linalg.norm(raw.tx, axis=1)).all()


def test_autofocus_turns_the_phase_by_ph_correct_less_the_way_of_r_correct(tmp_path):
    data = a_gotcha()
    path = write_gotcha(tmp_path, data)
    raw, plain = sarcl.read(path, autofocus=True), sarcl.read(path)
    f = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)
    r, phase = (data["af"][n].astype(float)[:, None] for n in ("r_correct", "ph_correct"))
    expected = plain.samples * np.exp(1j * (phase - 4 * np.pi * f * r / 299792458))
    np.testing.assert_allclose(raw.samples, expected, rtol=3e-7)  # float32 rounding of each sample


@pytest.mark.parametrize("af", [None, {}, np.zeros((0, 0)), {"other": 1.0}])
def test_without_autofocus_fields_the_samples_are_as_they_are(tmp_path, af):
    data = a_gotcha(af=False)
    if af is not None:
        data["af"] = af
    assert (sarcl.read(write_gotcha(tmp_path, data)).samples == data["fp"].T).all()


def test_one_autofocus_field_alone_is_applied(tmp_path):
    data = a_gotcha()
    del data["af"]["r_correct"]
    raw = sarcl.read(write_gotcha(tmp_path, data), autofocus=True)
    turned = data["fp"].T * np.exp(1j * data["af"]["ph_correct"].astype(float))[:, None]
    np.testing.assert_allclose(raw.samples, turned, rtol=3e-7)


@pytest.mark.parametrize("name", ["fp", "freq", "x", "y", "z", "r0"])
def test_a_missing_gotcha_field_is_named(tmp_path, name):
    data = a_gotcha()
    del data[name]
    with pytest.raises(ValueError, match=rf"az001_HH\.mat: 'data' has no field '{name}'"):
        sarcl.read(write_gotcha(tmp_path, data))


@pytest.mark.parametrize("name", ["freq", "x", "y", "z", "r0"])
def test_a_gotcha_field_of_the_wrong_length_is_named(tmp_path, name):
    data = a_gotcha()
    data[name] = data[name][:-1]
    with pytest.raises(ValueError, match=rf"az001_HH\.mat: {name} has shape"):
        sarcl.read(write_gotcha(tmp_path, data))


def test_a_gotcha_correction_of_the_wrong_length_is_named(tmp_path):
    data = a_gotcha()
    data["af"]["r_correct"] = data["af"]["r_correct"][:2]
    with pytest.raises(ValueError, match=r"az001_HH\.mat: r_correct has shape"):
        sarcl.read(write_gotcha(tmp_path, data), autofocus=True)


@pytest.mark.parametrize("name", ["fp", "freq", "x", "r0"])
def test_a_nan_in_a_gotcha_field_is_named_with_its_place(tmp_path, name):
    data = a_gotcha()
    data[name].flat[2] = np.nan
    with pytest.raises(ValueError, match=rf"az001_HH\.mat: {name}\[\d, \d\] is \(?nan"):
        sarcl.read(write_gotcha(tmp_path, data))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"fp": np.zeros((6, 4, 2), np.complex64)}, "fp has shape"),
        ({"fp": np.zeros((0, 4), np.complex64)}, "fp is empty"),
        ({"fp": "text"}, "fp must be numbers"),
        ({"x": np.full(4, 1j)}, "x is complex"),
        ({"fp": np.ones((1, 4), np.complex64), "freq": np.float32(9e9)}, "at least two"),
        ({"r0": np.full(4, 9000.0)}, r"r0\[\d\] is 9000"),
        ({"freq": np.array([9.0e9, 9.001e9, 9.0e9, 9.003e9, 9.004e9, 9.005e9])}, "off a uniform step"),
        ({"freq": 9e9 - 1e6 * np.arange(6)}, "frequency_step.*reverse"),
    ],
)
def test_a_gotcha_field_that_makes_no_sense_is_named(tmp_path, change, words):
    with pytest.raises(ValueError, match=words):
        sarcl.read(write_gotcha(tmp_path, a_gotcha() | change))


@pytest.mark.parametrize("data", [np.arange(3), "text", np.zeros((0, 0))])
def test_a_mat_file_whose_data_is_no_struct_is_refused(tmp_path, data):
    with pytest.raises(ValueError, match=r"'data' is .*wanted one struct"):
        sarcl.read(write_gotcha(tmp_path, data))


def test_a_mat_file_of_something_else_is_refused(tmp_path):
    savemat(tmp_path / "a.mat", {"x": np.arange(3)})
    with pytest.raises(ValueError, match="no struct 'data'"):
        sarcl.read(tmp_path / "a.mat")


@pytest.mark.parametrize("compress", [False, True])
def test_a_truncated_mat_file_is_refused_wherever_it_is_cut(tmp_path, compress):
    savemat(tmp_path / "a.mat", {"data": a_gotcha()}, do_compression=compress)
    whole = (tmp_path / "a.mat").read_bytes()
    for size in [1, 60, 127, 128, 129, 136, 140, *range(150, len(whole), 97), len(whole) - 1]:
        (tmp_path / "b.mat").write_bytes(whole[:size])
        with pytest.raises(ValueError, match=r"b\.mat"):
            sarcl.read(tmp_path / "b.mat")


@needs_gotcha
@pytest.mark.parametrize("part", [0.001, 0.1, 0.5, 0.9, 0.99, 0.9999])
def test_a_truncated_gotcha_file_is_refused(tmp_path, part):
    whole = GOTCHA[0].read_bytes()
    (tmp_path / "cut.mat").write_bytes(whole[: int(len(whole) * part)])
    with pytest.raises(ValueError, match=r"cut\.mat"):
        sarcl.read(tmp_path / "cut.mat")


def exact_image(raw, points):
    """The image sum in float64, one pulse at a time."""
    out = np.zeros(len(points), complex)
    f = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)
    for s, tx, r in zip(raw.samples, raw.tx, raw.reference_range, strict=True):
        delta = np.linalg.norm(points - tx, axis=1) - r
        out += np.exp(4j * np.pi / 299792458 * np.outer(delta, f)) @ s.astype(complex)
    return out


@needs_gotcha
def test_two_gotcha_files_focus_together_on_their_brightest_reflector():
    raw = sarcl.read(GOTCHA, autofocus=False)
    assert raw.n_rows == 234 and raw.n_samples == 424 and set(raw.polarization) == {"HH"}
    step = np.arange(-6, 7) * 0.1
    points = np.stack([*np.meshgrid(-15.6 + step, 21.6 + step), np.zeros((13, 13))], axis=-1).reshape(-1, 3)
    image = np.abs(exact_image(raw, points))
    peak = points[image.argmax()]
    assert np.abs(peak[:2] - (-15.6, 21.6)).max() < 0.11
    # With every pulse in phase, the peak would be the sum of the peaks of the pulses.
    alone = [abs(exact_image(raw[i], peak[None])[0]) for i in range(0, 234, 6)]
    assert image.max() > 0.97 * np.mean(alone) * 234


@needs_gotcha
def test_gotcha_autofocus_sharpens_the_reflector_it_was_made_from():
    def straightness(raw, where):
        """Standard deviation from pulse to pulse of the reflector's range, m."""
        ranges = np.arange(-0.5, 0.51, 0.02)
        f = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)
        delta = np.linalg.norm(np.array(where) - raw.tx, axis=1) - raw.reference_range
        turned = raw.samples * np.exp(4j * np.pi / 299792458 * np.outer(delta, f))
        profile = np.abs(turned @ np.exp(4j * np.pi / 299792458 * np.outer(f, ranges)))
        return ranges[profile.argmax(axis=1)].std()

    before = straightness(sarcl.read(GOTCHA, autofocus=False), (-15.6, 21.6, 0))
    after = straightness(sarcl.read(GOTCHA, autofocus=True), (-15.2, 22.1, 0))
    assert before > 0.015 and after < 0.008


# read ------------------------------------------------------------------------------------------------------


def test_what_a_file_is_follows_from_its_content_not_its_name(tmp_path):
    a_raw().save(tmp_path / "a.h5")
    (tmp_path / "a.h5").rename(tmp_path / "a.mat")
    write_gotcha(tmp_path, a_gotcha()).rename(tmp_path / "b.h5")
    assert sarcl.read(tmp_path / "a.mat").n_rows == 7
    assert sarcl.read(tmp_path / "b.h5").n_rows == 4


def test_several_files_are_one_phase_history_in_the_order_given(tmp_path):
    raw = a_raw(bistatic=False)
    raw[:3].save(tmp_path / "a.h5")
    raw[3:].save(tmp_path / "b.h5")
    both = sarcl.read([tmp_path / "b.h5", str(tmp_path / "a.h5")])
    assert same(both.samples, raw.samples[[3, 4, 5, 6, 0, 1, 2]])
    assert sarcl.read((tmp_path / "a.h5",)).n_rows == 3


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b"hello, this is text", "starts with b'hello, this "),
        (b"CPHD/1.0.1\nXML", "is truncated or damaged|pip install"),
        (b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + bytes(600), r"7\.3.*-v7"),
        (b"\x89PNG\r\n\x1a\n", "no file kind sarcl knows"),
        (b"MATLAB 5.0 MAT-file" + bytes(200), "cannot be read as a MATLAB 5 file|no struct 'data'"),
        (b"\x89HDF\r\n\x1a\n" + struct.pack("<50d", *range(50)), "damaged"),
    ],
)
@pytest.mark.parametrize("name", ["a.mat", "a.h5", "a.cphd"])
def test_a_file_that_is_not_what_its_name_says_is_refused(tmp_path, name, content, words):
    (tmp_path / name).write_bytes(content)
    with pytest.raises((ValueError, ImportError), match=words) as caught:
        sarcl.read(tmp_path / name)
    assert name in str(caught.value) or caught.type is ImportError


def test_an_unknown_kind_is_refused_with_what_can_be_read(tmp_path):
    (tmp_path / "a.bin").write_bytes(b"12345")
    with pytest.raises(ValueError, match=r"sarcl reads .*HDF5.*Gotcha \.mat"):
        sarcl.read(tmp_path / "a.bin")


def test_a_new_format_is_one_file_and_one_line_of_the_table(tmp_path, monkeypatch, capsys):
    class Writer:
        def __init__(self, path, grid, dtype):
            self.path, self.data = path, np.zeros(grid["shape"], dtype)

        def __enter__(self):
            return self

        def __exit__(self, *exc):
            pass

        def close(self, fields):
            self.path.write_bytes(b"toy" + self.data.tobytes() + np.float64(fields["gain"]).tobytes())

    def load(path, make):
        data = np.frombuffer(path.read_bytes()[3:-8], np.complex64).reshape(2, 3)
        grid = {"shape": (2, 3), "center": np.zeros(3), "spacing": (1, 1), "x_axis": X, "y_axis": Y}
        return make("image", {"data": data, "grid": grid, "gain": np.frombuffer(path.read_bytes()[-8:])[0]})

    X, Y = np.eye(3)[:2]
    toy = formats.Format((".toy",), b"toy", "toys (.toy)", "_toy", writes=("image",))
    monkeypatch.setattr(formats, "FORMATS", (*formats.FORMATS, toy))
    monkeypatch.setitem(sys.modules, f"{formats.__package__}._toy", SimpleNamespace(load=load, ImageWriter=Writer))
    image = sarcl.Image(
        np.arange(6, dtype=np.complex64).reshape(2, 3), sarcl.ImageGrid.plane(shape=(2, 3), spacing=1.0), gain=3.0
    )
    image.save(tmp_path / "a.toy")
    again = sarcl.read(tmp_path / "a.toy")
    assert same(again.data, image.data) and again.gain == 3.0 and same(again.grid.positions, image.grid.positions)
    with pytest.raises(ValueError, match=r"choose '\.png', '\.h5', '\.nitf', '\.zarr', '\.nc', '\.tif' or '\.toy'"):
        image.save(tmp_path / "a.bmp")
    (tmp_path / "b.toy").write_bytes(b"12345")
    with pytest.raises(
        ValueError,
        match=r"although its name ends in '\.toy'; sarcl reads .*CRSD files, SICD files, .* and toys \(\.toy\)",
    ):
        sarcl.read(tmp_path / "b.toy")
    with pytest.raises(SystemExit):
        main(["focus", "--help"])
    said = " ".join(capsys.readouterr().out.split())
    assert "toys (.toy)" in said and ".png, .h5, .nitf, .zarr, .nc, .tif or .toy" in said
    assert formats.named("a.toy", formats.writing("image", by_blocks=True)) is None


@pytest.mark.parametrize("name", ["no.h5", "no.mat", "no"])
def test_a_missing_file_is_named(tmp_path, name):
    with pytest.raises(FileNotFoundError, match=rf"{name}' does not exist"):
        sarcl.read(tmp_path / name)


def test_a_folder_an_empty_list_and_a_number_are_refused(tmp_path):
    with pytest.raises(IsADirectoryError, match="glob"):
        sarcl.read(tmp_path)
    with pytest.raises(ValueError, match="empty list"):
        sarcl.read([])
    with pytest.raises(TypeError, match="file name"):
        sarcl.read(7)


def test_an_image_among_phase_histories_is_refused(tmp_path):
    a_raw().save(tmp_path / "a.h5")
    sarcl.Image(np.zeros((6, 4), "c8"), a_grid()).save(tmp_path / "b.h5")
    with pytest.raises(ValueError, match=r"b\.h5' holds an image"):
        sarcl.read([tmp_path / "a.h5", tmp_path / "b.h5"])


def test_parts_that_do_not_fit_together_are_refused(tmp_path):
    a_raw(3, 5).save(tmp_path / "a.h5")
    a_raw(3, 6).save(tmp_path / "b.h5")
    with pytest.raises(ValueError, match="part 1 has 6 samples"):
        sarcl.read([tmp_path / "a.h5", tmp_path / "b.h5"])


@pytest.mark.parametrize("name", ["x.mat", "x.png", "x.raw", "x"])
def test_echoes_are_written_to_no_file_whose_name_promises_another_format(tmp_path, name):
    raw = sarcl.PhaseHistory(np.ones((2, 4), complex), 9e9, 1e6, np.ones((2, 3)), 10.0)
    with pytest.raises(ValueError, match=r"phase history path .* sarcl writes a phase history to '.h5'"):
        raw.save(tmp_path / name)
    assert not list(tmp_path.iterdir())
