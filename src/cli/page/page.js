// Shows the picture as it refines, and the choices beside it. What is shown is always what the program says: choices are
// sent to it, and come back with the next picture, so that several pages stay alike.

import { listen } from "./hands.js";

const $ = (id) => document.getElementById(id);
const canvas = $("picture");
const context = canvas.getContext("2d");
let told = null;

/** Sends something to the program. */
async function post(url, body) {
  const answer = await fetch(url, { method: "POST", body: JSON.stringify(body ?? null) });
  if (!answer.ok) showTrouble(await answer.text());
  return answer.ok;
}

const set = (choice) => post("set", choice);

function showTrouble(text) {
  $("trouble").textContent = text;
  $("trouble").hidden = !text;
}

/** Asks for the next picture, again and again. */
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

/** Draws an answer: a length, JSON of that length, pixels. */
function draw(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  told = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const pixels = new Uint8ClampedArray(buffer, 4 + length);
  if (canvas.width !== told.width || canvas.height !== told.height) {
    canvas.width = told.width;
    canvas.height = told.height;
  }
  context.putImageData(new ImageData(pixels, told.width, told.height), 0, 0);
  $("waiting").hidden = true;
  fit();
  tell();
  // For programs that drive the page.
  document.body.dataset.version = told.version;
  document.body.dataset.samples = told.preview ? 0 : told.samples;
  document.body.dataset.finished = told.finished;
  return told.version;
}

/** Makes the picture as large as the window allows, at most at two pixels of the screen for one of its own. */
function fit() {
  if (!told) return;
  const [width, height] = told.size;
  const room = canvas.parentElement;
  const scale = Math.min(room.clientWidth / width, room.clientHeight / height, 2);
  canvas.style.width = `${Math.round(width * scale)}px`;
  canvas.style.height = `${Math.round(height * scale)}px`;
}

/** Fills a list of choices, unless it has them already. */
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

/** Brings everything beside the picture up to date. */
function tell() {
  const facts = told.facts;
  document.title = `${facts.name} - oscura`;
  $("name").textContent = facts.name;
  $("facts").textContent = `${facts.triangles.toLocaleString("en")} triangles`;
  const samples = told.samples.toLocaleString("en", { maximumFractionDigits: 0 });
  const progress = told.preview ? "preview" : `${samples} of ${facts.samples} samples`;
  const error = told.error && !told.preview ? `, error about ${(100 * told.error).toPrecision(2)} %` : "";
  $("state").textContent = `${progress}, ${told.seconds.toFixed(1)} s${error}${told.finished ? ", done" : ""}`;
  showTrouble(told.trouble);
  slide("exposure", told.exposure, `${told.exposure.toFixed(1)} stops`);
  slide("defocus", told.defocus, told.defocus ? `${told.defocus.toFixed(2)}°` : "closed");
  document.body.classList.toggle("looking-on", !facts.is_live);
  $("rotation-row").hidden = facts.rotation === null;
  slide("rotation", told.rotation ?? 0, `${Math.round(told.rotation ?? 0)}°`);
  fill($("view"), told.views.map((name) => [name, name]), told.view);
  fill($("pass"), [["", "colour"], ...facts.passes.map(([name, about]) => [name, name.replaceAll("_", " "), about])], told.pass);
  fill($("size"), facts.sizes.map(([w, h]) => [`${w},${h}`, `${w} x ${h}`]), told.size.join(","));
  fill($("camera"), facts.cameras.map((name, i) => [String(i), name]), String(told.camera));
  if (document.activeElement !== $("command")) $("command").value = told.command;
  $("note-count").textContent = `(${facts.notes.length})`;
  const notes = JSON.stringify(facts.notes);
  if ($("notes").dataset.shown !== notes) {
    $("notes").dataset.shown = notes;
    $("notes").replaceChildren(...facts.notes.map((note) => Object.assign(document.createElement("li"), { textContent: note })));
  }
}

/** Numbers under the mouse. */
async function probe(x, y) {
  const answer = await fetch(`probe?x=${x}&y=${y}`);
  if (!answer.ok) return;
  const { x: column, y: row, values } = await answer.json();
  const number = (v) => (v === null ? "none" : Number(v).toPrecision(4));
  const rgb = ["R", "G", "B"].map((c) => number(values[c])).join(" ");
  const depth = values.Z > 5e9 ? "" : `  ${number(values.Z)} m`;
  const others = Object.entries(values).filter(([name]) => !["R", "G", "B", "A", "Z"].includes(name)).slice(0, 4);
  const more = others.map(([name, v]) => `  ${name} ${number(v)}`).join("");
  $("probe").textContent = `${column}, ${row}  ${rgb}${depth}${more}`;
}

/** Sends what an input says, but not more often than answers come. */
function live(input, choice) {
  let busy = false, again = false;
  const send = async () => {
    if (busy) { again = true; return; }
    busy = true;
    await set(choice(input.value));
    busy = false;
    if (again) { again = false; send(); }
  };
  input.addEventListener("input", send);
}

live($("exposure"), (v) => ({ exposure: Number(v) }));
live($("rotation"), (v) => ({ rotation: Number(v) }));
live($("defocus"), (v) => ({ defocus: Number(v) }));
live($("view"), (v) => ({ view: v }));
live($("pass"), (v) => ({ pass: v }));
live($("size"), (v) => ({ size: v.split(",").map(Number) }));
$("camera").addEventListener("input", () => post("camera", Number($("camera").value)));
$("reset").addEventListener("click", () => post("camera", Number($("camera").value)));
$("reload").addEventListener("click", () => post("reload"));
$("copy").addEventListener("click", async () => {
  try {
    await navigator.clipboard.writeText($("command").value);
  } catch {
    $("command").select();
    document.execCommand("copy");
  }
  $("copy").textContent = "Copied";
  setTimeout(() => { $("copy").textContent = "Copy command"; }, 1500);
});
const aim = (on) => {
  $("focus").setAttribute("aria-pressed", on);
  canvas.classList.toggle("aiming", on);
};
$("focus").addEventListener("click", () => aim($("focus").getAttribute("aria-pressed") !== "true"));

listen(canvas, {
  move: async (step) => told?.facts.is_live && post("move", step),
  probe,
  isAiming: () => $("focus").getAttribute("aria-pressed") === "true",
  focus: async (x, y) => {
    aim(false);
    if (!told?.facts.is_live) return;
    if (await post("focus", [x, y]) && told.defocus === 0) set({ defocus: 1 });
  },
  reset: () => $("reset").click(),
});
window.addEventListener("resize", fit);
follow();
