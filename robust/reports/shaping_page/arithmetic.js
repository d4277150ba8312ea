// The control arithmetic of the shaping page: responses, stability, rs, rp, step response. It knows no document.
//
// r --->(+)-- e -->[ K ]-- u -->[ G ]---+--> y     L = G K, S = 1/(1 + L), T = 1 - S
//       -^                              |          S_p = S (1 + a D)/(1 + b D), |D| <= 1
//       +-------------------------------+          b = q S, a = q in inverse forms, else 0; q = w times G, K as read

"use strict";

const TWO_PI = 2 * Math.PI;
const AT_A_POLE = 1e140; // stands for a response at a pole on the axis
const RULES = 1e4; // times all aliases together: then the plant at a frequency is told from the sampled one
const STEEP = 0.35; // phase step [rad] of 1 + L between two frequencies above which there are too few
const RISE = 1.1; // from a valley to a peak
const ROUNDS = 6, MOST_INSERTED = 400, PIECES = 8, MAXIMA = 8, NEARLY = 0.8;

// ---------------------------------------------------------------------------------------------- responses of systems

/** A solver for C (x I - H)^-1 B + D with H upper Hessenberg: elimination with neighbouring rows as pivots. */
function solver(system) {
  const n = system.b.length, width = n + 1;
  const re = new Float64Array(n * width), im = new Float64Array(n * width);
  const { H, b, c, d, dt } = system;
  return function response(omega, out) {
    if (n === 0) { out[0] = d; out[1] = 0; return; }
    let xr = 0, xi = omega;
    if (dt) { // exp(j omega dt) - 1 without rounding to zero
      const half = Math.sin(omega * dt / 2);
      xr = -2 * half * half; xi = Math.sin(omega * dt);
    }
    for (let i = 0; i < n; i++) {
      for (let j = i ? i - 1 : 0; j < n; j++) { re[i * width + j] = -H[i * n + j]; im[i * width + j] = 0; }
      re[i * width + i] += xr; im[i * width + i] = xi;
      re[i * width + n] = b[i]; im[i * width + n] = 0;
    }
    for (let k = 0; k < n - 1; k++) {
      const top = k * width, low = top + width;
      if (Math.hypot(re[low + k], im[low + k]) > Math.hypot(re[top + k], im[top + k])) {
        for (let j = k; j <= n; j++) {
          let keep = re[top + j]; re[top + j] = re[low + j]; re[low + j] = keep;
          keep = im[top + j]; im[top + j] = im[low + j]; im[low + j] = keep;
        }
      }
      const pr = re[top + k], pi = im[top + k], size = pr * pr + pi * pi;
      if (size === 0) continue;
      const fr = (re[low + k] * pr + im[low + k] * pi) / size, fi = (im[low + k] * pr - re[low + k] * pi) / size;
      if (fr === 0 && fi === 0) continue;
      for (let j = k + 1; j <= n; j++) {
        re[low + j] -= fr * re[top + j] - fi * im[top + j];
        im[low + j] -= fr * im[top + j] + fi * re[top + j];
      }
    }
    let sr = d, si = 0;
    for (let i = n - 1; i >= 0; i--) {
      const row = i * width;
      let vr = re[row + n], vi = im[row + n];
      for (let j = i + 1; j < n; j++) { // the solution stands in the last column, from below
        const zr = re[j * width + n], zi = im[j * width + n];
        vr -= re[row + j] * zr - im[row + j] * zi;
        vi -= re[row + j] * zi + im[row + j] * zr;
      }
      const pr = re[row + i], pi = im[row + i], size = pr * pr + pi * pi;
      const zr = (vr * pr + vi * pi) / size, zi = (vi * pr - vr * pi) / size;
      re[row + n] = zr; im[row + n] = zi;
      sr += c[i] * zr; si += c[i] * zi;
    }
    if (!Number.isFinite(sr) || !Number.isFinite(si)) { sr = AT_A_POLE; si = 0; }
    out[0] = sr; out[1] = si;
  };
}

// ------------------------------------------------------------------------------------------- elements of a controller

