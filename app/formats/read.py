"""From a file's bytes to its drives: the one entry that commands and routes call."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import BinaryIO

import numpy as np

from app.formats import (
    geosubmit,
    gnettrack,
    gnettrack_kml,
    network_survey,
    opencellid,
    romes,
    sniff,
    tidy,
)
from app.formats.account import (
    Account,
    BrokenFile,
    EmptyFile,
    WrongFile,
    refuse_if_broken,
)
from app.formats.assemble import Assembler, Drive
from app.formats.options import Options
from app.formats.rows import Labels, Rows, sift
from app.formats.sniff import Sniffed
from app.formats.source import damage_of
from app.formats.swap import swapped_by_country
from app.formats.table import Layout

TableReader = Callable[[BinaryIO, Layout, Options, Account, Labels], Iterator[Rows]]
PlainReader = Callable[[BinaryIO, Options, Account, Labels], Iterator[Rows]]

TABLES: dict[str, TableReader] = {
    sniff.TIDY: tidy.read,
    sniff.GNETTRACK: gnettrack.read,
    sniff.OPENCELLID: opencellid.read,
    sniff.NETWORK_SURVEY: network_survey.read_table,
    sniff.ROMES: romes.read,
}
OTHERS: dict[str, PlainReader] = {
    sniff.GNETTRACK_KML: gnettrack_kml.read,
    sniff.GEOSUBMIT: geosubmit.read,
    sniff.NETWORK_SURVEY_JSON: network_survey.read_messages,
}


def nothing() -> None:
    """What happens after a block when nobody watches."""


def read_drives(
    source: BinaryIO,
    sniffed: Sniffed,
    options: Options,
    account: Account,
    *,
    keep_going: bool = False,
    after_block: Callable[[], None] = nothing,
) -> Iterator[Drive]:
    """
    The drives of a file, each as soon as it is whole; one block and what waits are in memory.

    Args:
        source: Unpacked bytes at their beginning.
        sniffed: What `app.formats.sniff.sniff` said of them.
        options: What the importer said.
        account: Grows while the file is read, and is complete at the end.
        keep_going: Take the sound rows of a broken file. Otherwise a broken row ends the reading
            with an error, and the caller must store nothing of what it was given.
        after_block: Called after each block, for progress.

    Raises:
        WrongFile: It is no file of this format.
        EmptyFile: It is, and holds no drive.
        BrokenFile: Some of it is broken and ``keep_going`` is not asked for.
    """
    labels = Labels()
    assembler = Assembler(labels, account)
    blocks = _blocks(source, sniffed, options, account, labels)
    blocks = _to_the_end(source, blocks, keep_going=keep_going)
    for rows in _sound_blocks(blocks, account, keep_going=keep_going):
        _refuse_swapped(rows, labels)
        yield from assembler.add(rows)
        after_block()
    yield from assembler.finish()
    if not account.drives:
        raise EmptyFile(f"no drive in it: {account.summary()}")


def _blocks(
    source: BinaryIO, sniffed: Sniffed, options: Options, account: Account, labels: Labels
) -> Iterator[Rows]:
    if sniffed.layout is not None:
        return TABLES[sniffed.name](source, sniffed.layout, options, account, labels)
    return OTHERS[sniffed.name](source, options, account, labels)


def _to_the_end(source: BinaryIO, blocks: Iterator[Rows], *, keep_going: bool) -> Iterator[Rows]:
    """
    The blocks, and the reason when the source ended early: at once, or after what came before.

    Raises:
        BrokenFile: It did.
    """
    for rows in blocks:
        damage = damage_of(source)
        if damage is not None and not keep_going:
            raise damage  # before its last row, cut in two, is called wrong
        yield rows
    damage = damage_of(source)
    if damage is not None:
        raise damage


def _sound_blocks(blocks: Iterator[Rows], account: Account, *, keep_going: bool) -> Iterator[Rows]:
    """Blocks without the rows that are no readings, as far as the file can be read."""
    try:
        for rows in blocks:
            yield sift(rows, account)
            if not keep_going:
                refuse_if_broken(account)
    except BrokenFile as error:
        if not keep_going:
            raise
        account.note(f"read only as far as it is sound: {error}")
    if not keep_going:
        refuse_if_broken(account)


def _refuse_swapped(rows: Rows, labels: Labels) -> None:
    """
    Positions in another part of the world than their cells' countries, right when swapped.

    Raises:
        WrongFile: So it is, in every row of the block.
    """
    keys = list(labels.cells)
    cells = (keys[cell] for cell in np.unique(rows.cell).tolist())
    ids = [labels.global_ids.get(cell, cell) for cell in cells]
    known = [each for each in ids if each.count("-") == 2]
    if swapped_by_country(rows.lon, rows.lat, known):
        where = f"lon {rows.lon[0]:g}, lat {rows.lat[0]:g}"
        raise WrongFile(
            f"lon and lat look swapped: {where} (line {rows.line[0]}) is not where mobile country "
            f"code {known[0][:3]} is on the air, and would be the other way round",
            f"/lines/{rows.line[0]}",
        )
