"""The commands that sarcl/cli/parser.py reads, one function each, and the table that `sarcl devices` prints.

Every output path is checked before the work starts.
"""

from __future__ import annotations

import argparse
import logging
import os
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.errors import SarclWarning
from ..base.text import duration
from ..io import formats, input_paths, output_paths
from . import _doctor
from ._job import Job, Outputs
from ._pages import bench, fda, papers

if TYPE_CHECKING:
    from ..base.report import Report
    from ..model.image import Image
    from ..model.image_grid import ImageGrid
    from ..model.phase_history import PhaseHistory
    from ._methods import Method

HEAD = ("", "", "device", "platform", "kind", "works", "fp64", "vector", "memory", "largest buffer")


def run(args: argparse.Namespace, outputs: Outputs) -> int:
    """Run the command in `args`; `outputs` gets what each output path is before the work."""
    logging.basicConfig(level=logging.INFO if args.verbose else logging.WARNING, format="sarcl: %(message)s")
    warnings.showwarning = _show_warning
    commands = {
        "devices": devices,
        "doctor": lambda args, job: _doctor.run(args.json),
        "demo": demo,
        "simulate": simulate,
        "focus": focus,
        "measure": measure,
        "fda": fda,
        "papers": papers,
        "bench": bench,
    }
    with Job(outputs) as job:
        return commands[args.command](args, job)


def devices(args: argparse.Namespace, job: Job) -> int:
    """Print the table of devices, the one in use marked; 3 where none works."""
    from ..opencl import device_list
    from ..opencl.choose_device import NoDeviceError, open_devices

    infos = device_list.tried_again()
    works = any(d.works for d in infos)
    try:
        print(device_table(infos, [d.info.index for d in open_devices(None)]))
    except NoDeviceError as exc:
        print(device_table(infos, []))
        print(f"sarcl: {'' if works else 'error: '}{exc}", file=sys.stderr)
    return 0 if works else 3


def demo(args: argparse.Namespace, job: Job) -> int:
    """Simulate and focus the demo scene; print how long each step took."""
    from ..experiments import demo as demo_scene

    for path in demo_scene.outputs(args.out):
        job.expect(path)
    demo_scene.run(args.out, quick=args.quick, device=args.device, seed=args.seed, progress=job.progress, say=job.say)
    return 0


def simulate(args: argparse.Namespace, job: Job) -> int:
    """Echoes of a scenario, and their image where there is a grid or --image asks for one."""
    from ..opencl.choose_device import open_devices
    from ..scenario.scenario import load
    from ._methods import echo_pieces

    scenario = load(args.scenario)
    running = echo_pieces(args, scenario)
    stem = Path(args.scenario).stem
    output = args.output or f"{stem}_raw.h5"
    images = args.image or ([f"{stem}.png"] if scenario.has_image else [])
    job.expect_named([output], formats.writing("phase history"), [args.scenario])
    job.expect_named(images, formats.writing(*formats.OF_IMAGES), [args.scenario, output])
    _check_scale(args)
    grid = scenario.build_grid() if scenario.grid is not None else None
    devices = open_devices(args.device)
    options: dict[str, Any] = {} if args.tolerance is None else {"tolerance": args.tolerance}
    on: dict[str, Any] = {"device": devices}
    if scenario.orbit is not None:
        job.say(scenario.describe_orbit())
    if args.dry_run:
        print(scenario.plan(**options, **on))
        if images:
            print(f"image: {scenario.describe_image()}")
        return 0
    _check_room(grid, images)
    _check_maps(grid, images, args)
    if scenario.noise is None:  # pulse after pulse into the file
        raw = scenario.simulate(**options, **on, **running, out=output, progress=job.progress)
        job.check()
        if raw is None:
            _say_piece(output, job)
            return 0
    else:
        raw = scenario.simulate(**options, **on, progress=job.progress)
        job.check()
        raw.save(output)
    _say_report("echo", raw.report, job)
    if raw.time is None:
        job.say("the track has no times: the antenna rests while a pulse is on its way; prf or speed gives it times")
    job.say(f"wrote {output}: {raw.n_rows} rows of {raw.n_samples} samples")
    if images:
        raw = _compressed(raw, job)
        if grid is None and scenario.needs_grid:
            grid = _default_grid(raw, job, scenario.default_grid_options())
        _check_room(grid, images)
        _check_maps(grid, images, args)
        options |= {"device": devices if scenario.focuses_in_blocks else devices[0]}
        _focus(lambda out: scenario.focus(raw, grid, out=out, progress=job.progress, **options), images, args, job)
    return 0


