/* What the page does: reads the events, draws them, passes orders on. Texts enter as text, never as markup. */
"use strict";
const at = id => document.getElementById(id);
const SVG = "http://www.w3.org/2000/svg", KEPT_ms = 120000, BEAT_ms = 500, SILENT_s = 2, PATIENCE_ms = 3000;
/* A band this many times as wide as the present one leaves the plot. */
const WIDEST = 5;
/* Runs that are listed at once; the rest is folded. */
const RECENT = 5;
/* Time for which what was wrong stays on the first screen: what comes and goes must not move what is pressed. */
const WRONG_ms = 20000;
let ill_ms = -Infinity;
const past = [], trace = [], courses = {};
let token = "", last = null, heard_ms = 0, beaten_ms = 0, notified = null, readOnly = null, locked = false, watching = false;

/* A sentence; what stands between backticks is to be typed. */
function say(place, sentence) {
  if (place.said === sentence) return;
  place.said = sentence;
  place.replaceChildren(...sentence.split("`").map((part, index) => index % 2 ? make("code", part) : part));
}
const make = (name, text, kind) => {
  const made = document.createElement(name);
  if (text !== undefined) say(made, String(text));
  if (kind) made.className = kind;
  return made;
};
/* A table of texts, one row below its headings for each of them; `kind` of a cell by its place and text. */
const rowsOf = (headings, found, kind = () => "") => {
  const head = make("tr");
  head.append(...headings.map(heading));
  return [head, ...found.map(cells => {
    const row = make("tr");
    row.append(...cells.map((text, index) => make("td", text, kind(index, text))));
    return row;
  })];
};
const heading = word => Object.assign(make("th", word), {scope: "col"});
const draw = (name, attributes) => {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
};
const fixed = (value, digits) => (Math.abs(value) < 0.5 * 10 ** -digits ? 0 : value).toFixed(digits);
const number = (value, digits, unit, sign) => {
  if (value === null) return "unknown";
  const text = fixed(value, digits);
  return (sign && !text.startsWith("-") ? "+" : "") + text + " " + unit;
};
const short = value => value === null ? "?"
  : Math.abs(value) >= 1000 ? value.toFixed(0) : String(+value.toPrecision(3));
/* A value with the digits that its standard deviation, rounded to two, leaves it. */
const measured = (value, std) => {
  if (value === null || !(std > 0)) return `${short(value)} \u00b1${short(std)}`;
  const digits = Math.min(9, Math.max(0, 1 - Math.floor(Math.log10(Number(std.toPrecision(2))))));
  return `${fixed(value, digits)} \u00b1${std.toFixed(digits)}`;
};
const rows = (place, found) => place.replaceChildren(...found.flatMap(([name, text, kind]) =>
  [make("dt", name), make("dd", text, kind)]));

/* ---- the server: its paths are relative, for the page may be served below a prefix, as by BlueOS */

const ask = (path, words, more) => fetch(path, {
  method: words ? "POST" : "GET", cache: "no-store", credentials: "omit",
  headers: {Authorization: "Bearer " + token, ...(words ? {"Content-Type": "application/json"} : {}), ...more},
  body: words ? JSON.stringify(words) : undefined});

const order = async (name, words = {}) => {
  const asked_ms = Date.now(), before = situation();
  try {
    /* An end is sent again: a crowded server may close a connection before it has read it. */
    let answer;
    for (let tries = ["fly", "commission"].includes(name) ? 4 : 1; !answer; tries++) {
      answer = await ask(name, words).catch(error => { if (tries >= 4) throw error; });
    }
    if (!answer.ok) notify(await answer.text(), false, () => situation() !== before);
  } catch {
    notify(name + ": no link to the vehicle; `./hindrax stop` in a terminal, or cut the power", false,
      () => heard_ms > asked_ms + 1000);
  }
};

/* What a refusal depends on: when it changes, the refusal is over. */
const situation = () => last && [last.thrusters.armed, last.ordered, last.silent_s > SILENT_s].join();

