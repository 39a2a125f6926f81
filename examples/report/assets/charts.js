'use strict';
// Everything over time, on one common axis: zooming one chart zooms all, a click shows the frame.

const charts = [];
let zooming = false;

function stateBands(u, run) {
  const c = u.ctx;
  const {left, top, width, height} = u.bbox;
  c.save();
  c.beginPath();
  c.rect(left, top, width, height);
  c.clip();
  for (const part of run.parts) {
    const x0 = u.valToPos(run.time[part.begin], 'x', true);
    const after = part.end + 1 < run.time.length ? run.time[part.end + 1] : run.time[part.end];
    fillState(c, part.state, x0, top, Math.max(2, u.valToPos(after, 'x', true) - x0), height);
  }
  c.restore();
}

/// \param series list of {label, values, colour: index or name, dash, width, fill, value}
/// \param end    of the axis of values, the same for all runs
/// \param begin  of the axis; more than 0: the axis is logarithmic
function addChart(parent, title, run, time, series, end, begin = 0) {
  const box = element('div', {class: 'chart'}, element('h3', {}, title));
  parent.append(box);
  const axis = () => ({stroke: () => colour('soft'), grid: {stroke: () => colour('grid'), width: 1}, ticks: {stroke: () => colour('grid'), width: 1}});
  const stroke = (s) => () => (typeof s.colour === 'number' ? seriesColour(s.colour) : colour(s.colour));
  const u = new uPlot({
    width: widthOf(box),
    height: 190,
    cursor: {sync: {key: 'time'}, drag: {x: true, y: false}, points: {size: 5}},
    scales: {x: {time: false, range: (_, a, b) => (a === null || b <= a ? [0, lastTime] : [a, b])}, y: {distr: begin > 0 ? 3 : 1, range: () => [begin, end]}},
    axes: [axis(), {...axis(), size: 60, values: (_, list) => list.map(short), splits: begin > 0 ? () => powers(begin, end) : undefined}],
    series: [{label: 'time [s]', value: (_, v) => fixed(v, 2)}, ...series.map((s) => ({
      label: s.label, stroke: stroke(s), width: s.width || 1.5, dash: s.dash, points: {show: false},
      fill: s.fill ? () => stroke(s)() + '55' : undefined,
      value: (_, v, index, row) => short(s.raw && row !== null ? s.raw[row] : v),
    }))],
    // of layers on top of each other each is filled down to the next, so that their colours do not mix
    bands: series.every((s) => s.fill) ? series.slice(1).map((_, i) => ({series: [i + 1, i + 2]})) : [],
    hooks: {
      drawClear: run ? [(self) => stateBands(self, run)] : [],
      setScale: [(self, key) => {
        if (key !== 'x') return;
        placeLine(self);
        if (zooming || charts.length === 0 || !charts.includes(self)) return;
        zooming = true;
        const {min, max} = self.scales.x;
        for (const other of charts) if (other !== self) other.setScale('x', {min, max});
        zooming = false;
      }],
      setSize: [placeLine],
    },
  }, [time, ...series.map((s) => s.values)], box);
  u.line = element('div', {class: 'now'});
  u.over.append(u.line);
  let pressed = 0;
  u.over.addEventListener('mousedown', (e) => { pressed = e.clientX; });
  u.over.addEventListener('click', (e) => {
    if (Math.abs(e.clientX - pressed) < 4) showTime(u.posToVal(e.clientX - u.over.getBoundingClientRect().left, 'x'));
  });
  u.over.addEventListener('dblclick', () => u.setScale('x', {min: 0, max: lastTime}));
  u.box = box;
  u.setScale('x', {min: 0, max: lastTime});
  charts.push(u);
}

function placeLine(u) {
  if (!u.line) return;
  const x = u.valToPos(lead.time[shownRow], 'x');
  u.line.style.display = x >= 0 && x <= u.over.clientWidth ? '' : 'none';
  u.line.style.transform = 'translateX(' + x + 'px)';
}

function powers(begin, end) {
  const list = [];
  for (let p = Math.round(Math.log10(begin)); p <= Math.round(Math.log10(end)); ++p) list.push(10 ** p);
  return list;
}

/// One kind of chart for every run, side by side with the same axes. \param make (run) => list of series, or null
function addRow(here, title, make, end, begin) {
  const row = element('div', {class: 'columns'});
  row.style.setProperty('--columns', String(Math.min(3, runs.length)));
  here.append(row);
  runs.forEach((run, r) => addChart(row, title + (several ? ' \u2013 ' + runName(r) : ''), run, run.time, make(run), end, begin));
}

