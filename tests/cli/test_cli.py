"""The command line: help without delay, refusals before the computation, and no half-written files."""

import os
import re
import signal
import subprocess
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.cases import SCENARIO

import sarcl
from sarcl.cli import parser
from sarcl.opencl import choose_device, device_list

GRID = """
[grid.plane]
shape = [64, 64]
spacing = [0.15, 0.15]
"""


def run(*argv):
    """sarcl in a process of its own, as a user starts it."""
    return subprocess.run([sys.executable, "-m", "sarcl", *map(str, argv)], capture_output=True, text=True, timeout=120)


def refused(capsys, *argv, status=2):
    """The one line that a refused command prints."""
    assert parser.main([str(a) for a in argv]) == status
    said = capsys.readouterr().err
    assert said.startswith("sarcl: error: ") and said.count("\n") == 1
    return said


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def raw_file(here):
    """Echoes of a unit point at the origin, seen from the +x side."""
    track = sarcl.Trajectory.circle(radius=7e3, height=5e3, start=-0.015, arc=0.03, n_pulses=48)
    n, step = 64, 300e6 / 64
    samples = np.ones((48, n), np.complex64)  # at the reference itself the phase is zero
    r = np.linalg.norm(track.positions, axis=1)
    sarcl.PhaseHistory(samples, 9.45e9 + step / 2, step, track.positions, r, polarization=["HH"] * 48).save(
        here / "raw.h5"
    )
    return here / "raw.h5"


# ---- answers


