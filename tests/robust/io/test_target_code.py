"""C and structured text for a target: equal to numpy to the last bit, with bounds of rounding that
hold.
"""

import ctypes
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import control
import numpy as np
import pytest

import robust
from robust import DesignWarning
from robust.io import export_c, export_structured_text
from robust.lti import discretize
from robust.models import LpvModel
from tests.support.responses import response

COMPILER = shutil.which("cc")
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wdouble-promotion", "-Werror")
DT = 1e-3


def notches():
    """Three notches from 5 to 90 Hz and a lag, at 10 kHz."""
    K = control.tf([2.0, 60.0], [1.0, 0.5])
    for hertz in (5.0, 31.0, 90.0):
        w = 2 * np.pi * hertz
        K = K * control.tf([1, 0.02 * w, w * w], [1, 0.8 * w, w * w])
    return discretize(K, 1e-4)


def dk_step():
    """The K-step of a D-K iteration of order 20: six modes, a weight on each side, D of order 3."""
    frequencies = np.array([60.0, 170, 300, 480, 700, 900])
    G = sum(
        (
            control.ss(control.tf([0.6**k * w * w], [1, 0.04 * w, w * w]))
            for k, w in enumerate(frequencies)
        ),
        control.ss([], [], [], [[0.0]]),
    )
    D = control.ss(control.tf(np.poly([-30.0, -200, -900]), np.poly([-60.0, -150, -700])))
    inverse = control.ss(control.tf(np.poly([-60.0, -150, -700]), np.poly([-30.0, -200, -900])))
    parts = [
        control.ss(G, inputs="v", outputs="y"),
        control.ss(inverse, inputs="w", outputs="d"),
        control.ss(D * control.ss(control.tf([0.6, 30], [1, 600])), inputs="u", outputs="z1"),
        control.ss(robust.performance_weight(12, M_S=2.5, A=1e-3), inputs="e", outputs="z2"),
        control.ss([], [], [], [[1.0]], inputs="e", outputs="read"),
        control.summing_junction(["u", "d"], "v"),
        control.summing_junction(["r", "-y"], "e"),
    ]
    P = control.interconnect(parts, inplist=["w", "r", "u"], outlist=["z1", "z2", "read"])
    K = robust.hinfsyn(control.ss(P), 1, 1).K
    assert K.nstates == 20
    return discretize(K, DT)


CASES = {
    "PID with a limit": (
        lambda: robust.shaping.pid(20.0, 300.0, 0.1, filter_time=2e-3, dt=DT),
        15.0,
    ),
    "notches": (notches, (-3.0, 4.0)),
    "D-K of order 20": (dk_step, None),
    "two integrators": (lambda: control.tf([1, -1.9, 0.91], np.poly([1, 1, 0.5]), DT), None),
    "gain": (lambda: control.ss([], [], [], [[-3.1]], DT), None),
    "delay of three samples": (lambda: control.tf([1], [1, 0, 0, 0], DT), None),
    "unstable": (lambda: control.tf([1, -0.5], np.poly([1.01, 0.3]), DT), None),
}


@pytest.fixture(scope="module")
def controllers():
    return {name: (make(), limit) for name, (make, limit) in CASES.items()}


def rounded_by(K, **options):
    """The rounded controller behind a header."""
    with tempfile.TemporaryDirectory() as folder:
        return export_c(K, Path(folder) / "k.h", **options)


