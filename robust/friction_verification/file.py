"""Proofs of a machine with friction as files that someone else can check: every number as given, and a digest."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from typing import Any

from nlfrf.shared.strict_json import parse_json, require_schema
from nlfrf.shared.whole_files import write_text
from robust.friction_verification.claim import FrictionClaim, content, from_content
from robust.verification.claim import digest

__all__ = ["SCHEMA", "read_friction_claim", "write_friction_claim"]

SCHEMA = "robust-friction-certificate"
VERSION = 2
READ = (1, 2)  # the first without actuators


def write_friction_claim(
    path: str | os.PathLike[str], claim: FrictionClaim, found: Sequence[dict[str, Any]] = ()
) -> None:
    """Write a claim with how it was found; the digest covers everything else in the file."""
    entries: dict[str, Any] = {
        "schema": SCHEMA,
        "version": VERSION,
        "units": {"dt": "s", "delay": "s", "K0": "N/m", "microdamping": "Ns/m", "bristle_time": "s", "rates": "rad/s"},
        "loop": ("u = sat(-K y)" if claim.actuator else "u = -K y")
        + ", sampled, delayed, held; p' = A p + B (u, -f), C p: measured, displacement at the port",
        "claim": content(claim),
        "found": list(found),
    }
    entries["digest"] = digest(entries)
    write_text(path, json.dumps(entries, indent=1, allow_nan=False) + "\n")


def read_friction_claim(path: str | os.PathLike[str]) -> FrictionClaim | None:
    """The claim of a file whose digest fits, None of a certificate of another kind, or a ValueError."""
    entries = parse_json(path)
    if not isinstance(entries, dict) or entries.get("schema") != SCHEMA:
        return None
    if entries.get("version") not in READ:
        raise ValueError(f"path must have version {VERSION} at most, got {entries.get('version')!r} in {str(path)!r}")
    if entries.get("digest") != digest({name: entry for name, entry in entries.items() if name != "digest"}):
        raise ValueError(
            f"path must be a certificate as it was written, got {str(path)!r} whose digest does not fit. "
            "Something in it was changed."
        )
    require_schema(entries, path, "robust", SCHEMA)
    return from_content(entries["claim"])