/* A banner goes when `over` says so, when the next word about the same order comes, by its button, or by itself. */
function notify(sentence, well, over = () => false) {
  const line = make("p", undefined, well ? "good" : "bad"), gone = make("button", "\u2715");
  line.dataset.order = sentence.split(":")[0];
  line.over = over;
  gone.type = "button";
  gone.setAttribute("aria-label", "dismiss");
  gone.addEventListener("click", () => line.remove());
  line.append(make("span", sentence), gone);
  for (const one of [...at("outcomes").children]) if (one.dataset.order === line.dataset.order) one.remove();
  at("outcomes").prepend(line);
  while (at("outcomes").childElementCount > 4) at("outcomes").lastChild.remove();
  setTimeout(() => line.remove(), well ? 8000 : 30000);
}

/* Whether a sentence stands in a banner, so that no other place need say it. */
const in_a_banner = sentence => [...at("outcomes").children].some(line => line.textContent.includes(sentence));

async function listen() {
  for (;;) {
    try {
      const answer = await ask("events");
      if (answer.status === 401) { askForToken(); return; }
      if (!answer.ok) throw new Error(await answer.text());
      await read(answer.body.getReader());
    } catch (error) { if (error.message) say(at("reason"), error.message); }
    await new Promise(go => setTimeout(go, 1000));
  }
}

async function read(reader) {
  const decoder = new TextDecoder();
  let rest = "";
  for (;;) {
    const {value, done} = await reader.read();
    if (done) return;
    const parts = (rest + decoder.decode(value, {stream: true})).split("\n\n");
    rest = parts.pop();
    if (parts.length) receive(JSON.parse(parts.at(-1).replace(/^data: /, "")));
  }
}

function receive(update) {
  last = update;
  heard_ms = Date.now();
  if (!update.read_only && heard_ms - beaten_ms >= BEAT_ms && !document.hidden) {
    beaten_ms = heard_ms;
    ask("here", {}).catch(() => {});
  }
  if (update.navigation) past.push({at: heard_ms, ...update.navigation});
  while (past.length && heard_ms - past[0].at > KEPT_ms) past.shift();
  const place = update.place && update.place.place;
  if (place && place.x_m !== null) trace.push([place.x_m, place.y_m]);
  if (trace.length > 3000) trace.splice(0, 600);
  const newest = Math.max(0, ...update.outcomes.map(one => one.number));
  for (const one of update.outcomes) if (notified !== null && one.number > notified) notify(one.sentence, one.well);
  if (notified !== null && newest > notified) listReports();
  notified = newest;
  for (const line of [...at("outcomes").children]) if (line.over()) line.remove();
  update.estimates.forEach(keep);
  requestAnimationFrame(show);
}

function askForToken() {
  locked = true;
  document.body.classList.add("cut");
  at("ask").hidden = false;
  at("view").hidden = true;
  at("armed").textContent = "no token";
}

/* ---- what is seen */

function show() {
  headline();
  if (!last) return;
  state(last.navigation);
  pool(last.pool, last.place);
  thrusters(last.thrusters);
  flight(last);
  holds(last.holds);
  health(last.health);
  estimates(last.estimates);
  cameras(last.cameras);
  commissioning(last);
  session(last.session);
  document.querySelectorAll("canvas[data-keys]").forEach(plotPast);
  plotCourses();
}

/* Grey: an order would not arrive. It is sent all the same when the button is pressed. */
const isCut = () => Date.now() - heard_ms > PATIENCE_ms;

function headline() {
  if (locked) return;
  const cut = isCut();
  const silent = last && (last.silent_s === null || last.silent_s > SILENT_s), gone = silent && !last.stoppable;
  document.body.classList.toggle("cut", cut || gone);
  at("view").classList.toggle("old", Boolean(cut || silent));
  const pill = at("armed");
  if (cut || silent) {
    pill.className = "pill warn";
    pill.textContent = cut ? (last ? "page cut off" : "connecting") : "vehicle silent";
    say(at("reason"), cut ? "the page gets no updates" :
      "no message from the thrusters" + (gone && last.silent_s !== null ? ", and no program is left to stop them: if they turn, cut the power" : ""));
    return;
  }
  const {armed, state, reason} = last.thrusters;
  pill.className = "pill " + (armed ? "armed" : state === "disarmed" ? "safe" : "warn");
  pill.textContent = armed || state === "disarmed" ? state.toUpperCase() : state;
  say(at("reason"), state === "disarmed" ? "" : reason);
  at("title").textContent = last.title + (last.read_only ? ", read-only" : "");
  if (readOnly !== last.read_only) {
    readOnly = last.read_only;
    for (const id of ["stop", "disarm", "fly", "proof"]) at(id).hidden = readOnly;
  }
}

