// The selected material and the selected light: their values, their sliders, and the changes as lines of a scene file.

const $ = (id) => document.getElementById(id);
const SLIDERS = ["roughness", "metallic", "emission"];
const DARKEST = 2 ** -7;       // at the left end of the slider, emission is 0

const toLinear = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
const toShown = (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
const rgbOf = (hex) => [1, 3, 5].map((at) => Number(toLinear(parseInt(hex.slice(at, at + 2), 16) / 255).toPrecision(4)));
const hexOf = (rgb) => "#" + rgb.map((v) => Math.round(255 * toShown(Math.min(v, 1))).toString(16).padStart(2, "0")).join("");

/** Sets the value of an input, unless the user is changing it. */
function put(id, value) {
  if (!$(id).matches(":active") && document.activeElement?.id !== id) $(id).value = value;
  else if ($(id).type === "range" && !$(id).matches(":active")) $(id).value = value;
}

/** Shows and changes the scene's lights. The slider is in stops relative to the initial strength; its left end is 0. */
export function sceneLights({ heldLive, fill }) {
  const initial = new Map();
  const chosen = () => initial.get($("scene-light").value);
  const dimmest = Number($("scene-light-strength").min);
  let current = [];
  const edit = (change) => (chosen() ? { light: [chosen().name, change] } : null);
  heldLive($("scene-light-strength"), (v) => {
    const strength = v <= dimmest ? 0 : Number((2 ** v * (chosen()?.strength || 1)).toPrecision(4));
    return edit({ strength });
  });
  heldLive($("scene-light-color"), (v) => edit({ color: rgbOf(v) }));
  const show = () => {
    const light = current.find(({ name }) => name === $("scene-light").value);
    if (!light) return;
    const stops = light.strength > 0 ? Math.log2(light.strength / (chosen().strength || 1)) : dimmest;
    put("scene-light-strength", Math.max(stops, dimmest));
    put("scene-light-color", hexOf(light.color));
    $("scene-light-strength-value").textContent = light.strength > 0 ? `${Number(light.strength.toPrecision(3))} ${light.unit}` : "off";
  };
  $("scene-light").addEventListener("input", show);
  return {
    choose: (name) => { $("scene-light").value = name; show(); },
    update: (lights) => {
      current = lights;
      // The initial strength is at the middle of the slider.
      for (const light of lights) if (!initial.has(light.name)) initial.set(light.name, light);
      $("scene-light-fields").hidden = lights.length === 0;
      fill($("scene-light"), lights.map(({ name }) => [name, name]), $("scene-light").value || lights[0]?.name);
      show();
    },
  };
}

/** Shows and changes materials; `heldLive` sends the changes of an input, `post` a command; `chooseLight` selects a light by name. */
export function materials({ heldLive, post, copy, chooseLight }) {
  let own = null, status = null;

  /** Sends changes of a material parameter. */
  const listen = (input, key, read) =>
    heldLive(input, (v) => (own ? { material: [own.name, { [key]: read(v) }] } : null));
  listen($("base_color"), "base_color", rgbOf);
  listen($("roughness"), "roughness", Number);
  listen($("metallic"), "metallic", Number);
  listen($("emission"), "emission", (v) => (2 ** v <= DARKEST ? 0 : Number((2 ** v).toPrecision(3))));
  const undo = () => (status?.undo ? post("undo") : null);
  $("undo").addEventListener("click", undo);
  $("save").addEventListener("click", async () => {
    if (await post("save")) $("announcement").textContent = `Written: ${status.scene_info.sidecar}`;
  });
  $("copy-toml").addEventListener("click", () => copy($("copy-toml"), $("toml")));

  const show = () => {
    const now = own && (status?.edited[own.name] ?? own);
    $("material-fields").hidden = !now?.is_editable;
    $("material-hint").hidden = Boolean(now?.is_editable);
    const reason = now?.is_light ? "is a light: its sliders are above." : "can't be edited here: its shaders have no such parameters.";
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
    /** Selects the material at a position of the picture. */
    choose: async (x, y) => {
      const answer = await fetch(`material?x=${x}&y=${y}`);
      if (!answer.ok) return;
      own = await answer.json();
      if (own.is_light) chooseLight(own.name);
      show();
    },
    update: (news) => {
      status = news;
      $("changes").hidden = !news.undo && !news.toml;
      $("undo").disabled = !news.undo;
      $("save").hidden = news.scene_info.sidecar === null;
      $("save").disabled = !news.toml;
      $("save").textContent = "Save";
      $("save").title = `Write the changes to the sidecar ${news.scene_info.sidecar}`;
      $("toml-row").hidden = !news.toml;
      if (document.activeElement !== $("toml")) $("toml").value = news.toml;
      show();
    },
  };
}
