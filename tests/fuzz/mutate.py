"""Damages and distorts inputs, by what their names say they are; all of it drawn from a seeded generator.

An edit knows the structure of its file, so that what it changes is reached: checksums are made right again or
taken out, lengths agree with what they count unless they are what is edited.
"""

import ast
import io
import json
import re
import struct
import tomllib
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import PurePosixPath
from random import Random
from typing import Any, TypeAlias

import tomli_w
from tests.fuzz.base import Input

Edit: TypeAlias = Callable[[Random, bytes], bytes]
INTEGERS = (0, 1, -1, 2, 7, 127, 255, 65535, 2**24, 2**31 - 1, 2**31, 2**32 - 1, 2**62, 2**63 - 1, 2**64 - 1)
NUMBERS = (0, 1, -1, 3, 65, 1 << 20, 2**31, 2**53, 2**63 - 1, -(2**63), 2**64, 10**30, 10**400, 0.5, -0.5,
           1e-320, 1e-9, 1e9, 1e18, 1e300, -1e300, float("inf"), float("-inf"), float("nan"))  # fmt: skip
TEXTS = ("", " ", "x", "nan", "-1", "1e999", "inf", "true", "null", "../../x", "/", "a.b", "a\0b", "ä\u2028",
         "\ud800", "[a-z", "*", "%s{0}", "a" * 300, "9" * 5000, "\r\n", "2024-02-30", "0x1f",
         "1_000")  # fmt: skip
WORDS = (b"", b"nan", b"inf", b"-inf", b"-0", b"1e308", b"1e-320", b"-1", b"0", b"9" * 25, b"9" * 5000,
         b"1.5", b"0x1f", b"true", b"[]", b"{}", b'""', b"\0", b"\xff\xfe", b"\xed\xa0\x80", b"\r",
         b'"', b"'",
         b";",
         b"\t", b"=", b"[" * 3000, b'{"a":' * 2000, b"1979-05-27", b"a" * 200_000)  # fmt: skip


def edited(random: Random, given: Input, others: list[Input]) -> Input:
    """Return an input with one to eight edits, most often in one of its files."""
    result = dict(given)
    names = sorted(result)
    name = random.choice(names)
    for _ in range(random.choice((1, 1, 1, 2, 3, 8))):
        if random.random() < 0.15:
            name = random.choice(names)
        draw = random.random()
        if draw < 0.02 and len(names) > 1:
            result.pop(name, None)
        elif draw < 0.04:
            result[name] = random.choice([*random.choice(others).values(), b""])
        elif draw < 0.2:
            result[name] = _bytes(random, result.get(name, b""))
        else:
            result[name] = _by_name(name)(random, result.get(name, b""))
    return result or dict(given)


def _by_name(name: str) -> Edit:
    edits: dict[str, Edit] = {
        ".mcap": _mcap, ".json": _json, ".toml": _toml, ".csv": _csv, ".npy": _npy, ".parquet": _parquet,
        ".safetensors": _safetensors, ".packets": _packets, ".http": _text, ".set": _text,
    }  # fmt: skip
    return edits.get(PurePosixPath(name).suffix, _bytes)


# ---- any bytes ----


def _bytes(random: Random, data: bytes) -> bytes:
    result = bytearray(data)
    size = len(result)
    at, to = sorted((random.randint(0, size), random.randint(0, size)))
    to = min(to, at + random.choice((1, 4, 64, 4096)))
    match random.randrange(8):
        case 0 if size:
            for _ in range(random.choice((1, 1, 4, 32))):
                result[random.randrange(size)] ^= 1 << random.randrange(8)
        case 1:
            del result[at:to]
        case 2:
            result[at:at] = result[at:to] * random.choice((1, 1, 2, 50))
        case 3:
            del result[at:]
        case 4:
            result[at:to] = random.randbytes(to - at)
        case 5:
            other = random.randint(0, size)
            result[at:to] = result[other : other + to - at]
        case 6:
            result[at:at] = random.randbytes(random.choice((1, 3, 8, 100)))
        case _:
            return _integer(random, data)
    return bytes(result)