function state(found) {
  if (!found) { rows(at("state"), [["", "no navigation solution yet; see the health", "warn"]]); return; }
  rows(at("state"), [
    ["heading", number(found.heading, 1, "deg")],
    ["roll", number(found.roll, 1, "deg", true)], ["pitch", number(found.pitch, 1, "deg", true)],
    ["depth", number(found.depth, 2, "m")], ["altitude", number(found.altitude, 2, "m")],
    ["surge", number(found.surge, 3, "m/s", true)], ["sway", number(found.sway, 3, "m/s", true)],
    ["heave", number(found.heave, 3, "m/s", true)],
    ["DVL", found.locked ? "locked" : "no bottom lock", found.locked ? "good" : "bad"]]);
}

/* Pool axes: x along the length (drawn to the right), y to the right of it (drawn downward). */
function pool({size, hull: sides}, found) {
  const [length, width] = size, place = found && found.place, svg = at("pool");
  svg.setAttribute("viewBox", [-0.1, -0.1, length + 0.2, width + 0.2].join(" "));
  const parts = [draw("rect", {x: 0, y: 0, width: length, height: width, class: "water"})];
  for (let x = 1; x < length; x++) parts.push(draw("line", {x1: x, x2: x, y1: 0, y2: width, class: "meter"}));
  for (let y = 1; y < width; y++) parts.push(draw("line", {x1: 0, x2: length, y1: y, y2: y, class: "meter"}));
  const edge = found && found.margin_m, room = [length, width].map(side => Math.max(0, side - 2 * edge));
  if (edge !== null) parts.push(draw("rect", {x: (length - room[0]) / 2, y: (width - room[1]) / 2, width: room[0],
    height: room[1], class: "limit"}));
  if (trace.length > 1) parts.push(draw("polyline", {points: trace.map(one => one.map(v => v.toFixed(2))).join(" "),
    class: "trace"}));
  if (place && place.x_m !== null && place.heading_rad !== null) {
    const [a, b] = sides.map(side => side / 2);
    const heading = (place.heading_rad * 180 / Math.PI).toFixed(1);
    const move = `translate(${place.x_m.toFixed(3)} ${place.y_m.toFixed(3)}) rotate(${heading})`;
    const hull = draw("g", {transform: move});
    hull.append(draw("rect", {x: -a, y: -b, width: 2 * a, height: 2 * b, rx: 0.08, class: "hull"}),
      draw("path", {d: `M${a + 0.22} 0L${a - 0.1} ${-b * 0.7}L${a - 0.1} ${b * 0.7}Z`, class: "bow"}));
    parts.push(hull);
  }
  const walls = Object.entries(found ? found.walls_m : {}).filter(one => one[1] !== null);
  const nearest = Math.min(...walls.map(one => one[1])), pixel_m = (length + 0.2) / (svg.clientWidth || 400);
  parts.push(...walls.map(([name, left_m]) => number_at(name, left_m, length, width, 14 * pixel_m,
    left_m < edge ? "bad" : left_m === nearest ? "near" : "")));
  svg.replaceChildren(...parts);
  const placed = place && place.x_m !== null;
  const position = placed ? `x ${place.x_m.toFixed(2)} m, y ${place.y_m.toFixed(2)} m` +
    (place.sigma_m === null ? "" : ` \u00b1${place.sigma_m.toFixed(2)} m`) : "no position yet";
  at("where").textContent = [position, ...(found && found.unplaced ? [found.unplaced] : [])].join("; ");
  svg.setAttribute("aria-label", `the vehicle in the pool of ${length} by ${width} m: ${position}` +
    walls.map(([name, left_m]) => `, ${left_m.toFixed(2)} m to the ${name} wall`).join(""));
}

