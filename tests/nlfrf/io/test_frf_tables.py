"""FRFs in files of analysers: what is read, what is asked for, what inspect says, and the command
that it prints.
"""

import shlex

import numpy as np
import pytest

import nlfrf
from benchmarks import names
from tests.nlfrf.test_cli import nlfrf_command  # noqa: F401 (a fixture)
from tests.robust.test_cli import robust_command  # noqa: F401 (a fixture)
from tests.support.measurement_files import write_uff
from tests.support.printed import unwrapped

F = np.geomspace(0.5, 200, 60)
G = 3 / (1 - (F / 40) ** 2 + 0.1j * F / 40) * np.exp(-2j * np.pi * F * 0.004)
DB, WRAPPED, UNWRAPPED = (
    20 * np.log10(np.abs(G)),
    np.degrees(np.angle(G)),
    np.degrees(np.unwrap(np.angle(G))),
)
COHERENCE = 1 - 1e-4 * F


def table(header, *columns, sep=",", decimal="."):
    rows = (
        sep.join(f"{x:.9g}" for x in row).replace(".", decimal)
        for row in zip(*columns, strict=True)
    )
    return "\n".join((header, *rows, ""))


WAVEFORMS = "Frequency (Hz),Channel 1 Magnitude (dB),Channel 2 Magnitude (dB),Channel 2 Phase"
TABLES = {
    "Keysight": table(
        "#,Frequency (Hz),Amplitude (Vpp),Gain (dB),Phase (°)", F, F, 2 + 0 * F, DB, WRAPPED
    ),
    "Rigol": table("Freq(Hz),Gain(dB),Phase(°)", F, DB, WRAPPED),
    "Siglent": table(
        "Model Number,SDS\nSweep Type,Simple\n\nFrequency(Hz),CH2 Amplitude(dB),CH2 Phase(Deg)",
        F,
        DB,
        WRAPPED,
    ),
    "Rohde": table(
        "Frequency in Hz,Gain in dB,Phase in °,Amplitude in Vpp", F, DB, WRAPPED, 1 + 0 * F
    ),
    "WaveForms": table(
        f"#Digilent WaveForms Network Analyzer\n\n{WAVEFORMS} (deg)", F, 0 * F - 0.01, DB, WRAPPED
    ),
    "WaveForms without a degree sign": table(f"{WAVEFORMS} (*)", F, 0 * F - 0.01, DB, UNWRAPPED),
    "Bode 100": table(
        'Frequency (Hz);"Trace 1: Gain: Real ";"Trace 1: Gain: Imaginary ";Trace 1: Gain: Magnitude'
        ' (dB);"Trace 2: Gain: Real ";"Trace 2: Gain: Imaginary ";Trace 2: Gain: Phase (°)',
        *(F, G.real, G.imag, DB, G.real, G.imag, WRAPPED),
        sep=";",
    ),
    "Bode 100 of two traces": table(
        "Frequency (Hz),Trace 1: Gain: Magnitude (dB),Trace 2: Gain: Phase (°)", F, DB, WRAPPED
    ),
    "Moku": table(
        "% Moku\n% Frequency (Hz), Channel 1 Magnitude (dB), Channel 1 Phase (deg)",
        F,
        DB,
        WRAPPED,
        sep=", ",
    ),
    "PicoScope": table(
        "Frequency Log(Hz), Gain (dB), Phase (deg)", np.log10(F), DB, UNWRAPPED, sep=", "
    ),
    "ELVIS": table("Frequency (Hz)\tGain (dB)\tPhase (deg)", F, DB, WRAPPED, sep="\t"),
    "names alone": table("f,dB,degrees", F, DB, WRAPPED),
    "ratio and radians": table("f,|G| [1],phase [rad]", F, np.abs(G), np.unwrap(np.angle(G))),
    "ratio and degrees": table("f,magnitude [V/V],phase deg", F, np.abs(G), WRAPPED),
    "small ratios": table("f,magnitude [1],phase [rad]", F, 1e-3 * np.abs(G), np.angle(G)),
    "real and imaginary": table("f,Re,Im", F, G.real, G.imag),
    "rad/s": table("omega [rad/s],Re G,Im G", 2 * np.pi * F, G.real, G.imag),
    "omega": table("omega,Re G,Im G", 2 * np.pi * F, G.real, G.imag),
    "French": table(
        "Frequence (rad/s),Gain (dB),Phase (deg),Reel,Imaginaire",
        2 * np.pi * F,
        DB,
        WRAPPED,
        G.real,
        G.imag,
    ),
    "units in names": table("frequency_hz,magnitude_db,phase_rad", F, DB, np.unwrap(np.angle(G))),
    "kHz": table("Frequency (kHz),Gain (dB),Phase (deg)", F / 1e3, DB, WRAPPED),
    "mHz": table("Frequency (mHz),Gain (dB),Phase (deg)", F * 1e3, DB, WRAPPED),
    "downwards": table("Frequency (Hz),Gain (dB),Phase (deg)", F[::-1], DB[::-1], WRAPPED[::-1]),
    "German": table("Frequenz [Hz];Betrag [dB];Phase [Grad]", F, DB, WRAPPED, sep=";", decimal=","),
    "row of units": table("f,gain,phase\nHz,dB,deg", F, DB, WRAPPED),
    "0 Hz": table(
        "f [Hz],Re,Im", np.append(0.0, F), np.append(3.0, G.real), np.append(0.0, G.imag)
    ),
}