def _integer(random: Random, data: bytes) -> bytes:
    """Set what may be an integer field to an extreme, or to near what it was."""
    width, order = random.choice(
        ((1, "<"), (2, "<"), (4, "<"), (8, "<"), (4, ">"), (8, ">"), (4, "<"), (8, "<"))
    )
    if len(data) < width:
        return data
    at = random.randrange(len(data) - width + 1)
    at -= at % random.choice((1, 4)) if at >= 4 else 0
    byte_order: Any = "little" if order == "<" else "big"
    before = int.from_bytes(data[at : at + width], byte_order)
    value = random.choice((*INTEGERS, before + 1, before - 1, before * 2, len(data), before << 8))
    return data[:at] + (value % (1 << 8 * width)).to_bytes(width, byte_order) + data[at + width :]


# ---- text and trees ----


def _text(random: Random, data: bytes) -> bytes:
    lines = data.split(b"\n")
    at = random.randrange(len(lines))
    match random.randrange(7):
        case 0 | 1 | 2:
            words = list(re.finditer(rb"[-+.\w]+", data)) or [re.compile(b"").search(data)]
            word = random.choice(words)
            assert word
            return data[: word.start()] + random.choice(WORDS) + data[word.end() :]
        case 3:
            del lines[at]
        case 4:
            lines[at:at] = [random.choice(lines)] * random.choice((1, 2, 200))
        case 5:
            place = random.randint(0, len(lines[at]))
            lines[at] = lines[at][:place] + random.choice(WORDS) + lines[at][place:]
        case _:
            return _bytes(random, data)
    return b"\n".join(lines)


def _tree(random: Random, tree: Any) -> Any:
    """Return plain values with one edit somewhere: another value, another key, one more, one less."""
    places: list[tuple[Any, Any]] = []
    stack: list[Any] = [tree]
    while stack:
        node = stack.pop()
        children: list[tuple[Any, Any]] = (
            list(node.items())
            if isinstance(node, dict)
            else list(enumerate(node))
            if isinstance(node, list)
            else []
        )
        places += [(node, key) for key, _ in children]
        stack += [child for _, child in children]
    if not places:
        return random.choice((*NUMBERS, *TEXTS, [], {}, None))
    node, key = random.choice(places)
    value = node[key]
    match random.randrange(9):
        case 0 | 1:
            node[key] = random.choice(NUMBERS)
        case 2:
            node[key] = random.choice(TEXTS)
        case 3:
            node[key] = random.choice((None, True, [], {}, [[]], [None], {"": 0}, [value], {"name": value}))
        case 4:
            del node[key]
        case 5 if isinstance(node, dict):
            node[random.choice((*TEXTS[:10], str(key).upper(), f"{key}s", random.choice(places)[1]))] = value
        case 6 if isinstance(value, list):
            node[key] = value * random.choice((0, 2, 3, 300))
        case 7 if isinstance(value, (int, float)):
            node[key] = random.choice((value + 1, value - 1, -value, value * 1000, str(value), [value]))
        case _:
            other, step = random.choice(places)
            node[key] = json.loads(json.dumps(other[step], default=str))
    return tree


def _json(random: Random, data: bytes) -> bytes:
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError):
        return _text(random, data)
    if random.random() < 0.2:
        return _text(random, data)
    return json.dumps(_tree(random, tree)).encode()


def _toml(random: Random, data: bytes) -> bytes:
    try:
        tree = tomllib.loads(data.decode())
        return tomli_w.dumps(_tree(random, tree)).encode() if random.random() < 0.7 else _text(random, data)
    except (ValueError, TypeError, RecursionError, AttributeError):
        return _text(random, data)


def _csv(random: Random, data: bytes) -> bytes:
    rows = [line.split(b",") for line in data.split(b"\n")]
    row = random.choice(rows)
    column = random.randrange(len(row))
    match random.randrange(8):
        case 0 | 1 | 2:
            row[column] = random.choice(WORDS)
        case 3:
            for each in rows:
                del each[column : column + 1]
        case 4:
            for each in rows:
                each[column:column] = each[column : column + 1]
        case 5:
            rows[0][min(column, len(rows[0]) - 1)] = random.choice((*WORDS, *row))
        case 6:
            random.shuffle(rows)
        case _:
            return _text(random, data)
    return b"\n".join(b",".join(each) for each in rows)


