"""Death is noticed at once on one machine, by silence across machines, and never by mistake."""

from __future__ import annotations

import pytest

from app.services import presence
from app.services.presence import Presence
from app.store import workers
from app.store.engine import read, write


@pytest.fixture
def clock(monkeypatch):
    """A clock that the test sets."""
    now = [0.0]
    monkeypatch.setattr(presence.time, "monotonic", lambda: now[0])
    return now


def silent_stranger(engine):
    """A worker of another machine, which beat once."""
    with write(engine) as connection:
        workers.beat(connection, "far", host="elsewhere", pid=1)


def test_the_living_are_not_taken_for_dead(engine, tmp_path):
    """Two workers on one folder see each other alive, and not themselves."""
    with Presence(engine, tmp_path) as one, Presence(engine, tmp_path) as other:
        assert one.dead() == other.dead() == set()


def test_a_worker_that_let_go_is_dead_at_once(engine, tmp_path):
    """The moment its lock is free the others know."""
    with Presence(engine, tmp_path) as one:
        with Presence(engine, tmp_path) as other:
            gone = other.worker_id
        assert one.dead() == {gone}
        one.bury(gone)
        assert one.dead() == set()
        assert not (tmp_path / f"{gone}.lock").exists()


def test_a_worker_elsewhere_is_dead_after_its_silence(engine, tmp_path, clock):
    """Without a lock to look at, beats that stand still tell, and only after the whole silence."""
    silent_stranger(engine)
    with Presence(engine, tmp_path) as one:
        assert one.dead() == set()
        clock[0] = presence.SILENT_S - 0.1
        assert one.dead() == set()
        clock[0] = presence.SILENT_S + 0.1
        assert one.dead() == {"far"}


def test_a_beat_ends_the_silence(engine, tmp_path, clock):
    """A worker that beats again is given the whole silence anew."""
    silent_stranger(engine)
    with Presence(engine, tmp_path) as one:
        one.dead()
        clock[0] = 10.0
        silent_stranger(engine)
        assert one.dead() == set()
        clock[0] = 20.0
        assert one.dead() == set()


def test_work_of_nobody_entered_is_noticed(engine, tmp_path):
    """A worker struck off while it still had work is found by that work."""
    with Presence(engine, tmp_path) as one:
        assert one.strangers({"ghost", one.worker_id}) == {"ghost"}


def test_a_worker_struck_off_by_mistake_enters_again(engine, tmp_path):
    """Its next beat makes it known."""
    with Presence(engine, tmp_path) as one, Presence(engine, tmp_path) as other:
        one.bury(other.worker_id)
        other._beat()
        with read(engine) as connection:
            assert set(workers.select_beats(connection)) == {one.worker_id, other.worker_id}
