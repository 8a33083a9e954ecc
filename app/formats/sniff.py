"""Which format a file has, by its content; and the reason when it has none that is known."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import BinaryIO

from app.formats import gnettrack, network_survey, opencellid, romes, tidy
from app.formats.account import WrongFile
from app.formats.table import MOST_HEADER_BYTES, Layout, names_of

HEAD_BYTES = 1 << 16  # of JSON and KML: enough to meet a name that only one format has

TIDY, GNETTRACK, GNETTRACK_KML = "tidy", "gnettrack", "gnettrack-kml"
OPENCELLID, GEOSUBMIT, ROMES = "opencellid", "geosubmit", "romes"
NETWORK_SURVEY, NETWORK_SURVEY_JSON, SURVEY_JSON = (
    "network-survey", "network-survey-json", "survey-json",
)  # fmt: skip

TABLES: dict[str, Callable[[tuple[str, ...]], bool]] = {
    TIDY: tidy.is_tidy,
    GNETTRACK: gnettrack.is_log,
    NETWORK_SURVEY: network_survey.is_table,
    ROMES: romes.is_log,
    OPENCELLID: opencellid.is_measurements,
}
NEEDED = {
    TIDY: (*tidy.NEEDED, "time_s"),
    GNETTRACK: ("timestamp", "longitude", "latitude", "networktech", "level"),
    NETWORK_SURVEY: (*network_survey.NEEDED, *network_survey.LTE),
    ROMES: romes.NEEDED,
    OPENCELLID: (*opencellid.NEEDED, "cellid"),
}
FORMATS = (*TABLES, GNETTRACK_KML, GEOSUBMIT, NETWORK_SURVEY_JSON, SURVEY_JSON)
DELIMITERS = ("\t", ";", ",", "|")
MOST_LINES_BEFORE = 50  # blank lines and comments above a header
KINDS = {  # how files begin that are often taken for text
    b"PK\x03\x04": "a zip archive (XLSX and KMZ are, too); unpack it or save it as CSV or KML",
    b"%PDF": "a PDF",
    b"SQLite format 3": "a SQLite database; export its table as CSV",
    b"\x89PNG": "a picture",
}


@dataclass(frozen=True, slots=True)
class Sniffed:
    """A format's name, with the layout when it is a table."""

    name: str
    layout: Layout | None = None


def sniff(source: BinaryIO, wanted: str | None = None) -> Sniffed:
    """
    The format of a file that can seek; it is left at its beginning.

    Args:
        source: Unpacked bytes.
        wanted: A format that somebody asked for: then only its own needs are checked.

    Raises:
        WrongFile: It has none of the formats, or not the one that is wanted.
    """
    if wanted is not None and wanted not in FORMATS:
        raise WrongFile(f"there is no format {wanted!r}; there are {', '.join(FORMATS)}")
    head = source.read(HEAD_BYTES)
    source.seek(0)
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    if not text:
        raise WrongFile("the file is empty")
    _refuse_no_text(head)
    if text.startswith(b"<"):
        return _one_of(wanted, (GNETTRACK_KML,), _xml(text))
    if text.startswith((b"{", b"[")):
        return _json(wanted, text)
    found = _table(source, wanted)
    source.seek(0)
    return found


def _refuse_no_text(head: bytes) -> None:
    """
    Refuse what is no UTF-8 text.

    Raises:
        WrongFile: So it is; with what it is instead, and what to do.
    """
    if head.startswith(b"\x1f\x8b"):
        raise WrongFile(
            "gzipped where text belongs: a body needs Content-Encoding: gzip, a file packed twice "
            "has to be unpacked once"
        )
    for begins, kind in KINDS.items():
        if head.startswith(begins):
            raise WrongFile(f"the file is {kind}")
    if head.startswith((b"\xff\xfe", b"\xfe\xff")) or head[1:2] == b"\0" != head[:1]:
        raise WrongFile("the file is UTF-16 text; save it as UTF-8")
    at = head.find(b"\0")
    if at >= 0:
        raise WrongFile(
            f"byte {at} is NUL: no text, or a log that was cut off while it was written; "
            "remove the NUL bytes"
        )