/* The way that is left to a wall after braking, written at it. */
function number_at(wall, left_m, length, width, size, kind) {
  const [x, y, anchor] = {south: [size / 3, width / 2, "start"], north: [length - size / 3, width / 2, "end"],
    west: [length / 2, size * 1.1, "middle"], east: [length / 2, width - size * 0.4, "middle"]}[wall];
  const made = draw("text", {x, y, "font-size": size, "text-anchor": anchor, class: "distance " + kind});
  made.textContent = left_m.toFixed(2) + " m";
  return made;
}

function thrusters(found) {
  at("lost").textContent = found.lost_axes.length ? "lost: " + found.lost_axes.join(", ") : "";
  at("thrusters").replaceChildren(...found.names.map((name, index) => {
    const row = make("div", undefined, "thruster" + (found.saturated[index] ? " full" : ""));
    const track = make("span"), bar = make("i");
    const pulse = found.pulses_us[index], disabled = found.disabled.includes(name);
    const part = Math.max(-1, Math.min(1, (pulse - found.stops_us[index]) / 400)) * 50;
    bar.style.left = (part < 0 ? 50 + part : 50) + "%";
    bar.style.width = Math.abs(part) + "%";
    track.append(bar);
    row.append(make("b", name), track, make("span", disabled ? "" : pulse.toFixed(0) + " us", "soft"),
      make("span", disabled ? "disabled" : number(found.forces_N[index], 1, "N", true), disabled ? "bad" : ""));
    return row;
  }));
}

function flight(update) {
  const found = update.flight, place = at("flight"), armed = update.thrusters.armed, over = !found || ["done", "aborted"].includes(found.phase);
  if (!found) place.replaceChildren(make("p", "none yet", "soft"));
  else if (found.aborted) place.replaceChildren(make("p", (found.motion || "the maneuver") +
    (in_a_banner(found.aborted) ? " ended early" : " ended by " + found.aborted), "bad"));
  else if (over) place.replaceChildren(make("p", "done", "good"));
  else if (!armed) place.replaceChildren(make("p", found.motion + " ended, the thrusters are at rest", "soft"));
  else {
    const bar = make("div", undefined, "bar"), done = make("i");
    done.style.width = 100 * Math.max(0, Math.min(1, found.progress)) + "%";
    bar.append(done);
    const [force, rate] = found.units;
    place.replaceChildren(make("b", `${found.motion} ${found.phase}, ${(100 * found.progress).toFixed(0)} %`), bar,
      make("p", (found.remaining_s === null ? "" : found.remaining_s.toFixed(0) + " s to go, ") +
        number(found.force, 1, force, true) + ", " + number(found.velocity, 3, rate, true) +
        (found.wall_m === null ? "" : ", wall " + found.wall_m.toFixed(1) + " m ahead"), "soft"));
  }
  const picked = [...document.querySelectorAll("[name=motion]:checked")].map(one => update.plans[one.value]);
  at("planned").textContent = experimenting() ? "the fastest and the slowest legs of each, then the most informative" :
    at("excitation").value === choices.excitations[0] ? picked.filter(Boolean).join("; ") : "";
  const busy = update.ordered || armed && !over;
  at("flying").disabled = !armed || busy;
  at("maneuver").classList.toggle("busy", armed && !over);
  say(at("why"), readOnly || busy || armed ? "" : "the page cannot arm: `./hindrax arm` in a terminal");
}

function holds(found) {
  const words = one => {
    const digits = one.unit === "m" ? 2 : 1;
    return one.note || (one.engaged ? `at ${number(one.setpoint, digits, one.unit)}, ` +
      `off by ${number(one.error, digits, one.unit, true)}` : "off");
  };
  rows(at("holds"), found.length
    ? found.map(one => [one.axis, words(one), one.note ? "warn" : one.engaged ? "good" : "soft"])
    : [["", "no message from the pilot yet", "soft"]]);
}

