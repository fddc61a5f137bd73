// The page: keys, mouse, touch, and what is written over the picture.
"use strict";

const KEYS = [
  ["W A S D, arrows up, down", "walk"],
  ["E Q, space shift", "up, down"],
  ["drag, arrows left, right", "look around"],
  ["right click, C", "capture or free the mouse"],
  ["two fingers", "pinch to walk, drag to step aside"],
  ["wheel", "walking speed"],
  ["1 … 9, 0", "the scene's cameras"],
  ["+ −", "brighter, darker"],
  ["backspace", "automatic exposure again"],
  ["T", "show or hide the line at the top"],
  ["H", "this help"],
];
// Stops per press of + or −.
const STOPS = 1 / 3;
// Turn of a captured mouse in radians per count.
const CAPTURED_TURN = 0.0022;
// Pixels of scrolling that count as one notch of a wheel.
const NOTCH = 100;
// How long a message stays, in milliseconds.
const MESSAGE = 4000;

const element = (id) => document.getElementById(id);

function setState(state) {
  document.documentElement.dataset.state = state;
}

// Begins once all of the file is there.
async function start() {
  setState("unpacking");
  try {
    const scene = await unpackScene(element("solution").textContent);
    element("message").hidden = true;
    new Viewer(scene);
    setState("ready");
  } catch (error) {
    setState("failed");
    complain(error instanceof Trouble ? error.message : `${DAMAGED} (${error.message}). ${REMEDY}`);
  }
}

class Viewer {
  constructor(scene) {
    const { facts } = scene;
    this.canvas = element("picture");
    this.facts = facts;
    this.resize();
    this.picture = new Picture(this.canvas, scene);
    this.walker = new Walker(facts);
    this.pointers = new Map();
    this.stops = 0;
    // What the camera gone to last needs beside the first one's exposure, which is in the light already.
    this.automatic = 1;
    this.frame = { asked: false, last: null, time: 0, evaluated: 0 };
    document.title = `${facts.name} — hr-view`;
    facts.cameras.forEach(([name], i) => {
      element("cameras").add(new Option(i < 10 ? `${(i + 1) % 10}  ${name}` : name, i));
    });
    for (const [keys, action] of KEYS) {
      const [term, detail] = [document.createElement("dt"), document.createElement("dd")];
      [term.textContent, detail.textContent] = [keys, action];
      element("keys").append(term, detail);
    }
    this.take(0);
    this.listen();
    this.redraw();
  }

