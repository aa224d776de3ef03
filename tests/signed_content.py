"""The content of a calibration file, changed by somebody who knows how to sign it."""

import hashlib
import json


def signed(content: dict) -> dict:
    """The content with a checksum that fits, as somebody would write it who knows how."""
    content = {name: part for name, part in content.items() if name != "checksum"}
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return {**content, "checksum": hashlib.sha256(canonical.encode()).hexdigest()}


def changed(text, *path_and_value):
    """The content with one entry replaced, and signed again."""
    *path, last, value = path_and_value
    content = json.loads(text)
    part = content
    for key in path:
        part = part[key]
    part[last] = value
    return signed(content)
