"""KML and JSON as other versions and programs write them: read alike, or refused in words."""

# ruff: noqa: E501 - a case a line

from __future__ import annotations

import gzip
import json
import math

import pytest

from app.formats import account as reasons

from . import samples
from .expectations import READ, SAME, cases, check

OLD = "cell heard too long before or after"
FOUR = [samples.report(i) for i in range(4)]
MESSAGES = [samples.message(i) for i in range(4)]


def kml(**changed: str) -> str:
    return samples.kml(*(samples.placemark(i) for i in range(4)), samples.placemark(9, **changed))


def tower(**changed: object) -> str:
    return json.dumps({"items": [*FOUR, samples.report(9, samples.tower(**changed))]})


def report(**changed: object) -> str:
    return json.dumps({"items": [*FOUR, samples.report(9, **changed)]})


def message(**changed: object) -> str:
    return "\n".join(json.dumps(each) for each in [*MESSAGES, samples.message(9, **changed)])


def lines(*documents: object, end: str = "\n") -> str:
    return "".join(json.dumps(each) + end for each in documents)


def at(**changed: object) -> dict[str, object]:
    lon, lat = samples.place(9)
    return {"longitude": lon, "latitude": lat, **changed}


@pytest.mark.parametrize(("text", "expected"), [
    *cases(kml, ({"RSRP": "-81dBm"}, READ), ({"RSRP": "-81"}, READ), ({"RSRP": "-81.5 DBM"}, READ), ({"RSRP": "-81,5 dBm"}, READ),
           ({"RSRP": "--"}, reasons.NO_LEVEL), ({"RSRP": ""}, reasons.NO_LEVEL), ({"RSRP": "2147483647 dBm"}, reasons.FILLER),
           ({"RSRP": "-81 W"}, "refused: unknown unit"), ({"RSRP": "x"}, "refused: not a number"), ({"PC": "-1"}, READ),
           ({"PC": "", "CGI": ""}, reasons.NO_CELL), ({"ARFCN": "0", "CGI": ""}, reasons.NO_CELL), ({"TECHNOLOGY": "--"}, reasons.NOT_LTE_OR_NR),
           ({"TECHNOLOGY": "5G", "RSRP": "-150 dBm"}, READ), ({"SPEED": "36 mph"}, READ), ({"SPEED": "-"}, READ), ({"ACCURACY": "200m"}, reasons.INACCURATE),
           ({"TIME": "08.05.2025 10:00:09"}, READ), ({"TIME": "2025-05-08T10:00:09Z"}, READ), ({"TIME": ""}, reasons.NO_TIME),
           ({"TIME": "05/08/2025 10:00:09"}, "refused: not a time"), ({"CGI": "26201-7000"}, READ), ({"RNC": "2147483647"}, READ)),
    *cases(tower, ({"signalStrength": 2147483647}, reasons.FILLER), ({"signalStrength": None}, reasons.NO_LEVEL), ({"signalStrength": math.nan}, reasons.NO_LEVEL),
           ({"signalStrength": -1}, reasons.OUT_OF_RANGE), ({"signalStrength": "-81"}, "refused: not a number"), ({"signalStrength": True}, "refused: not a number"),
           ({"signalStrength": 10**400}, "refused: not a number"), ({"radioType": "LTE"}, READ), ({"radioType": "nr", "signalStrength": -150}, READ),
           ({"radioType": "wcdma"}, reasons.NOT_LTE_OR_NR), ({"radioType": None}, reasons.NOT_LTE_OR_NR), ({"radioType": [1]}, reasons.NOT_LTE_OR_NR),
           ({"serving": True}, READ), ({"serving": 2}, READ), ({"serving": "1"}, READ), ({"serving": [1]}, READ), ({"serving": {}}, READ),
           ({"primaryScramblingCode": -1}, READ), ({"primaryScramblingCode": 2147483647, "cellId": None}, reasons.NO_CELL), ({"arfcn": 0, "cellId": 0}, reasons.NO_CELL),
           ({"cellId": 2147483647, "arfcn": None}, reasons.NO_CELL), ({"cellId": 9223372036854775807, "arfcn": None}, reasons.NO_CELL), ({"cellId": 2147483647}, READ),
           ({"age": 99_999}, OLD), ({"age": -5}, READ), ({"mobileCountryCode": "262"}, READ), ({"mobileNetworkCodeStr": 5}, READ)),
    *cases(report, ({"timestamp": 1746698409}, READ), ({"timestamp": 1746698409000.0}, READ), ({"timestamp": None}, reasons.NO_TIME), ({"timestamp": "x"}, "refused: not a time"),
           ({"timestamp": 1e300}, "refused: not a time"), ({"timestamp": 10**400}, "refused: not a time"), ({"position": None}, reasons.NO_POSITION), ({"position": {}}, reasons.NO_POSITION),
           ({"position": {"latitude": 48.1}}, reasons.NO_POSITION), ({"position": at(accuracy=5000)}, reasons.INACCURATE), ({"position": at(accuracy=-1)}, READ),
           ({"position": at(age=1e20)}, READ), ({"position": at(longitude="11.5")}, "refused: not a number"), ({"position": at(longitude=[])}, "refused: not a number"),
           ({"position": at(longitude=999)}, "refused: position out of range"), ({"cellTowers": []}, SAME), ({"cellTowers": None}, SAME), ({"cellTowers": {}}, "refused: malformed"),
           ({"cellTowers": ["x"]}, "refused: malformed"), ({"position": [1, 2]}, "refused: malformed"), ({"cellTowers": None, "wifiAccessPoints": [{}]}, SAME)),
    *cases(message, ({"rsrp": None}, reasons.NO_LEVEL), ({"rsrp": "-81"}, READ), ({"rsrp": 2147483647}, reasons.FILLER), ({"rsrp": True}, "refused: not a number"),
           ({"rsrp": [1]}, "refused: not a number"), ({"rsrp": math.nan}, reasons.NO_LEVEL), ({"pci": -1}, READ), ({"pci": None, "eci": None}, reasons.NO_CELL),
           ({"earfcn": None, "mcc": None}, reasons.NO_CELL), ({"eci": 2147483647}, READ), ({"eci": 2147483647, "pci": None}, reasons.NO_CELL), ({"deviceTime": None}, reasons.NO_TIME),
           ({"deviceTime": 1746698409000}, READ), ({"deviceTime": "x"}, "refused: not a time"), ({"latitude": None}, reasons.NO_POSITION), ({"latitude": "48.1378"}, READ),
           ({"mcc": "262", "mnc": "01"}, READ), ({"servingCell": "true"}, READ), ({"servingCell": None}, READ), ({"accuracy": "x"}, READ), ({"groupNumber": None}, READ),
           ({"missionId": 5}, READ), ({"deviceSerialNumber": "pixel", "extra": {"a": [1]}}, READ)),
])  # fmt: skip
def test_the_quirks_of_each_tool_are_known(text, expected):
    """Units, fillers, missing members, values of another type, times in every unit."""
    check(text, expected)


