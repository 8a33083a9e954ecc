"""Every format becomes the same drive, its quirks notwithstanding."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pytest

from app.formats import account as reasons
from app.formats.account import BrokenFile, WrongFile
from app.formats.options import Options

from . import samples

START = datetime.fromtimestamp(samples.START_S, UTC)
REAL = Path(__file__).resolve().parents[3] / "shared" / "formats"
SHORT, GLOBAL = "2850:325", "262-01-5387"
KEY_OF = dict.fromkeys(samples.ALL, SHORT) | {"tidy": "850:293", "opencellid": GLOBAL}


@pytest.mark.parametrize("name", samples.ALL)
def test_a_file_is_known_by_its_content_and_read_whole(read, name):
    """Format, time with its zone, positions and levels of every sample; nothing dropped."""
    found = read(samples.ALL[name])
    assert found.name == name
    (drive,) = found.drives
    trace = drive.trace
    assert trace.recorded_at == START
    np.testing.assert_allclose(trace.time_s, [0, 1, 2, 3])
    np.testing.assert_allclose(trace.lon, samples.LON)
    np.testing.assert_allclose(trace.lat, [samples.place(i)[1] for i in range(4)])
    level_dbm = trace.rsrp_dbm[:, trace.cells.index(KEY_OF[name])]
    first_dbm = -90 if name == "tidy" else -81
    np.testing.assert_array_equal(level_dbm, first_dbm - np.arange(4.0))
    assert not found.account.dropped
    assert (found.account.samples, found.account.drives) == (4, 1)


@pytest.mark.parametrize("name", sorted(set(samples.ALL) - {"tidy", "opencellid"}))
def test_a_cell_keeps_its_global_id_beside_its_key(read, name):
    """``mcc-mnc-eci``, with the zeros of the MNC where the file has them."""
    mnc = "1" if name == "network-survey-json" else "01"  # whole numbers lose their zeros
    (drive,) = read(samples.ALL[name]).drives
    assert drive.trace.global_ids[SHORT] == f"262-{mnc}-5387"


@pytest.mark.parametrize("name", sorted(set(samples.ALL) - {"geosubmit", "gnettrack-kml"}))
@pytest.mark.parametrize("change", ["crlf", "bom", "lf"])
def test_line_ends_and_byte_order_marks_change_nothing(read, name, change):
    """CRLF, LF or a mark at the beginning."""
    plain = samples.ALL[name].replace("\r\n", "\n")
    text = {"crlf": plain.replace("\n", "\r\n"), "bom": "\ufeff" + plain, "lf": plain}[change]
    drive, whole = read(text).drives[0], read(samples.ALL[name]).drives[0]
    np.testing.assert_array_equal(drive.trace.rsrp_dbm, whole.trace.rsrp_dbm)
    assert drive.trace.recorded_at == whole.trace.recorded_at


@pytest.mark.parametrize(
    ("name", "hours"), [("gnettrack", -2), ("gnettrack-kml", -2), ("romes", -2), ("opencellid", 0),
                        ("network-survey-json", 0), ("geosubmit", 0)],
)  # fmt: skip
def test_only_local_times_follow_the_time_zone(read, name, hours):
    """Times of tools that write no zone are in the zone that is said; the account says so."""
    found = read(samples.ALL[name], Options(zone=ZoneInfo("Europe/Berlin")))
    moment = found.drives[0].trace.recorded_at
    assert (moment - START).total_seconds() == 3600 * hours
    told = any("Europe/Berlin" in note for note in found.account.notes)
    assert told == (hours != 0)


def test_neighbours_of_a_gnettrack_log_are_keyed_by_arfcn_and_pci(read):
    """Also where the serving cell is none of ours, when they say their own technology."""
    names = [*samples.GNETTRACK_NAMES, "NTech1", "NCell1", "NARFCN1", "NRxLev1", "NRxLev2"]
    more = {"NTech1": "4G", "NCell1": 17, "NARFCN1": 1300, "NRxLev1": -99, "NRxLev2": "-"}
    rows = [samples.gnettrack_row(i, **more) for i in range(3)]
    rows.append(samples.gnettrack_row(3, NetworkTech="3G", **more))
    found = read(samples.gnettrack(*rows, names=names))
    assert found.drives[0].trace.cells == ("1300:17", SHORT)
    assert np.isnan(found.drives[0].trace.rsrp_dbm[3, 1])
    assert found.account.dropped == {reasons.NOT_LTE_OR_NR: 1}


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"NetworkTech": "3G"}, reasons.NOT_LTE_OR_NR),
        ({"NetworkTech": "--"}, reasons.NOT_LTE_OR_NR),
        ({"NetworkTech": "4G+", "Level": -145}, reasons.OUT_OF_RANGE),
        ({"Level": -340}, reasons.OUT_OF_RANGE),
        ({"Level": -24}, reasons.OUT_OF_RANGE),
        ({"Level": -30}, reasons.FILLER),
        ({"Level": 2147483647}, reasons.FILLER),
        ({"Level": "-"}, reasons.NO_LEVEL),
        ({"ARFCN": "-", "Node": "-"}, reasons.NO_CELL),
        ({"ARFCN": 0, "Operator": ""}, reasons.NO_CELL),
        ({"Longitude": "", "Latitude": ""}, reasons.NO_POSITION),
        ({"Longitude": 0.0, "Latitude": 0.0}, reasons.NO_POSITION),
        ({"Timestamp": "2025.05.08_10.00.02"}, reasons.REPEATED_TIME),
        ({"Timestamp": "-"}, reasons.NO_TIME),
    ],
)
def test_rows_that_are_no_readings_are_counted_with_their_line(read, change, reason):
    """A sound file of the tool has such rows; they are left out and change nothing else."""
    rows = [samples.gnettrack_row(i) for i in range(4)] + [samples.gnettrack_row(9, **change)]
    found = read(samples.gnettrack(*rows))
    assert found.account.dropped == {reason: 1}
    assert found.account.lines == {reason: [6]}
    assert found.account.samples == 4


def test_the_first_lines_of_a_reason_are_named_and_the_rest_counted(read):
    """Five lines are enough to find the pattern."""
    rows = [samples.gnettrack_row(i, Level="-" if i > 3 else -80) for i in range(20)]
    account = read(samples.gnettrack(*rows)).account
    assert account.dropped == {reasons.NO_LEVEL: 16}
    assert account.places(reasons.NO_LEVEL) == "6, 7, 8, 9, 10, ..."


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("tidy", samples.TIDY + "1,2\n", reasons.WRONG_COLUMNS),
        ("tidy", samples.TIDY + "x,1,1,a,-90,1\n", reasons.NOT_A_TIME),
        ("tidy", samples.TIDY + "9,1,91,a,-90,1\n", reasons.SWAPPED),
        ("tidy", samples.TIDY + "9,1,191,a,-90,1\n", reasons.POSITION_OUT_OF_RANGE),
        ("opencellid", samples.OPENCELLID + samples.opencellid_row(9, signal="?"),
         reasons.NOT_A_NUMBER),
        ("gnettrack-kml", samples.kml(*(samples.placemark(i) for i in range(4)),
                                      samples.placemark(9, RSRP="-81 W")), reasons.UNKNOWN_UNIT),
        ("network-survey-json", samples.NETWORK_SURVEY_JSON + "{}\n", reasons.NOT_A_RECORD),
    ],
)  # fmt: skip
def test_a_half_broken_file_is_taken_only_on_demand(read, name, text, reason):
    """The error points at the line; with ``keep_going`` the sound rows come in."""
    with pytest.raises(BrokenFile, match=reason) as refused:
        read(text)
    assert refused.value.faults[0].pointer.startswith("/lines/")
    found = read(text, keep_going=True)
    assert found.name == name
    assert found.account.dropped == {reason: 1}
    assert found.account.samples == 4


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (samples.KML[:-200], "no XML"),
        (samples.NETWORK_SURVEY_JSON[:-20], "no JSON"),
    ],
)
def test_a_file_cut_short_gives_what_came_before_on_demand(read, text, complaint):
    """What is whole is read, and the account says how far."""
    with pytest.raises(BrokenFile, match=complaint):
        read(text)
    found = read(text, keep_going=True)
    assert found.account.samples == 3
    assert any(complaint in note for note in found.account.notes)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "empty"),
        ("hello\n", "header of no known table"),
        ("time_s,lon,lat,cell\n1,2,3,4\n", "nearest is tidy.*cell_id, rsrp_dbm"),
        (
            "radio,mcc,net,area,cell,unit,lon,lat,range,samples,changeable,created,updated\n",
            "not measurements",
        ),
        ("<gpx></gpx>", "no KML"),
        ('<!DOCTYPE kml [<!ENTITY a "b">]><kml></kml>', "document type"),
        ('{"a": 1}', "JSON without"),
        ('{"items": [1]}', "malformed"),
        ('{"items": 3}', "list of reports"),
        ("a,b\0", "NUL"),
        (b"\xff\xfea\0", "UTF-16"),
        (b"\x1f\x8b\x08", "Content-Encoding"),
        ("time_s,lon,lat,lat,cell_id,rsrp_dbm\n1,2,3,3,a,-90\n", "twice"),
        ("time_s,lon,lat,cell_id,rsrp_dbm\n", "no drive in it: no rows"),
        ("time_s,lon,lat,cell_id,rsrp_dbm\n1,2,3,a,-30\n", "filler"),
        ("time_s,lon,lat,cell_id,rsrp_dbm\n1,2,3,a,-90\n", reasons.TOO_FEW_SAMPLES),
        (samples.gnettrack(), "no drive in it"),
    ],
)
def test_a_wrong_file_is_refused_with_the_reason(read, text, complaint):
    """One sentence that says what it is, or what it lacks."""
    with pytest.raises(WrongFile, match=complaint):
        read(text)


@pytest.mark.parametrize("name", samples.ALL)
def test_another_format_than_the_wanted_one_is_refused(read, name):
    """``--format`` is a claim that is checked, not a wish that is granted."""
    other = "romes" if name != "romes" else "tidy"
    with pytest.raises(WrongFile):
        read(samples.ALL[name], wanted=other)
    assert read(samples.ALL[name], wanted=name).account.samples == 4


def test_writers_of_opencellid_differ_in_their_columns_only(read):
    """Another order, a date in place of a number, quotes, a device's name."""
    mine, other = read(samples.OPENCELLID).drives[0], read(samples.TOWER_COLLECTOR).drives[0]
    np.testing.assert_array_equal(mine.trace.rsrp_dbm, other.trace.rsrp_dbm)
    assert mine.trace.recorded_at == other.trace.recorded_at == START
    assert other.trace.device == "phone"
    assert mine.trace.cells == other.trace.cells == (GLOBAL,)
    assert np.isnan(mine.speed_mps).all()  # -2000 is none


