"""`tune` against published and closed-form optima, and on everything that a user can get wrong."""

import control
import numpy as np
import pytest

import robust
from robust import tuning
from tests.support.compleib import problem as compleib_problem
from tests.support.printed import unwrapped

ERROR = control.summing_junction(["r", "-y"], "e")
FORCE = control.summing_junction(["u", "d"], "f")
LAG = tuning.Plants(control.tf([1], [1, 1]), inputs="f", outputs="y")


def static_feedback(name, *, order=0, **options):
    """A COMPleib problem by static output feedback, or by a controller of an order."""
    P, n_y, n_u = compleib_problem(name)
    n_w, n_z = P.ninputs - n_u, P.noutputs - n_y
    w, u, z, y = (
        [f"{letter}{k}" for k in range(n)]
        for letter, n in zip("wuzy", (n_w, n_u, n_z, n_y), strict=True)
    )
    if order:
        block = tuning.StateSpace(n_states=order, reads=y, drives=u)
    else:
        block = tuning.Gain(K=np.zeros((n_u, n_y)), reads=y, drives=u)
    plant = tuning.Plants(P, inputs=[*w, *u], outputs=[*z, *y])
    return robust.tune([], plant, {"K": block}, soft=[tuning.Limit(w, z)], **options), (w, z)


def has_norm(system, level):
    """Whether a norm is this level, proved within 1e-6 on both sides."""
    above, below = (robust.certify_norm(system, level * (1 + x)) for x in (1e-6, -1e-6))
    return above.holds and not below.holds


@pytest.mark.attack(every=4)
@pytest.mark.parametrize(
    ("name", "best"), [("AC17", 6.61243), ("NN2", 2.2216), ("MFP", 31.590), ("REA1", 0.8660)]
)
def test_static_output_feedback(name, best):
    """AC17: no controller of any order is better (an LMI's bound).

    The norm is that of the loop, certified.
    """
    design, (w, z) = static_feedback(name, rng=1, n_starts=4)
    assert design.gamma == pytest.approx(best, rel=1e-3)
    loop = design.loop(w, z)
    assert has_norm(loop, design.gamma)
    assert not design.limits[0].n_lines
    there = loop(
        1j * design.limits[0].omega, squeeze=False
    )  # one of several peaks of the same height
    assert np.linalg.norm(there, 2) == pytest.approx(design.gamma, rel=1e-6)
    assert design.met  # nothing hard is asked, and the loop is stable
    assert min(design.spread) == pytest.approx(design.gamma, rel=1e-6)


def test_a_closed_form():
    """|u/r| = K (s + 1)/(s + 1 + K) has its largest value K at infinity: the hard limit is reached,
    not passed.
    """
    design = robust.tune(
        [ERROR, FORCE],
        LAG,
        {"K": tuning.Gain(K=1.0, reads="e", drives="u")},
        hard=[tuning.Limit("r", "u", 9.0)],
        soft=[tuning.Limit("r", "e", 1.0, band=(0.0, 0.5))],
        rng=0,
    )
    K = design.blocks["K"].K[0, 0]
    assert design.met
    assert 9.0 * (1 - 1e-4) < K <= 9.0
    assert design.gamma == pytest.approx(abs((0.5j + 1) / (0.5j + 1 + K)), rel=1e-6)
    assert np.allclose(design.spread, design.gamma, rtol=1e-4)
    assert abs(design.excess + 1 + K) < 1e-9


def test_several_plants_share_one_controller():
    """Gains 1 and 4 with one integral gain: peak |S| of the faster plant decides, as it does
    alone.
    """
    plants = [control.tf([k], [1, 1, 0]) for k in (1.0, 4.0)]
    asked = {
        "hard": [tuning.Limit("d", "f", 1.5)],
        "soft": [tuning.Limit("d", "y", 1.0, band=(0.0, 0.01))],
    }
    block = {"K": tuning.Gain(K=0.1, reads="e", drives="u")}
    both = robust.tune(
        [ERROR, FORCE], tuning.Plants(plants, inputs="f", outputs="y"), block, **asked, rng=0
    )
    alone = robust.tune(
        [ERROR, FORCE], tuning.Plants(plants[1], inputs="f", outputs="y"), block, **asked, rng=0
    )
    assert both.met
    assert both.blocks["K"].K[0, 0] == pytest.approx(alone.blocks["K"].K[0, 0], rel=1e-3)
    assert {one.plant for one in both.limits} == {0, 1}


