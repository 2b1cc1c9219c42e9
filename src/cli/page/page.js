// Shows the picture and the settings. All state is the program's: changes are sent to it and come back with the next picture,
// so that several pages are in sync.

import { listen } from "./gestures.js";
import { sceneLights, materials } from "./materials.js";
import { decode, drawHistogram, outliner, put, thumbnails } from "./picture.js";

const $ = (id) => document.getElementById(id);
const canvas = $("picture");
const outline = outliner($("overlay"), $("outline"), $("object"));
const showThumbnails = thumbnails($("thumbnails"), canvas, (pass) => set({ pass }));
const sceneLight = sceneLights({ heldLive, fill });
const material = materials({ heldLive, post: (url) => post(url), copy, chooseLight: sceneLight.choose });
let status = null, namesObjects = true;

/** Channels that are always recorded. */
const PAGE_AOVS = /^([RGBAZ]$|N\.|albedo\.|denoising_|object\.|material\.)/;

/** Sends a request to the program. */
async function post(url, body) {
  const answer = await fetch(url, { method: "POST", body: JSON.stringify(body ?? null) });
  if (!answer.ok) showError(await answer.text());
  return answer.ok;
}

function set(choice) {
  return post("set", choice);
}

function showError(text) {
  $("error-message").textContent = text;
  $("error-message").hidden = !text;
}

/** Fetches new pictures in a loop. */
async function follow() {
  let version = 0;
  for (;;) {
    try {
      const answer = await fetch(`frame?after=${version}`);
      if (answer.status === 200) version = draw(await answer.arrayBuffer());
      else if (answer.status !== 204) throw new Error(await answer.text());
    } catch (error) {
      $("state").textContent = "The program has ended, or can't be reached.";
      version = 0;
      await new Promise((done) => setTimeout(done, 1000));
    }
  }
}

/** Draws a response. */
function draw(buffer) {
  const wasFinished = status?.finished, requestNumber = status?.request_number;
  let image;
  ({ status, image } = decode(buffer));
  if (image) {
    put(canvas, image);
    drawHistogram($("histogram"), image);
  }
  $("waiting").hidden = true;
  if (status.request_number !== requestNumber) outline.clear();
  if (status.finished && !wasFinished) $("announcement").textContent = "The picture is done.";
  fit();
  showStatus();
  showThumbnails(status);
  // For tests that drive the page.
  document.body.dataset.version = status.version;
  document.body.dataset.samples = status.preview ? 0 : status.samples;
  document.body.dataset.finished = status.finished;
  document.body.dataset.denoised = status.denoised ?? 0;
  return status.version;
}

/** Scales the picture to the window, by a factor of at most 2. */
function fit() {
  if (!status) return;
  const [width, height] = status.size;
  const room = $("stage");
  const scale = Math.min(room.clientWidth / width, room.clientHeight / height, 2);
  $("frame").style.width = `${Math.round(width * scale)}px`;
  $("frame").style.height = `${Math.round(height * scale)}px`;
}

/** Fills a select element, unless it has these choices already. */
function fill(select, choices, chosen) {
  const wanted = JSON.stringify(choices);
  if (select.dataset.choices !== wanted) {
    select.dataset.choices = wanted;
    select.replaceChildren(...choices.map(([value, text, title]) => {
      const option = new Option(text, value);
      if (title) option.title = title;
      return option;
    }));
  }
  if (document.activeElement !== select) select.value = chosen;
}

function slide(id, value, text) {
  const input = $(id);
  if (document.activeElement !== input || !input.matches(":active")) input.value = value;
  $(`${id}-value`).textContent = text;
}

/** A fraction in percent with two significant digits; whole percents from 100 on. */
const percent = (fraction) => (fraction < 1 ? (100 * fraction).toPrecision(2) : Math.round(100 * fraction));

