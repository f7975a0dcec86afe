"""Refusals of planners, in the units of the caller's tolerance; and no other error counts as a refusal."""

from __future__ import annotations

import ast
import copy
import dataclasses
import functools
import itertools
import pickle
import re
from pathlib import Path

import numpy as np
import pytest
from helpers.array_cases import TONE, line, passing
from helpers.cases import SCENARIO, noise_history, noise_on, planned_within, quick_of, straight

import sarcl
from sarcl import pointing, shapes
from sarcl.base.errors import ToleranceUnreachable
from sarcl.base.text import tolerance_text
from sarcl.base.tolerances import reachable, rounded_up
from sarcl.imaging.choose_method import choose
from sarcl.imaging.focusing_task import make_task
from sarcl.opencl.choose_device import open_device
from sarcl.scenario.scenario import loads

# so that the best tolerance takes a second, not an hour, and sums in float32, as more facets, pulses and samples do
FEW = {"facets": 20_000, "float64_terms": 0.0}
PLANE = sarcl.ImageGrid.plane(shape=(40, 40), spacing=0.3)
LARGE = sarcl.ImageGrid.plane(shape=(500, 500), spacing=0.3)  # so large that sub-apertures may pay
LISTED = sarcl.ImageGrid.points(np.random.default_rng(0).uniform(-3e3, 3e3, (2000, 3)))
CHIRP = sarcl.Waveform.chirp(center=9e9, bandwidth=300e6, duration=1e-6)
POINTS = sarcl.Scene.points([[0.0, 0, 0], [1, 2, 0]])
SQUARE = np.array([[[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0]], [[-0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]]])
PLATE, TILE = (sarcl.Scene.facets(side * SQUARE, two_sided=True) for side in (1.0, 0.1))
BOX = shapes.box((0.5, 0.4, 0.3))
ARRAY = line(12, spacing=0.0144)


def track(n=4, distance=1000.0):
    return sarcl.Trajectory(
        np.arange(n), np.stack([np.full(n, -0.7 * distance), np.linspace(-2, 2, n), np.full(n, 0.7 * distance)], axis=1)
    )


def no_fp64():
    return open_device().without_fp64()


def aside():
    """A track whose antenna, a narrow one, looks past the scene."""
    return pointing.spotlight(track(), (0, 60.0, 0))


def echoed(scene, limits=FEW, **options):
    return lambda tolerance: planned_within(
        limits, sarcl.echo, scene, CHIRP, options.get("track", track()), shadows=False, tolerance=tolerance,
        check=False, **{k: v for k, v in options.items() if k != "track"},
    ).run()  # fmt: skip


def channels(scene):
    return lambda tolerance: planned_within(
        FEW, sarcl.echo, scene, TONE, passing(4), array=ARRAY, reference=(0, 0, 0), range_window=(-3.6, 3.6),
        tolerance=tolerance, check=False, shadows=False,
    ).run()  # fmt: skip


def focused(raw, grid, **options):
    return lambda tolerance: sarcl.backproject(raw, grid, tolerance=tolerance, check=False, **options)


def method_for(raw, grid, method="auto"):
    """As focused, but only planned, and for tolerances too that verbs refuse for their size: below 1e-11."""
    return lambda tolerance: choose(make_task(raw, grid, None, None, False, True), method, tolerance)


def field(tolerance):
    return sarcl.beam(
        sarcl.AntennaArray.linear(9, spacing=0.015, frequency_step=1e6), 1e11, times=[0.1], positions=[[3.6e9, 0, 0]],
        tolerance=tolerance,
    )  # fmt: skip


