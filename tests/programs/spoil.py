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


def _scaled_number(data, rng):
    found = [match for match in NUMBER.finditer(data) if b"." in match[0]]
    if not found:
        return data
    number = rng.choice(found)
    factor = rng.choice((-1.0, 0.0, 1.0001, 1.01, 3.0, 57.3, 1000.0))
    return data[: number.start()] + b"%.9f" % (factor * float(number[0])) + data[number.end() :]


def _plain_line(data, rng):
    """A line that opens or closes no block, once more, elsewhere, or not at all."""
    lines = data.split(b"\n")
    plain = [i for i, line in enumerate(lines) if not re.search(rb"\b(def|thread|sec|if|elif|else|while|end)\b", line)]
    if not plain:
        return data
    at = rng.choice(plain)
    line = lines.pop(at) if rng.random() < 0.7 else lines[at]
    if rng.random() < 0.7:
        lines.insert(rng.randint(0, len(lines)), line)
    return b"\n".join(lines)


GENTLE = (_scaled_number, _scaled_number, _plain_line)


def mutate_gently(data, rng):
    """Other numbers, and lines gone or elsewhere: most of these can still be read."""
    for _ in range(rng.randint(1, 6)):
        data = rng.choice(GENTLE)(data, rng)
    return data


# Tables: toolpaths as CSV

ODD_CELLS = (
    *(
        b"",
        b" ",
        b"nan",
        b"inf",
        b"-1e999",
        b"1e308",
        b"9" * 400,
        b"1_000",
        b"0x1F",
        b"1,5",
        b"1;5",
        b"--1",
        b"1e",
        b"x",
    ),
    *(b'"', b'"1"', b'"1\n2"', b"1\t", "٣".encode(), "\u22121".encode(), b"x", b"=1+1", b"#", b"\x00", b"\xff", b"360"),
)
ODD_NAMES = (
    b"q1_rad",
    b"q1_deg",
    b"q7_rad",
    b"Q1_rad",
    b"x_mm",
    b"x_m",
    b"qw",
    b"",
    b"label",
    b'"a,b"',
    "größe".encode(),
)


def _odd_cell(data, rng):
    lines = data.split(b"\n")
    at = rng.randrange(len(lines))
    cells = lines[at].split(b",")
    cells[rng.randrange(len(cells))] = rng.choice(ODD_NAMES if at == 0 else ODD_CELLS)
    lines[at] = b",".join(cells)
    return b"\n".join(lines)


def _drop_column(data, rng):
    rows = [line.split(b",") for line in data.split(b"\n")]
    at = rng.randrange(max(len(rows[0]), 1))
    return b"\n".join(b",".join(cells[:at] + cells[at + 1 :]) for cells in rows)


def _double_column(data, rng):
    rows = [line.split(b",") for line in data.split(b"\n")]
    at = rng.randrange(max(len(rows[0]), 1))
    return b"\n".join(b",".join([*cells[: at + 1], *cells[at:]]) for cells in rows)


def _rename_column(data, rng):
    head, *rest = data.split(b"\n")
    cells = head.split(b",")
    cells[rng.randrange(len(cells))] = rng.choice(ODD_NAMES)
    return b"\n".join([b",".join(cells), *rest])


def _shuffle_rows(data, rng):
    head, *rest = data.split(b"\n")
    rng.shuffle(rest)
    return b"\n".join([head, *rest])


def _other_ends(data, rng):
    return data.replace(b"\n", rng.choice((b"\r\n", b"\r", b"\n\n", b"\n\r", b";\n")))


def _other_separator(data, rng):
    return data.replace(b",", rng.choice((b";", b"\t", b", ", b" , ", b",,")))


OF_TABLES = (
    *(_odd_cell, _odd_cell, _scaled_number, _scaled_number, _drop_column, _double_column, _rename_column),
    *(_shuffle_rows, _other_ends, _other_separator, _flip, _drop_line, _repeat_block, _truncate, _odd_bytes),
)


def _long_cell(data, rng):
    at = rng.randint(0, len(data))
    return data[:at] + rng.choice((b"1", b"a", b" ", b",", b'"', b"\n")) * 200_000 + data[at:]


def mutate_table(data, rng):
    """The same for a table in bytes: one in forty has 200,000 characters too many besides."""
    for _ in range(rng.randint(1, 3)):
        if data:
            data = rng.choice(OF_TABLES)(data, rng)
    return _long_cell(data, rng) if rng.random() < 1 / 40 else data