/** Updates everything except the picture. */
function showStatus() {
  const scene_info = status.scene_info;
  document.title = `${scene_info.name} - oscura`;
  $("name").textContent = scene_info.name;
  $("scene_info").textContent = `${scene_info.triangles.toLocaleString("en")} triangles`;
  const samples = status.samples.toLocaleString("en", { maximumFractionDigits: 0 });
  const progress = status.preview ? "preview" : `${samples} of ${scene_info.samples} samples`;
  const error = status.error && !status.preview ? `, noise ${percent(status.error)} %` : "";
  $("state").textContent = `${progress}, ${status.seconds.toFixed(1)} s${error}${status.finished ? ", done" : ""}`;
  $("progress").value = status.preview ? 0 : status.samples / scene_info.samples;
  showError(status.error_message);
  slide("exposure", status.exposure, `${status.exposure.toFixed(1)} stops`);
  slide("defocus", status.defocus, status.defocus ? `${status.defocus.toFixed(2)}°` : "off");
  $("denoise").checked = status.denoise;
  const taken = Math.round(status.denoised ?? 0);
  $("denoise-value").textContent = taken ? `of ${taken} sample${taken > 1 ? "s" : ""}` : status.denoise ? "soon" : "off";
  $("split-row").hidden = !status.denoise;
  slide("split", status.split, `${Math.round(100 * status.split)} %`);
  $("split-line").hidden = !status.denoised || status.split === 0 || status.pass !== "";
  $("split-line").style.left = `${100 * status.split}%`;
  document.body.classList.toggle("looking-on", !scene_info.is_live);
  $("rotation-row").hidden = scene_info.rotation === null;
  $("strength-row").hidden = scene_info.strength === null;
  slide("strength", Math.log2(status.strength ?? 1), (status.strength ?? 1).toPrecision(3));
  sceneLight.update(status.lights);
  material.update(status);
  slide("rotation", status.rotation ?? 0, `${Math.round(status.rotation ?? 0)}°`);
  fill($("view"), status.views.map((name) => [name, name]), status.view);
  fill($("pass"), [["", "colour"], ...scene_info.passes.map(([name, about]) => [name, name.replaceAll("_", " "), about])], status.pass);
  fill($("size"), scene_info.sizes.map(([w, h]) => [`${w},${h}`, `${w} x ${h}`]), status.size.join(","));
  const named = (names) => names.map((name) => [name, name]);
  $("stage-row").hidden = status.stage === null;
  $("up-row").hidden = status.up === null;
  $("light").hidden = status.stage === null && status.up === null && scene_info.rotation === null && scene_info.strength === null
    && status.lights.length === 0;
  fill($("stage-light"), named(scene_info.stages), status.stage);
  fill($("up"), named(scene_info.ups), status.up);
  fill($("camera"), scene_info.cameras.map((name, i) => [String(i), name]), String(status.camera));
  if (document.activeElement !== $("command")) $("command").value = status.command;
  $("note-count").textContent = `(${scene_info.notes.length})`;
  const notes = JSON.stringify(scene_info.notes);
  if ($("notes").dataset.shown !== notes) {
    $("notes").dataset.shown = notes;
    $("notes").replaceChildren(...scene_info.notes.map((note) => Object.assign(document.createElement("li"), { textContent: note })));
  }
}

/** Shows the values and the object at a position of the picture. */
async function probe(x, y) {
  const answer = await fetch(`probe?x=${x}&y=${y}`);
  if (!answer.ok) return;
  const { x: column, y: row, values } = await answer.json();
  const number = (v) => (v === null ? "none" : Number(v).toPrecision(4));
  const rgb = ["R", "G", "B"].map((c) => number(values[c])).join(" ");
  const depth = values.Z > 5e9 ? "" : `  ${number(values.Z)} m`;
  if (namesObjects) outline.show(x, y, values["object.id"], status.version);
  const prefix = { normal: "N.", albedo: "albedo." }[status.pass];
  const shown = ([name]) => (prefix ? name.startsWith(prefix) : !PAGE_AOVS.test(name));
  const more = Object.entries(values).filter(shown).slice(0, 4).map(([name, v]) => `  ${name} ${number(v)}`).join("");
  $("probe").textContent = `${column}, ${row}  ${rgb}${depth}${more}`;
}

