"""NPZ files of NumPy: every array, read to where it stays."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from zipfile import ZIP_STORED, BadZipFile, ZipFile, ZipInfo

import numpy as np
from numpy.lib import format as npy

from nlfrf.shared.own_process import Found
from nlfrf.shared.transforms import blocks

__all__ = ["contents"]


LOCAL, SIZES = 30, 26  # bytes of the head of a member in its place, and where the lengths of its two texts stand
LARGE = 1 << 20  # bytes from which it is worth not to read them twice


def contents(path: Path) -> Found:
    """Arrays by name; those that are not compressed without a copy on the way, held against their checksum."""
    arrays: dict[str, np.ndarray] = {}
    with path.open("rb") as stream, ZipFile(stream) as archive, np.load(path, allow_pickle=False) as loaded:
        for member in archive.infolist():
            name = member.filename.removesuffix(".npy")
            plain = member.compress_type == ZIP_STORED and member.file_size == member.compress_size > LARGE
            array = stored(path, member) if plain else None
            arrays[name] = loaded[name] if array is None else array
    return arrays, {}, {}, {}


def stored(path: Path, member: ZipInfo) -> np.ndarray | None:
    """An array that lies in the file as it is; None where it is of a kind that NumPy had better read."""
    with path.open("rb") as stream:
        stream.seek(member.header_offset + SIZES)
        begin = member.header_offset + LOCAL + sum(struct.unpack("<2H", stream.read(4)))
        stream.seek(begin)
        if npy.read_magic(stream) != (1, 0):
            return None
        shape, by_columns, kind = npy.read_array_header_1_0(stream)
        head = stream.tell() - begin
        count = int(np.prod(shape, dtype=object))
        if kind.hasobject or head + count * kind.itemsize != member.file_size:
            return None
        stream.seek(begin)
        check = zlib.crc32(stream.read(head))
        flat = np.fromfile(stream, kind, count)
    for some in blocks(flat.size):
        check = zlib.crc32(flat[some].data, check)
    if flat.size < count or check != member.CRC:
        raise BadZipFile(f"Bad CRC-32 for file {member.filename!r}")
    return flat.reshape(shape, order="F" if by_columns else "C")