def test_decay_is_kept():
    """With 1/(s (s + 2)) and a gain both poles are at -1 at best: a decay of 0.9 bounds the gain
    from both sides.
    """
    plant = tuning.Plants(control.tf([1], [1, 2, 0]), inputs="f", outputs="y")
    design = robust.tune(
        [ERROR, FORCE],
        plant,
        {"K": tuning.Gain(K=0.5, reads="e", drives="u")},
        soft=[tuning.Limit("r", "u", 1.0)],
        decay=0.9,
        rng=0,
    )
    assert design.met
    assert design.blocks["K"].K[0, 0] == pytest.approx(0.99, rel=1e-3)  # s^2 + 2 s + K = 0 at -0.9


def test_an_unstable_start_is_brought_in():
    """1/(s - 1) with a gain that starts at 0.1."""
    plant = tuning.Plants(control.tf([1], [1, -1]), inputs="f", outputs="y")
    design = robust.tune(
        [ERROR, FORCE],
        plant,
        {"K": tuning.Gain(K=0.1, reads="e", drives="u")},
        soft=[tuning.Limit("r", "y", 1.0)],
        rng=0,
        n_starts=1,
    )
    assert design.met
    assert design.excess < 0


def test_what_cannot_be_stabilised_is_said():
    """1/(s - 1)^2 by a gain: s^2 - 2 s + 1 + K keeps a sum of poles of two."""
    plant = tuning.Plants(control.tf([1], [1, -2, 1]), inputs="f", outputs="y")
    block = {"K": tuning.Gain(K=0.1, reads="e", drives="u")}
    design = robust.tune([ERROR, FORCE], plant, block, soft=[tuning.Limit("r", "y")], rng=0)
    assert not design.met
    assert np.isinf(design.spread).all()
    assert "no stable loop" in design.reason
    assert "NOT MET" in unwrapped(design)


def test_limits_that_contradict_each_other_are_named_with_how_far():
    """|S| < 0.1 up to 10 rad/s and |K S| < 1 of 1/(s + 1): the best is known to be far off."""
    design = robust.tune(
        [ERROR, FORCE],
        LAG,
        {"K": tuning.Gain(K=1.0, reads="e", drives="u")},
        hard=[tuning.Limit("r", "e", 0.1, band=(0.0, 0.1)), tuning.Limit("r", "u", 1.0)],
        rng=0,
    )
    assert not design.met
    assert "missed by a factor" in design.reason
    assert all(one.ratio > 1 for one in design.limits if one.hard and not one.met)


def test_what_nothing_asks_for_and_what_is_at_a_bound():
    """A peak alone drives the integral gain to its lower bound; both are said."""
    design = robust.tune(
        [ERROR, FORCE],
        LAG,
        {"K": tuning.Pid(kp=1.0, ki=1.0, reads="e", drives="u", upper={"kp": 2.0})},
        soft=[tuning.Limit("d", "y", 1.0)],
        rng=0,
    )
    assert "K.kp" in design.at_bounds
    assert any("integrator" in one for one in design.not_asked)
    assert "a bound" in unwrapped(design)


def test_a_feedforward_needs_no_loop():
    """F = kp + kd s/(tau s + 1) from r against the error: 1 - G F is made small."""
    plant = tuning.Plants(control.tf([1], [0.5, 1]), inputs="f", outputs="y")
    design = robust.tune(
        [ERROR],
        plant,
        {
            "F": tuning.Pid(
                kp=0.5, kd=0.1, filter_time=0.05, fixed=("filter_time",), reads="r", drives="f"
            )
        },
        soft=[tuning.Limit("r", "e", 1.0, band=(0.0, 5.0))],
        rng=0,
    )
    assert design.gamma < 0.2
    assert design.blocks["F"].filter_time == 0.05


