"""Range-Doppler images compared with backprojection: error, position and phase of points, and CPU seconds.

    python bench/range_doppler.py [--size 1024] [--tolerance 1e-2 3e-3] [--case broadside squinted orbit] [--device ...]

As many pulses as --size, half as many samples. Broadside and squinted by 30 degrees: X band, 300 MHz, 10 km; orbit:
C band, 60 MHz, 1000 km. White noise gives the error, relative L2 at 100 random pixels against the exact sum; nine
points give the largest differences of position, phase, width at half power (of both axes, relative) and highest side
lobe between both images. bench/spaceborne.py compares them with theory. Backprojection focuses as many pixels, of
about the same size, on a plane. CPU seconds are those of the process, user and system, the shorter of two runs.
"""

from __future__ import annotations

import argparse
import dataclasses
import time

import numpy as np


def airborne(n, squint):
    """Track, m (n, 3), times, s, and points, m, seen at X band; their frequencies and the options of range_doppler."""
    y = 240.0 * (np.arange(n) / (n - 1) - 0.5) + 7e3 * np.tan(squint)
    tx = np.stack([np.full(n, -7e3), y, np.full(n, 7e3)], axis=1)
    along, across = np.meshgrid([-25.0, 0, 25], [-25.0, 0, 25])
    points = np.stack([across.ravel(), along.ravel(), np.zeros(9)], axis=1)
    return tx, tx, np.linspace(0, 2.4, n), points, np.eye(3), 9.6e9, 300e6, {}


def spaceborne(n):
    """The same for an orbit at C band."""
    import sarcl

    orbit = sarcl.Orbit.kepler(7.171e6, 0.001, 1.72, span=(-60, 60))
    track = orbit.trajectory(start=0.0, prf=2200.0, n_pulses=n)
    half = n / 4400
    middle = orbit.geolocate(half, 1e6, side="right")
    longitude, latitude, _ = sarcl.wgs84.geodetic(middle)
    axes = sarcl.wgs84.local_axes(float(longitude), float(latitude))
    steps = np.linspace(-300, 300, 3)
    points = np.array([orbit.geolocate(half + 1e-4 * a, 1e6 + b, side="right") for a in steps for b in steps / 3])
    chirp = sarcl.Waveform.tone(center=5.4e9, duration=1e-6)
    one = sarcl.echo(sarcl.Scene.points([middle]), chirp, track, range_window=(-10, 10), check=False)
    return one.tx, one.rx, one.time, points, axes, 5.4e9, 60e6, {"side": "right"}


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--tolerance", type=float, nargs="+", default=[1e-2, 3e-3])
    parser.add_argument("--case", nargs="+", default=["broadside", "squinted", "orbit"])
    parser.add_argument("--device")
    asked = parser.parse_args()

    import sarcl
    from sarcl.reference.backproject import backproject as exact

    cases = {
        "broadside": lambda n: airborne(n, 0.0),
        "squinted": lambda n: airborne(n, np.arctan(np.tan(np.radians(30)) * np.sqrt(2))),
        "orbit": spaceborne,
    }
    n, random = asked.size, np.random.default_rng(0)
    print("| case, tolerance | pixels | achieved | predicted | CPU seconds | backproject achieved | CPU seconds | "
          "position | phase | IRW | PSLR |")  # fmt: skip
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for name in asked.case:
        tx, rx, when, points, axes, center, bandwidth, options = cases[name](n)
        step = 2 * bandwidth / n
        f = center - bandwidth / 2 + step * np.arange(n // 2)

        def half_path(x, tx=tx, rx=rx):
            return (np.linalg.norm(tx - x, axis=1) + np.linalg.norm(rx - x, axis=1)) / 2

        reference = half_path(points[4])
        fields = {"frequency": f[0], "frequency_step": step, "tx": tx, "rx": rx, "reference_range": reference,
                  "time": when}  # fmt: skip
        turns = [np.outer(half_path(x) - reference, f) for x in points]
        echoes = sum(np.exp(-4j * np.pi / 299792458.0 * t) for t in turns)
        bright = sarcl.PhaseHistory(echoes.astype(np.complex64), **fields)
        white = random.standard_normal((2, *echoes.shape)).astype(np.float32)
        noise = dataclasses.replace(bright, samples=white[0] + 1j * white[1])
        for tolerance in asked.tolerance:
            images = {}

            def run(verb, made=images):
                start = time.process_time()
                made[verb] = verb()
                return time.process_time() - start

            def fast(raw=noise, tolerance=tolerance, options=options):
                return sarcl.range_doppler(raw, tolerance=tolerance, check=False, device=asked.device, **options)

            quick = min(run(fast) for _ in range(2))
            image = images[fast]
            shape = image.data.shape
            spacing = image.grid.spacing_at(shape[0] // 2, shape[1] // 2)
            grid = sarcl.ImageGrid.plane(center=points[4], shape=shape, spacing=spacing, normal=axes[2], x_axis=axes[0])

            def slow(raw=noise, grid=grid, tolerance=tolerance):
                return sarcl.backproject(raw, grid, tolerance=tolerance, check=False, device=asked.device)

            careful = min(run(slow) for _ in range(2))
            errors = []
            for made in (image, images[slow]):
                index, places = made.grid.sample(100, seed=1)
                wanted, norm = exact(noise, places)
                errors.append(np.linalg.norm(made.data[index] - wanted) / max(norm, np.linalg.norm(wanted)))
            seen = fast(bright)
            away, turned, width, lobe = 0.0, 0.0, 0.0, 0.0
            for x in points:
                part = sarcl.ImageGrid.plane(center=x, shape=(96, 96), spacing=min(spacing), normal=axes[2])
                truth = sarcl.measure(sarcl.backproject(bright, part, tolerance=1e-5, check=False), near=x)
                here = sarcl.measure(seen, near=x)
                at = np.array([here.position])
                away = max(away, float(np.linalg.norm(here.position - truth.position)))
                width = max(width, *(abs(a / b - 1) for a, b in zip(here.irw, truth.irw, strict=True)))
                lobe = max(lobe, *(abs(a - b) for a, b in zip(here.pslr, truth.pslr, strict=True)))
                turned = max(turned, float(abs(np.angle(here.peak / exact(bright, at)[0][0]))))
            print(
                f"| {name}, {tolerance:.0e} | {shape[0]} x {shape[1]} | {errors[0]:.1e} | "
                f"{image.report.predicted_error:.1e} | {quick:.2f} | {errors[1]:.1e} | {careful:.2f} | "
                f"{away * 1e3:.2g} mm | {turned:.1e} rad | {width:.1e} | {lobe:.2g} dB |",
                flush=True,
            )


if __name__ == "__main__":
    main()