def focus(args: argparse.Namespace, job: Job) -> int:
    """Focus echoes."""
    from ..imaging.focusing_task import check_polarizations
    from ..model.phase_history import PhaseHistory
    from ..model.store import read
    from ..opencl.choose_device import open_devices
    from ..scenario.scenario import load
    from ._methods import Method, check_default_grid, check_pieces, heights

    for path in filter(os.path.isdir, args.raw):  # before an output is named after it
        input_paths.check(Path(path), folder=f"give the files in it, as in {Path(path) / '*'}")
    outputs = args.output or [f"{Path(args.raw[0]).stem}.png"]
    method = Method.of(args)
    check_pieces(args, outputs)
    among = formats.writing(*formats.OF_IMAGES, "product")
    job.expect_named(outputs, among, [*args.raw, *([args.grid] if args.grid else [])])
    _check_scale(args)
    place = _grid_options(args)
    grid = None if args.grid is None else load(args.grid).build_grid()
    rows = {"polarization": args.polarization, "channel": args.channel}
    raw = read(args.raw if len(args.raw) > 1 else args.raw[0], autofocus=args.autofocus, **rows)
    if not isinstance(raw, PhaseHistory):
        raise ValueError(f"{args.raw[0]!r} holds an image; focus wants echoes (sarcl measure takes images)")
    check_polarizations(raw, args.sum_polarizations, "--polarization {}", "--sum-polarizations")
    devices: Any = open_devices(args.device)
    job.say(f"{raw.n_rows} rows of {raw.n_samples} samples at {raw.center_frequency.mean() / 1e9:.4g} GHz")
    raw = _compressed(raw, job)
    levels = heights(args)
    if method.name == "range_doppler":
        method.options["heights"] = levels
    else:
        check_default_grid(args, raw)
    if grid is None and method.name != "range_doppler":
        grid = _default_grid(raw, job, {**place, "side": args.side, "heights": levels})
    if method.name != "backproject":  # by one device
        devices = devices[0]
    if args.dry_run:
        forecast = method.plan(raw, grid, devices)
        if grid is None:
            job.say(f"grid: {forecast.plan['pixels']} zero-Doppler times x slant ranges")
        print(forecast)
        return 0
    running = {} if method.name != "backproject" else {"tile": args.tile, "resume": args.resume}
    _check_room(grid, outputs)
    _check_maps(grid, outputs, args)
    if any(formats.named(path, [formats.SICD]) for path in outputs):
        _check_product(raw, grid, method)

    def image(out: str | None) -> Image | None:
        return method.image(raw, grid, devices, out=out, progress=job.progress, **running)

    _focus(image, outputs, args, job, raw)
    return 0


def measure(args: argparse.Namespace, job: Job) -> int:
    """The point response near each position, or at the brightest pixel, as a table; its cuts as a picture."""
    from ..model.image import Image
    from ..model.store import read

    if args.plot is not None:
        if len(args.near or [()]) > 1:
            raise ValueError(f"--plot draws the cuts of one point, and {len(args.near)} --near are given; give one")
        if not args.plot.lower().endswith(".png"):
            raise ValueError(f"--plot is {args.plot!r}; cuts are drawn in a PNG: give a name that ends in .png")
        job.expect(args.plot)
    image = read(args.image)
    if not isinstance(image, Image):
        raise ValueError(f"{args.image!r} holds echoes; measure wants an image (sarcl focus makes one)")
    from ..analysis import point_response

    near = args.near[0] if args.near and len(args.near) == 1 else args.near
    responses = point_response.measure(image, near=near)
    if isinstance(responses, tuple):
        print("\n\n".join(map(str, responses)))
        return 0
    print(responses)
    if args.plot is not None:
        from ..figures.decibels import write_png

        write_png(responses.show(), args.plot)
        job.say(f"wrote {args.plot}")
    return 0


def _check_product(raw: PhaseHistory, grid: ImageGrid | None, method: Method) -> None:
    """Refuse, before the work, images that no SICD file can describe, as far as that is known."""
    import numpy as np

    from ..model.image import Image
    from ..model.sicd.image_product import check

    if grid is None or method.name != "backproject":
        raise ValueError(f"SICD describes images by backproject; leave out --method {method.name}, or write .h5")
    empty = Image(np.broadcast_to(np.complex64(), grid.shape), grid)
    check(empty, raw, has_beam=method.options.get("beam") is not None)


def _check_room(grid: ImageGrid | None, outputs: list[str]) -> None:
    """Refuse, before the work, outputs for which the disk has no room, where the size of the image is known."""
    from ..figures.decibels import picture_bytes

    if grid is not None and len(grid.shape) == 2:
        pictures, shape = formats.writing("picture"), (grid.shape[0], grid.shape[1])
        drawn, stored = picture_bytes(shape, grid.spacing), 8.0 * grid.size
        output_paths.check_room({p: drawn if formats.named(p, pictures) else stored for p in outputs})


def _check_maps(grid: ImageGrid | None, outputs: list[str], args: argparse.Namespace) -> None:
    """Refuse, before the work, maps of an image in a local frame, and a CRS that is not known."""
    if any(formats.named(path, formats.writing("map")) for path in outputs):
        from ..earth.map_projection import MapProjection
        from ..model.maps.saving import check_place

        if args.map_crs is not None:
            MapProjection.of(args.map_crs)
        if grid is not None:
            check_place(grid)


def _check_scale(args: argparse.Namespace) -> None:
    """Refuse, before the work, grey levels that no picture can have."""
    from ..figures.decibels import check_scale

    check_scale(args.floor_db, args.top_db, args.percentile, ("--floor-db", "--top-db", "--percentile"))


