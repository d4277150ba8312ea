"""One small experiment in the formats of others: a force u [N], a position y [mm], 1000 Hz, three
periods of 250.
"""

import numpy as np
import scipy.io

import nlfrf

FS, N, P = 1000, 250, 3
MS = nlfrf.multisine(fs=FS, n_samples=N, f_min=4, f_max=200, rng=3)
U = np.round(np.tile(MS.u[0], P), 6)
Y = np.round(0.4 * U + 0.02 * U**3, 6)
T = np.arange(U.size) / FS


def write_csv(path):
    np.savetxt(
        path,
        np.column_stack([T, U, Y]),
        delimiter=";",
        header="t;u;y\ns;N;mm",
        comments="",
        fmt="%.6f",
    )


def write_lvm(path):
    path.write_text("\n".join(lvm()))


def lvm(x_columns="One", decimal="."):
    """Lines of a LabVIEW measurement file."""
    head = [
        "LabVIEW Measurement\t",
        "Writer_Version\t2",
        "Separator\tTab",
        f"Decimal_Separator\t{decimal}",
    ]
    head += [
        f"X_Columns\t{x_columns}",
        "Time_Pref\tRelative",
        "***End_of_Header***\t",
        "\t",
        "Channels\t2\t\t",
    ]
    head += [
        "Samples\t750\t750\t",
        "Y_Unit_Label\tN\tmm\t",
        f"Delta_X\t0{decimal}001\t0{decimal}001\t",
    ]
    head += ["***End_of_Header***\t\t\t", "X_Value\tu\ty\tComment"]
    first = [""] * U.size if x_columns == "No" else [f"{t:.6f}" for t in T]
    rows = [
        f"{t}\t{u:.6f}\t{y:.6f}".replace(".", decimal) for t, u, y in zip(first, U, Y, strict=True)
    ]
    return [*head, *rows]


def write_tdms(path):
    import nptdms

    about = {"wf_increment": 1 / FS, "wf_start_offset": 0.0, "wf_samples": U.size}
    channels = [
        nptdms.ChannelObject("run", "u", U, properties={**about, "unit_string": "N"}),
        nptdms.ChannelObject("run", "y", Y, properties={**about, "NI_UnitDescription": "mm"}),
        nptdms.ChannelObject(
            "slow", "temperature", Y[::10], properties=about | {"wf_increment": 10 / FS}
        ),
    ]
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment(channels)


def write_mdf(path):
    import asammdf

    with asammdf.MDF(version="3.30" if path.suffix == ".dat" else "4.10") as file:
        file.append(
            [asammdf.Signal(U, T, name="u", unit="N"), asammdf.Signal(Y, T, name="y", unit="mm")]
        )
        file.append([asammdf.Signal(Y[::10], T[::10], name="temperature", unit="K")])
        written = file.save(path.with_suffix(".mdf"), overwrite=True)
    written.rename(path)


def write_uff(path):
    import pyuff

    file = pyuff.UFF(str(path))
    for name, data, unit in (("u", U, "N"), ("y", Y, "mm")):
        about = dict(binary=0, func_type=1, rsp_node=1, rsp_dir=3, ref_dir=0, ref_node=0, id1=name)
        about |= dict(
            abscissa_spacing=1, abscissa_min=0.0, abscissa_inc=1 / FS, ordinate_axis_units_lab=unit
        )
        about |= dict(
            rsp_ent_name="NONE",
            ref_ent_name="NONE",
            ord_data_type=4,
            num_pts=U.size,
            data=data,
            x=T,
        )
        about |= dict(
            abscissa_spec_data_type=17, ordinate_spec_data_type=13, orddenom_spec_data_type=0
        )
        file.write_sets(pyuff.prepare_58(**about), "add")


def write_arrow(path, moments=False):
    import pyarrow as pa
    from pyarrow import feather, parquet

    t = (
        np.datetime64("2026-11-22T10:00", "ns") + (1e9 * T).astype("timedelta64[ns]")
        if moments
        else T
    )
    named = [("time", t, "s"), ("u", U, "N"), ("y", Y, "mm"), ("state", ["run"] * U.size, "")]
    fields = [pa.field(n, pa.array(a).type, metadata={"unit": unit}) for n, a, unit in named]
    table = pa.Table.from_arrays([pa.array(a) for _, a, _ in named], schema=pa.schema(fields))
    (parquet.write_table if path.suffix == ".parquet" else feather.write_feather)(table, path)


def write_wav(path):
    from scipy.io import wavfile

    wavfile.write(path, FS, (np.column_stack([U, Y]) / 8).astype(np.float32))


def write_hdf5(path):
    import h5py

    table = np.zeros(U.size, dtype=[("u", float), ("y", float), ("state", "i4")])
    table["u"], table["y"] = U, Y
    with h5py.File(path, "w") as file:
        file["table"] = table
        file.attrs["fs"] = FS
        group = file.create_group("fast")
        group.attrs["sample_rate"] = 2.0 * FS
        for name, data, unit in (("force", U, "N"), ("position", Y, "mm")):
            group[name] = data
            group[name].attrs["units"] = unit
            group[name].attrs["dt"] = 1 / FS
        file["matrix"] = np.column_stack([U, Y])
        file["matrix"].attrs["columns"] = ["current", "angle"]


def write_mat(path):
    scipy.io.savemat(path, {"run": {"u": U, "y": Y}, "fs": FS})


#: Format -> who writes it, and what to load of it where it is not u and y.
WRITERS = {
    ".csv": (write_csv, {}),
    ".lvm": (write_lvm, {}),
    ".tdms": (write_tdms, {}),
    ".uff": (write_uff, {}),
    ".wav": (write_wav, {"u": "ch1", "y": "ch2"}),
    ".mf4": (write_mdf, {}),
    ".dat": (write_mdf, {}),
    ".parquet": (write_arrow, {}),
    ".feather": (write_arrow, {}),
    ".h5": (write_hdf5, {}),
    ".mat": (write_mat, {}),
}


def damaged(content, rng):
    """The bytes of a file, cut short, with some flipped, or with a stretch moved."""
    raw = bytearray(content)
    how = rng.integers(3)
    if how == 0:
        return bytes(raw[: rng.integers(len(raw))])
    if how == 1:
        for place in rng.integers(len(raw), size=rng.integers(1, 20)):
            raw[place] ^= 1 << rng.integers(8)
        return bytes(raw)
    a, b = np.sort(rng.integers(len(raw), size=2))
    return bytes(raw[:a] + raw[b:] + raw[a:b])


def fuzz(suffix, folder, *, n, seed):
    """Load n damaged files of one format, and count the refused; all but a ValueError in one line
    is let through.
    """
    rng = np.random.default_rng(seed)
    write, names = WRITERS[suffix]
    write(folder / f"whole{suffix}")
    content = (folder / f"whole{suffix}").read_bytes()
    path = folder / f"damaged{suffix}"
    refused = 0
    for _ in range(n):
        path.write_bytes(damaged(content, rng))
        try:
            nlfrf.load_record(path, n_samples=N, fs=FS, **names)
        except ValueError as error:
            refused += 1
            if "\n" in str(error):
                raise AssertionError("a refusal has one line") from error
    return refused