/** Like `live`, for changes that can be undone: all changes while a slider is held are one step. */
function heldLive(input, choice) {
  let isHeld = false;
  live(input, (v) => {
    const chosen = choice(v);
    if (!chosen) return null;
    const sent = { ...chosen, is_same: isHeld };
    isHeld = true;
    return sent;
  });
  input.addEventListener("change", () => { isHeld = false; });
}

/** Sends the value of an input on each change, one request at a time; nothing if `choice` returns null. */
function live(input, choice) {
  let busy = false, again = false;
  const send = async () => {
    if (busy) { again = true; return; }
    const chosen = choice(input.value);
    if (!chosen) return;
    busy = true;
    await set(chosen);
    busy = false;
    if (again) { again = false; send(); }
  };
  input.addEventListener("input", send);
}

live($("exposure"), (v) => ({ exposure: Number(v) }));
live($("rotation"), (v) => ({ rotation: Number(v) }));
heldLive($("strength"), (v) => ({ strength: Number((2 ** v).toPrecision(3)) }));
live($("defocus"), (v) => ({ defocus: Number(v) }));
live($("split"), (v) => ({ split: Number(v) }));
live($("view"), (v) => ({ view: v }));
live($("pass"), (v) => ({ pass: v }));
live($("size"), (v) => ({ size: v.split(",").map(Number) }));
live($("stage-light"), (v) => ({ stage: v }));
live($("up"), (v) => ({ up: v }));
$("denoise").addEventListener("input", () => set({ denoise: $("denoise").checked }));
$("camera").addEventListener("input", () => post("camera", Number($("camera").value)));
$("reset").addEventListener("click", () => post("camera", Number($("camera").value)));
$("reload").addEventListener("click", () => post("reload"));
/** Copies the text of a field to the clipboard, with feedback on the button. */
async function copy(button, field) {
  try {
    await navigator.clipboard.writeText(field.value);
  } catch {
    field.select();
    document.execCommand("copy");
  }
  const text = button.textContent;
  button.textContent = "Copied";
  setTimeout(() => { button.textContent = text; }, 1500);
}
$("copy").addEventListener("click", () => copy($("copy"), $("command")));
const aim = (on) => {
  $("focus").setAttribute("aria-pressed", on);
  canvas.classList.toggle("aiming", on);
};
$("focus").addEventListener("click", () => aim($("focus").getAttribute("aria-pressed") !== "true"));
$("keys").addEventListener("click", () => $("help").showModal());
$("theme").addEventListener("click", () => {
  const root = document.documentElement.style;
  root.colorScheme = { "": "light", light: "dark", dark: "" }[root.colorScheme];
});

/** Global keys, except in text fields and select elements. */
const keys = {
  "?": () => $("help").showModal(),
  d: () => $("denoise").click(),
  r: () => $("reset").click(),
  p: () => stepPass(1),
  P: () => stepPass(-1),
  o: () => { namesObjects = !namesObjects; outline.clear(); },
  Escape: () => { aim(false); outline.clear(); },
};
const stepPass = (by) => {
  const list = $("pass");
  set({ pass: list.options[(list.selectedIndex + by + list.length) % list.length].value });
};
window.addEventListener("keydown", (event) => {
  if (status && event.key === "z" && (event.ctrlKey || event.metaKey) && !event.target.matches("textarea")) {
    event.preventDefault();
    material.undo();
    return;
  }
  const isTyping = event.target.matches("select, textarea") || $("help").open;
  if (!status || isTyping || event.ctrlKey || event.metaKey || event.altKey || !keys[event.key]) return;
  keys[event.key]();
  event.preventDefault();
});

listen(canvas, {
  move: async (step) => status?.scene_info.is_live && post("move", step),
  probe,
  isAiming: () => $("focus").getAttribute("aria-pressed") === "true",
  focus: async (x, y) => {
    aim(false);
    if (!status?.scene_info.is_live) return;
    if (await post("focus", [x, y]) && status.defocus === 0) set({ defocus: 1 });
  },
  tap: async (x, y) => {
    await probe(x, y);
    if (status?.scene_info.is_live) await material.choose(x, y);
  },
  leave: () => outline.clear(),
});
window.addEventListener("resize", fit);
follow();
