"""Packages that add to sarcl by entry points: a format, a grid, a verb and a scattering model, each of a few lines."""

from __future__ import annotations

import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import sarcl
from sarcl.cli.parser import main
from sarcl.io import entry_points

FORMAT = """
import numpy as np
import sarcl

FIELDS = "samples frequency frequency_step tx reference_range".split()

def load(path):
    with np.load(path) as stored:
        return sarcl.PhaseHistory(**{name: stored[name] for name in FIELDS})

def save(path, value):
    if not isinstance(value, sarcl.PhaseHistory):
        raise ValueError("this format holds echoes")
    np.savez(path, **{name: np.asarray(getattr(value, name)) for name in FIELDS})
"""
GRID = """
import numpy as np

BLOCKS = []

class Fan:
    def __init__(self, near: float, far: float, shape: tuple[int, int] = (3, 4), width: float = 0.1):
        self.shape, self.ranges, self.width = tuple(shape), np.linspace(near, far, shape[0]), width

    def positions(self, first, stop):
        BLOCKS.append((first, stop))
        angle = np.linspace(-self.width, self.width, self.shape[1])
        r = self.ranges[first:stop, None]
        return np.stack([r * np.cos(angle), r * np.sin(angle), 0 * r * angle], axis=-1)
"""
VERB = '''
from dataclasses import dataclass
import numpy as np
import sarcl

@dataclass(frozen=True, eq=False, kw_only=True)
class LookOptions(sarcl.Options):
    looks: int = sarcl.option(4, "number of parts of the track")
    tolerance: float = sarcl.option(1e-3, "of the image of each part")

class LookPlan:
    def __init__(self, raw, grid, options):
        parts = np.array_split(np.arange(raw.n_rows), options.looks)
        self.grid, self.plans = grid, [sarcl.plan(raw[p], grid, tolerance=options.tolerance) for p in parts]

    def forecast(self):
        error = max(plan.predicted_error for plan in self.plans)
        return sarcl.Forecast("looks", {}, sum(p.seconds for p in self.plans), self.plans[0].bytes, error, self.run)

    def run(self):
        images = [plan.run() for plan in self.plans]
        return sarcl.Image(sum(abs(i.data) ** 2 for i in images) / len(images), self.grid, gain=images[0].gain)

@sarcl.verb(LookOptions)
def looks(raw, grid, options):
    """Mean power of images of parts of the track.

    {options}
    """
    return LookPlan(raw, grid, options)
'''
SCATTERING = """
import numpy as np

def conductor(normal, to_tx, to_rx, frequency, up, material):
    from sarcl.scattering.physical_optics import scattering_matrix
    s = scattering_matrix(normal, to_tx, to_rx, np.inf, tuple(up))
    return np.broadcast_to(s, (len(frequency), *s.shape))

def lambertian(normal, to_tx, to_rx, frequency, up, material):
    cosine = np.sum(normal * to_tx, axis=1)
    return np.sqrt(cosine)[:, None, None] * (frequency / 10e9)[:, None, None, None] * np.eye(2)

def mirror(normal, to_tx, to_rx, frequency, up, material):
    return np.broadcast_to(2 * np.eye(2), (len(frequency), len(normal), 2, 2))

def flat(normal, to_tx, to_rx, frequency, up, material):
    return np.eye(2)
"""
CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=2e-6)
TRACK = sarcl.Trajectory.circle(radius=7e3, height=5e3, arc=0.03, n_pulses=16)


