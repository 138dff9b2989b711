"""Damaged files: bytes and values put where they do not belong.

Everything is drawn from a `random.Random` or from hypothesis, so that a case can be repeated.
"""

import copy
import io
import json
import re
from functools import partial

import numpy as np
from hypothesis import strategies as st
from safetensors.torch import save_file

from repaint_cli.files.headers import KEY
from repaint_cli.policies.weights import load

ODD_BYTES = [
    b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\xed\xa0\x80", b"NaN", b"Infinity", b"-Infinity",
    b"1e999", b"-1", b"0", b"1e300", b"1e-300", b"9" * 400, b"9" * 5000, b"0x" + b"f" * 5000,
    b"18446744073709551616", b"[" * 50, b"[" * 2000, b"{" * 50, b'{"a":' * 2000, b'"', b"'", b"\\",
    b'"\\ud800"', b"\\u0000", b"\x1b[2J", b"[red]", b"[/]", b"null", b"true", b"1979-05-27", b"a.b",
    b"a." * 2000, b"\n", b"\r", b",", b"," * 3000, b";", b"=", b"#", b"inf", b"nan", b"../../x",
    b"/dev/zero", b"/dev/zero.npy", b"x" * 5000, b"\xf0\x9f\x98\x80", b"\xc2\x9b", b"[[]]", b"{}",
    b"__import__('os').system('touch ran')", b"os:Reacher-v5", b"|O8", b"(1000000000000, 6)",
]  # fmt: skip

TEXTS = st.text(max_size=20) | st.sampled_from(
    [word.decode("utf-8", "replace") for word in ODD_BYTES]
)
NUMBERS = (
    st.integers(-3, 3)
    | st.integers()
    | st.floats()
    | st.sampled_from([10**9, 10**30, 2**63, 1e300])
)
VALUES = st.recursive(
    st.none() | st.booleans() | NUMBERS | TEXTS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXTS, inner, max_size=4),
    max_leaves=8,
)


def flipped(rng, data, _):
    spoiled = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 8, 64])):
        spoiled[rng.randrange(len(spoiled))] ^= rng.randrange(1, 256)
    return bytes(spoiled)


def cut(rng, data, _):
    return data[: rng.randrange(len(data))]


def spliced(rng, data, others):
    """A piece of a file, of any kind, is put into another."""
    other = rng.choice(others)
    start = rng.randrange(len(other))
    piece = other[start : start + rng.choice([8, 64, 1024])]
    at, gone = rng.randrange(len(data)), rng.choice([0, len(piece)])
    return data[:at] + piece + data[at + gone :]


def seeded(rng, data, _):
    """Odd bytes are put in, or in place of others."""
    for _ in range(rng.choice([1, 1, 3])):
        at, gone = rng.randrange(len(data)), rng.choice([0, 1, 4, 32])
        data = data[:at] + rng.choice(ODD_BYTES) + data[at + gone :]
    return data


def renumbered(rng, data, _):
    """A number becomes odd bytes."""
    found = list(re.finditer(rb"-?\d+(\.\d+)?", data))
    if not found:
        return flipped(rng, data, _)
    where = rng.choice(found)
    return data[: where.start()] + rng.choice(ODD_BYTES) + data[where.end() :]


def shuffled(rng, data, _):
    """Lines come twice, not at all, or in another order."""
    lines = data.splitlines(keepends=True)
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[i : i + 1] = rng.choice([[], [lines[i]] * 2, [lines[j]], [lines[i]] * 500])
    return b"".join(lines)


SPOILERS = [flipped, cut, spliced, seeded, renumbered, shuffled]


def spoiled(rng, data, others):
    """The file, spoiled in a way or two; where it has a header of JSON, often just that."""
    inner = is_safetensors(data) and rng.random() < 0.7
    length = int.from_bytes(data[:8], "little") if inner else 0
    part = data[8 : 8 + length] if inner else data
    for _ in range(rng.choice([1, 1, 1, 2])):
        part = rng.choice(SPOILERS)(rng, part, others) or b" "
    return len(part).to_bytes(8, "little") + part + data[8 + length :] if inner else part


