"""The parser of the command line: sarcl devices | doctor | demo | simulate | focus | measure | fda | papers | bench.

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
from collections.abc import Callable
from typing import Any, NoReturn

from ..io import entry_points, formats
from ._flags import CHOICES, DEFAULTS, METHODS

EPILOG = """examples:
  sarcl demo                                            simulate and focus a scene: out/demo.png
  sarcl simulate scene.toml -o raw.h5 --image image.png
  sarcl focus raw.h5 -o image.png -o image.h5 --window taylor:35:5
  sarcl focus pass.cphd                                 on the image area that the file names: pass.png
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


def _add(group: Any, words: str, text: str, kind: Callable[[str], object] | None = None, **options: Any) -> None:
    """Add an option: its names and what follows them, as "-o --output PATH", its help, and what a value becomes."""
    names = [word for word in words.split() if word.startswith("-")] or words.split()[:1]
    values = tuple(words.split()[len(names) :])
    if len(values) > 1:
        options |= {"nargs": len(values), "metavar": values}
    elif values:
        options["metavar"] = values[0]
    if kind is not None:
        options["type"] = kind
    group.add_argument(*names, help=text, **options)


def _image_endings(*more: formats.Written) -> str:
    """Endings of files that images are written to."""
    return formats.suggested(formats.writing(*formats.OF_IMAGES, *more))


def _flag(group: object, words: str, text: str) -> None:
    """Add an option without a value."""
    _add(group, words, text, action="store_true")


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
    _flag(common, "--debug", "show the traceback of an error")
    _flag(common, "-v --verbose", "print more about the run")
    device = _Parser(add_help=False)
    _add(device, "--device NAME", "part of a device's name, its number, cpu or gpu (see sarcl devices)")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)

    def command(name: str, text: str, *parents: _Parser) -> argparse.ArgumentParser:
        return commands.add_parser(
            name, help=text, description=text[0].upper() + text[1:] + ".", parents=[common, *parents]
        )

    command("devices", "list the OpenCL devices: which work, which do not and why")
    doctor = command("doctor", "say what keeps OpenCL, or a part of it, from working on this machine, and the remedy")
    _flag(doctor, "--json", "print all that was found as JSON")
    demo = command("demo", "simulate the echoes of a scene, focus them and write the picture", device)
    _add(demo, "--out DIR", "folder for the results, made if missing (default out)", default="out")
    _flag(demo, "--quick", "half the resolution, in less time")
    _add(demo, "--seed", "seed of the random scene (default 0)", int, default=0)
    _simulate(command("simulate", "make the echoes that a scenario file describes, and their image", device))
    _focus(command("focus", "turn echoes into an image: backprojection, polar_format or range_doppler", device))
    measure = command("measure", "measure a point response: resolution and side lobes")
    _add(measure, "image IMAGE", f"image that sarcl wrote ({formats.suggested(formats.writing('image'))})")
    _add(measure, "--near X Y Z", "m; default the brightest pixel; once per point", float, action="append")
    _add(measure, "--plot FILE.png", "draw the cuts in range and cross-range, of one point")
    text = "compare aperture mappings of frequency-diverse arrays with a conventional antenna: page and JSON"
    fda = command("fda", text, device)
    _add(fda, "experiment FILE.toml", "cases to run (docs/guide/fda.md)")
    _add(fda, "-o --output PATH", "the page, default FILE.html, with FILE.json beside it")
    text = "list the reproduced papers, or reproduce one (farooq, saras, wan, zou): published and measured values"
    papers = command("papers", text, device)
    _add(papers, "paper NAME", "farooq, saras, wan or zou (docs/guide/papers.md); none: list the papers", nargs="?")
    _add(papers, "-o --output PATH", "the page, or a folder for it, default NAME.html, with NAME.json beside it")
    _flag(papers, "--quick", "compute less: smaller fields, fewer elements and looks; the page says what")
    _bench(command("bench", "measure run time against achieved error, with peers on the same data"))
    return top


def _simulate(p: argparse.ArgumentParser) -> None:
    images = f"focus too and write {_image_endings()}; repeatable (default, where there is a grid: FILE.png)"
    _add(p, "scenario FILE.toml", "scenario, see docs/guide/scenarios.md")
    _add(p, "-o --output RAW.h5", "echoes (default: the scenario's name with _raw.h5, here)")
    _add(p, "--image IMAGE", images, action="append", default=[])
    _add(p, "--tolerance", "relative error allowed, instead of the scenario's", float)
    _flag(p, "--dry-run", "print size, time and error of the echoes, and write nothing")
    _pieces(p, "large jobs", "RAW.h5", "puts the echoes together")
    _picture(p)