def emulate(rounded, e, dtype=None, *, p=None):
    """Return (n, lanes) outputs: the statements in numpy, each product and each sum rounded to the
    dtype; p: operating points of a schedule.
    """
    number = np.dtype(dtype or rounded.dtype).type
    held = {name: np.zeros(e.shape[1], number) for name in rounded.states}
    least, largest = (number(bound) for bound in rounded.limit)

    def factor(c):
        return held[c] if isinstance(c, str) else number(c)

    def horner(coefficients):
        total = number(coefficients[-1])
        for one in coefficients[-2::-1]:
            total = total * held["theta"] + number(one)
        return total

    def run(statements):
        for statement in statements:
            target, terms = statement
            if not isinstance(terms[0], tuple):
                held[target] = horner(terms)
                continue
            values = [held[name] if c == 1 else factor(c) * held[name] for c, name in terms]
            total = values[0]
            for one in values[1:]:
                total = total + one
            held[target] = total

    u = np.empty_like(e, number)
    for k in range(len(e)):
        held["e"] = e[k].astype(number)
        if p is not None:
            middle, scale = (number(one) for one in rounded.theta)
            held["theta"] = np.clip(scale * (p[k].astype(number) - middle), number(-1), number(1))
        run(rounded.before)
        held["u"] = u[k] = np.minimum(np.maximum(held["v"], least), largest)
        run(rounded.after)
    return u


def compiled(header, dtype, e, p=None):
    """Return (n, lanes) outputs of the compiled header, a struct of its own for each lane."""
    name, kind = header.stem, {"float32": "float", "float64": "double"}[dtype]
    point = "" if p is None else "p[i], "
    source = header.with_suffix(".c")
    source.write_text(
        f'#include "{header.name}"\n'
        f"void run(int n, int lanes, const {kind} *p, const {kind} *e, {kind} *u)\n"
        "{\n"
        f"    (void)p;\n"
        f"    for (int lane = 0; lane < lanes; lane++) {{\n"
        f"        {name}_state k;\n"
        f"        {name}_init(&k);\n"
        f"        for (int i = lane; i < n * lanes; i += lanes) u[i] = {name}_step(&k, {point}e[i]);\n"
        "    }\n"
        "}\n"
    )
    library = header.with_suffix(".so")
    flags = ["-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC", *WARNINGS]
    subprocess.run([COMPILER, *flags, str(source), "-o", str(library)], check=True)
    u = np.empty_like(e)
    given = (e if p is None else p, e, u)
    pointers = (array.ctypes.data_as(ctypes.c_void_p) for array in given)
    ctypes.CDLL(str(library)).run(*e.shape, *pointers)
    return u


@pytest.mark.skipif(COMPILER is None, reason="no C compiler (cc) on this machine")
@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("name", CASES)
def test_compiled_it_is_numpy_to_the_last_bit(name, dtype, controllers, tmp_path):
    """1e5 samples, in 200 runs from rest."""
    K, limit = controllers[name]
    rounded = export_c(K, tmp_path / "controller.h", dtype=dtype, limit=limit)
    e = np.random.default_rng(0).standard_normal((500, 200)).astype(dtype)
    u = compiled(tmp_path / "controller.h", dtype, e)
    assert np.array_equal(u, emulate(rounded, e))
    assert len(np.unique(u)) > 100
    if limit is not None:
        assert u.min() == np.dtype(dtype).type(rounded.limit[0])
        assert u.max() == np.dtype(dtype).type(rounded.limit[1])


def run_block(text, e, dtype, p=None):
    """Return (n, lanes) outputs of a function block, translated statement by statement."""
    number = np.dtype(dtype).type
    body = re.sub(r"\(\*.*?\*\)", "", text, flags=re.DOTALL)
    names = dict.fromkeys(re.findall(r"(\w+) : L?REAL", body), np.zeros(e.shape[1], number))
    body = body[body.rindex("END_VAR") + len("END_VAR") : body.index("END_FUNCTION_BLOCK")]
    body = re.sub(r"IF reset THEN.*?END_IF;", "", body, count=1, flags=re.DOTALL)
    body = re.sub(r"IF (u [<>] (.+?)) THEN u := .*?; END_IF;", r"u = where(\1, \2, u)", body)
    body = re.sub(r"L?REAL#([\dE.+-]+)", r"number(\1)", body).replace(":=", "=").replace(";", "")
    code = compile("\n".join(line.strip() for line in body.splitlines()), "block", "exec")
    u = np.empty_like(e)
    for k in range(len(e)):
        names |= {"e": e[k], "number": number, "where": np.where}
        names |= (
            {} if p is None else {"p": p[k], "LIMIT": lambda low, x, high: np.clip(x, low, high)}
        )
        exec(code, {}, names)
        u[k] = names["u"]
    return u


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("name", ["PID with a limit", "notches", "two integrators", "gain"])
def test_structured_text_has_the_same_statements(name, dtype, controllers, tmp_path):
    K, limit = controllers[name]
    rounded = export_structured_text(K, tmp_path / "controller.st", dtype=dtype, limit=limit)
    e = np.random.default_rng(1).standard_normal((300, 5)).astype(dtype)
    text = (tmp_path / "controller.st").read_text()
    assert np.array_equal(run_block(text, e, dtype), emulate(rounded, e))
    assert text.startswith("FUNCTION_BLOCK FB_controller\n")
    assert f": {'LREAL' if dtype == 'float64' else 'REAL'}" in text