# ---- arrays ----


def _npy(random: Random, data: bytes) -> bytes:
    try:
        size = struct.unpack_from("<H", data, 8)[0]
        head = ast.literal_eval(data[10 : 10 + size].decode("latin-1").strip())
        body = data[10 + size :]
        shape = list(head["shape"])
    except (struct.error, ValueError, SyntaxError, KeyError, TypeError, RecursionError):
        return _bytes(random, data)
    match random.randrange(5):
        case 0:
            kinds = (
                "<f8",
                "<f4",
                "<i8",
                "<i4",
                "|b1",
                "|O",
                "<U4",
                ">f8",
                "<c16",
                "|V8",
                "<f2",
                "<M8[s]",
                "x",
                "",
            )
            head["descr"] = random.choice((*kinds, [("a", "<f4")]))
        case 1:
            place = random.randrange(len(shape) + 1)
            shape[place : place + 1] = [random.choice((0, 1, -1, 2**31, 2**40, 2**62, len(body)))]
            head["shape"] = tuple(shape)
        case 2:
            head["shape"] = random.choice(
                ((), tuple(shape[::-1]), (*shape, 1), (1, *shape), tuple(shape[:-1]), 5, None)
            )
        case 3:
            head["fortran_order"] = random.choice((True, None, 7))
        case _:
            body = _integer(random, body)
    text = repr(head).encode() + b"\n"
    return data[:8] + struct.pack("<H", len(text)) + text + body


