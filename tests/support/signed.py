"""Certificates that somebody changed and signed again."""

import hashlib
import json


def signed(content):
    """The entries with the digest that fits them: SHA-256 over all others, sorted by name."""
    entries = {name: entry for name, entry in content.items() if name != "digest"}
    text = json.dumps(entries, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return entries | {"digest": hashlib.sha256(text.encode()).hexdigest()}
