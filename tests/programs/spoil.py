"""Ways to spoil a program: what a broken disk, a bad transfer, a careless editor or an attacker leaves of it."""

import re

TOKEN = re.compile(rb"\w+(?:\.\w+)?|[^\w\s]")
NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
ODD_NUMBERS = (
    *(
        b"nan",
        b"inf",
        b"-inf",
        b"1e999",
        b"-1e999",
        b"1e-999",
        b"9" * 400,
        b"0x1F",
        b"1.2.3",
        b"--",
        b"1e",
        b"1/0",
        b"True",
    ),
    *("٣".encode(), b"0.1f", b"1_000", b'"0.1"', b"p", b"[]", b"p[0,0,0,0,0,0]"),
)
ODD_BYTES = (
    *(b"\x00", b"\xff\xfe", b"\xc3\x28", b"\xed\xa0\x80", b"\r", b"\x0c", b"\x0b", b"\x1a", b"\x85"),
    *("\u2028".encode(), "\u200b".encode(), "\ufeff".encode(), "\u0301".encode(), b'"', b"#", b"\\", b"'", b";", b"$"),
)
BRACKETS = b"()[]{}"


def _flip(data, rng):
    at = rng.randrange(len(data))
    return data[:at] + bytes([data[at] ^ (1 << rng.randrange(8))]) + data[at + 1 :]


def _drop_token(data, rng):
    found = rng.choice(list(TOKEN.finditer(data)) or [re.match(b"", data)])
    return data[: found.start()] + data[found.end() :]


def _swap_tokens(data, rng):
    found = list(TOKEN.finditer(data))
    if len(found) < 2:
        return data
    a, b = sorted(rng.sample(range(len(found)), 2))
    a, b = found[a], found[b]
    return data[: a.start()] + b[0] + data[a.end() : b.start()] + a[0] + data[b.end() :]


def _repeat_block(data, rng):
    lines = data.split(b"\n")
    start = rng.randrange(len(lines))
    block = lines[start : start + rng.randint(1, 12)]
    at = rng.randint(0, len(lines))
    return b"\n".join(lines[:at] + block * rng.randint(1, 3) + lines[at:])


def _drop_line(data, rng):
    lines = data.split(b"\n")
    del lines[rng.randrange(len(lines))]
    return b"\n".join(lines)


def _truncate(data, rng):
    return data[: rng.randint(0, len(data))]


def _swap_bracket(data, rng):
    at = [i for i, byte in enumerate(data) if byte in BRACKETS]
    if not at:
        return data
    i = rng.choice(at)
    return data[:i] + bytes([rng.choice(BRACKETS)]) + data[i + 1 :]


def _odd_number(data, rng):
    found = rng.choice(list(NUMBER.finditer(data)) or [re.match(b"", data)])
    return data[: found.start()] + rng.choice(ODD_NUMBERS) + data[found.end() :]


def _odd_bytes(data, rng):
    at = rng.randint(0, len(data))
    return data[:at] + rng.choice(ODD_BYTES) + data[at:]


def _drop_end(data, rng):
    found = list(re.finditer(rb"\bend\b", data))
    if not found:
        return data
    end = rng.choice(found)
    return data[: end.start()] + rng.choice((b"", b"ende", b"end end")) + data[end.end() :]


def _long_line(data, rng):
    at = rng.randint(0, len(data))
    piece = rng.choice((b"a", b" ", b"#", b"1+", b"0.1,", b'"', b"\t", b"p[0,0,0,0,0,0],", b"(", b"-", b"not "))
    return data[:at] + piece * (1_000_000 // len(piece)) + data[at:]


def _deep_brackets(data, rng):
    at = rng.randint(0, len(data))
    opening, closing = rng.choice(((b"(", b")"), (b"[", b"]"), (b"p[", b"]"), (b"pose_inv(", b")"), (b"-", b"")))
    return data[:at] + opening * 10_000 + b"0.1" + closing * rng.choice((10_000, 9_999, 0)) + data[at:]


def _deep_blocks(data, rng):
    at = data.find(b"\n", rng.randint(0, len(data))) + 1
    head = rng.choice((b"if True:\n", b"while True:\n", b"def f():\n", b"else:\n"))
    return data[:at] + head * 10_000 + b"end\n" * rng.choice((10_000, 1)) + data[at:]


SMALL = (
    *(_flip, _drop_token, _swap_tokens, _repeat_block, _drop_line, _truncate),
    *(_swap_bracket, _odd_number, _odd_bytes, _drop_end),
)
LARGE = (_long_line, _deep_brackets, _deep_blocks)


def mutate(text, rng):
    """A spoilt copy in bytes: a few small wounds, one in forty with a megabyte or 10,000 brackets besides.

    Args:
        text: program, str or bytes.
        rng: ``random.Random``.
    """
    data = text.encode() if isinstance(text, str) else bytes(text)
    for _ in range(rng.randint(1, 4)):
        if data:
            data = rng.choice(SMALL)(data, rng)
    return rng.choice(LARGE)(data, rng) if rng.random() < 1 / 40 else data
