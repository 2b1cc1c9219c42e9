// What hands do on the picture: turn, move sideways, go nearer, point at pixels.

const TURN = Math.PI;          // radians for a drag over the picture's height
const STEP = 0.08;             // of a turn or a height, for a key
const WHEEL = 0.0015;          // in the exponent, for a pixel of the wheel
const STILL = 4;               // pixels that a click may move

/** Calls back for what happens on the picture; steps are gathered until the last one was taken. */
export function listen(canvas, { move, probe, isAiming, focus, reset }) {
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
  let held = null, travelled = 0, mouse = [0.5, 0.5], isProbing = false;
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    canvas.focus({ preventScroll: true });
    held = [event.clientX, event.clientY];
    travelled = 0;
    canvas.classList.add("grabbed");
    event.preventDefault();
  });
  canvas.addEventListener("pointermove", async (event) => {
    mouse = place(event);
    if (!held) {
      if (isProbing) return;
      isProbing = true;
      await probe(...mouse);
      isProbing = false;
      return;
    }
    const [dx, dy] = [event.clientX - held[0], event.clientY - held[1]].map((v) => v / canvas.clientHeight);
    travelled += Math.hypot(event.clientX - held[0], event.clientY - held[1]);
    held = [event.clientX, event.clientY];
    if (event.shiftKey || event.buttons & 6) add({ pan: [-dx, dy] });
    else add({ orbit: [-dx * TURN, dy * TURN] });
  });
  const release = (event) => {
    if (held && travelled < STILL && isAiming()) focus(...place(event));
    held = null;
    canvas.classList.remove("grabbed");
  };
  canvas.addEventListener("pointerup", release);
  canvas.addEventListener("pointercancel", () => { held = null; });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    add({ dolly: Math.exp(Math.max(-300, Math.min(300, event.deltaY)) * WHEEL) });
  }, { passive: false });

  const turns = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  canvas.addEventListener("keydown", (event) => {
    const turn = turns[event.key];
    if (turn) add(event.shiftKey ? { pan: turn.map((v) => v * STEP) } : { orbit: turn.map((v) => v * STEP * TURN) });
    else if (event.key === "+" || event.key === "=") add({ dolly: 1 - STEP });
    else if (event.key === "-") add({ dolly: 1 + STEP });
    else if (event.key === "f") focus(...mouse);
    else if (event.key === "r") reset();
    else return;
    event.preventDefault();
  });
}
