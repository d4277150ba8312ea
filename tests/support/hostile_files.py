"""Measurement files made to do harm: to fill the memory, to show other files, to command the
terminal, to run code.
"""

import io
import re
import struct
import warnings
import zipfile
import zlib

import numpy as np
from numpy.lib import format as npy

from nlfrf._base import own_process
from nlfrf.io.measurement_files import read_channels
from tests.support import measurement_files as files

SECRET = 7777.0 + np.arange(64)  # numbers that stand in another file of the machine
#: Clears a screen, sets a title, turns the direction of what follows, forges a line, ends a page.
NAMES = (
    "u\x1b[2J",
    "\x1b]0;owned\x07y",
    "u\u202egpj.",
    "u\nall is well",
    "y\r\x9b31m",
    "</script><script>alert(1)",
    "a\x00b",
)
COMMANDS = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)


def npz_of(path, members, method=zipfile.ZIP_DEFLATED):
    """An archive of (name, bytes), names as often as they are given."""
    with zipfile.ZipFile(path, "w", method, compresslevel=1) as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name, content in members:
            archive.writestr(name, content)
    return path


def member(array):
    """The bytes of an array."""
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def header(shape, kind="<f8"):
    """A header alone, of any shape and type."""
    stream = io.BytesIO()
    npy.write_array_header_1_0(stream, {"shape": shape, "fortran_order": False, "descr": kind})
    return stream.getvalue()


