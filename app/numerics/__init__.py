"""The method itself, as pure functions of arrays: no I/O, clock, logging, settings or globals."""