def is_safetensors(data):
    return data[8:9] == b"{"


@st.composite
def grafts(draw, document):
    """A document with a value of any kind somewhere, or without one."""
    document = copy.deepcopy(document)
    parent = document
    while True:
        keys = list(parent) if isinstance(parent, dict) else list(range(len(parent)))
        key = draw(st.sampled_from(keys)) if keys else None
        if key is None or not isinstance(parent[key], dict | list) or draw(st.integers(0, 3)) == 0:
            break
        parent = parent[key]
    what = draw(st.sampled_from(["change", "change", "change", "drop", "add"]))
    if key is not None and what == "drop":
        del parent[key]
    elif key is not None and what == "change":
        parent[key] = draw(VALUES)
    elif isinstance(parent, dict):
        parent[draw(TEXTS)] = draw(VALUES)
    else:
        parent.append(draw(VALUES))
    return document


def as_json(document):
    return json.dumps(document).encode()


def as_toml(document):
    """TOML, of whatever a document holds."""

    def value(part):
        if isinstance(part, dict):
            return "{" + ", ".join(f"{json.dumps(k)} = {value(v)}" for k, v in part.items()) + "}"
        if isinstance(part, list):
            return "[" + ", ".join(map(value, part)) + "]"
        if isinstance(part, float):
            return repr(part)
        return "1979-05-27" if part is None else json.dumps(part)

    lines = [f"{json.dumps(k)} = {value(v)}" for k, v in document.items()]
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def as_csv(rows):
    return "\n".join(",".join(map(str, row)) for row in rows).encode("utf-8", "surrogatepass")


def json_cases(data):
    return grafts(json.loads(data)).map(as_json)


def csv_cases(data):
    return grafts([line.split(",") for line in data.decode().splitlines()]).map(
        lambda rows: as_csv([row if isinstance(row, list) else [row] for row in rows])
    )


def toml_cases(document, _):
    return grafts(document).map(as_toml)


def forget_hash(path):
    """Write a file as before there were hashes, which would refuse nearly all that is spoiled."""
    tensors, header = load(path)
    save_file(tensors, path, metadata={KEY: json.dumps(header)})


def safetensors_cases(data):
    """Another card in the header, or other leaves."""
    length = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + length])
    card = json.loads(header["__metadata__"][KEY])

    def packed(document, is_card):
        new_header = header | {"__metadata__": {KEY: json.dumps(document)}} if is_card else document
        text = json.dumps(new_header).encode()
        return len(text).to_bytes(8, "little") + text + data[8 + length :]

    return grafts(card).map(partial(packed, is_card=True)) | grafts(header).map(
        partial(packed, is_card=False)
    )


@st.composite
def npy_cases(draw, data):
    """Waypoints of any type and shape, some of them odd, under a header that may be wrong."""
    rows = np.load(io.BytesIO(data))
    kind = draw(st.sampled_from(["f8", "f4", "f2", "i4", "u8", "c16", "S4", "U2", "?", "M8[s]"]))
    rows = rows[: draw(st.integers(0, len(rows)))]
    odd = draw(st.lists(st.tuples(st.integers(0, 10**6), st.floats(width=16)), max_size=3))
    flat = rows.reshape(-1).copy()
    for place, number in odd:
        if flat.size:
            flat[place % flat.size] = number * draw(st.sampled_from([1, 1e5, 1e300]))
    with np.errstate(all="ignore"):
        flat = np.nan_to_num(flat).astype(kind) if kind not in ("f8", "f4") else flat.astype(kind)
    shape = draw(st.sampled_from([rows.shape, (-1,), (-1, 1), (-1, 2), (1, -1)]))
    rows = flat.reshape(shape if flat.size else rows.shape)
    file = io.BytesIO()
    np.save(file, np.asfortranarray(rows) if draw(st.booleans()) else rows)
    written = file.getvalue()
    if draw(st.booleans()):
        shape_text = repr(rows.shape).encode()
        written = written.replace(
            shape_text, repr(tuple(draw(st.lists(NUMBERS, max_size=3)))).encode(), 1
        )
    return written
