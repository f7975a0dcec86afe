"""Polar format compared with backprojection: run time against the errors of arithmetic and of plane waves.

    python bench/polar_format.py [--size 1024] [--tolerance 1e-2 ...] [--km 10 ...] [--device ...]

White noise, as many pulses, samples and pixels a side as --size, X band, pixels of 0.25 m, 400 MHz
at 1024 and in proportion, an aperture of 0.04 of the distance, 10 and 1000 km.
Errors are relative L2 at 100 random pixels: of each against its own exact sum, and of the polar format image against
the exact sum of backprojection. Runs alternate; the shortest of three counts.
"""

from __future__ import annotations

import argparse
import time
import warnings

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


if __name__ == "__main__":
    main()
