// What a person sees of the shaping page: curves with handles to drag, verdicts, gains, Python. It computes nothing.

const COLOURS = ["#1f6fd1", "#d1681f", "#2a9d5c", "#9b4fc4", "#c43c5a", "#6b7280"];
const FAINT = "#d9dfe6", AXIS = "#5b6774", TOO_LOW = "#1f6fd1", TOO_HIGH = "#d13444";
const FONT = "12px system-ui, sans-serif";
const TALLEST = 120; // of |L| beyond 0 dB or the nearest of its values [dB]
const SETTLED = 0.03, LONGEST = 9; // the step axis grows, at most so often, until the response stays this close to its end
/** What each element is called, starts with, may be, and which of its numbers a vertical drag changes. */
const KINDS = {
  integrator: { title: "Integrator", sign: "∫", begin: f => ({ f: f / 10 }), help: "(s + ω)/s: error to zero", fields: {} },
  lead: { title: "Lead", sign: "φ", begin: f => ({ f, phase: 30 }), help: "phase at its frequency, gain one there",
    fields: { phase: { title: "phase", unit: "°", least: 1, most: 85, perPixel: 0.25, key: 1 } } },
  notch: { title: "Notch", sign: "V", begin: (f, resonance) => ({ f: resonance || 3 * f, depth: 0.2, width: 0.5 }), help: "a dip over the resonance that limits rs",
    fields: { depth: { title: "depth", unit: "", least: 0.01, most: 10, ratio: 0.01, key: 0.06 },
      width: { title: "width", unit: "", least: 0.02, most: 3, ratio: 0.01, key: 0.06 } } },
  "roll-off": { title: "Roll-off", sign: "↘", begin: f => ({ f: 5 * f, order: 1, zeta: 0.7 }), help: "low-pass against noise",
    fields: { zeta: { title: "damping", unit: "", least: 0.1, most: 1.5, ratio: 0.005, key: 0.03 },
      order: { title: "order", unit: "", least: 1, most: 2, whole: true } } },
};
/** What the numbers of a verdict mean, shown where the pointer rests. */
const MEANING = {
  rs: "Robust stability: share of the distance from L to −1 that the set takes up, at its largest. Below 1 the loop is stable with every plant of the set.",
  rp: "Robust performance: |w_P S| with the worst plant of the set, at its largest. At most 1 every plant meets the demand.",
  crossover: "Frequencies at which the nominal |L| is 1.",
  phase: "Phase margin of the nominal loop: the phase lag at a crossover that makes it unstable.",
  gain: "Gain margin of the nominal loop: the factor of the gain that makes it unstable.",
  disk: "Disk margin α of the nominal loop, 0 to 2: gain and phase may change together. The gain alone may change by a factor up to (2 + α)/(2 − α), the phase alone by up to 2 arctan(α/2).",
};
const clamp = (x, low, high) => Math.min(high, Math.max(low, x));
const tidy = x => Number(x.toPrecision(4));
const db = x => 20 * Math.log10(Math.max(x, 1e-12));
const brief = x => (Number.isFinite(x) ? String(Number(x.toPrecision(3))) : x === Infinity ? "∞" : "–");

/** An element of the page: make("div.name", {attributes}, ...children). */
function make(what, attributes = {}, ...children) {
  const [tag, ...names] = what.split("."), made = document.createElement(tag);
  made.className = names.map(name => `shaping-${name}`).join(" ");
  for (const [name, content] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), content); else made.setAttribute(name, content);
  }
  made.append(...children);
  return made;
}