def write(path, text):
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.filterwarnings("error")
def test_tables_of_analysers(name, tmp_path):
    bla = nlfrf.io.load_frf(write(tmp_path / "bode.csv", TABLES[name]), relative_std=0.02)
    np.testing.assert_allclose(bla.f, F, rtol=1e-7)
    factor = 1e-3 if name == "small ratios" else 1.0
    np.testing.assert_allclose(bla.G, factor * G, rtol=1e-6)
    np.testing.assert_allclose(np.sqrt(bla.var_total), 0.02 * np.abs(bla.G))
    found = nlfrf.inspect_file(tmp_path / "bode.csv")
    assert found.frf.startswith("FRF:   60 lines from 0.5 to 200 Hz in ")
    assert (found.u, found.y) == ("", "")


def test_units_coherence_and_deviations_come_from_the_file(tmp_path):
    path = write(
        tmp_path / "a.csv",
        table("f,gain,phase,coherence\nHz,m/N,deg,%", F, np.abs(G), WRAPPED, 100 * COHERENCE),
    )
    bla = nlfrf.io.load_frf(path, n_averages=21)
    assert bla.unit == "m/N"
    np.testing.assert_allclose(bla.var_total, 1e-4 * F / COHERENCE * np.abs(G) ** 2 / 20, rtol=1e-5)
    with pytest.raises(
        ValueError, match="n_averages must be given: a coherence gives a variance only with"
    ):
        nlfrf.io.load_frf(path)
    path = write(tmp_path / "b.csv", table("f,Re,Im,std", F, G.real, G.imag, 0.1 * np.abs(G)))
    np.testing.assert_allclose(
        nlfrf.io.load_frf(path).bound(), np.sqrt(-np.log(0.05)) * 0.1 * np.abs(G), rtol=1e-5
    )
    assert nlfrf.inspect_file(path).command.startswith(f"robust model {path} -o ")


def test_a_table_of_this_package_says_no_variance_by_its_parts(tmp_path):
    """Its columns of noise alone and of distortion alone are no deviation of G."""
    nlfrf.export_csv(nlfrf.bla_from_frf(F, G, std=0.1), tmp_path / "bla.csv")
    with pytest.raises(ValueError, match=r"relative_std must be given: .* shows no distortion"):
        nlfrf.io.load_frf(tmp_path / "bla.csv")


def test_one_of_several_channels_is_asked_for(tmp_path):
    names = "Frequency (Hz),CH2 Amplitude (dB),CH2 Phase (deg),CH3 Amplitude (dB),CH3 Phase (deg)"
    path = write(tmp_path / "two.csv", table(names, F, DB - 6, WRAPPED + 10, DB, WRAPPED))
    with pytest.raises(
        ValueError,
        match=r"channel must name one of the FRFs of 'two.csv', 'CH 2', 'CH 3'; got 'none'",
    ):
        nlfrf.io.load_frf(path, relative_std=0.02)
    np.testing.assert_allclose(
        nlfrf.io.load_frf(path, relative_std=0.02, channel="ch3").G, G, rtol=1e-6
    )
    with pytest.raises(ValueError, match=r"channel must name .*; got 'CH4'"):
        nlfrf.io.load_frf(path, relative_std=0.02, channel="CH4")
    assert "--channel 'CH 2'" in nlfrf.inspect_file(path).command


