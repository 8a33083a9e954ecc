"""Tables as other versions, exports and programs write them: read alike, or refused in words."""

# ruff: noqa: E501 - a case a line

from __future__ import annotations

import gzip
import re

import pytest

from app.formats import account as reasons

from . import samples
from .expectations import READ, SAME, cases, check

TABLES = ("tidy", "gnettrack", "opencellid", "network-survey", "romes")
DELIMITER = {"gnettrack": "\t", "romes": ";"}


def plain(name: str) -> str:
    """A sample with line feeds, without a scanner's preamble and its padding."""
    text = samples.ALL[name].replace("\r\n", "\n")
    text = text[text.index("Date;Time") :] if name == "romes" else text
    return "".join(line.rstrip(";") + "\n" for line in text.splitlines())


def cells_of(name: str, text: str) -> list[list[str]]:
    return [line.split(DELIMITER.get(name, ",")) for line in text.splitlines()]


def joined(rows: list[list[str]], delimiter: str, quote: str = "") -> str:
    return "".join(delimiter.join(quote + cell + quote for cell in row) + "\n" for row in rows)


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize(
    "change",
    ["none", "bom", "crlf", "no end", "blank lines", "blank first", "comment", "sep", "again",
     "semicolon", "tab", "pipe", "quoted", "quoted header", "spaces", "upper", "decimal comma",
     "two delimiters", "columns back to front", "column more", "latin-1"],
)  # fmt: skip
def test_a_table_is_read_however_it_is_written(name, change):
    """Delimiters, quotes, decimal commas, marks, comments and blanks say nothing."""
    text = plain(name)
    rows = cells_of(name, text)
    delimiter = DELIMITER.get(name, ",")
    written = {
        "none": text,
        "bom": "\ufeff" + text,
        "crlf": text.replace("\n", "\r\n"),
        "no end": text.rstrip("\n"),
        "blank lines": text.replace("\n", "\n\n") + "\n \n".replace(" ", ""),
        "blank first": "\n\n" + text,
        "comment": "# made by a tool\n" + text,
        "sep": f"sep={delimiter}\n" + text,
        "again": text + text.splitlines()[0] + "\n",
        "semicolon": joined(rows, ";"),
        "tab": joined(rows, "\t"),
        "pipe": joined(rows, "|"),
        "quoted": joined(rows, delimiter, '"'),
        "quoted header": joined(rows[:1], delimiter, '"') + joined(rows[1:], delimiter),
        "spaces": joined(rows[:1], delimiter).replace(delimiter, f" {delimiter} ") + joined(rows[1:], delimiter),
        "upper": joined([[each.upper() for each in rows[0]]], delimiter) + joined(rows[1:], delimiter),
        "decimal comma": joined([[re.sub(r"^(-?\d+)\.(\d+)$", r"\1,\2", each) for each in row] for row in rows], ";"),
        "two delimiters": joined(rows[:1], delimiter) + joined([[*row, "", ""] for row in rows[1:]], delimiter),
        "columns back to front": joined([row[: len(rows[0])][::-1] for row in rows], delimiter),
        "column more": joined([[*row[: len(rows[0])], "x"] for row in rows], delimiter),
        "latin-1": joined([[*row[: len(rows[0])], "Straße"] for row in rows], delimiter).encode("latin-1"),
    }[change]  # fmt: skip
    if name == "romes" and change == "columns back to front":
        return  # a scanner's table begins with its date
    check(written, SAME)


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda t: t.encode("utf-16"), "UTF-16.*UTF-8"),
        (lambda t: t.encode("utf-16-le"), "UTF-16.*UTF-8"),
        (lambda t: t.replace("\n", "\r"), "carriage return"),
        (lambda t: t[:150] + "\0" * 9 + t[150:], "byte 150 is NUL"),
        (lambda t: gzip.compress(t.encode()), "gzipped"),
        (lambda t: t.splitlines()[0], "no rows"),
        (lambda t: "".join(t.splitlines(keepends=True)[:2]), "too few samples.*line 2"),
        (lambda t: t + "x\n", "wrong number of columns"),
        (lambda t: t[:-12], "wrong number of columns|no drive|not a"),
    ],
)
def test_what_is_no_whole_table_is_refused_in_words(name, change, complaint):
    """The reason, and where."""
    if name == "opencellid" and change("abc") == "":
        return  # its last values are optional: nobody sees that they are gone
    check(change(plain(name)), f"refused: {complaint}")


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("<!DOCTYPE html><html><body>404</body></html>", "web page"),
        ("\n <html lang=en>\n<body>Forbidden", "web page"),
        (b"PK\x03\x04" + bytes(40), "zip"),
        (b"%PDF-1.7\n1 0 obj", "PDF"),
        (b"SQLite format 3\0" + bytes(40), "SQLite"),
        (b"\x89PNG\r\n\x1a\n", "picture"),
        (bytes(range(1, 256)) * 9, "header of no known table|carriage return"),
        (" \n \n", "empty"),
        ("Not found", "header of no known table"),
        ('{"error": "forbidden"}', "JSON without"),
        (
            "LTE,262,1,7000,5387,325,11.5,48.1,1000,5,1,1400000000,1400000000,-90\n",
            "no known table",
        ),
    ],
)
def test_what_is_no_measurements_at_all_is_called_by_its_name(text, complaint):
    """An error page saved as CSV, an archive, junk."""
    check(text, f"refused: {complaint}")