/** Fill an element with the page; `changed(state)` is told of every step that undo can take back. */
function start(root, content, changed = () => {}, begin = null) {
  const problem = prepare(content), band = bandOf(content);
  let state = begin || content.begin;
  const history = { past: [], future: [], last: JSON.stringify(state) };
  const page = { content, problem, frames: 0, took: 0, key: `shaping-${Math.random()}` };
  let answer = null, waiting = false, dragging = false, scale = null;

  // ------------------------------------------------------------------------------------------------------ the frame
  root.classList.add("shaping-page");
  root.tabIndex = -1;
  const undo = make("button", { type: "button", onclick: () => step(history.past, history.future), title: "Ctrl+Z" }, "Undo");
  const redo = make("button", { type: "button", onclick: () => step(history.future, history.past), title: "Ctrl+Y" }, "Redo");
  const kind = [...new Set(content.models.map(model => model.set))].join("; ");
  const clock = content.dt ? `sampled at ${brief(1 / content.dt)} Hz` : "continuous";
  const late = content.delay ? `, delay ${brief(content.delay * 1e3)} ms` : "";
  const verdicts = make("section.verdicts", { "aria-live": "polite", "aria-label": "Verdicts" });
  const panels = Object.fromEntries([
    ["loop", "Loop gain |L| and its bounds", [...(problem.demand ? [[TOO_LOW, "too low for the demand"]] : []), [TOO_HIGH, "too high for the set"]]],
    ["nyquist", "Nyquist, with the discs of the set", content.models.map((model, k) => [COLOURS[k % 6], content.models.length > 1 ? `L of ${model.name} over its set` : "L over the set"])],
    ["robust", `rs${problem.demand ? " (solid) and rp (dashed)" : ""}, to lie below 1`, [], `${MEANING.rs}${problem.demand ? ` ${MEANING.rp}` : ""}`], ["sensitivity", `|S| (solid) and |T| (dashed)${problem.demand ? ", 1/|w_P| (dotted)" : ""}`],
    ["step", "Step response, r to y"],
  ].map(([name, title, areas, help]) => [name, panel(name, title, areas, help)]));
  const elements = make("section.elements", { "aria-label": "Controller" }), gains = make("div.gains");
  const python = make("pre.code", { tabindex: 0, "aria-label": "Python" });
  root.append(
    make("header.head", {}, make("div", {}, make("h1", {}, content.title), make("p.kind", {}, `${kind}; ${clock}${late}`),
      ...content.warnings.map(text => make("p.kind.warned", {}, `Warning: ${text}`))),
      make("div.buttons", {}, undo, redo)),
    verdicts,
    make("div.body", {},
      make("div.plots", {}, ...Object.values(panels).map(p => p.frame)),
      make("div.side", {}, elements, make("section", {}, make("h2", {}, "PID gains"), gains)),
      make("div.side.below", {},
        make("section.prove", {}, make("h2", {}, "Prove"), ...proving(content, () => state)),
        make("section", {}, make("h2", {}, "Python"), copyButton(() => python.textContent), python))));

  const loop = curvePlot(panels.loop.place, { y: [-60, 60], label: "|L| [dB]", tall: true, below: drawBounds, drawn: () => answer && placeHandles() });
  const robust = curvePlot(panels.robust.place, { y: [0, 1.5], label: problem.demand ? "rs, rp [-]" : "rs [-]", below: drawLimit, dashes: [[], [6, 4]] });
  const sensitivity = curvePlot(panels.sensitivity.place, { y: [-50, 15], label: "|S|, |T| [dB]", dashes: [[], [6, 4]], demand: true });
  const stepPlot = curvePlot(panels.step.place, { y: [-0.2, 1.8], label: "y over the step of r [-]", time: true });
  const nyquist = nyquistPlot(panels.nyquist.place);
  const handles = new Map();
  loop.over.addEventListener("pointerdown", grabCurve);
  drawElements();

  // -------------------------------------------------------------------------------------------------------- changing
  function set(next) { state = next; request(); }

  function commit() {
    const now = JSON.stringify(state);
    if (now === history.last) return;
    history.past.push(history.last); history.future.length = 0; history.last = now;
    changed(state);
    request();
  }

  function step(from, to) {
    if (!from.length) return;
    to.push(history.last); history.last = from.pop(); state = JSON.parse(history.last);
    drawElements(); changed(state); request();
  }

  function altered(k, numbers) {
    const next = state.elements.map((element, i) => (i === k ? limited({ ...element, ...numbers }) : element));
    set({ ...state, elements: next });
  }

  function limited(element) {
    const out = { ...element, f: tidy(clamp(element.f, band.low, band.highest)) };
    for (const [name, field] of Object.entries(KINDS[element.kind].fields)) {
      out[name] = tidy(clamp(element[name], field.least, field.most));
      if (field.whole) out[name] = Math.round(out[name]);
    }
    return out;
  }

  function amplify(gain) { set({ ...state, gain: tidy(Math.sign(gain || state.gain) * clamp(Math.abs(gain), 1e-12, 1e12)) }); }

  function add(name) {
    const f = answer && answer.models[0].crossovers.length ? answer.models[0].crossovers.at(-1) / TWO_PI : Math.sqrt(band.low * band.high);
    set({ ...state, elements: [...state.elements, limited({ kind: name, ...KINDS[name].begin(clamp(f, band.low, band.high), answer && limitingResonance()) })] });
    drawElements(); commit();
  }

  /** The frequency [Hz] of the resonance that limits, 0 where there is none: the peak of |L| in the band with the largest
   * rs, of any model. The peak of rs itself lies beside it, moved by feedback: a notch there would turn its phase. */
  function limitingResonance() {
    const found = answer.models.flatMap(m => peaks(Float64Array.from(m.lr, (r, i) => Math.hypot(r, m.li[i])))
      .map(i => ({ f: answer.omega[i] / TWO_PI, rs: m.rs[i] })).filter(({ f }) => f >= band.low && f <= band.highest));
    return found.reduce((one, other) => (other.rs > one.rs ? other : one), { f: 0, rs: 0 }).f;
  }

  function remove(k) { set({ ...state, elements: state.elements.filter((_, i) => i !== k) }); drawElements(); commit(); }

  // -------------------------------------------------------------------------------------------------------- dragging
  function drag(event, move) {
    event.preventDefault();
    dragging = true; // axes hold still under the pointer
    const target = event.currentTarget;
    if (target.setPointerCapture && event.pointerId !== undefined) target.setPointerCapture(event.pointerId);
    let [x, y] = [event.clientX, event.clientY];
    const moved = e => { move(e.clientX - x, e.clientY - y, e); [x, y] = [e.clientX, e.clientY]; };
    const done = () => {
      dragging = false;
      target.removeEventListener("pointermove", moved);
      target.removeEventListener("pointerup", done);
      target.removeEventListener("pointercancel", done);
      drawElements(); commit(); request();
    };
    target.addEventListener("pointermove", moved);
    target.addEventListener("pointerup", done);
    target.addEventListener("pointercancel", done);
  }

  function dragGain() {
    let exact = state.gain; // rounding must not swallow slow drags
    return (dx, dy) => { exact *= Math.pow(10, -dy * loop.perPixel() / 20); amplify(exact); };
  }

  function grabCurve(event) {
    if (event.target !== loop.over || !answer) return;
    const box = loop.over.getBoundingClientRect(), f = loop.plot.posToVal(event.clientX - box.left, "x");
    const { lr, li } = answer.models[0], k = nearest(answer.omega, TWO_PI * f);
    const away = Math.abs(loop.plot.valToPos(db(Math.hypot(lr[k], li[k])), "y") - (event.clientY - box.top));
    if (away < (event.pointerType === "touch" ? 26 : 14)) drag(event, dragGain());
  }

  function dragElement(k) {
    const exact = { ...state.elements[k] };
    return (dx, dy) => {
      exact.f = clamp(exact.f * Math.pow(10, dx * loop.decadesPerPixel()), band.low, band.highest);
      const [name, field] = Object.entries(KINDS[exact.kind].fields)[0] || [];
      if (field) {
        // up is more: phase, gain at the notch, damping
        exact[name] = field.perPixel ? exact[name] - field.perPixel * dy : exact[name] * Math.exp(-field.ratio * dy);
        exact[name] = clamp(exact[name], field.least, field.most);
      }
      altered(k, exact);
    };
  }

  function key(event, k) {
    const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (steps) {
      const much = event.shiftKey ? 6 : 1;
      if (k < 0) amplify(state.gain * Math.pow(10, (steps[1] || steps[0]) * much * 0.5 / 20));
      else {
        const element = state.elements[k], [name, field] = Object.entries(KINDS[element.kind].fields)[0] || [];
        const numbers = { f: element.f * Math.pow(2, steps[0] * much / 24) };
        if (field) numbers[name] = field.perPixel ? element[name] + steps[1] * much * field.key : element[name] * Math.exp(steps[1] * much * field.key);
        altered(k, numbers);
      }
    } else if (k >= 0 && (event.key === "Delete" || event.key === "Backspace")) remove(k);
    else return;
    event.preventDefault();
    drawElements(); commit();
  }

  root.setAttribute("data-lm-suppress-shortcuts", "true"); // a notebook has keys of its own
  root.addEventListener("keydown", event => {
    event.stopPropagation();
    if (!(event.ctrlKey || event.metaKey)) return;
    const pressed = event.key.toLowerCase();
    if (pressed === "z" && !event.shiftKey) step(history.past, history.future);
    else if (pressed === "y" || (pressed === "z" && event.shiftKey)) step(history.future, history.past);
    else return;
    event.preventDefault();
  });

  // --------------------------------------------------------------------------------------------------------- drawing
  function request() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; draw(); });
  }

  function draw() {
    const begun = performance.now();
    answer = evaluate(problem, state);
    const x = Array.from(answer.omega, omega => omega / TWO_PI);
    const every = of => answer.models.map(of);
    const size = every(m => Float64Array.from(m.lr, (r, i) => db(Math.hypot(r, m.li[i]))));
    if (!dragging) scale = gainRange(size, x, band);
    loop.show(x, size, scale);
    robust.show(x, [...every(m => (m.stable ? m.rs : blank(m.rs))), ...(problem.demand ? every(m => (m.stable ? m.rp : blank(m.rp))) : [])],
      [0, clamp(1.15 * Math.max(1.1, ...every(m => (m.stable ? Math.max(m.maxRs.value, m.maxRp ? m.maxRp.value : 0) : 0))), 1.25, 3)]);
    sensitivity.show(x, [...every(m => m.S.map(db)), ...every(m => m.T.map(db)), ...(problem.demand ? [answer.size.map(p => -db(p))] : [])], [-50, 16]);
    drawStep();
    nyquist.show(answer, content);
    drawVerdicts();
    python.textContent = pythonOf(content, state);
    drawGains();
    undo.disabled = !history.past.length; redo.disabled = !history.future.length;
    page.took = performance.now() - begun;
    page.frames += 1;
  }

  function drawStep() {
    const fast = Math.max(...answer.models.map(m => m.crossovers[m.crossovers.length - 1] || 0)), stable = answer.models.every(m => m.stable);
    const wanted = 6 / (fast || TWO_PI * band.low), power = Math.pow(10, Math.floor(Math.log10(wanted)));
    const lengths = Array.from({ length: LONGEST }, (_, k) => [1, 2, 5][k % 3] * power * Math.pow(10, Math.floor(k / 3))).filter(end => end >= wanted);
    const end = lengths.find(length => answer.models.every(m => !m.stable || settles(m, length))) || lengths[lengths.length - 1];
    let times = Array.from({ length: 121 }, (_, k) => k * end / 120);
    if (content.dt) times = sampledTimes(content.dt, end);
    const shown = answer.models.map(m => (m.stable ? stepOf(m, times) : times.map(() => null)));
    stepPlot.show(times, shown, range(shown), [0, end]);
    panels.step.note.textContent = stable ? "" : "loop unstable";
  }

  /** Whether the last third of a step response stays at its end, Re T at the lowest frequency. */
  function settles(m, length) {
    const times = Array.from({ length: 8 }, (_, k) => length * (0.66 + 0.34 * k / 7));
    return stepOf(m, times).every(y => Math.abs(y - m.Tr[0]) < SETTLED);
  }

  function stepOf(m, times) {
    const keep = [0]; // points that say something
    for (let i = 1; i < answer.omega.length; i++) {
      const last = keep[keep.length - 1];
      if (Math.abs(m.Tr[i] - m.Tr[last]) > 0.01 || answer.omega[i] > 1.08 * answer.omega[last]) keep.push(i);
    }
    return stepResponse(Float64Array.from(keep, i => answer.omega[i]), Float64Array.from(keep, i => m.Tr[i]), times, content.dt);
  }

  function drawVerdicts() {
    const cards = answer.models.map((m, k) => {
      const good = m.verdict === "holds on the grid";
      const facts = m.stable ? [["rs", m.maxRs.value, m.maxRs.omega], ...(m.maxRp ? [["rp", m.maxRp.value, m.maxRp.omega]] : [])] : [];
      const margins = m.stable ? [["crossover", crossing(m.crossovers)], ["phase", `phase ${brief(m.phaseMargin * 180 / Math.PI)}°`], ["gain", `gain ×${brief(m.gainMargin)}`], ["disk", `disk ${brief(m.disk)}`]] : [];
      const said = m.verdict === "unstable" ? `unstable: ${m.count} poles` : m.verdict;
      return make(`div.card${good ? "" : m.verdict === "demand not met" ? ".weak" : ".bad"}`, { style: `--level:${COLOURS[k % 6]}` },
        make("span.level", {}, content.models.length > 1 ? m.name : "Nominal and set"), make("strong", {}, said),
        ...facts.map(([name, value, omega]) => make("span.fact", {}, make("span.help", { title: MEANING[name] }, `max ${name}`), ` ${value > 99 ? "∞" : value.toFixed(3)}`, make("small", {}, ` ${placeOf(omega)}`))),
        make("span.margins", {}, ...margins.flatMap(([name, text], i) => [i ? " · " : "", make("span.help", { title: MEANING[name] }, text)])));
    });
    verdicts.replaceChildren(...cards, make("p.note", {}, "On a grid of frequencies. Nothing here is proved; “Prove” says how it is."));
  }

  /** Where a peak lies: a number says nothing where nothing was measured and nothing is drawn. */
  function placeOf(omega) {
    const f = omega / TWO_PI;
    if (f < band.low) return "below the band";
    return f > band.high ? "above the band" : `at ${brief(f)} Hz`;
  }

  function crossing(found) {
    if (!found.length) return "|L| never crosses 1";
    return `crossover${found.length > 1 ? "s" : ""} ${found.map(omega => brief(omega / TWO_PI)).join(", ")} Hz`;
  }

  function drawGains() {
    const found = pidGains(state, content.dt);
    if (content.begun) gains.replaceChildren(make("p", {}, "None: the controller begins with one that was given."));
    else if (!found) gains.replaceChildren(make("p", {}, "None: a PID has one integrator and one lead at most."));
    else {
      const row = (name, x) => make("div.gain", {}, make("span", {}, name), make("output", {}, String(Number(x.toPrecision(6)))));
      const rest = found.rest.length ? ` In series with: ${found.rest.join(", ")}.` : "";
      const how = content.dt ? "kp + ki/s + kd s/(filter_time s + 1), by Tustin." : "kp + ki/s + kd s/(filter_time s + 1).";
      gains.replaceChildren(row("kp", found.kp), row("ki", found.ki), row("kd", found.kd), row("filter_time", found.filter_time), make("p", {}, how + rest));
    }
  }

  function drawElements() {
    const number = (label, value, unit, change, name) => make("label", {}, `${label} `, make("input", { type: "number", step: "any", value, name,
      onchange: event => { const x = Number(event.target.value); if (Number.isFinite(x) && event.target.value !== "") { change(x); commit(); } drawElements(); } }), unit);
    const rows = state.elements.map((element, k) => make("div.element", {}, make("span.sign", { "data-kind": element.kind }, KINDS[element.kind].sign),
      make("strong", {}, KINDS[element.kind].title), number("", element.f, " Hz", f => f > 0 && altered(k, { f }), `f${k}`),
      ...Object.entries(KINDS[element.kind].fields).map(([name, field]) => number(field.title, element[name], field.unit, x => altered(k, { [name]: x }), `${name}${k}`)),
      make("button.remove", { type: "button", "aria-label": `Remove ${KINDS[element.kind].title}`, onclick: () => remove(k) }, "×")));
    const buttons = Object.entries(KINDS).map(([name, row]) => make("button", { type: "button", title: row.help, onclick: () => add(name) }, `+ ${row.title}`));
    elements.replaceChildren(make("h2", {}, "Controller"),
      make("div.element", {}, make("span.sign", { "data-kind": "gain" }, "k"), make("strong", {}, "Gain"), number("", state.gain, "", amplify, "gain")),
      ...rows, make("div.adders", {}, ...buttons), make("p.note", {}, "Drag the curve for gain, the handles for the rest; arrow keys work on both."));
    drawHandles();
  }

  function drawHandles() {
    const focused = document.activeElement && document.activeElement.dataset ? document.activeElement.dataset.handle : undefined;
    for (const handle of handles.values()) handle.remove();
    handles.clear();
    const one = (k, name, sign, title, move) => {
      const made = make("div.handle", { tabindex: 0, role: "slider", "data-handle": k, "data-kind": name, "aria-label": title,
        onpointerdown: event => { made.focus({ preventScroll: true }); drag(event, move(k)); }, onkeydown: event => key(event, k) }, sign);
      loop.over.append(made); handles.set(k, made);
      if (String(k) === focused) made.focus({ preventScroll: true });
    };
    one(-1, "gain", "↕", "Gain", dragGain);
    state.elements.forEach((element, k) => one(k, element.kind, KINDS[element.kind].sign, KINDS[element.kind].title, dragElement));
    if (answer) placeHandles();
  }

  function placeHandles() {
    const m = answer.models[0];
    for (const [k, handle] of handles) {
      const element = state.elements[k];
      const f = element ? element.f : clamp(m.crossovers.length ? m.crossovers.at(-1) / TWO_PI : Math.sqrt(band.low * band.high), band.low, band.high);
      const i = nearest(answer.omega, TWO_PI * f), x = loop.plot.valToPos(clamp(f, band.low, band.high), "x");
      const y = loop.plot.valToPos(db(Math.hypot(m.lr[i], m.li[i])), "y"), high = loop.over.clientHeight;
      handle.style.transform = `translate(${x}px, ${clamp(y, 12, high - 12)}px)`;
      const said = element ? `${brief(element.f)} Hz${Object.entries(KINDS[element.kind].fields).map(([n, field]) => `, ${field.title} ${brief(element[n])}${field.unit}`).join("")}` : `gain ${brief(state.gain)}`;
      handle.setAttribute("aria-valuetext", said); handle.setAttribute("aria-valuenow", element ? element.f : state.gain); handle.title = said;
    }
  }

  // ----------------------------------------------------------------------------------------------------------- plots
  /** A plot of curves over frequency, or time, with room for what lies below them. */
  function curvePlot(place, { y, label, tall = false, time = false, below = null, drawn = null, dashes = [[]], demand = false }) {
    const count = content.models.length, series = [{}];
    for (const dash of dashes) for (let k = 0; k < count; k++) series.push({ stroke: COLOURS[k % 6], width: dash.length ? 1.6 : 2, dash, points: { show: false }, spanGaps: false });
    if (dashes.length > 1 && !demand && !problem.demand) series.splice(1 + count);
    if (demand && problem.demand) series.push({ stroke: "#8a94a0", width: 1.4, dash: [2, 3], points: { show: false } });
    let yRange = y, xRange = time ? [0, 1] : [band.low, band.high];
    const axisOf = (size, more) => ({ stroke: AXIS, font: FONT, grid: { stroke: FAINT, width: 1 }, ticks: { show: false }, gap: 4, size, labelFont: FONT, labelSize: 18, labelGap: 0, ...more });
    const frequencies = (u, splits) => splits.map(v => (Math.abs(Math.log10(v) - Math.round(Math.log10(v))) < 1e-6 ? brief(v) : /^[25]/.test(v.toExponential()) && band.high / band.low < 1000 ? brief(v) : ""));
    const options = { width: 300, height: 200, legend: { show: false }, cursor: { y: false, points: { show: false }, drag: { x: false, y: false }, ...(time ? {} : { sync: { key: page.key } }) },
      padding: [8, 10, 0, 0],
      scales: { x: time ? { time: false, range: () => xRange } : { time: false, distr: 3, range: () => xRange }, y: { range: () => yRange } },
      axes: [axisOf(24, time ? { label: "Time [s]" } : { label: "Frequency [Hz]", values: frequencies, filter: (u, splits) => splits }), axisOf(40, { label, values: (u, splits) => splits.map(brief) })], series,
      hooks: { drawClear: below ? [below] : [], draw: drawn ? [drawn] : [] } }; // a scale is new only when the plot is drawn
    const plot = new uPlot(options, [[1], ...series.slice(1).map(() => [null])], place);
    const fit = () => {
      const width = Math.max(220, Math.floor(place.clientWidth)), height = tall ? clamp(Math.round(0.72 * width), 300, 420) : clamp(Math.round(0.66 * width), 190, 260);
      if (width !== plot.width || height !== plot.height) plot.setSize({ width, height });
    };
    watch(place, fit);
    return { plot, over: plot.over,
      show(x, curves, range, times) { yRange = range || yRange; if (times) xRange = times; plot.setData([x, ...curves]); },
      perPixel: () => (yRange[1] - yRange[0]) / plot.over.clientHeight,
      decadesPerPixel: () => Math.log10(xRange[1] / xRange[0]) / plot.over.clientWidth };
  }

  function drawBounds(u) {
    const { ctx, bbox } = u, right = bbox.left + bbox.width, bottom = bbox.top + bbox.height;
    ctx.save(); ctx.beginPath(); ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height); ctx.clip();
    ctx.globalAlpha = 0.14 / Math.pow(content.models.length, 0.7);
    for (const model of content.models) {
      for (const [name, colour, edge] of [["low", TOO_LOW, bottom], ["high", TOO_HIGH, bbox.top]]) {
        ctx.fillStyle = colour; ctx.beginPath();
        model.lines.forEach((omega, i) => {
          const x = u.valToPos(omega / TWO_PI, "x", true), v = model[name][i], none = name === "low" ? v === 0 : v >= 1e299;
          const hopeless = name === "low" ? v >= 1e299 : v === 0, far = name === "low" ? bbox.top : bottom;
          const y = none ? edge : hopeless ? far : clamp(u.valToPos(db(v), "y", true), bbox.top, bottom);
          if (i === 0) ctx.moveTo(x, edge);
          ctx.lineTo(x, y);
          if (i === model.lines.length - 1) ctx.lineTo(x, edge);
        });
        ctx.fill();
      }
    }
    ctx.globalAlpha = 1; level(u, ctx, 0, AXIS, right); ctx.restore();
  }

  function drawLimit(u) { u.ctx.save(); level(u, u.ctx, 1, "#d13444", u.bbox.left + u.bbox.width); u.ctx.restore(); }

  function level(u, ctx, value, colour, right) {
    const y = Math.round(u.valToPos(value, "y", true)) + 0.5;
    ctx.setLineDash([]); ctx.strokeStyle = colour; ctx.lineWidth = devicePixelRatio; ctx.beginPath(); ctx.moveTo(u.bbox.left, y); ctx.lineTo(right, y); ctx.stroke();
  }

  document.fonts?.ready.then(request);
  root.ownerDocument.defaultView.addEventListener("beforeprint", () => { root.classList.add("shaping-printing"); draw(); });
  root.ownerDocument.defaultView.addEventListener("afterprint", () => root.classList.remove("shaping-printing"));
  draw();
  return Object.assign(page, { eval: s => evaluate(problem, s), state: () => state, answer: () => answer, set: next => { set(next); drawElements(); commit(); draw(); }, loop, band });
}