@pytest.mark.parametrize(
    ("text", "word", "true"),
    [
        (
            table("f,gain,phase [rad]", F, DB, np.angle(G)),
            "'gain' .* is taken for dB, not a ratio",
            G,
        ),
        (table("f,dB,phase", F, DB, WRAPPED), "'phase' .* for degrees, not radians", G),
        (
            table("Frequency,Re,Im", F, G.real, G.imag),
            "'Frequency' .* is taken for Hz, not rad/s",
            G,
        ),
        (
            table("f,dB,phase", F, 0 * F, -F / 20),
            "'phase' .* for degrees, not radians",
            np.exp(-1j * np.radians(F / 20)),
        ),
        (
            table("f,dB,phase", F, 0 * F, -F / 200),
            "'phase' .* for radians, not degrees",
            np.exp(-1j * F / 200),
        ),
    ],
)
def test_a_unit_that_is_not_stated_is_said(text, word, true, tmp_path):
    path = write(tmp_path / "bode.csv", text)
    with pytest.warns(nlfrf.DataWarning, match=word):
        bla = nlfrf.io.load_frf(path, relative_std=0.02)
    np.testing.assert_allclose(bla.G, true, rtol=1e-6)


#: Names of columns and what they hold, by which the table is that of G at F.
MEANT = {
    "a sign": ("f,Re,-Im", F, G.real, -G.imag),
    "a Unicode sign, after a unit": ("freq/Hz,Re(Z)/Ohm,\u2212Im(Z)/Ohm", F, G.real, -G.imag),
    "impedance": (
        "Frequency (Hz);Z' (Ω);-Z'' (Ω);Z (Ω);-Phase (°)",
        F,
        G.real,
        -G.imag,
        np.abs(G),
        -WRAPPED,
    ),
    "another impedance": (
        "f [Hz];Zreal;Zimag;Zmod [1];Zphz [deg]",
        F,
        G.real,
        G.imag,
        np.abs(G),
        WRAPPED,
    ),
    "lag": ("Frequency (Hz),Gain (dB),Phase lag (deg)", F, DB, -WRAPPED),
    "conjugate": ("f,Re,Im (conj)", F, G.real, -G.imag),
    "attenuation": ("f,Attenuation (dB),Phase (deg)", F, -DB, WRAPPED),
    "inverse": ("f,1/|G| [1],arg(1/G) [deg]", F, 1 / np.abs(G), -WRAPPED),
    "inverse by its parts": ("f,Re(1/G),Im(1/G)", F, (1 / G).real, (1 / G).imag),
    "neper": ("f,Gain (Np),Phase (deg)", F, np.log(np.abs(G)), WRAPPED),
    "bel, gon": ("f,Gain (B),Phase (gon)", F, DB / 10, WRAPPED / 0.9),
    "logarithm, turns": ("f,log10|G|,Phase (turns)", F, DB / 20, WRAPPED / 360),
    "20 log": ("f,20*log10|G|,Phase (pi rad)", F, DB, WRAPPED / 180),
    "squared": ("f,|G|²,Phase (mrad)", F, np.abs(G) ** 2, 1e3 * np.angle(G)),
    "percent": ("f,Gain (%),Phase (deg)", F, 100 * np.abs(G), WRAPPED),
    "one number is zero": ("f,Gain (V/V),Phase (deg)", F, np.abs(G) * (F < 199), WRAPPED),
    "rad/min": ("Frequency (rad/min),Gain (dB),Phase (deg)", 2 * np.pi * 60 * F, DB, WRAPPED),
    "rpm": ("f [rpm],dB,degrees", 60 * F, DB, WRAPPED),
    "ten hertz": ("Frequency (x10 Hz),Gain (dB),Phase (deg)", F / 10, DB, WRAPPED),
    "two units": ("f,Re [mm/N],Im [m/N]", F, 1e3 * G.real, G.imag),
    "network analyser": ('"Freq [Hz]","dB(S(2,1)) []","ang_deg(S(2,1)) [deg]"', F, DB, WRAPPED),
    "quantity behind": ("Freq(Hz),S21(REAL),S21(IMAG)", F, G.real, G.imag),
    "long words": (
        "Hz,Frequency Response Function Real,Frequency Response Function Imaginary",
        F,
        G.real,
        G.imag,
    ),
    "a margin beside": ("f,Gain (dB),Phase (deg),CH2 Gain (dB)", F, DB, WRAPPED, 0 * F),
    "German": ("Frequenz in Hz,Amplitudengang in dB,Phasengang in Grad", F, DB, WRAPPED),
    "glued": ("FreqHz,MagdB,PhaseDeg", F, DB, WRAPPED),
    "dB of a unit": ("f,Magnitude dB re 1 mm/N,Phase (deg)", F, DB + 60, WRAPPED),
    "viscoelastic": ("f,Storage modulus (Pa),Loss modulus (Pa)", F, G.real, G.imag),
}


