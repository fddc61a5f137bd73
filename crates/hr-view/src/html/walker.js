// Where the eye is and how it walks: as in hr-view's window.
"use strict";

const plus = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const times = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a, otherwise = [0, 0, 0]) => {
  const length = Math.hypot(...a);
  return length > 1e-9 && length < Infinity ? times(a, 1 / length) : otherwise;
};
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
const perpendicular = (a) => unit(cross(a, Math.abs(a[0]) < 0.7 ? [1, 0, 0] : [0, 1, 0]));

// Time to cross the scene at the initial speed, in seconds.
const CROSSING = 8;
// Speed per notch of the mouse wheel.
const SPEED_STEP = 1.25;
// A frame that took longer (seconds) moves no further than this.
const LONGEST_STEP = 0.2;
// Turning speed of the arrow keys in radians per second.
const KEY_TURN = 1.2;
// Directions closer to the vertical than this (radians) are not looked in: the horizon would flip.
const STEEPEST = 0.01;

// What a held key does: forward, right, up, turn.
const MOTIONS = {
  KeyW: [1, 0, 0, 0], ArrowUp: [1, 0, 0, 0], KeyS: [-1, 0, 0, 0], ArrowDown: [-1, 0, 0, 0],
  KeyD: [0, 1, 0, 0], KeyA: [0, -1, 0, 0],
  KeyE: [0, 0, 1, 0], Space: [0, 0, 1, 0], KeyQ: [0, 0, -1, 0], ShiftLeft: [0, 0, -1, 0], ShiftRight: [0, 0, -1, 0],
  ArrowRight: [0, 0, 0, 1], ArrowLeft: [0, 0, 0, -1],
};

class Walker {
  constructor(facts) {
    this.up = facts.up;
    this.pace = facts.extent > 0 ? facts.extent / CROSSING : 1;
    this.notches = 0;
    this.held = new Set();
  }

  get speed() {
    return this.pace * SPEED_STEP ** this.notches;
  }

  get isMoving() {
    return this.held.size > 0;
  }

  // Goes to a camera, its eye relative to the origin.
  take(camera, origin) {
    this.eye = plus(camera.eye, origin, -1);
    this.breadth = clamp(camera.fov_x, 1, 170);
    // Width / height of the camera's picture. A canvas of another shape shows more, at the sides or above and below.
    this.shape = camera.width / camera.height;
    this.look(plus(camera.target, camera.eye, -1), camera.up);
  }

  look(forward, up) {
    this.forward = unit(forward, [1, 0, 0]);
    this.right = unit(cross(this.forward, unit(up, this.up)), perpendicular(this.forward));
    this.top = cross(this.right, this.forward);
  }

  // Turns by angles in radians to the right and up, about the vertical; levels the horizon.
  turn(right, rise) {
    const sine = clamp(dot(this.forward, this.up), -1, 1);
    const limit = Math.PI / 2 - STEEPEST;
    const pitch = clamp(Math.asin(sine) + rise, -limit, limit);
    const level = (v) => unit(plus(v, this.up, -dot(v, this.up)));
    let ahead = level(Math.abs(sine) < 1 - 1e-9 ? this.forward : times(this.top, -Math.sign(sine)));
    ahead = plus(times(ahead, Math.cos(right)), cross(ahead, this.up), Math.sin(right));
    this.look(plus(times(ahead, Math.cos(pitch)), this.up, Math.sin(pitch)), this.up);
  }

  move(forward, right, up) {
    this.eye = plus(plus(plus(this.eye, this.forward, forward), this.right, right), this.up, up);
  }

  // Moves on by the time since the last frame, in seconds.
  advance(seconds) {
    const sum = [0, 0, 0, 0];
    this.held.forEach((key) => MOTIONS[key].forEach((x, i) => { sum[i] += x; }));
    const time = Math.min(seconds, LONGEST_STEP);
    // Two keys at once are no faster than one.
    const length = Math.hypot(...sum.slice(0, 3));
    const step = length > 0 ? this.speed * time / length : 0;
    this.move(sum[0] * step, sum[1] * step, sum[2] * step);
    if (sum[3] !== 0) {
      this.turn(sum[3] * KEY_TURN * time, 0);
    }
  }

  // Cotangents of half the fields of view, horizontal and vertical, of a picture of width / height `aspect`.
  scales(aspect) {
    const x = 1 / Math.tan(this.breadth * Math.PI / 360);
    return aspect > this.shape ? [x * this.shape / aspect, x * this.shape] : [x, x * aspect];
  }
}
