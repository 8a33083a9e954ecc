"""Small files of every format, written for these tests."""

# ruff: noqa: E501, SIM905 - rows and headers read best as the tools write them

from __future__ import annotations

import json
from datetime import UTC, datetime

START_S = 1_746_698_400.0  # 2025-05-08T10:00:00Z
LAT, LON = 48.137, 11.575  # Munich, whose country code is 262


def place(i: int) -> tuple[float, float]:
    """Longitude and latitude of sample ``i``: 10 m further north each second."""
    return LON, round(LAT + 9e-5 * i, 7)


TIDY = "time_s,lon,lat,cell_id,rsrp_dbm,serving\n" + "".join(
    f"{START_S + i},{place(i)[0]},{place(i)[1]},{cell},{level - i},{serving}\n"
    for i in range(4)
    for cell, level, serving in (("850:293", -90, 1), ("850:60", -101.5, 0))
)

GNETTRACK_NAMES = (
    "Timestamp Longitude Latitude Operatorname Operator Cellname Node CellID LAC NetworkTech Level "
    "Qual SNR CQI LTERSSI ARFCN PSC Altitude Distance TA BAND"
).split()


def gnettrack_row(i: int, **changed: object) -> str:
    lon, lat = place(i)
    told = {
        "Timestamp": f"2025.05.08_10.00.{i:02d}", "Longitude": lon, "Latitude": lat,
        "Operatorname": "Orange", "Operator": "26201", "Cellname": "", "Node": 21, "CellID": 11,
        "LAC": 7000, "NetworkTech": "4G", "Level": -81 - i, "Qual": -8, "SNR": "0.0", "CQI": "-",
        "LTERSSI": -73, "ARFCN": 2850, "PSC": 325, "Altitude": 74, "Distance": -1, "TA": 0,
        "BAND": "L7", **changed,
    }  # fmt: skip
    return "\t".join(str(value) for value in told.values()) + "\t\r\n"  # one tab too many: as seen


def gnettrack(*rows: str, names: list[str] = GNETTRACK_NAMES) -> str:
    return "\t".join(names) + "\r\n" + "".join(rows)


GNETTRACK = gnettrack(*(gnettrack_row(i) for i in range(4)))


def kml(*marks: str) -> str:
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2">'
        f"<Document>{''.join(marks)}</Document></kml>"
    )


def placemark(i: int, **changed: str) -> str:
    lon, lat = place(i)
    told = {
        "CGI": "262-01-21-11", "CELLID": "11", "RNC": "21", "TAC": "7000", "TECHNOLOGY": "4G",
        "ARFCN": "2850", "RSRP": f"{-81 - i} dBm", "PC": "325", "SPEED": "36 km/h",
        "ACCURACY": "7m", "BEARING": "1000deg", "TIME": f"2025.05.08_10.00.{i:02d}", **changed,
    }  # fmt: skip
    values = "".join(f'<Data name="{k}"><value>{v}</value></Data>' for k, v in told.items())
    point = f"<Point><coordinates>{lon},{lat},0</coordinates></Point>"
    return f"<Placemark><ExtendedData>{values}</ExtendedData>{point}</Placemark>"


KML = kml(*(placemark(i) for i in range(4)))

OPENCELLID_NAMES = "mcc,mnc,lac,cellid,lat,lon,signal,measured_at,rating,speed,direction,act,ta,psc,tac,pci,sid,nid,bid"


def opencellid_row(i: int, **changed: object) -> str:
    lon, lat = place(i)
    told = {
        "mcc": "262", "mnc": "01", "lac": 7000, "cellid": 5387, "lat": lat, "lon": lon,
        "signal": -81 - i, "measured_at": int(1000 * (START_S + i)), "rating": 7.5,
        "speed": -2000.0, "direction": -2000.0, "act": "LTE+", "ta": 2, "psc": "", "tac": 7000,
        "pci": 325, "sid": "", "nid": "", "bid": "", **changed,
    }  # fmt: skip
    return ",".join(str(value) for value in told.values()) + "\n"


OPENCELLID = OPENCELLID_NAMES + "\n" + "".join(opencellid_row(i) for i in range(4))