/** The band that is drawn, and the highest frequency an element may have [Hz]. */
function bandOf(content) {
  const lines = content.models.flatMap(model => [model.lines[0], model.lines[model.lines.length - 1]]).map(omega => omega / TWO_PI);
  const nyquist = content.dt ? 0.5 / content.dt : Infinity, high = Math.max(...lines) * (content.models[0].lines.length > 1 ? 1.6 : 30);
  const low = Math.min(...lines) / (content.models[0].lines.length > 1 ? 1.6 : 30);
  return { low, high: Math.min(high, nyquist), highest: Math.min(high, 0.9 * nyquist) };
}

/** A picture with its title, and a legend of its shaded areas, [colour, words]. */
function panel(name, title, areas = [], help = "") {
  const place = make("div.place"), note = make("span.unit");
  const legend = make("div.legend", {}, ...areas.map(([colour, words]) => make("span", { style: `--area:${colour}` }, words)));
  return { frame: make(`figure.panel.${name}`, {}, make("figcaption", help ? { title: help } : {}, title, note), legend, place), place, note };
}

function watch(place, fit) { new ResizeObserver(fit).observe(place); requestAnimationFrame(fit); }

function blank(values) { return Array.from(values, () => null); }

function nearest(omega, wanted) {
  let low = 0, high = omega.length - 1;
  while (high - low > 1) { const middle = (low + high) >> 1; if (omega[middle] <= wanted) low = middle; else high = middle; }
  return wanted - omega[low] < omega[high] - wanted ? low : high;
}