STRIP = noise_on(straight(32, aperture=10.0), time=np.linspace(0, 0.1, 32))
SMOOTH = noise_on(straight(128), n_samples=32)
RAW = noise_history()
# name: (what is made at a tolerance, tolerance it refuses, what limits it)
REFUSED = {
    "float32": (method_for(RAW, PLANE), 1e-16, "float64 range profiles"),
    "float32 without float64": (lambda t: focused(RAW, PLANE, device=no_fp64())(t), 2e-7, "float32"),
    "float64 of listed points": (method_for(RAW, LISTED), 3.25e-17, "float64 range profiles"),
    "sub-apertures": (focused(SMOOTH, PLANE, method="factorized"), 1.25e-6, "decimation of the pulses"),
    "sub-apertures below float32": (focused(SMOOTH, PLANE, method="factorized"), 1e-8, "float32 range profiles"),
    "range Doppler": (
        lambda t: sarcl.range_doppler(STRIP, tolerance=t, side="right", check=False), 1e-7, "rounding of complex64"
    ),
    "polar format": (lambda t: sarcl.polar_format(SMOOTH, PLANE, tolerance=t, check=False), 1e-9, "float32 grid"),
    "field": (field, 1e-11, "path differences"),
    "points": (echoed(POINTS), 1.5e-7, "float32 range profiles"),
    "points in a side lobe": (
        echoed(POINTS, track=aside(), antenna=sarcl.Antenna.gaussian(width=0.04)), 1.5e-6, "float32 gains",
    ),
    "facets": (echoed(TILE), 1e-6, "number of facets"),
    "facets below float32": (echoed(TILE), 4e-7, "float32 integrals"),
    "facets and points": (echoed(TILE + POINTS), 1.75e-6, "float32 range profiles"),
    "facets uncut": (echoed(PLATE, max_edge=None), 1e-3, "facets as large as they are"),
    "too many facets": (echoed(PLATE), 1e-4, "number of facets"),
    "channels of points": (channels(POINTS), 1e-7, "float32 range profiles"),
    "channels of facets": (channels(TILE), 1e-6, "float32 range profiles"),
}  # fmt: skip


# quick: one of each kind of planning, for plans of facets and points together are those of both
QUICK = [name for name in REFUSED if "too many" not in name][::2]
QUICK.remove("facets and points")


@pytest.mark.filterwarnings("ignore::sarcl.SarclWarning")
@pytest.mark.parametrize("name", quick_of(QUICK, REFUSED))
def test_a_refusal_is_in_the_numbers_asked_for_and_its_best_works(name):
    make, asked, limit = REFUSED[name]
    with pytest.raises(ToleranceUnreachable) as caught:
        make(asked)
    refused = caught.value
    assert refused.asked == asked and limit in refused.limit
    assert asked < refused.best < 1
    written = {float(number) for number in re.findall(r"\d(?:\.\d+)?e-\d+", str(refused))}
    assert written == {asked, refused.best}
    assert (
        refused.remedy in str(refused) or refused.remedy == f"pass tolerance={tolerance_text(refused.best)} or larger"
    )
    made = make(refused.best)
    report = getattr(made, "report", getattr(made, "plan", None))  # of a field there is none
    assert report is None or report.predicted_error <= refused.best


def test_the_message_names_what_is_asked_the_best_and_a_remedy():
    refused = ToleranceUnreachable(1.25e-3, 2e-2, "thinning", "method='direct' can", how="with sub-apertures")
    assert str(refused) == (
        "tolerance 1.25e-03 cannot be met with sub-apertures; the best here is 2.0e-02: method='direct' can"
    )
    assert ToleranceUnreachable(1e-3, 2e-2, "thinning").remedy == "pass tolerance=2.0e-02 or larger"
    assert ToleranceUnreachable(1e-3, 2e-2, "thinning").restated(1e-2, 0.2).remedy == "pass tolerance=2.0e-01 or larger"
    assert str(ToleranceUnreachable(1e-3, None, "thinning")) == (
        "tolerance 1.0e-03 cannot be met here: the limit is thinning"
    )
    assert str(refused.restated(1e-2, 0.16)).startswith("tolerance 1.0e-02 cannot be met with sub-apertures; the best")
    assert str(refused.placed("f.toml:3: [echo]")).startswith("f.toml:3: [echo] tolerance 1.25e-03 cannot")
    assert isinstance(refused, ValueError) and sarcl.ToleranceUnreachable is ToleranceUnreachable


@pytest.mark.parametrize("made", [pickle.loads, copy.copy], ids=["pickled", "copied"])
def test_a_refusal_travels_between_processes(made):
    refused = ToleranceUnreachable(1e-3, 2e-2, "thinning", "method='direct' can", how="with it").placed("f.toml:")
    found = made(pickle.dumps(refused) if made is pickle.loads else refused)
    assert type(found) is ToleranceUnreachable and str(found) == str(refused)
    for name in ("asked", "best", "limit", "remedy", "how"):
        assert getattr(found, name) == getattr(refused, name)