@pytest.mark.parametrize("name", MEANT)
@pytest.mark.filterwarnings("error")
def test_names_are_parsed_whole(name, tmp_path):
    header, *columns = MEANT[name]
    path = write(tmp_path / "bode.csv", table(header, *columns, sep=";" if ";" in header else ","))
    bla = nlfrf.io.load_frf(path, relative_std=0.02)
    kept = F < 199 if name == "one number is zero" else F > 0
    np.testing.assert_allclose(bla.f, F[kept], rtol=1e-7)
    np.testing.assert_allclose(bla.G, G[kept], rtol=1e-6)


@pytest.mark.parametrize(
    ("header", "columns", "why"),
    [
        ("f,Gain (foo),Phase (deg)", (DB, WRAPPED), r"'foo' in 'Gain \(foo\)' is not known"),
        ("f,Gain (dB),Phase margin (deg)", (DB, WRAPPED), "'margin' in 'Phase margin"),
        (
            "f,Normalised gain (dB),Normalised phase (deg)",
            (DB, WRAPPED),
            "'Normalised' in 'Normalised gain",
        ),
        (
            "Frequency (rad/sample),Gain (dB),Phase (deg)",
            (DB, WRAPPED),
            "'rad/sample' in 'Frequency",
        ),
        (
            "Frequency (normalised),Gain (dB),Phase (deg)",
            (DB, WRAPPED),
            "'normalised' in 'Frequency",
        ),
        ("f,Gain (dB),Phase [grad]", (DB, WRAPPED), r"'grad' in 'Phase \[grad\]'"),
        (
            "f,gain,phase [deg]",
            (np.abs(G), WRAPPED),
            r"'gain' names no unit and may be in dB, or a ratio, \[1\]",
        ),
        (
            "f,Amplitude,Gain (dB),Phase (deg)",
            (0.5 + 0 * F, DB, WRAPPED),
            "'Gain .*' and 'Amplitude' may both be the magn",
        ),
        (
            "f,Re,Im,Magnitude (dB),Phase (deg)",
            (G.real, -G.imag, DB, WRAPPED),
            "'Re' and 'Im' contradict 'Magnitude",
        ),
        ("f,Re [m],Im [m/N]", (G.real, G.imag), "'Re .*' and 'Im .*' must be in one unit"),
        ("f,Re(1/G),Im(G)", (G.real, G.imag), "only one of .* belongs to an inverse"),
        (
            "f,omega,Re,Im",
            (7 * F, G.real, G.imag),
            "the frequencies 'f' and 'omega' contradict each other",
        ),
    ],
)
def test_names_that_are_not_understood_are_refused_with_the_option(header, columns, why, tmp_path):
    path = write(tmp_path / "bode.csv", table(header, F, *columns))
    with pytest.raises(
        ValueError, match=rf"^columns must describe those of 'bode.csv': {why}.*; as in '(f|mag|G)="
    ):
        nlfrf.io.load_frf(path, relative_std=0.02)
    assert "--columns COLUMNS" in nlfrf.inspect_file(path).command


