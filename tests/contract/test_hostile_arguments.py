"""What is no number, no index, no name of a file and no function, given to cheap calls: refused in sarcl's words.

Each argument in turn is replaced by values of every wrong kind. What is accepted may be right (True is 1 for a flag);
what is refused must be refused by a `raise` of sarcl, whose message names the argument and has no words of others.
"""

from __future__ import annotations

import datetime
import itertools
import linecache
import warnings
from pathlib import Path

import numpy as np
import pytest
from helpers.cases import SCENARIO, noise_on, straight
from test_messages import FOREIGN

import sarcl
from sarcl import array_factor, illumination, motion, noise, papers, pointing, radar, shapes, wgs84
from sarcl import scenario as scenarios
from sarcl.scene import material_arguments

ROOT = Path(sarcl.__file__).parent
KINDS = {
    "None": lambda: None, "nan": lambda: float("nan"), "inf": lambda: float("inf"), "-1": lambda: -1,
    "10**9": lambda: 10**9, "10**30": lambda: 10**30, "1e308": lambda: 1e308, "text": lambda: "x",
    "bytes": lambda: b"x",
    "number in text": lambda: "3", "nothing": lambda: [], "ragged": lambda: [[1], [2, 3]], "object": object,
    "complex": lambda: 1j, "masked": lambda: np.ma.masked_array([1.0, 2, 3], mask=[0, 1, 0]), "dict": dict,
    "set": lambda: {1}, "generator": lambda: (i for i in (1.0, 2.0)), "True": lambda: True,
    "float16": lambda: np.float16(1), "mixed": lambda: np.array([1, "a", None], object), "class": lambda: int,
    "function": lambda: lambda *_: 1.0, "date": lambda: datetime.datetime(2020, 1, 1),
    "date64": lambda: np.datetime64("2020-01-01"), "words": lambda: ["x"], "matrix": lambda: np.eye(2),
    "long text": lambda: "a" * 10**5,
}  # fmt: skip
OTHERS = (
    *FOREIGN, "ufunc", "'NoneType' object", "only 0-dimensional", "not supported between", "expected str",
    "out of bounds",
)  # fmt: skip

