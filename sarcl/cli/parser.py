"""The parser of the command line: sarcl devices | demo | simulate | focus | measure | fda | papers | bench.

It imports nothing that takes time, so that --help answers at once; sarcl/cli/_commands.py does the work.
"""

from __future__ import annotations

import argparse
import math
import os
import re
import shlex
import signal
import sys
from typing import Any, NoReturn

from ..io import formats
from ._flags import CHOICES, DEFAULTS

EPILOG = """examples:
  sarcl demo                                            simulate and focus a scene: out/demo.png
  sarcl simulate scene.toml -o raw.h5 --image image.png
  sarcl focus raw.h5 -o image.png -o image.h5 --window taylor:35:5
  sarcl focus orbit_raw.h5 --method range_doppler --side right --heights 250 -o image.h5
  sarcl measure image.h5 --near 10 0 0
  sarcl papers saras --quick                            published beside measured: saras.html

environment: SARCL_DEVICE (default of --device), SARCL_THREADS (threads of CPU devices).
exit status: 0 done, 1 something failed, 2 bad input, 3 no working OpenCL device, 130 interrupted,
143 ended by SIGTERM."""

FAILED, BAD_INPUT, NO_DEVICE, INTERRUPTED, ENDED = 1, 2, 3, 130, 143


class _Parser(argparse.ArgumentParser):
    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self._negative_number_matcher = re.compile(r"-\.?\d")  # -1e3 too is a number, not an option

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"sarcl: error: {message} (see {self.prog} --help)\n")


def parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    top = _Parser(
        prog="sarcl",
        description="Synthetic-aperture-radar echoes and images on any OpenCL device.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("--version", action=_Version, nargs=0, help="print the version and stop")
    common = _Parser(add_help=False)
    common.add_argument("--debug", action="store_true", help="show the traceback of an error")
    common.add_argument("-v", "--verbose", action="store_true", help="print more about the run")
    device = _Parser(add_help=False)
    device.add_argument(
        "--device", metavar="NAME", help="part of a device's name, its number, cpu or gpu (see sarcl devices)"
    )
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)

    def command(name: str, text: str, *parents: _Parser) -> argparse.ArgumentParser:
        return commands.add_parser(
            name, help=text, description=text[0].upper() + text[1:] + ".", parents=[common, *parents]
        )

    command("devices", "list the OpenCL devices: which work, which do not and why")
    _demo(command("demo", "simulate the echoes of a scene, focus them and write the picture", device))
    _simulate(command("simulate", "make the echoes that a scenario file describes, and their image", device))
    _focus(command("focus", "turn echoes into an image: backprojection, polar_format or range_doppler", device))
    measure = command("measure", "measure a point response: resolution and side lobes")
    measure.add_argument(
        "image", metavar="IMAGE", help=f"image that sarcl wrote ({formats.suggested(formats.writing('image'))})"
    )
    measure.add_argument(
        "--near", nargs=3, type=float, action="append", metavar=("X", "Y", "Z"),
        help="m; default the brightest pixel; once per point",
    )  # fmt: skip
    measure.add_argument("--plot", metavar="FILE.png", help="draw the cuts in range and cross-range, of one point")
    _fda(
        command(
            "fda",
            "compare aperture mappings of frequency-diverse arrays with a conventional antenna: page and JSON",
            device,
        )
    )
    _papers(
        command(
            "papers",
            "list the reproduced papers, or reproduce one (farooq, saras, wan, zou): published and measured values",
            device,
        )
    )
    _bench(command("bench", "measure run time against achieved error, with peers on the same data"))
    return top


def _demo(p: argparse.ArgumentParser) -> None:
    p.add_argument("--out", default="out", metavar="DIR", help="folder for the results, made if missing (default out)")
    p.add_argument("--quick", action="store_true", help="half the resolution, in a few seconds")
    p.add_argument("--seed", type=int, default=0, help="seed of the random scene (default 0)")


def _simulate(p: argparse.ArgumentParser) -> None:
    images = formats.suggested(formats.writing("picture", "image"))
    p.add_argument("scenario", metavar="FILE.toml", help="scenario, see docs/guide/scenarios.md")
    p.add_argument("-o", "--output", metavar="RAW.h5", help="echoes (default: the scenario's name with _raw.h5, here)")
    p.add_argument(
        "--image",
        action="append",
        default=[],
        metavar="IMAGE",
        help=f"focus too and write {images}; repeatable (default, where there is a grid: FILE.png)",
    )
    p.add_argument("--tolerance", type=float, help="relative error allowed, instead of the scenario's")
    p.add_argument("--dry-run", action="store_true", help="print size, time and error of the echoes, and write nothing")
    _picture(p)