@pytest.fixture
def install(tmp_path, monkeypatch):
    """install(name, code, **groups): a package as pip leaves it, with entry points {name: object} of each group."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def write(name: str, code: str, **groups: dict[str, str]) -> Path:
        (tmp_path / f"{name}.py").write_text(code)
        monkeypatch.delitem(sys.modules, name, raising=False)
        folder = tmp_path / f"{name}-1.2.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n")
        lines = [f"[sarcl.{g}]\n" + "".join(f"{n} = {o}\n" for n, o in own.items()) for g, own in groups.items()]
        (folder / "entry_points.txt").write_text("\n".join(lines))
        return tmp_path

    return write


@pytest.fixture(scope="module")
def raw():
    scene = sarcl.Scene.points([[0, 0, 0], [2, 1, 0]], [1, 0.5])
    return sarcl.echo(scene, CHIRP, TRACK, range_window=(-8, 8))


def same(first, second):
    names = ("samples", "frequency", "frequency_step", "tx", "reference_range")
    return all(np.array_equal(getattr(first, n), getattr(second, n)) for n in names)


# ---- how entry points are found


def test_nothing_is_looked_up_before_a_name_is_used():
    code = "import sys, sarcl, sarcl.cli.parser; print('importlib.metadata' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "False", done.stderr


def test_a_name_that_two_packages_add_is_refused_with_both(install):
    install("one_pkg", FORMAT, formats={"raw": "one_pkg"})
    install("two_pkg", FORMAT, formats={"raw": "two_pkg"})
    with pytest.raises(ImportError, match=r"ambiguous: .*raw = one_pkg.* of one_pkg 1\.2 and .*raw = two_pkg.*two_pkg"):
        entry_points.added("formats", "raw")


def test_a_package_that_cannot_be_loaded_is_one_error_and_breaks_nothing_else(install, raw, tmp_path):
    install("bad_pkg", "import no_such_module", formats={"bad": "bad_pkg"}, verbs={"bad": "bad_pkg:verb"})
    install("npz_pkg", FORMAT, formats={"npz": "npz_pkg"})
    raw.save(tmp_path / "a.npz")
    raw.save(tmp_path / "a.h5")
    assert same(sarcl.read(tmp_path / "a.npz"), raw) and same(sarcl.read(tmp_path / "a.h5"), raw)
    text = r"entry point 'bad = bad_pkg' of bad_pkg 1\.2 cannot be loaded: ModuleNotFoundError: .*no_such_module"
    with pytest.raises(ImportError, match=text):
        raw.save(tmp_path / "a.bad")
    with pytest.raises(ImportError, match=r"'bad = bad_pkg:verb' of bad_pkg"):
        _ = sarcl.verbs.bad
    assert not hasattr(sarcl.verbs, "other") and not (tmp_path / "a.bad").exists()


# ---- formats


def test_a_format_is_written_and_read_and_its_echoes_focused(install, raw, tmp_path, monkeypatch):
    install("npz_pkg", FORMAT, formats={"npz": "npz_pkg"})
    monkeypatch.chdir(tmp_path)
    raw.save("raw.npz")
    assert same(sarcl.read("raw.npz"), raw)
    assert main(["focus", "raw.npz", "--shape", "8", "8", "-o", "x.h5"]) == 0
    assert sarcl.read("x.h5").data.shape == (8, 8)
    with pytest.raises(FileNotFoundError, match="does not exist"):
        sarcl.read("none.npz")
    with pytest.raises(ValueError, match=r"sarcl writes a phase history to '\.h5'"):
        raw.save("raw.xyz")


def test_a_format_that_fails_leaves_the_file_as_it_was(install, raw, tmp_path):
    install("npz_pkg", FORMAT, formats={"npz": "npz_pkg"})
    raw.save(tmp_path / "a.npz")
    before = (tmp_path / "a.npz").read_bytes()
    with pytest.raises(ValueError, match="this format holds echoes"):
        sarcl.backproject(raw, sarcl.ImageGrid.plane(shape=4, spacing=1.0)).save(tmp_path / "a.npz")
    assert (tmp_path / "a.npz").read_bytes() == before


def test_what_a_format_lacks_is_said(install, raw, tmp_path):
    install("reader", "def load(path):\n    return 3\n", formats={"three": "reader"})
    (tmp_path / "a.three").write_text("3")
    with pytest.raises(TypeError, match=r"the package for \.three read .* as int"):
        sarcl.read(tmp_path / "a.three")
    with pytest.raises(ValueError, match=r"the package for \.three has no save\(\)"):
        raw.save(tmp_path / "a.three")


# ---- grids


def test_a_grid_is_asked_for_in_blocks_and_focused(install, raw):
    install("fan_pkg", GRID, grids={"fan": "fan_pkg:Fan"})
    grid = sarcl.ImageGrid.extension("fan", near=1.0, far=9.0, shape=(5, 4))
    assert np.allclose(np.linalg.norm(grid.positions, axis=-1), np.linspace(1, 9, 5)[:, None])
    pixels = sarcl.backproject(raw, sarcl.ImageGrid.points(grid.positions)).data
    assert np.array_equal(sarcl.backproject(raw, grid).data, pixels)
    large = sarcl.ImageGrid.extension("fan", near=1.0, far=9.0, shape=(4, 300_000))
    assert sys.modules["fan_pkg"].BLOCKS == [(0, 5), (0, 3), (3, 4)]
    assert np.allclose(np.linalg.norm(large.positions[:, ::50_000], axis=-1), np.linspace(1, 9, 4)[:, None])


def test_a_scenario_has_such_a_grid(install):
    install("fan_pkg", GRID, grids={"fan": "fan_pkg:Fan"})
    grid = sarcl.scenario.loads("[grid.fan]\nnear = 1.0\nfar = 9.0\nshape = [2, 3]\n").build_grid()
    assert grid.shape == (2, 3)
    with pytest.raises(ValueError, match=r"scenario:2: \[grid.fan\] unknown key 'nearest'; did you mean 'near'"):
        sarcl.scenario.loads("[grid.fan]\nnearest = 1.0\n")
    with pytest.raises(ValueError, match="unknown table 'fam'"):
        sarcl.scenario.loads("[grid.fam]\nnear = 1.0\n")


def test_a_grid_of_another_shape_than_it_says_is_refused(install):
    install("fan_pkg", GRID.replace("axis=-1)", "axis=-1)[..., :2]"), grids={"fan": "fan_pkg:Fan"})
    with pytest.raises(ValueError, match=r"positions\(0, 3\) has shape \(3, 4, 2\), wanted \(3, 4, 3\)"):
        sarcl.ImageGrid.extension("fan", near=1.0, far=2.0)
    with pytest.raises(ValueError, match="unknown grid of an installed package 'fun'; did you mean 'fan'"):
        sarcl.ImageGrid.extension("fun")


# ---- verbs


def test_a_verb_is_planned_called_and_run_from_the_command_line(install, raw, tmp_path, monkeypatch, capsys):
    install("look_pkg", VERB, verbs={"looks": "look_pkg:looks"})
    monkeypatch.chdir(tmp_path)
    grid = sarcl.ImageGrid.plane(shape=(6, 6), spacing=0.5)
    verb = sarcl.verbs.looks
    image = verb(raw, grid, looks=2)
    parts = [sarcl.backproject(raw[p], grid).data for p in (slice(0, 8), slice(8, 16))]
    assert np.allclose(image.data, sum(abs(p) ** 2 for p in parts) / 2)
    forecast = sarcl.plan(verb, raw, grid, looks=2)
    assert forecast.method == "looks" and np.array_equal(forecast.run().data, image.data)
    assert "number of parts of the track" in verb.__doc__
    with pytest.raises(TypeError, match="looks has unknown option 'look'; did you mean 'looks'"):
        verb(raw, grid, look=2)
    raw.save("raw.h5")
    argv = "focus raw.h5 --method looks --shape 6 6 --spacing 0.5 0.5 --center 0 0 0".split()
    assert main([*argv, "--option", "looks=2", "-o", "x.h5"]) == 0
    assert np.allclose(sarcl.read("x.h5").data, image.data)
    assert main([*argv, "--option", "looks=2", "--dry-run"]) == 0 and "looks: about" in capsys.readouterr().out
    for wrong, text in (
        (["--option", "look=2"], "unknown option 'look'; did you mean 'looks'"),
        (["--wrap"], "unknown option 'wrap'"),
        (["--option", "looks=two"], "give NAME=VALUE"),
    ):
        assert main([*argv, *wrong]) == 2 and text in capsys.readouterr().err
    assert main(["focus", "raw.h5", "--option", "looks=2"]) == 2


def test_an_object_that_is_no_verb_is_refused(install):
    install("look_pkg", "looks = 3", verbs={"looks": "look_pkg:looks"})
    with pytest.raises(TypeError, match=r"entry point 'looks' of sarcl.verbs is 3; make it by @sarcl.verb"):
        _ = sarcl.verbs.looks


# ---- scattering models

MODELS = {name: f"wave_pkg:{name}" for name in ("conductor", "lambertian", "mirror", "flat")}


def box(scattering: str) -> sarcl.Scene:
    return sarcl.shapes.box((0.5, 0.4, 0.3), material=sarcl.Material(scattering=scattering))


def test_the_conductor_as_a_model_is_the_conductor(install):
    install("wave_pkg", SCATTERING, scattering=MODELS)
    azimuth = np.linspace(0.1, 1, 5)
    for names in ("HH", ("HV", "VV")):
        one, other = (
            sarcl.rcs(scene, azimuth, 0.3, 9.6e9, polarization=names, receiver=(azimuth + 0.2, 0.4))
            for scene in (sarcl.shapes.box((0.5, 0.4, 0.3)), box("conductor"))
        )
        assert np.abs(one).max() > 0.01 and np.array_equal(one, other)
    beside = sarcl.shapes.plate((0.2, 0.2), position=(2, 0, 0.3))
    metal, mixed = (
        sarcl.echo(scene + beside, CHIRP, TRACK, tolerance=1e-3)
        for scene in (sarcl.shapes.box((0.5, 0.4, 0.3)), box("conductor"))
    )
    assert np.linalg.norm(metal.samples - mixed.samples) <= 2e-3 * np.linalg.norm(metal.samples)
    assert mixed.report.plan["sums"] == "in float64"


def test_corners_of_a_model_are_not_judged_by_the_coefficients_of_others(install):
    install("wave_pkg", SCATTERING, scattering=MODELS)
    words = []
    for material in (sarcl.Material(), sarcl.Material(scattering="lambertian")):
        corner = sarcl.shapes.dihedral((0.5, 0.5), material=material)
        with warnings.catch_warnings():
            warnings.simplefilter("error" if material.scattering else "ignore", sarcl.SarclWarning)
            above = sarcl.Trajectory(None, [[7e3, 0, 7e3]])
            words.append(sarcl.plan(sarcl.echo, corner, CHIRP, above, tolerance=0.1).plan)
    assert ["left out at right angles, dB" in plan for plan in words] == [True, False]


def test_a_model_follows_direction_and_frequency(install):
    """A plate at right angles: |s|^2 = 4 pi A^2/lambda^2 |S/2|^2, and S of the model."""
    install("wave_pkg", SCATTERING, scattering=MODELS)
    plate = sarcl.shapes.plate((0.3, 0.2), material=sarcl.Material(scattering="lambertian"))
    f, elevation = np.array([8e9, 10e9, 12e9]), np.array([np.pi / 2, 1.5])
    s = sarcl.rcs(plate, 0.0, elevation, f, polarization=("HH", "HV"))
    k, area = 2 * np.pi * f / 299792458.0, 0.06
    integral = area * np.sinc(k * 0.3 * np.cos(elevation)[:, None] / np.pi)
    expected = k / (2 * np.sqrt(np.pi)) * np.sqrt(np.sin(elevation))[:, None] * f / 10e9 * integral
    assert np.allclose(np.abs(s[..., 0]), np.abs(expected), rtol=1e-9, atol=1e-9) and not s[..., 1].any()


def test_facets_that_face_away_do_not_scatter_whatever_their_model_says(install):
    install("wave_pkg", SCATTERING, scattering=MODELS)
    culled, every = (sarcl.echo(box("mirror"), CHIRP, TRACK, shadows=False, skip=skip) for skip in (True, False))
    assert every.samples.any() and np.allclose(culled.samples, every.samples, rtol=1e-5, atol=1e-6)


def test_a_scenario_names_the_model_of_a_material(install):
    install("wave_pkg", SCATTERING, scattering=MODELS)
    text = '[materials.own]\nscattering = "lambertian"\n[[scene.plate]]\nsize = [0.3, 0.2]\nmaterial = "own"\n'
    assert sarcl.scenario.loads(text).build_scene().scattering_models == ("lambertian",)


def test_what_a_model_does_not_reach_is_refused(install):
    install("wave_pkg", SCATTERING, scattering=MODELS)
    scene = box("conductor")
    for call in (
        lambda: sarcl.spectral_echo(scene, CHIRP, TRACK),
        lambda: sarcl.fullwave_echo(scene, CHIRP, TRACK),
        lambda: sarcl.echo(scene, CHIRP, TRACK, bounces=2),
        lambda: sarcl.echo(scene, CHIRP, TRACK, edges=True),
        lambda: sarcl.rcs(scene, 0.0, 0.3, 9.6e9, bounces=2),
    ):
        with pytest.raises(ValueError, match="scattering model 'conductor' of an installed package"):
            call()
    for options in ({"thickness": 0.01, "eps_r": 3}, {"height": 0.01}, {"diagram": "cos"}):
        with pytest.raises(ValueError, match="that of smooth facets"):
            sarcl.Material(scattering="conductor", **options)
    with pytest.raises(ValueError, match="unknown scattering model of an installed package 'conductors'; did you mean"):
        sarcl.Material(scattering="conductors")
    with pytest.raises(ValueError, match=r"'flat' gave an array of shape \(2, 2\), wanted \(1, "):
        sarcl.rcs(box("flat"), 0.0, 0.3, 9.6e9)
