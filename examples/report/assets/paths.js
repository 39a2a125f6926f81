'use strict';
// The path of the camera: in the plane of its largest extent, from the side, and in 3-D, coloured by error.

const axisNames = ['x', 'y', 'z'];
const allPoints = runs.flatMap((r) => [...r.position, ...r.truth]).filter((p) => p);
const space = {low: [0, 0, 0], high: [0, 0, 0], empty: allPoints.length === 0};
for (let k = 0; k < 3 && !space.empty; ++k) {
  space.low[k] = allPoints.reduce((m, p) => Math.min(m, p[k]), Infinity);
  space.high[k] = allPoints.reduce((m, p) => Math.max(m, p[k]), -Infinity);
}
space.size = space.low.map((v, k) => space.high[k] - v);
space.centre = space.low.map((v, k) => 0.5 * (v + space.high[k]));
// the axis of least extent is seen along; y, which points down in a camera, among equals
space.flat = [1, 0, 2].reduce((best, k) => (space.size[k] < space.size[best] ? k : best));
space.plane = [0, 1, 2].filter((k) => k !== space.flat);
space.long = space.size[space.plane[0]] >= space.size[space.plane[1]] ? space.plane[0] : space.plane[1];

// 2 % of the errors lie above the end of the colours, so that one jump does not make all others look alike
const sortedErrors = runs.flatMap((r) => r.error).filter(isNumber).sort((a, b) => a - b);
const errorEnd = Math.max(1e-6, sortedErrors.length > 0 ? sortedErrors[Math.ceil(0.98 * (sortedErrors.length - 1))] : 0);
const turn = {yaw: 0.7, pitch: 0.5};
const views = [];

function mix(a, b, share) {
  const part = (text, i) => parseInt(text.slice(1 + 2 * i, 3 + 2 * i), 16);
  return 'rgb(' + [0, 1, 2].map((i) => Math.round(part(a, i) + share * (part(b, i) - part(a, i)))).join(',') + ')';
}
/// 64 colours from no error to the largest one.
function errorColours() {
  const ends = ['low', 'middle', 'high'].map(colour);
  return Array.from({length: 64}, (_, i) => (i < 32 ? mix(ends[0], ends[1], i / 32) : mix(ends[1], ends[2], (i - 32) / 31)));
}

function niceStep(length, count) {
  const raw = Math.max(length, 1e-9) / count;
  const power = Math.pow(10, Math.floor(Math.log10(raw)));
  return [1, 2, 5, 10].map((f) => f * power).find((s) => s >= raw) || power;
}

/// Projection into a plane: axis `a` to the right, axis `b` up, the same scale on both.
function planeProjection(a, b, width, height) {
  const margin = {left: 46, right: 14, top: 12, bottom: 34};
  const inner = [width - margin.left - margin.right, height - margin.top - margin.bottom];
  const scale = 0.92 * Math.min(inner[0] / Math.max(space.size[a], 1e-3), inner[1] / Math.max(space.size[b], 1e-3));
  const middle = [margin.left + inner[0] / 2, margin.top + inner[1] / 2];
  const project = (p) => [middle[0] + scale * (p[a] - space.centre[a]), middle[1] - scale * (p[b] - space.centre[b])];
  const axes = (c) => {
    c.font = '11px system-ui, sans-serif';
    c.lineWidth = 1;
    const step = niceStep(inner[0] / scale, 5);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    const ticks = (k, pixels) => {
      const half = pixels / scale / 2;
      const list = [];
      for (let v = Math.ceil((space.centre[k] - half) / step) * step; v <= space.centre[k] + half; v += step) list.push(v);
      return list;
    };
    c.strokeStyle = colour('grid');
    c.fillStyle = colour('soft');
    c.textAlign = 'center';
    for (const v of ticks(a, inner[0])) {
      const x = middle[0] + scale * (v - space.centre[a]);
      c.strokeRect(x, margin.top, 0, inner[1]);
      c.fillText(v.toFixed(digits), x, height - 20);
    }
    c.textAlign = 'right';
    for (const v of ticks(b, inner[1])) {
      const y = middle[1] - scale * (v - space.centre[b]);
      c.strokeRect(margin.left, y, inner[0], 0);
      c.fillText(v.toFixed(digits), margin.left - 5, y + 4);
    }
    c.textAlign = 'center';
    c.fillText(axisNames[a] + ' [m]', middle[0], height - 5);
    c.save();
    c.translate(11, middle[1]);
    c.rotate(-Math.PI / 2);
    c.fillText(axisNames[b] + ' [m]', 0, 0);
    c.restore();
  };
  return {project, axes};
}

