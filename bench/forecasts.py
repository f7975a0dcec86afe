"""Forecasts of backproject beside the CPU seconds that it takes, for several limits of memory.

    python bench/forecasts.py [--size 1024 ...] [--max-bytes 1e9 1e8 2e7 6e6] [--tolerance 1e-2]

White noise, X band: as many pulses, samples and pixels a side as --size. CPU seconds are those of the process, planning
included, in a second call: programs are built. The ratio is that of CPU seconds to `sarcl.plan(...).seconds`.
"""

from __future__ import annotations

import argparse
import time
import warnings

import numpy as np


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, nargs="+", default=[256, 512, 1024])
    parser.add_argument("--max-bytes", type=float, nargs="+", default=[1e9, 1e8, 2e7, 6e6])
    parser.add_argument("--tolerance", type=float, default=1e-2)
    asked = parser.parse_args()

    import sarcl

    warnings.simplefilter("ignore", sarcl.SarclWarning)
    random = np.random.default_rng(0)
    print("| size | method | max_bytes | error predicted | error measured | forecast, s | CPU s | ratio |")
    print("|---|---|---|---|---|---|---|---|")
    for n in asked.size:
        tx = np.stack([np.full(n, -7e3), np.linspace(-300, 300, n), np.full(n, 7e3)], axis=1)
        samples = (random.standard_normal((n, n)) + 1j * random.standard_normal((n, n))).astype(np.complex64)
        raw = sarcl.PhaseHistory(
            samples, frequency=9.5e9, frequency_step=1.5e8 / n, tx=tx, reference_range=np.linalg.norm(tx, axis=1)
        )
        grid = sarcl.ImageGrid.plane(shape=(n, n), spacing=150.0 / n)
        for method in ("direct", "factorized"):
            error = None
            for max_bytes in asked.max_bytes:
                options = {"tolerance": asked.tolerance, "method": method, "max_bytes": max_bytes}
                try:
                    error = error or sarcl.backproject(raw, grid, check=True, **options).report.measured_error
                    forecast = sarcl.plan(raw, grid, **options)
                except (MemoryError, sarcl.ToleranceUnreachable) as refused:
                    print(f"| {n} | {method} | {max_bytes:.0e} | {type(refused).__name__} | | | | |")
                    continue
                start = time.process_time()
                image = sarcl.backproject(raw, grid, check=False, **options)
                seconds = time.process_time() - start
                print(
                    f"| {n} | {method} | {max_bytes:.0e} | {image.report.predicted_error:.1e} | {error:.1e} | "
                    f"{forecast.seconds:.3f} | {seconds:.3f} | {seconds / forecast.seconds:.2f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