@pytest.mark.parametrize(
    "name", ["PID with a limit", "notches", "D-K of order 20", "two integrators", "unstable"]
)
def test_the_rounded_controller_is_the_one_that_runs(name, controllers):
    """In float64 the statements with the coefficients of float32 follow `K` of the result, by its
    own simulation.
    """
    K, _ = controllers[name]
    rounded = rounded_by(K, dtype="float32")
    e = np.random.default_rng(2).standard_normal((400, 1))
    wanted = control.forced_response(rounded.K, inputs=e[:, 0]).outputs
    assert np.allclose(
        emulate(rounded, e, "float64")[:, 0], wanted, rtol=0, atol=1e-9 * np.abs(wanted).max()
    )
    assert rounded.K.dt == K.dt
    omega = np.geomspace(1e-2, 0.9 * np.pi / K.dt, 200)
    wanted = response(control.ss(K), omega)
    assert np.abs(response(rounded.K, omega) / wanted - 1).max() < 1e-4
    assert rounded.coefficient_error < 1e-4


@pytest.mark.parametrize("dt", [1e-3, 1e-4, 1e-5])
def test_slow_poles_keep_their_digits_whatever_the_clock(dt):
    """In powers of z float32 moves a notch at 1 Hz by 100 % at 100 kHz; here |K| changes by 1e-5 at
    most.
    """
    w = 2 * np.pi
    K = discretize(
        control.tf([1, 0.02 * w, w * w], [1, 0.8 * w, w * w]) * control.tf([1, 3.0], [1, 1.0]), dt
    )
    rounded = rounded_by(K, dtype="float32")
    assert rounded.coefficient_error < 1e-5
    if dt == 1e-5:
        a = robust.io.controller_sections(K).astype(np.float32)[:, 3:].sum(axis=1).astype(float)
        assert np.abs(a / robust.io.controller_sections(K)[:, 3:].sum(axis=1) - 1).max() > 0.1


def exact_l1(A, b, c, n):
    """Return sum |c A^k b| of n terms."""
    total, x = 0.0, np.array(b, float)
    for _ in range(n):
        total += abs(float(c @ x))
        x = A @ x
    return total


@pytest.mark.parametrize("seed", range(6))
def test_the_gain_is_a_close_bound_of_the_l1_norm(seed):
    rng = np.random.default_rng(seed)
    p = [0.97 * np.exp(1j * rng.uniform(0.05, 2)), rng.uniform(0.2, 0.995), rng.uniform(-0.5, 0.9)]
    K = control.ss(
        control.tf(
            np.poly(rng.uniform(-0.9, 0.9, 3)), np.poly([p[0], np.conj(p[0]), *p[1:]]).real, DT
        )
    )
    rounded = rounded_by(K, dtype="float64")
    true = exact_l1(K.A, K.B[:, 0], K.C[0], 8000) + abs(K.D[0, 0])
    assert true * (1 - 1e-9) < rounded.gain < 2 * true


