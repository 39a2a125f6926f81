'use strict';
// The tables: result, errors, times, events, options, and where the runs come from.

/// \param head list of texts; \param rows lists of texts, or {cells, attributes}
function addTable(here, head, rows, tall) {
  const make = (row) => {
    const {cells, attributes} = Array.isArray(row) ? {cells: row, attributes: {}} : row;
    return element('tr', attributes, cells.map((c) => (c instanceof Node ? c : element('td', {}, c))));
  };
  const table = element('table', {}, element('thead', {}, element('tr', {}, head.map((h) => element('th', h === 'what' ? {class: 'word'} : {}, h)))), element('tbody', {}, rows.map(make)));
  here.append(element('div', {class: tall ? 'scroll tall' : 'scroll'}, table));
  return table;
}
const textCell = (text) => element('td', {class: 'text'}, text);
const at = (o, ...keys) => keys.reduce((v, k) => (v === null || v === undefined ? null : v[k]), o);

function makeResult() {
  const sequences = Array.from(new Set(runs.map((r) => r.sequence)));
  section('title').textContent = sequences.join(', ');
  document.title = sequences.join(', ') + ' \u2013 apso report';
  section('about').textContent = runs.map((run, r) => runName(r)).join(', ') + ' \u2013 trajectory, errors, scores and every frame';
  const here = section('result');
  runs.forEach((run, r) => {
    if (run.summary.failure) here.append(element('p', {class: 'warning'}, runName(r) + ' ended early: ' + run.summary.failure));
    if (run.summary.evaluation_problem) {
      here.append(element('p', {class: 'warning'}, runName(r) + ': the errors are not known: ' + run.summary.evaluation_problem));
    }
  });
  runs.forEach((run, r) => {
    const pairs = at(run.summary, 'final', 'pairs');
    const poses = at(run.summary, 'frames', 'in_sequence');
    if (isNumber(pairs) && pairs < 0.9 * poses) {
      here.append(element('p', {class: 'warning'}, runName(r) + ': the ATE is that of ' + pairs + ' of ' + poses + ' frames; the others have no pose or no ground truth.'));
    }
  });
  const lines = [
    ['sequence', (run) => run.sequence],
    ['ATE rmse, final poses', (run) => metres(at(run.summary, 'final', 'ate', 'rmse')), true],
    ['ATE rmse, features only', (run) => metres(at(run.summary, 'features', 'ate', 'rmse')), true],
    ['pairs of the ATE / frames', (run) => short(at(run.summary, 'final', 'pairs')) + ' / ' + at(run.summary, 'frames', 'processed')],
    ['RPE translation over 1 s', (run) => metres(at(run.summary, 'final', 'rpe_1s', 'translation', 'rmse')), true],
    ['RPE translation over 1 frame', (run) => metres(at(run.summary, 'final', 'rpe_1f', 'translation', 'rmse')), true],
    ['frames with a pose', (run) => at(run.summary, 'frames', 'with_pose') + ' of ' + at(run.summary, 'frames', 'in_sequence')],
    ['BAD / of these refined', (run) => at(run.summary, 'frames', 'bad') + ' / ' + at(run.summary, 'frames', 'repaired')],
    ['LOST', (run) => short(at(run.summary, 'frames', 'lost'))],
    ['skipped', (run) => short(at(run.summary, 'frames', 'skipped'))],
    ['time per frame, median', (run) => fixed(at(run.summary, 'ms', 'total', 'median'), 1) + ' ms', true],
  ];
  const one = sequences.length === 1 && several;
  addTable(here, ['', ...runs.map((_, r) => runName(r))], lines.map(([name, text, lessIsBetter]) => {
    const texts = runs.map(text);
    const values = texts.map(parseFloat);
    const best = one && lessIsBetter && values.every(isNumber) && new Set(texts).size > 1 ? Math.min(...values) : NaN;
    return [name, ...texts.map((t, r) => element('td', {class: values[r] === best ? 'best' : null}, t))];
  }));
  if (one) here.append(element('p', {class: 'note'}, '\u25C6 marks the least of a row.'));
}