def test_the_controller_is_the_one_that_was_tuned():
    """`controller` with `check`'s sign in a loop of its own: the same |S| as the design says,
    sampled with a delay.
    """
    dt = 0.02
    plant = control.tf([4], [1, 1, 4])
    design = robust.tune(
        [ERROR, FORCE],
        tuning.Plants(plant, inputs="f", outputs="y"),
        {
            "K": tuning.Pid(kp=0.3, ki=1.0, reads="e", drives="u_c"),
            "N": tuning.Notch(omega=2.0, reads="u_c", drives="u"),
        },
        hard=[tuning.Limit("d", "f", 1.7)],
        soft=[tuning.Limit("d", "y", 1.0, band=(0, 0.3))],
        dt=dt,
        delay=0.03,
        rng=0,
    )
    K = design.controller("y", "u")
    G = robust.sampled(plant, dt, 0.03)
    loop = control.ss(control.feedback(1, control.ss(G) * K))
    assert design.met
    assert has_norm(loop, 1.7 * design.limits[0].ratio)
    assert K.dt == dt
    assert K.nstates == 3


# ---- What a user can get wrong.


def ask(**changed):
    """A design of one lag with something changed."""
    given = {
        "system": [ERROR, FORCE],
        "plant": LAG,
        "blocks": {"K": tuning.Gain(K=1.0, reads="e", drives="u")},
        "soft": [tuning.Limit("d", "y", 1.0)],
        "n_starts": 1,
        **changed,
    }
    return robust.tune(given.pop("system"), given.pop("plant"), given.pop("blocks"), **given)


PI = {"reads": "e", "drives": "u"}
INTEGRATOR = control.ss([[0.0]], [[1.0]], [[1.0]], [[0.0]], inputs="y", outputs="y_i")
UNSTABLE = control.ss([[1.0]], [[1.0]], [[1.0]], [[0.0]], inputs="y", outputs="y_i")
GAIN_ONE = control.ss([], [], [], [[1.0]], inputs="q", outputs="q")