def _focus(p: argparse.ArgumentParser) -> None:
    images = f"image to write, {_image_endings('product')}; repeatable (default: RAW's name with .png, here)"
    _add(p, "raw RAW", f"{formats.readable('or')}; several are joined", nargs="+")
    _add(p, "-o --output IMAGE", images, action="append", default=[])
    _focus_grid(p)
    _focus_method(p)
    _focus_ground(p)
    _pieces(p, "large images", "IMAGE.h5", "puts the image together")
    _focus_rows(p)
    _picture(p)


def _focus_grid(p: argparse.ArgumentParser) -> None:
    """Options of the grid."""
    where = p.add_argument_group("grid", "default: chosen from the data, and printed")
    _add(where, "--grid FILE.toml", "take the grid from the [grid.*] table of a scenario file")
    _add(where, "--center X Y Z", "centre of the grid, m", float)
    _add(where, "--shape ROWS COLUMNS", "number of pixels", int)
    _add(where, "--spacing DY DX", "distance of rows and of columns, m", float)
    _add(where, "--normal NX NY NZ", "normal of the plane (default 0 0 1)", float)
    _add(where, "--x-axis X Y Z", "direction of columns (default 1 0 0)", float)


def _focus_method(p: argparse.ArgumentParser) -> None:
    """Options of the method."""
    how = p.add_argument_group("focusing")
    default, of_fast = (f"{DEFAULTS[verb]['tolerance']:g}" for verb in ("backproject", "polar_format"))
    text = f"relative error allowed (default {default}; polar_format, range_doppler: {of_fast})"
    _add(how, "--tolerance", text, float)
    text = (
        "backprojection (default auto: the cheaper of direct and factorized); polar_format: plane wavefronts; "
        "range_doppler: straight tracks and orbits, by zero-Doppler time and slant range"
    )
    text += "; or the name of a verb that an installed package adds"
    _add(how, f"--method {{{','.join(METHODS)}}}", text, method, default=DEFAULTS["backproject"]["method"])
    _add(how, "--option NAME=VALUE", "of such a verb; repeatable", action="append", default=[])
    _flag(how, "--dry-run", "print method, time, memory and error, and focus nothing")
    text = "hamming, taylor:SIDELOBE_DB:NBAR such as taylor:35:5, hann, kaiser:8.6 ...; or RANGE,CROSS-RANGE"
    _add(how, "--window", text, window)
    text = "full angle of the transmit beam, pointed at the grid's centre"
    _add(how, "--beam DEG", text, degrees)
    text = "map the echoes of a frequency-diverse array first (docs/guide/fda.md)"
    _add(how, "--mapping", text, choices=CHOICES["backproject"]["mapping"])
    _flag(how, "--wrap", "repeat ranges outside the unambiguous swath")
    _add(how, "--max-bytes SIZE", "memory for blocks on the device, e.g. 2G", size)


def _focus_ground(p: argparse.ArgumentParser) -> None:
    """Options of the ground that is seen, and of range_doppler."""
    earth = p.add_argument_group("echoes of orbits, and range_doppler", "docs/guide/range_doppler.md")
    _add(earth, "--heights H|DEM", "of pixels: m above the ellipsoid (local tracks: z), or a DEM (default 0)")
    _add(earth, "--heights-above NAME", "what a DEM's heights are above: ellipsoid, EGM96 ...")
    _add(earth, "--geoid M|FILE", "height of that geoid above the ellipsoid, m, or its raster")
    _add(earth, "--side", "side of the track, seen from above", choices=CHOICES["range_doppler"]["side"])
    _add(earth, "--times FIRST LAST", "zero-Doppler times, s", float)
    _add(earth, "--ranges NEAR FAR", "slant ranges, m", float)
    _add(earth, "--azimuth-beam DEG", "full angle of the azimuth beam about the Doppler centroid", degrees)
    _add(earth, "--doppler HZ|data", "Doppler centroid (default: from the geometry)", doppler)
    _add(earth, "--near HZ", "of --doppler data: the centroid nearest to this (default: geometry's)", float)
    _add(earth, "--doppler-rate HZ/S|data", "Doppler rate (default: from the geometry)", doppler)


def _pieces(p: argparse.ArgumentParser, title: str, name: str, together: str) -> None:
    """Options of results that are computed in blocks."""
    large = p.add_argument_group(
        title, f"finished tiles of {name} wait in {name}.parts; --device all uses every device"
    )
    _add(large, "--tile I/N", f"make piece I of N alone; the last to finish {together}", piece)
    text = "keep finished tiles whatever ends the run (default: when it is killed), or --no-resume: start again"
    _add(large, "--resume", text, action=argparse.BooleanOptionalAction)


def _focus_rows(p: argparse.ArgumentParser) -> None:
    """Options that choose rows of the echoes."""
    rows = p.add_argument_group("data")
    _add(rows, "--polarization PQ", "only rows of this polarisation, e.g. HV")
    _flag(rows, "--sum-polarizations", "add rows of several polarisations coherently")
    _add(rows, "--channel N", "only rows of this receive channel; of CPHD the name of a channel")
    _flag(rows, "--autofocus", "apply the corrections a Gotcha file holds")


