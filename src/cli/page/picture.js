// Decoding of pictures, histogram, outlines of objects, thumbnails of passes.

/** Decodes a response: length of the JSON (u32, little-endian), JSON, RGBA pixels unless they are unchanged. */
export function decode(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const status = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const pixels = new Uint8ClampedArray(buffer, 4 + length);
  return { status, image: pixels.length ? new ImageData(pixels, status.width, status.height) : null };
}

/** Draws pixels to a canvas, which is resized to them. */
export function put(canvas, image) {
  if (canvas.width !== image.width) canvas.width = image.width;
  if (canvas.height !== image.height) canvas.height = image.height;
  canvas.getContext("2d").putImageData(image, 0, 0);
}

/** Draws an RGB histogram, with the percentage of clipped pixels as label. */
export function drawHistogram(canvas, image) {
  const counts = [0, 1, 2].map(() => new Uint32Array(256));
  const data = image.data;
  let clipped = 0;
  for (let i = 0; i < data.length; i += 4) {
    for (let c = 0; c < 3; c++) counts[c][data[i + c]]++;
    if (Math.max(data[i], data[i + 1], data[i + 2]) === 255) clipped++;
  }
  const { width, height } = canvas, context = canvas.getContext("2d");
  // Peaks of uniform backgrounds are clipped, and the square root keeps small counts visible.
  const max = (6 * data.length) / 4 / 256;
  context.clearRect(0, 0, width, height);
  context.globalCompositeOperation = "lighter";
  ["#c22", "#2a2", "#33d"].forEach((color, c) => {
    context.fillStyle = color;
    counts[c].forEach((count, x) => {
      const bar = Math.round(Math.min(1, Math.sqrt(count / max)) * height);
      context.fillRect(x, height - bar, 1, bar);
    });
  });
  const percent = (100 * clipped) / (data.length / 4);
  canvas.setAttribute("aria-label", `Histogram; ${percent.toFixed(1)} % of the pixels are clipped`);
  canvas.title = `${percent.toFixed(1)} % of the pixels are clipped`;
}

/** Shows the outline and the name of the object at a position; fetched once per object and picture. */
export function outliner(svg, path, label) {
  let shown = 0, at = 0, busy = false;
  const clear = () => {
    shown = 0;
    label.hidden = true;
    path.setAttribute("d", "");
  };
  const show = async (x, y, object, version) => {
    label.style.left = `${100 * x}%`;
    label.style.top = `${100 * y}%`;
    if (!object) return clear();
    if (busy || (object === shown && version === at)) return;
    busy = true;
    const answer = await fetch(`outline?x=${x}&y=${y}`);
    busy = false;
    if (!answer.ok) return clear();
    const outline = await answer.json();
    [shown, at] = [outline.object, version];
    svg.setAttribute("viewBox", `0 0 ${outline.width} ${outline.height}`);
    path.setAttribute("d", outline.path);
    label.textContent = outline.name;
    label.hidden = false;
  };
  return { show, clear };
}

/** Passes with thumbnails, and their captions. */
const SHOWN = [["", "colour"], ["albedo", "albedo"], ["normal", "normal"], ["depth", "depth"], ["object_id", "objects"]];

/** Delay before the thumbnails of a view are fetched, milliseconds. */
const REST = 700;

/** Thumbnail buttons that select a pass. The thumbnail of the displayed pass is drawn from `picture`. */
export function thumbnails(group, picture, choose) {
  let key = null, timer = 0;
  const buttons = SHOWN.map(([pass, caption]) => {
    const button = document.createElement("button");
    const small = document.createElement("canvas");
    small.width = small.height = 1;
    button.append(small, caption);
    button.addEventListener("click", () => choose(pass));
    group.append(button);
    return [pass, button];
  });
  const refresh = async (shown) => {
    for (const [pass, button] of buttons) {
      const small = button.firstChild;
      if (button.hidden) continue;
      if (pass === shown) {
        [small.width, small.height] = [160, Math.round((160 * picture.height) / picture.width)];
        small.getContext("2d").drawImage(picture, 0, 0, small.width, small.height);
        continue;
      }
      const answer = await fetch(`thumbnail?pass=${pass}`);
      if (answer.ok) put(small, decode(await answer.arrayBuffer()).image);
    }
  };
  return (status) => {
    for (const [pass, button] of buttons) {
      button.hidden = pass !== "" && !status.scene_info.passes.some(([name]) => name === pass);
      button.setAttribute("aria-pressed", status.pass === pass);
    }
    // Refreshed for each view, and when it is finished.
    const wanted = JSON.stringify([status.request_number, status.finished, status.exposure, status.view]);
    if (status.preview || wanted === key) return;
    key = wanted;
    clearTimeout(timer);
    timer = setTimeout(() => refresh(status.pass), REST);
  };
}
