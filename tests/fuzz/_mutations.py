"""Seeded damage: to bytes, text, trees of plain values, XML, archives of arrays. The same generator, the same input."""

from __future__ import annotations

import copy
import io
import json
import re
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

Random = np.random.Generator

NUMBERS = (
    "nan", ".nan", "inf", "-inf", ".inf", "1e308", "-1e308", "1e999", "-0", "-0.0", "0", "1e-320", "9" * 60,
    "-" + "9" * 60,
    "1e30", "-1", "2147483648", "9223372036854775808", "", "025", "0x1F", "0o17", "1_000", "12:30", "1,5", "١٢", "--1",
    "1e", "+.5", "true", "null", "~",
)  # fmt: skip
WORDS = (
    "", " ", "\x00", "~", "~nosuchuser", "~nosuchuser/a.urdf", "..", "/", "/dev/null", "/proc/self/mem", "é" * 40,
    "\ud7ff",
    "\U0001f9be", "x" * 5000, "%s%n", "{0}", "[/]", "[bold]", "a: b", "- a", "&a *a", "!!python/object:os.system", "<<",
    "\ufeff", "\r", "\t", "'", '"', "nan", "null", "true", "package://nowhere/a.stl", "lee1991", "sin(",
)  # fmt: skip
VALUES: tuple[Any, ...] = (
    float("nan"), float("inf"), float("-inf"), 1e308, -1e308, 1e30, -0.0, 0, 1, -1, 5e-324, 1e-12, 0.5, 10**60,
    -(10**60), 2**63,
    2**31, 10**9, True, False, None, [], {}, [[]], [None], {"a": 1}, [1.0, 2.0], [1.0, 2.0, 3.0], [float("nan")] * 3,
    "025", "1.0",
)  # fmt: skip
NUMBER = re.compile(rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
TOKEN = re.compile(rb"\w+|[^\w\s]")


def pick(random: Random, choices: Sequence[Any]) -> Any:
    return choices[int(random.integers(len(choices)))]


def times(random: Random) -> int:
    """How many mutations: mostly one."""
    return int(random.choice([1, 1, 1, 2, 3]))


def damaged_bytes(random: Random, data: bytes) -> bytes:
    """Bits flipped, bytes cut, doubled, filled in or exchanged."""
    out = bytearray(data)
    for _ in range(times(random)):
        at, length = int(random.integers(len(out) + 1)), int(2 ** random.uniform(0, 8))
        match int(random.integers(6)):
            case 0 if at < len(out):
                out[at] ^= 1 << int(random.integers(8))
            case 1:
                del out[at:]
            case 2:
                del out[at : at + length]
            case 3:
                out[at:at] = out[at : at + length]
            case 4:
                out[at : at + length] = random.bytes(length)
            case _:
                out[at : at + length] = pick(random, (b"\x00", b"\xff", b"\x80")) * length
    return bytes(out)


def damaged_text(random: Random, data: bytes) -> bytes:
    """Numbers, words and lines replaced, doubled, dropped, exchanged; now and then bytes."""
    for _ in range(times(random)):
        match int(random.integers(8)):
            case 0:
                data = damaged_bytes(random, data)
            case 1 | 2 | 3:
                data = _replaced(random, data, NUMBER, NUMBERS)
            case 4:
                data = _replaced(random, data, TOKEN, WORDS)
            case 5:
                data = _exchanged_tokens(random, data)
            case _:
                data = _lines(random, data)
    return data


def _replaced(random: Random, data: bytes, what: re.Pattern[bytes], by: Sequence[str]) -> bytes:
    found = list(what.finditer(data))
    if not found:
        return data
    start, end = pick(random, found).span()
    word: str = pick(random, by)
    return data[:start] + word.encode("utf-8", "surrogatepass") + data[end:]


def _exchanged_tokens(random: Random, data: bytes) -> bytes:
    found = list(TOKEN.finditer(data))
    if len(found) < 2:
        return data
    one, other = sorted(random.choice(len(found), 2, replace=False).tolist())
    (a, b), (c, d) = found[one].span(), found[other].span()
    return data[:a] + data[c:d] + data[b:c] + data[a:b] + data[d:]


def _lines(random: Random, data: bytes) -> bytes:
    lines = data.splitlines(keepends=True) or [b""]
    at, to = (int(random.integers(len(lines))) for _ in range(2))
    match int(random.integers(4)):
        case 0:
            del lines[at]
        case 1:
            lines.insert(to, lines[at])
        case 2:
            lines.insert(to, lines.pop(at))
        case _:
            lines[at] = pick(random, (b"  ", b"\t", b" ")) + lines[at]
    return b"".join(lines)


Place = tuple[Any, Any]  # a mapping or list, and one of its keys


def _places(tree: Any) -> list[Place]:
    inner = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    found: list[Place] = []
    for key, value in inner:
        found.append((tree, key))
        found.extend(_places(value))
    return found


def damaged_tree(random: Random, tree: Any, values: Sequence[Any] = (*VALUES, *WORDS)) -> Any:
    """Values replaced, parts dropped, doubled, moved, renamed, put into lists."""
    root = {"": copy.deepcopy(tree)}
    for _ in range(times(random)):
        where, key = pick(random, _places(root))
        other, its = pick(random, _places(root))
        match int(random.integers(8)):
            case 0 | 1 | 2 | 3:
                where[key] = pick(random, values)
            case 4 if where is not root:
                del where[key]
            case 5:
                where[key] = copy.deepcopy(other[its])
            case 6 if isinstance(where, list):
                where.insert(int(random.integers(len(where) + 1)), copy.deepcopy(where[key]))
            case 6 if where is not root:
                where[f"{key}{pick(random, ('', '_', 's', 'x' * 300))}"] = where.pop(key)
            case _:
                where[key] = [copy.deepcopy(where[key]) for _ in range(int(random.integers(1, 3)))]
    return root[""]


def damaged_yaml(random: Random, data: bytes) -> bytes:
    """As text, or as what it says."""
    if random.random() < 0.5:
        return damaged_text(random, data)
    tree = damaged_tree(random, yaml.safe_load(data))
    flow = bool(random.random() < 0.3)
    return yaml.safe_dump(tree, sort_keys=False, allow_unicode=True, default_flow_style=flow).encode("utf-8", "replace")


def damaged_json(random: Random, data: bytes) -> bytes:
    """As text, or as what it says."""
    if random.random() < 0.5:
        return damaged_text(random, data)
    return json.dumps(damaged_tree(random, json.loads(data))).encode()


def damaged_xml(random: Random, data: bytes) -> bytes:
    """As text, or its elements and attributes: replaced, dropped, doubled, moved, renamed."""
    if random.random() < 0.35:
        return damaged_text(random, data)
    root = ET.fromstring(data)
    for _ in range(times(random)):
        _damage_element(random, root)
    return ET.tostring(root)


def _damage_element(random: Random, root: ET.Element) -> None:
    parents = [(parent, child) for parent in root.iter() for child in parent]
    parent, child = pick(random, parents)
    named = [(element, name) for element in root.iter() for name in element.attrib]
    match int(random.integers(9)):
        case 0 | 1 | 2 | 3:
            element, name = pick(random, named)
            element.set(name, _attribute(random, element.get(name, "")))
        case 4:
            element, name = pick(random, named)
            del element.attrib[name]
        case 5:
            parent.remove(child)
        case 6:
            pick(random, [parent, *list(root.iter())]).append(copy.deepcopy(child))
        case 7:
            parent.remove(child)
            pick(random, [one for one in root.iter() if one not in set(child.iter())]).append(child)
        case _:
            child.tag = pick(
                random, [one.tag for one in root.iter()] + ["capsule", "mesh", "mimic", "box", "x", "xacro"]
            )


def _attribute(random: Random, value: str) -> str:
    """One of its numbers replaced, all dropped but some, or a word instead."""
    numbers = value.split() or [""]
    match int(random.integers(4)):
        case 0 | 1:
            numbers[int(random.integers(len(numbers)))] = pick(random, NUMBERS)
        case 2:
            numbers = numbers[: int(random.integers(len(numbers) + 1))] + numbers[: int(random.integers(2))]
        case _:
            return "".join(one for one in pick(random, WORDS) if one.isprintable())
    return " ".join(numbers)


def damaged_npz(random: Random, data: bytes, heads: Sequence[str]) -> bytes:
    """As bytes, or its arrays: hostile numbers, other shapes and types, dropped, doubled, more than they say; its JSON.

    Args:
        random: Draws.
        data: The archive.
        heads: Names of arrays that hold JSON.
    """
    if random.random() < 0.3:
        return damaged_bytes(random, data)
    with np.load(io.BytesIO(data)) as archive:
        arrays: dict[str, NDArray[Any]] = {name: archive[name] for name in archive.files}
    for _ in range(times(random)):
        name = pick(random, heads if random.random() < 0.4 else list(arrays))
        if name not in arrays:
            continue
        if name in heads and random.random() < 0.8:
            arrays[name] = _damaged_head(random, arrays[name])
        else:
            _damage_array(random, arrays, name)
    if random.random() < 0.1:
        return _bomb(random, arrays)
    out = io.BytesIO()
    pick(random, (np.savez, np.savez_compressed))(out, **{str(name): array for name, array in arrays.items()})
    return out.getvalue()


def _damaged_head(random: Random, head: NDArray[Any]) -> NDArray[Any]:
    try:
        return np.frombuffer(damaged_json(random, head.tobytes()), dtype=np.uint8)
    except ValueError:  # no longer JSON
        return head[: len(head) // 2]


def _damage_array(random: Random, arrays: dict[str, NDArray[Any]], name: str) -> None:
    array = arrays[name]
    match int(random.integers(7)):
        case 0 | 1 if array.size and array.dtype.kind == "f":
            array = array.copy()
            array.reshape(-1)[int(random.integers(array.size))] = pick(
                random, (np.nan, np.inf, -np.inf, 3e38, -1.0, 0.0)
            )
            arrays[name] = array
        case 2 if array.dtype.kind in "fiu":
            arrays[name] = array.astype(pick(random, ("f2", "f4", "f8", "i8", "u1", "c16", "U3", "?")))
        case 3:
            shapes = (
                [array[:0], array[:-1], array[None], array.reshape(-1), np.repeat(array, 2, 0)] if array.ndim else []
            )
            arrays[name] = pick(random, [*shapes, np.zeros(()), np.zeros((0, 3)), array.T])
        case 4:
            del arrays[name]
        case 5:
            arrays[f"{name}{pick(random, ('_', '0', '/../x'))}"] = array
        case _:
            arrays[name] = arrays[pick(random, list(arrays))]


def _bomb(random: Random, arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """One array is said to be much larger than the file: its zeros are packed, or are not there."""
    out, chosen = io.BytesIO(), pick(random, list(arrays))
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in arrays.items():
            member = io.BytesIO()
            if name == chosen:
                count = int(pick(random, (2**22, 2**28, 2**31, 2**40, 2**62, -1)))
                np.lib.format.write_array_header_1_0(
                    member, {"descr": "<f4", "fortran_order": False, "shape": (count,)}
                )
                member.write(b"\x00" * (2**24 if count == 2**22 else 64))
            else:
                np.lib.format.write_array(member, array)
            archive.writestr(f"{name}.npy", member.getvalue())
    return out.getvalue()


Damage = Callable[[Random, bytes], bytes]


def damaged_copies(whole: bytes, random: Random, count: int) -> Iterator[bytes]:
    """So many copies of a file, each with some bits flipped, cut, longer, or cut and longer; also in its last bytes."""
    for k in range(count):
        place = int(random.integers(len(whole))) if k % 8 else len(whole) - 1 - int(random.integers(64))
        flipped = bytearray(whole)
        for _ in range(1 + k % 3):
            flipped[(place + int(random.integers(3))) % len(whole)] ^= 1 << int(random.integers(8))
        damaged = (bytes(flipped), whole[:place], whole + b"\0" * (1 + k % 7), whole[:place] + b"x")[k % 4]
        if damaged != whole:
            yield damaged