RAW = noise_on(straight(16), n_samples=32)
NAMED = noise_on(
    straight(16), n_samples=32, polarization=["HH"] * 16, rx_channel=np.zeros(16, int), tx_channel=np.zeros(16, int)
)
GRID = sarcl.ImageGrid.plane(shape=(8, 8), spacing=0.1)
LISTED = sarcl.ImageGrid.points(GRID.positions)
IMAGE = sarcl.Image(np.ones((8, 8), np.complex64), GRID)
TRACK = sarcl.Trajectory.line(start=(0, -5, 1e3), velocity=(0, 10, 0), prf=16.0, n_pulses=16)
BOX, CHIRP = shapes.box((1, 1, 1)), sarcl.Waveform.chirp(center=9e9, bandwidth=1e8, duration=1e-6)
ARRAY, RADAR = sarcl.AntennaArray.linear(4, spacing=0.1), sarcl.Radar(power=100.0)
ORBIT = sarcl.Orbit.kepler(7.07e6, 0.001, 1.7, span=(-60, 720))
DEM = sarcl.ElevationModel(np.linspace(12, 12.1, 5), np.linspace(42, 42.1, 6), np.zeros((6, 5)))
ROUGH = sarcl.Material(4.0, height=np.inf, diagram="exp", width=0.2)
TIME = {"samples": np.ones((16, 64), complex), "rate": 1e8, "carrier": 9e9, "tx": TRACK.positions}
FDA = {"f0": 1e10, "spacing": (0.015, 0.015), "frequency_step": (1e4, 2e4), "retarded": 0.0}
# what is called, its arguments, and the names of those that are replaced; None: all
CALLS = {
    "lit": (
        illumination.lit, {"triangles": BOX.triangles, "tx": TRACK.positions},
        "triangles tx rx two_sided tolerance accuracy max_bytes device",
    ),
    "facet_shares": (illumination.facet_shares, {"scene": BOX, "track": TRACK}, "scene track receiver device progress"),
    "pixel_shares": (
        illumination.pixel_shares,
        {"scene": BOX, "grid": sarcl.ImageGrid.plane(shape=(3, 3), spacing=(1, 1)), "track": TRACK},
        "scene grid track receiver tolerance device progress",
    ),
    "ElevationModel": (
        sarcl.ElevationModel, {"longitude": [12, 12.1], "latitude": [42, 42.1], "height": np.zeros((2, 2))}, None,
    ),
    "heights_at": (DEM.heights_at, {"longitude": 12.05, "latitude": 42.05}, None),
    "grid_positions": (
        DEM.grid_positions, {"spacing": (1e3, 1e3), "frame": "local", "center": (12.05, 42.05)}, None
    ),
    "on_terrain": (sarcl.ImageGrid.on_terrain, {"dem": DEM, "spacing": 1e3}, "dem spacing center frame"),
    "on_map": (
        sarcl.ImageGrid.on_map, {"crs": "EPSG:4326", "bounds": (12, 42, 12.1, 42.1), "spacing": 0.01, "heights": 0.0},
        "crs bounds spacing heights",
    ),
    "Radar.amplitude": (
        RADAR.amplitude, {"frequency": 1e9, "tx_range": 1.0, "rx_range": 1.0, "tx_gain": 1.0, "rx_gain": 1.0}, None
    ),
    "spreading": (radar.spreading, {"tx_range": 1.0, "rx_range": 1.0}, None),
    "AntennaArray.planar": (
        sarcl.AntennaArray.planar, {"shape": (3, 3), "spacing": (1.0, 1.0), "axes": ((0, 1.0, 0), (0, 0, 1.0))}, None
    ),
    "switched": (ARRAY.switched, {"other": ARRAY, "at": 2, "n_pulses": 4}, None),
    "subarrays": (ARRAY.subarrays, {"count": 2}, None),
    "ImageGrid": (
        sarcl.ImageGrid,
        {"shape": (4, 4), "center": (0, 0, 0), "spacing": (1.0, 1.0), "x_axis": (1, 0, 0), "y_axis": (0, 1, 0)}, None,
    ),
    "ImageGrid.points": (sarcl.ImageGrid.points, {"positions": GRID.positions}, "positions valid"),
    "columns": (GRID.columns, {"start": 0, "stop": 2}, None),
    "sample": (GRID.sample, {"most": 3, "seed": 0}, None),
    "positions_of": (LISTED.positions_of, {"index": (np.array([0]), np.array([0]))}, None),
    "at": (GRID.at, {"row": 0, "column": 0}, None),
    "index": (GRID.index, {"position": (0, 0, 0)}, None),
    "Image[]": (IMAGE.__getitem__, {"index": 0}, None),
    "Image.show": (IMAGE.show, {"floor_db": -50.0}, "floor_db top_db percentile title"),
    "Image.save": (IMAGE.save, {"path": "a.png"}, None),
    "kepler": (
        sarcl.Orbit.kepler, {"semi_major_axis": 7.07e6, "eccentricity": 0.001, "inclination": 1.7}, None
    ),
    "Orbit.read": (sarcl.Orbit.read, {"path": "a.EOF"}, None),
    "Orbit.trajectory": (ORBIT.trajectory, {"prf": 100.0, "center": 10.0, "duration": 0.1}, "center duration"),
    "footprint": (ORBIT.footprint, {"t": 100.0, "look": 0.5, "width": (0.01, 0.05), "n": 8}, None),
    "from_time": (
        sarcl.PhaseHistory.from_time, {**TIME, "start": 0.0, "reference_range": 0.0},
        "samples rate start reference_range",
    ),
    "from_time, chirped": (
        sarcl.PhaseHistory.from_time,
        {**TIME, "kind": "chirped", "waveform": sarcl.Waveform.chirp(center=9e9, bandwidth=5e7, duration=1e-7)}, "rate",
    ),
    "PhaseHistory": (
        sarcl.PhaseHistory,
        {n: getattr(RAW, n) for n in ("samples", "frequency", "frequency_step", "tx", "reference_range")},
        "frequency_step tx_channel rx_channel",
    ),
    "raw.read": (RAW.read, {"start": 0, "stop": 4}, None),
    "raw.select": (NAMED.select, {"polarization": "HH", "channel": 0, "sender": 0}, None),
    "raw.time_signal": (RAW.time_signal, {"oversample": 1}, None),
    "raw.save": (RAW.save, {"path": "a.h5"}, None),
    "raw[]": (RAW.__getitem__, {"rows": slice(0, 4)}, None),
    "noisy rows": (sarcl.add_noise(RAW, variance=1.0).samples.__getitem__, {"index": slice(0, 4)}, None),
    "picked": (TRACK.picked, {"pulses": slice(0, 4)}, None),
    "lobe": (ROUGH.lobe, {"delta": 0.1}, None),
    "permittivity": (ROUGH.permittivity, {"frequency": 1e9}, None),
    "pulse_spectrum": (CHIRP.pulse_spectrum, {"frequency": 9e9}, None),
    "box": (shapes.box, {"size": (1, 1, 1)}, "size position rotation edge"),
    "cone": (shapes.cone, {"radius": 1.0, "height": 1.0, "sections": 8}, "radius height rotation edge"),
    "Scene": (
        sarcl.Scene,
        {"positions": [[0, 0, 0.0]], "amplitudes": [1.0], "triangles": np.zeros((0, 3, 3)), "reflectivity": [],
         "roughness": [], "two_sided": np.zeros(0, bool)}, "positions triangles material materials",
    ),
    "Scene.part": (BOX.part, {"which": slice(0, 2)}, None),
    "Scene.on_earth": (BOX.on_earth, {"longitude": 12.0, "latitude": 42.0, "height": 0.0}, None),
    "perturbed": (motion.perturbed, {"track": TRACK, "rms": 0.01, "correlation_time": 0.5}, None),
    "relative": (motion.relative, {"track": TRACK, "epoch": 0.0}, None),
    "spotlight": (pointing.spotlight, {"track": TRACK, "point": (0, 0, 0)}, None),
    "cell_area": (noise.cell_area, {"raw": RAW, "point": (0, 0, 0)}, None),
    "papers.find": (papers.find, {"name": "wan"}, None),
    "ecef": (wgs84.ecef, {"longitude": 12.0, "latitude": 42.0, "height": 0.0}, None),
    "up": (wgs84.up, {"longitude": 12.0, "latitude": 42.0}, None),
    "vertical_at": (wgs84.vertical_at, {"position": (7e6, 0, 0)}, None),
    "is_earth_fixed": (wgs84.is_earth_fixed, {"antenna": (7e6, 0, 0)}, None),
    "beam_angles": (array_factor.beam_angles, {**FDA, "lobe": (0, 0)}, None),
    "power_pattern": (array_factor.power_pattern, {"factor": np.ones(3), "peak": 3.0}, None),
    "peak_delay": (
        array_factor.peak_delay, {"f0": 1e10, "spacing": 0.015, "frequency_step": 1e6, "azimuth": 0.1,
         "elevation": 0.0},
        "azimuth elevation",
    ),
    "waveform": (
        array_factor.waveform,
        {"f0": 1e10, "n": 5, "spacing": 0.015, "frequency_step": 1e6, "azimuth": 0.1, "retarded": 0.0},
        "azimuth retarded",
    ),
    "read": (sarcl.read, {"path": "a.h5"}, "path autofocus external"),
    "scenario.load": (scenarios.load, {"path": "a.toml"}, None),
    "scenario.loads": (scenarios.loads, {"text": SCENARIO}, None),
    "Scenario.save": (scenarios.loads(SCENARIO).save, {"path": "b.toml"}, None),
    "Orbit": (sarcl.Orbit, {"path": ORBIT.path, "span": (-60, 720), "epoch": "2020-01-01"}, None),
    "Image": (sarcl.Image, {"data": IMAGE.data, "grid": GRID}, "data grid gain report window polarization frame"),
    "Antenna": (
        sarcl.Antenna, {"kind": "gaussian", "width": (0.1, 0.1)}, "kind width size taper azimuth elevation values mount"
    ),
    "resolve": (
        material_arguments.resolve, {"material": "metal", "materials": None, "shape": (3,)}, "material materials"
    ),
}  # fmt: skip
# refusals that name the argument by another word, as the reader of the message knows it
ALSO = {
    "path": ("file", "list of files", "picture", "image path"), "dem": ("DEM",), "x": ("angle",),
    "index": ("row", "samples"),
    "factor": ("factor",), "n_pulses": ("pulses",), "text": ("scenario",), "name": ("paper",), "n": ("positions",),
    "oversample": ("signal",), "waveform": ("waveform",), "duration": ("pulses",), "epoch": ("trajectory", "date"),
    "rms": ("trajectory",), "height": ("longitude", "horizon", "height"), "radius": ("radius",),
    "center": ("outside", "epoch"),
    "spacing": ("ImageGrid.plane",), "positions": ("scene is empty",),
    "retarded": ("angle",), "at": ("at",), "rate": ("rate", "samples", "pulse of"), "which": ("facets", "empty"),
    "look": ("horizon",), "eccentricity": ("perigee",), "semi_major_axis": ("perigee",), "count": ("count",),
}  # fmt: skip