  listen() {
    const { canvas, walker } = this;
    addEventListener("resize", () => { this.resize(); this.redraw(); });
    addEventListener("blur", () => { walker.held.clear(); });
    addEventListener("keydown", (event) => this.key(event));
    addEventListener("keyup", (event) => { walker.held.delete(event.code); });
    canvas.addEventListener("pointerdown", (event) => this.press(event));
    canvas.addEventListener("pointermove", (event) => this.drag(event));
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, (event) => { this.pointers.delete(event.pointerId); });
    }
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const notches = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? event.deltaY / NOTCH : event.deltaY / 3;
      walker.notches = clamp(walker.notches - notches, -40, 40);
      this.say(`walking speed ${walker.speed.toPrecision(3)} units/s`);
    }, { passive: false });
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      setState("waiting");
      complain("The browser has taken the graphics device away; waiting for it to come back.");
    });
    canvas.addEventListener("webglcontextrestored", () => {
      element("message").hidden = true;
      this.picture.prepare();
      setState("ready");
      this.redraw();
    });
    element("cameras").addEventListener("change", (event) => {
      this.take(Number(event.target.value));
      canvas.focus();
    });
    element("help-button").addEventListener("click", () => { this.toggle("help"); canvas.focus(); });
    element("stops").addEventListener("input", (event) => { this.expose(Number(event.target.value)); });
    element("breadth").addEventListener("input", (event) => { this.widen(Number(event.target.value)); });
    for (const id of ["stops", "breadth"]) {
      // Arrow keys are for walking again.
      element(id).addEventListener("change", () => canvas.focus());
    }
  }

  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target.matches?.("select, input")) {
      return;
    }
    const digit = /^Digit(\d)$/.exec(event.code);
    if (MOTIONS[event.code]) {
      this.walker.held.add(event.code);
    } else if (digit) {
      this.take((Number(digit[1]) + 9) % 10);
    } else if (event.key === "+" || event.key === "=") {
      this.expose(this.stops + STOPS);
    } else if (event.key === "-" || event.key === "−") {
      this.expose(this.stops - STOPS);
    } else if (event.code === "Backspace") {
      this.expose(0);
    } else if (event.code === "KeyH" || event.code === "Escape" && !element("help").hidden) {
      this.toggle("help");
    } else if (event.code === "KeyT") {
      this.toggle("line");
    } else if (event.code === "KeyC") {
      this.capture();
    } else {
      return;
    }
    event.preventDefault();
    this.redraw();
  }

  press(event) {
    this.canvas.focus();
    if (event.button === 2) {
      this.capture();
      return;
    }
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
  }

  drag(event) {
    const { canvas, walker, pointers } = this;
    if (document.pointerLockElement === canvas) {
      walker.turn(event.movementX * CAPTURED_TURN, -event.movementY * CAPTURED_TURN);
      this.redraw();
      return;
    }
    const last = pointers.get(event.pointerId);
    if (!last) {
      return;
    }
    const now = [event.clientX, event.clientY];
    const [dx, dy] = [now[0] - last[0], now[1] - last[1]];
    if (pointers.size === 1) {
      // A drag across the whole picture turns by the whole field of view.
      const [scale] = walker.scales(canvas.width / canvas.height);
      const turn = 2 * Math.atan(1 / scale) / canvas.clientWidth;
      walker.turn(dx * turn, -dy * turn);
    } else {
      const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
      const apart = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
      // Across the picture once is what the keys walk in two seconds; each finger does half of it.
      const step = 2 * walker.speed / Math.min(canvas.clientWidth, canvas.clientHeight);
      walker.move((apart(now) - apart(last)) * step, -0.5 * dx * step, 0.5 * dy * step);
    }
    pointers.set(event.pointerId, now);
    this.redraw();
  }

  capture() {
    if (document.pointerLockElement) {
      document.exitPointerLock();
    } else {
      // Browsers refuse right after the mouse was freed; trying again helps.
      Promise.resolve(this.canvas.requestPointerLock()).catch(() => this.say("the mouse cannot be captured now"));
    }
  }

  // Goes to a camera of the scene.
  take(index) {
    const camera = this.facts.cameras[index];
    if (!camera) {
      return;
    }
    this.walker.take(camera[1], this.facts.origin);
    this.automatic = this.facts.exposures[index];
    element("cameras").value = index;
    this.widen(this.walker.breadth);
  }

  expose(stops) {
    this.stops = clamp(stops, -10, 10);
    element("stops").value = this.stops;
    element("stops-shown").value = `${this.stops.toFixed(1)} EV`;
    this.redraw();
  }

  widen(breadth) {
    this.walker.breadth = breadth;
    element("breadth").value = breadth;
    element("breadth-shown").value = `${Math.round(breadth)}°`;
    this.redraw();
  }

  toggle(id) {
    element(id).hidden = !element(id).hidden;
  }

  say(text) {
    complain(text);
    clearTimeout(this.fading);
    this.fading = setTimeout(() => { element("message").hidden = true; }, MESSAGE);
  }

  resize() {
    this.canvas.width = Math.max(1, Math.round(innerWidth * devicePixelRatio));
    this.canvas.height = Math.max(1, Math.round(innerHeight * devicePixelRatio));
  }

  // Asks for a frame; nothing is drawn while nobody does.
  redraw() {
    if (!this.frame.asked) {
      this.frame.asked = true;
      requestAnimationFrame((now) => this.draw(now));
    }
  }

  draw(now) {
    const { frame, walker } = this;
    frame.asked = false;
    if (this.picture.gl.isContextLost()) {
      return;
    }
    if (frame.last !== null) {
      frame.time = now - frame.last;
      walker.advance(frame.time / 1000);
    }
    const { evaluated, isMore } = this.picture.draw(walker, this.automatic * 2 ** this.stops);
    frame.evaluated = evaluated;
    this.tell();
    frame.last = walker.isMoving ? now : null;
    if (walker.isMoving || isMore) {
      this.redraw();
    }
  }

  // The line at the top.
  tell() {
    const { frame, facts, picture } = this;
    const rate = frame.time > 0 ? `${frame.time.toFixed(1)} ms  ${Math.round(1000 / frame.time)} fps   ` : "";
    const triangles = (picture.diffuse.indices.length + picture.glossy.indices.length) / 3;
    const glossy = picture.glossy.places.length / 3;
    const stops = `${this.stops >= 0 ? "+" : ""}${this.stops.toFixed(1)} EV`;
    const evaluated = `glossy ${frame.evaluated} of ${glossy} vertices`;
    element("line").textContent = `${facts.name}   ${rate}${triangles} triangles   ${evaluated}   ${stops}   H help`;
  }
}
