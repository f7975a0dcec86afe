"""Echoes by Fourier transforms and by the sum over facets and pulses, side by side; and memory of large transforms.

    python bench/spectral_echo.py [--pixels 512] [--facets 1 4 9 16] [--only spectral_echo echo] [--device ...]
    python bench/spectral_echo.py --memory 8192 [--max-bytes 2.5e8]

The first is the run time of section V of Franceschetti et al. 1992 (SARAS): raw data of as many pixels of 1 m, each of
so many rough facets, X band, 10 km, a Gaussian beam of 0.69 deg, tolerance 1e-2, no shadows. CPU seconds are those of
the process, user and system, for the scene and for its echoes; the error is measured against the exact sum at the same
random pulses and samples for both, whose time is not counted. The second computes a scene of points with --memory
pulses and samples in processes of their own, in memory and with out= and max_bytes=: peak resident memory above that
before the call, CPU seconds, and the difference of the samples.
"""

from __future__ import annotations

import argparse
import importlib
import json
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

VAX = {1: 490, 4: 930, 9: 1590, 16: 2480}  # s, section V, on a VAX 3100/30, for 512 x 512 pixels


def saras(n, facets):
    """Rough ground of n x n pixels of 1 m with so many facets in each, waveform, track and options."""
    import sarcl

    look, height, width = np.radians(50), 6e3, np.radians(0.69)
    middle, m = height * np.tan(look), int(np.ceil(n * np.sqrt(facets / 2)))
    axis = np.linspace(-n / 2, n / 2, m + 1)
    random = np.random.default_rng(0)
    material = sarcl.Material(eps_r=4.0, conductivity=1e-3, diagram="cos2")
    scene = sarcl.Scene.from_heights(middle + axis, axis, random.normal(size=(m + 1, m + 1)) * 0.02, material=material)
    n_pulses = int(n + 2.5 * width * np.hypot(height, middle))
    line = sarcl.Trajectory.line(
        start=(0, -n_pulses / 2 * 0.8, height), velocity=(0, 100, 0), prf=125, n_pulses=n_pulses
    )
    track = sarcl.pointing.stripmap(line, look=look, side="right")
    chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=0.5e-6)
    options = {"antenna": sarcl.Antenna.gaussian(width=(width, 0.3)), "max_edge": None, "shadows": False}
    return scene, chirp, track, options


def run_times(asked):
    """Rows of run times."""
    import sarcl

    checking = [0.0]

    def timed(measure):
        def check(*arguments):
            start = time.process_time()
            try:
                return measure(*arguments)
            finally:
                checking[0] = time.process_time() - start

        return check

    for name in ("echo", "spectral.spectral_echo"):
        module = importlib.import_module("sarcl.simulation." + name)
        module.measure_error = timed(module.measure_error)
    print("| facets per pixel | facets | VAX 3100/30, 512 x 512, s | generator | CPU seconds | us per facet | "
          "predicted | achieved |\n|---|---|---|---|---|---|---|---|")  # fmt: skip
    for facets in asked.facets:
        for name in asked.only:
            scene, chirp, track, options = saras(asked.pixels, facets)
            start = time.process_time()
            with warnings.catch_warnings():  # one facet per pixel is too few for speckle, and the paper's choice
                warnings.simplefilter("ignore", sarcl.SarclWarning)
                raw = getattr(sarcl, name)(
                    scene, chirp, track, tolerance=1e-2, check=True, device=asked.device, **options
                )
            seconds = time.process_time() - start - checking[0]
            print(
                f"| {facets} | {len(scene.triangles)} | {VAX.get(facets, '')} | {name} | {seconds:.1f} | "
                f"{1e6 * seconds / len(scene.triangles):.1f} | {raw.report.predicted_error:.1e} | "
                f"{raw.report.measured_error:.1e} |",
                flush=True,
            )


def points(n):
    """A scene of points for n pulses and about n samples, its waveform, track and options."""
    import sarcl

    spacing, chirp = 0.4, sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
    swath, height, many = 0.45 * n, 3e4, 65_536  # m: samples are 0.5 m apart
    line = sarcl.Trajectory.line(
        start=(0, -n * spacing / 2, height), velocity=(0, 100, 0), prf=100 / spacing, n_pulses=n
    )
    track = sarcl.pointing.stripmap(line, look=np.radians(50), side="right")
    random = np.random.default_rng(0)
    slant = height / np.cos(np.radians(50)) + random.uniform(-0.5, 0.5, many) * swath
    along = random.uniform(-0.45, 0.45, many) * n * spacing
    places = np.stack([np.sqrt(slant**2 - height**2), along, np.zeros(many)], axis=1)
    amplitudes = random.normal(size=many) + 1j * random.normal(size=many)
    options = {"antenna": sarcl.Antenna.gaussian(width=(0.01, 0.5)), "range_window": (-0.55 * swath, 0.55 * swath)}
    return sarcl.Scene.points(places, amplitudes), chirp, track, options


def peak():
    """Largest resident memory so far, bytes."""
    line = next(t for t in Path("/proc/self/status").read_text().splitlines() if t.startswith("VmHWM"))
    return 1024 * int(line.split()[1])


def resident():
    """Resident memory now, bytes."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def one_large(n, folder, max_bytes, device):
    """One large transform: prints its figures as JSON, and keeps 32 rows of its samples."""
    import sarcl

    small = points(256)
    sarcl.spectral_echo(*small[:3], tolerance=1e-2, check=False, device=device, **small[3])  # programs are built
    scene, chirp, track, options = points(n)
    before, start = resident(), time.process_time()
    given = {"out": Path(folder, "raw.h5"), "max_bytes": max_bytes} if max_bytes else {}
    raw = sarcl.spectral_echo(scene, chirp, track, tolerance=1e-2, check=False, device=device, **given, **options)
    seconds = time.process_time() - start
    row = {"bytes": peak() - before, "seconds": seconds, "shape": (raw.n_rows, raw.n_samples)}
    print(json.dumps(row))
    np.save(Path(folder, "limited.npy" if max_bytes else "whole.npy"), raw.read(n // 2, n // 2 + 32))


def memory(asked):
    """The rows of memory: each in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        for limit in (0.0, asked.max_bytes):
            command = [sys.executable, __file__, "--one", folder, "--memory", str(asked.memory)]
            command += ["--max-bytes", str(limit)] + (["--device", asked.device] if asked.device else [])
            row = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)
            how = f"out=, max_bytes={limit:.3g}" if limit else "in memory"
            text = f"{row['shape'][0]} x {row['shape'][1]} samples, {how}: {row['bytes'] / 1e6:.0f} MB"
            print(f"{text}, {row['seconds']:.1f} CPU seconds", flush=True)
        whole, limited = (np.load(Path(folder, name)) for name in ("whole.npy", "limited.npy"))
        print(f"difference of 32 rows: {np.linalg.norm(limited - whole) / np.linalg.norm(whole):.1e}")


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pixels", type=int, default=512)
    parser.add_argument("--facets", type=int, nargs="+", default=[1, 4, 9, 16])
    parser.add_argument("--only", nargs="+", default=["spectral_echo", "echo"])
    parser.add_argument("--memory", type=int)
    parser.add_argument("--max-bytes", type=float, default=2.5e8)
    parser.add_argument("--device")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.one:
        one_large(asked.memory, asked.one, asked.max_bytes, asked.device)
    elif asked.memory:
        memory(asked)
    else:
        run_times(asked)


if __name__ == "__main__":
    main()