/** Numerator and denominator, highest power first, of an element in s over its own (prewarped) frequency. */
function polynomials(element, dt) {
  const omega = TWO_PI * element.f;
  const o = dt ? 2 / dt * Math.tan(omega * dt / 2) : omega; // the bilinear map keeps the element exact at omega
  if (element.kind === "integrator") return [[1, o], [1, 0]];
  if (element.kind === "lead") {
    const sine = Math.sin(element.phase * Math.PI / 180), r = Math.sqrt((1 + sine) / (1 - sine));
    return [[r, o], [1, o * r]]; // r (s + o/r)/(s + o r)
  }
  if (element.kind === "notch") {
    return [[1, element.depth * element.width * o, o * o], [1, element.width * o, o * o]];
  }
  return element.order === 1 ? [[o], [1, o]] : [[o * o], [1, 2 * element.zeta * o, o * o]];
}

/** The response of gain and elements, [re, im] of every point s = j v. */
function elementResponse(parts, gain, v) {
  const n = v.length, zr = new Float64Array(n).fill(gain), zi = new Float64Array(n);
  for (const [num, den] of parts) {
    const [n2, n1, n0] = padded(num), [d2, d1, d0] = padded(den);
    for (let i = 0; i < n; i++) {
      const x = v[i], nr = n0 - n2 * x * x, ni = n1 * x, dr = d0 - d2 * x * x, di = d1 * x, size = dr * dr + di * di;
      const fr = (nr * dr + ni * di) / size, fi = (ni * dr - nr * di) / size, keep = zr[i] * fr - zi[i] * fi;
      zi[i] = zr[i] * fi + zi[i] * fr; zr[i] = keep;
    }
  }
  return [zr, zi];
}

function padded(p) { return p.length === 3 ? p : p.length === 2 ? [0, p[0], p[1]] : [0, 0, p[0]]; }

function partsOf(state, dt) { return state.elements.map(element => polynomials(element, dt)); }

// ------------------------------------------------------------------------------------------------------- the problem

/** What does not change while a controller is shaped: responses on the grid, solvers for points between. */
function prepare(content) {
  const omega = Float64Array.from(content.omega), dt = content.dt;
  const K = solver(content.K), P = content.w_P ? solver(content.w_P) : null;
  const models = content.models.map(model => ({
    ...model, solveG: solver(model.G), solveW: solver(model.w),
    solveHeld: model.aliases && model.aliases.G ? solver(model.aliases.G) : null,
  }));
  const problem = { omega, dt, models, K, P, K_poles: content.K_poles, demand: Boolean(content.w_P) };
  problem.base = fixed(problem, omega);
  return problem;
}

/** What stands for |w| in b = K S w where a set of continuous plants is sampled: the sum over every alias omega_k of
 * |h_k F_k|, F = G w or w and h_k the hold, or of an operator the root of the sum of |F_k|^2. [gr, gi] is G as sampled. */
function aliasSize(model, omega, gr, gi) {
  const { dt, delay, n, tail, operator } = model.aliases, step = TWO_PI / dt, out = [0, 0];
  const hold = Math.abs(Math.sin(omega * dt / 2) / (dt / 2));
  let total = operator ? tail : tail * Math.sin(Math.min(omega * dt / 2, Math.PI / 2));
  let own = 0, w0 = 0, restR = 0, restI = 0, rest = 0;
  for (let k = -n; k <= n; k++) {
    const at = omega + k * step;
    model.solveW(Math.abs(at), out);
    let F = Math.hypot(out[0], out[1]);
    if (k === 0) w0 = F;
    if (model.solveHeld) {
      model.solveHeld(Math.abs(at), out);
      const size = Math.hypot(out[0], out[1]);
      F *= size;
      if (k !== 0) {
        const turn = -(omega * dt / 2 + at * delay), h = hold / at, im = at < 0 ? -out[1] : out[1];
        restR += h * (out[0] * Math.cos(turn) - im * Math.sin(turn));
        restI += h * (out[0] * Math.sin(turn) + im * Math.cos(turn));
        rest += size * Math.abs(h);
      }
    }
    if (k === 0) own = F; else total += operator ? F * F : F * hold / Math.abs(at);
  }
  const h0 = hold / omega;
  // beside a pole on the axis the plant at omega itself is what the sampled one leaves, as rounding moves both poles alike
  if (model.solveHeld && own * h0 > RULES * rest * w0) own = Math.hypot(gr - restR, gi - restI) / h0 * w0;
  return operator ? Math.sqrt(total + own * own) : total + own * h0;
}

