'use strict';
// What all parts of the page share: the data, elements, colours, numbers as text, the frame that is shown.

const data = JSON.parse(document.getElementById('runs').textContent);
const pictures = JSON.parse(document.getElementById('pictures').textContent);
const runs = data.runs;
const several = runs.length > 1;
const letters = 'ABCDEFGHIJKLMNOPQRSTUVWXYZ';
const section = (id) => document.getElementById(id);

// Text goes in as text nodes only, so that nothing of a file is read as HTML.
function element(tag, attributes, ...children) {
  const e = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) {
    if (value !== null && value !== undefined) e.setAttribute(name, value);
  }
  e.append(...children.flat().filter((c) => c !== null && c !== undefined).map((c) => (c instanceof Node ? c : String(c))));
  return e;
}

const isNumber = (v) => typeof v === 'number' && Number.isFinite(v);
const none = '\u2013';
const fixed = (v, digits) => (isNumber(v) ? v.toFixed(digits) : none);
const short = (v) => (isNumber(v) ? String(Number(v.toPrecision(4))) : none);
const metres = (v) => (isNumber(v) ? (v < 1 ? v.toFixed(4) : v.toPrecision(5)) + ' m' : none);
const runName = (r) => (several ? letters[r % 26] + ': ' : '') + runs[r].name;

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue('--' + name).trim();
const seriesColour = (i) => colour('s' + (i % 8));
const largest = (list, least = 0) => list.reduce((m, v) => (isNumber(v) && v > m ? v : m), least);

for (const run of runs) {
  run.time = run.columns.time;
  run.value = (name, row) => (run.columns[name] ? run.columns[name][row] : null);
  run.pair = run.error.some(isNumber);
  // consecutive frames of one state: {state, begin, end}, rows begin..end
  run.parts = [];
  run.state.forEach((state, row) => {
    const last = run.parts[run.parts.length - 1];
    if (last && last.state === state) last.end = row;
    else run.parts.push({state, begin: row, end: row});
  });
}
const lastTime = Math.max(largest(runs.map((r) => r.time[r.time.length - 1])), 1e-3);
const anyError = runs.some((r) => r.pair);

// The run that the slider counts along: the one with the most frames.
const lead = runs.reduce((best, r) => (r.time.length > best.time.length ? r : best), runs[0]);

/// Row of a run whose time is nearest.
function rowAt(run, time) {
  let low = 0;
  let high = run.time.length - 1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (run.time[middle] < time) low = middle + 1;
    else high = middle;
  }
  return low > 0 && time - run.time[low - 1] < run.time[low] - time ? low - 1 : low;
}

// What is shown, and who wants to know when it changes.
let shownRow = 0;
const whenShown = [];
function show(row) {
  shownRow = Math.max(0, Math.min(lead.time.length - 1, row));
  for (const f of whenShown) f(lead.time[shownRow]);
}
const showTime = (time) => show(rowAt(lead, time));

// Canvases are drawn anew when the colours or the width change.
const whenRestyled = [];
const restyle = () => whenRestyled.forEach((f) => f());
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', restyle);
let printing = false;
addEventListener('beforeprint', () => {
  printing = true;
  document.documentElement.dataset.theme = 'light';
  restyle();
});
addEventListener('afterprint', () => {
  printing = false;
  delete document.documentElement.dataset.theme;
  restyle();
});
const widthOf = (e) => Math.max(120, printing ? Math.min(e.clientWidth, 660) : e.clientWidth);
new ResizeObserver(() => requestAnimationFrame(restyle)).observe(document.body);

/// A canvas context in CSS pixels.
function context(canvas, width, height) {
  const scale = window.devicePixelRatio || 1;
  canvas.width = Math.round(width * scale);
  canvas.height = Math.round(height * scale);
  canvas.style.height = height + 'px';
  const c = canvas.getContext('2d');
  c.setTransform(scale, 0, 0, scale, 0, 0);
  return c;
}

/// Marks an area as that of a state: a tint, for LOST stripes, so that not only the colour tells.
function fillState(c, state, x, y, width, height) {
  if (state === 'GOOD') return;
  c.save();
  c.beginPath();
  c.rect(x, y, width, height);
  c.clip();
  c.setLineDash([]);
  if (state === 'LOST') {
    c.strokeStyle = colour('lost');
    c.globalAlpha = 0.75;
    c.lineWidth = 1.5 * (window.devicePixelRatio || 1);
    const step = 4 * c.lineWidth;
    c.beginPath();
    for (let s = Math.floor((x - height) / step) * step; s < x + width; s += step) {
      c.moveTo(s, y + height);
      c.lineTo(s + height, y);
    }
    c.stroke();
  } else {
    c.globalAlpha = state === 'BAD' ? 0.32 : 0.25;
    c.fillStyle = colour(state === 'BAD' ? 'bad' : 'start');
    c.fillRect(x, y, width, height);
  }
  c.restore();
}

const stateKey = () => element('div', {class: 'key'}, ['INITIALISING', 'BAD', 'LOST'].map((s) => element('span', {}, element('i', {class: s}), s)));
