"""The channels of a CPHD file: names, sizes, polarisations, phase centres; those that are chosen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..sarkit_library import Element, Refused, text_of

# Letters of polarisations in a phase history by their names in CPHD
ENDS = ("tx_channel", "rx_channel")  # of added parameters "tx_channel of NAME", the numbers of a channel's antennas
LETTERS = {name: name for name in "HVXYSE"} | {"RHC": "R", "LHC": "L"}


@dataclass(frozen=True)
class Channel:
    """A channel: its Identifier, array sizes, polarisations by name, and numbers of its phase centres."""

    name: str
    n_vectors: int
    n_samples: int
    polarizations: tuple[str, str]
    tx_channel: int
    rx_channel: int

    @property
    def polarization(self) -> str | None:
        """Letters of the sender's and the receiver's, such as HV or RL; None where either has none."""
        sender, receiver = (LETTERS.get(name) for name in self.polarizations)
        return None if sender is None or receiver is None else sender + receiver

    def fields(self, n_rows: int) -> dict[str, Any]:
        """Fields of n_rows rows of a phase history that follow from the channel alone."""
        return {
            "tx_channel": np.full(n_rows, self.tx_channel),
            "rx_channel": np.full(n_rows, self.rx_channel),
            "polarization": None if self.polarization is None else np.full(n_rows, self.polarization),
            "compressed": True,
        }


def channels_of(root: Element) -> list[Channel]:
    """All channels, in the order of the file. KeyError, ValueError for elements that are missing or wrong."""
    centres: tuple[dict[str, int], dict[str, int]] = ({}, {})
    channels = []
    added = {p.get("name"): p.text or "" for p in root.findall("{*}Channel/{*}AddedParameters/{*}Parameter")}
    for size in root.findall("{*}Data/{*}Channel"):
        name = text_of(size, "Identifier")
        parameters = next(p for p in root.findall("{*}Channel/{*}Parameters") if text_of(p, "Identifier") == name)
        ends = [parameters.findtext(f"{{*}}Antenna/{{*}}{end}APCId") or "" for end in ("Tx", "Rcv")]
        numbers = [known.setdefault(end, len(known)) for known, end in zip(centres, ends, strict=True)]
        numbers = [int(added.get(f"{end} of {name}", n)) for end, n in zip(ENDS, numbers, strict=True)]
        channels.append(
            Channel(
                name,
                int(text_of(size, "NumVectors")),
                int(text_of(size, "NumSamples")),
                (text_of(parameters, "Polarization/TxPol"), text_of(parameters, "Polarization/RcvPol")),
                *numbers,
            )
        )
    return channels


def chosen(channels: Sequence[Channel], channel: str | int | None, polarization: str | None) -> list[Channel]:
    """Channels of an Identifier or a number of a receiver's phase centre, and of a polarisation, of equal samples.

    Refused lists the channels where none is so, where they differ in samples, or some alone have a polarisation.
    ValueError where a file has none, or one is empty.
    """
    if not channels or min(min(c.n_vectors, c.n_samples) for c in channels) < 1:
        raise ValueError("it has no channel with vectors and samples")
    for wanted, kind, name in ((channel, (str, int), "channel"), (polarization, str, "polarization")):
        if wanted is not None and (not isinstance(wanted, kind) or isinstance(wanted, bool)):
            raise Refused(f"has no {name} {wanted!r}: it has {_listed(channels)}")
    selection = [
        c
        for c in channels
        if (channel is None or channel == (c.name if isinstance(channel, str) else c.rx_channel))
        and (polarization is None or polarization in (c.polarization, ":".join(c.polarizations)))
    ]
    if not selection:
        parts = {"channel": channel, "polarization": polarization}
        wanted = ", ".join(f"{name} {value!r}" for name, value in parts.items() if value is not None)
        raise Refused(f"has no {wanted}: it has {_listed(channels)}")
    remedy = "give channel= or polarization="
    if len({c.n_samples for c in selection}) > 1:
        sizes = ", ".join(f"{c.name!r} ({c.n_samples})" for c in selection)
        raise Refused(f"has channels that differ in samples per vector: {sizes}; {remedy}")
    if len({c.polarization is None for c in selection}) > 1:
        nameless = ", ".join(repr(c.name) for c in selection if c.polarization is None)
        raise Refused(f"has no known polarisation of channel {nameless}, unlike others: {_listed(channels)}; {remedy}")
    return selection


def _listed(channels: Sequence[Channel]) -> str:
    return ", ".join(f"channel {c.name!r} ({':'.join(c.polarizations)})" for c in channels)