/** Plant times the controller to begin with, q without what is shaped, and |w_P|, at some frequencies. */
function fixed(problem, omega) {
  const n = omega.length, out = [0, 0], size = new Float64Array(n), kr = new Float64Array(n), ki = new Float64Array(n);
  for (let i = 0; i < n; i++) {
    problem.K(omega[i], out); kr[i] = out[0]; ki[i] = out[1];
    if (problem.P) { problem.P(omega[i], out); size[i] = Math.hypot(out[0], out[1]); }
  }
  const models = problem.models.map(model => {
    const lr = new Float64Array(n), li = new Float64Array(n), qr = new Float64Array(n), qi = new Float64Array(n);
    for (let i = 0; i < n; i++) {
      model.solveG(omega[i], out);
      const turn = -omega[i] * model.shift, cosine = Math.cos(turn), sine = Math.sin(turn);
      const gr = out[0] * cosine - out[1] * sine, gi = out[0] * sine + out[1] * cosine;
      lr[i] = gr * kr[i] - gi * ki[i]; li[i] = gr * ki[i] + gi * kr[i];
      model.solveW(omega[i], out);
      let ar = out[0], ai = out[1];
      for (const factor of model.read) {
        const [fr, fi] = factor === "G" ? [gr, gi] : [kr[i], ki[i]], keep = ar * fr - ai * fi;
        ai = ar * fi + ai * fr; ar = keep;
      }
      if (model.aliases) {
        const R = aliasSize(model, omega[i], gr, gi);
        ar = kr[i] * R; ai = ki[i] * R;
      }
      qr[i] = ar; qi[i] = ai;
    }
    return { lr, li, qr, qi, readsK: model.read.includes("K") };
  });
  const v = problem.dt ? omega.map(x => 2 / problem.dt * Math.tan(x * problem.dt / 2)) : omega; // s = j v
  return { omega, v, size, models };
}

/** The same with the shaped part in it: L and q at every frequency. */
function shaped(problem, base, parts, gain) {
  const [kr, ki] = elementResponse(parts, gain, base.v);
  const models = base.models.map(from => {
    const [lr, li] = product(from.lr, from.li, kr, ki);
    const [qr, qi] = from.readsK ? product(from.qr, from.qi, kr, ki) : [from.qr, from.qi];
    return { lr, li, qr, qi };
  });
  return { omega: base.omega, v: base.v, size: base.size, models };
}

function product(ar, ai, br, bi) {
  const n = ar.length, cr = new Float64Array(n), ci = new Float64Array(n);
  for (let i = 0; i < n; i++) { cr[i] = ar[i] * br[i] - ai[i] * bi[i]; ci[i] = ar[i] * bi[i] + ai[i] * br[i]; }
  return [cr, ci];
}

/** Two sets of curves in one, in order of frequency. */
function merged(a, b) {
  const n = a.omega.length, m = b.omega.length, from = new Int32Array(n + m);
  for (let i = 0, j = 0, k = 0; k < n + m; k++) from[k] = j >= m || (i < n && a.omega[i] <= b.omega[j]) ? i++ : -1 - j++;
  const joined = (x, y) => {
    const z = new Float64Array(n + m);
    for (let k = 0; k < n + m; k++) z[k] = from[k] >= 0 ? x[from[k]] : y[-1 - from[k]];
    return z;
  };
  const models = a.models.map((x, k) => Object.fromEntries(["lr", "li", "qr", "qi"].map(c => [c, joined(x[c], b.models[k][c])])));
  return { omega: joined(a.omega, b.omega), v: joined(a.v, b.v), size: joined(a.size, b.size), models };
}