/// Orthographic projection that the mouse turns; the axis of least extent stands upright.
function turnedProjection(width, height) {
  const [a, b] = space.plane;
  const radius = Math.max(1e-3, 0.5 * Math.hypot(...space.size));
  const scale = 0.46 * Math.min(width, height) / radius;
  const project = (p) => {
    const u = p[a] - space.centre[a];
    const v = p[b] - space.centre[b];
    const w = p[space.flat] - space.centre[space.flat];
    const right = Math.cos(turn.yaw) * u - Math.sin(turn.yaw) * v;
    const back = Math.sin(turn.yaw) * u + Math.cos(turn.yaw) * v;
    return [width / 2 + scale * right, height / 2 - scale * (w * Math.cos(turn.pitch) + back * Math.sin(turn.pitch))];
  };
  const axes = (c) => {
    const corner = (i) => [0, 1, 2].map((k) => ((i >> k) & 1 ? space.high[k] : space.low[k]));
    c.strokeStyle = colour('grid');
    c.lineWidth = 1;
    c.beginPath();
    for (let i = 0; i < 8; ++i) {
      for (let k = 0; k < 3; ++k) {
        if ((i >> k) & 1) continue;
        c.moveTo(...project(corner(i)));
        c.lineTo(...project(corner(i | (1 << k))));
      }
    }
    c.stroke();
    c.fillStyle = colour('soft');
    c.font = '11px system-ui, sans-serif';
    c.textAlign = 'center';
    for (let k = 0; k < 3; ++k) {
      const p = corner(0);
      p[k] = space.centre[k];
      const [x, y] = project(p);
      c.fillText(axisNames[k] + ' ' + space.size[k].toFixed(2) + ' m', x, y + 12);
    }
  };
  return {project, axes};
}

/// Joins points; a missing one breaks the line.
function polyline(c, points, project) {
  c.beginPath();
  let down = false;
  for (const p of points) {
    if (p) c[down ? 'lineTo' : 'moveTo'](...project(p));
    down = Boolean(p);
  }
  c.stroke();
}

function drawRun(c, run, project, width) {
  c.lineJoin = 'round';
  c.strokeStyle = colour('truth');
  c.lineWidth = 4;
  polyline(c, run.truth, project);
  const scale = errorColours();
  c.lineWidth = 2;
  const bad = [];
  let before = null;
  run.position.forEach((p, row) => {
    if (!p) return;
    const here = project(p);
    const last = bad[bad.length - 1];
    if (run.state[row] === 'BAD' && !(last && Math.hypot(here[0] - last[0], here[1] - last[1]) < 5)) bad.push(here);
    if (before) {
      const gap = before.row !== row - 1;  // LOST in between
      const e = run.error[row];
      c.setLineDash(gap ? [3, 4] : []);
      c.strokeStyle = gap ? colour('lost') : isNumber(e) ? scale[Math.min(63, Math.floor(64 * e / errorEnd))] : colour('unknown');
      c.beginPath();
      c.moveTo(...before.here);
      c.lineTo(...here);
      c.stroke();
    }
    before = {row, here};
  });
  c.setLineDash([]);
  c.strokeStyle = colour('text');
  c.lineWidth = 1.2;
  c.beginPath();
  for (const [x, y] of bad) {
    c.moveTo(x - 3, y - 3);
    c.lineTo(x + 3, y + 3);
    c.moveTo(x - 3, y + 3);
    c.lineTo(x + 3, y - 3);
  }
  c.stroke();
  for (const part of run.parts.filter((s) => s.state === 'LOST')) {
    const p = run.position.slice(0, part.begin).reverse().find((q) => q) || run.position.find((q) => q);
    if (!p) continue;
    const [x, y] = project(p);
    c.strokeStyle = colour('lost');
    c.lineWidth = 2;
    c.beginPath();
    c.moveTo(x, y - 7);
    c.lineTo(x + 7, y);
    c.lineTo(x, y + 7);
    c.lineTo(x - 7, y);
    c.closePath();
    c.stroke();
  }
  const ends = run.position.filter((p) => p);
  if (ends.length === 0) return;
  c.strokeStyle = c.fillStyle = colour('text');
  c.font = 'bold 11px system-ui, sans-serif';
  const name = (text, x, y) => {
    const right = x > width - 45;
    c.textAlign = right ? 'right' : 'left';
    c.fillText(text, right ? x - 7 : x + 7, y);
  };
  const [x0, y0] = project(ends[0]);
  const [x1, y1] = project(ends[ends.length - 1]);
  c.beginPath();
  c.arc(x0, y0, 4, 0, 7);
  c.stroke();
  name('start', x0, y0 - 5);
  c.fillRect(x1 - 3.5, y1 - 3.5, 7, 7);
  name('end', x1, y1 + 11);
}

