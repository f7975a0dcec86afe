"""The verbs: from a scene to echoes or cross sections, from echoes to an image; and plan(), which forecasts them.

A verb is imported from its room when it is first used: an image needs none of the rooms that make echoes. An installed
package adds a verb by an entry point of the group sarcl.verbs (docs/developers/extensions.md). Types of the arguments
for type checkers and editors: __init__.pyi, which docs/developers/write_options.py makes of the verbs' records.
"""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from typing import Any

from ..base.forecast import Forecast as Forecast
from ..io import entry_points
from ..model.lazy_rows import file_stamps
from ..model.phase_history import PhaseHistory

# verb -> the file that defines it
HOMES = {
    "echo": "simulation.echo",
    "spectral_echo": "simulation.spectral.spectral_echo",
    "fullwave_echo": "fullwave.echoes.fullwave_echo",
    "backproject": "imaging.backproject",
    "polar_format": "imaging.polar_format.polar_format",
    "range_doppler": "imaging.range_doppler.range_doppler",
}
# a verb that returns plain numbers, without a report -> the file that defines it
NUMBERS = {"rcs": "simulation.rcs.rcs"}
__all__ = ["backproject", "echo", "fullwave_echo", "plan", "polar_format", "range_doppler", "rcs", "spectral_echo"]


def __getattr__(name: str) -> Any:
    homes = HOMES | NUMBERS
    if name not in homes:
        verb = None if name.startswith("_") else entry_points.added("verbs", name)
        if verb is None:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {', '.join(__all__)}")
        if not hasattr(verb, "planned"):
            raise TypeError(f"the entry point {name!r} of sarcl.verbs is {verb!r:.60}; make it by @sarcl.verb(record)")
        return verb
    verb = getattr(import_module(f"..{homes[name]}", __name__), name)
    globals()[name] = verb
    return verb


def plan(*args: Any, **options: Any) -> Forecast[Any]:
    """Forecast of a verb: plan(verb, *args, **options) with the arguments of `verb(...)`, before any work.

    plan(sarcl.echo, scene, waveform, track, tolerance=1e-3) forecasts those echoes; plan(raw, grid, ...) is short for
    plan(sarcl.backproject, raw, grid, ...). Options that only a run has (check, progress, out, resume, tile, cluster)
    are taken too, for forecast.run().

    Returns a Forecast: method, plan, seconds, bytes, predicted_error, error_terms, cheaper, n_rows, n_samples. Its
    run() carries out this very plan; ValueError where a file of echoes has changed meanwhile. TypeError for what is no
    verb, and for options that the verb does not have; else plan raises and warns as the verb does.

    >>> forecast = sarcl.plan(sarcl.echo, scene, chirp, track, tolerance=1e-3)
    >>> forecast.n_rows, forecast.n_samples == raw.n_samples
    (64, True)
    """
    is_short = not args or isinstance(args[0], PhaseHistory)  # plan(raw, grid, ...)
    verb, subjects = (__getattr__("backproject"), args) if is_short else (args[0], args[1:])
    planned = getattr(verb, "planned", None)
    if planned is None:
        known = ", ".join((*HOMES, *NUMBERS))
        raise TypeError(f"plan was given {verb!r:.60}, which is no verb; give one of {known}, such as sarcl.echo")
    forecast: Forecast[Any] = planned(*subjects, **options).forecast()
    echoes = [value for value in (*subjects, *options.values()) if isinstance(value, PhaseHistory)]
    stamps = [file_stamps(raw.samples) for raw in echoes]

    def run() -> Any:
        """The verb's result, by this plan."""
        for raw, before in zip(echoes, stamps, strict=True):
            changed = [path for path, stamp in file_stamps(raw.samples).items() if stamp != before[path]]
            if changed:
                raise ValueError(f"{changed[0]!r} has changed since the plan was made from it; read it and plan again")
        return forecast.run()

    return replace(forecast, run=run)