def test_tolerances_are_rounded_up_to_what_is_printed():
    for value in 10.0 ** np.random.default_rng(0).uniform(-20, 3, 2000):
        up = rounded_up(float(value))
        assert value <= up <= 1.1 * value and float(f"{up:.1e}") == up and float(tolerance_text(float(value))) == value
    assert rounded_up(1e-6) == 1e-6 and tolerance_text(1e-3) == "1.0e-03"


def test_a_search_for_the_best_follows_what_is_named_and_ends():
    def plan(tolerance, least, names):
        if tolerance < least:
            raise ToleranceUnreachable(tolerance / 2, least / 2 if names else None, "it")

    assert reachable(lambda t: plan(t, 3e-4, True), 1e-9) == 3e-4
    assert 3e-4 <= reachable(lambda t: plan(t, 3e-4, False), 1e-9) <= 1.3 * 3e-4
    assert reachable(lambda t: plan(t, 2.0, True), 1e-9) is None


def test_why_no_sub_apertures_are_tried_is_true():
    few = noise_on(straight(3))
    wild = noise_on(straight(64) + np.random.default_rng(4).standard_normal((64, 3)) * 5)
    for raw, grid, why in (
        (few, PLANE, "the aperture has 3 pulses; at least 4"),
        (wild, PLANE, "neighbouring pulses see the smallest tiles, of .* m radius, from directions that differ"),
        (SMOOTH, LISTED, "neighbouring pulses see the smallest tiles, of .* m radius"),
    ):
        with pytest.raises(ToleranceUnreachable, match=why) as caught:
            sarcl.backproject(raw, grid, tolerance=1e-2, method="factorized")
        assert caught.value.best is None and caught.value.remedy == "method='direct' can"
        sarcl.backproject(raw, grid, tolerance=1e-2, method="direct")


def test_a_remedy_is_named_only_where_it_works():
    with pytest.raises(ToleranceUnreachable) as caught:
        method_for(SMOOTH, PLANE, "factorized")(1e-20)
    assert caught.value.remedy == f"pass tolerance={tolerance_text(caught.value.best)} or larger"
    with pytest.raises(ToleranceUnreachable, match="let echo cut them") as caught:
        echoed(PLATE, {}, max_edge=None)(1e-3)
    echoed(PLATE, {})(1e-3)
    with pytest.raises(ToleranceUnreachable) as caught:
        echoed(PLATE, max_edge=None)(1e-4)
    assert "let echo cut them" not in str(caught.value)


TOO_FINE = f"""\
{SCENARIO}
[echo]
tolerance = 1e-7

[grid.plane]
shape = [8, 8]
spacing = 0.1

[backproject]
tolerance = 1e-3
"""


def test_a_scenario_names_the_line_and_keeps_the_refusal():
    with pytest.raises(ToleranceUnreachable, match=r"^f\.toml:17: \[echo\] tolerance 1\.0e-07 cannot") as caught:
        loads(TOO_FINE, name="f.toml").simulate()
    assert caught.value.asked == 1e-7 and caught.value.best == 1e-6


def test_a_scenario_hands_on_the_image_that_missed_its_tolerance(monkeypatch):
    def missed(raw, grid, *, tolerance):
        raise sarcl.ToleranceMissed(1e-3, 2e-3, "the image")

    monkeypatch.setattr("sarcl.verbs.backproject", missed)
    scenario = loads(TOO_FINE, name="f.toml")
    with pytest.raises(sarcl.ToleranceMissed, match=r"^tolerance 1\.0e-03 was missed") as caught:
        scenario.focus(RAW, PLANE)
    assert caught.value.image == "the image"


BUG = "could not broadcast"


def broken(*_, **__):
    raise ValueError(BUG)


def interpolated(verb=sarcl.echo):
    return verb(
        POINTS, TONE, passing(4), array=line(45, spacing=0.0144), reference=(0, 0, 0), range_window=(-3.6, 3.6),
        tolerance=1e-3,
    )  # fmt: skip