// ---------------------------------------------------------------------------------------------------------- stability

/** Phase of F = (1 + L) prod (s - p)/(s + |p| + 1): poles that are not surely stable are moved away, so that F has none
 * to the right, and its zeros there are the unstable poles of the closed loop. */
function anglesOfF(problem, curves, m, poles) {
  const { lr, li } = curves.models[m], n = lr.length, angle = new Float64Array(n), v = curves.v;
  let nearest = Infinity;
  for (let i = 0; i < n; i++) {
    const fr = 1 + lr[i], fi = li[i];
    nearest = Math.min(nearest, fr * fr + fi * fi);
    angle[i] = Math.atan2(fi, fr);
  }
  for (const [pr, pi] of poles) {
    const beyond = Math.sqrt(pr * pr + pi * pi) || curves.omega[n >> 1];
    for (let i = 0; i < n; i++) angle[i] += Math.atan2(v[i] - pi, -pr) - Math.atan2(v[i], beyond);
  }
  return { angle, nearest: Math.sqrt(nearest) };
}

function wrapped(x) { return x - TWO_PI * Math.round(x / TWO_PI); }

/** Number of unstable closed-loop poles, and whether the curve leaves no doubt. */
function unstablePoles(angle) {
  const n = angle.length;
  let total = 0, largest = 0;
  for (let i = 1; i < n; i++) {
    const step = wrapped(angle[i] - angle[i - 1]);
    total += step; largest = Math.max(largest, Math.abs(step));
  }
  // F is real at zero frequency and at the last
  const toReal = x => { const y = wrapped(x); return Math.abs(y) <= Math.PI / 2 ? y : wrapped(y - Math.PI); };
  const opening = toReal(angle[0]), closing = -toReal(angle[n - 1]);
  const turns = -(total + opening + closing) / Math.PI;
  const clear = largest < 2.5 && Math.abs(turns - Math.round(turns)) < 0.01 && Math.abs(opening) < 1 && Math.abs(closing) < 1;
  return { count: Math.round(turns), clear };
}

// ------------------------------------------------------------------------------------------------------------- curves

/** S, T, rs, rp of one model from L, q and |w_P|. */
function loopCurves(curves, m, inverse, demand) {
  const { lr, li, qr, qi } = curves.models[m], n = lr.length;
  const S = new Float64Array(n), T = new Float64Array(n), rs = new Float64Array(n), rp = new Float64Array(n);
  const Tr = new Float64Array(n), half = new Float64Array(n);
  for (let i = 0; i < n; i++) {
    const fr = 1 + lr[i], fi = li[i], size = fr * fr + fi * fi;
    const sr = fr / size, si = -fi / size;
    S[i] = Math.sqrt(sr * sr + si * si);
    const tr = lr[i] * sr - li[i] * si, ti = lr[i] * si + li[i] * sr;
    T[i] = Math.sqrt(tr * tr + ti * ti); Tr[i] = tr;
    half[i] = Math.sqrt((sr - 0.5) * (sr - 0.5) + si * si);
    const br = qr[i] * sr - qi[i] * si, bi = qr[i] * si + qi[i] * sr, b = Math.sqrt(br * br + bi * bi);
    rs[i] = b;
    if (!demand) continue;
    if (b >= 1) { rp[i] = Infinity; continue; }
    const ar = inverse ? qr[i] : 0, ai = inverse ? qi[i] : 0;
    const cr = 1 - (ar * br + ai * bi), ci = ai * br - ar * bi, er = ar - br, ei = ai - bi;
    const centre = Math.sqrt(cr * cr + ci * ci), edge = Math.sqrt(er * er + ei * ei);
    rp[i] = curves.size[i] * S[i] * (centre + edge) / (1 - b * b);
  }
  return { S, T, Tr, rs, rp, half };
}

/** Frequencies to look closer at: around the largest values of some curves. */
function aroundMaxima(omega, values, found) {
  const n = omega.length, places = [];
  for (let i = 1; i < n - 1; i++) if (values[i] >= values[i - 1] && values[i] >= values[i + 1] && values[i] > 0) places.push(i);
  places.sort((i, j) => values[j] - values[i]);
  for (const i of places.slice(0, MAXIMA)) {
    if (values[i] < NEARLY * values[places[0]]) break;
    between(omega[i - 1], omega[i], found);
    between(omega[i], omega[i + 1], found);
  }
}

