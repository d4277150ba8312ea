"""The shaping page in a browser: dragged, typed at, undone, on a phone, on paper; it asks nobody
for anything.
"""

import json
import sys

import control
import numpy as np
import pytest

import robust
from robust import cli
from tests.support.browser import browser
from tests.support.shaped_loops import content_of, random_loop, shaped, written_content

W_P = robust.performance_weight(2 * np.pi * 0.5, M_S=2.2, A=2e-2)
WAIT = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"


def level(gain, form="multiplicative"):
    """A resonance at 8 Hz behind a lag, its gain that of a level."""
    plant = control.tf([gain * 2500], [1, 10, 2500]) * control.tf([4], [1, 4])
    w = control.tf([0.015, 0.12], [0.0027, 1])
    omega = 2 * np.pi * np.geomspace(0.1, 100, 120)
    return robust.UncertaintyModel(plant, w, form, omega, 0.9 * np.abs(np.squeeze(w(1j * omega))))


@pytest.fixture(scope="module")
def chromium(tmp_path_factory):
    with browser(tmp_path_factory.mktemp("profile")) as page:
        yield page


@pytest.fixture
def page(chromium, tmp_path):
    """The page of two levels, sampled with a delay, as a desktop shows it."""
    robust.shaping.write_shaping_page(
        tmp_path / "shape.html", [level(1), level(1.3)], w_P=W_P, K=1.0, dt=2e-3, delay=1e-3
    )
    screen(chromium, 1300, 1100)
    chromium.open(tmp_path / "shape.html")
    yield chromium
    assert chromium.errors == []
    assert [
        url for url in chromium.requests if not url.startswith(("file://", "data:", "blob:"))
    ] == []


def screen(page, width, height, mobile=False):
    page.ask(
        "Emulation.setDeviceMetricsOverride",
        width=width,
        height=height,
        deviceScaleFactor=1,
        mobile=mobile,
    )


def state(page):
    page.wait(WAIT)
    return page.run("shaping.state()")


def add(page, title):
    page.run(
        f"[...document.querySelectorAll('button')].find(b => b.textContent === '+ {title}').click()"
    )
    return state(page)


def middle(page, selector):
    return page.run(
        f"(() => {{ const b = document.querySelector('{selector}').getBoundingClientRect();"
        " return [b.x + b.width / 2, b.y + b.height / 2]; })()"
    )