@pytest.mark.parametrize("seed", range(8))
def test_rounding_stays_within_its_bound_and_is_not_far_below_it(seed):
    """Against the same coefficients in float64, with a sine at each resonance and noise."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 6))
    p = np.concatenate(
        [
            r * np.exp(1j * a * np.array([1, -1]))
            for r, a in zip(rng.uniform(0.9, 0.999, n), rng.uniform(0.02, 2, n), strict=True)
        ]
    )
    z = np.concatenate(
        [
            r * np.exp(1j * a * np.array([1, -1]))
            for r, a in zip(rng.uniform(0.5, 0.99, n), rng.uniform(0.02, 2, n), strict=True)
        ]
    )
    K = control.ss([], [], [], [[1.0]], DT)
    for k in range(n):
        K = (
            control.ss(
                control.tf(
                    np.poly(z[2 * k : 2 * k + 2]).real, np.poly(p[2 * k : 2 * k + 2]).real, DT
                )
            )
            * K
        )
    rounded = rounded_by(K, dtype="float32")
    k = np.arange(1000)
    e = np.column_stack(
        [
            *(np.sign(np.sin(np.abs(np.angle(root)) * k + 0.1)) for root in p[::2]),
            rng.uniform(-1, 1, (1000, 4)),
        ]
    )
    off = np.abs(
        emulate(rounded, e.astype(np.float32)).astype(float)
        - emulate(rounded, e.astype(np.float32).astype(float), "float64")
    )
    assert 1e-4 * rounded.rounding < off.max() <= rounded.rounding


def test_a_compensated_integral_loses_nothing_that_is_small():
    """An error of 2e-6 for 1e4 samples beside an integral of 8: a plain sum in float32 stands
    still.
    """
    rounded = rounded_by(control.tf([0.1], [1, -1], DT), dtype="float32")
    e = np.full((10_000, 1), 2e-6)
    e[0] = 80.0
    assert emulate(rounded, e)[-1, 0] == pytest.approx(8.0 + 0.1 * 2e-6 * 9_998, rel=1e-7)
    assert np.float32(8.0) + np.float32(0.1) * np.float32(2e-6) == np.float32(8.0)


@pytest.mark.parametrize(
    "K",
    [
        robust.shaping.pid(20.0, 300.0, 0.1, filter_time=2e-3, dt=DT),
        control.tf([0.02], [1, -0.9999], DT),
    ],
    ids=["PID", "lag"],
)
def test_the_integral_comes_back_from_a_limit(K):
    """A second against the limit; then the output leaves it within a few samples, and not after a
    second.
    """
    e = np.concatenate([np.full((1000, 1), 0.5), np.full((300, 1), -0.05)])
    held = {
        limit: emulate(rounded_by(K, dtype="float64", limit=limit), e)[:, 0]
        for limit in (1.0, None)
    }
    assert np.all(held[1.0][150:1000] == 1.0)
    left = 1000 + int(np.argmax(held[1.0][1000:] < 1.0))
    assert left < 1100
    assert np.all(held[None][1000:] > 1.0)


def test_check_proves_the_rounded_controller_again(tmp_path):
    G = control.tf([1.0], [1, 2, 0])
    w = control.tf([0.2, 2], [1, 40])
    omega = np.geomspace(0.1, 100, 50)
    model = robust.UncertaintyModel(
        G, w, "multiplicative", omega, 0.99 * np.abs(w(1j * omega)), perturbation="LTI"
    )
    rounded = export_c(
        robust.shaping.pid(8.0, 4.0, 2.0, filter_time=0.02, dt=0.01), tmp_path / "k.h", limit=5.0
    )
    assert robust.check(model, rounded.K).proofs.robustly_stable


def test_the_comment_states_units_clock_flags_and_what_is_not_proved(tmp_path):
    export_c(robust.shaping.pid(20.0, 300.0, dt=DT), tmp_path / "axis.h", limit=(-3, 4), unit="m/N")
    text = (tmp_path / "axis.h").read_text()
    head = " ".join(text[: text.index("*/")].split())
    for part in (
        "one step every 0.001 s (1000 Hz)",
        "K is in N/m, u over e",
        "-ffp-contract=off",
        "powers of z - 1",
        "u from -3 to 4. Nothing is proved after u reaches it",
        "anti-windup by back-calculation",
        "(written by 'robust export')",
    ):
        assert part in head, part
    assert "malloc" not in text
    assert "static inline float axis_step(axis_state *k, float e)" in text


@pytest.mark.parametrize("stem", ["2 PID", "größe", "a*)b", "float", "NAME", "_"])
def test_any_file_name_makes_an_identifier(stem, tmp_path):
    export_structured_text(
        robust.shaping.pid(2.0, 3.0, dt=DT), tmp_path / f"{stem}.st", unit="m*)(*/N"
    )
    assert (tmp_path / f"{stem}.st").read_text().count(
        "*)"
    ) == 3  # its comment, and two behind a variable
    export_c(robust.shaping.pid(2.0, 3.0, dt=DT), tmp_path / f"{stem}.h", unit="m*/N")
    text = (tmp_path / f"{stem}.h").read_text()
    assert text.count("*/") == 1
    if COMPILER:
        source = tmp_path / "x.c"
        source.write_text(text)
        subprocess.run(
            [COMPILER, "-std=c99", "-Werror", "-c", str(source), "-o", str(tmp_path / "x.o")],
            check=True,
        )


def test_rounding_that_changes_much_is_warned_of():
    K = control.tf(
        [1.0], np.poly([np.exp(1j * 0.5) * (1 - 1e-6), np.exp(-1j * 0.5) * (1 - 1e-6)]).real, DT
    )
    with pytest.warns(
        DesignWarning, match="with coefficients in float32, and u by up to .*use dtype='float64'"
    ):
        rounded_by(K, dtype="float32")


@pytest.mark.parametrize(
    ("K", "more", "message"),
    [
        (control.tf([1], [1, 1]), {}, r"K must be discrete .*use robust\.lti\.discretize\(K, dt\)"),
        (2.0, {}, "K must be discrete to be written as code"),
        (
            control.ss([], [], [], np.eye(2), DT),
            {},
            "K must have one input and one output to be written as code, got 2 and 2",
        ),
        (
            control.tf([1], [1, -2, 1], DT),
            {"limit": 1.0},
            "limit must be left out .* got 2 integrators",
        ),
        (robust.shaping.pid(1.0, dt=DT), {"limit": 0.0}, "limit must be positive, got 0"),
        (
            robust.shaping.pid(1.0, dt=DT),
            {"limit": (2.0, 1.0)},
            "limit must be a positive number, or the least and the largest u",
        ),
        (
            robust.shaping.pid(1.0, dt=DT),
            {"limit": (3, 5)},
            "limit must include u = 0, which K gives at rest, got 3 to 5: subtract the output",
        ),
        (
            robust.shaping.pid(1.0, dt=DT),
            {"limit": (1.0, 2.0, 3.0)},
            "limit must be a positive number, or the least and the largest u",
        ),
        (
            robust.shaping.pid(1.0, dt=DT),
            {"dtype": "float16"},
            "dtype must be one of 'float32', 'float64', got 'float16'",
        ),
        (
            control.ss([], [], [], [[1e39]], DT),
            {},
            r"K must have coefficients of at most 3\.4e\+38 in float32, got 1e\+39",
        ),
        (robust.shaping.pid(1.0, dt=DT), {"unit": 3}, "unit must be"),
    ],
)
def test_refusals_in_one_line(K, more, message, tmp_path):
    with pytest.raises(ValueError, match=message) as refusal:
        export_c(K, tmp_path / "k.h", **more)
    assert "\n" not in str(refusal.value)
    assert not list(tmp_path.iterdir())


def test_an_actuator_that_only_pushes_may_end_at_zero():
    rounded = rounded_by(robust.shaping.pid(1.0, 2.0, dt=DT), dtype="float32", limit=(0, 5))
    assert rounded.limit.tolist() == [0, 5]


def test_a_file_of_another_kind_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"path must end in \.h, got"):
        export_c(robust.shaping.pid(1.0, dt=DT), tmp_path / "k.c")
    with pytest.raises(ValueError, match=r"path must end in \.st, got"):
        export_structured_text(robust.shaping.pid(1.0, dt=DT), tmp_path / "k.h")


# ---- Schedules.


def schedule(seed=None):
    """A PID with a notch that go with the position; with a seed a random polynomial of the order
    of the seed.
    """
    points = np.array([-0.2, 0.1, 0.4])
    known = {"at": points, "over": "position", "unit": "m"}
    if seed is None:
        blocks = [
            robust.tuning.Pid(
                kp=20 * (1 + p), ki=300 * (1 - p), kd=0.1, filter_time=2e-3, reads="e", drives="a"
            ).system(DT)
            for p in points
        ]
        slots = [robust.tuning.Notch(omega=400 + 200 * p).system(DT) for p in points]
        return LpvModel.from_points(
            [control.series(*one) for one in zip(blocks, slots, strict=True)], **known
        )
    rng = np.random.default_rng(seed)
    n = int(rng.integers(0, 6))
    middle = rng.normal(size=(n, n))
    middle *= rng.uniform(0.5, 0.98) / max(np.abs(np.linalg.eigvals(middle)).max(initial=0), 1e-9)
    systems = [
        control.ss(
            middle + 0.02 * rng.normal(size=(n, n)),
            rng.normal(size=(n, 1)),
            rng.normal(size=(1, n)),
            rng.normal(size=(1, 1)),
            DT,
        )
        for _ in points
    ]
    return LpvModel.from_points(systems, **known, degree=int(rng.integers(0, 3)))


def moving(dtype, n, lanes):
    """Errors, and operating points that move over the range and leave it."""
    rng = np.random.default_rng(5)
    e = rng.standard_normal((n, lanes)).astype(dtype)
    p = 0.1 + 0.35 * np.sin(np.linspace(0, 40, n)[:, None] + rng.uniform(0, 6, lanes))
    assert p.max() > 0.4
    return e, p.astype(dtype)


@pytest.mark.skipif(COMPILER is None, reason="no C compiler (cc) on this machine")
@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("seed", [None, 0, 1, 2, 3])
def test_a_compiled_schedule_is_numpy_to_the_last_bit(seed, dtype, tmp_path):
    """1e5 samples, in 200 runs from rest, with a position that moves."""
    rounded = export_c(schedule(seed), tmp_path / "controller.h", dtype=dtype)
    e, p = moving(dtype, 500, 200)
    u = compiled(tmp_path / "controller.h", dtype, e, p)
    assert np.array_equal(u, emulate(rounded, e, p=p))
    assert len(np.unique(u)) > 100


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("seed", [None, 0, 1, 2])
def test_structured_text_of_a_schedule_has_the_same_statements(seed, dtype, tmp_path):
    rounded = export_structured_text(schedule(seed), tmp_path / "controller.st", dtype=dtype)
    e, p = moving(dtype, 300, 5)
    text = (tmp_path / "controller.st").read_text()
    assert np.array_equal(run_block(text, e, dtype, p), emulate(rounded, e, p=p))


@pytest.mark.parametrize("seed", [None, 1, 4])
def test_the_rounded_schedule_is_the_one_that_runs(seed):
    """The statements in float64 with coefficients of float32 follow `K.at(p)` of the result, step by
    step; clamped outside the range.
    """
    rounded = rounded_by(schedule(seed), dtype="float32")
    e, p = moving("float64", 400, 1)
    x, wanted = np.zeros((rounded.K.order, 1)), []
    for error, point in zip(e[:, 0], p[:, 0], strict=True):
        law = rounded.K.at(np.clip(point, -0.2, 0.4))
        wanted.append((law.C @ x + law.D * error)[0, 0])
        x = law.A @ x + law.B * error
    off = emulate(rounded, e, "float64", p=p)[:, 0] - wanted
    assert np.abs(off).max() < 1e-6 * np.abs(wanted).max()  # theta itself is rounded
    assert 0 < rounded.coefficient_error < 1e-4
    assert np.isnan([rounded.gain, rounded.rounding]).all()


def test_a_rounded_schedule_is_proved_again(tmp_path):
    points = np.array([-0.2, 0.1, 0.4])
    known = {"at": points, "over": "position", "unit": "m"}
    plant = LpvModel.from_points(
        [control.ss([[0, 1], [-900 * (1 + p), -60]], [[0], [1]], [[1, 0]], 0) for p in points],
        weight=control.ss([], [], [], 0.1, DT),
        **known,
    )
    rounded = export_c(schedule(), tmp_path / "axis.h", unit="m/N")
    assert robust.prove_schedule(plant, rounded.K, rate=0.1, delay=DT, limit=False).holds
    text = (tmp_path / "axis.h").read_text()
    head = " ".join(text[: text.index("*/")].split())
    for part in (
        "K is in N/m, u over e",
        "p: position from -0.2 to 0.4 m, read in every step and clamped to this range",
        "Operations are rounded too, without a bound here",
        "another controller while theta moves",
    ):
        assert part in head
    assert "axis_step(axis_state *k, float p, float e)" in text


def test_the_integral_of_a_schedule_loses_nothing_that_is_small():
    """An error of 2e-6 for 1e4 samples beside an integral of 8, while the position moves."""
    parts = [control.ss([[1.0]], [[0.1]], [[1.0]], [[g]], DT) for g in (0.0, 1e-9)]
    rounded = rounded_by(LpvModel.from_points(parts, at=[0, 1]), dtype="float32")
    e = np.full((10_000, 1), 2e-6)
    e[0] = 80.0
    u = emulate(rounded, e, p=np.linspace(0, 1, 10_000)[:, None])
    assert u[-1, 0] == pytest.approx(8.0 + 0.1 * 2e-6 * 9_998, rel=1e-7)


def turned(residue, scale):
    """An integrator beside a lag with a notch-like state that e does not reach at once; `residue`
    is what the states add to the integral, as after a change of states.
    """
    A = np.array([[1.0, residue, residue], [0.0, 0.6, 0.1], [0.0, 0.2, 0.5]])
    T = np.diag([1.0, scale, scale])
    parts = {"B": [[0.1], [0.3], [0.0]], "C": np.array([[1.0, 1e-9, 0.0]])}
    return LpvModel.from_points(
        [
            control.ss(
                T @ A @ np.linalg.inv(T),
                T @ parts["B"],
                (1 + p) * parts["C"] @ np.linalg.inv(T),
                0,
                DT,
            )
            for p in (0.0, 1e-9)
        ],
        at=[0, 1],
    )


@pytest.mark.parametrize("scale", [1.0, 1e6, 1e-6])
def test_a_residue_that_single_precision_cannot_see_leaves_an_integral_compensated(scale, tmp_path):
    rounded = export_structured_text(
        turned(1e-15, scale), tmp_path / "controller.st", dtype="float32"
    )
    e = np.full((10_000, 1), 2e-6, np.float32)
    e[0] = 80.0
    p = np.linspace(0, 1, 10_000)[:, None].astype(np.float32)
    u = emulate(rounded, e, p=p)
    assert u[-1, 0] == pytest.approx(8.0 + 0.1 * 2e-6 * 9_998, rel=2e-7)
    text = (tmp_path / "controller.st").read_text()
    assert np.array_equal(run_block(text, e[:300], "float32", p[:300]), u[:300])
    for seen, dtype in ((1e-3, "float32"), (1e-15, "float64")):
        assert "s1_carry" not in rounded_by(turned(seen, scale), dtype=dtype).states


@pytest.mark.parametrize(
    ("K", "more", "message"),
    [
        (
            LpvModel.from_points([1.0, 2.0], at=[0, 1]),
            {},
            "K must be discrete .* got a schedule that is continuous",
        ),
        (
            LpvModel.from_points([control.ss([], [], [], np.eye(2), DT)] * 2, at=[0, 1]),
            {},
            "got a schedule that is with 2 inputs and 2 outputs",
        ),
        (schedule(), {"limit": 3.0}, "limit must be left out for a schedule, .* got 3.0"),
        (
            LpvModel.from_points([control.ss([], [], [], 1e39, DT)] * 2, at=[0, 1]),
            {},
            "K must have coefficients of at most 3.4e.38 in float32",
        ),
    ],
)
def test_schedules_that_cannot_be_written_are_refused(K, more, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        export_c(K, tmp_path / "k.h", **more)