@pytest.mark.parametrize(
    "name",
    [one * 4000 for one in ("a b ", "m/", "1/", "((", "Frequenz", "re(", "[ ")]
    + [" " * 9000 + "x"],
    ids=lambda name: name[:8],
)
def test_names_that_do_not_end_take_no_time(name, tmp_path):
    for header in (f"{name},mag [dB],phase [deg]", f"f [Hz],mag [{name}],phase [deg]"):
        path = write(tmp_path / "bode.csv", table(header, F, DB, WRAPPED))
        with pytest.raises(ValueError, match="must hold an FRF, by name"):
            nlfrf.io.load_frf(path, relative_std=0.02)
        assert not nlfrf.inspect_file(path).frf


def test_columns_are_said(tmp_path):
    path = write(
        tmp_path / "a.csv",
        "\n".join(f"{f:.9g};{g.real:.9g};{-g.imag:.9g}" for f, g in zip(F, G, strict=True)),
    )
    with pytest.raises(ValueError, match="or give columns, as in"):
        nlfrf.io.load_frf(path, relative_std=0.02)
    bla = nlfrf.io.load_frf(
        path, relative_std=0.02, columns="f=col1 [Hz], re=col2 [Ohm], im=-col3 [Ohm]"
    )
    np.testing.assert_allclose(bla.G, G, rtol=1e-6)
    path = write(
        tmp_path / "b.csv",
        table("f,Gain (foo),Phase (deg),Std (bar)", F, 1 / np.abs(G), WRAPPED, 0.1 * np.abs(G)),
    )
    bla = nlfrf.io.load_frf(
        path, columns="f=f, mag=1/Gain (foo) [1], phase=Phase, std=Std (bar) [1]"
    )
    np.testing.assert_allclose(bla.G, G, rtol=1e-6)
    np.testing.assert_allclose(np.sqrt(bla.var_total), 0.1 * np.abs(G), rtol=1e-6)
    for wrong in ("f=nothing, re=f", "x=f", "f=f [N]", "f"):
        with pytest.raises(
            ValueError,
            match=r"columns must be f, G, re, .* got '.*'; the columns of 'b.csv' are f, Gain",
        ):
            nlfrf.io.load_frf(path, relative_std=0.02, columns=wrong)


@pytest.mark.parametrize(
    ("name", "values", "factor"),
    [
        ("Std (dB)", 0.5, 10 ** (0.5 / 20) - 1),
        ("Std (%)", 3.0, 0.03),
        ("Std [1]", 0.1 * np.abs(G), 0.1),
        ("Std phase (deg)", 1.0, np.sqrt(2) * np.pi / 180),
        ("Std Gain (dB),Std Phase (deg)", 0.5, np.hypot(10 ** (0.5 / 20) - 1, np.radians(0.5))),
    ],
)
def test_units_of_a_deviation(name, values, factor, tmp_path):
    columns = [values + 0 * F for _ in name.split(",")]
    path = write(
        tmp_path / "bode.csv", table(f"f,Gain (dB),Phase (deg),{name}", F, DB, WRAPPED, *columns)
    )
    np.testing.assert_allclose(
        np.sqrt(nlfrf.io.load_frf(path).var_total), factor * np.abs(G), rtol=1e-6
    )


def test_other_columns_are_left_out_with_a_word(tmp_path):
    names = "f,Gain (dB),Phase (deg),Temp (°C),Phase error (deg)"
    path = write(tmp_path / "bode.csv", table(names, F, DB, WRAPPED, 21 + 0 * F, 0.1 + 0 * F))
    with pytest.warns(
        nlfrf.DataWarning,
        match=r"left out, because not part of the FRF in 'bode.csv': 'Temp .*', 'Phase error",
    ):
        bla = nlfrf.io.load_frf(path, relative_std=0.02)
    np.testing.assert_allclose(bla.G, G, rtol=1e-6)
    assert "not part of it: 'Temp (°C)', 'Phase error (deg)'" in nlfrf.inspect_file(path).frf
    path = write(
        tmp_path / "named.csv", table("f,Plant gain (dB),Plant phase (deg)", F, DB, WRAPPED)
    )
    with pytest.warns(nlfrf.DataWarning, match=r"'Plant' in .* is taken as the measured quantity"):
        assert nlfrf.io.load_frf(path, relative_std=0.02).f.size == F.size