def drag(page, begin, dx, dy):
    """Press, move in steps, let go."""
    x, y = begin
    page.ask("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, button="left", clickCount=1)
    for part in (0.25, 0.5, 0.75, 1.0):
        page.ask(
            "Input.dispatchMouseEvent",
            type="mouseMoved",
            x=x + part * dx,
            y=y + part * dy,
            button="left",
            buttons=1,
        )
    page.ask(
        "Input.dispatchMouseEvent",
        type="mouseReleased",
        x=x + dx,
        y=y + dy,
        button="left",
        clickCount=1,
    )
    return state(page)


def press(page, key, code=0, modifiers=0):
    page.ask(
        "Input.dispatchKeyEvent",
        type="keyDown",
        key=key,
        windowsVirtualKeyCode=code,
        modifiers=modifiers,
    )
    page.ask(
        "Input.dispatchKeyEvent",
        type="keyUp",
        key=key,
        windowsVirtualKeyCode=code,
        modifiers=modifiers,
    )
    return state(page)


def test_gain_is_dragged_up_and_every_curve_follows(page):
    before = page.run("shaping.answer().models.map(m => m.maxRs.value)")
    at, per_pixel = middle(page, '[data-handle="-1"]'), page.run("shaping.loop.perPixel()")
    assert drag(page, at, 0, -40)["gain"] == pytest.approx(10 ** (40 * per_pixel / 20), rel=2e-3)
    after = page.run("shaping.answer().models.map(m => m.maxRs.value)")
    assert all(a > b for a, b in zip(after, before, strict=True))
    assert page.run("document.querySelectorAll('.shaping-card').length") == 2


def test_the_curve_itself_is_gain_too(page):
    x, y = page.run(
        "(() => { const o = shaping.loop.over.getBoundingClientRect(), m ="
        " shaping.answer().models[0], f = 0.4; const k = shaping.answer().omega.findIndex(w => w >"
        " 2 * Math.PI * f); return [o.x + shaping.loop.plot.valToPos(f, 'x'), o.y +"
        " shaping.loop.plot.valToPos(20 * Math.log10(Math.hypot(m.lr[k], m.li[k])), 'y')]; })()"
    )
    assert drag(page, (x, y), 0, 30)["gain"] < 1
    assert (
        drag(page, (x, y + 150), 0, 30)["gain"] == state(page)["gain"]
    )  # beside the curve nothing is caught


def test_every_element_is_added_dragged_and_taken_away(page):
    for k, (title, field) in enumerate(
        [("Integrator", None), ("Lead", "phase"), ("Notch", "depth"), ("Roll-off", "zeta")]
    ):
        begun = add(page, title)["elements"][k]
        moved = drag(page, middle(page, f'[data-handle="{k}"]'), 25, -20)["elements"][k]
        assert moved["f"] > begun["f"]
        assert field is None or moved[field] > begun[field]
    page.run("document.querySelectorAll('.shaping-remove')[1].click()")
    assert [element["kind"] for element in state(page)["elements"]] == [
        "integrator",
        "notch",
        "roll-off",
    ]


def test_keys_move_what_has_the_focus_and_undo_takes_it_back(page):
    begun = add(page, "Lead")["elements"][0]
    page.run("document.querySelector('[data-handle=\"0\"]').focus()")
    moved = press(page, "ArrowRight", 39)["elements"][0]
    assert moved["f"] == pytest.approx(begun["f"] * 2 ** (1 / 24), rel=1e-3)
    assert press(page, "ArrowUp", 38)["elements"][0]["phase"] == begun["phase"] + 1
    assert press(page, "z", 90, modifiers=2)["elements"][0] == moved
    assert press(page, "y", 89, modifiers=2)["elements"][0]["phase"] == begun["phase"] + 1
    assert (
        page.run("document.activeElement.dataset.handle") == "0"
    )  # the focus outlives what is drawn anew
    assert press(page, "Delete", 46)["elements"] == []
    for _ in range(5):
        press(page, "z", 90, modifiers=2)
    assert state(page) == {"gain": 1, "elements": []}


def test_numbers_can_be_typed_and_are_kept_in_bounds(page):
    add(page, "Lead")
    change = (
        "(() => {{ const i = document.querySelector('[name={}]'); i.value = '{}';"
        " i.dispatchEvent(new Event('change')); }})()"
    )
    for name, typed, wanted in (
        ("phase0", "200", 85),
        ("phase0", "12.5", 12.5),
        ("f0", "7.25", 7.25),
        ("gain", "3", 3),
    ):
        page.run(change.format(name, typed))
        now = state(page)
        assert (now["gain"] if name == "gain" else now["elements"][0][name[:-1]]) == wanted
    page.run(change.format("f0", ""))
    assert state(page)["elements"][0]["f"] == 7.25


def test_the_verdict_on_the_grid_claims_no_proof(page):
    assert page.run("document.body.innerText").count("Nothing here is proved") == 1
    page.run("shaping.set({ gain: 30, elements: [] })")
    said = page.run(
        "[...document.querySelectorAll('.shaping-card strong')].map(s => s.textContent)"
    )
    reports = [
        robust.check(m, control.ss([], [], [], [[30.0]], 2e-3), w_P=W_P, delay=1e-3, certify=False)
        for m in (level(1), level(1.3))
    ]
    assert (
        [text.startswith("unstable") for text in said]
        == [not report.nominally_stable for report in reports]
        == [True] * 2
    )


def test_a_redraw_takes_less_than_a_frame(page):
    """Sixty frames a second are 16.7 ms each; the shortest of many, as other programs run beside
    this one.
    """
    took = page.run(
        "[...Array(60).keys()].map(k => { shaping.set({ gain: 1 + k / 100, elements:"
        " shaping.state().elements }); return shaping.took; })"
    )
    assert min(took) < 16.7


@pytest.mark.parametrize("width", [360, 390, 800, 1300])
def test_nothing_sticks_out_at_any_width(page, width):
    screen(page, width, 900, mobile=width < 500)
    page.wait(f"{WAIT}.then(() => {WAIT})")
    assert page.run("document.documentElement.scrollWidth") <= width
    widest = page.run(
        "Math.max(...[...document.querySelectorAll('canvas')].map(c =>"
        " c.getBoundingClientRect().right))"
    )
    assert widest <= width
    small = page.run(
        "Math.min(...[...document.querySelectorAll('.shaping-plots figure')].map(f =>"
        " f.clientWidth))"
    )
    assert small >= min(250, width - 40)


def test_a_finger_drags_on_a_phone(page):
    screen(page, 390, 844, mobile=True)
    page.ask("Emulation.setTouchEmulationEnabled", enabled=True)
    page.wait(f"{WAIT}.then(() => {WAIT})")
    x, y = middle(page, '[data-handle="-1"]')
    page.ask("Input.dispatchTouchEvent", type="touchStart", touchPoints=[{"x": x, "y": y}])
    for part in range(1, 5):
        page.ask(
            "Input.dispatchTouchEvent", type="touchMove", touchPoints=[{"x": x, "y": y - 10 * part}]
        )
    page.ask("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
    page.ask("Emulation.setTouchEmulationEnabled", enabled=False)
    assert state(page)["gain"] > 1.2


def test_it_prints(page):
    add(page, "Lead")
    pdf = page.pdf()
    assert pdf.startswith(b"%PDF")
    assert 1 <= pdf.count(b"/Type /Page\n") <= 3
    assert not page.run(
        "document.querySelector('.shaping-page').classList.contains('shaping-printing')"
    )


def test_a_title_cannot_break_out_of_the_page(chromium, tmp_path):
    evil = "</script><script>document.title = 'broken'</script>"
    robust.shaping.write_shaping_page(tmp_path / "shape.html", level(1), title=evil)
    chromium.open(tmp_path / "shape.html")
    assert (
        chromium.run("document.title")
        == evil
        == chromium.run("document.querySelector('h1').textContent")
    )


def test_the_controller_of_the_page_is_a_file_that_check_reads(page, tmp_path):
    add(page, "Lead")
    page.run(
        "globalThis.blobs = []; URL.createObjectURL = blob => { blobs.push(blob); return"
        " 'data:,'; }"
    )
    page.run(
        "[...document.querySelectorAll('button')].find(b => b.textContent === 'Save"
        " controller.json').click()"
    )
    (tmp_path / "controller.json").write_text(page.run("blobs[0].text()"), encoding="utf-8")
    K, at = robust.load(tmp_path / "controller.json"), np.exp(2e-3j * np.array([1.0, 30.0, 300.0]))
    lead = state(page)["elements"][0]
    assert K(at) == pytest.approx(
        robust.shaping.lead(2 * np.pi * lead["f"], np.radians(lead["phase"]), dt=2e-3)(at), rel=1e-9
    )


def run_command(monkeypatch, words):
    monkeypatch.setattr(sys, "argv", words.split())
    with pytest.raises(SystemExit) as stop:
        cli.main()
    assert not stop.value.code


def content_by_command(folder, monkeypatch, model, *, bandwidth, dt):
    """What the page of `robust shape` holds for its script, with the demand of a bandwidth [Hz]."""
    monkeypatch.chdir(folder)
    robust.save(model, "model.json")
    run_command(
        monkeypatch,
        f"robust shape model.json --bandwidth {bandwidth} --sample-time {dt} -o shape.html",
    )
    return content_of(folder / "shape.html")


def test_the_command_writes_it_with_the_command_that_proves(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    robust.save(level(1), "low.json")
    robust.save(level(1.3), "high.json")
    run_command(
        monkeypatch,
        "robust shape low.json high.json --bandwidth 0.5 --sample-time 0.002 --delay 0.001 -o"
        " shape.html",
    )
    assert "wrote shape.html" in capsys.readouterr().out
    text = (tmp_path / "shape.html").read_text(encoding="utf-8")
    assert (
        "robust check low.json controller.json --bandwidth 0.5 --peak 2.0 --error 0.01 --delay"
        " 0.001" in text
    )
    assert "['low.json', 'high.json']" in text


def test_the_widget_holds_the_page_and_gives_the_controller_back():
    pytest.importorskip("anywidget")
    made = robust.shaping.shape(level(1), w_P=W_P, dt=2e-3)
    assert made._esm.rstrip().endswith("} };")
    assert json.loads(json.dumps(made.content))["dt"] == 2e-3
    assert made.K.dt == 2e-3
    made.state = {"gain": 2.0, "elements": [{"kind": "lead", "f": 5.0, "phase": 40.0}]}
    K = 2.0 * robust.shaping.lead(2 * np.pi * 5, np.radians(40), dt=2e-3)
    at = np.exp(2e-3j * np.array([1.0, 30.0]))
    assert made.K(at) == pytest.approx(K(at))
    other = robust.shaping.shape(level(1.3))
    assert type(made).__bases__ == type(other).__bases__  # the class is made once


def test_the_widget_runs_as_a_module(chromium, tmp_path):
    """As a notebook does it: the module is imported, `render` is given a model of traits and an
    element.
    """
    pytest.importorskip("anywidget")
    made = robust.shaping.shape(level(1), w_P=W_P, K=1.0)
    (tmp_path / "empty.html").write_text(
        "<!DOCTYPE html><title>cell</title><body></body>", encoding="utf-8"
    )
    chromium.open(tmp_path / "empty.html")
    chromium.wait(
        f"(async () => {{ const source = {json.dumps(made._esm)}, content ="
        f" {json.dumps(made.content)}; const url = URL.createObjectURL(new Blob([source], {{ type:"
        " 'text/javascript' })); const module = await import(url); globalThis.traits = {"
        " content, state: {} }; module.default.render({ el: document.body, model: { get: name"
        " => traits[name], set: (name, value) => { traits[name] = value; }, save_changes: () =>"
        " { traits.saved = true; } } }); })()"
    )
    assert chromium.errors == []
    add_lead = (
        "[...document.querySelectorAll('button')].find(b => b.textContent === '+ Lead').click()"
    )
    chromium.run(add_lead)
    assert chromium.run("traits.saved && traits.state.elements[0].kind") == "lead"


def machine(stiffness=1e5, f_n=5.0):
    """A mass on a spring: 1 / stiffness [m/N] up to its resonance."""
    omega_n = 2 * np.pi * f_n
    plant = control.tf([omega_n**2 / stiffness], [1, 0.2 * omega_n, omega_n**2])
    w = control.tf([1 / (120 * np.pi), 0.15], [1 / (480 * np.pi), 1])
    omega = 2 * np.pi * np.geomspace(0.5, 200, 120)
    return robust.UncertaintyModel(
        plant, w, "multiplicative", omega, 0.9 * np.abs(np.squeeze(w(1j * omega)))
    )


def test_it_opens_on_a_loop_and_not_on_an_empty_page(chromium, tmp_path):
    """Of 1e-5 m/N: |w| = 1 at 61 Hz, so that |L| = 1 at 31 Hz; curves, verdict and legends are in
    sight.
    """
    robust.shaping.write_shaping_page(tmp_path / "shape.html", machine())
    screen(chromium, 1300, 1100)
    chromium.open(tmp_path / "shape.html")
    chromium.wait(WAIT)
    [crossover] = chromium.run("shaping.answer().models[0].crossovers")
    assert crossover / 2 / np.pi == pytest.approx(30.6, abs=1.0)
    assert (
        chromium.run("document.querySelector('.shaping-card strong').textContent")
        == "holds on the grid"
    )
    assert chromium.run("document.querySelector('.shaping-margins').textContent").startswith(
        "crossover 31.3 Hz · phase 50°"
    )
    low, high = chromium.run("[shaping.loop.plot.scales.y.min, shaping.loop.plot.scales.y.max]")
    size = chromium.run(
        "(() => { const a = shaping.answer(), m = a.models[0]; return Array.from(m.lr,"
        " (r, i) => [a.omega[i] / 2 / Math.PI, 20 * Math.log10(Math.hypot(r, m.li[i]))])"
        ".filter(([f]) => f >= shaping.band.low && f <= shaping.band.high).map(([, d]) => d); })()"
    )
    assert low <= min(size)
    assert high >= max(size)
    text = chromium.run("document.body.innerText")
    assert "too high for the set" in text
    assert "L over the set" in text
    chromium.run(
        "shaping.set({ gain: 1, elements: [] })"
    )  # with a gain of one |L| is at -100 dB, and in sight too
    chromium.wait(WAIT)
    assert chromium.run("shaping.loop.plot.scales.y.min") < -100
    assert "|L| never crosses 1" in chromium.run("document.body.innerText")


def handle_over_curve(page, k):
    """How far a handle stands above or below the curve at its place, and from where it may be at
    most [px].
    """
    return page.run(
        "(() => { const box ="
        f" document.querySelector('[data-handle=\"{k}\"]').getBoundingClientRect(); const o ="
        " shaping.loop.over.getBoundingClientRect(), x = box.x + box.width / 2 - o.x, a ="
        " shaping.answer(); const w = 2 * Math.PI * shaping.loop.plot.posToVal(x, 'x'), m ="
        " a.models[0]; const away = v => Math.abs(Math.log(v / w)); const i ="
        " a.omega.reduce((best, v, j) => away(v) < away(a.omega[best]) ? j : best, 0); const y ="
        " shaping.loop.plot.valToPos(20 * Math.log10(Math.hypot(m.lr[i], m.li[i])), 'y'); return"
        " box.y + box.height / 2 - o.y - Math.min(Math.max(y, 12), o.height - 12); })()"
    )


@pytest.mark.parametrize("gain", [1.0, 1e-4, 3e3, 1e-7])
def test_handles_stay_on_the_curve_when_the_axis_rescales(page, gain):
    """The plot takes a new scale only when it is drawn: handles that were placed before stood
    beside the curve.
    """
    elements = [{"kind": "lead", "f": 2.0, "phase": 30.0}, {"kind": "integrator", "f": 0.3}]
    page.run(f"shaping.set({json.dumps({'gain': gain, 'elements': elements})})")
    state(page)
    before = page.run("[shaping.loop.plot.scales.y.min, shaping.loop.plot.scales.y.max]")
    for k in (-1, 0, 1):
        assert abs(handle_over_curve(page, k)) < 3, k
    page.run(f"shaping.set({json.dumps({'gain': 1e3 * gain, 'elements': elements})})")
    state(page)
    assert page.run("[shaping.loop.plot.scales.y.min, shaping.loop.plot.scales.y.max]") != before
    for k in (-1, 0, 1):
        assert abs(handle_over_curve(page, k)) < 3, k
    screen(page, 800, 900)
    page.wait(f"{WAIT}.then(() => {WAIT})")
    for k in (-1, 0, 1):
        assert abs(handle_over_curve(page, k)) < 3, k


def test_the_numbers_of_the_verdict_explain_themselves(page):
    shown = page.run(
        "[...document.querySelector('.shaping-card').querySelectorAll('[title]')].map(e =>"
        " [e.textContent, e.title])"
    )
    wanted = {
        "max rs": "Below 1",
        "max rp": "meets the demand",
        "phase": "margin",
        "gain": "factor",
        "disk": "together",
    }
    for name, words in wanted.items():
        assert [title for text, title in shown if text.startswith(name) and words in title], name
    assert "rs" in page.run("document.querySelector('.shaping-robust figcaption').textContent")
    assert "every plant of the set" in page.run(
        "document.querySelector('.shaping-robust figcaption').title"
    )


def test_a_peak_where_nothing_is_drawn_has_a_word_for_its_place(chromium, tmp_path):
    """With an integrator rs of a set of 55 % at low frequency is largest at zero frequency: no
    number says that.
    """
    omega = 2 * np.pi * np.geomspace(2, 150, 120)
    w = control.tf([0.55], [1 / 400, 1])
    plant = control.tf([60.0**2], [1, 6, 60.0**2])
    model = robust.UncertaintyModel(
        plant, w, "multiplicative", omega, 0.9 * np.abs(np.squeeze(w(1j * omega)))
    )
    robust.shaping.write_shaping_page(tmp_path / "shape.html", model)
    chromium.open(tmp_path / "shape.html")
    chromium.wait(WAIT)
    chromium.run("shaping.set({ gain: 0.002, elements: [{ kind: 'integrator', f: 30 }] })")
    chromium.wait(WAIT)
    f, low = chromium.run(
        "[shaping.answer().models[0].maxRs.omega / 2 / Math.PI, shaping.band.low]"
    )
    assert f < low
    fact = chromium.run("document.querySelector('.shaping-fact').textContent")
    assert fact.startswith("max rs 0.5")
    assert fact.endswith("below the band")


def resonant(zeta=0.03):
    """A mass on a light spring whose set is wide below its resonance at 58 Hz, as that of a machine
    with friction.
    """
    omega_n, omega = 2 * np.pi * 58, 2 * np.pi * np.geomspace(2.25, 149, 120)
    plant = control.tf([1.16e-5 * omega_n**2], [1, 2 * zeta * omega_n, omega_n**2])
    w = control.tf([0.25 / omega_n, 0.54], [1 / omega_n, 1])
    return robust.UncertaintyModel(
        plant, w, "multiplicative", omega, 0.9 * np.abs(np.squeeze(w(1j * omega)))
    )


def test_a_new_notch_lands_on_the_peak_that_limits(chromium, tmp_path):
    robust.shaping.write_shaping_page(tmp_path / "shape.html", resonant(), K=1.0)
    chromium.open(tmp_path / "shape.html")
    chromium.run("shaping.set({ gain: 20000, elements: [{ kind: 'integrator', f: 9 }] })")
    chromium.wait(WAIT)
    rs = "Math.max(...shaping.answer().models[0].rs)"
    before = chromium.run(rs)
    peak = chromium.run(
        "(() => { const m = shaping.answer().models[0]; return m.maxRs.omega / 2 / Math.PI; })()"
    )
    [_, notch] = add(chromium, "Notch")["elements"]
    assert notch["f"] == pytest.approx(58, rel=0.01)  # the resonance
    assert notch["f"] == pytest.approx(peak, rel=0.15)  # the peak of rs, shifted by feedback
    assert chromium.run(rs) < 0.7 * before
    # a hump of rs at the crossover, under a resonance that limits less, is not the place of a notch
    elements = [
        {"kind": "integrator", "f": 18.0},
        {"kind": "roll-off", "f": 6.6, "order": 1, "zeta": 0.7},
    ]
    chromium.run(f"shaping.set({json.dumps({'gain': 20000, 'elements': elements})})")
    chromium.wait(WAIT)
    assert chromium.run("shaping.answer().models[0].maxRs.omega / 2 / Math.PI") < 20
    assert add(chromium, "Notch")["elements"][-1]["f"] == pytest.approx(58, rel=0.01)


@pytest.mark.parametrize("dt", [0.0, 1e-3])
@pytest.mark.parametrize("bandwidth", [1.0, 3.3, 6.0, 60.0])
def test_a_resonance_above_the_crossover_does_not_keep_the_page_from_a_robust_loop(
    bandwidth, dt, tmp_path, monkeypatch
):
    """A roll-off brings the resonance down; corners stay below Nyquist at a high crossover."""
    content = content_by_command(tmp_path, monkeypatch, resonant(), bandwidth=bandwidth, dt=dt)
    report = robust.check(resonant(), shaped(content["begin"], 1.0, dt), certify=False)
    assert report.nominally_stable
    assert np.max(report.curves.rs) < 1


@pytest.mark.parametrize(
    ("plant", "kinds", "sign", "octave"),
    [
        (control.tf([1], [20, 5, 0]), ["lead"], 1, 1),
        (control.tf([3e-4], [1 / 130, 1]), ["integrator"], 1, 1),
        (control.tf([-3.0], [1 / 130, 1]), ["integrator"], -1, 1),
        (control.tf([1], [0.5, 1]), ["integrator"], 1, 2),
    ],
)
@pytest.mark.parametrize("dt", [0.0, 1e-3])
def test_the_controller_to_begin_with_is_what_the_plant_asks_for(
    plant, kinds, sign, octave, dt, tmp_path, monkeypatch
):
    """A mass with friction takes a lead, a lag and a flat plant an integrator; stable, and |L| = 1
    octaves above the bandwidth, where the loop comes nearest to its demand.
    """
    w, omega = machine().weight, machine().omega
    model = robust.UncertaintyModel(
        plant, w, "multiplicative", omega, 0.9 * np.abs(np.squeeze(w(1j * omega)))
    )
    begin = content_by_command(tmp_path, monkeypatch, model, bandwidth=4.0, dt=dt)["begin"]
    assert [element["kind"] for element in begin["elements"]] == kinds
    assert np.sign(begin["gain"]) == sign
    report = robust.check(model, shaped(begin, 1.0, dt), certify=False)
    assert report.nominally_stable
    assert report.classical.crossover == pytest.approx(2 * np.pi * 4.0 * 2**octave, rel=1e-3)
    assert np.max(report.curves.rs) < 1


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"model": []}, "model must be an UncertaintyModel or a list of them"),
        ({"model": 3}, "model must be an UncertaintyModel"),
        ({"K": robust.shaping.lead(5.0, 0.5, dt=0.01), "dt": 0.02}, "dt must be one sampling time"),
        ({"K": robust.shaping.lead(5.0, 0.5), "dt": 0.02}, "K must be sampled at 0.02 s"),
        ({"path": "shape.txt"}, "path must end in .html"),
        ({"delay": -1.0}, "delay must be zero or positive"),
        ({"w_P": control.tf([1], [1, 0])}, "w_P must be stable"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(change, said, tmp_path):
    asked = {"path": "shape.html", "model": level(1)} | change
    path = tmp_path / asked.pop("path")
    with pytest.raises(ValueError, match=said) as refused:
        robust.shaping.write_shaping_page(path, asked.pop("model"), **asked)
    assert "\n" not in str(refused.value)
    assert not path.exists()


def test_a_model_on_an_frf_is_refused(tmp_path):
    omega = np.geomspace(1, 100, 40)
    frf = control.FrequencyResponseData(1 / (1j * omega + 1), omega)
    model = robust.UncertaintyModel(
        frf, control.tf([0.2], [1]), "multiplicative", omega, np.full(40, 0.1)
    )
    with pytest.raises(ValueError, match=r"parametric nominal.*fit_nominal"):
        written_content(tmp_path, model)


def test_content_is_json_with_no_number_beyond_it(tmp_path):
    for seed in range(6):
        model, w_P, begin, dt, delay, _ = random_loop([seed])
        content = written_content(tmp_path, model, w_P=w_P, K=begin, dt=dt, delay=delay)
        json.dumps(content, allow_nan=False)