def tidy(**changed: object) -> str:
    told = {"time_s": samples.START_S + 9, "lon": samples.LON, "lat": samples.LAT,
            "cell_id": "850:293", "rsrp_dbm": -90, "serving": 1, **changed}  # fmt: skip
    return samples.TIDY + ",".join(f'"{value}"' for value in told.values()) + "\n"


def gnet(**changed: object) -> str:
    return samples.GNETTRACK + samples.gnettrack_row(9, **changed)


def ocid(**changed: object) -> str:
    return samples.OPENCELLID + samples.opencellid_row(9, **changed)


def romes(**changed: object) -> str:
    names = samples.ROMES_NAMES.split(";")
    told = dict(zip(names, samples.romes_row(9).split(";"), strict=True)) | changed
    return plain("romes") + ";".join(map(str, told.values())) + "\n"


def survey(**changed: object) -> str:
    lon, lat = samples.place(9)
    names = samples.NETWORK_SURVEY.splitlines()[0].split(",")
    told = dict.fromkeys(names, "") | {
        "deviceTime": "2025-05-08T10:00:09Z", "latitude": lat, "longitude": lon, "accuracy": 5.0,
        "missionId": "m1", "groupNumber": 9, "mcc": 262, "mnc": "01", "tac": 7000, "eci": 5387,
        "earfcn": 2850, "pci": 325, "rsrp": -90.0, "servingCell": "true", **changed,
    }  # fmt: skip
    return samples.NETWORK_SURVEY + ",".join(f'"{value}"' for value in told.values()) + "\n"


LEVELS = (
    ("-90,5", READ), ("-9e1", READ), ("-90 dBm", READ), ("-90dBm", READ), (" -90 ", READ),
    ("", reasons.NO_LEVEL), ("NaN", reasons.NO_LEVEL), ("null", reasons.NO_LEVEL),
    ("N/A", reasons.NO_LEVEL), ("-", reasons.NO_LEVEL), ("2147483647", reasons.FILLER),
    ("-1", reasons.OUT_OF_RANGE), ("0", reasons.OUT_OF_RANGE), ("-32768", reasons.OUT_OF_RANGE),
    ("-90 mW", "refused: not a number"), ("inf", "refused: not a number"),
    ("0x10", "refused: not a number"), ("-90.0.0", "refused: not a number"),
)  # fmt: skip
PLACES = (
    ("11,575", READ), ("NaN", reasons.NO_POSITION), ("", reasons.NO_POSITION),
    ("2147483647", reasons.NO_POSITION), ("999", "refused: position out of range"),
    ("11.575E", "refused: not a number"),
)  # fmt: skip
TIMES = (
    (1746698409, READ), (1746698409000, READ), (1746698409000000, READ),
    (1746698409000000000, READ), ("2025-05-08T10:00:09Z", READ), ("2025-05-08 12:00:09+02:00", READ),
    ("2025-05-08 12:00:09.000+0200", READ), ("2025-05-08 10:00:09 UTC", READ),
    ("2025-05-08 10:00:09,25", READ), ("08.05.2025 10:00:09", READ), ("2025/05/08 10:00:09", READ),
    ("", reasons.NO_TIME), ("null", reasons.NO_TIME), ("05/08/2025 10:00:09", "refused: not a time"),
    ("10:00:09", "refused: not a time"), ("1e300", "refused: not a time"),
    ("2025-13-45 10:00:09", "refused: not a time"), (-5e18, "refused: not a time"),
)  # fmt: skip
OF = {tidy: ("rsrp_dbm", "lon", "time_s"), gnet: ("Level", "Longitude", "Timestamp"),
      survey: ("rsrp", "longitude", "deviceTime"), romes: ("RSRP", "Longitude", None),
      ocid: ("signal", "lon", "measured_at")}  # fmt: skip