def test_a_measurement_that_tells_no_radio_is_of_lte_when_it_has_a_pci(read):
    """Older writers have no ``act``; 2G and 3G have no PCI."""
    rows = [samples.opencellid_row(i, act="", pci=325 if i < 3 else "") for i in range(4)]
    found = read(samples.OPENCELLID_NAMES + "\n" + "".join(rows))
    assert found.account.samples == 3
    assert found.account.dropped == {reasons.NOT_LTE_OR_NR: 1}


def test_units_are_converted(read):
    """36 km/h are 10 m/s, and accuracies are metres."""
    for text in (samples.KML, samples.ROMES):
        np.testing.assert_allclose(read(text).drives[0].speed_mps, 10.0)
    np.testing.assert_allclose(read(samples.KML).drives[0].accuracy_m, 7.0)


def test_records_of_one_scan_are_one_sample(read):
    """Network Survey stamps each record; the group says which belong together."""
    (drive,) = read(samples.NETWORK_SURVEY).drives
    assert drive.trace.rsrp_dbm.shape == (4, 2)
    assert np.isfinite(drive.trace.rsrp_dbm).all()


def test_nr_has_its_own_range(read):
    """-150 dBm is a reading of NR and none of LTE."""
    nr = [
        samples.message(i, "NrRecord", narfcn=630000, nci="68719476735", ssRsrp=-150.0)
        for i in range(3)
    ]
    found = read(json.dumps(nr))
    assert found.drives[0].trace.cells == ("630000:325",)
    assert found.drives[0].trace.global_ids == {"630000:325": "262-1-68719476735"}
    with pytest.raises(WrongFile, match=reasons.OUT_OF_RANGE):
        read(json.dumps([samples.message(i, rsrp=-150.0) for i in range(3)]))