def _grid_options(args: argparse.Namespace) -> dict[str, Any]:
    """What the options say of the grid, refused before the data are read where it makes no plane."""
    from ..model.image_grid import ImageGrid

    names = ("center", "shape", "spacing", "normal", "x_axis")
    values = {n: getattr(args, n) for n in names if getattr(args, n) is not None}
    if args.grid is not None and values:
        other = next(iter(values)).replace("_", "-")
        raise ValueError(f"--grid and --{other} both describe the grid; give one or the other")
    ImageGrid.plane(**{"shape": 1, "spacing": 1.0, **values})
    return values


def _default_grid(raw: PhaseHistory, job: Job, options: dict[str, Any]) -> ImageGrid:
    from ..imaging.default_grid import choose_grid

    choice = choose_grid(raw, **options)
    grid = choice.grid
    assert grid.spacing is not None and grid.center is not None
    pixels = f"{grid.shape[0]} x {grid.shape[1]} pixels of {grid.spacing[0]:.4g} x {grid.spacing[1]:.4g} m"
    job.say(f"grid: {pixels} about ({', '.join(f'{c:.6g}' for c in grid.center)})")
    if choice.why:
        job.say(f"      from the data: {choice.why}")
    return grid


def _compressed(raw: PhaseHistory, job: Job) -> PhaseHistory:
    if raw.compressed:
        return raw
    from ..imaging.compress import compress

    job.say("the echoes are not compressed: compressing them first")
    return compress(raw)


def _focus(
    make: Callable[[str | None], Image | None],
    outputs: list[str],
    args: argparse.Namespace,
    job: Job,
    raw: PhaseHistory | None = None,
) -> None:
    """Make the image, in the first of `outputs` that takes it block by block, and write the other outputs."""
    from ..figures.decibels import write_png

    by_blocks, pictures = formats.writing("image", by_blocks=True), formats.writing("picture")
    file = next((p for p in outputs if formats.named(p, by_blocks)), None)
    image = make(file)
    if image is None:
        _say_piece(file, job)
        return
    _say_report("focus", image.report, job)
    for path in outputs:
        scale = ""
        if formats.named(path, pictures):
            picture = image.show(args.floor_db, top_db=args.top_db, percentile=args.percentile)
            write_png(picture, path)
            scale = f". {picture.info['caption']}"
        elif path != file and raw is not None and formats.named(path, [formats.SICD]):
            image.save(path, collection=raw)
        elif formats.named(path, formats.writing("map")):
            image.save(path, value=args.map_value, crs=args.map_crs)
        elif path != file:
            image.save(path)
        job.say(f"wrote {path}{scale}")


def _say_piece(path: str | None, job: Job) -> None:
    folder = path and output_paths.tile_folder(path)
    where = f"{path}{folder.suffix}" if folder else f"files beside {path}"
    job.say(f"this piece is finished; its tiles wait in {where} for those of the other pieces")


def _say_report(what: str, report: Report | None, job: Job) -> None:
    if report is None:
        return
    steps = ", ".join(f"{stage} {duration(s)}" for stage, s in report.seconds.items() if s >= 0.05)
    job.say(f"{what}: {duration(sum(report.seconds.values()))} on {report.device}" + (steps and f" ({steps})"))
    error = f"error {report.tolerance:.1e} allowed, {report.predicted_error:.1e} predicted"
    if report.measured_error is not None:
        error += f", {report.measured_error:.1e} measured at random places"
    if report.model_error is not None:
        error += f"; model {report.model_error:.1e} predicted"
    job.say(f"{'':{len(what)}}  {error}")
    logging.getLogger("sarcl").info("%s", report)


def _show_warning(
    message: Warning | str, category: type[Warning], filename: str, lineno: int, *rest: object, **more: object
) -> None:
    if issubclass(category, SarclWarning):
        print(f"sarcl: warning: {message}", file=sys.stderr)
    else:  # of another package: with its place, as Python shows it
        print(warnings.formatwarning(message, category, filename, lineno), end="", file=sys.stderr)


def device_table(devices: Sequence[Any], picked: Sequence[int]) -> str:
    """`sarcl.devices()` as a table, a star at the indices `picked`, the reasons under what does not work."""
    from ..base.text import size_text

    rows = [HEAD]
    for d in devices:
        mark = "*" if d.index in picked else ""
        yes = ["yes" if v else "no" for v in (d.works, d.fp64)]
        rows.append((mark, str(d.index), d.name, d.platform, d.kind, *yes, str(d.vector_width),
                     size_text(d.memory), size_text(d.max_alloc)))  # fmt: skip
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(f"{cell:{w}}" for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows]
    for n, d in reversed(list(enumerate(devices, 1))):
        if d.why:
            what = "float64 does not work" if d.works else "does not work"
            lines.insert(n + 1, f"{'':{widths[0] + widths[1] + 4}}{what}: {d.why}")
    if picked:
        lines += ["", "* is used unless --device or SARCL_DEVICE names another"]
    return "\n".join(lines) if devices else "no OpenCL device"
