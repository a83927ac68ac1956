"use strict";
// The page keeps what was changed and asks for it: a coarse grid while the hand moves, finer ones when it rests.
const REST = 300; // ms without a change
const $ = (id) => document.getElementById(id);
const changes = {}; // key -> text, as --set has it
let scene, shown, last = "", busy = null, moved = false, timer = 0; // busy: what ends a request, while there is one

const PREFIXED = /^(m|Pa|Pa s|N|N\/m|W|W\/m|m\/s|N m|s)$/;
const PREFIX = { "-9": "n", "-6": "u", "-3": "m", 0: "", 3: "k", 6: "M", 9: "G" };

function scaled(size, unit) { // [factor, unit]: numbers from 1 to 1000
  if (!PREFIXED.test(unit) || !size || !isFinite(size)) return [1, unit];
  const power = Math.min(9, Math.max(-9, 3 * Math.floor(Math.log10(Math.abs(size)) / 3 + 1e-12)));
  return [10 ** -power, PREFIX[power] + unit];
}
const digits = (value, n = 4) => value && (Math.abs(value) < 1e-3 || Math.abs(value) >= 1e6) ? value.toExponential(n - 1) : String(Number(value.toPrecision(n)));
function words(value, unit, n = 4) { // "15 um"
  if (Array.isArray(value)) {
    const [factor, name] = scaled(Math.max(...value.map(Math.abs)), unit);
    return `(${value.map((x) => digits(factor * x, n)).join(", ")}) ${name}`;
  }
  const [factor, name] = scaled(value, unit);
  return `${digits(factor * value, n)} ${name}`.trim();
}