@pytest.mark.parametrize("of", OF, ids=lambda of: of.__name__)
@pytest.mark.parametrize(("kind", "value", "expected"), [
    *((0, *each) for each in LEVELS), *((1, *each) for each in PLACES), *((2, *each) for each in TIMES),
])  # fmt: skip
def test_values_are_read_left_out_or_named_alike_in_every_table(of, kind, value, expected):
    """Units, decimal commas, fillers, times in every unit and with every zone."""
    name = OF[of][kind]
    if name is None or (of is ocid and "," in str(value)):  # romes has two columns; ocid no quotes
        return
    check(of(**{name: value}), expected)


@pytest.mark.parametrize(("text", "expected"), [
    *cases(tidy, ({"cell_id": ""}, reasons.NO_CELL), ({"cell_id": "nan"}, reasons.NO_CELL),
           ({"cell_id": "-"}, reasons.NO_CELL), ({"cell_id": "x" * 200}, reasons.NO_CELL),
           ({"cell_id": " 850:293 "}, READ), ({"serving": "TRUE"}, READ), ({"serving": "?"}, READ)),
    *cases(gnet, ({"PSC": -1, "Operator": ""}, reasons.NO_CELL), ({"PSC": 2147483647}, READ), ({"ARFCN": "-"}, READ),
           ({"ARFCN": 2147483647, "Node": 2147483647}, reasons.NO_CELL), ({"NetworkTech": "5G", "Level": -150}, READ),
           ({"NetworkTech": "LTE_CA"}, READ), ({"NetworkTech": "4G/5G"}, READ), ({"NetworkTech": ""}, reasons.NOT_LTE_OR_NR),
           ({"Timestamp": "2025.05.08_10.00.09.250"}, READ), ({"Operator": "26201,26202"}, READ)),
    *cases(ocid, ({"cellid": 2147483647}, reasons.NO_CELL), ({"cellid": 268435455}, reasons.NO_CELL), ({"cellid": -1}, reasons.NO_CELL),
           ({"mcc": "262.0", "mnc": "01.0"}, READ), ({"cellid": "5387.0"}, READ), ({"mcc": 0}, reasons.NO_CELL), ({"act": "NR"}, READ),
           ({"act": "NRNSA", "signal": -150}, READ), ({"act": ""}, READ), ({"act": "", "pci": ""}, reasons.NOT_LTE_OR_NR),
           ({"act": "IWLAN"}, reasons.NOT_LTE_OR_NR), ({"rating": -1}, READ), ({"rating": 5000}, reasons.INACCURATE), ({"speed": "abc"}, READ)),
    *cases(survey, ({"eci": 2147483647}, READ), ({"mcc": 2147483647, "mnc": 2147483647}, READ), ({"pci": -1, "eci": ""}, reasons.NO_CELL),
           ({"earfcn": "", "eci": ""}, reasons.NO_CELL), ({"earfcn": 2147483647, "mcc": ""}, reasons.NO_CELL), ({"servingCell": "1"}, READ),
           ({"accuracy": "x"}, READ), ({"accuracy": 500}, reasons.INACCURATE), ({"groupNumber": ""}, READ)),
    *cases(romes, ({"PCI": "---", "CI": "---"}, reasons.NO_CELL), ({"PCI": -1}, READ), ({"EARFCN": "---"}, READ), ({"MNC": "---"}, READ),
           ({"CI": 2147483647}, READ), ({"Date": "08.05.2025"}, READ), ({"Date": "2025-05-08"}, READ), ({"Date": "08/05/2025"}, "refused: not a time"),
           ({"Date": ""}, "refused: not a time"), ({"Time": "10:00:09,5"}, READ), ({"Time": "25:00:00"}, "refused: not a time"),
           ({"Speed": "36 km/h"}, READ), ({"Speed": "---"}, READ)),
])  # fmt: skip
def test_the_quirks_of_each_tool_are_known(text, expected):
    """Fillers in names of cells, radios by other words, codes as a data frame writes them."""
    check(text, expected)


def test_a_table_of_lte_and_nr_is_read_row_by_row():
    """Where a table has the columns of both, each row has one of them."""
    text = samples.NETWORK_SURVEY.replace("pci,", "pci,narfcn,ssRsrp,", 1)
    text = text.replace(",325,", ",325,,,").replace(",2850,326,", ",,326,640000,-90,")
    found = check(text, SAME)
    assert found.drives[0].trace.cells == ("2850:325", "640000:326")