@pytest.mark.parametrize(
    ("message", "changed"),
    [
        ("at least one free parameter", {"blocks": {"K": tuning.Gain(K=1.0, fixed=("K",), **PI)}}),
        ("blocks must be named blocks", {"blocks": {}}),
        ("blocks\\['K'\\] must be of type", {"blocks": {"K": 3.0}}),
        ("plant must be of type Plants", {"plant": control.tf([1], [1, 1])}),
        ("the design has no demand", {"soft": []}),
        ("soft must hold robust.tuning.Limit", {"soft": [1.0]}),
        ("zero for all blocks", {"soft": [tuning.Limit("r", "q_out", 1.0)]}),
        ("must be inputs of a system", {"soft": [tuning.Limit("nobody", "y", 1.0)]}),
        ("must be outputs of a system", {"soft": [tuning.Limit("d", "nobody", 1.0)]}),
        ("which no output drives", {"blocks": {"K": tuning.Gain(K=1.0, reads="q9", drives="u")}}),
        ("which no input reads", {"blocks": {"K": tuning.Gain(K=1.0, reads="e", drives="q9")}}),
        (
            "independent of all blocks",
            {"soft": [tuning.Limit("d", "y_i", 1.0)], "system": [ERROR, FORCE, INTEGRATOR]},
        ),
        (
            "independent of all blocks",
            {"soft": [tuning.Limit("d", "y_i", 1.0)], "system": [ERROR, FORCE, UNSTABLE]},
        ),
        ("algebraic loop", {"system": [ERROR, FORCE, GAIN_ONE]}),
        (
            "must have the sampling time of the design",
            {"dt": 0.1, "system": [ERROR, FORCE, INTEGRATOR]},
        ),
        ("must name the signal that it reads", {"blocks": {"K": tuning.Pid(kp=1.0)}}),
        ("decay must be zero or positive", {"decay": -1.0}),
        ("delay must be finite", {"delay": float("nan")}),
        ("n_starts must be a whole number", {"n_starts": 0}),
        ("progress must be callable", {"progress": 3}),
        ("rng must be", {"rng": "x"}),
        (
            "start between its bounds",
            {"blocks": {"K": tuning.Pid(kp=1.0, lower={"kp": 2.0}, upper={"kp": 3.0}, **PI)}},
        ),
        ("keep the sign", {"blocks": {"K": tuning.Pid(kp=1.0, lower={"kp": -2.0}, **PI)}}),
        (
            "positive and finite at every frequency",
            {"soft": [tuning.Limit("d", "y", 1.0, weight=lambda w: w * np.nan)]},
        ),
        ("worst must be False unless", {"soft": [tuning.Limit("d", "y", 1.0, worst=True)]}),
    ],
)
def test_one_clear_line(message, changed):
    if "zero for all" in message:
        tail = control.ss([], [], [], [[1.0]], inputs="q_in", outputs="q_out")
        changed = {**changed, "system": [ERROR, FORCE, tail]}
    with pytest.raises(ValueError, match=message) as refusal:
        ask(**changed)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("message", "make"),
    [
        ("filter_time must be positive", lambda: tuning.Pid(kp=1.0, kd=1.0, **PI)),
        ("fixed must name parameters", lambda: tuning.Pid(kp=1.0, fixed=("kx",), **PI)),
        ("lower must bound parameters", lambda: tuning.Pid(kp=1.0, lower={"kx": 1.0}, **PI)),
        ("lower must bound parameters by name", lambda: tuning.Pid(kp=1.0, lower=1.0, **PI)),
        ("K must be 1 by 1", lambda: tuning.Gain(K=[[1.0, 2.0]], **PI)),
        ("K must be finite", lambda: tuning.Gain(K=float("nan"), **PI)),
        ("omega must be positive", lambda: tuning.Notch(omega=-1.0, **PI)),
        ("reads must name one signal", lambda: tuning.Notch(omega=1.0, reads=[], drives="u")),
        ("one signal each", lambda: tuning.Notch(omega=1.0, reads=["a", "b"], drives="u")),
        ("n_states must be", lambda: tuning.StateSpace(n_states=-1, **PI)),
        ("A must be 1 by 1", lambda: tuning.StateSpace(n_states=1, A=np.eye(2), **PI)),
        ("bound must be positive", lambda: tuning.Limit("d", "y", 0.0)),
        ("band must run from", lambda: tuning.Limit("d", "y", band=(2.0, 1.0))),
        ("band must be", lambda: tuning.Limit("d", "y", band=3.0)),
        ("weight must be stable", lambda: tuning.Limit("d", "y", weight=control.tf([1], [1, -1]))),
        ("worst must be of type bool", lambda: tuning.Limit("d", "y", worst="yes")),
        ("models must hold at least one", lambda: tuning.Plants([], inputs="u", outputs="y")),
        (
            "must have the 1 outputs and 2 inputs",
            lambda: tuning.Plants(1.0, inputs=["u", "v"], outputs="y"),
        ),
        (
            "must be finite on every line",
            lambda: tuning.Plants(
                control.FrequencyResponseData([1.0, np.nan], [1.0, 2.0]), inputs="u", outputs="y"
            ),
        ),
        ("must be a control.StateSpace", lambda: tuning.Plants(["x"], inputs="u", outputs="y")),
    ],
)
def test_a_value_says_what_is_wrong_with_it(message, make):
    with pytest.raises(ValueError, match=message):
        make()


def test_a_limit_that_nothing_changes_is_refused_with_where():
    """A channel beside the loop has its gain whatever the blocks are."""
    beside = control.ss([[-1.0]], [[1.0]], [[3.0]], [[0.0]], inputs="n", outputs="q")
    with pytest.raises(
        ValueError, match=r"hard\[0\] must be a limit that the blocks can change.* factor 3 "
    ):
        ask(system=[ERROR, FORCE, beside], hard=[tuning.Limit("n", "q", 1.0)])


def test_interrupted_the_best_so_far_is_kept():
    calls = []

    def stop(n, best, left):
        calls.append((n, best, left))
        if len(calls) == 3:
            raise KeyboardInterrupt

    design = ask(
        blocks={"K": tuning.Pid(kp=0.1, ki=0.1, reads="e", drives="u")},
        hard=[tuning.Limit("r", "y", 1.3)],
        n_starts=3,
        progress=stop,
    )
    assert design.ended is tuning.Ended.INTERRUPTED
    assert len(design.limits) == 2
    assert len(design.spread) == 1
    assert [n for n, *_ in calls] == sorted(n for n, *_ in calls)
    assert all(left <= 60 for *_, left in calls)