@pytest.mark.parametrize("argv", [["--help"], ["focus", "--help"], ["demo", "--help"], ["--version"]])
def test_help_imports_nothing_that_takes_time(argv):
    code = (
        "import sys; from sarcl.cli.parser import main\n"
        "try: main(sys.argv[1:])\n"
        "except SystemExit as end: assert not end.code\n"
        "heavy = {'numpy', 'scipy', 'pyopencl', 'trimesh', 'h5py', 'PIL', 'reikna', 'asyncio', 'logging'}\n"
        "print('HEAVY', sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code, *argv], capture_output=True, text=True, timeout=60)
    assert done.stdout.endswith("HEAVY []\n"), done.stdout + done.stderr


def test_version_is_the_packages():
    assert run("--version").stdout == f"sarcl {sarcl.__version__}\n"


def test_every_command_has_its_help():
    for name in ("devices", "demo", "simulate", "focus", "measure"):
        with pytest.raises(SystemExit) as end:
            parser.main([name, "--help"])
        assert end.value.code == 0


@pytest.mark.parametrize(
    ("text", "value"),
    [("2G", 2e9), ("500 MB", 5e8), ("1.5GiB", 1.5 * 2**30), ("64k", 64e3), ("1000", 1000.0), ("2e9", 2e9)],
)
def test_sizes_are_given_as_people_write_them(text, value):
    assert parser.size(text) == value


def test_windows_are_named_with_their_parameters():
    assert parser.window("hamming") == "hamming" and parser.window("taylor:35:5") == ("taylor", 35.0, 5)


def test_negative_numbers_are_numbers_however_they_are_written():
    args = parser.parser().parse_args(["focus", "raw.h5", "--center", "-1e3", "-.5", "-2"])
    assert args.center == [-1000.0, -0.5, -2.0]


@pytest.mark.parametrize(
    "argv",
    [
        ["focus"],
        ["focus", "raw.h5", "--window", "kaiser"],
        ["focus", "raw.h5", "--window", "taylor:x:y"],
        ["focus", "raw.h5", "--max-bytes", "lots"],
        ["focus", "raw.h5", "--max-bytes", "-1"],
        ["focus", "raw.h5", "--center", "1", "2"],
        ["focus", "raw.h5", "--top-db", "0", "--percentile", "99"],
        ["nonsense"],
        [],
    ],
)
def test_what_the_options_cannot_mean_is_one_line_and_status_2(argv, capsys):
    with pytest.raises(SystemExit) as end:
        parser.main(argv)
    said = capsys.readouterr().err
    assert end.value.code == 2 and said.startswith("sarcl: error: ") and said.count("\n") == 1 and "--help" in said


# ---- devices


def record(**changes):
    common = dict(index=0, platform="PoCL", name="cpu-x", kind="cpu", works=True, why="", fp64=True)
    return SimpleNamespace(**{**common, "vector_width": 8, "memory": 6e9, "max_alloc": 2e9, **changes})


def test_devices_marks_the_one_in_use_and_says_why_others_do_not_work(monkeypatch, capsys):
    broken = record(index=1, name="gpu-y", kind="gpu", works=False, fp64=False, why="unknown target CPU")
    single = record(index=2, fp64=False, why="wrong numbers: float64 is float32")
    monkeypatch.setattr(device_list, "tried_again", lambda: [record(), broken, single])
    monkeypatch.setattr(choose_device, "open_devices", lambda choice: [SimpleNamespace(info=record())])
    assert parser.main(["devices"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].startswith("*  0  cpu-x") and "6 GB" in lines[1] and "2 GB" in lines[1]
    assert lines[2].startswith("   1  gpu-y") and lines[3].strip() == "does not work: unknown target CPU"
    assert lines[4].startswith("   2  cpu-x") and lines[5].strip().startswith("float64 does not work: wrong numbers")


def test_devices_lists_what_is_here():
    done = run("devices")
    assert done.returncode == (0 if any(d.works for d in sarcl.devices()) else 3)
    assert all(d.name in done.stdout for d in sarcl.devices())


def test_no_device_is_status_3_and_names_the_doctor(here):
    none = here / "none"
    none.mkdir()
    environment = {**os.environ, "OCL_ICD_VENDORS": str(none), "OCL_ICD_FILENAMES": ""}
    done = subprocess.run(
        [sys.executable, "-m", "sarcl", "devices"],
        capture_output=True,
        text=True,
        env=environment,
        timeout=60,
    )
    if "no OpenCL" not in done.stderr:
        pytest.skip("this OpenCL loader does not obey OCL_ICD_VENDORS")
    assert done.returncode == 3 and "sarcl doctor says what is wrong" in done.stderr and "Traceback" not in done.stderr


def test_a_device_name_that_matches_nothing_lists_what_there_is(raw_file, capsys):
    said = refused(capsys, "focus", raw_file, "--device", "no such device", status=3)
    assert "'no such device' matches no" in said
    assert all(d.name in said for d in sarcl.devices())


# ---- bad input, refused before the work


@pytest.fixture
def no_work(monkeypatch):
    """The verbs may not be reached."""

    def refuse(*args, **options):
        raise AssertionError("the work began")

    for verb in ("simulation.echo.echo", "imaging.backproject.backproject", "imaging.compress.compress"):
        monkeypatch.setattr(f"sarcl.{verb}", refuse)


def test_an_output_that_cannot_be_written_is_found_before_the_work(raw_file, here, capsys, no_work):
    assert "no folder" in refused(capsys, "focus", raw_file, "-o", here / "none" / "a.png")
    (here / "folder.png").mkdir()
    assert "is a folder" in refused(capsys, "focus", raw_file, "-o", "folder.png")
    (here / "s.toml").write_text(SCENARIO)
    assert "no folder" in refused(capsys, "simulate", "s.toml", "-o", "none/raw.h5")
    assert "no folder" in refused(capsys, "simulate", "s.toml", "--image", "none/a.png")
    (here / "file").write_text("")
    assert "is a file" in refused(capsys, "demo", "--out", "file")


def test_outputs_of_unknown_kind_or_named_twice_are_refused(raw_file, capsys, no_work):
    assert "ends in '.jpg'; choose a name that ends in .png, .h5, .nitf, .zarr, .nc or .tif" in refused(
        capsys, "focus", raw_file, "-o", "a.jpg"
    )
    assert "name one file twice" in refused(capsys, "focus", raw_file, "-o", "a.png", "-o", "./a.png")


def test_folders_and_names_without_an_ending_are_called_so(raw_file, here, capsys, no_work):
    (here / "folder").mkdir()
    for folder in ("folder", ".", "folder/.."):
        said = refused(capsys, "focus", folder)
        assert f"'{folder}' is a folder; give the files in it, as in" in said and "ends in" not in said
    assert "'folder' is a folder; choose a name that ends in .png, .h5" in refused(
        capsys, "focus", raw_file, "-o", "folder"
    )
    assert "'image' has no ending; choose a name" in refused(capsys, "focus", raw_file, "-o", "image")


def test_an_output_that_would_replace_an_input_or_another_output_is_refused(raw_file, here, capsys, no_work):
    before = Path(raw_file).read_bytes()
    assert "is also read by this command" in refused(capsys, "focus", raw_file, "-o", raw_file)
    (here / "link.h5").symlink_to(raw_file)
    assert "is also read by this command" in refused(capsys, "focus", "link.h5", "-o", "link.h5")
    assert Path(raw_file).read_bytes() == before
    (here / "s.h5").write_text(SCENARIO)
    assert "is also read by this command" in refused(capsys, "simulate", "s.h5", "-o", "s.h5")
    assert (here / "s.h5").read_text() == SCENARIO
    (here / "s.toml").write_text(SCENARIO)
    assert "choose another name" in refused(capsys, "simulate", "s.toml", "-o", "a.h5", "--image", "a.h5")


def test_a_floor_that_no_picture_can_have_is_refused_before_the_work(raw_file, capsys, no_work):
    assert "--floor-db is 50" in refused(capsys, "focus", raw_file, "--floor-db", "50")
    assert "--percentile is 200" in refused(capsys, "focus", raw_file, "--percentile", "200")


def test_grey_levels_are_chosen_and_printed(raw_file, here, capsys):
    from PIL import Image

    assert parser.main(["focus", str(raw_file), "--shape", "32", "32", "--floor-db", "-30", "--top-db", "-6"]) == 0
    with Image.open(here / "raw.png") as saved:
        assert f"wrote raw.png. {saved.text['Description']}\n" in capsys.readouterr().out
        assert "White: -6.0 dB (given" in saved.text["Description"] and "Black: -36.0 dB" in saved.text["Description"]


def test_an_unknown_toml_key_is_named_with_its_line(here, capsys, no_work):
    (here / "s.toml").write_text(SCENARIO.replace("radius", "radios"))
    said = refused(capsys, "simulate", "s.toml")
    assert "s.toml:7: [trajectory.circle] unknown key 'radios'; did you mean 'radius'?" in said


def test_files_that_are_missing_or_something_else_are_refused(raw_file, here, capsys, no_work):
    assert "does not exist" in refused(capsys, "focus", "none.h5")
    assert "is a folder" in refused(capsys, "focus", here)
    (here / "text.h5").write_text("not HDF5")
    assert "text.h5" in refused(capsys, "focus", "text.h5")
    assert "does not exist" in refused(capsys, "simulate", "none.toml")
    assert "holds echoes" in refused(capsys, "measure", raw_file)


def test_grid_options_are_refused_before_the_data_are_read(here, capsys, no_work):
    assert "spacing[0] is 0" in refused(capsys, "focus", "none.h5", "--spacing", 0, 1)
    (here / "g.toml").write_text(GRID)
    said = refused(capsys, "focus", "none.h5", "--grid", "g.toml", "--shape", 10, 10)
    assert "--grid and --shape both describe the grid" in said


def test_a_polarization_that_is_not_there_lists_what_is(raw_file, capsys, no_work):
    assert "polarization 'HV' is not in these data; there are ['HH']" in refused(
        capsys, "focus", raw_file, "--polarization", "HV"
    )


def test_files_of_two_polarizations_are_not_summed_unless_asked_for(raw_file, here, capsys):
    raw = sarcl.read(raw_file)
    replace(raw, polarization="VV").save(here / "vv.h5")
    said = refused(capsys, "focus", raw_file, here / "vv.h5", "--shape", 8, 8)
    assert "polarisations HH, VV" in said and "--polarization HH, or pass --sum-polarizations" in said
    argv = ["focus", raw_file, "vv.h5", "--shape", 8, 8, "--sum-polarizations", "-o", "sum.h5"]
    assert parser.main([str(a) for a in argv]) == 0
    assert sarcl.read("sum.h5").gain == 2 * 48 * 64


def test_tracebacks_are_for_debug_only(here, capsys):
    with pytest.raises(FileNotFoundError):
        parser.main(["focus", "none.h5", "--debug"])


def test_what_is_nobodys_fault_is_status_1(monkeypatch, capsys):
    monkeypatch.setattr("sarcl.model.store.read", lambda *a, **k: 1 / 0)
    assert "ZeroDivisionError" in refused(capsys, "measure", "x.h5", status=1)


# ---- work


def test_focus_writes_the_image_and_says_what_it_chose(raw_file, here, capsys):
    assert parser.main(["focus", str(raw_file), "-o", "a.h5", "-o", "a.png", "--window", "hamming"]) == 0
    said = capsys.readouterr().out
    assert "48 rows of 64 samples at 9.6 GHz" in said
    assert re.search(r"grid: \d+ x \d+ pixels of .* about \(0, 0, 0\)", said) and "wrote a.png" in said
    assert (here / "a.png").read_bytes().startswith(b"\x89PNG")
    image = sarcl.read(here / "a.h5")
    middle = image.grid.index((0, 0, 0)).astype(int)
    assert abs(image.data[tuple(middle)]) == pytest.approx(image.gain, rel=1e-2)  # a unit point gives |I| = gain
    assert sorted(p.name for p in here.iterdir()) == ["a.h5", "a.png", "raw.h5"]


def test_focus_without_an_output_names_it_after_the_data(raw_file, here):
    assert parser.main(["focus", str(raw_file), "--shape", "32", "48"]) == 0
    assert (here / "raw.png").exists()


def test_the_grid_of_a_scenario_serves_focus(raw_file, here):
    (here / "g.toml").write_text(GRID)
    assert parser.main(["focus", str(raw_file), "--grid", "g.toml", "-o", "a.h5"]) == 0
    assert sarcl.read(here / "a.h5").data.shape == (64, 64)


def test_measure_prints_the_point_response(raw_file, here, capsys):
    grid = ["--center", "0", "0", "0", "--shape", "200", "200", "--spacing", "0.1", "0.1"]
    assert parser.main(["focus", str(raw_file), "-o", "a.h5", *grid]) == 0
    capsys.readouterr()
    assert parser.main(["measure", "a.h5"]) == 0
    brightest = capsys.readouterr().out
    assert parser.main(["measure", "a.h5", "--near", "0.05", "0", "0"]) == 0
    assert capsys.readouterr().out == brightest
    assert re.search(r"PSLR +-13\.\d+ +-13\.\d+ dB", brightest)
    twice = ["--near", "0.05", "0", "0", "--near", "0", "0.05", "0"]
    assert parser.main(["measure", "a.h5", *twice]) == 0
    assert capsys.readouterr().out == f"{brightest}\n{brightest}"
    assert parser.main(["measure", "a.h5", "--plot", "cuts.png"]) == 0
    assert capsys.readouterr().out == f"{brightest}wrote cuts.png\n" and (here / "cuts.png").stat().st_size > 1000
    assert "draws the cuts of one point" in refused(capsys, "measure", "a.h5", "--plot", "b.png", *twice)
    assert "ends in .png" in refused(capsys, "measure", "a.h5", "--plot", "b.svg")


def test_simulate_makes_echoes_and_the_image(here, capsys):
    (here / "s.toml").write_text(SCENARIO + GRID)
    assert parser.main(["simulate", "s.toml"]) == 0
    assert sorted(p.name for p in here.iterdir()) == ["s.png", "s.toml", "s_raw.h5"]
    assert parser.main(["simulate", "s.toml", "-o", "r.h5", "--image", "i.h5", "--tolerance", "1e-2"]) == 0
    image = sarcl.read(here / "i.h5")
    i, j = np.rint(image.grid.index([[0, 0, 0], [3, 2, 0]])).astype(int).T
    assert np.abs(image.data[i[0], j[0]]) == pytest.approx(image.gain, rel=0.02)
    assert np.abs(image.data[i[1], j[1]]) == pytest.approx(0.1 * image.gain, rel=0.2)


CENTIMETRES = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="centimeter" meter="0.01"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="{count}">{numbers}</float_array><technique_common>
<accessor source="#a" count="{corners}" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="{facets}"><input semantic="VERTEX" source="#v" offset="0"/><p>{order}</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


@pytest.mark.filterwarnings("always::sarcl.SarclWarning")
def test_what_simulate_has_to_warn_of_it_says_once(here, capsys):
    """A coarse mesh in centimetres from a circle without prf or speed: three things to say, each in one line."""
    ball = 100 * sarcl.shapes.sphere(0.5, facets=300).triangles.reshape(-1, 3)  # cm
    numbers, order = (" ".join(f"{x:.9g}" for x in values) for values in (ball.ravel(), np.arange(len(ball))))
    text = CENTIMETRES.format(count=ball.size, numbers=numbers, corners=len(ball), facets=len(ball) // 3, order=order)
    (here / "ball.dae").write_text(text)
    points = SCENARIO.index("[[scene.points]]")
    fast = "[echo]\ntolerance = 1e-2\nshadows = false\n"
    (here / "s.toml").write_text(f'{SCENARIO[:points]}[[scene.from_mesh]]\nfile = "ball.dae"\n{GRID}{fast}')
    assert parser.main(["simulate", "s.toml"]) == 0
    said, warned = capsys.readouterr()
    assert said.count("the track has no times") == 1
    assert warned.count("\n") == 2
    assert warned.count("sarcl: warning: the unit of this mesh is 0.01 m, as its file says") == 1
    assert warned.count("sarcl: warning: mesh too coarse for the wavelength") == 1
    (here / "s.toml").write_text(SCENARIO.replace("n_pulses = 48", "n_pulses = 48\nprf = 100.0"))
    assert parser.main(["simulate", "s.toml"]) == 0
    said, warned = capsys.readouterr()
    assert warned == "" and "the track has no times" not in said


@pytest.mark.filterwarnings("always::sarcl.SarclWarning")
def test_warnings_of_other_packages_keep_their_place(here, capsys):
    assert parser.main(["focus", "missing.h5"]) == 2
    capsys.readouterr()
    warnings.warn_explicit("old", DeprecationWarning, "other.py", 3)
    warnings.warn_explicit("coarse", sarcl.SarclWarning, "scene.py", 4)
    assert capsys.readouterr().err.splitlines() == ["other.py:3: DeprecationWarning: old", "sarcl: warning: coarse"]


def test_echoes_that_are_not_compressed_are_compressed_first(here, capsys):
    (here / "s.toml").write_text(SCENARIO + "[echo]\ncompressed = false\n")
    assert parser.main(["simulate", "s.toml"]) == 0
    assert sorted(p.name for p in here.iterdir()) == ["s.toml", "s_raw.h5"]  # no grid, no image
    assert parser.main(["focus", "s_raw.h5"]) == 0
    assert "compressing them first" in capsys.readouterr().out


@pytest.mark.slow  # the packages of .ci/run make this picture for every change
def test_the_demo_writes_its_picture_and_says_where(here, capsys):
    assert parser.main(["demo", "--quick", "--out", "made/here"]) == 0
    said = capsys.readouterr().out
    assert str((here / "made" / "here" / "demo.png").resolve()) in said
    assert re.search(r"echo +\d+\.\d s", said) and re.search(r"focus +\d+\.\d s", said)
    assert (here / "made" / "here" / "demo.png").read_bytes().startswith(b"\x89PNG")


# ---- Ctrl-C


def interrupt(arguments, folder, when, limit=60.0):
    """Start sarcl, press Ctrl-C as soon as when() is true: (status, stderr)."""
    process = subprocess.Popen(
        [sys.executable, "-m", "sarcl", *arguments],
        cwd=folder,
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),  # where pytest itself ignores it
    )
    end = time.monotonic() + limit
    while not when() and process.poll() is None and time.monotonic() < end:
        time.sleep(0.002)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=limit)
    return process.returncode, said


@pytest.mark.skipif(os.name != "posix", reason="sends POSIX signals")
def test_ctrl_c_leaves_nothing_half_written(raw_file, here):
    big = ["--center", "0", "0", "0", "--shape", "3000", "3000", "--spacing", "0.005", "0.005"]
    status, said = interrupt(
        ["focus", "raw.h5", "-o", "a.h5", "-o", "a.png", *big], here, lambda: list(here.glob(".sarcl-*"))
    )
    assert (status, said) == (130, "sarcl: interrupted; nothing was written\n")
    assert [p.name for p in here.iterdir()] == ["raw.h5"]


@pytest.mark.skipif(os.name != "posix", reason="sends POSIX signals")
def test_ctrl_c_keeps_what_is_complete_and_says_so(here):
    grid = GRID.replace("64, 64", "4000, 4000").replace("0.15", "0.002")
    (here / "s.toml").write_text(SCENARIO + grid)
    status, said = interrupt(["simulate", "s.toml", "-o", "r.h5"], here, lambda: (here / "r.h5").exists())
    assert (status, said) == (130, "sarcl: interrupted; r.h5 is complete, nothing else was written\n")
    assert sorted(p.name for p in here.iterdir()) == ["r.h5", "s.toml"]
    assert sarcl.read(here / "r.h5").n_rows == 48