def _xml(text: bytes) -> str:
    """
    KML's name when it is KML.

    A document type declaration is refused: no tool writes one, and entities can blow up a parser.
    """
    if re.match(rb"<(!doctype\s+)?html\b", text, re.IGNORECASE):
        raise WrongFile("the file is a web page, perhaps that of an error, and no measurements")
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise WrongFile("XML with a document type declaration is not read")
    if not re.search(rb"<(\w+:)?kml\b", text):
        raise WrongFile("the file is XML and no KML")
    return GNETTRACK_KML


def _json(wanted: str | None, text: bytes) -> Sniffed:
    names = (GEOSUBMIT, NETWORK_SURVEY_JSON, SURVEY_JSON)
    if wanted in names:
        return Sniffed(str(wanted))
    if b'"messageType"' in text:
        name = NETWORK_SURVEY_JSON
    elif b'"cells"' in text or b'"rsrp_dbm"' in text:
        name = SURVEY_JSON
    elif b'"items"' in text:
        name = GEOSUBMIT
    else:
        raise WrongFile(
            "JSON without messageType (Network Survey), items (geosubmit) or cells and rsrp_dbm "
            f"(a survey) in its first {HEAD_BYTES} bytes"
        )
    return _one_of(wanted, names, name)


def _one_of(wanted: str | None, names: tuple[str, ...], found: str) -> Sniffed:
    if wanted is not None and wanted not in names:
        raise WrongFile(f"the content is that of {found}, not of {wanted}")
    return Sniffed(found)


def _table(source: BinaryIO, wanted: str | None) -> Sniffed:
    """
    The first line is the header, after blank lines, comments and Excel's ``sep=``; or, in a
    scanner's export, the line that begins as its does.
    """
    line, header_line = _first_line(source)
    source.seek(0)
    preamble = _after_preamble(source)
    if preamble is not None:
        line, header_line = preamble
    if b"\r" in line.rstrip(b"\r\n"):
        raise WrongFile("lines end with a carriage return alone; save the file with line feeds")
    text = line.decode("utf-8", "replace")
    delimiter = max(DELIMITERS, key=text.count)
    names = names_of(text, delimiter)
    fits = [name for name, is_it in TABLES.items() if is_it(names)]
    if wanted is not None:
        fits = [name for name in fits if name == wanted]
    if fits:
        return Sniffed(fits[0], Layout(names, delimiter, header_line))
    raise WrongFile(_why_not(text, names, wanted), f"/lines/{header_line}")


def _first_line(source: BinaryIO) -> tuple[bytes, int]:
    """The first line that says something, and its number from 1."""
    line, number = b"", 0
    while number < MOST_LINES_BEFORE:
        line, number = source.readline(MOST_HEADER_BYTES), number + 1
        text = line.removeprefix(b"\xef\xbb\xbf").strip().lower()
        if not line or (text and not text.startswith((b"#", b"sep=", b"//"))):
            break
    return line, number


def _after_preamble(source: BinaryIO) -> tuple[bytes, int] | None:
    """A scanner's header and its line; looked for in the first megabyte."""
    read_bytes, number = 0, 0
    while read_bytes < MOST_HEADER_BYTES:
        line = source.readline(MOST_HEADER_BYTES)
        if not line:
            return None
        read_bytes, number = read_bytes + len(line), number + 1
        plain = line.removeprefix(b"\xef\xbb\xbf").translate(None, b'" ').lower()
        if plain.startswith(romes.HEADER_BEGINS):
            return line, number
    return None


def _why_not(text: str, names: tuple[str, ...], wanted: str | None) -> str:
    """The format that comes nearest and what it lacks, or that the first line is no header."""
    if wanted in {OPENCELLID, None} and set(names) >= opencellid.AGGREGATE:
        return (
            "a list of cells with their mean positions (OpenCelliD's or MLS's aggregate), "
            "not measurements"
        )
    candidates = [wanted] if wanted in NEEDED else list(NEEDED)
    lacks = {
        name: [column for column in NEEDED[name] if column not in names]
        for name in candidates
        if name is not None
    }
    nearest = min(lacks, key=lambda name: len(lacks[name]) / len(NEEDED[name]))
    if len(lacks[nearest]) == len(NEEDED[nearest]):
        shown = "".join(filter(str.isprintable, text.strip("\ufeff")))[:120]
        return f"the first line ({shown}) is the header of no known table"
    return f"nearest is {nearest}, but the column {', '.join(lacks[nearest])} is missing"