/** Least and largest value of the curves inside a band. */
function extremes(curves, x, band) {
  let low = Infinity, high = -Infinity;
  for (const curve of curves) for (let i = 0; i < curve.length; i++) {
    if (curve[i] === null || !Number.isFinite(curve[i]) || (x && (x[i] < band.low || x[i] > band.high))) continue;
    low = Math.min(low, curve[i]); high = Math.max(high, curve[i]);
  }
  return [low, high];
}

/** Decibels that hold every curve and 0 dB. What lies more
 * than TALLEST beyond the nearest of both is cut off: a notch to zero, a pole on the axis. */
function gainRange(curves, x, band) {
  const [low, high] = extremes(curves, x, band);
  if (!(high >= low)) return [-40, 40];
  const bottom = Math.max(Math.min(0, low), Math.min(0, high) - TALLEST), top = Math.min(Math.max(0, high), Math.max(0, low) + TALLEST);
  return [20 * Math.floor((bottom - 4) / 20), 20 * Math.ceil((top + 4) / 20)];
}

/** A range around step responses. */
function range(curves) {
  const [low, high] = extremes(curves);
  if (!(high >= low)) return [0, 1.5];
  return [clamp(0.25 * Math.floor((low - 0.03) / 0.25), -3, 3.75), clamp(0.25 * Math.ceil((high + 0.03) / 0.25), -2.75, 4)];
}

