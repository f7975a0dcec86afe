"""Polar format compared with backprojection: run time against the errors of arithmetic and of plane waves.

    python bench/polar_format.py [--size 1024] [--tolerance 1e-2 ...] [--km 10 ...] [--device ...]

White noise, as many pulses, samples and pixels a side as --size, X band, pixels of 0.25 m, 400 MHz
at 1024 and in proportion, an aperture of 0.04 of the distance, 10 and 1000 km.
Errors are relative L2 at 100 random pixels: of each against its own exact sum, and of the polar format image against
the exact sum of backprojection. Runs alternate; the shortest of three counts.
Points at some distances from the centre, along and across the line of sight, give the larger differences of place (of
the peak), phase (at the point's own place) and level (of the peak) from backprojection.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
import warnings
from typing import Any

import numpy as np


def main() -> None:
    """Measure, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--tolerance", type=float, nargs="+", default=[1e-1, 1e-2, 1e-3, 1e-4, 1e-5])
    parser.add_argument("--km", type=float, nargs="+", default=[10.0, 1000.0], help="distances")
    parser.add_argument("--device")
    asked = parser.parse_args()

    import sarcl
    from sarcl.reference.backproject import backproject as exact
    from sarcl.reference.polar_format import polar_format as plane

    warnings.simplefilter("ignore", sarcl.SarclWarning)
    n, random = asked.size, np.random.default_rng(0)
    samples = (random.standard_normal((n, n)) + 1j * random.standard_normal((n, n))).astype(np.complex64)
    grid = sarcl.ImageGrid.plane(shape=(n, n), spacing=0.25)
    index, points = grid.sample(100, seed=1)
    for distance in (1e3 * km for km in asked.km):
        y = 0.04 * distance * (np.arange(n) / (n - 1) - 0.5)
        tx = np.stack([np.full(n, -0.7 * distance), y, np.full(n, 0.714 * distance)], axis=1)
        raw = sarcl.PhaseHistory(
            samples, frequency=9.6e9 - n * 2e8 / 1024, frequency_step=4e8 / 1024, tx=tx,
            reference_range=np.linalg.norm(tx, axis=1),
        )  # fmt: skip
        own, own_norm = plane(raw, points, np.zeros(3))
        true, true_norm = exact(raw, points)
        own_norm, true_norm = max(own_norm, float(np.linalg.norm(own))), max(true_norm, float(np.linalg.norm(true)))
        print(f"\n{distance / 1e3:g} km")
        print(
            "| tolerance | achieved | predicted | seconds | backproject achieved | seconds | polar format against it |"
        )
        print("|---|---|---|---|---|---|---|")
        for tolerance in asked.tolerance:
            seconds = {sarcl.polar_format: np.inf, sarcl.backproject: np.inf}
            made = {}
            for _ in range(3):
                for verb in seconds:
                    start = time.perf_counter()
                    made[verb] = verb(raw, grid, tolerance=tolerance, check=False, device=asked.device)
                    seconds[verb] = min(seconds[verb], time.perf_counter() - start)
            fast, slow = made[sarcl.polar_format], made[sarcl.backproject]
            errors = (
                np.linalg.norm(fast.data[index] - own) / own_norm,
                np.linalg.norm(slow.data[index] - true) / true_norm,
                np.linalg.norm(fast.data[index] - true) / true_norm,
            )
            bound, quick, careful = fast.report.predicted_error, *seconds.values()
            print(
                f"| {tolerance:.0e} | {errors[0]:.1e} | {bound:.1e} | {quick:.2f} | {errors[1]:.1e} | {careful:.2f} | "
                f"{errors[2]:.1e} |"
            )
        words = ("plane-wave phase error", "defocusing phase error", "displaced by", "sharp within")
        print(", ".join(f"{word} {fast.report.plan[word]}" for word in words))
        print("\n| from the centre, m | place, m | neglected phase, rad | phase, modulo 2 pi | peak, dB |")
        print("|---|---|---|---|---|")
        for away in (1.0, 3.0, 10.0, 30.0, 50.0):
            if away < 0.4 * n * 0.25:
                place, neglected, phase, level = of_points(raw, grid, away, asked.device)
                print(f"| {away:g} | {place:.2g} | {neglected:.2g} | {phase:.2g} | {level:+.2f} |")


def of_points(raw: Any, grid: Any, away: float, device: Any) -> tuple[float, ...]:
    """Of points so many m from the centre: largest difference of place, m, phase neglected in the middle of band and
    rows, and measured phase, rad, and lowest level, dB."""
    import sarcl
    from sarcl.reference.backproject import backproject as exact

    f = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)
    middle = np.array(grid.shape) // 2
    found = []
    for i, j in middle + np.array([[0, 1], [1, 0]]) * round(away / 0.25):
        place = grid.at(i, j)
        path = np.linalg.norm(raw.tx - place, axis=1) - raw.reference_range
        samples = np.exp(-4j * np.pi / 299_792_458.0 * np.outer(path, f)).astype(np.complex64)
        bright = dataclasses.replace(raw, samples=samples)
        image = sarcl.polar_format(bright, grid, tolerance=1e-4, check=False, device=device)
        peak = np.unravel_index(int(np.argmax(np.abs(image.data))), grid.shape)
        seen = sarcl.measure(image, near=grid.at(*peak))
        wanted = exact(bright, place[None])[0][0]
        end = raw.tx[raw.n_rows // 2]
        bent = np.linalg.norm(end - place) - np.linalg.norm(end) + end @ place / np.linalg.norm(end)
        found.append([
            float(np.linalg.norm(seen.position - place)),
            4 * np.pi * f.mean() / 299_792_458.0 * bent,
            abs(float(np.angle(image.data[i, j] / wanted))),
            -20 * np.log10(abs(seen.peak) / abs(wanted)),
        ])  # fmt: skip
    apart, bent, turned, lost = np.max(found, axis=0)
    return apart, bent, turned, -lost


if __name__ == "__main__":
    main()