const KINDS = {ok: "good", warning: "warn"};
function health(found) {
  if (Object.values(found).some(one => one.level !== "ok")) ill_ms = Date.now();
  at("nodes").classList.toggle("wrong", Date.now() - ill_ms < WRONG_ms);
  at("health").replaceChildren(...Object.entries(found)
    .sort(([, a], [, b]) => (a.level === "ok") - (b.level === "ok"))
    .map(([name, one]) => {
      const kind = KINDS[one.level] || "bad", line = make("li", undefined, one.level === "ok" ? "" : "wrong");
      line.append(make("span", one.level === "ok" ? "\u2713 " : "\u2717 ", kind), make("b", name),
        make("span", (one.rate_Hz === null ? "" : " " + one.rate_Hz.toFixed(0) + "\u00a0Hz") +
          (one.level === "ok" ? "" : " " + one.message), one.level === "ok" ? "soft" : kind));
      return line;
    }));
}

function estimates(found) {
  const body = found.map(one => {
    const row = make("tr");
    row.append(make("td", one.motion));
    const cell = make("td", undefined, "many");
    if (!one.samples) cell.append("nothing learned yet");
    else cell.append(...one.values.map(v =>
      make("span", `${v.name} ${measured(v.value, v.std)} ${v.unit}`, "coefficient")));
    row.append(cell, make("td", one.samples), make("td", one.learning ? "learning" : one.reason || "resting",
      one.learning ? "good" : "soft"));
    return row;
  });
  const head = make("tr");
  head.append(...["motion", "coefficients", "samples", "state"].map(heading));
  at("estimates").replaceChildren(...(body.length ? [head, ...body]
    : [make("caption", "none yet; they come with the first plateau of a maneuver", "soft")]));
}

/* ---- plots */

/* Draws lines of points {at, value, band} over the time since `from_ms`; the axis fits what is newer than half of it,
   but for bands beside which the present one would look like a line. */
function plot(canvas, lines, from_ms, least) {
  const width = canvas.clientWidth, height = canvas.clientHeight, scale = window.devicePixelRatio || 1;
  if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
  }
  const pen = canvas.getContext("2d"), style = getComputedStyle(document.documentElement);
  const color = name => style.getPropertyValue("--" + name);
  const left = 52, bottom = height - 16;
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  const widest = points => WIDEST * (points.at(-1).band || Infinity);
  const counted = lines.flatMap(points => points[0] && "band" in points[0]
    ? points.slice(points.length >> 1).filter(one => one.band <= widest(points)) : points).filter(one => one.value !== null);
  if (!counted.length) return;
  let low = Math.min(...counted.map(one => one.value - (one.band || 0)));
  let high = Math.max(...counted.map(one => one.value + (one.band || 0)));
  const lacking = least - (high - low);
  if (lacking > 0) { low -= lacking / 2; high += lacking / 2; }
  const step = nice((high - low) / 3);
  low = Math.floor(low / step) * step;
  high = Math.ceil(high / step) * step;
  const x = at_ms => left + (width - left - 4) * (at_ms - from_ms) / (heard_ms - from_ms);
  const y = value => bottom - (bottom - 8) * (value - low) / (high - low);
  pen.font = "12px system-ui,sans-serif";
  pen.lineWidth = 1;
  pen.textAlign = "right";
  for (let value = low; value < high + step / 2; value += step) {
    pen.strokeStyle = color("grid");
    pen.beginPath(); pen.moveTo(left, y(value)); pen.lineTo(width, y(value)); pen.stroke();
    pen.fillStyle = color("soft");
    pen.fillText(value.toFixed(Math.max(0, -Math.floor(Math.log10(step) + 1e-9))), left - 5, y(value) + 4);
  }
  const seconds = Math.round((heard_ms - from_ms) / 1000);
  [[`-${seconds} s`, from_ms, "left"], [`-${Math.round(seconds / 2)} s`, (from_ms + heard_ms) / 2, "center"],
    ["now", heard_ms, "right"]].forEach(([text, at_ms, align]) => {
    pen.textAlign = align;
    pen.fillText(text, x(at_ms), height - 2);
  });
  pen.save();
  pen.beginPath(); pen.rect(left, 0, width - left, bottom); pen.clip();
  lines.forEach((points, index) => {
    band(pen, points, color("abc"[index]), x, y);
    line(pen, points, color("abc"[index]), x, y);
  });
  pen.restore();
}