def fault(call, arguments, name, kind):
    """What is wrong with the answer to a value of the wrong kind, None: nothing."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            call(**{**arguments, name: KINDS[kind]()})
        except Exception as exc:
            text, trace = str(exc), exc.__traceback__
            while trace.tb_next:
                trace = trace.tb_next
            where = trace.tb_frame.f_code.co_filename
            own = Path(where).is_relative_to(ROOT) and linecache.getline(where, trace.tb_lineno).strip()[:5] == "raise"
            if not own or not isinstance(exc, (ValueError, TypeError, IndexError, OSError, MemoryError, RuntimeError)):
                return f"bare {type(exc).__name__} from {where}:{trace.tb_lineno}: {text:.150}"
            if words := [each for each in OTHERS if each in text]:
                return f"{words} in {type(exc).__name__}: {text:.150}"
            if not isinstance(exc, FileNotFoundError) and not any(
                each in text for each in (name.removesuffix("s"), *ALSO.get(name, ()))
            ):
                return f"nameless {type(exc).__name__}: {text:.150}"
    foreign = [str(each.message) for each in said if issubclass(each.category, RuntimeWarning)]
    return f"warned: {foreign[0]}" if foreign else None


@pytest.mark.parametrize("what", CALLS)
def test_arguments_of_every_wrong_kind_are_refused_in_words_of_sarcl(what, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    call, arguments, names = CALLS[what]
    names = list(arguments) if names is None else names.split()
    if not {"path", "text"} & set(arguments):
        call(*arguments.values()) if what.endswith("[]") else call(**arguments)
    pairs = [
        (n, kind) for n, kind in itertools.product(names, KINDS) if (n, kind) != ("progress", "class")
    ]  # int(1, 2)
    found = {(n, kind): fault(call, arguments, n, kind) for n, kind in pairs}
    wrong = [f"{what}({name}={kind}): {said}" for (name, kind), said in found.items() if said]
    assert not wrong, "\n".join(wrong)


def test_rows_of_a_file_by_odd_indices_are_those_of_the_array_or_refused_by_name(tmp_path):
    RAW.save(tmp_path / "a.h5")
    IMAGE.save(tmp_path / "b.h5")
    raw, image = sarcl.read(tmp_path / "a.h5"), sarcl.read(tmp_path / "b.h5")
    for rows in (slice(None, None, -2), slice(9, 2, -3), [3, 1, 1], [-1, 0], np.arange(16) % 3 == 0, slice(50, 60)):
        if np.size(np.arange(16)[rows]):
            np.testing.assert_array_equal(raw[rows].samples[:], RAW.samples[rows])
    there = {"a.h5": (raw.samples, RAW.samples), "b.h5": (image, IMAGE.data)}
    for (name, (lazy, array)), index in itertools.product(
        there.items(),
        (10**9, -99, 1.5, "x", b"x", 1j, object(), {}, [[1], [2, 3]], (0, 99), (0, 1, 2), slice("a"), [99]),
    ):
        try:
            wanted = array[index]
        except (IndexError, TypeError, ValueError):
            wanted = None
        with pytest.raises(IndexError, match=r"index .*(give|take)") if wanted is None else warnings.catch_warnings():
            np.testing.assert_array_equal(lazy[index], wanted, err_msg=f"{name} {index}")
    for index in (slice(None, None, -1), [3, 1], [1, 1], ([0, 1], [2, 3]), None):
        try:
            np.testing.assert_array_equal(raw.samples[index], RAW.samples[index])
        except IndexError as exc:
            assert "a.h5" in str(exc) and "take all into memory first" in str(exc)


@pytest.mark.parametrize(
    "choice", [1.5, float("nan"), True, b"cpu", {"cpu"}, np.arange(1), object(), [1.5], ["cpu", None, {}]]
)
def test_devices_that_are_no_names_are_refused(choice):
    with pytest.raises(TypeError, match=r"device is .*; give an index, 'cpu', 'gpu', a part of the name"):
        sarcl.backproject(RAW, GRID, device=choice)
    with pytest.raises(TypeError, match=r"device is .*; give an index"):
        sarcl.echo(sarcl.Scene.points([[0, 0, 0]]), CHIRP, TRACK, device=choice)


def test_a_device_whose_name_is_a_digit_but_no_number_is_not_found():
    with pytest.raises(sarcl.NoDeviceError, match="device '²' matches no working OpenCL device"):
        sarcl.backproject(RAW, GRID, device="²")


@pytest.mark.parametrize(
    "name, value",
    [("channels", "x"), ("receive", None), ("max_edge", "3"), ("max_edge", np.ones(2)), ("report", "x"), ("window", 5)],
)
def test_words_are_checked_where_they_change_nothing_too(name, value):
    """Without an array, facets or a window of its own."""
    point = sarcl.Scene.points([[0, 0, 0]])
    with pytest.raises((ValueError, TypeError), match=name):
        if name in ("report", "window"):
            sarcl.Image(IMAGE.data, GRID, **{name: value})
        else:
            sarcl.echo(point, CHIRP, TRACK, **{name: value})
    with pytest.raises(ValueError, match="side is 'x'; choose one of 'right', 'left'"):
        ORBIT.trajectory(prf=100.0, center=10.0, duration=0.1, side="x")


@pytest.mark.parametrize("progress", [5, "x", [], object(), np.zeros(3)])
def test_progress_that_cannot_be_called_is_refused_before_any_work(progress):
    point = sarcl.Scene.points([[0, 0, 0]])
    for call in (
        lambda **k: sarcl.backproject(RAW, GRID, **k), lambda **k: sarcl.polar_format(RAW, GRID, **k),
        lambda **k: sarcl.range_doppler(RAW, **k), lambda **k: sarcl.autofocus(RAW, GRID, **k),
        lambda **k: sarcl.echo(point, CHIRP, TRACK, **k), lambda **k: sarcl.spectral_echo(point, CHIRP, TRACK, **k),
        lambda **k: sarcl.fullwave_echo(point, CHIRP, TRACK, **k),
    ):  # fmt: skip
        with pytest.raises(TypeError, match=r"progress is .*; give a function, which is called as progress"):
            call(progress=progress)
