"""Scenario files: the Python names as TOML, mistakes located by line, and writing without loss."""

import inspect

import numpy as np
import pytest

import sarcl
from sarcl.base.options import described
from sarcl.earth.place import Place
from sarcl.scenario.scenario import Scenario, load, loads

TEXT = """\
# a spotlight pass
[waveform.chirp]
center = 9.6e9
bandwidth = 600e6
duration = 2e-6

[trajectory.circle]
radius = 7e3
height = 5e3
arc = 0.07
n_pulses = 64

[[scene.points]]
positions = [
  [0, 0, 0],
  [1, 2, 3],
]
amplitudes = [[1, 0], [0, 1.5]]

[[scene.points]]
positions = [[4, 5, 6]]

[grid.plane]
shape = [64, 32]
spacing = [0.1, 0.2]

[backproject]
window = ["taylor", 35, 5]
"""

TRIANGLE = """\
OFF
3 1 0
0 0 0
1 0 0
0 1 0
3 0 1 2
"""


def build(text, **where):
    s = loads(text, name="f.toml", **where)
    return s.build_waveform(), s.build_track(), s.build_receiver(), s.build_scene(), s.build_grid()


# ---- what a scenario means


def test_tables_and_keys_are_the_python_names():
    waveform, track, receiver, scene, grid = build(TEXT)
    assert (waveform.kind, waveform.center, waveform.bandwidth) == ("chirp", 9.6e9, 600e6)
    np.testing.assert_array_equal(
        track.positions, sarcl.Trajectory.circle(radius=7e3, height=5e3, arc=0.07, n_pulses=64).positions
    )
    assert receiver is None
    np.testing.assert_array_equal(scene.positions, [[0, 0, 0], [1, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal(scene.amplitudes, [1, 1.5j, 1])
    assert grid.shape == (64, 32) and grid.spacing == (0.1, 0.2)


def test_an_arbitrary_track_is_the_trajectory_table_itself():
    text = TEXT.replace(
        "[trajectory.circle]", "[trajectory]\ntimes = [0, 1]\npositions = [[0, 0, 1], [0, 1, 1]]\n[other]"
    )
    text = text[: text.index("[other]")] + text[text.index("[[scene") :]
    assert len(build(text)[1]) == 2


def test_a_receiver_of_its_own_is_a_second_track():
    text = TEXT + "[receiver.line]\nstart = [0, 0, 3e3]\nvelocity = [0, 50, 0]\nprf = 100\nn_pulses = 64\n"
    assert build(text)[2].positions[0].tolist() == [0, 0, 3e3]


def test_mesh_files_are_found_beside_the_scenario(tmp_path, monkeypatch):
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / "one.off").write_text(TRIANGLE)
    file = tmp_path / "s.toml"
    file.write_text('[[scene.from_mesh]]\nfile = "models/one.off"\nscale = 2.0\nposition = [0, 0, 1]\n')
    monkeypatch.chdir("/")
    scene = load(file).build_scene()
    assert scene.triangles.shape == (1, 3, 3) and scene.triangles.max() == 2.0


def test_scenes_add_in_the_order_of_the_file():
    text = "[[scene.from_heights]]\nx = [0, 1]\ny = [0, 1]\nz = [[0, 0], [0, 0]]\n"
    text += "[[scene.points]]\npositions = [[0, 0, 5]]\n"
    scene = loads(text).build_scene()
    assert len(scene.triangles) == 2 and len(scene.positions) == 1


def known_names(text):
    """Names that the refusal of an unknown one gives: of sections, tables or keys."""
    with pytest.raises(ValueError, match="unknown") as refusal:
        loads(text)
    return set(str(refusal.value).split("known: ")[1].split(", "))


TRACKS = {"line": sarcl.Trajectory.line, "circle": sarcl.Trajectory.circle, "": sarcl.Trajectory}
POINTINGS = {name: getattr(sarcl.pointing, name) for name in ("spotlight", "stripmap", "fixed")}
ANTENNAS = {name: getattr(sarcl.Antenna, name) for name in ("isotropic", "rectangular", "gaussian", "table")}
ARRAYS = {name: getattr(sarcl.AntennaArray, name) for name in ("linear", "planar", "costas")}
GRIDS = {name: getattr(sarcl.ImageGrid, name) for name in ("plane", "points", "on_terrain", "on_map", "zero_doppler")}
SHAPES = {name: getattr(sarcl.shapes, name) for name in "plate disc box cylinder cone frustum sphere tank".split()}
SHAPES |= {name: getattr(sarcl.shapes, name) for name in "trihedral dihedral top_hat luneburg".split()}
SCENES = {name: getattr(sarcl.Scene, name) for name in ("points", "from_mesh", "from_heights", "from_dem", "facets")}
VERBS = {verb: {"": getattr(sarcl, verb)} for verb in ("echo", "spectral_echo", "fullwave_echo", "backproject")}
VERBS |= {verb: {"": getattr(sarcl, verb)} for verb in ("polar_format", "range_doppler")}
CALLS = {
    "waveform": {name: getattr(sarcl.Waveform, name) for name in ("chirp", "tone", "sampled")},
    "orbit": {"kepler": sarcl.Orbit.kepler, "tle": sarcl.Orbit.tle, "states": sarcl.Orbit.states},
    "trajectory": {**TRACKS, "orbit": sarcl.Orbit.trajectory}, "receiver": TRACKS,
    "pointing": POINTINGS, "receiver_pointing": POINTINGS, "antenna": ANTENNAS, "receiver_antenna": ANTENNAS,
    "array": {**ARRAYS, "": sarcl.AntennaArray}, "radar": {"": sarcl.Radar}, "materials": {"ice": sarcl.Material},
    "place": {"": Place.above}, "scene": SCENES | SHAPES, "grid": GRIDS, "noise": {"": sarcl.add_noise}, **VERBS,
}  # fmt: skip


@pytest.mark.parametrize("section", CALLS)
def test_the_keys_are_those_of_the_python_signatures(section):
    """So the file format cannot drift from the library. Scenes may stand on other parts of the scene."""
    for kind, call in CALLS[section].items():
        wanted = set(inspect.signature(call).parameters) - {"self", "track", "raw", "grid", "name"}
        wanted = {"file" if name in ("mesh", "path", "dem") else name for name in wanted}
        if hasattr(call, "options"):
            wanted = {name for name, (_, option) in described(call.options).items() if option.in_files}
            assert {"tolerance", "check"} <= wanted and not wanted & {"device", "progress", "out"}
        table = f"[{section}{'.' * bool(kind)}{kind}]"
        names = known_names(f"[{table}]\nqqqq = 1\n" if section == "scene" else f"{table}\nqqqq = 1\n")
        kinds = set() if kind else set(CALLS[section]) | ({"orbit"} & names)
        assert names - kinds - {"on"} == wanted


def test_every_section_and_every_part_of_a_scene_is_one_of_those():
    assert known_names("[qqqq]\n") == {*CALLS}
    assert known_names("[[scene.qqqq]]\n") == {*SCENES, *SHAPES}
    assert known_names("[grid.qqqq]\n") == {*GRIDS}


def test_the_verbs_get_their_tables_as_arguments_and_the_caller_has_the_last_word(monkeypatch):
    seen = {}
    scenario = loads(TEXT + "tolerance = 1e-4\n")
    monkeypatch.setattr(sarcl.verbs, "backproject", lambda raw, grid, **options: seen.update(options))
    scenario.focus(None, tolerance=1e-2)
    assert seen == {"window": ("taylor", 35, 5), "tolerance": 1e-2}


def test_what_a_verb_refuses_is_located_where_the_file_said_it():
    scenario = loads(TEXT + "tolerance = -1\n", name="f.toml")
    raw = sarcl.PhaseHistory(np.ones((1, 1), np.complex64), 1e9, 1e6, tx=[[0, 0, 10]], reference_range=10.0)
    with pytest.raises(ValueError, match=r"^f\.toml:29: \[backproject\] tolerance is -1"):
        scenario.focus(raw)
    with pytest.raises(ValueError, match=r"^tolerance is -2"):
        scenario.focus(raw, tolerance=-2)


# ---- mistakes


MISTAKES = [
    # replace, by, line named, words
    (
        "radius",
        "radios",
        8,
        "[trajectory.circle] unknown key 'radios'; did you mean 'radius'? known: radius, height",
    ),
    ("[grid.plane]", "[grid.plain]", 23, "[grid] unknown table 'plain'; did you mean 'plane'?"),
    ("[grid.plane]", "[gird.plane]", 23, "unknown table 'gird'; did you mean 'grid'?"),
    (
        "[[scene.points]]\npositions = [[4",
        "[[scene.points]]\npsitions = [[4",
        21,
        "[[scene.points]] unknown key 'psitions'",
    ),
    (
        "center = 9.6e9",
        'center = "9.6 GHz"',
        3,
        "[waveform.chirp] center is '9.6 GHz' (a string), wanted a number",
    ),
    ("n_pulses = 64", "n_pulses = 64.5", 11, "n_pulses is 64.5, wanted a whole number"),
    ("n_pulses = 64", "n_pulses = true", 11, "n_pulses is true, wanted a whole number"),
    ("n_pulses = 64", "n_pulses = inf", 11, "n_pulses is inf, wanted a whole number"),
    ("arc = 0.07", "arc = 1979-05-27", 10, "arc is '1979-05-27' (a string), wanted a number"),
    ("spacing = [0.1, 0.2]", "spacing = {dy = 1}", 25, "spacing is a table, wanted"),
    (
        "radius = 7e3\n",
        "",
        7,
        "[trajectory.circle] lacks the key 'radius'; it needs radius, height, n_pulses",
    ),
    (
        "[waveform.chirp]",
        "[waveform.tone]\n[waveform.chirp]",
        2,
        "exactly one of the tables chirp, tone, sampled",
    ),
    ("[trajectory.circle]", "[trajectory]\ncircle = 5", 8, "circle is 5, wanted a table"),
    ("[trajectory.circle]", "[trajectory.line]", 8, "[trajectory.line] unknown key 'radius'"),
    ("[[scene.points]]\npositions = [\n", "[[scene.points]]\nx.positions = [\n", 14, "unknown key 'x'"),
    ("# a", "waveform = 3\n# a", None, ""),
    # refused by the nouns
    (
        "center = 9.6e9",
        "center = -1.0",
        3,
        "[waveform.chirp] waveform center is -1; it must be greater than 0",
    ),
    ("[1, 2, 3]", "[1, 2, nan]", 14, "positions[1, 2] is nan"),
    (
        "[0, 1.5]]",
        "[0, 1.5, 2]]",
        18,
        "amplitudes[1] is [0, 1.5, 2]; a complex number is a pair [real, imaginary]",
    ),
    ("amplitudes = [[1, 0], [0, 1.5]]", "amplitudes = [1, 2, 3]", 18, "amplitudes has shape (3,)"),
    ("shape = [64, 32]", "shape = [64, 0]", 24, "shape[1] is 0"),
    # not TOML
    ("arc = 0.07", "arc = 0,07", 10, "this is not valid TOML"),
    ('"taylor", 35, 5]', '"taylor", 35, 5', 28, "this is not valid TOML"),
]


@pytest.mark.parametrize(("old", "new", "number", "words"), MISTAKES)
def test_every_mistake_names_its_file_and_line(old, new, number, words):
    assert old in TEXT
    with pytest.raises(ValueError) as error:
        build(TEXT.replace(old, new, 1))
    if number is not None:
        assert str(error.value).startswith(f"f.toml:{number}: ")
    assert words in str(error.value)


def test_a_missing_mesh_is_named_with_the_line_of_its_file(tmp_path):
    with pytest.raises(
        FileNotFoundError, match=r"^f\.toml:3: \[\[scene.from_mesh\]\] mesh file '.*none.stl' does not exist"
    ):
        loads('[[scene.from_mesh]]\nscale = 1.0\nfile = "none.stl"\n', name="f.toml", folder=tmp_path).build_scene()


def test_what_is_not_there_is_asked_for_when_it_is_used():
    with pytest.raises(ValueError, match=r"f\.toml: there is no waveform; add a \[waveform\.chirp\] table"):
        build("[grid.plane]\nshape = [1, 1]\nspacing = [1, 1]\n")


def test_files_that_are_no_scenario_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="does not exist"):
        load(tmp_path / "none.toml")
    with pytest.raises(IsADirectoryError, match="is a folder"):
        load(tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\x89HDF\xff\xfe")
    with pytest.raises(ValueError, match="byte 0 is not UTF-8 text"):
        load(tmp_path / "binary.toml")


def test_a_scenario_made_in_python_names_the_table():
    with pytest.raises(ValueError, match=r"scenario: \[waveform.chirp\] unknown key 'centre'; did you mean 'center'"):
        Scenario(waveform={"chirp": {"centre": 1e9, "bandwidth": 1e6, "duration": 1e-6}})


# ---- and back


def test_dumps_and_loads_give_the_same_tables():
    scenario = loads(TEXT)
    assert loads(scenario.dumps()).tables == scenario.tables


def test_nouns_dump_to_tables_that_give_equal_nouns():
    waveform, track, _, scene, grid = build(TEXT)
    terrain = sarcl.Scene.from_heights(
        [0, 1, 2], [0, 1], np.arange(6.0).reshape(2, 3) / 7, material=0.3, roughness=0.01
    )
    made = Scenario(waveform=waveform, trajectory=track, scene=scene + terrain, grid=grid)
    again = loads(made.dumps())
    assert again.tables == made.tables
    np.testing.assert_array_equal(again.build_track().positions, track.positions)
    for name in ("positions", "amplitudes", "triangles", "reflectivity", "roughness", "two_sided"):
        np.testing.assert_array_equal(getattr(again.build_scene(), name), getattr(scene + terrain, name))
    np.testing.assert_array_equal(again.build_grid().positions, grid.positions)
    signal = sarcl.Waveform.sampled([1, 1j, -1], rate=1e6, center=1e9)
    np.testing.assert_array_equal(loads(Scenario(waveform=signal).dumps()).build_waveform().signal, [1, 1j, -1])


def test_what_toml_cannot_say_is_refused():
    with pytest.raises(ValueError, match="prf is None"):
        Scenario(trajectory={"line": {"start": [0, 0, 1], "velocity": [1, 0, 0], "prf": None, "n_pulses": 2}})


def test_a_saved_scenario_loads(tmp_path):
    scenario = loads(TEXT)
    scenario.save(tmp_path / "again.toml")
    assert load(tmp_path / "again.toml").tables == scenario.tables


def test_windows_line_ends_count_once():
    with pytest.raises(ValueError, match=r"^f\.toml:8: "):
        loads(TEXT.replace("radius", "radios").replace("\n", "\r\n"), name="f.toml")


def test_an_invalid_window_is_refused_before_echoes_are_computed():
    def work(*_):
        raise AssertionError("work began")

    with pytest.raises(ValueError, match=r"f\.toml:28: \[backproject\] .*tailor"):
        loads(TEXT.replace("taylor", "tailor"), name="f.toml").simulate(progress=work)