MOVES = itertools.count(1)


def moved(raw):
    """The same echoes from other places each time: plans are kept for places."""
    return dataclasses.replace(raw, tx=raw.tx + 1e-6 * next(MOVES))


PLANTED = {
    "interpolated channels": ("sarcl.simulation.channels._interpolated.InterpolatedChannels.fill", interpolated),
    "planning of interpolated channels": ("sarcl.simulation.scene_plan.plan_scene", interpolated),
    "a scene made ready": ("sarcl.simulation.planned_echoes.prepare_scene", interpolated),
    "forecast of echoes": (
        "sarcl.simulation.channels._interpolated.InterpolatedChannels.fill",
        lambda: interpolated(functools.partial(sarcl.plan, sarcl.echo)),
    ),
    "direct": ("sarcl.imaging.direct.direct.make_plan", lambda: sarcl.backproject(moved(RAW), PLANE)),
    "direct, forecast": ("sarcl.imaging.direct.direct.make_plan", lambda: sarcl.plan(moved(RAW), PLANE)),
    "interpolator": ("sarcl.numerics.interpolator_choice.choose_interpolator", lambda: sarcl.backproject(RAW, LISTED)),
    "interpolator of lines": (
        "sarcl.numerics.interpolator_choice.choose_interpolator",
        lambda: sarcl.backproject(moved(RAW), PLANE),
    ),
    "float64": ("sarcl.imaging.float64.plan.make_plan", lambda: sarcl.backproject(moved(RAW), PLANE, tolerance=1e-8)),
    "sub-apertures": (
        "sarcl.imaging.factorized.plan.make_plan",
        lambda: sarcl.backproject(moved(SMOOTH), LARGE, tolerance=1e-2),
    ),
    "sub-apertures, decimation": (
        "sarcl.imaging.factorized.plan.decimated",
        lambda: sarcl.plan(moved(SMOOTH), LARGE, tolerance=1e-2),
    ),
    "lit parts": (
        "sarcl.visibility.lit_parts.candidate_pairs",
        lambda: sarcl.echo(shapes.box((0.5, 0.4, 0.3)), CHIRP, track(), tolerance=1e-1),
    ),
}


@pytest.mark.parametrize("name", PLANTED)
def test_a_bug_is_not_taken_for_a_refusal(name, monkeypatch):
    where, make = PLANTED[name]
    make()
    monkeypatch.setattr(where, broken)
    with pytest.raises(ValueError, match=BUG) as caught:
        make()
    assert not isinstance(caught.value, ToleranceUnreachable)


def test_where_float32_fails_a_bug_in_float64_is_not_hidden(monkeypatch):
    raw = noise_history()
    sarcl.backproject(raw[:], PLANE, tolerance=1e-6)

    def refuse(task, tolerance, on=None):
        raise ToleranceUnreachable(tolerance, None, "test")

    monkeypatch.setattr("sarcl.imaging.direct.direct.make_plan", refuse)
    assert sarcl.backproject(raw[:], PLANE, tolerance=1e-3).data.dtype == np.complex128
    monkeypatch.setattr("sarcl.imaging.float64.plan.make_plan", broken)
    with pytest.raises(ValueError, match=BUG):
        sarcl.backproject(raw, PLANE, tolerance=1e-3)


def test_what_progress_raises_comes_out_of_interpolated_channels():
    def stop(stage, done, total):
        raise ValueError("enough")

    with pytest.raises(ValueError, match="enough"):
        sarcl.echo(
            POINTS, TONE, passing(4), array=line(45, spacing=0.0144), reference=(0, 0, 0), range_window=(-3.6, 3.6),
            progress=stop,
        )  # fmt: skip


def test_interpolated_channels_that_cannot_keep_the_tolerance_give_way_before_any_work(monkeypatch):
    assert "array positions" in interpolated().report.plan
    from sarcl.simulation import scene_plan
    from sarcl.simulation.channels.array_channels import InterpolatedChannels

    plan = scene_plan.plan_scene

    def tight(order, *rest):
        if order.tolerance < 1e-3:
            raise ToleranceUnreachable(order.tolerance, None, "test")
        return plan(order, *rest)

    monkeypatch.setattr(scene_plan, "plan_scene", tight)
    monkeypatch.setattr(InterpolatedChannels, "fill", broken)
    assert "array positions" not in interpolated().report.plan