/// A quantity of all runs in one chart. \param values (run) => one number per frame
function addComparison(here, title, values, end, begin) {
  const joined = uPlot.join(runs.map((run) => [run.time, values(run)]));
  // a time that another run has is no gap of this one
  const series = joined.slice(1).map((list, r) => ({label: letters[r % 26], colour: r, dash: r % 2 ? [6, 3] : undefined, values: list}));
  addChart(here, title, null, joined[0], series, end, begin);
}

const stages = ['features', 'observe', 'assess', 'refine', 'map'];
/// Times of the stages on top of each other, the topmost first so that it is drawn behind.
function stackedTimes(run) {
  const sum = run.time.map(() => 0);
  const layers = stages.map((stage, i) => {
    const raw = run.columns['ms_' + stage] || run.time.map(() => null);
    raw.forEach((v, row) => { sum[row] += isNumber(v) ? v : 0; });
    return {label: stage, colour: i, values: sum.slice(), raw, fill: true, width: 1};
  });
  return layers.reverse();
}

function makeCharts() {
  const here = section('charts');
  here.append(stateKey(), element('p', {class: 'note'}, 'Time since the first frame, in seconds. Drag over a chart to zoom all of them, double-click to see ' +
    'everything again, click to see the frame. A click on a name in a legend hides its line.'));
  const column = (run, name) => run.columns[name] || run.time.map(() => null);
  const line = (run, name, index, more) => ({label: name, values: column(run, name), colour: index, ...more});
  if (anyError) {
    const power = (v, round) => 10 ** round(Math.log10(v));
    const errors = runs.flatMap((r) => [...r.error, ...r.feature_error]).filter((v) => isNumber(v) && v > 0);
    const end = power(largest(errors, 1e-4), Math.ceil);
    const begin = Math.min(end / 10, power(Math.max(1e-4, errors.reduce((m, v) => Math.min(m, v), end)), Math.floor));
    const raised = (list) => list.map((v) => (isNumber(v) ? Math.max(v, begin) : v));
    if (several) addComparison(here, 'Position error of the final poses [m], logarithmic', (r) => raised(r.error), end, begin);
    addRow(here, 'Position error after alignment [m], logarithmic', (run) => [
      {label: 'features only', values: raised(run.feature_error), raw: run.feature_error, colour: 1, dash: [6, 3]},
      {label: 'final', values: raised(run.error), raw: run.error, colour: 0, width: 2}], end, begin);
  } else {
    here.append(element('p', {class: 'note'}, 'There is no ground truth that can be compared, so errors are not known.'));
  }
  if (several) addComparison(here, 'S_final', (r) => column(r, 'S_final'), 1.03);
  addRow(here, 'Verdict: BAD where S_final is below th_differ; S_inn is its factor from the feature pose', (run) => [
    line(run, 'S_final', 0, {width: 2}), line(run, 'S_inn', 1, {dash: [2, 3]}), {label: 'th_differ', values: column(run, 'th_differ').map((v, row) => (run.state[row] === 'INITIALISING' ? null : v)), colour: 7, dash: [5, 4]}], 1.03);
  addRow(here, 'Scores of the frame, 1 is best; th_s is the threshold of S_total while initialising', (run) => [
    line(run, 'S_total', 7, {width: 2}), ...run.frame_scores.map((name, i) => line(run, name, i)),
    {label: 'th_s', values: column(run, 'th_s').map((v, row) => (run.state[row] === 'INITIALISING' ? v : null)), colour: 7, dash: [5, 4]}], 1.03);
  addRow(here, 'Deviation from the reference, 0 is best', (run) => [
    line(run, 'S_change', 7, {width: 2}), ...run.change_scores.map((name, i) => line(run, name, i)), line(run, 'S_step', 6, {dash: [2, 3]}),
    line(run, 'dynamic_ratio', 4, {dash: [6, 3]})], 1.03);
  const slowest = 1.05 * largest(runs.flatMap((r) => column(r, 'ms_total')), 1);
  addRow(here, 'Time per stage [ms], stacked', stackedTimes, slowest);
  whenShown.push(() => charts.forEach(placeLine));
  let width = 0;
  whenRestyled.push(() => {
    const now = widthOf(document.body);
    for (const u of charts) {
      if (now !== width || printing) u.setSize({width: widthOf(u.box), height: 190});
      u.redraw(false, true);
    }
    width = now;
  });
}