def test_a_phone_is_known_by_a_digest_of_its_imei(read):
    """Two phones in one file are two drives, and neither IMEI is kept."""
    names = [*samples.GNETTRACK_NAMES, "IMEI"]
    rows = [samples.gnettrack_row(i, IMEI=imei) for i in range(3) for imei in ("3561", "3562")]
    drives = read(samples.gnettrack(*rows, names=names)).drives
    devices = {drive.trace.device for drive in drives}
    assert len(drives) == len(devices) == 2
    assert all(device.startswith("phone-") and "356" not in device[:9] for device in devices)


def test_old_and_misplaced_reports_are_left_out(read):
    """A cell heard half a minute before its position belongs elsewhere; wifi has no level here."""
    old = samples.report(9, samples.tower(age=30_000))
    text = json.dumps({"items": [*(samples.report(i) for i in range(3)), old, {"position": None}]})
    found = read(text)
    assert found.account.samples == 3
    assert found.account.dropped.total() == 1


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("file", "name", "samples_read"),
    [("gnettrack_orange_log.txt", "gnettrack", 880),
     ("opencellid_measurements.csv", "opencellid", 116)],
)  # fmt: skip
def test_real_logs_are_read(read, file, name, samples_read):
    """Logs of the tools themselves, whole and without a fault."""
    if not (REAL / file).is_file():
        pytest.skip(f"{file} is not beside the repository")
    found = read((REAL / file).read_bytes())
    assert found.name == name
    assert found.account.samples == samples_read
    assert not found.account.faults