def _focus(p: argparse.ArgumentParser) -> None:
    images = formats.suggested(formats.writing("picture", "image"))
    p.add_argument("raw", nargs="+", metavar="RAW", help=f"{formats.readable('or')}; several are joined")
    p.add_argument(
        "-o",
        "--output",
        action="append",
        default=[],
        metavar="IMAGE",
        help=f"image to write, {images}; repeatable (default: RAW's name with .png, here)",
    )
    _focus_grid(p)
    _focus_method(p)
    _focus_ground(p)
    _focus_pieces(p)
    _focus_rows(p)
    _picture(p)


def _focus_grid(p: argparse.ArgumentParser) -> None:
    """Options of the grid."""
    where = p.add_argument_group("grid", "default: chosen from the data, and printed")
    where.add_argument("--grid", metavar="FILE.toml", help="take the grid from the [grid.*] table of a scenario file")
    where.add_argument("--center", nargs=3, type=float, metavar=("X", "Y", "Z"), help="centre of the grid, m")
    where.add_argument("--shape", nargs=2, type=int, metavar=("ROWS", "COLUMNS"), help="number of pixels")
    where.add_argument(
        "--spacing", nargs=2, type=float, metavar=("DY", "DX"), help="distance of rows and of columns, m"
    )
    where.add_argument(
        "--normal", nargs=3, type=float, metavar=("NX", "NY", "NZ"), help="normal of the plane (default 0 0 1)"
    )
    where.add_argument(
        "--x-axis", nargs=3, type=float, metavar=("X", "Y", "Z"), help="direction of columns (default 1 0 0)"
    )


def _focus_method(p: argparse.ArgumentParser) -> None:
    """Options of the method."""
    how = p.add_argument_group("focusing")
    default, of_fast = (f"{DEFAULTS[verb]['tolerance']:g}" for verb in ("backproject", "polar_format"))
    how.add_argument(
        "--tolerance",
        type=float,
        help=f"relative error allowed (default {default}; polar_format, range_doppler: {of_fast})",
    )
    how.add_argument(
        "--method",
        choices=[*CHOICES["backproject"]["method"], "polar_format", "range_doppler"],
        default=DEFAULTS["backproject"]["method"],
        help="backprojection (default auto: the cheaper of direct and factorized); polar_format: plane wavefronts; "
        "range_doppler: straight tracks and orbits, by zero-Doppler time and slant range",
    )
    how.add_argument("--dry-run", action="store_true", help="print method, time, memory and error, and focus nothing")
    how.add_argument(
        "--window",
        type=window,
        help="hamming, taylor:SIDELOBE_DB:NBAR such as taylor:35:5, hann, kaiser:8.6 ...; or RANGE,CROSS-RANGE",
    )
    how.add_argument(
        "--beam",
        type=degrees,
        metavar="DEG",
        help="full angle of the transmit beam, pointed at the grid's centre; range_doppler: of the azimuth beam",
    )
    how.add_argument(
        "--mapping",
        choices=CHOICES["backproject"]["mapping"],
        help="map the echoes of a frequency-diverse array first (docs/guide/fda.md)",
    )
    how.add_argument("--wrap", action="store_true", help="repeat ranges outside the unambiguous swath")
    how.add_argument("--max-bytes", type=size, metavar="SIZE", help="memory for blocks on the device, e.g. 2G")


def _focus_ground(p: argparse.ArgumentParser) -> None:
    """Options of the ground that is seen, and of range_doppler."""
    earth = p.add_argument_group("echoes of orbits, and range_doppler", "docs/guide/range_doppler.md")
    earth.add_argument(
        "--heights",
        metavar="H|DEM",
        help="of pixels: m above the ellipsoid (local tracks: z), or a DEM (default 0)",
    )
    earth.add_argument("--heights-above", metavar="NAME", help="what a DEM's heights are above: ellipsoid, EGM96 ...")
    earth.add_argument("--geoid", metavar="M|FILE", help="height of that geoid above the ellipsoid, m, or its raster")
    earth.add_argument("--side", choices=CHOICES["range_doppler"]["side"], help="side of the track, seen from above")
    earth.add_argument("--times", nargs=2, type=float, metavar=("FIRST", "LAST"), help="zero-Doppler times, s")
    earth.add_argument("--ranges", nargs=2, type=float, metavar=("NEAR", "FAR"), help="slant ranges, m")
    earth.add_argument(
        "--doppler", type=doppler, metavar="HZ|data", help="Doppler centroid (default: from the geometry)"
    )
    earth.add_argument(
        "--near", type=float, metavar="HZ", help="of --doppler data: the centroid nearest to this (default: geometry's)"
    )
    earth.add_argument(
        "--doppler-rate", type=doppler, metavar="HZ/S|data", help="Doppler rate (default: from the geometry)"
    )