TOWER_COLLECTOR = (
    "lat,lon,mcc,mnc,sid,lac,tac,nid,cellid,bid,psc,pci,signal,ta,measured_at,rating,speed,"
    "direction,act,devn\n"
) + "".join(
    f"{place(i)[1]},{place(i)[0]},262,01,,,7000,,5387,,,325,{-81 - i},,"
    f'"2025-05-08 10:00:{i:02d}.000+0000",7.5,1.0,0,LTE,phone\n'
    for i in range(4)
)


def report(i: int, *cells: dict[str, object], **changed: object) -> dict[str, object]:
    lon, lat = place(i)
    return {
        "timestamp": int(1000 * (START_S + i)),
        "position": {"latitude": lat, "longitude": lon, "accuracy": 5.0, "source": "gps"},
        "cellTowers": list(cells) or [tower(signalStrength=-81 - i)],
        **changed,
    }


def tower(**changed: object) -> dict[str, object]:
    return {
        "radioType": "lte", "mobileCountryCode": 262, "mobileNetworkCode": 1,
        "mobileNetworkCodeStr": "01", "locationAreaCode": 7000, "cellId": 5387, "serving": 1,
        "primaryScramblingCode": 325, "arfcn": 2850, "signalStrength": -81, **changed,
    }  # fmt: skip


GEOSUBMIT = json.dumps({"items": [report(i) for i in range(4)]})

NETWORK_SURVEY = (
    "deviceTime,latitude,longitude,altitude,accuracy,missionId,recordNumber,groupNumber,mcc,mnc,tac,"
    "eci,earfcn,pci,rsrp,rsrq,ta,lteBandwidth,provider,servingCell\n"
) + "".join(
    f"{datetime.fromtimestamp(START_S + i, UTC).isoformat()[:-6]}.{k}00Z,{place(i)[1]},{place(i)[0]},"
    f"500.0,5.0,m1,{2 * i + k},{i},{'262,01,7000,5387' if not k else ',,,'},2850,{325 + k},"
    f"{-81.0 - i - 10 * k},-9.0,,,Orange,{'true' if not k else 'false'}\n"
    for i in range(4)
    for k in range(2)
)


def message(i: int, kind: str = "LteRecord", **changed: object) -> dict[str, object]:
    lon, lat = place(i)
    data = {
        "deviceSerialNumber": "pixel", "deviceTime": f"2025-05-08T12:00:{i:02d}+02:00",
        "latitude": lat, "longitude": lon, "accuracy": 5.0, "missionId": "m1", "recordNumber": i,
        "groupNumber": i, "mcc": 262, "mnc": 1, "tac": 7000, "eci": 5387, "earfcn": 2850,
        "pci": 325, "rsrp": -81.0 - i, "servingCell": True, **changed,
    }  # fmt: skip
    return {"version": "0.9.0", "messageType": kind, "data": data}


NETWORK_SURVEY_JSON = "\n".join(json.dumps(message(i)) for i in range(4)) + "\n"

ROMES_NAMES = (
    "Date;Time;UTC;Latitude;Longitude;Altitude;Speed;Heading;#Sat;EARFCN;Frequency;PCI;MCC;MNC;TAC;CI;"
    "eNodeB-ID;cellID;BW;SymPerSlot;Power;SINR;RSRP;RSRQ"
)
PADDING = ";" * 40


def romes(*rows: str) -> str:
    preamble = "".join(f"Scanner setting {i};value{PADDING}\n" for i in range(2500))
    return preamble + f"Time zone;UTC{PADDING}\n" + "".join(
        f"{line}{PADDING}\n" for line in (ROMES_NAMES, *rows)
    )  # fmt: skip


def romes_row(i: int, pci: int = 325, ci: str = "5387", level: float = -81.0) -> str:
    lon, lat = place(i)
    network = "262;01;7000" if ci else ";;"
    return (
        f"8.5.2025;10:00:{i:02d};1749376800;{lat};{lon};500;36;0;9;2850;2655000000;{pci};{network};"
        f"{ci};21;11;20;7;-50;---;{level - i};-9"
    )


ROMES = romes(*(romes_row(i, pci, ci) for i in range(4) for pci, ci in ((325, "5387"), (326, ""))))

ALL = {
    "tidy": TIDY,
    "gnettrack": GNETTRACK,
    "gnettrack-kml": KML,
    "opencellid": OPENCELLID,
    "geosubmit": GEOSUBMIT,
    "network-survey": NETWORK_SURVEY,
    "network-survey-json": NETWORK_SURVEY_JSON,
    "romes": ROMES,
}
