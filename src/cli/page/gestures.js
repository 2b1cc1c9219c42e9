// Mouse, touch and keyboard on the picture: orbit, pan, dolly, probe pixels, focus.

const ORBIT = Math.PI;         // radians per picture height of a drag
const STEP = 0.08;             // of ORBIT or of a picture height, per key press
const WHEEL = 0.0015;          // natural logarithm of the dolly factor per pixel of the wheel
const CLICK_TOLERANCE = 4;     // maximum movement of a click, pixels
const DOUBLE = 350;            // maximum time between the clicks of a double click, milliseconds

/** Calls the callbacks for gestures on the picture; camera moves are merged while the last one is being sent. */
export function listen(canvas, { move, probe, isAiming, focus, tap, leave }) {
  let step = null, busy = false;
  const add = (change) => {
    step ??= { orbit: [0, 0], pan: [0, 0], dolly: 1 };
    step.orbit = step.orbit.map((v, i) => v + (change.orbit?.[i] ?? 0));
    step.pan = step.pan.map((v, i) => v + (change.pan?.[i] ?? 0));
    step.dolly *= change.dolly ?? 1;
    send();
  };
  const send = async () => {
    if (busy || !step) return;
    busy = true;
    const taken = step;
    step = null;
    await move(taken);
    busy = false;
    send();
  };

  const place = (event) => {
    const box = canvas.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  };
  // Last positions of pressed pointers, by id.
  const held = new Map();
  let dragged = 0, mouse = [0.5, 0.5], isProbing = false, lastClick = -Infinity, wasPinch = false;

  /** Centre of the pressed pointers, and the distance between two fingers. */
  const centroid = () => {
    const [a, b = a] = [...held.values()];
    return { x: (a[0] + b[0]) / 2, y: (a[1] + b[1]) / 2, distance: Math.hypot(a[0] - b[0], a[1] - b[1]) };
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    canvas.focus({ preventScroll: true });
    if (held.size === 0) [dragged, wasPinch] = [0, false];
    if (held.size < 2) held.set(event.pointerId, [event.clientX, event.clientY]);
    wasPinch ||= held.size === 2;
    canvas.classList.add("grabbed");
    event.preventDefault();
  });
  canvas.addEventListener("pointermove", async (event) => {
    mouse = place(event);
    if (!held.has(event.pointerId)) {
      if (isProbing || held.size > 0) return;
      isProbing = true;
      await probe(...mouse);
      isProbing = false;
      return;
    }
    const before = centroid();
    held.set(event.pointerId, [event.clientX, event.clientY]);
    const after = centroid();
    const [dx, dy] = [after.x - before.x, after.y - before.y].map((v) => v / canvas.clientHeight);
    dragged += Math.hypot(after.x - before.x, after.y - before.y) + Math.abs(after.distance - before.distance);
    if (dragged >= CLICK_TOLERANCE) leave();
    if (held.size === 2) add({ pan: [-dx, dy], dolly: after.distance > 0 ? before.distance / after.distance : 1 });
    else if (wasPinch) return;
    else if (event.shiftKey || event.buttons & 6) add({ pan: [-dx, dy] });
    else add({ orbit: [-dx * ORBIT, dy * ORBIT] });
  });
  const release = (event) => {
    const isClick = held.delete(event.pointerId) && dragged < CLICK_TOLERANCE && !wasPinch && event.type === "pointerup";
    if (held.size === 0) canvas.classList.remove("grabbed");
    if (!isClick || event.button > 0) return;
    const isDouble = event.timeStamp - lastClick < DOUBLE;
    lastClick = isDouble ? -Infinity : event.timeStamp;
    if (isDouble || isAiming()) focus(...place(event));
    else tap(...place(event));
  };
  canvas.addEventListener("pointerup", release);
  canvas.addEventListener("pointercancel", release);
  canvas.addEventListener("pointerleave", () => held.size === 0 && leave());
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    leave();
    add({ dolly: Math.exp(Math.max(-300, Math.min(300, event.deltaY)) * WHEEL) });
  }, { passive: false });

  const directions = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  canvas.addEventListener("keydown", (event) => {
    const direction = directions[event.key];
    if (direction) add(event.shiftKey ? { pan: direction.map((v) => v * STEP) } : { orbit: direction.map((v) => v * STEP * ORBIT) });
    else if (event.key === "+" || event.key === "=") add({ dolly: 1 - STEP });
    else if (event.key === "-") add({ dolly: 1 + STEP });
    else if (event.key === "f") focus(...mouse);
    else if (event.key === "m") tap(...mouse);
    else return;
    leave();
    event.preventDefault();
  });
}
