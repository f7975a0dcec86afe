"""What the XML of a CPHD file says of its collection, by CPHD's own names."""

from __future__ import annotations

NAMES = {name: f"CollectionID/{name}" for name in ("CollectorName", "IlluminatorName", "CoreName", "Classification")}
NAMES |= {name: f"CollectionID/RadarMode/{name}" for name in ("ModeType", "ModeID")}
NAMES |= {"CountryCode": "CollectionID/CountryCode", "CollectionStart": "Global/Timeline/CollectionStart"}


def names_of(xml: str | None) -> dict[str, str]:
    """Texts by name, of those that the XML has; none where there is no XML of CPHD."""
    if xml is None or "/cphd/" not in xml[:1000]:
        return {}
    from xml.etree import ElementTree

    try:
        root = ElementTree.fromstring(xml)
    except ElementTree.ParseError:  # text that a user gave
        return {}
    texts = {name: root.findtext("/".join(f"{{*}}{part}" for part in path.split("/"))) for name, path in NAMES.items()}
    return {name: text.strip() for name, text in texts.items() if text and text.strip()}
