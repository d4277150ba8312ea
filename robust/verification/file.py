"""Certificates as files that someone else can check: JSON with every number as given, and a digest over it all."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from typing import Any

from nlfrf.shared.strict_json import parse_json, require_schema
from nlfrf.shared.whole_files import write_text
from robust.verification.claim import LoopClaim, content, digest, from_content

__all__ = ["SCHEMA", "read_claim", "write_claim"]


SCHEMA = "robust-certificate"
VERSION = 1


def write_claim(path: str | os.PathLike[str], claim: LoopClaim, found: Sequence[dict[str, Any]] = ()) -> None:
    """Write a claim with how it was found; the digest covers everything else in the file."""
    entries: dict[str, Any] = {
        "schema": SCHEMA,
        "version": VERSION,
        "units": {"dt": "s", "delay": "s"},
        "loop": "u = K (r - y), S = 1/(1 + G K); a continuous plant under a sampled K is held and delayed exactly",
        "claim": content(claim),
        "found": list(found),
    }
    entries["digest"] = digest(entries)
    write_text(path, json.dumps(entries, indent=1, allow_nan=False) + "\n")


def read_claim(path: str | os.PathLike[str]) -> LoopClaim:
    """The claim of a file whose digest fits, or a ValueError that says what is wrong.

    A digest guards against accidents and hurried edits, not against someone who computes it anew: what counts is
    that the claim is proved again, and that plant and controller are compared with those one has.
    """
    entries = parse_json(path)
    if not isinstance(entries, dict) or entries.get("schema") != SCHEMA:
        raise ValueError(f"path must be a certificate written by this package, got {str(path)!r}")
    if entries.get("version") != VERSION:
        raise ValueError(f"path must have version {VERSION} at most, got {entries.get('version')!r} in {str(path)!r}")
    if entries.get("digest") != digest({name: entry for name, entry in entries.items() if name != "digest"}):
        raise ValueError(
            f"path must be a certificate as it was written, got {str(path)!r} whose digest does not fit. "
            "Something in it was changed."
        )
    require_schema(entries, path, "robust", SCHEMA)
    return from_content(entries["claim"])
