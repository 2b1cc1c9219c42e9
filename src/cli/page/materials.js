// The material that was clicked on and the lamp that was chosen: their values, sliders that change them, and the lines that say the
// same in a file.

const $ = (id) => document.getElementById(id);
const SLIDERS = ["roughness", "metallic", "emission"];
const DARKEST = 2 ** -7;       // the left end of the slider of emission is none at all

const toLinear = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
const toShown = (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
const rgbOf = (hex) => [1, 3, 5].map((at) => Number(toLinear(parseInt(hex.slice(at, at + 2), 16) / 255).toPrecision(4)));
const hexOf = (rgb) => "#" + rgb.map((v) => Math.round(255 * toShown(Math.min(v, 1))).toString(16).padStart(2, "0")).join("");

/** Gives an input its value, unless someone is at it. */
function put(id, value) {
  if (!$(id).matches(":active") && document.activeElement?.id !== id) $(id).value = value;
  else if ($(id).type === "range" && !$(id).matches(":active")) $(id).value = value;
}

/** Shows and changes the scene's lamps. The slider's unit is a stop over the strength that a lamp had; its left end is none. */
export function lamps({ heldLive, fill }) {
  const own = new Map();
  const chosen = () => own.get($("lamp").value);
  const dimmest = Number($("lamp-strength").min);
  let now = [];
  const edit = (change) => (chosen() ? { light: [chosen().name, change] } : null);
  heldLive($("lamp-strength"), (v) => {
    const strength = v <= dimmest ? 0 : Number((2 ** v * (chosen()?.strength || 1)).toPrecision(4));
    return edit({ strength });
  });
  heldLive($("lamp-color"), (v) => edit({ color: rgbOf(v) }));
  const show = () => {
    const lamp = now.find(({ name }) => name === $("lamp").value);
    if (!lamp) return;
    const stops = lamp.strength > 0 ? Math.log2(lamp.strength / (chosen().strength || 1)) : dimmest;
    put("lamp-strength", Math.max(stops, dimmest));
    put("lamp-color", hexOf(lamp.color));
    $("lamp-strength-value").textContent = lamp.strength > 0 ? `${Number(lamp.strength.toPrecision(3))} ${lamp.unit}` : "off";
  };
  $("lamp").addEventListener("input", show);
  return {
    choose: (name) => { $("lamp").value = name; show(); },
    update: (lights) => {
      now = lights;
      // What a lamp was first is the middle of its slider.
      for (const lamp of lights) if (!own.has(lamp.name)) own.set(lamp.name, lamp);
      $("lamp-fields").hidden = lights.length === 0;
      fill($("lamp"), lights.map(({ name }) => [name, name]), $("lamp").value || lights[0]?.name);
      show();
    },
  };
}

/** Shows and changes materials; `heldLive` sends the changes of an input, `post` a command; `chooseLamp` shows the lamp of a name. */
export function materials({ heldLive, post, copy, chooseLamp }) {
  let own = null, status = null;

  /** Sends a value of the material. */
  const listen = (input, key, read) =>
    heldLive(input, (v) => (own ? { material: [own.name, { [key]: read(v) }] } : null));
  listen($("base_color"), "base_color", rgbOf);
  listen($("roughness"), "roughness", Number);
  listen($("metallic"), "metallic", Number);
  listen($("emission"), "emission", (v) => (2 ** v <= DARKEST ? 0 : Number((2 ** v).toPrecision(3))));
  const undo = () => (status?.undo ? post("undo") : null);
  $("undo").addEventListener("click", undo);
  $("save").addEventListener("click", async () => {
    if (await post("save")) $("announcement").textContent = `Written: ${status.facts.sidecar}`;
  });
  $("copy-toml").addEventListener("click", () => copy($("copy-toml"), $("toml")));

  const show = () => {
    const now = own && (status?.edited[own.name] ?? own);
    $("material-fields").hidden = !now?.is_editable;
    $("material-hint").hidden = Boolean(now?.is_editable);
    const reason = now?.is_light ? "is a lamp: its sliders are above." : "is of shaders that have no such sliders.";
    if (now && !now.is_editable) $("material-hint").textContent = `'${now.name}' ${reason}`;
    if (!now?.is_editable) return;
    $("material-name").textContent = now.name;
    for (const key of ["base_color", ...SLIDERS]) {
      $(`${key}-note`).textContent = now.textures.includes(key) ? "(replaces its texture)" : "";
    }
    put("base_color", hexOf(now.base_color));
    put("roughness", now.roughness);
    put("metallic", now.metallic);
    put("emission", Math.log2(Math.max(now.emission, DARKEST)));
    $("roughness-value").textContent = now.roughness.toFixed(2);
    $("metallic-value").textContent = now.metallic.toFixed(2);
    $("emission-value").textContent = now.emission > 0 ? `${Number(now.emission.toPrecision(3))} W/sr/m²` : "none";
  };

  return {
    undo,
    /** Chooses the material at a place of the picture. */
    choose: async (x, y) => {
      const answer = await fetch(`material?x=${x}&y=${y}`);
      if (!answer.ok) return;
      own = await answer.json();
      if (own.is_light) chooseLamp(own.name);
      show();
    },
    update: (news) => {
      status = news;
      $("changes").hidden = !news.undo && !news.toml;
      $("undo").disabled = !news.undo;
      $("save").hidden = news.facts.sidecar === null;
      $("save").disabled = !news.toml;
      $("save").textContent = "Save";
      $("save").title = `Write the changes into ${news.facts.sidecar}, beside the model`;
      $("toml-row").hidden = !news.toml;
      if (document.activeElement !== $("toml")) $("toml").value = news.toml;
      show();
    },
  };
}
