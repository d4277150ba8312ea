"""NPZ files of NumPy: every array, read without a copy where possible.

Each array is a header and its numbers, compressed or not. The header states the number of entries,
the archive the number of bytes. If the two contradict each other, or exceed the limit of
`require_size`, nothing is unpacked.
"""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import IO, NamedTuple
from zipfile import ZIP_STORED, BadZipFile, ZipFile, ZipInfo

import numpy as np
from numpy.lib import format as npy

from nlfrf._base.numbers import iterate_blocks
from nlfrf._base.own_process import Contents, require_size

_LARGE_MEMBER = 1 << 20  # bytes above which a second copy is avoided
_HEADER_READERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


class _Header(NamedTuple):
    """Header of a member, with its own length in bytes."""

    shape: tuple[int, ...]
    by_columns: bool
    kind: np.dtype
    length: int

    @property
    def n_numbers(self) -> int:
        """Number of entries of the array."""
        return int(np.prod(self.shape, dtype=object))


def contents(path: Path) -> Contents:
    """Return arrays by name; uncompressed ones without an extra copy, checked against their
    checksum.
    """
    notes: dict[str, str] = {}
    arrays: dict[str, np.ndarray] = {}
    with path.open("rb") as stream, ZipFile(stream) as archive:
        members = archive.infolist()
        require_size(sum(member.file_size for member in members), path.stat().st_size)
        headers: dict[str, tuple[ZipInfo, _Header]] = {}
        for member in members:
            name = member.filename.removesuffix(".npy")
            if name in headers or name in notes:
                raise ValueError(f"it holds {name!r} twice")
            with archive.open(member) as opened:
                if opened.read(6) == npy.MAGIC_PREFIX:
                    header = _read_header(opened)
                else:
                    header = None
            if header is None:
                notes[name] = "is no array of NumPy"
            elif header.kind.hasobject:
                raise ValueError(f"{name!r} holds Python objects, and pickles are never read")
            elif (
                header.length + header.n_numbers * header.kind.itemsize != member.file_size
                or header.kind.itemsize == 0
            ):
                raise ValueError(
                    f"{name!r} has the shape {header.shape} in its header, and another number of"
                    " entries"
                )
            else:
                headers[name] = member, header
        for name, (member, header) in headers.items():
            plain = (
                member.compress_type == ZIP_STORED
                and member.file_size == member.compress_size > _LARGE_MEMBER
            )
            arrays[name] = (
                _map_member(path, archive, member=member, header=header)
                if plain
                else _read_member(archive, member)
            )
    return arrays, {}, {}, notes


def _read_header(stream: IO[bytes]) -> _Header | None:
    """Return the header of a member behind its first bytes; None for a version used by tables
    only.
    """
    version = tuple(stream.read(2))
    if version not in _HEADER_READERS:
        return None
    shape, by_columns, kind = _HEADER_READERS[version](stream)
    if min(shape, default=1) < 0:
        raise ValueError(f"a shape must be of whole numbers from zero, got {shape}")
    return _Header(shape, by_columns, kind, stream.tell())


def _read_member(archive: ZipFile, member: ZipInfo) -> np.ndarray:
    """Return an array as NumPy reads it; the archive checks its checksum."""
    with archive.open(member) as stream:
        return npy.read_array(stream, allow_pickle=False)


def _map_member(path: Path, archive: ZipFile, *, member: ZipInfo, header: _Header) -> np.ndarray:
    """Return an array that lies uncompressed in the file."""
    with archive.open(member) as opened:
        head = opened.read(header.length)
    with path.open("rb") as stream:
        stream.seek(_member_offset(stream, member) + header.length)
        flat = np.fromfile(stream, header.kind, header.n_numbers)
    check = zlib.crc32(head)
    for some in iterate_blocks(flat.size):
        check = zlib.crc32(flat[some].data, check)
    if flat.size < header.n_numbers or check != member.CRC:
        raise BadZipFile(f"Bad CRC-32 for file {member.filename!r}")
    return flat.reshape(header.shape, order="F" if header.by_columns else "C")


def _member_offset(stream: IO[bytes], member: ZipInfo) -> int:
    """Return the offset of the bytes of a member, behind its local head of 30 bytes, a name and an
    extra field.
    """
    stream.seek(member.header_offset + 26)
    lengths = stream.read(4)
    return (
        member.header_offset
        + 30
        + int.from_bytes(lengths[:2], "little")
        + int.from_bytes(lengths[2:], "little")
    )