@pytest.mark.parametrize(
    "text",
    [
        table("f,dB", F, DB),
        table("a,b,c", F, DB, WRAPPED),
        table("f,dB,degrees", np.tile(F[:30], 2), DB, WRAPPED),  # two sweeps in one
        table("f,Amplitude (Vpp),Phase (deg)", F, DB, WRAPPED),
    ],
)
def test_what_is_no_frf_is_refused_with_the_columns(text, tmp_path):
    with pytest.raises(
        ValueError, match=r"path must hold an FRF, by name: .*name the columns as in 'f \[Hz\],gain"
    ):
        nlfrf.io.load_frf(write(tmp_path / "bode.csv", text), relative_std=0.02)


def test_complex_arrays(tmp_path):
    np.savez(tmp_path / "frf.npz", G=G, omega=2 * np.pi * F, note="sweep")
    np.testing.assert_allclose(nlfrf.io.load_frf(tmp_path / "frf.npz", relative_std=0.02).f, F)


def write_functions(path, *functions, unit="Hz", where="add"):
    """Write functions (kind, response node and direction, data) of a universal file."""
    import pyuff

    for kind, node, way, data in functions:
        about = dict(
            binary=0,
            func_type=kind,
            rsp_node=node,
            rsp_dir=way,
            ref_node=1,
            ref_dir=3,
            id1="Frequency response",
        )
        about |= dict(
            abscissa_spacing=0, abscissa_min=0.0, abscissa_inc=0.0, ordinate_axis_units_lab="m/s2"
        )
        about |= dict(
            orddenom_axis_units_lab="N", rsp_ent_name="NONE", ref_ent_name="NONE", num_pts=F.size
        )
        about |= dict(
            ord_data_type=6 if np.iscomplexobj(data) else 4,
            data=data,
            x=F,
            abscissa_axis_units_lab=unit,
        )
        about |= dict(
            abscissa_spec_data_type=18, ordinate_spec_data_type=12, orddenom_spec_data_type=13
        )
        pyuff.UFF(str(path)).write_sets([pyuff.prepare_58(**about)], where)


def test_functions_of_a_universal_file(tmp_path):
    path = tmp_path / "modal.uff"
    write_functions(path, (4, 5, 3, G), (6, 5, 3, COHERENCE), (4, 6, -1, 2 * G))
    bla = nlfrf.io.load_frf(path, n_averages=11, channel="5 z / 1 z")
    np.testing.assert_allclose(bla.G, G, rtol=1e-6)
    np.testing.assert_allclose(
        bla.var_total, (1 - COHERENCE) / COHERENCE * np.abs(G) ** 2 / 10, rtol=1e-3
    )
    assert bla.unit == "m/s2/N"
    with pytest.raises(ValueError, match=r"channel must name one .* '5 z 1 z', '6 minus x 1 z'"):
        nlfrf.io.load_frf(path, n_averages=11)
    with pytest.raises(
        ValueError, match="relative_std must be given"
    ):  # the coherence is that of the other
        nlfrf.io.load_frf(path, n_averages=11, channel="6 minus x 1 z")
    write_uff(path)  # and time records behind them
    found = nlfrf.inspect_file(path)
    assert (found.u, found.y) == ("u", "y")
    assert "FRF:   60 lines from 0.5 to 200 Hz in '5 z / 1 z', and of '6 minus x 1 z'" in str(found)
    assert found.command.startswith("nlfrf identify ")


@pytest.mark.parametrize("form", ["RI", "MA", "DB"])
def test_parameters_of_a_touchstone_file(tmp_path, form):
    """Rows of version 1: the frequency in the stated unit, S11 S21 S12 S22, each as the form has it
    (IBIS, 2009).
    """
    pytest.importorskip("skrf")
    parts = {
        "RI": lambda x: (x.real, x.imag),
        "MA": lambda x: (abs(x), np.degrees(np.angle(x))),
        "DB": lambda x: (20 * np.log10(abs(x)), np.degrees(np.angle(x))),
    }
    order = (0.1 * G, G, 0.01 * G.conj(), 0.2 * G)
    rows = [
        [f / 1e3, *(part for one in order for part in parts[form](one[k]))] for k, f in enumerate(F)
    ]
    text = "\n".join(" ".join(f"{float(number):.15g}" for number in row) for row in rows)
    path = tmp_path / "amplifier.s2p"
    path.write_text(f"! analyser\n# kHz S {form} R 50\n{text}\n")
    bla = nlfrf.io.load_frf(path, relative_std=0.02, channel="S21")
    np.testing.assert_allclose(bla.f, F, rtol=1e-12)
    np.testing.assert_allclose(bla.G, G, rtol=1e-12)
    with pytest.raises(
        ValueError, match=r"channel must name one of the FRFs .* 'S 11', 'S 12', 'S 21', 'S 22'"
    ):
        nlfrf.io.load_frf(path, relative_std=0.02)
    path.write_text(f"# kHz Z {form} R 50\n{text}\n")
    with pytest.raises(ValueError, match="it holds Z-parameters: export S-parameters"):
        nlfrf.io.load_frf(path, relative_std=0.02, channel="Z21")


