"""How a cell is named: `earfcn:pci` when both are known, else its global id."""

from __future__ import annotations

MOST_EARFCN = 3_279_165  # the largest NR-ARFCN (3GPP TS 38.104 table 5.4.2.1-1); LTE's are smaller
MOST_LTE_PCI, MOST_NR_PCI = 503, 1007
MOST_NCI = 2**36 - 1  # NR cell identity; an ECI has 28 bits
NO_IDENTITY = frozenset({2**31 - 1, 2**28 - 1})  # Android's "unavailable", and all bits of an ECI
ABSENT = frozenset({"", "-", "--", "---", "null", "none", "nan", "n/a", "not available"})


def whole(text: str | None) -> int | None:
    """A whole number as tools write it (``2850``, ``2850.0``); None when there is none."""
    if text is None or text.strip().lower() in ABSENT:
        return None
    try:
        number = float(text.replace(",", "."))
    except ValueError:
        return None
    return int(number) if number.is_integer() else None


def technology(text: str | None) -> bool | None:
    """Whether a radio is NR (``5G``, ``NR NSA``) or not (``4G``, ``LTE+``); None for all others."""
    word = (text or "").strip().lower()
    if word.startswith(("4g", "lte")):
        return False
    return True if word.startswith(("5g", "nr")) else None


def short_key(earfcn: int | None, pci: int | None) -> str | None:
    """``earfcn:pci``; None unless both are real. EARFCN 0 is what old Androids write for none."""
    if earfcn is None or pci is None:
        return None
    if not (0 < earfcn <= MOST_EARFCN and 0 <= pci <= MOST_NR_PCI):
        return None
    return f"{earfcn}:{pci}"


def global_id(mcc: str | None, mnc: str | None, identity: int | None) -> str | None:
    """``mcc-mnc-identity``; None unless all are known. The MNC keeps its zeros as written."""
    if mcc is None or mnc is None or identity is None or not 0 < identity <= MOST_NCI:
        return None
    if identity in NO_IDENTITY:
        return None
    mcc, mnc = (code.strip().removesuffix(".0") for code in (mcc, mnc))  # as data frames write them
    if not (mcc.isdigit() and mnc.isdigit() and len(mcc) == 3 and 1 <= len(mnc) <= 3):
        return None
    return f"{mcc}-{mnc}-{identity}"


def split_operator(operator: str | None) -> tuple[str | None, str | None]:
    """MCC and MNC of an operator's digits (``60801`` is ``608``, ``01``)."""
    digits = (operator or "").strip()
    if not digits.isdigit() or len(digits) not in {5, 6}:
        return None, None
    return digits[:3], digits[3:]
