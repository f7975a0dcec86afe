"""The page of Zou et al. 2021: radar, targets, samples of a receiver; published beside measured values."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import sarcl
from sarcl import papers
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.cli import parser
from sarcl.fullwave.bodies.mesh_lines import mesh_lines
from sarcl.fullwave.lattice import lattice_around
from sarcl.imaging.compress import compress
from sarcl.opencl.choose_device import open_device
from sarcl.papers.zou import PAPER, _forming, _images, _lab, _radar, _setting, _sphere, _summary, _targets
from sarcl.papers.zou._lab import CELLS, REDUCTION
from sarcl.papers.zou._radar import Radar

PRINTED = {
    "cuboid": (3, 6, 3), "cylinder": (3, 3, 6), "sharp cone": (3, 3, 6), "blunt cone": (6, 6, 1.5),
    "sphere": (3, 3, 3), "tank": (4.01, 9.58, 4.02),
}  # fmt: skip


@pytest.mark.parametrize("reduction", [1, 6])
def test_the_track_crosses_the_beam_of_table_1(reduction):
    radar = Radar(reduction)
    at = radar.track.positions
    assert len(at) == 1536 // reduction
    assert np.linalg.norm(at, axis=1).min() == pytest.approx(radar.range_, rel=1e-6)
    assert at[:, 1] == pytest.approx(-at[::-1, 1])
    assert at[:, 2] == pytest.approx(-at[:, 0])  # 45 degrees of incidence
    assert np.diff(at[:, 1]) == pytest.approx(300 / 1200)
    sine = at[-1, 1] / np.hypot(at[-1, 1], radar.range_)
    assert 4 * 300 * 1.5e9 / SPEED_OF_LIGHT * sine == pytest.approx(1000, abs=5)  # Hz, table 1


@pytest.mark.parametrize("target", _targets.TARGETS, ids=lambda target: target.name)
def test_targets_have_the_sizes_of_table_2_and_are_closed_bodies_for_the_grid(target):
    assert np.diff(target.scene().bounds, axis=0)[0] == pytest.approx(PRINTED[target.name], rel=1e-3)
    scene = target.scene(REDUCTION[True])
    assert scene.bounds.mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-9)
    volume = np.linalg.det(scene.triangles).sum() / 6  # theorem of divergence
    assert volume > 0
    cell = SPEED_OF_LIGHT / 1.75e9 / CELLS[True]
    found = mesh_lines(lattice_around(*scene.bounds, cell, 4), scene.triangles)
    overlap = 0.25 if target.name == "tank" else 0.12  # bodies of the tank overlap: their union is smaller
    assert found.volume == pytest.approx(np.full(3, volume), rel=overlap)


def test_images_show_points_where_seen_says():
    radar = Radar(8)
    points = np.array([[0.4, -0.3, 0.2], [-0.5, 0.6, 0.1]])
    offset, cross = radar.seen(points)[:, 1], radar.seen(points)[:, 0]
    assert offset == pytest.approx((points[:, 0] - points[:, 2]) / np.sqrt(2), abs=2e-3)
    for point, y, r in zip(points, cross, offset, strict=True):
        raw = sarcl.echo(
            sarcl.Scene.points([point]), _radar.CHIRP, radar.track, range_window=(-4, 4), reference=(0, 0, 0)
        )
        grid = radar.grid((2.5, 2.5), 0.05)
        found = sarcl.measure(sarcl.backproject(raw, grid))
        row, column = (found.position @ axis for axis in (grid.y_axis, grid.x_axis))
        assert (row, column) == pytest.approx((y, r), abs=5e-3)


def test_a_receivers_samples_are_the_transform_of_the_band_of_the_chirp():
    """sqrt(T/B) integral over the band of exp(-j pi f^2 T/B + j pi/4 + j 2 pi f (t - tau)) df exp(-j 2 pi f0 tau):
    about exp(j pi B/T (t - tau)^2), whose bandwidth is 500 MHz, for |t - tau| < 10 ns."""
    radar = Radar(16)
    raw = sarcl.echo(
        sarcl.Scene.points([[0.3, 0, 0]], [2.0]), _radar.CHIRP, radar.track, range_window=(-20, 20), tolerance=1e-5,
        reference=(0, 0, 0),
    )  # fmt: skip
    f = (np.arange(4000) - 1999.5) / 4000 * 500e6
    pulse = np.exp(-1j * np.pi * f**2 * 20e-9 / 500e6 + 0.25j * np.pi) * np.sqrt(20e-9 / 500e6) * 500e6 / 4000
    for carrier, rate in ((1.5e9, 600e6), (0.0, 6e9)):
        record = _radar.received(raw, rate, carrier)
        assert record.rate == rate and len(record.samples) == 96
        for row in (0, 48):
            delay = 2 * np.linalg.norm(radar.track.positions[row] - [0.3, 0, 0]) / SPEED_OF_LIGHT
            inside = np.abs(record.times - delay) < 15e-9
            waves = np.exp(2j * np.pi * np.outer(record.times[inside] - delay, f))
            mixed = (1.5e9 - carrier) * record.times[inside] - 1.5e9 * delay
            wanted = 2 * (waves @ pulse) * np.exp(2j * np.pi * mixed)
            assert np.linalg.norm(record.samples[row, inside] - wanted) < 0.02 * np.linalg.norm(wanted)
            assert 0.8 < np.abs(wanted[np.abs(record.times[inside] - delay) < 8e-9]).mean() / 2 < 1.2


def test_600_mhz_samples_hold_all_of_the_echoes():
    radar = Radar(16)
    raw = sarcl.echo(
        sarcl.Scene.points([[0.2, 0.1, 0], [0, 0, -0.3]], [1, 0.5]), _radar.CHIRP, radar.track, range_window=(-6, 6),
        reference=(0, 0, 0),
    )  # fmt: skip
    again = compress(_radar.recorded(_radar.received(raw), raw))
    grid = radar.grid((0.8, 0.8), 0.1)
    one, other = (sarcl.backproject(data, grid) for data in (raw, again))
    wanted = np.asarray(one.data) / one.gain
    apart = np.linalg.norm(np.asarray(other.data) / other.gain - wanted) / np.linalg.norm(wanted)
    assert apart < 0.02  # ends of the record


def test_plane_waves_miss_the_ends_of_the_tank_by_more_than_half_a_radian():
    tank = _targets.find("tank").scene()
    assert 0.5 < _setting._curved(_radar.RANGE, tank) < 1
    near, far = (_setting._curved(r, tank) for r in (2e3, 4e3))
    assert near / far == pytest.approx(2, rel=0.01)  # k x^2/r


@pytest.mark.parametrize("n", [256, 307, 1536])
@pytest.mark.parametrize("number", [1, 5, 9, 40])
def test_azimuths_are_off_the_anchors_and_in_pairs_about_the_middle(n, number):
    anchors = np.unique(np.linspace(0, n - 1, number).round().astype(int)) if number > 1 else np.array([n // 2])
    rows = _forming.azimuths(n, anchors)
    assert len(rows) == 16 and not set(rows) & set(anchors)
    assert rows.tolist() == (n - 1 - rows[::-1]).tolist() and rows.min() < n / 10


@pytest.mark.slow
def test_the_command_writes_a_page_with_the_known_differences(tmp_path, monkeypatch):
    """Two of the six targets, smaller and on coarser cells than those of a quick run."""
    monkeypatch.setitem(_lab.REDUCTION, True, 8)
    monkeypatch.setitem(_lab.CELLS, True, 8)
    azimuths = _forming.azimuths
    monkeypatch.setattr(_forming, "azimuths", lambda *given: azimuths(*given)[[*range(4), *range(-4, 0)]])
    images = [partial(_images.section, name) for name in ("cuboid", "sphere")]
    sections = (_setting.section, *images, _summary.section, _sphere.section, _forming.section)
    monkeypatch.setattr(papers, "find", lambda name: replace(PAPER, sections=sections))
    assert parser.main(["papers", "zou", "--quick", "-o", str(tmp_path)]) == 0
    document = json.loads((tmp_path / "zou.json").read_text())
    rows = {row["item"]: row for section in document["sections"] for row in section["rows"]}
    assert document["finished"] and set(PAPER.main) <= set(rows)
    for item in (
        "range resolution of a point: distance of peak and null",
        "azimuth resolution of a point: distance of peak and null",
        "cuboid: range-Doppler image of 600 MHz samples",
        "sphere: range-Doppler image of 600 MHz samples",
        "sphere: echoes in HH against Mie's series",
        "sphere: slant range of the brightest place",
        "sphere: VH over HH",
        "sharp cone: 5 anchors against one run per azimuth",
    ):
        assert rows[item]["holds"], rows[item]
    assert rows["sphere: echoes in HH against Mie's series"]["value"] < 0.04
    one = rows["sharp cone: one anchor against one run per azimuth"]
    assert not one["holds"] and one["cause"] == "interpretation" and one["value"] > 0.15
    assert not (tmp_path / "zou.runs").exists()  # a quick run keeps nothing
    text = (tmp_path / "zou.html").read_text()
    assert text.index("Conclusion") < text.index("<figure") and "sarcl papers zou --quick" in text


@pytest.mark.slow
def test_a_full_run_that_was_stopped_reads_what_it_had_finished(tmp_path, monkeypatch):
    lab = _lab.Lab(open_device(None), quick=True)
    assert lab.folder is None and _lab.Lab(lab.device, False, tmp_path / "runs").folder == tmp_path / "runs"
    lab.folder = tmp_path / "runs"
    track = lab.radar.track.picked([100, 128, 150])
    first = lab.run("sphere", track, "HH", "few", anchors=[1], model_error=False)
    monkeypatch.setattr(_lab, "fullwave_echo", lambda *_, **__: pytest.fail("it computed again"))
    again = lab.run("sphere", track, "HH", "few", anchors=[1], model_error=False)
    assert np.array_equal(again.read(0, 3), first.read(0, 3)) and again.report.plan["anchors"] == [1]