def _safetensors(random: Random, data: bytes) -> bytes:
    try:
        size = struct.unpack_from("<Q", data)[0]
        tree: Any = json.loads(data[8 : 8 + size])
    except (struct.error, ValueError, RecursionError):
        return _bytes(random, data)
    body = data[8 + size :]
    if random.random() < 0.4:
        for _ in range(random.choice((1, 5, 100))):
            at = random.randrange(max(len(body) // 4, 1)) * 4
            body = (
                body[:at]
                + struct.pack("<f", random.choice((0.0, float("nan"), float("inf"), 3e38, -1.0)))
                + body[at + 4 :]
            )
        body = body[: len(data) - 8 - size]
    else:
        state = tree.get("__metadata__", {}) if isinstance(tree, dict) else {}
        if isinstance(state, dict) and isinstance(state.get("state"), str) and random.random() < 0.5:
            state["state"] = _json(random, state["state"].encode(errors="replace")).decode(errors="replace")
        else:
            tree = _tree(random, tree)
    text = json.dumps(tree).encode()
    return struct.pack("<Q", len(text)) + text + body


def _parquet(random: Random, data: bytes) -> bytes:  # noqa: C901  (a list of edits)
    """Return a table with other columns, types or values; now and then with bytes that are wrong."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    if random.random() < 0.2:
        return _bytes(random, data)
    try:
        table: Any = pq.read_table(io.BytesIO(data))
        place = random.randrange(max(table.num_columns, 1))
        name, column = table.column_names[place], table.column(place)
        rows = column.to_pylist()
    except Exception:  # noqa: BLE001  (what earlier edits broke)
        return _bytes(random, data)
    match random.randrange(7):
        case 0:
            table = table.drop_columns([name])
        case 1:
            table = table.append_column(random.choice((*TEXTS[:5], name, "time")), column)
        case 2:
            made: Any = random.choice((None, 1, 1.5, "x", b"x", [], [1.0], [None], {"a": 1}, True))
            table = table.set_column(place, name, pa.array([made] * len(rows)))
        case 3:
            table = table.slice(random.randint(0, len(rows)), random.choice((0, 1, 10**6)))
        case 4:
            table = pa.concat_tables([table] * random.choice((2, 20)))
        case _:
            if not rows:
                return data
            at = random.randrange(len(rows))
            if isinstance(rows[at], list):
                rows[at] = random.choice(
                    (None, [], rows[at][:-1], rows[at] * 2, [None], [float("nan")] * len(rows[at]))
                )
            else:
                rows[at] = random.choice((None, *NUMBERS, *TEXTS[:9]))
            try:
                table = table.set_column(place, name, pa.array(rows, column.type))
            except (pa.ArrowException, TypeError, OverflowError, ValueError, UnicodeError):
                return _bytes(random, data)
    out = io.BytesIO()
    pq.write_table(table, out)
    return out.getvalue()


# ---- datagrams ----


def packets(datagrams: list[bytes]) -> bytes:
    """Return datagrams as one file: each behind its length in four bytes."""
    return b"".join(struct.pack("<I", len(each)) + each for each in datagrams)


def datagrams(data: bytes) -> list[bytes]:
    """Return the datagrams in a file, as far as it is whole."""
    datagram_list: list[bytes] = []
    at = 0
    while at + 4 <= len(data):
        size = struct.unpack_from("<I", data, at)[0]
        datagram_list.append(data[at + 4 : at + 4 + min(size, 60000)])
        at += 4 + size
    return datagram_list


def _packets(random: Random, data: bytes) -> bytes:
    parts = datagrams(data) or [b""]
    at = random.randrange(len(parts))
    is_json = parts[at][:1] == b"{"
    match random.randrange(12 if is_json else 6):
        case 0:
            parts[at : at + random.choice((1, 3))] = []
        case 1:
            parts[at:at] = [parts[at]] * random.choice((1, 2, 40))
        case 2:
            other = random.randrange(len(parts))
            parts[at], parts[other] = parts[other], parts[at]
        case 3:
            parts[at] = parts[at] * random.choice((0, 2, 200))
        case _:
            edit = _json if is_json else random.choice((_integer, _bytes))
            parts[at] = edit(random, parts[at])
    return packets(parts)


# ---- MCAP ----

MAGIC = b"\x89MCAP0\r\n"
CHANNEL, MESSAGE, CHUNK, METADATA, FOOTER = 4, 5, 6, 12, 2


def _mcap(random: Random, data: bytes) -> bytes:
    """Return a file with a record edited, in a chunk or outside, every length and checksum being right."""
    records, rest = _records(data[len(MAGIC) :])
    if not records or random.random() < 0.1:
        return _bytes(random, data)
    whole: list[list[Any]] = [[opcode, body] for opcode, body in records]
    chunks = [place for place, (opcode, _) in enumerate(whole) if opcode == CHUNK]
    if chunks and random.random() < 0.7:
        place = random.choice(chunks)
        whole[place][1] = _chunk(random, whole[place][1])
    else:
        whole = _edit_records(random, whole)
    out = MAGIC + _joined(whole) + rest
    return out if random.random() < 0.9 else out[: random.randint(0, len(out))]


def _records(data: bytes) -> tuple[list[tuple[int, bytes]], bytes]:
    records: list[tuple[int, bytes]] = []
    at = 0
    while at + 9 <= len(data):
        opcode, size = struct.unpack_from("<BQ", data, at)
        if at + 9 + size > len(data):
            break
        records.append((opcode, data[at + 9 : at + 9 + size]))
        at += 9 + size
        if opcode == FOOTER:
            break
    return records, data[at:]


def _joined(records: list[list[Any]]) -> bytes:
    return b"".join(struct.pack("<BQ", opcode % 256, len(body)) + body for opcode, body in records)


def _edit_records(random: Random, records: list[list[Any]]) -> list[list[Any]]:
    at = random.randrange(len(records))
    opcode, body = records[at]
    match random.randrange(10):
        case 0:
            del records[at]
        case 1:
            records[at:at] = [records[at]] * random.choice((1, 1, 3))
        case 2:
            other = random.randrange(len(records))
            records[at], records[other] = records[other], records[at]
        case 3:
            records[at] = [random.choice((*range(1, 16), 0, 200)), body]
        case 4:
            records[at] = [opcode, body[: random.randint(0, len(body))]]
        case _:
            records[at] = [opcode, _body(random, opcode, body)]
    return records


def _body(random: Random, opcode: int, body: bytes) -> bytes:
    if opcode == METADATA:
        return _metadata(random, body)
    if opcode == MESSAGE and random.random() < 0.8:
        return body[:22] + _cdr(random, body[22:])
    return _integer(random, body) if random.random() < 0.6 else _bytes(random, body)


def _cdr(random: Random, data: bytes) -> bytes:
    """Return a message of CDR bytes edited: most often a length or a number, or the JSON in a text."""
    size = struct.unpack_from("<I", data, 4)[0] if len(data) >= 8 else 0
    text = data[8 : 8 + size - 1] if size else b""
    if text[:1] == b"{":
        new = _json(random, text)
        return data[:4] + struct.pack("<I", len(new) + 1) + new + b"\0" + data[8 + size :]
    if len(data) < 12 or random.random() < 0.2:
        return _bytes(random, data)
    at = 4 * random.randrange(min(len(data) // 4, random.choice((16, 1 << 20))))
    value = random.choice((*INTEGERS, struct.unpack_from("<I", data.ljust(at + 4, b"\0"), at)[0] + 1))
    return data[:at] + struct.pack("<I", value % (1 << 32)) + data[at + 4 :]


def _metadata(random: Random, body: bytes) -> bytes:
    """Return the body of a metadata record with a value edited: JSON as JSON."""
    try:
        parts: list[bytes] = []
        at, head = 0, True
        while at < len(body):
            size = struct.unpack_from("<I", body, at)[0]
            parts.append(body[at + 4 : at + 4 + size])
            at += 4 + size
            if head:
                at, head = at + 4, False  # the bytes that all entries take
    except struct.error:
        return _bytes(random, body)
    if len(parts) < 2:
        return _bytes(random, body)
    place = random.randrange(len(parts))
    parts[place] = _json(random, parts[place]) if parts[place][:1] == b"{" else _text(random, parts[place])
    packed = [struct.pack("<I", len(each)) + each for each in parts]
    entries = b"".join(packed[1:])
    return packed[0] + struct.pack("<I", len(entries)) + entries


def _chunk(random: Random, body: bytes) -> bytes:
    if len(body) < 40:
        return _bytes(random, body)
    begin, stop, size, _, length = struct.unpack_from("<QQQII", body)
    packed = body[40 + length :]
    if length:  # packed by an edit before
        return _integer(random, body)
    records, rest = _records(packed)
    inner: list[list[Any]] = [[opcode, content] for opcode, content in records]
    if inner:
        # Messages are what most of a chunk is; schemas and channels are edited as often.
        kinds = sorted({opcode for opcode, _ in records})
        kind = random.choice(kinds)
        place = random.choice([at for at, (opcode, _) in enumerate(records) if opcode == kind])
        if random.random() < 0.6:
            inner[place] = [kind, _body(random, kind, inner[place][1])]
        else:
            inner = _edit_records(random, inner)
    content = _joined(inner) + rest
    size, name = len(content), b""
    checksum = random.choice((0, zlib.crc32(content)))
    if random.random() < 0.1:
        content, name = _packed(random, content)
        size = random.choice((size, size, 0, 1 << 31, 1 << 63))
    head = struct.pack("<QQQII", begin, stop, size % (1 << 64), checksum, len(name)) + name
    return head + struct.pack("<Q", len(content)) + content


def _packed(random: Random, content: bytes) -> tuple[bytes, bytes]:
    """Return content compressed, and the compression's name; it may be more than fits into memory."""
    import lz4.frame
    import zstandard

    match random.randrange(4):
        case 0:
            return lz4.frame.compress(content), b"lz4"
        case 1:
            return zstandard.compress(content), b"zstd"
        case 2:
            return _bomb(), b"zstd"
        case _:
            return content, random.choice((b"zstd", b"lz4", b"none", b"\xff"))


@cache
def _bomb() -> bytes:
    """Return what zstd makes of 1.3 GB of zeros."""
    import zstandard

    packer = zstandard.ZstdCompressor(level=1).compressobj()
    zeros = bytes(1 << 24)
    return b"".join([*(packer.compress(zeros) for _ in range(80)), packer.flush()])