function sampledTimes(dt, end) {
  const stride = Math.max(1, Math.ceil(end / dt / 160));
  return Array.from({ length: Math.floor(end / dt / stride) + 1 }, (_, k) => k * stride * dt);
}

/** L in the complex plane with the disc that each frequency fills over the set. */
function nyquistPlot(place) {
  const canvas = make("canvas.nyquist", { role: "img", "aria-label": "Nyquist plot" });
  let reach = 1.6, last = null;
  const zoom = factor => () => { reach = clamp(reach * factor, 0.4, 100); if (last) draw(...last); };
  place.append(canvas, make("div.zoom", {}, make("button", { type: "button", "aria-label": "Zoom out", onclick: zoom(1.5) }, "−"), make("button", { type: "button", "aria-label": "Zoom in", onclick: zoom(1 / 1.5) }, "+")));
  watch(place, () => last && draw(...last));
  function draw(answer, content) {
    const wide = Math.max(220, place.clientWidth), high = clamp(Math.round(0.72 * wide), 300, 420), scale = devicePixelRatio || 1;
    if (canvas.width !== Math.round(wide * scale) || canvas.height !== Math.round(high * scale)) {
      canvas.width = Math.round(wide * scale); canvas.height = Math.round(high * scale);
      canvas.style.width = `${wide}px`; canvas.style.height = `${high}px`;
    }
    const ctx = canvas.getContext("2d"), unit = high / 2 / reach, x = re => wide / 2 + unit * (re + 0.45 * reach), y = im => high / 2 - unit * im;
    ctx.setTransform(scale, 0, 0, scale, 0, 0); ctx.clearRect(0, 0, wide, high);
    ctx.strokeStyle = FAINT; ctx.lineWidth = 1; ctx.beginPath();
    ctx.moveTo(0, y(0)); ctx.lineTo(wide, y(0)); ctx.moveTo(x(0), 0); ctx.lineTo(x(0), high); ctx.stroke();
    ctx.setLineDash([3, 3]); ctx.strokeStyle = "#aab3bd"; ctx.beginPath(); ctx.arc(x(0), y(0), unit, 0, TWO_PI); ctx.stroke(); ctx.setLineDash([]);
    answer.models.forEach((m, k) => {
      const colour = COLOURS[k % 6], inverse = content.models[k].inverse;
      ctx.fillStyle = colour; ctx.globalAlpha = 0.1;
      let [pr, pi] = [Infinity, Infinity];
      for (let i = 0; i < m.lr.length; i++) {
        if (Math.hypot(m.lr[i] - pr, m.li[i] - pi) < 0.06 * reach || Math.hypot(m.lr[i], m.li[i]) > 4 * reach) continue;
        [pr, pi] = [m.lr[i], m.li[i]];
        const q = Math.hypot(m.qr[i], m.qi[i]), away = 1 - q * q;
        if (inverse && q >= 1) continue; // the outside of a disc
        const radius = inverse ? Math.hypot(pr, pi) * q / away : q, [cr, ci] = inverse ? [pr / away, pi / away] : [pr, pi];
        ctx.beginPath(); ctx.arc(x(cr), y(ci), Math.min(unit * radius, 1e4), 0, TWO_PI); ctx.fill();
      }
      ctx.globalAlpha = 1; ctx.strokeStyle = colour; ctx.lineWidth = 2; ctx.beginPath();
      let drawing = false;
      for (let i = 0; i < m.lr.length; i++) {
        if (Math.hypot(m.lr[i], m.li[i]) > 30 * reach) { drawing = false; continue; }
        if (drawing) ctx.lineTo(x(m.lr[i]), y(m.li[i])); else ctx.moveTo(x(m.lr[i]), y(m.li[i]));
        drawing = true;
      }
      ctx.stroke();
    });
    ctx.strokeStyle = "#d13444"; ctx.lineWidth = 2; ctx.beginPath();
    ctx.moveTo(x(-1) - 6, y(0)); ctx.lineTo(x(-1) + 6, y(0)); ctx.moveTo(x(-1), y(0) - 6); ctx.lineTo(x(-1), y(0) + 6); ctx.stroke();
    ctx.fillStyle = AXIS; ctx.font = FONT; ctx.fillText("−1", x(-1) + 8, y(0) - 8); ctx.fillText("|L| = 1", x(0.72) + 4, y(0.72));
    ctx.fillText("Im L [-]", x(0) + 5, 12); ctx.textAlign = "right"; ctx.fillText("Re L [-]", wide - 4, y(0) - 5); ctx.textAlign = "left";
  }
  return { show(answer, content) { last = [answer, content]; draw(answer, content); } };
}

function copyButton(text) {
  const button = make("button.copy", { type: "button", onclick: async () => {
    try { await navigator.clipboard.writeText(text()); button.textContent = "Copied"; } catch { button.textContent = "Select it"; }
    setTimeout(() => { button.textContent = "Copy"; }, 1500);
  } }, "Copy");
  return button;
}

/** How what is shown here is proved: a file of the controller, and the command or the Python. */
function proving(content, state) {
  const save = make("button", { type: "button", onclick: () => {
    const link = make("a", { href: URL.createObjectURL(new Blob([controllerFile(content, state())], { type: "application/json" })), download: "controller.json" });
    link.click(); URL.revokeObjectURL(link.href);
  } }, "Save controller.json");
  if (!content.command.length) return [make("p", {}, "Run the Python below: ", make("code", {}, "check"), " proves it at every frequency, or says what it could not."), save];
  const commands = content.command.join("\n");
  return [make("p", {}, "Save the controller, then run:"), save, copyButton(() => commands), make("pre.code.command", { tabindex: 0, "aria-label": "Command" }, commands)];
}