@pytest.mark.parametrize(
    "options", ["# S RI kHz R 50", "# R 50 RI S KHZ", "# kHz RI", "# RI kHz ! of an analyser"]
)
def test_options_of_a_touchstone_file_stand_in_any_order(options, tmp_path):
    pytest.importorskip("skrf")
    path = tmp_path / "one.s1p"
    path.write_text(
        f"{options}\n"
        + "".join(
            f"{f / 1e3:.12g} {g.real:.12g} {g.imag:.12g}\n" for f, g in zip(F, G, strict=True)
        )
    )
    bla = nlfrf.io.load_frf(path, relative_std=0.02)
    np.testing.assert_allclose(bla.f, F, rtol=1e-9)
    np.testing.assert_allclose(bla.G, G, rtol=1e-9)


@pytest.mark.parametrize(
    ("header", "row"),
    [
        (
            "Freq [Hz]\tV(out)",
            lambda f, g: (
                f"{f:.15e}\t({20 * np.log10(abs(g)):.15e}dB,{np.degrees(np.angle(g)):.15e}°)"
            ),
        ),
        ("Freq [Hz]\tV(out)", lambda f, g: f"{f:.15e}\t{g.real:.15e},{g.imag:.15e}"),
        ("f,G", lambda f, g: f"{f:.9g},({g.real:.9g}{g.imag:+.9g}j)"),
        (
            "f;conj(G)",
            lambda f, g: f"{f:.9g};{g.real:.9g} {'-+'[int(g.imag < 0)]} {abs(g.imag):.9g}i",
        ),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_complex_numbers_as_texts(header, row, encoding, tmp_path):
    path = tmp_path / "sweep.txt"
    path.write_text("\n".join([header, *map(row, F, G), ""]), encoding=encoding)
    bla = nlfrf.io.load_frf(path, relative_std=0.02)
    np.testing.assert_allclose(bla.f, F, rtol=1e-7)
    np.testing.assert_allclose(bla.G, G, rtol=1e-7)


def test_units_of_frequencies_beside_them(tmp_path):
    from scipy.io import savemat

    w, path = 2 * np.pi * F, tmp_path / "sys.mat"
    for held in (
        {"ResponseData": G[None, None], "Frequency": w, "FrequencyUnit": "rad/s"},
        {
            "ResponseData": G[None, None],
            "Frequency": 60 * w,
            "FrequencyUnit": "rad/TimeUnit",
            "TimeUnit": "minutes",
        },
        {"ResponseData": G, "Frequency": F, "Units": "Hz"},
        {"mag": np.abs(G), "phase": np.degrees(np.angle(G)), "wout": w},  # of MATLAB's bode
        {"re": G.real, "im": G.imag, "wout": w},
        {"H": G, "freq": F / 1e3, "freq_unit": "kHz"},
    ):
        for content in (held, {"sys": held}):
            savemat(path, content)
            bla = nlfrf.io.load_frf(path, relative_std=0.02)
            np.testing.assert_allclose(bla.f, F)
            np.testing.assert_allclose(bla.G, G)
    savemat(path, {"H": G, "freq": F, "freq_unit": "furlong"})
    with pytest.raises(ValueError, match="'furlong' in 'freq' is not known"):
        nlfrf.io.load_frf(path, relative_std=0.02)


def test_files_of_potentiostats_and_loudspeakers(tmp_path):
    head = "ZPLOT2 ASCII\n  Open Circuit Potential (V): 0.0033\n"
    head += "  Freq(Hz)\tAmpl\tBias\tTime(Sec)\tZ'(a)\tZ''(b)\nEnd Comments\n"
    columns = np.column_stack([F, 0.01 + 0 * F, 0 * F, F, G.real, G.imag])
    rows = "".join("\t".join(f"{x:.9E}" for x in row) + "\n" for row in columns)
    gamry = "EXPLAIN\nTAG\tEISPOT\nOCVCURVE\tTABLE\t2\n\tPt\tT\tVf\n\t#\ts\tV\n\t0\t1\t2\n\t1\t2\t2\nZCURVE\tTABLE\n"
    gamry += "\tPt\tFreq\tZreal\tZimag\tZsig\n\t#\tHz\tohm\tohm\tV\n"
    gamry += "".join(
        f"\t{k}\t{f:.9g}\t{g.real:.9g}\t{g.imag:.9g}\t1\n"
        for k, (f, g) in enumerate(zip(F, G, strict=True))
    )
    for name, text in (("a.z", head + rows), ("b.DTA", gamry)):
        with pytest.warns(nlfrf.DataWarning, match="left out, because not part of the FRF"):
            bla = nlfrf.io.load_frf(write(tmp_path / name, text), relative_std=0.02)
        np.testing.assert_allclose(bla.G, G, rtol=1e-7)
    text = "".join(f"{f:.9g} {x:.9g} {y:.9g}\n" for f, x, y in zip(F, DB, WRAPPED, strict=True))
    with pytest.warns(
        nlfrf.DataWarning, match=r"'c.frd' names no columns: they are taken for 'f=col1 \[Hz\], mag"
    ):
        bla = nlfrf.io.load_frf(write(tmp_path / "c.frd", text), relative_std=0.02)
    np.testing.assert_allclose(bla.G, G, rtol=1e-6)
    with pytest.raises(ValueError, match="export the SDF of the analyser"):
        nlfrf.io.load_frf(write(tmp_path / "d.sdf", "B"), relative_std=0.02)


def test_names_composed_of_parts_and_of_words_that_are_not_known(tmp_path):
    """A part of the thousands of `python -m benchmarks.names`."""
    refused, n_own = 0, 0
    with names.readers_in_this_process():
        for seed in range(40):
            case = names.draw(seed)
            outcome, words = names.judge(case, tmp_path)
            assert outcome is not names.Outcome.WRONG, (seed, case.about, words)
            n_own += case.is_own and case.may_be_read
            refused += case.is_own and case.may_be_read and outcome is not names.Outcome.RIGHT
    assert refused <= names.MOST_REFUSED * n_own


def test_from_inspect_to_a_model(nlfrf_command, robust_command, tmp_path):  # noqa: F811
    """The command that inspect prints runs, with what nobody else can know in place of the words in
    capitals.
    """
    write(tmp_path / "bode.csv", TABLES["Keysight"])
    code, out, _ = nlfrf_command("inspect", "bode.csv")
    assert code == 0
    assert "needs: the file has no coherence, and a swept sine shows no distortion" in unwrapped(
        out
    )
    command = shlex.split(out.splitlines()[-1].removeprefix("run:   robust "))
    assert "--relative-std" in command
    given = {"RELATIVE-STD": "0.02"}
    options = "--poles 2 --delay 0.004"
    code, out, _ = robust_command(" ".join([*(given.get(word, word) for word in command), options]))
    assert code == 0
    assert (tmp_path / "bode-model.json").exists()
    code, _, err = robust_command("model bode.csv --poles 2 -o other.json")
    assert code == 2
    assert err.startswith("robust: --relative-std must be given: the file has no coherence")
    for refused in ("orders bode.csv", "design bode.csv --method pid -o K.json"):
        code, _, err = robust_command(refused)
        assert code == 2
        assert (
            "nlfrf frf bode.csv --relative-std STD -o bla.npz makes a BLA of it for every command"
            in unwrapped(err)
        )
    code, out, _ = nlfrf_command("frf", "bode.csv", "--relative-std", "0.02", "-o", "bla.npz")
    assert code == 0
    for taken in (
        "orders bla.npz --most 3",
        "design bla.npz --method pid --structure I --sample-time 1e-3 -o K.json",
    ):
        assert robust_command(taken)[0] == 0
    code, _, err = robust_command("model bla.npz --poles 2 --relative-std 0.1 -o other.json")
    assert (code, "must be left out for a BLA" in err) == (2, True)
