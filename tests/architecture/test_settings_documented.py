"""Every setting is in the operations guide, with its variable and its default."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.settings import ENV_PREFIX, Settings

OPERATIONS = Path(__file__).resolve().parents[2] / "docs" / "operations.md"


@pytest.mark.parametrize("name", list(Settings.model_fields))
def test_a_setting_is_documented(name: str):
    """One row of the table a setting, saying its default as it is."""
    variable = f"`{ENV_PREFIX}{name.upper()}`"
    rows = [
        line for line in OPERATIONS.read_text(encoding="utf-8").splitlines() if variable in line
    ]
    row = next(line for line in rows if line.startswith(f"| {variable}"))
    default = Settings.model_fields[name].default
    assert f"| `{default}` |" in row or (default is None and "| none |" in row), row


def test_no_setting_is_documented_that_is_not_there():
    """A variable in the table's first column is a field."""
    lines = OPERATIONS.read_text(encoding="utf-8").splitlines()
    rows = [line for line in lines if line.startswith(f"| `{ENV_PREFIX}")]
    documented = {line.split("`")[1].removeprefix(ENV_PREFIX).lower() for line in rows}
    assert documented == set(Settings.model_fields)


def test_options_win_over_the_environment():
    """What is given on the command line is meant; an empty variable is none."""
    environment = {"ROADPRINT_PORT": "9000", "ROADPRINT_HOST": "", "ROADPRINT_LOG_LEVEL": "debug"}
    settings = Settings.from_environment(environment, port=9001, data_dir=None)
    assert (settings.port, settings.host, settings.log_level) == (9001, "127.0.0.1", "debug")
    assert Settings.from_environment(settings.to_environment()) == settings