function between(low, high, found) {
  if (high / low < 1 + 1e-7) return;
  for (let k = 1; k < PIECES; k++) found.push(low * Math.pow(high / low, k / PIECES));
}

/** The whole answer for a state {gain, elements}: curves on a grid refined where they turn, peaks, margins, verdicts. */
function evaluate(problem, state) {
  const parts = partsOf(state, problem.dt);
  const shapedPoles = state.elements.filter(element => element.kind === "integrator").map(() => [0, 0]);
  const poles = problem.models.map(model => [...model.poles, ...problem.K_poles, ...shapedPoles]);
  let curves = shaped(problem, problem.base, parts, state.gain);
  const insert = found => {
    const omega = Float64Array.from([...new Set(found)].sort((x, y) => x - y));
    if (omega.length) curves = merged(curves, shaped(problem, fixed(problem, omega), parts, state.gain));
    return omega.length > 0;
  };
  for (let round = 0; round < ROUNDS; round++) {
    const found = [];
    problem.models.forEach((model, m) => {
      const { angle } = anglesOfF(problem, curves, m, poles[m]);
      for (let i = 1; i < angle.length && found.length < MOST_INSERTED; i++) {
        if (Math.abs(wrapped(angle[i] - angle[i - 1])) > STEEP) between(curves.omega[i - 1], curves.omega[i], found);
      }
    });
    if (!insert(found)) break;
  }
  for (let round = 0; round < 2; round++) {
    const found = [];
    problem.models.forEach((model, m) => {
      const { rs, rp, half } = loopCurves(curves, m, model.inverse, problem.demand);
      aroundMaxima(curves.omega, rs, found);
      aroundMaxima(curves.omega, half, found);
      if (problem.demand) aroundMaxima(curves.omega, rp, found);
    });
    insert(found);
  }
  const models = problem.models.map((model, m) => judged(problem, curves, m, poles[m]));
  return { omega: curves.omega, size: curves.size, curves, models };
}

/** Curves, peaks, margins and verdict of one model. */
function judged(problem, curves, m, poles) {
  const model = problem.models[m], of = loopCurves(curves, m, model.inverse, problem.demand);
  const { angle, nearest } = anglesOfF(problem, curves, m, poles);
  const { count, clear } = unstablePoles(angle);
  const stable = clear && count === 0;
  const rs = largest(curves.omega, of.rs), rp = problem.demand ? largest(curves.omega, of.rp) : null;
  const half = largest(curves.omega, of.half);
  let verdict = "holds on the grid";
  if (!clear || nearest < 1e-9) verdict = "stability is not decided";
  else if (count) verdict = "unstable";
  else if (rs.value >= 1) verdict = "not robustly stable";
  else if (problem.demand && rp.value > 1) verdict = "demand not met";
  return { ...of, ...curves.models[m], name: model.name, stable, count, clear, verdict, maxRs: rs, maxRp: rp,
    disk: 1 / half.value, ...margins(curves.omega, curves.models[m]) };
}

function largest(omega, values) {
  let k = 0;
  for (let i = 1; i < values.length; i++) if (values[i] > values[k]) k = i;
  return { value: values[k], omega: omega[k] };
}

/** Where a curve has a peak, higher by a tenth than the valleys on both sides of it. */
function peaks(values) {
  const found = [];
  let valley = Infinity, top = -1; // the last one, and what may become a peak
  for (let i = 0; i < values.length; i++) {
    if (top < 0 ? values[i] > RISE * valley : values[i] > values[top]) top = i;
    else if (top >= 0 && RISE * values[i] < values[top]) { found.push(top); top = -1; valley = values[i]; }
    if (top < 0) valley = Math.min(valley, values[i]);
  }
  return found;
}