function band(pen, points, color, x, y) {
  const known = points.filter(one => one.value !== null && one.band !== null && one.band !== undefined);
  if (known.length < 2) return;
  pen.globalAlpha = 0.2;
  pen.fillStyle = color;
  pen.beginPath();
  for (const one of known) pen.lineTo(x(one.at), y(one.value + one.band));
  for (const one of known.reverse()) pen.lineTo(x(one.at), y(one.value - one.band));
  pen.fill();
  pen.globalAlpha = 1;
}

function line(pen, points, color, x, y) {
  pen.strokeStyle = color;
  pen.lineWidth = 2;
  pen.lineJoin = "round";
  pen.beginPath();
  let drawing = false;
  for (const one of points) {
    if (one.value !== null) pen[drawing && !one.gap ? "lineTo" : "moveTo"](x(one.at), y(one.value));
    drawing = one.value !== null;
  }
  pen.stroke();
}

/* A gap where no message came, and where the heading goes through north. */
const pointsOf = key => past.map((one, index) => ({at: one.at, value: one[key], gap: index > 0 &&
  (one.at - past[index - 1].at > 1500 || key === "heading" && Math.abs(one[key] - past[index - 1][key]) > 180)}));

function plotPast(canvas) {
  const {keys, name, unit, span} = canvas.dataset, names = keys.split(" ");
  plot(canvas, names.map(pointsOf), heard_ms - KEPT_ms, Number(span));
  const now = last.navigation ? names.map(key => `${key} ${short(last.navigation[key])}`).join(", ") : "unknown";
  canvas.setAttribute("aria-label", `${name} over the last two minutes, now in ${unit}: ${now}`);
}

/* ---- the estimate over time, as far as this page has seen it */

function keep(found) {
  let course = courses[found.motion];
  if (!course || found.samples < course.samples) course = courses[found.motion] = {samples: 0, lines: {}};
  if (found.samples === course.samples) return;
  course.samples = found.samples;
  for (const one of found.values) {
    const kept = course.lines[one.name] ||= {unit: one.unit, points: []};
    kept.points.push({at: heard_ms, value: one.value, std: one.std, band: one.band});
    if (kept.points.length > 800) kept.points = kept.points.filter((_, index) => index % 2);
  }
  at("course").dataset.newest = found.motion;
}

function plotCourses() {
  const known = Object.keys(courses), picked = at("course").dataset.chosen || at("course").dataset.newest;
  at("choice").hidden = !known.length;
  options(at("course"), known.map(name => [name, name]), picked);
  const course = courses[picked], place = at("courses");
  if (!course) return;
  const names = Object.keys(course.lines);
  if (place.dataset.shown !== picked + names) {
    place.dataset.shown = picked + names;
    place.replaceChildren(...names.map(name => {
      const figure = make("figure"), canvas = make("canvas");
      canvas.setAttribute("role", "img");
      figure.append(make("figcaption", `${picked} ${name} [${course.lines[name].unit}]`), canvas);
      return figure;
    }));
  }
  place.querySelectorAll("canvas").forEach((canvas, index) => {
    const {points, unit} = course.lines[names[index]], {value, std} = points.at(-1);
    plot(canvas, [points], points[0].at, Math.abs(value || 1) * 0.02);
    canvas.setAttribute("aria-label", `${picked} ${names[index]} over time, now ${measured(value, std)} ${unit}`);
  });
}

/* Options of a choice, made anew only when they change, so that an open list stays open. */
function options(choice, wanted, picked) {
  if (choice.dataset.made !== String(wanted)) {
    choice.dataset.made = String(wanted);
    choice.replaceChildren(...wanted.map(([value, text]) => Object.assign(make("option", text), {value})));
  }
  if (picked !== undefined && document.activeElement !== choice) choice.value = picked;
}