def _focus_pieces(p: argparse.ArgumentParser) -> None:
    """Options of large images."""
    large = p.add_argument_group(
        "large images", "finished tiles of an IMAGE.h5 wait in IMAGE.h5.parts; --device all uses every device"
    )
    large.add_argument(
        "--tile", type=piece, metavar="I/N", help="make piece I of N alone; the last to finish puts the image together"
    )
    large.add_argument(
        "--resume",
        action=argparse.BooleanOptionalAction,
        help="keep finished tiles whatever ends the run (default: when it is killed), or --no-resume: start again",
    )


def _focus_rows(p: argparse.ArgumentParser) -> None:
    """Options that choose rows of the echoes."""
    rows = p.add_argument_group("data")
    rows.add_argument("--polarization", metavar="PQ", help="only rows of this polarisation, e.g. HV")
    rows.add_argument("--sum-polarizations", action="store_true", help="add rows of several polarisations coherently")
    rows.add_argument("--channel", type=int, metavar="N", help="only rows of this receive channel")
    rows.add_argument("--autofocus", action="store_true", help="apply the corrections a Gotcha file holds")


def _picture(p: argparse.ArgumentParser) -> None:
    grey = p.add_argument_group("grey levels of a .png", "its caption says what white and black are")
    grey.add_argument("--floor-db", type=float, default=-50.0, metavar="DB", help="black, dB below white (default -50)")
    white = grey.add_mutually_exclusive_group()
    white.add_argument("--top-db", type=float, metavar="DB", help="white, dB of a unit point in focus")
    white.add_argument(
        "--percentile",
        type=float,
        metavar="P",
        help="white: this percentile of the scene's pixels (default 99.5; 100: the brightest pixel)",
    )


def _fda(p: argparse.ArgumentParser) -> None:
    p.add_argument("experiment", metavar="FILE.toml", help="cases to run (docs/guide/fda.md)")
    p.add_argument("-o", "--output", metavar="PATH", help="the page, default FILE.html, with FILE.json beside it")


def _papers(p: argparse.ArgumentParser) -> None:
    p.add_argument(
        "paper",
        nargs="?",
        metavar="NAME",
        help="farooq, saras, wan or zou (docs/guide/papers.md); none: list the papers",
    )
    p.add_argument(
        "-o",
        "--output",
        metavar="PATH",
        help="the page, or a folder for it, default NAME.html, with NAME.json beside it",
    )
    p.add_argument(
        "--quick",
        action="store_true",
        help="compute less: smaller fields, fewer elements and looks; the page says what",
    )


def _bench(p: argparse.ArgumentParser) -> None:
    p.add_argument("what", nargs="?", choices=["backproject"], default="backproject", help="what to measure")
    p.add_argument("--json", metavar="FILE", help="write all measurements, .json")
    p.add_argument("--picture", metavar="FILE", help="plot rate against error, .png (needs the extra plots)")
    what = p.add_argument_group("what is measured")
    what.add_argument("--scenes", nargs="+", choices=["spotlight", "straight"], help="tracks (default both)")
    what.add_argument("--data", choices=["noise", "points"], help="default noise for spotlight, points for straight")
    what.add_argument("--sizes", nargs="+", type=int, metavar="N", help="pulses, samples, image side (default 1024)")
    what.add_argument("--tolerances", nargs="+", type=float, metavar="T", help="default 1e-1 to 1e-6")
    what.add_argument(
        "--methods", nargs="+", choices=["direct", "factorized", "auto"], help="default direct factorized"
    )
    what.add_argument("--devices", nargs="+", metavar="NAME", help="as --device elsewhere (default all that work)")
    what.add_argument("--no-fp64", action="store_true", help="measure each device again without float64")
    peer = p.add_argument_group("peers")
    peer.add_argument("--peer-python", metavar="PATH", help="a Python that has fastsar (default this one)")
    peer.add_argument("--peer-backend", choices=["cpu", "cuda", "jax", "auto"], help="fastsar's (default cpu)")
    peer.add_argument("--no-peers", action="store_true", help="measure sarcl alone, without NumPy and fastsar")
    how = p.add_argument_group("how")
    how.add_argument("--repeats", type=int, metavar="K", help="runs of each, alternating (default 5)")
    how.add_argument(
        "--pixels", type=int, metavar="K", help="pixels checked against the exact sum, at least 256 (default 1024)"
    )
    how.add_argument("--limit", type=float, metavar="S", help="leave out runs that would take longer, s (default 120)")
    how.add_argument(
        "--patience", type=float, metavar="S", help="wait up to so long for an idle machine, s (default 0)"
    )


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> NoReturn:
        from ..base.version import __version__

        print(f"sarcl {__version__}")
        parser.exit()