/// One canvas. Its lines are drawn once into a picture; when the frame changes, only the mark of the frame moves.
function addView(parent, run, title, projection) {
  const canvas = element('canvas', {role: 'img', 'aria-label': title + ' of ' + run.name});
  parent.append(element('figure', {}, canvas, element('figcaption', {}, title)));
  const picture = document.createElement('canvas');
  const view = {canvas, run, project: null};
  view.draw = () => {
    const width = widthOf(canvas.parentElement);
    const height = Math.round(Math.min(width * 0.85, 380));
    const {project, axes} = projection(width, height);
    view.project = project;
    const c = context(picture, width, height);
    axes(c);
    drawRun(c, run, project, width);
    context(canvas, width, height);
    view.mark();
  };
  view.mark = () => {
    const c = canvas.getContext('2d');
    c.clearRect(0, 0, canvas.width, canvas.height);
    c.save();
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.clearRect(0, 0, canvas.width, canvas.height);
    c.drawImage(picture, 0, 0);
    c.restore();
    const p = run.position[rowAt(run, lead.time[shownRow])];
    if (!p) return;
    c.strokeStyle = colour('text');
    c.fillStyle = colour('s4');
    c.lineWidth = 1.5;
    c.beginPath();
    c.arc(...view.project(p), 6, 0, 7);
    c.fill();
    c.stroke();
  };
  views.push(view);
  return canvas;
}

function selectByClick(canvas) {
  const view = views[views.length - 1];
  canvas.addEventListener('click', (event) => {
    const box = canvas.getBoundingClientRect();
    let best = {distance: 400, row: -1};
    view.run.position.forEach((p, row) => {
      if (!p) return;
      const [x, y] = view.project(p);
      const distance = (x - event.clientX + box.left) ** 2 + (y - event.clientY + box.top) ** 2;
      if (distance < best.distance) best = {distance, row};
    });
    if (best.row >= 0) showTime(view.run.time[best.row]);
  });
}

function turnByHand(canvas) {
  const drawTurned = () => views.filter((v) => v.canvas.classList.contains('turn')).forEach((v) => v.draw());
  const by = (yaw, pitch) => {
    turn.yaw += yaw;
    turn.pitch = Math.max(-1.57, Math.min(1.57, turn.pitch + pitch));
    requestAnimationFrame(drawTurned);
  };
  canvas.classList.add('turn');
  canvas.tabIndex = 0;
  canvas.addEventListener('pointerdown', (e) => canvas.setPointerCapture(e.pointerId));
  canvas.addEventListener('pointermove', (e) => {
    if (canvas.hasPointerCapture(e.pointerId)) by(0.01 * e.movementX, 0.01 * e.movementY);
  });
  const keys = {ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1]};
  canvas.addEventListener('keydown', (e) => {
    if (!keys[e.key]) return;
    e.preventDefault();
    by(...keys[e.key]);
  });
}

function makePaths() {
  const here = section('paths');
  if (space.empty) {
    here.append(element('p', {class: 'note'}, 'No frame has a pose.'));
    return;
  }
  const plane = space.plane.map((k) => axisNames[k]).join('\u2013');
  const side = axisNames[space.long] + '\u2013' + axisNames[space.flat];
  here.append(element('div', {class: 'key'},
    anyError ? element('span', {}, 'error 0 ', element('i', {class: 'errors'}), metres(errorEnd) + ' and more') : null,
    anyError ? element('span', {}, 'wide grey line: ground truth; bright blue: error not known') : element('span', {}, 'no ground truth: the colour tells nothing'),
    element('span', {}, '\u2715 BAD'), element('span', {}, '\u25C7 LOST from here, dashed until found again'), element('span', {}, '\u25CF the frame above')));
  runs.forEach((run, r) => {
    if (several) here.append(element('h3', {}, runName(r)));
    const row = element('div', {class: 'views'});
    here.append(row);
    selectByClick(addView(row, run, 'plane of largest extent, ' + plane, (w, h) => planeProjection(...space.plane, w, h)));
    selectByClick(addView(row, run, 'from the side, ' + side, (w, h) => planeProjection(space.long, space.flat, w, h)));
    turnByHand(addView(row, run, '3-D: drag or use the arrow keys to turn', turnedProjection));
  });
  whenRestyled.push(() => views.forEach((v) => v.draw()));
  whenShown.push(() => views.forEach((v) => v.mark()));
}
