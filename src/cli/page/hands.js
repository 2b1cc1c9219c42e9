// What hands do on the picture: orbit, pan, dolly, point at pixels, focus.

const TURN = Math.PI;          // radians for a drag over the picture's height
const STEP = 0.08;             // of a turn or a height, for a key
const WHEEL = 0.0015;          // in the exponent, for a pixel of the wheel
const STILL = 4;               // pixels that a click may move
const DOUBLE = 350;            // milliseconds between two clicks

/** Calls back for what happens on the picture; steps are gathered until the last one was taken. */
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
  // Fingers or the mouse that are down, by their ids: where they were last.
  const held = new Map();
  let travelled = 0, mouse = [0.5, 0.5], isProbing = false, lastClick = -Infinity, wasPinch = false;

  /** Middle of what is held, and how far two fingers are apart. */
  const grip = () => {
    const [a, b = a] = [...held.values()];
    return { x: (a[0] + b[0]) / 2, y: (a[1] + b[1]) / 2, apart: Math.hypot(a[0] - b[0], a[1] - b[1]) };
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    canvas.focus({ preventScroll: true });
    if (held.size === 0) [travelled, wasPinch] = [0, false];
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
    const before = grip();
    held.set(event.pointerId, [event.clientX, event.clientY]);
    const after = grip();
    const [dx, dy] = [after.x - before.x, after.y - before.y].map((v) => v / canvas.clientHeight);
    travelled += Math.hypot(after.x - before.x, after.y - before.y) + Math.abs(after.apart - before.apart);
    if (travelled >= STILL) leave();
    if (held.size === 2) add({ pan: [-dx, dy], dolly: after.apart > 0 ? before.apart / after.apart : 1 });
    else if (wasPinch) return;
    else if (event.shiftKey || event.buttons & 6) add({ pan: [-dx, dy] });
    else add({ orbit: [-dx * TURN, dy * TURN] });
  });
  const release = (event) => {
    const isClick = held.delete(event.pointerId) && travelled < STILL && !wasPinch && event.type === "pointerup";
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

  const turns = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  canvas.addEventListener("keydown", (event) => {
    const turn = turns[event.key];
    if (turn) add(event.shiftKey ? { pan: turn.map((v) => v * STEP) } : { orbit: turn.map((v) => v * STEP * TURN) });
    else if (event.key === "+" || event.key === "=") add({ dolly: 1 - STEP });
    else if (event.key === "-") add({ dolly: 1 + STEP });
    else if (event.key === "f") focus(...mouse);
    else if (event.key === "m") tap(...mouse);
    else return;
    leave();
    event.preventDefault();
  });
}