function element(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

// Controls ---------------------------------------------------------------------------------------------------------
const position = (c, value) => c.log ? 1000 * Math.log(value / c.low) / Math.log(c.high / c.low) : 1000 * (value - c.low) / (c.high - c.low);
function valueAt(c, place) {
  const part = place / 1000;
  const value = c.log ? c.low * (c.high / c.low) ** part : c.low + part * (c.high - c.low);
  return c.whole ? Math.round(value) : Number(value.toPrecision(4));
}

function control(c) {
  const id = `key-${c.key}`, box = element("div", { class: "control" });
  let entry;
  if (c.kind === "choice") {
    entry = element("select", { id }, ...c.options.map((option) => element("option", { value: option }, option)));
    entry.value = c.value;
    entry.addEventListener("change", () => change(c.key, entry.value));
  } else if (c.kind === "switch") {
    entry = element("input", { id, type: "checkbox" });
    entry.checked = c.value;
    entry.addEventListener("change", () => change(c.key, String(entry.checked)));
  } else {
    entry = element("input", { id, type: "text", spellcheck: "false", autocomplete: "off" });
    entry.value = c.value === null ? "" : c.kind === "number" ? words(c.value, c.unit, 6) : c.value;
  }
  box.append(element("label", { for: id }, c.key, entry));
  if (c.kind === "number") {
    const slider = element("input", { type: "range", min: 0, max: 1000, step: "any", "aria-label": `${c.key}, slider` });
    slider.value = position(c, c.value);
    slider.addEventListener("input", () => {
      const value = valueAt(c, Number(slider.value));
      entry.value = words(value, c.unit, 6);
      change(c.key, String(value));
    });
    entry.addEventListener("change", () => change(c.key, entry.value)); // with any unit: the program reads it
    box.append(slider);
    box.follow = (value) => { if (value > 0 || !c.log) slider.value = position(c, value); };
  } else if (c.kind === "text") {
    entry.addEventListener("change", () => change(c.key, entry.value));
  }
  box.append(element("span", { class: "text" }, c.text), element("span", { class: "fault", role: "alert" }));
  box.dataset.key = c.key;
  box.entry = entry;
  return box;
}

function change(key, text) {
  changes[key] = text;
  last = key;
  again();
}

function again() {
  moved = true;
  clearTimeout(timer);
  if (busy && busy.level > 0) busy.abort(); // what refines the values before is not waited for
  else ask(0);
}

function fault(text) { // beside the control that was touched last
  for (const box of document.querySelectorAll(".control")) {
    const here = text && box.dataset.key === last;
    box.querySelector(".fault").textContent = here ? text : "";
    box.entry.setAttribute("aria-invalid", String(Boolean(here)));
  }
  $("pictures").classList.toggle("stale", Boolean(text));
}

// Asking -----------------------------------------------------------------------------------------------------------
async function post(what, level, signal) {
  const body = JSON.stringify({ changes, level });
  const reply = await fetch(what, { method: "POST", headers: { "Content-Type": "application/json" }, body, signal });
  if (!reply.ok) throw refusal(reply.status, await reply.json());
  return reply;
}
const refusal = (status, answer) => Object.assign(new Error(answer.refused), { refused: status === 400 });

async function answered(reply) { // the last of its lines; those before, of a film in time, are shown as they come
  const reader = reply.body.pipeThrough(new TextDecoderStream()).getReader();
  let text = "";
  for (;;) {
    const { done, value } = await reader.read();
    text += value || "";
    const lines = text.split("\n");
    if (lines.length > 1 && !moved) show(JSON.parse(lines[lines.length - 2]));
    text = lines[lines.length - 1];
    if (done) break;
  }
  const answer = JSON.parse(text);
  if (answer.refused) throw refusal(400, answer);
  return answer;
}

async function ask(level) {
  if (busy) return; // one request at a time; what moved meanwhile is asked when its answer is there
  busy = Object.assign(new AbortController(), { level });
  moved = false;
  let next = null;
  try {
    const answer = await answered(await post("solve", level, busy.signal));
    if (!moved || level === 0) show(answer);
    if (!answer.last) next = level + 1;
  } catch (error) {
    const ended = error instanceof TypeError;
    if (error.name !== "AbortError") {
      if (!ended) fault(error.message);
      state(ended ? "the program has ended" : error.refused ? "not solved: the value is refused, see beside it" : error.message, true);
    }
  }
  busy = null;
  if (moved) ask(0);
  else if (next !== null) timer = setTimeout(() => ask(next), next === 1 ? REST : 0);
}

async function save(what, name) {
  try {
    const blob = await (await post(what, shown ? shown.level : 0)).blob();
    const link = element("a", { href: URL.createObjectURL(blob), download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  } catch (error) {
    fault(error.message);
  }
}

// Showing ----------------------------------------------------------------------------------------------------------
function state(text, bad = false) {
  $("state").textContent = text;
  $("state").classList.toggle("bad", bad);
}

function show(answer) {
  shown = answer;
  fault("");
  const time = answer.time ? `t = ${words(answer.time[0], "s", 3)} of ${words(answer.time[1], "s", 3)}, ` : "";
  const error = answer.estimate === null ? answer.last ? "no estimate" : "no estimate yet" : `${answer.quantity}: estimated error ${digits(100 * answer.estimate, 2)} %`;
  const going = answer.reached ? "" : answer.last ? " (a finer grid would take too long here: lcp-lube solve --accuracy)" : ", refining ...";
  state(answer.solved ? `${time}${error}; grid ${answer.grid}, ${digits(1000 * answer.seconds, 3)} ms${going}` : `${answer.outcome}: ${answer.message}`, !answer.solved);
  $("state").dataset.level = answer.level;
  $("state").dataset.last = String(answer.last);
  $("warnings").textContent = answer.warnings.join("; ");
  $("why").textContent = answer.why.join("\n");
  $("numbers").tBodies[0].replaceChildren(...answer.numbers.map((one) =>
    element("tr", { "data-name": one.name }, element("td", {}, one.name.replaceAll("_", " ")), element("td", {}, words(one.value, one.unit, 5)))));
  draw(answer);
}

const unpack = (text) => new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
const NAMES = { p: "pressure p", r: "void fraction r", h: "film h" };
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
// viridis, cividis and a blue: told apart in grey and by all eyes
const MAPS = {
  p: ["#440154", "#472d7b", "#3b528b", "#2c728e", "#21918c", "#28ae80", "#5ec962", "#addc30", "#fde725"],
  r: ["#00224e", "#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74", "#c3b369", "#fee838"],
  h: ["#f7fbff", "#deebf7", "#c6dbef", "#9ecae1", "#6baed6", "#4292c6", "#2171b5", "#08519c", "#08306b"],
};
const rgb = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16));
function tint(map, part) {
  const stops = (MAPS[map] || MAPS.p).map(rgb), at = Math.min(Math.max(part, 0), 1) * (stops.length - 1), k = Math.min(Math.floor(at), stops.length - 2);
  return stops[k].map((low, j) => low + (at - k) * (stops[k + 1][j] - low));
}
function limits(values) {
  let low = Infinity, high = -Infinity;
  for (const value of values) if (isFinite(value)) { low = Math.min(low, value); high = Math.max(high, value); }
  return low > high ? [0, 1] : [low, high];
}

function draw(answer) {
  const fields = Object.fromEntries(Object.entries(answer.fields).map(([name, field]) => [name, { ...field, values: unpack(field.values) }]));
  const x = answer.axes.x, y = answer.axes.y, holder = $("pictures"), figures = [];
  for (const [name, field] of Object.entries(fields)) figures.push(y ? map(name, field, x, y) : null);
  const row = y ? middle(y) : 0;
  const line = (name) => fields[name].values.slice(row * x.values.length, (row + 1) * x.values.length);
  const title = y ? ` at y = ${words(y.values[row], y.unit, 3)}` : "";
  for (const name of Object.keys(fields)) if (!y || name === "p" || name === "v") figures.push(curve(name, fields[name].unit, x, line(name), fields.r ? line("r") : null, title));
  holder.replaceChildren(...figures.filter(Boolean));
}
const middle = (y) => Math.floor(y.values.length / 2);

function map(name, field, x, y) {
  const nx = x.values.length, ny = y.values.length, [low, high] = limits(field.values), canvas = element("canvas", { width: nx, height: ny });
  const context = canvas.getContext("2d"), image = context.createImageData(nx, ny);
  for (let j = 0; j < ny; j++) for (let i = 0; i < nx; i++) {
    const shade = tint(name, (field.values[j * nx + i] - low) / (high - low || 1)), at = 4 * ((ny - 1 - j) * nx + i);
    image.data.set([...shade, 255], at);
  }
  context.putImageData(image, 0, 0);
  const length = x.values[nx - 1] - x.values[0] || 1, width = y.values[ny - 1] - y.values[0] || 1;
  canvas.style.aspectRatio = String(Math.min(Math.max(length / width, 0.5), 4));
  const bar = element("canvas", { width: 64, height: 1 }), ink = bar.getContext("2d");
  for (let k = 0; k < 64; k++) { ink.fillStyle = `rgb(${tint(name, k / 63).join(" ")})`; ink.fillRect(k, 0, 1, 1); }
  return element("figure", {}, element("figcaption", {}, NAMES[name] || name), canvas,
    element("div", { class: "bar" }, words(low, field.unit, 3), bar, words(high, field.unit, 3)));
}

function curve(name, unit, x, values, r, where) {
  const ratio = window.devicePixelRatio || 1, width = Math.min(Math.max($("pictures").clientWidth - 2, 240), 900), height = name === "p" ? 240 : 150, canvas = element("canvas", { width: width * ratio, height: height * ratio });
  canvas.style.aspectRatio = `${width} / ${height}`;
  const c = canvas.getContext("2d"), [low, high] = limits(values), start = x.values[0], end = x.values[x.values.length - 1];
  c.scale(ratio, ratio);
  const pad = 8, left = 64, floor = name === "r" ? 0 : name === "h" ? Math.min(0, low) : low, top = high > floor ? high : floor + 1;
  const px = (value) => left + (width - left - pad) * (value - start) / (end - start || 1);
  const py = (value) => height - 22 - (height - 34) * (value - floor) / (top - floor);
  if (r) { c.fillStyle = colour("cavity"); for (let i = 0; i < r.length; i++) if (r[i] > 0) { const a = px(x.values[Math.max(i - 1, 0)]), b = px(x.values[Math.min(i + 1, r.length - 1)]); c.fillRect((a + px(x.values[i])) / 2, 12, (b - a) / 2 + 0.5, height - 34); } }
  c.strokeStyle = colour("line"); c.strokeRect(left, 12, width - left - pad, height - 34);
  c.strokeStyle = colour(name === "r" ? "red" : "blue"); c.lineWidth = 2; c.beginPath();
  values.forEach((value, i) => i ? c.lineTo(px(x.values[i]), py(value)) : c.moveTo(px(x.values[i]), py(value)));
  c.stroke();
  c.fillStyle = colour("ink"); c.font = "12px system-ui, sans-serif"; c.textAlign = "right";
  c.fillText(words(top, unit, 3), left - 5, 20); c.fillText(words(floor, unit, 3), left - 5, height - 22);
  c.textAlign = "left"; c.fillText(words(start, x.unit, 3), left, height - 6);
  c.textAlign = "right"; c.fillText(`x = ${words(end, x.unit, 3)}`, width - pad, height - 6);
  return element("figure", { class: "wide" }, element("figcaption", {}, `${NAMES[name] || name}${where}${r && name === "p" ? " (grey: cavity)" : ""}`), canvas);
}

// Start ------------------------------------------------------------------------------------------------------------
function lay() {
  for (const place of ["first", "more"]) $(place).replaceChildren(...scene.controls.filter((c) => c.first === (place === "first")).map(control));
}

async function begin() {
  scene = await (await fetch("scene")).json();
  document.title = `${scene.name}: lcp-lube explore`;
  $("name").textContent = scene.name;
  $("line").textContent = scene.line;
  lay();
  $("reset").addEventListener("click", () => { for (const key of Object.keys(changes)) delete changes[key]; lay(); again(); });
  $("toml").addEventListener("click", () => save("toml", `${scene.name}.toml`));
  $("picture").addEventListener("click", () => save("picture", `${scene.name}.png`));
  ask(0);
}
begin();