/** Every crossover [rad/s], phase margin [rad] and gain margin [factor] of L. */
function margins(omega, { lr, li }) {
  const crossovers = [];
  let phase = Infinity, gain = Infinity;
  for (let i = 1; i < omega.length; i++) {
    const before = Math.hypot(lr[i - 1], li[i - 1]), after = Math.hypot(lr[i], li[i]);
    if ((before - 1) * (after - 1) < 0) {
      const x = Math.log(before) / (Math.log(before) - Math.log(after));
      crossovers.push(omega[i - 1] * Math.pow(omega[i] / omega[i - 1], x));
      const first = Math.atan2(-li[i - 1], -lr[i - 1]), turn = wrapped(Math.atan2(-li[i], -lr[i]) - first);
      phase = Math.min(phase, Math.abs(wrapped(first + x * turn)));
    }
    if (li[i - 1] * li[i] < 0 && Math.min(lr[i - 1], lr[i]) < 0) {
      const x = li[i - 1] / (li[i - 1] - li[i]), real = lr[i - 1] + x * (lr[i] - lr[i - 1]);
      if (real < 0 && real > -1) gain = Math.min(gain, -1 / real);
    }
  }
  return { crossovers, phaseMargin: phase, gainMargin: gain };
}

// ------------------------------------------------------------------------------------------------------ step response

const SINE_STEP = 0.02, SINE_END = 60;
const sineTable = (() => { // Si(x) by Simpson's rule on sin(x)/x
  const table = new Float64Array(Math.round(SINE_END / SINE_STEP) + 2), f = x => (x ? Math.sin(x) / x : 1);
  for (let k = 1; k < table.length; k++) {
    const x = (k - 1) * SINE_STEP;
    table[k] = table[k - 1] + SINE_STEP / 6 * (f(x) + 4 * f(x + SINE_STEP / 2) + f(x + SINE_STEP));
  }
  return table;
})();

/** The sine integral, to 1e-5. */
function sineIntegral(x) {
  if (x >= SINE_END) {
    const y = 1 / (x * x);
    return Math.PI / 2 - Math.cos(x) / x * (1 - 2 * y + 24 * y * y) - Math.sin(x) / x / x * (1 - 6 * y);
  }
  const k = Math.floor(x / SINE_STEP), rest = x / SINE_STEP - k;
  return sineTable[k] + rest * (sineTable[k + 1] - sineTable[k]);
}

/** Step response of T at the times, for a stable loop: (2/pi) int Re T sin(omega t)/omega, Re T straight between points.
 * Sampled: at t = (k + 1/2) dt with Re T (omega dt/2)/sin(omega dt/2) this is the exact sum of the samples up to k. */
function stepResponse(omega, Tr, times, dt) {
  const n = omega.length, y = new Float64Array(times.length), R = Float64Array.from(Tr);
  if (dt) for (let i = 0; i < n; i++) { const x = omega[i] * dt / 2; R[i] *= x / Math.sin(x); }
  for (let k = 0; k < times.length; k++) {
    const t = dt ? (Math.round(times[k] / dt) + 0.5) * dt : times[k];
    if (t <= 0) continue;
    let lastS = sineIntegral(omega[0] * t), lastC = Math.cos(omega[0] * t), sum = R[0] * lastS;
    for (let i = 1; i < n; i++) {
      const x = omega[i] * t, S = sineIntegral(x), C = Math.cos(x);
      const slope = (R[i] - R[i - 1]) / (omega[i] - omega[i - 1]), level = R[i] - slope * omega[i];
      sum += level * (S - lastS) - slope * (C - lastC) / t;
      lastS = S; lastC = C;
    }
    y[k] = 2 / Math.PI * sum;
  }
  return y;
}

// ------------------------------------------------------------------------------------------------- what is written out