/* ---- cameras */

function cameras(found) {
  at("video").hidden = !found.length;
  const before = at("cameras").dataset.made;
  options(at("cameras"), found.length ? [...found.map(name => [name, name]), ["", "none"]] : []);
  if (before === undefined && found.length) at("cameras").value = found[0];
}

async function watch() {
  let seen = "", of = "", framed_ms = 0;
  for (;;) {
    const name = at("cameras").value, frame = at("frame");
    if (name !== of) { [of, seen, frame.hidden] = [name, "", true]; at("framed").textContent = ""; }
    if (!name || document.hidden || locked || isCut()) { await new Promise(go => setTimeout(go, 300)); continue; }
    try {
      const answer = await ask("camera/" + encodeURIComponent(name), undefined, {"If-None-Match": seen});
      if (answer.ok) {
        seen = answer.headers.get("ETag");
        framed_ms = Date.now();
        await picture(frame, await answer.blob(), name);
        at("framed").textContent = "";
      } else if (answer.status !== 304) at("framed").textContent = await answer.text();
    } catch (error) { at("framed").textContent = error.message; }
    const old = Date.now() - framed_ms > PATIENCE_ms;
    frame.classList.toggle("old", old);
    if (old && !at("framed").textContent) at("framed").textContent = frame.hidden ? "no picture yet" : "no new picture";
    await new Promise(go => setTimeout(go, old ? 500 : 40));
  }
}

async function picture(frame, blob, name) {
  const before = frame.src;
  frame.src = URL.createObjectURL(blob);
  if (before) URL.revokeObjectURL(before);
  await frame.decode().catch(() => { throw new Error("this browser cannot show the picture"); });
  frame.alt = "camera " + name;
  frame.hidden = false;
}

function nice(step) {
  const power = 10 ** Math.floor(Math.log10(step)), part = step / power;
  return power * (part > 5 ? 10 : part > 2 ? 5 : part > 1 ? 2 : 1);
}

/* ---- commissioning */

let proven = 0;
const CLAIMS = ["verdict", "claim", "claimed", "found"], VERDICTS = {wrong: "bad", open: "warn", proven: "good"};

function commissioning(update) {
  const {saying, number} = update.commissioning;
  at("commission").disabled = update.ordered || update.thrusters.armed;
  if (saying) say(at("proving"), saying);
  if (number === proven) return;
  proven = number;
  showProof();
}

async function showProof() {
  const answer = await ask("commissioning").catch(() => null);
  if (!answer || !answer.ok) { proven = 0; return; }
  const found = await answer.json();
  at("claims").replaceChildren(...rowsOf(CLAIMS, found.rows, (index, text) => index ? "many" : VERDICTS[text] || "soft"));
  at("lines").textContent = found.lines.length ? "These lines go into the vehicle file; then restart the stack:"
    : "What is wrong or open: mend it, and commission again.";
  at("yaml").textContent = found.lines.join("\n");
  at("yaml").hidden = !found.lines.length;
  if (at("picture").src) URL.revokeObjectURL(at("picture").src);
  at("picture").src = URL.createObjectURL(new Blob([found.picture], {type: "image/svg+xml"}));
  at("proven").hidden = false;
  say(at("proving"), "");
}

/* ---- the session of the day: it runs in a terminal, and waits for Enter there or for a tap here */

const STEPS = {done: "good", next: "", left: "soft"};

function session(found) {
  at("session").hidden = !found;
  if (!found) return;
  const {name, steps, reached, question} = found;
  at("day").textContent = name;
  at("answered").hidden = readOnly || !question || question.arms;
  at("answered").dataset.number = question ? question.number : "";
  say(at("asked"), !question ? "" : question.sentence + (question.arms ? "; then press Enter in the terminal: it arms" : ""));
  at("steps").replaceChildren(...steps.map(step => make("li", step.name + (step.remark ? ": " + step.remark : "") +
    (step.state === "next" ? " (next)" : step.state === "done" ? " \u2713" : ""), STEPS[step.state])));
  at("gained").replaceChildren(...(reached.length ? rowsOf(["motion", "drag known to", "goal"], reached) : []));
}