# Files that may catch ValueError, or everything, and why: each gives the error of a foreign library a message.
MAY_CATCH = {
    "bench/fastsar_peer.py": "a process of its own: what another library raises is a line of the table",
    "bench/_peers.py": "text that is no JSON",
    "io/toml.py": "an integer with more digits than Python reads",
    "bench/_measure.py": "/proc/stat of a system that has none",
    "base/arguments.py": "what numpy says of an index",
    "io/_checked_rows.py": "what h5py says of an index",
    "base/validation.py": "what numpy, float and int say of input",
    "opencl/_probe.py": "a process that tries drivers for `sarcl doctor`: whatever they raise is a finding",
    "io/entry_points.py": "another package, which may raise anything when it is imported: it is named",
    "linear/_autograd.py": "arrays of another library that cannot be read in place are copied",
    "cli/_doctor.py": "a SARCL_THREADS that is no number, which the devices' findings name",
    "opencl/_trial_record.py": "text that is no JSON",
    "opencl/_queries.py": "a driver that refuses a question, however it does so",
    "opencl/_trial.py": "a driver's trial: whatever it raises, the device does not work",
    "cli/parser.py": "text of a command line; the last resort of a program",
    "simulation/echo_output.py": "numpy's sizes that overflow",
    "simulation/tracks/_track_files.py": "a file of echoes, or a list of tracks, that is damaged",
    "experiments/fda/file.py": "the file and case are put before a message, which is raised again",
    "experiments/fda/_sweep.py": "the values of a sweep are put before a message, which is raised again",
    "base/host_memory.py": "a system that does not say its memory",
    "cli/_methods.py": "text of a command line: a number, or the name of a file",
    "earth/elevation.py": "numpy's shapes that do not fit together; the file is put before a message",
    "earth/map_projection.py": "what pyproj says of a reference system",
    "earth/two_line.py": "text that is no number",
    "io/orbit_files.py": "dates that do not exist",
    "model/_orbit_arguments.py": "numpy's shapes that do not fit together",
    "simulation/rcs/_rcs_task.py": "numpy's shapes that do not fit together",
    "earth/dates.py": "dates that do not exist",
    "model/orbit.py": "the file is put before a message, which is raised again",
    "io/input_paths.py": "names that no system takes",
    "io/_gotcha.py": "scipy's reader of damaged files; the file is put before a message, which is raised again",
    "io/_checksums.py": "text that is no JSON",
    "io/sicd/_reading.py": "the library: a file that is no SICD, or lacks what exact places need",
    "io/sarkit_library.py": "file objects, the library and lxml, which fail in many ways; text that is no number",
    "model/sicd/image_product.py": "SciPy's windows: words that name none",
    "io/labelled_files.py": "readers of damaged files, of xarray, zarr and h5py",
    "io/meshes/_gltf_checks.py": "text that is no JSON",
    "io/meshes/_text.py": "text that is no UTF-8 and no numbers",
    "io/meshes/_ply.py": "words of text that are no numbers",
    "io/meshes/mesh.py": "trimesh's readers of damaged files",
    "io/other_files.py": "paths that are no names of files",
    "io/xml/parser.py": "XML that cannot be read",
    "io/sarcl_hdf5.py": "h5py's reader of damaged files",
    "fullwave/bodies/materials.py": "the number of the part is put before a message, which is raised again",
    "cli/_job.py": "signals outside the main thread",
    "blocks/tile_files.py": "text that is no JSON",
    "scenario/_schema.py": "the file and line are put before a message, which is raised again",
    "imaging/_image_output.py": "numpy's sizes that overflow",
    "numerics/windows.py": "text of a command line",
}


def test_nothing_decides_by_a_bare_value_error():
    root, found = Path(sarcl.__file__).parent, set()
    for path in root.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ExceptHandler):
                kinds = {n.id for n in ast.walk(node.type) if isinstance(n, ast.Name)} if node.type else {"Exception"}
                if kinds & {"ValueError", "Exception"}:
                    found.add(path.relative_to(root).as_posix())
    assert found == set(MAY_CATCH)
