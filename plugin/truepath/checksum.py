"""A checksum over the content of a JSON file: what was changed after truepath wrote it is noticed."""

from __future__ import annotations

import hashlib
import json


def checksum(content: dict) -> str:
    """SHA-256 of the content, whatever the order of its names."""
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(canonical.encode()).hexdigest()