def test_out_of_time_the_best_so_far_is_kept(monkeypatch):
    clock = iter(np.arange(0, 1e4, 0.5))
    monkeypatch.setattr("robust.synthesis.tuning.problem.time.monotonic", lambda: next(clock))
    design = ask(blocks={"K": tuning.Pid(kp=0.1, ki=0.1, reads="e", drives="u")}, time_cap=15.0)
    assert design.ended is tuning.Ended.OUT_OF_TIME
    assert np.isfinite(design.gamma)


def test_large_gains_are_no_algebraic_loop():
    """Blocks in series with gains of 1e6:

    I - D K has a determinant of one, whatever its condition.
    """
    stiff = control.tf([1], [1, 20, 1e5])
    design = robust.tune(
        [ERROR, FORCE],
        tuning.Plants(stiff, inputs="f", outputs="y"),
        {
            "K": tuning.Pid(kp=1e3, ki=1e6, kd=30.0, filter_time=2e-3, reads="e", drives="u_c"),
            "N": tuning.Notch(omega=300.0, reads="u_c", drives="u"),
        },
        hard=[tuning.Limit("d", "f", 1.8)],
        soft=[tuning.Limit("d", "y", 1e-6)],
        dt=1e-3,
        n_starts=1,
    )
    assert design.met
    loop = control.feedback(1, robust.sampled(stiff, 1e-3) * design.controller("y", "u"))
    assert has_norm(control.ss(loop), 1.8 * design.limits[0].ratio)


def test_a_design_of_one_loop_is_a_start():
    """The PID of `design_frf` as a block: the same controller, a start that only gets better, and
    back as a start.
    """
    dt, G = 1e-3, control.tf([400.0], [1, 8, 400])
    first = robust.design_frf(robust.sampled(G, dt), "PID", M_S=1.8, dt=dt, delay=dt)
    block = tuning.Pid.from_gains(robust.io.pid_gains(first.K), reads="e", drives="u")
    z = np.exp(1j * np.array([0.5, 20.0, 300.0]) * dt)
    assert np.allclose(block.system(dt)(z), first.K(z), rtol=1e-9)
    design = robust.tune(
        [ERROR, FORCE],
        tuning.Plants(G, inputs="f", outputs="y"),
        {"K": block},
        hard=[tuning.Limit("d", "f", 1.8)],
        soft=[tuning.Limit("r", "e", 1.0, band=(0.0, 1.0))],
        dt=dt,
        delay=dt,
        n_starts=1,
    )
    assert design.met
    assert (
        design.gamma
        <= abs(1 / (1 + robust.sampled(G, dt, dt)(np.exp(1j * dt)) * first.K(np.exp(1j * dt))))
        * 1.001
    )
    again = robust.design_frf(
        robust.sampled(G, dt), "PID", M_S=1.8, dt=dt, delay=dt, start=design.blocks["K"].system(dt)
    )
    assert robust.io.pid_gains(again.K).kp > 0


@pytest.mark.parametrize("dt", [0.0, 0.01])
def test_any_design_starts_a_block_of_its_own_response(dt: float) -> None:
    """A controller of 2 outputs and 1 input with an integrator, as it is and sampled by Tustin."""
    K = control.ss([[0, 0], [1.0, -30]], [[1.0], [2]], [[1.0, 0], [3, 4]], [[0.5], [0]])
    K = control.sample_system(K, dt, method="bilinear") if dt else K
    block = tuning.StateSpace.from_system(K, reads="e", drives=["u1", "u2"])
    omega = np.geomspace(0.1, 300, 30)
    at = np.exp(1j * omega * dt) if dt else 1j * omega
    np.testing.assert_allclose(block.system(dt)(at), K(at), rtol=1e-10)
    assert block.order == 2
    with pytest.raises(
        ValueError,
        match="K must have 2 inputs and 1 output, as reads and drives name them, got 1 and 2",
    ):
        tuning.StateSpace.from_system(K, reads=["e1", "e2"], drives="u")
