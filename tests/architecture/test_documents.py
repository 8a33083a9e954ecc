"""What the documents say is what is there."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import pytest

from app import domain, numerics
from app.cli import COMMANDS

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
MAKEFILE = (ROOT / "Makefile").read_text()
TARGETS = set(re.findall(r"^([a-z]+):", MAKEFILE, re.MULTILINE))


def read(name: str) -> str:
    return (ROOT / name).read_text()


def code_of(document: Path) -> str:
    """Fenced blocks and inline code, where commands stand."""
    text = document.read_text()
    return "\n".join(re.findall(r"```.*?```|`[^`\n]+`", text, re.DOTALL))


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_commands_in_documents_exist(document):
    """Every `make target` and `roadprint subcommand` that a reader may type."""
    code = code_of(document)
    assert set(re.findall(r"\bmake ([a-z]+)\b", code)) <= TARGETS
    assert set(re.findall(r"\broadprint ([a-z]+)\b", code)) <= set(COMMANDS)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_links_in_documents_lead_somewhere(document):
    """Relative links name files that are there."""
    for link in re.findall(r"\]\((?!https?:|#)([^)#]+)", document.read_text()):
        assert (document.parent / link).exists(), link


def test_readme_teaches_every_command():
    """A newcomer finds all subcommands and the main make targets."""
    readme = read("README.md")
    assert all(f"roadprint {name}" in readme for name in COMMANDS)
    assert all(f"make {name}" in readme for name in ("demo", "serve", "test", "bench"))


def test_every_noun_is_in_the_glossary():
    """The domain's classes are words that docs/glossary.md explains."""
    glossary = read("docs/glossary.md").lower()
    nouns = [
        re.sub(r"(?<!^)(?=[A-Z])", " ", name).lower()
        for name, value in vars(domain).items()
        if inspect.isclass(value) and value.__module__ == domain.__name__
    ]
    assert "road model" in nouns
    missing = [noun for noun in nouns if f"**{noun}**" not in glossary]
    assert not missing


def test_every_make_target_says_what_it_does():
    """`make` alone lists all of them."""
    described = set(re.findall(r"^([a-z]+):.*## \S", MAKEFILE, re.MULTILINE))
    assert described == TARGETS


def test_every_silenced_lint_rule_has_its_reason():
    """Each rule that pyproject.toml ignores has a comment beside it."""
    rules = re.findall(r'^  "([A-Z]+[0-9]*)",(.*)$', read("pyproject.toml"), re.MULTILINE)
    assert rules
    assert all(re.match(r"\s+# \S", comment) for _, comment in rules), rules


def test_the_methods_room_has_a_map():
    """Every module of app.numerics is named in what the package says of itself."""
    lines = re.findall(r"^- [^:]+: ([^-]+)", numerics.__doc__ or "", re.MULTILINE)
    named = re.findall(r"[a-z_]+", " ".join(lines))
    modules = [path.stem for path in (ROOT / "app/numerics").glob("[a-z]*.py")]
    assert len(modules) > 1
    assert not [name for name in modules if name not in named]