def _picture(p: argparse.ArgumentParser) -> None:
    grey = p.add_argument_group("grey levels of a .png", "its caption says what white and black are")
    _add(grey, "--floor-db DB", "black, dB below white (default -50)", float, default=-50.0)
    white = grey.add_mutually_exclusive_group()
    _add(white, "--top-db DB", "white, dB of a unit point in focus", float)
    text = "white: this percentile of the scene's pixels (default 99.5; 100: the brightest pixel)"
    _add(white, "--percentile P", text, float)
    maps = p.add_argument_group("maps, .tif", "GeoTIFF of images in Earth-fixed coordinates (needs the extra maps)")
    _add(
        maps,
        "--map-value",
        "of the pixels (default complex)",
        choices=("complex", "amplitude", "db"),
        default="complex",
    )
    _add(maps, "--map-crs CRS", "as EPSG:4326 (default: that of the grid, or the UTM zone)")


def _bench(p: argparse.ArgumentParser) -> None:
    text = 'every verb on tasks of its own (default), or images beside peers ("backproject")'
    _add(p, "what", text, choices=["verbs", "backproject"], default="verbs", nargs="?")
    _add(p, "--json FILE", "write all measurements, .json")
    text = "plot run time against error, .png: of verbs, a picture for each, FILE-VERB.png (needs the extra plots)"
    _add(p, "--picture FILE", text)
    what = p.add_argument_group("what is measured")
    _flag(what, "--quick", "verbs: small tasks, few tolerances, one run; at most 3 CPU minutes")
    _add(what, "--verbs NAME", "verbs: names of tasks, such as 'echo of points' (default all)", nargs="+")
    scenes = ["spotlight", "straight", "spaceborne"]
    _add(what, "--scenes", "images: tracks (default the first two)", choices=scenes, nargs="+")
    _add(what, "--data", "images: default noise for spotlight, points for straight", choices=["noise", "points"])
    _add(what, "--sizes N", "of the tasks; of images: pulses, samples, image side (default 1024)", int, nargs="+")
    _add(what, "--tolerances T", "of images: default 1e-1 to 1e-6", float, nargs="+")
    _add(what, "--methods", "images: default direct factorized", choices=["direct", "factorized", "auto"], nargs="+")
    _add(what, "--devices NAME", "as --device elsewhere (default all that work)", nargs="+")
    _flag(what, "--no-fp64", "measure each device again without float64")
    peer = p.add_argument_group("peers")
    _add(peer, "--peer-python PATH", "a Python that has fastsar (default this one)")
    _add(peer, "--peer-backend", "fastsar's (default cpu)", choices=["cpu", "cuda", "jax", "auto"])
    _flag(peer, "--no-peers", "measure sarcl alone, without NumPy and fastsar")
    how = p.add_argument_group("how")
    _add(how, "--repeats K", "runs of each, alternating (default 3, of images 5)", int)
    _add(how, "--pixels K", "pixels checked against the exact sum, at least 256 (default 1024)", int)
    _add(how, "--limit S", "leave out runs that would take longer, s (default 120)", float)
    _add(how, "--patience S", "wait up to so long for an idle machine, s (default 0)", float)


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from ..base.version import __version__

        print(f"sarcl {__version__}")
        parser.exit()


def window(text: str) -> object:
    """ "none", "hamming", "taylor:35:5" or "hann,none" as `backproject` takes it."""
    from ..numerics.windows import parse

    try:
        return parse(text)
    except ValueError as exc:
        raise argparse.ArgumentTypeError(str(exc)) from None


def method(text: str) -> str:
    """A method of sarcl, or the name of a verb that an installed package adds."""
    if text in METHODS or text in (added := entry_points.names("verbs")):
        return text
    raise argparse.ArgumentTypeError(f"invalid choice: {text!r} (choose from {', '.join([*METHODS, *added])})")


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


def doppler(text: str) -> str | float:
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
    outputs: dict[str, tuple[int, int] | None] = {}
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


def _kept(outputs: dict[str, tuple[int, int] | None]) -> str:
    if not outputs:
        return "nothing was written"
    from ..io import output_paths
    from ._job import complete

    names = complete(outputs)
    verb = "is" if len(names) == 1 else "are"
    rest = "nothing else was written" if names else "nothing was written"
    if any(map(output_paths.tile_folder, outputs)):
        rest = "only finished tiles are kept"
    return f"{' and '.join(names)} {verb} complete, {rest}" if names else rest


def _status(exc: Exception) -> int:
    if "NoDeviceError" in (kind.__name__ for kind in type(exc).__mro__):  # by name: its module need not be loaded
        return NO_DEVICE
    return BAD_INPUT if isinstance(exc, (ValueError, TypeError, OSError, MemoryError)) else FAILED
