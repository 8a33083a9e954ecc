"""G-NetTrack Pro's KML: a placemark a row, each value a text with its unit."""

from __future__ import annotations

import math
from collections.abc import Iterator
from datetime import UTC
from typing import BinaryIO
from xml.etree import ElementTree as ET

from app.formats.account import NOT_A_RECORD, NOT_LTE_OR_NR, UNKNOWN_UNIT, Account, BrokenFile
from app.formats.cells import global_id, short_key, technology, whole
from app.formats.gnettrack import ECI_PER_ENB, digest_of
from app.formats.options import Options
from app.formats.rows import DriveLabel, Fix, Labels, RowList, Rows
from app.formats.values import DBM, MPS_PER_KMH, UNREADABLE, measure, moment_s

SPEEDS = {"km/h": MPS_PER_KMH, "kmh": MPS_PER_KMH, "m/s": 1.0, "": MPS_PER_KMH}
METRES = {"m": 1.0, "": 1.0}
PCI_NAMES = ("pc", "pci", "psc")  # physical cell; older versions use 3G's word
BLOCK_ROWS = 5_000


def read(source: BinaryIO, options: Options, account: Account, labels: Labels) -> Iterator[Rows]:
    """
    Blocks of placemarks, numbered from 1 in place of lines.

    Raises:
        BrokenFile: It is no XML, or ends early.
    """
    if options.zone is UTC:
        account.note("times without a zone are taken as UTC")
    else:
        account.note(f"times without a zone are taken as {options.zone}")
    found = RowList()
    number_of = 0
    try:
        for _, element in ET.iterparse(source):  # noqa: S314 - sniff refuses files with a DTD
            if not element.tag.endswith("Placemark"):
                continue
            number_of += 1
            account.rows += 1
            _add(found, number_of, element, options, account, labels)
            element.clear()
            if len(found) >= BLOCK_ROWS:
                yield found.rows()
                found = RowList()
    except ET.ParseError as error:
        yield found.rows()
        raise BrokenFile(f"placemark {number_of + 1}: no XML: {error}") from error
    yield found.rows()


def _add(
    found: RowList, line: int, placemark: ET.Element, options: Options, account: Account,
    labels: Labels,
) -> None:  # fmt: skip
    told = _values(placemark)
    if "rsrp" not in told and "technology" not in told:
        account.note("placemarks without a measurement (tracks, marks) left out")
        return
    nr = technology(told.get("technology"))
    if nr is None:
        account.drop(NOT_LTE_OR_NR, [line])
        return
    level_dbm = measure(told.get("rsrp") or told.get("level") or "", DBM)
    if level_dbm is None:
        account.drop(UNKNOWN_UNIT, [line])
        return
    lon, lat = _place(placemark)
    if math.isinf(lon):
        account.drop(NOT_A_RECORD, [line])
        return
    fix = Fix(
        line=line,
        drive=labels.drive(DriveLabel(options.device or digest_of(told.get("imei")))),
        time_s=moment_s(told.get("time") or told.get("when") or "", options.zone),
        lon=lon,
        lat=lat,
        speed_mps=_told(told.get("speed"), SPEEDS),
        accuracy_m=_told(told.get("accuracy"), METRES),
    )
    key, gid = _cell(told, nr=nr)
    found.add(fix, labels.cell(key, gid), level_dbm, serving=1, nr=nr)


def _cell(told: dict[str, str], *, nr: bool) -> tuple[str | None, str | None]:
    """Key and global id; the CGI says ``mcc-mnc-...`` where the version writes one."""
    pci = next((value for name in PCI_NAMES if (value := whole(told.get(name))) is not None), None)
    raw, node, cell = (whole(told.get(name)) for name in ("rawcellid", "rnc", "cellid"))
    identity = raw
    if identity is None and not nr and node is not None and cell is not None:
        identity = node * ECI_PER_ENB + cell if cell < ECI_PER_ENB else None
    parts = (told.get("cgi") or "").replace("/", "-").replace(" ", "").split("-")
    mcc, mnc = (parts[0], parts[1]) if len(parts) > 2 else (None, None)
    gid = global_id(mcc, mnc, identity)
    return short_key(whole(told.get("arfcn")), pci) or gid, gid


def _values(placemark: ET.Element) -> dict[str, str]:
    """ExtendedData by lower-case name."""
    told = {}
    for element in placemark.iter():
        if element.tag.endswith("Data") and "name" in element.attrib:
            texts = [child.text or "" for child in element if child.tag.endswith("value")]
            told[element.attrib["name"].strip().lower()] = (texts or [""])[0].strip()
        elif element.tag.endswith("}when"):
            told["when"] = (element.text or "").strip()
    return told


def _place(placemark: ET.Element) -> tuple[float, float]:
    """Longitude and latitude of the point; NaN without one, infinity when they are no numbers."""
    for element in placemark.iter():
        if element.tag.endswith("coordinates"):
            parts = (element.text or "").strip().split(",")
            try:
                return float(parts[0]), float(parts[1])
            except (ValueError, IndexError):
                return UNREADABLE, UNREADABLE
    return math.nan, math.nan


def _told(text: str | None, units: dict[str, float]) -> float:
    """A speed or an accuracy; NaN when it is not told in a unit that is known."""
    value = measure(text or "", units)
    return value if value is not None and math.isfinite(value) and value >= 0.0 else math.nan