@pytest.mark.parametrize(("text", "expected"), [
    ("\ufeff" + samples.KML, SAME), (samples.KML.replace("><", ">\r\n<"), SAME), (samples.KML.replace('"RSRP"', '"rsrp"').replace('"PC"', '" Pc "'), SAME),
    (samples.KML.replace("<kml xmlns=", "<k:kml xmlns:k=").replace("</kml>", "</k:kml>"), SAME), (samples.KML.replace("<coordinates>", "<coordinates>\n  "), SAME),
    (samples.KML.replace("UTF-8", "ISO-8859-1").encode("latin-1"), SAME), (samples.KML.replace("UTF-8", "UTF-16").encode("utf-16"), "refused: UTF-16"),
    (samples.KML[:400], "refused: no XML"), (samples.kml(), "refused: no rows"), (samples.kml(samples.placemark(0)), "refused: too few samples"),
    (samples.KML.replace("<coordinates>", "<coordinates>x"), "refused: not a record"), (samples.KML.replace("4G", "4G &nbsp;"), "refused: no XML"),
    (samples.KML.replace("<coordinates>11.575", "<coordinates>NaN"), "refused: no position"),
    (samples.kml("<Placemark><LineString><coordinates>11,48 11,49</coordinates></LineString></Placemark>"), "refused: no rows"),
    ("\ufeff" + samples.GEOSUBMIT, SAME), (json.dumps(json.loads(samples.GEOSUBMIT), indent=2).replace("\n", "\r\n"), SAME), (samples.GEOSUBMIT.encode("utf-16"), "refused: UTF-16"),
    (samples.GEOSUBMIT[:-3], "refused: no JSON"), (samples.GEOSUBMIT[:300], "refused: no JSON"), ('{"items": []}', "refused: no rows"), ('{"items": null}', "refused: list of reports"),
    ("{}", "refused: JSON without"), (json.dumps(FOUR), "refused: JSON without"), ('{"items":' + "[" * 99_999, "refused: no JSON"), (gzip.compress(samples.GEOSUBMIT.encode()), "refused: gzipped"),
    (samples.GEOSUBMIT.replace("1746698400000", "1" + "0" * 5000), "refused: no JSON"),
    ("\ufeff" + lines(*MESSAGES), SAME), (lines(*MESSAGES, end="\r\n"), SAME), (lines(*MESSAGES, end=""), SAME), (json.dumps(MESSAGES), SAME), (json.dumps(MESSAGES, indent=1), SAME),
    (lines(*MESSAGES, samples.message(5, "GsmRecord")), reasons.NOT_LTE_OR_NR), (lines(*MESSAGES, {"messageType": "DeviceStatus", "data": {}}), reasons.NOT_LTE_OR_NR),
    (lines(*MESSAGES, {"messageType": "LteRecord", "data": None}), "refused: not a record"), (lines(*MESSAGES, {"messageType": 5, "data": {}}), "refused: not a record"),
    (json.dumps([MESSAGES]), "refused: not a record"), (lines(*MESSAGES)[:-9], "refused: record 4: no JSON"), (json.dumps(MESSAGES)[:-1], "refused: no JSON"),
    (lines(*(samples.message(i, "NrRecord", narfcn=640000, ssRsrp=-150.0) for i in range(4))), SAME), (lines(*MESSAGES) + "\0", "refused: NUL"),
])  # fmt: skip
def test_documents_are_read_whole_or_refused_in_words(text, expected):
    """Marks, line ends, layout and other records say nothing; what is cut short is said to be."""
    check(text, expected)