def window(text: str) -> Any:
    """ "none", "hamming", "taylor:35:5" or "hann,none" as `backproject` takes it."""
    from ..numerics.windows import parse

    try:
        return parse(text)
    except ValueError as exc:
        raise argparse.ArgumentTypeError(str(exc)) from None


def size(text: str) -> float:
    """ "2G", "500 MB", "1.5GiB" in bytes."""
    unit = text.strip().lower().removesuffix("b")
    base = 1024 if unit.endswith("i") else 1000
    unit = unit.removesuffix("i")
    power = "kmgt".find(unit[-1:]) + 1 if unit else 0
    try:
        value = float(unit[:-1] if power else unit) * base**power
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r} is not a size; give bytes, e.g. 2G, 500M or 1.5GiB")
    return value


def doppler(text: str) -> Any:
    """ "geometry", "data", or Hz (Hz/s)."""
    return text if text in ("geometry", "data") else float(text)


def degrees(text: str) -> float:
    """An angle in degrees as rad."""
    return math.radians(float(text))


def piece(text: str) -> tuple[int, int]:
    """ "2/8": piece 2 of 8."""
    match = re.fullmatch(r"\s*(\d+)\s*/\s*(\d+)\s*", text)
    i, n = (int(match[1]), int(match[2])) if match else (1, 0)
    if not i <= n:
        raise argparse.ArgumentTypeError(f"{text!r} is not a piece; give I/N with I from 1 to N, such as 2/8")
    return i, n


def main(argv: list[str] | None = None) -> int:
    """Run a command; returns the exit status."""
    outputs: Any = {}
    debug = "--debug" in (sys.argv[1:] if argv is None else argv)
    try:
        args = parser().parse_args(argv)
        args.command_line = shlex.join(["sarcl", *(sys.argv[1:] if argv is None else argv)])
        from ._commands import run

        return run(args, outputs)
    except KeyboardInterrupt as exc:
        if debug:
            raise
        by_term = signal.SIGTERM in exc.args
        print(f"sarcl: {'ended by SIGTERM' if by_term else 'interrupted'}; {_kept(outputs)}", file=sys.stderr)
        return ENDED if by_term else INTERRUPTED
    except BrokenPipeError:  # the reader of our output has ended: `sarcl devices | head -1`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except Exception as exc:
        if debug:
            raise
        status = _status(exc)
        text = " ".join(str(exc).split()) or type(exc).__name__
        if status == FAILED:
            text = f"{type(exc).__name__}: {text} (--debug shows where)"
        print(f"sarcl: error: {text}", file=sys.stderr)
        return status


def _kept(outputs: Any) -> str:
    if not outputs:
        return "nothing was written"
    from ._job import complete

    names = complete(outputs)
    verb = "is" if len(names) == 1 else "are"
    tiles = any(os.path.isdir(os.path.realpath(path) + ".parts") for path in outputs)
    rest = (
        "only finished tiles are kept" if tiles else "nothing was written" if not names else "nothing else was written"
    )
    return f"{' and '.join(names)} {verb} complete, {rest}" if names else rest


def _status(exc: Exception) -> int:
    if any(
        c.__name__ == "NoDeviceError" for c in type(exc).__mro__
    ):  # found by name, so that its module need not be loaded
        return NO_DEVICE
    return BAD_INPUT if isinstance(exc, (ValueError, TypeError, OSError, MemoryError)) else FAILED