def bomb(path, gigabytes, whole=True):
    """An NPZ of one array of zeros, a thousandth of its size: one deflated block, over and over.

    Whole with its checksum, which takes a while.
    """
    block = bytes(1 << 20)
    n = int(gigabytes * 1e9) >> 20
    first = header(((n << 20) // 8,))
    pack = zlib.compressobj(9, wbits=-15)
    begin = pack.compress(first) + pack.flush(zlib.Z_FULL_FLUSH)
    again = pack.compress(block) + pack.flush(zlib.Z_FULL_FLUSH)
    check = zlib.crc32(first)
    for _ in range(n if whole else 0):
        check = zlib.crc32(block, check)
    packed = begin + n * again + pack.flush()
    size = len(first) + (n << 20)
    about = struct.pack("<5H3I2H", 20, 0, 8, 0, 33, check, len(packed), size, 5, 0)
    local = b"PK\x03\x04" + about + b"u.npy"
    central = (
        b"PK\x01\x02"
        + struct.pack("<H", 20)
        + about
        + struct.pack("<3H2I", 0, 0, 0, 0, 0)
        + b"u.npy"
    )
    end = b"PK\x05\x06" + struct.pack(
        "<4H2IH", 0, 0, 1, 1, len(central), len(local) + len(packed), 0
    )
    path.write_bytes(local + packed + central + end)
    return path


def npz_lies(folder, rng):
    """A header that contradicts its member: other shapes, types of no size, names twice, objects,
    no array at all.
    """
    u = member(np.arange(64.0))
    big = int(rng.integers(1, 1 << 40))
    attacks = [
        [("u.npy", header((big,)) + bytes(80))],
        [("u.npy", header((-8, -8)) + bytes(512))],
        [("u.npy", header((-1,)) + bytes(64))],
        [("u.npy", header((big, 0)))],
        [("u.npy", header((1 << 60,), "<U0")), ("y.npy", u)],
        [("u.npy", header((big,), "|V0")), ("y.npy", u)],
        [("u.npy", u), ("u.npy", member(-np.arange(64.0)))],
        [("u.npy", u), ("u", member(-np.arange(64.0)))],
        [("u.npy", u), ("notes.txt", b"read me")],
        [("u.npy", b"\x93NUMPY\x02\x00" + struct.pack("<I", 0xFFFFFF00) + bytes(1000))],
        [("u.npy", header((64,), "|O") + b"cos\nsystem\n(S'touch owned'\ntR.")],
        [("u.npy", u + bytes(rng.integers(1, 64)))],
        [("u.npy", u[: -int(rng.integers(1, 64))])],
    ]
    method = zipfile.ZIP_STORED if rng.integers(2) else zipfile.ZIP_DEFLATED
    return npz_of(folder / "lies.npz", attacks[rng.integers(len(attacks))], method)


def npz_expands(folder, rng):
    """Zeros, in one member or in many."""
    n = int(rng.integers(1, 4))
    zeros = member(np.zeros(int((own_process.UNPACKED + (40 << 20)) / n) // 8))
    return npz_of(folder / "zeros.npz", [(f"u{i}.npy", zeros) for i in range(n)])


def hdf5_expands(folder, rng):
    """Datasets that were never written, compressed or not: their shape is all there is of them."""
    import h5py

    with h5py.File(folder / "zeros.h5", "w") as file:
        for i in range(int(rng.integers(1, 4))):
            shape = (int(rng.integers(1 << 28, 1 << 44)),)
            file.create_dataset(f"u{i}", shape, dtype="f8", chunks=(1 << 16,), compression="gzip")
    return folder / "zeros.h5"


def table_expands(folder, rng):
    """A few wide rows and many short ones, which a table fills up."""
    width = int(rng.integers(3000, 6000))
    wide = ",".join(["1"] * width) + "\n"
    path = folder / "short.csv"
    path.write_text(
        wide * (2 * (1 << 17) // len(wide)) + "1\n" * int(rng.integers(400_000, 800_000))
    )
    return path


def elsewhere(folder, rng):
    """HDF5, of MATLAB or not, whose numbers lie in other files: external storage, virtual datasets,
    links.
    """
    import h5py

    raw, other = folder / "secret.bin", folder / "secret.h5"
    raw.write_bytes(SECRET.tobytes())
    with h5py.File(other, "w") as file:
        file["s"] = SECRET
    matlab = bool(rng.integers(2))
    path = folder / f"elsewhere{'.mat' if matlab else '.h5'}"
    place = ["u", "a/b/u", "#refs#/u", "#subsystem#/u"][rng.integers(4)]
    with h5py.File(path, "w", userblock_size=512 if matlab else 0) as file:
        file["y"] = np.arange(64.0)
        way = rng.integers(4)
        if way == 0:
            file.create_dataset(place, (64,), dtype="f8", external=[(str(raw), 0, SECRET.nbytes)])
        elif way == 1:
            layout = h5py.VirtualLayout((64,), "f8")
            layout[:] = h5py.VirtualSource(str(other), "s", (64,))
            file.create_virtual_dataset(place, layout)
        elif way == 2:
            file[place] = h5py.ExternalLink(str(other), "s")
        else:  # by a link inside the file through one out of it
            file["other"] = h5py.ExternalLink(str(other), "/")
            file[place] = h5py.SoftLink("/other/s")
    if matlab:
        with path.open("r+b") as stream:
            stream.write(b"MATLAB 7.3 MAT-file, Platform: any")
    return path


def attached(folder, rng):
    """MDF whose channel has another file as its attachment; TDMS with an index beside it that
    speaks of other data.
    """
    if rng.integers(2):
        return mdf_attached(folder)
    files.write_tdms(folder / "run.tdms")
    (folder / "run.tdms_index").write_bytes(
        b"TDSh" + (folder / "run.tdms").read_bytes()[4 : int(rng.integers(40, 200))]
    )
    return folder / "run.tdms"


def mdf_attached(folder):
    """An MDF file whose channel has another file as its attachment: saved inside, and then said to
    be outside.
    """
    import asammdf

    secret = folder / "secret.dbc"
    secret.write_bytes(SECRET.tobytes())
    with asammdf.MDF(version="4.10") as file:
        inside = (SECRET.tobytes(), secret, b"")
        file.append([asammdf.Signal(files.U, files.T, name="u", unit="N", attachment=inside)])
        path = file.save(folder / "attached.mf4", overwrite=True)
    content = bytearray(path.read_bytes())
    content[content.index(b"##AT") + 56] &= (
        0xFE  # the flag behind a head of 24 bytes and four links
    )
    path.write_bytes(content)
    return path


def named(folder, rng):
    """Names and units that command a terminal, in every kind of file that takes them."""
    u, y = (f"{NAMES[k]}{i}" for i, k in enumerate(rng.integers(len(NAMES), size=2)))
    unit = NAMES[rng.integers(len(NAMES))]
    suffix = (".npz", ".csv", ".h5", ".parquet", ".tdms", ".uff", ".mf4", ".lvm")[rng.integers(8)]
    path = folder / f"named{suffix}"
    if suffix == ".npz":
        np.savez(
            path,
            **{
                u.replace("\0", ""): files.U,
                y.replace("\0", ""): files.Y,
                "u_unit": np.array(unit),
            },
        )
    elif suffix in (".csv", ".lvm"):
        quoted = ['"' + name.replace('"', "") + '"' for name in (u, y)]
        path.write_text("\n".join(["t," + ",".join(quoted), *files_rows()]), encoding="utf-8")
    elif suffix == ".h5":
        import h5py

        with h5py.File(path, "w") as file:
            for name, data in ((u, files.U), (y, files.Y)):
                file[name.replace("\0", "").replace("/", "_")] = data
                file[name.replace("\0", "").replace("/", "_")].attrs["unit"] = unit.replace(
                    "\0", ""
                )
    elif suffix == ".parquet":
        import pyarrow as pa
        from pyarrow import parquet

        fields = [pa.field(name, pa.float64(), metadata={"unit": unit}) for name in (u, y)]
        parquet.write_table(
            pa.Table.from_arrays([pa.array(files.U), pa.array(files.Y)], schema=pa.schema(fields)),
            path,
        )
    elif suffix == ".tdms":
        import nptdms

        with nptdms.TdmsWriter(str(path)) as writer:
            about = {"wf_increment": 1e-3, "unit_string": unit}
            writer.write_segment(
                [nptdms.ChannelObject("run", name, files.U, properties=about) for name in (u, y)]
            )
    elif suffix == ".mf4":
        import asammdf

        with asammdf.MDF(version="4.10") as file:
            file.append([asammdf.Signal(files.U, files.T, name=name, unit=unit) for name in (u, y)])
            return file.save(path, overwrite=True)
    else:
        files.write_uff(path)
        path.write_bytes(
            path.read_bytes().replace(b"\nu ", b"\nu\x1b[2J ").replace(b" N ", b" \x1b[ ")
        )
    return path


def files_rows():
    """The rows of the usual experiment."""
    return [f"{t:.6f},{u:.6f},{y:.6f}" for t, u, y in zip(files.T, files.U, files.Y, strict=True)]


#: Family -> who makes one of its files in a folder, by a generator.
FAMILIES = {
    "npz lies": npz_lies,
    "npz expands": npz_expands,
    "hdf5 expands": hdf5_expands,
    "table expands": table_expands,
    "elsewhere": elsewhere,
    "attached": attached,
    "named": named,
}


def harm_of(path):
    """What reading a file did that it must not: nothing where it was refused in one clean line, or
    read cleanly.
    """
    try:
        found = read_channels(path)
    except ValueError as error:
        said = str(error)
        return f"refused in {said!r}" * bool("\n" in said or COMMANDS.search(said))
    texts = [
        *found.arrays,
        *found.units,
        *found.units.values(),
        *found.notes,
        *found.notes.values(),
    ]
    texts += [found.text(name) for name in found.arrays]
    if wrong := [one for one in texts if "\n" in one or COMMANDS.search(one)]:
        return f"told {wrong[:3]}"
    size = sum(array.nbytes for array in found.arrays.values())
    if size > own_process.UNPACKED + own_process.FACTOR * path.stat().st_size:
        return f"read {size} bytes"
    numbers = [
        array
        for array in found.arrays.values()
        if array.dtype.kind == "f" and array.shape == SECRET.shape
    ]
    return "showed another file" * any(np.array_equal(array, SECRET) for array in numbers)
