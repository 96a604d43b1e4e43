"""The JSON schema of report.json, made from its records; `python -m deploy.report.schema` prints it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec

from deploy.report.record import Report

SCHEMA_FILE = Path(__file__).with_name("schema.json")


def schema() -> dict[str, Any]:
    """JSON Schema 2020-12 of a report."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Elea run report",
        **msgspec.json.schema(Report),
    }


def text() -> str:
    """The contents of schema.json."""
    return json.dumps(schema(), indent=2) + "\n"


if __name__ == "__main__":
    print(text(), end="")
