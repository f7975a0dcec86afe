"""A mesh and points on rough ground in one scene: culling does not change the echoes, memory is bounded."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
import trimesh

import sarcl
from sarcl.scene.material import Material

WAVE = sarcl.Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=1e-6)

LAMBERT, PARTLY = Material(eps_r=6.0, diagram="cos"), Material(eps_r=4.0, height=2e-3, diagram="cos2")


def composite(half):
    """Ground 2 half m wide, rough at every scale, a sixth of it without reflection; a mesh and a mast on it; points."""
    axis, n = np.linspace(-half, half, 2 * half + 1), 4 * half**2
    kinds = np.arange(n).reshape(2 * half, -1) * 6 // n
    ground = sarcl.Scene.from_heights(
        axis,
        axis,
        lambda x, y: 1.5 * np.sin(x / 7) * np.cos(y / 9),
        material=kinds,
        materials=["dry soil", LAMBERT, "asphalt", PARTLY, 0.0, "concrete"],
        point_roughness=0.02,
    )
    capsule = trimesh.creation.capsule(height=6, radius=1.5)
    body = sarcl.Scene.from_mesh(capsule, rotation=[0, 1.2, 0]).on(ground, 4, -3)
    mast = sarcl.Scene.from_mesh(trimesh.creation.box((0.5, 0.5, 8.0)), material="wood").on(ground, -8, 6)
    points = sarcl.Scene.points([[0, 0, 3], [12, 5, 2], [-15, -15, 1], [3, 3, 3]], [2.0, 1j, 3.0, 0.0])
    return ground + body + mast + points


def track(n=24):
    azimuth = 0.04 * (np.arange(n) / n - 0.5)
    around = [np.cos(azimuth), np.sin(azimuth), np.full(n, 0.7)]
    return sarcl.Trajectory(np.arange(n) / 100.0, 1e5 * np.stack(around, axis=1))


@pytest.mark.parametrize(
    "half, shadows",
    [(12, True), *(pytest.param(*values, marks=pytest.mark.slow) for values in ((12, False), (20, True)))],
)
@pytest.mark.filterwarnings("ignore:mesh too coarse")  # the capsule
@pytest.mark.filterwarnings("ignore:point_roughness moves posts")
def test_culling_changes_a_whole_scene_by_less_than_the_tolerance(half, shadows):
    scene, tolerance = composite(half), 1e-3
    options = {
        "tolerance": tolerance,
        "range_window": (-0.55 * half, 0.95 * half),
        "check": False,
        "seed": 4,
        "shadows": shadows,
    }
    every = sarcl.echo(scene, WAVE, track(), skip=False, **options)
    for skip in (True, {"zero reflectivity"}) if half > 12 else (True,):
        culled = sarcl.echo(scene, WAVE, track(), skip=skip, **options)
        left_out = culled.report.contributions_skipped
        total = culled.report.contributions_done + sum(left_out.values())
        shares = {why: n / total for why, n in left_out.items()}
        assert total == every.report.contributions_done + sum(every.report.contributions_skipped.values())
        # a sixth of the ground reflects nothing; of the rest some is turned away, hidden, or outside
        assert 0.05 < shares["zero reflectivity"] < 0.25
        assert shares["facing away"] > 0.001 and shares["range window"] > 0.05
        assert shares["shadowed"] > 0.001 or not shadows
        assert 0.2 < sum(shares.values()) < 0.8
        assert np.linalg.norm(culled.samples - every.samples) <= tolerance * np.linalg.norm(every.samples)


ECHO = """
import json, resource, sys
from pathlib import Path
import numpy as np
import sarcl
from sarcl.scene.material import Material

def resident():
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 2**20

def peak():  # ru_maxrss would count a parent's before the fork
    line = next(t for t in Path("/proc/self/status").read_text().splitlines() if t.startswith("VmHWM"))
    return int(line.split()[1]) / 1024

axis = np.linspace(-50, 50, 51)
kind = Material(eps_r=4.0, diagram="cos")
scene = sarcl.Scene.from_heights(axis, axis, np.zeros((51, 51)), material=kind, point_roughness=0.01)
wave = sarcl.Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=1e-6)
azimuth = 0.05 * np.arange(128) / 128
places = 1e5 * np.stack([np.cos(azimuth), np.sin(azimuth), np.full(128, 0.8)], axis=1)

def made(n):
    track = sarcl.Trajectory(np.arange(1.0 * n), places[:n])
    # 24 km of range, four polarisations: 5 MB of profiles a pulse
    options = dict(polarization="all", range_window=(-12000, 12000), max_edge=None)
    return sarcl.echo(scene, wave, track, tolerance=1e-2, check=False, max_bytes=float(sys.argv[1]), **options)

made(8)  # the kernels' compiler is no part of it
idle = resident()
samples = made(128).samples
some = samples[::37, ::1009]
print(json.dumps({"above": peak() - idle, "samples": samples.nbytes / 2**20, "norm": float(np.linalg.norm(samples)),
                  "some": np.stack([some.real, some.imag]).tolist()}))
"""


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_memory_for_facets_is_bounded_by_max_bytes():
    found = []
    for limit in ("5e7", "4e9"):
        done = subprocess.run([sys.executable, "-c", ECHO, limit], capture_output=True, text=True, timeout=600)
        assert done.returncode == 0, done.stderr
        found.append(json.loads(done.stdout.splitlines()[-1]))
    little, much = found
    # MiB: blocks of eight pulses, once on the device and once as they come back, besides the samples themselves
    assert little["above"] - little["samples"] < 300 < 450 < much["above"] - much["samples"]
    assert np.linalg.norm(np.subtract(little["some"], much["some"])) <= 1e-5 * np.linalg.norm(much["some"])
    assert little["norm"] == pytest.approx(much["norm"], rel=1e-5)