function makeErrors() {
  const here = section('errors');
  const rows = [];
  runs.forEach((run, r) => {
    for (const [key, poses] of [['final', 'final'], ['features', 'features only']]) {
      const e = run.summary[key];
      if (!e) continue;
      const add = (name, s, pairs, digits) => {
        if (s) rows.push([...(several ? [runName(r)] : []), poses, name, short(pairs), ...['rmse', 'mean', 'median', 'std', 'min', 'max'].map((k) => fixed(s[k], digits))]);
      };
      add('ATE [m]', e.ate, e.pairs, 5);
      for (const [rpe, over] of [['rpe_1s', '1 s'], ['rpe_1f', '1 frame']]) {
        add('RPE over ' + over + ' [m]', at(e, rpe, 'translation'), at(e, rpe, 'pairs'), 5);
        add('RPE over ' + over + ' [deg]', at(e, rpe, 'rotation_deg'), at(e, rpe, 'pairs'), 4);
      }
    }
  });
  if (rows.length === 0) {
    here.append(element('p', {class: 'note'}, 'There is no ground truth that can be compared.'));
    return;
  }
  here.append(element('p', {class: 'note'}, 'ATE: distance after the rigid motion, without scale, that lays the estimate onto the ground truth. RPE: error of the ' +
    'motion over an interval. Pairs: poses, or motions, for which there is ground truth; a LOST frame has no pose and is in none.'));
  addTable(here, [...(several ? ['run'] : []), 'poses', 'error', 'pairs', 'rmse', 'mean', 'median', 'S.D.', 'min', 'max'], rows);
}

function makeTimes() {
  const here = section('times');
  const rows = [];
  for (const stage of ['load', ...stages, 'total']) {
    runs.forEach((run, r) => {
      const ms = at(run.summary, 'ms', stage);
      if (ms) rows.push([stage, ...(several ? [runName(r)] : []), fixed(ms.median, 2), fixed(ms.p95, 2), fixed(ms.max, 2)]);
    });
  }
  addTable(here, ['stage [ms]', ...(several ? ['run'] : []), 'median', '95 %', 'max'], rows);
  here.append(element('p', {class: 'note'}, 'The total is without loading the images.'));
}

function makeEvents() {
  const here = section('events');
  const rows = [];
  runs.forEach((run, r) => run.events.forEach((e) => rows.push({time: e.time, e, r, run})));
  rows.sort((a, b) => a.time - b.time);
  const head = ['time [s]', 'frame', ...(several ? ['run'] : []), 'what', ''];
  const table = addTable(here, head, rows.map(({e, r, run}) => ({
    attributes: {tabindex: 0},
    cells: [fixed(e.time, 2), e.kind === 'skipped' ? none : short(run.value('frame', e.row)), ...(several ? [letters[r % 26]] : []), element('td', {class: 'word'}, e.kind), textCell(e.text)],
  })), true);
  const lines = Array.from(table.tBodies[0].rows);
  lines.forEach((line, i) => {
    const go = () => showTime(rows[i].run.time[rows[i].e.row]);
    line.addEventListener('click', go);
    line.addEventListener('keydown', (event) => { if (event.key === 'Enter') go(); });
  });
  whenShown.push((time) => lines.forEach((line, i) => line.classList.toggle('here', rows[i].run.time[rows[i].e.row] === time)));
}

function makeOptions() {
  const here = section('options');
  const text = (v) => (v === undefined ? none : typeof v === 'string' ? v : JSON.stringify(v));
  const names = Array.from(new Set(runs.flatMap((run) => Object.keys(run.options)))).sort();
  const differ = (name) => new Set(runs.map((run) => text(run.options[name]))).size > 1;
  const changed = (name) => name in data.defaults && runs.some((run) => text(run.options[name]) !== text(data.defaults[name]));
  const row = (name) => ({attributes: {class: differ(name) ? 'differs' : null},
    cells: [name, ...runs.map((run) => textCell(text(run.options[name]))), textCell(text(data.defaults[name]))]});
  const head = ['option', ...runs.map((_, r) => runName(r)), 'default'];
  const told = names.filter((name) => differ(name) || changed(name) || name === 'motion policy');
  if (several) here.append(element('p', {class: 'note'}, '\u25C6 marks the options in which the runs differ.'));
  addTable(here, head, told.map(row));
  if (!names.some((name) => differ(name) || changed(name))) here.append(element('p', {class: 'note'}, 'All other options have their default values.'));
  const all = element('details', {}, element('summary', {}, 'all ' + names.length + ' options'));
  here.append(all);
  addTable(all, head, names.map(row), true);
  runs.forEach((run, r) => here.append(element('h3', {}, runName(r) + ' \u2013 apso ' + run.summary.version),
    element('pre', {}, run.summary.command || 'The command of this run was not noted.')));
  section('made').textContent = 'Made by apso ' + data.version + '. This file holds everything it shows; it loads nothing.';
}
