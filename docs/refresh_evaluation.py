"""
The generated parts of evaluation.md anew, from folders that `roadprint evaluate` wrote.

    .venv/bin/python docs/refresh_evaluation.py paper=results/paper streets=results/streets

`make evaluation` runs what is needed and then this. A run that is not named keeps its parts.
"""

from __future__ import annotations

import sys
from pathlib import Path

from app.errors import RoadprintError
from app.evaluation.report.document import refresh

DOCUMENT = Path(__file__).with_name("evaluation.md")


def main(arguments: list[str]) -> int:
    """Fill the document; 0 when all went well."""
    pairs = [each.partition("=") for each in arguments]
    if not pairs or not all(name and folder for name, _, folder in pairs):
        sys.stderr.write(f"{__doc__}\n")
        return 2
    try:
        left = refresh(DOCUMENT, {name: Path(folder) for name, _, folder in pairs})
    except (RoadprintError, OSError) as error:
        sys.stderr.write(f"{error}\n")
        return 1
    kept = f"; parts of {', '.join(left)} are as they were" if left else ""
    sys.stdout.write(f"{DOCUMENT} is anew from {', '.join(name for name, _, _ in pairs)}{kept}\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