/** Gains of kp + ki/s + kd s/(filter_time s + 1), by Tustin where sampled; null where the shape is no PID. */
function pidGains(state, dt) {
  const count = kind => state.elements.filter(element => element.kind === kind).length;
  if (count("integrator") > 1 || count("lead") > 1) return null;
  const one = kind => state.elements.find(element => element.kind === kind);
  const I = one("integrator"), D = one("lead"), rest = state.elements.filter(e => e !== I && e !== D);
  const [, z1] = I ? polynomials(I, dt)[0] : [0, 0];
  let gains;
  if (!D) gains = { kp: state.gain, ki: state.gain * z1, kd: 0, filter_time: 0 };
  else {
    const [[r, o], [, p]] = polynomials(D, dt), z2 = o / r, k = state.gain * r;
    // k (s + z1)(s + z2)/(s (s + p)), or without z1 and s
    const ki = I ? k * z1 * z2 / p : 0, kp = I ? (k * (z1 + z2) - ki) / p : k * z2 / p;
    gains = { kp, ki, kd: (k - kp) / p, filter_time: 1 / p };
  }
  return { ...gains, rest: rest.map(element => element.kind) };
}

const places = { integrator: e => `robust.shaping.lag(${hz(e)}, np.inf, dt=dt)`,
  lead: e => `robust.shaping.lead(${hz(e)}, np.radians(${e.phase}), dt=dt)`,
  notch: e => `robust.shaping.notch(${hz(e)}, depth=${e.depth}, width=${e.width}, dt=dt)`,
  "roll-off": e => `robust.shaping.low_pass(${hz(e)}, order=${e.order}, zeta=${e.zeta}, dt=dt)` };
function hz(element) { return `2 * np.pi * ${element.f}`; }

/** The Python that makes the controller and checks it. */
function pythonOf(content, state) {
  const rows = [];
  if (state.gain !== 1) rows.push(`K = ${state.gain} * K`);
  for (const element of state.elements) rows.push(`K = K * ${places[element.kind](element)}`);
  return content.python.replace("# shaped", rows.join("\n") || "# nothing shaped yet");
}

/** The controller in state space, {A, B, C, D}: the one to begin with, then every element, in series. */
function realised(content, state) {
  const dt = content.dt;
  let { A, B, C, D } = content.K;
  [A, B, C, D] = [A.map(row => [...row]), B.map(row => [...row]), C.map(row => [...row]), [[D[0][0] * state.gain]]];
  C = C.map(row => row.map(x => x * state.gain));
  for (const pair of partsOf(state, dt)) {
    const [num, den] = dt ? pair.map(p => tustin(p, pair[1].length - 1, dt)) : pair;
    const n = den.length - 1, top = [...Array(n + 1 - num.length).fill(0), ...num].map(x => x / den[0]);
    const low = den.map(x => x / den[0]), d = top[0], c = low.slice(1).map((x, i) => top[i + 1] - d * x);
    const old = A.length, size = old + n, wide = Array.from({ length: size }, () => Array(size).fill(0));
    for (let i = 0; i < old; i++) for (let j = 0; j < old; j++) wide[i][j] = A[i][j];
    for (let j = 0; j < old; j++) wide[old][j] = C[0][j];
    for (let j = 0; j < n; j++) wide[old][old + j] = -low[j + 1];
    for (let i = 1; i < n; i++) wide[old + i][old + i - 1] = 1;
    const into = Array(n).fill(0); into[0] = D[0][0];
    A = wide; B = [...B, ...into.map(x => [x])];
    C = [[...(old ? C[0].map(x => d * x) : []), ...c]]; D = [[d * D[0][0]]];
  }
  return { A, B, C: A.length ? C : [], D };
}

/** A polynomial of degree n at most under s = 2/dt (z - 1)/(z + 1), times (z + 1)^n. */
function tustin(p, n, dt) {
  const k = 2 / dt, q = [...Array(n + 1 - p.length).fill(0), ...p];
  if (n === 1) return [q[0] * k + q[1], q[1] - q[0] * k];
  const [a, b, c] = [q[0] * k * k, q[1] * k, q[2]];
  return [a + b + c, 2 * (c - a), a - b + c];
}

/** A file that `robust check` reads. */
function controllerFile(content, state) {
  return JSON.stringify({ schema: "robust-controller", version: 1, units: { dt: "s" },
    feedback: "negative: u = K (r - y)", K: { kind: "ss", dt: content.dt, ...realised(content, state) } }, null, 1);
}
