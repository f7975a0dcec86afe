"""The public names: one list, each reachable after a bare import, and nothing else shown."""

from __future__ import annotations

import ast
import importlib
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import sarcl

PACKAGE = Path(sarcl.__file__).parent
MODULES = (
    "array_factor", "fda", "illumination", "linear", "material", "motion", "noise", "papers", "pointing", "progress",
    "radar", "scenario", "shapes", "stop_and_go", "wgs84",
)  # fmt: skip


def run(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize("name", sarcl.__all__)
def test_every_public_name_exists_and_has_this_name(name):
    value = getattr(sarcl, name)
    assert value is getattr(sarcl, name)
    if name not in MODULES:
        assert value.__name__ == name and value.__module__.startswith("sarcl.")


@pytest.mark.parametrize("name", sarcl.__all__)
def test_every_public_name_has_a_docstring(name):
    assert getattr(sarcl, name).__doc__


def test_public_modules_are_there_after_a_bare_import():
    code = f"import sarcl; print([type(getattr(sarcl, n)).__name__ for n in {MODULES!r}])"
    assert run(code) == str(["module"] * len(MODULES))
    assert run("import sarcl; print(sarcl.shapes.sphere.__name__, sarcl.fda.run.__name__)") == "sphere run"


@pytest.mark.parametrize("name", MODULES)
def test_public_modules_are_imported_as_they_are_named(name):
    module = importlib.import_module(f"sarcl.{name}")
    assert module is getattr(sarcl, name) and module.__spec__.name == module.__name__


def test_names_that_are_no_modules_are_not_imported_as_such():
    for name in ("echo", "backprojekt"):
        with pytest.raises(ModuleNotFoundError, match=f"sarcl.{name}"):
            importlib.import_module(f"sarcl.{name}")


def test_dir_shows_the_public_names_and_nothing_else():
    assert dir(sarcl) == sorted([*sarcl.__all__, "__version__"])
    # rooms that were imported on the way are no public names
    assert (
        run("import sarcl; sarcl.Scene, sarcl.echo; print('imaging' in dir(sarcl), 'ast' in dir(sarcl))")
        == "False False"
    )


def test_all_of_the_contract_is_there():
    wanted = (
        "Waveform Trajectory Scene Material Antenna AntennaArray Radar PhaseHistory ImageGrid Image Report Scenario "
        "echo beam ambiguity compress map_aperture backproject polar_format autofocus measure read concatenate devices "
        "plan Forecast PointResponse Ambiguity add_noise NoDeviceError SarclWarning "
        "ToleranceMissed ToleranceUnreachable Orbit ElevationModel spectral_echo range_doppler rcs "
        "doppler_centroid effective_velocity EffectiveVelocity fullwave_echo default_grid Options option verb"
    ).split()
    assert set(sarcl.__all__) == {*wanted, *MODULES}


def test_a_star_import_brings_them_all():
    assert run("from sarcl import *; print(Scene.__name__, shapes.__name__)") == "Scene sarcl.scene.shapes"


def test_an_unknown_name_is_refused_with_the_place_to_look():
    with pytest.raises(AttributeError, match=r"no attribute 'backprojekt'; dir\(sarcl\) lists the public names"):
        _ = sarcl.backprojekt
    assert not hasattr(sarcl, "cl")


def test_an_import_brings_nothing_that_takes_time():
    heavy = "numpy scipy pyopencl reikna trimesh h5py PIL".split()
    assert run(f"import sys, sarcl; print([m for m in {heavy!r} if m in sys.modules])") == "[]"


def test_names_are_written_once():
    code = (PACKAGE / "__init__.py").read_text()
    names = {n for n in sarcl.__all__ if n[0].isupper()}
    constants = {n.value for n in ast.walk(ast.parse(code)) if isinstance(n, ast.Constant) and isinstance(n.value, str)}
    assert not names & constants


def test_a_list_of_names_that_an_installer_left_out_is_said(tmp_path):
    shutil.copytree(PACKAGE / "base", tmp_path / "sarcl" / "base")
    shutil.copy(PACKAGE / "__init__.py", tmp_path / "sarcl")
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import sarcl"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith(f"ImportError: sarcl cannot start without {tmp_path}")
    assert "pip install --force-reinstall" in done.stderr and "FileNotFoundError" not in done.stderr
    shutil.copy(PACKAGE / "__init__.pyi", tmp_path / "sarcl")
    assert subprocess.run([sys.executable, "-c", code], cwd=tmp_path).returncode == 0