/* ---- reports */

async function listReports() {
  const answer = await ask("reports").catch(() => null);
  if (!answer || !answer.ok) return;
  const runs = await answer.json();
  const lines = runs.length ? runs.map(run => {
    const line = make("li"), link = make(run.report ? "a" : "span", run.name);
    line.append(link);
    if (run.report) {
      link.href = "#";
      link.addEventListener("click", event => { event.preventDefault(); openReport(run.name); });
    } else line.append(make("span", "\u00a0 recorded, no report yet", "soft"));
    if (run.motions && run.motions.length) line.append(results(run.motions));
    return line;
  }) : [make("li", "none in the folder of runs", "soft")];
  at("reports").replaceChildren(...lines.slice(0, RECENT));
  at("older").replaceChildren(...lines.slice(RECENT));
  at("earlier").hidden = lines.length <= RECENT;
}

/* Motion, verdict, and drag at the highest speed. */
function results(motions) {
  const table = make("table"), cells = motions.map(one => [one.motion, one.verdict, one.drag.replace("+- ", "\u00b1")]);
  table.append(...rowsOf(["motion", "verdict", "drag at the highest speed"], cells,
    (index, text) => ["", text === "identified" ? "good" : "warn", "many"][index]));
  return table;
}

async function openReport(name) {
  const answer = await ask("reports/" + encodeURIComponent(name)).catch(() => null);
  if (!answer) return;
  if (!answer.ok) { notify(await answer.text(), false); return; }
  location.assign(URL.createObjectURL(new Blob([await answer.blob()], {type: "text/html"})));
}

/* ---- begin */

function begin(found) {
  token = found.replace(/^.*#/, "").trim();
  sessionStorage.setItem("hindrax", token);
  locked = false;
  at("ask").hidden = true;
  at("view").hidden = false;
  listen();
  listReports();
  if (!watching) watch();
  watching = true;
}
const choices = JSON.parse(at("choices").textContent);
/* The identification node chooses the legs, instead of the pilot's plan. */
const EXPERIMENT = "most informative legs";
function experimenting() { return at("excitation").value === EXPERIMENT; }
at("motions").append(...choices.motions.map(name => {
  const label = make("label", undefined, "pick"), box = make("input");
  Object.assign(box, {type: "checkbox", name: "motion", value: name, checked: name === "surge"});
  label.append(box, name);
  return label;
}));
at("excitation").append(...choices.excitations.map(name => make("option", name)), make("option", EXPERIMENT));
at("excitation").addEventListener("change", () => {
  at("aim").hidden = !experimenting();
  at("random").hidden = experimenting();
});
for (const name of ["stop", "disarm", "cancel", "commission"]) at(name).addEventListener("click", () => order(name));
at("answered").addEventListener("click", () => {
  at("answered").hidden = true;
  order("answer", {number: Number(at("answered").dataset.number)});
});
at("fly").addEventListener("submit", event => {
  event.preventDefault();
  const motions = [...document.querySelectorAll("[name=motion]:checked")].map(one => one.value);
  const asked = (name, unit) => at(name).value === "" ? null : Number(at(name).value) / unit;
  const how = experimenting() ? {until: asked("until", 100), minutes: asked("minutes", 1)} :
    {excitation: at("excitation").value, seed: Number(at("seed").value)};
  order("fly", {motions, on_cancel: at("ending").value, ...how});
});
at("ask").addEventListener("submit", event => { event.preventDefault(); begin(at("token").value); });
/* Another token typed into the same window: begin anew with it. */
window.addEventListener("hashchange", () => location.reload());
at("course").addEventListener("change", () => { at("course").dataset.chosen = at("course").value; });
setInterval(headline, 500);
const given = location.hash.slice(1) || sessionStorage.getItem("hindrax") || "";
history.replaceState(null, "", location.pathname);
if (given) begin(given); else askForToken();
