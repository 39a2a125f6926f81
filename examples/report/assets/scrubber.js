'use strict';
// The slider: every frame with its picture, its numbers and why it has its state.

const quantities = [
  ['frame', (run, row) => short(run.value('frame', row))],
  ['time', (run, row) => fixed(run.time[row], 3) + ' s'],
  ['state', (run, row) => run.state[row] + (run.value('refined', row) === 1 ? ', refined' : '')],
  ['known difficulty', (run, row) => run.label[row] || none],
  ['error, final pose', (run, row) => metres(run.error[row])],
  ['error, feature pose', (run, row) => metres(run.feature_error[row])],
  ['S_final / th_differ', (run, row) => fixed(run.value('S_final', row), 3) + ' / ' + fixed(run.value('th_differ', row), 3)],
  ['S_total', (run, row) => fixed(run.value('S_total', row), 3)],
  ['S_change', (run, row) => fixed(run.value('S_change', row), 3)],
  ['dynamic part of the image', (run, row) => (isNumber(run.value('dynamic_ratio', row)) ? fixed(100 * run.value('dynamic_ratio', row), 1) + ' %' : none)],
  ['moving objects', (run, row) => short(run.value('objects', row))],
  ['inliers / matches', (run, row) => short(run.value('feature_inliers', row)) + ' / ' + short(run.value('feature_matches', row))],
  ['refinement', (run, row) => (run.refine_status[row] || 'not run') + (isNumber(run.value('references', row)) ? ', ' + run.value('references', row) + (run.value('references', row) === 1 ? ' reference' : ' references') : '')],
  ['c_dir', (run, row) => fixed(run.value('c_dir', row), 3)],
  ['keyframes / landmarks', (run, row) => short(run.value('keyframes', row)) + ' / ' + short(run.value('landmarks', row))],
  ['time of the frame', (run, row) => fixed(run.value('ms_total', row), 1) + ' ms'],
];

/// The picture of a frame, or the last one before it.
function pictureFinder(r) {
  const numbers = Object.keys(pictures[r]).map(Number).sort((a, b) => a - b);
  return (frame) => {
    let found = numbers.length > 0 ? numbers[0] : null;
    for (let low = 0, high = numbers.length - 1; low <= high;) {
      const middle = (low + high) >> 1;
      if (numbers[middle] <= frame) {
        found = numbers[middle];
        low = middle + 1;
      } else {
        high = middle - 1;
      }
    }
    return found;
  };
}

function makeRunPanel(run, r) {
  const image = element('img', {class: 'frame', alt: 'frame with moving pixels red and static features green'});
  const caption = element('figcaption', {});
  const sentence = element('p', {class: 'sentence'});
  const find = pictureFinder(r);
  let shown = null;
  const update = (time) => {
    const row = rowAt(run, time);
    const frame = run.value('frame', row);
    const picture = find(frame);
    if (picture === null) {
      image.style.display = 'none';
      caption.textContent = 'This run has no pictures: apso_track --report writes them.';
    } else {
      if (picture !== shown) image.src = pictures[r][picture];
      shown = picture;
      image.dataset.frame = String(picture);
      caption.textContent = picture === frame ? 'frame ' + frame + ': moving pixels red, static features green'
        : 'picture of frame ' + picture + ', the last one before frame ' + frame;
    }
    sentence.textContent = run.explanation[row];
  };
  return {update, panel: element('div', {}, several ? element('h3', {}, runName(r)) : null, element('figure', {}, image, caption), sentence)};
}

function drawStrip(canvas, run) {
  const width = widthOf(canvas.parentElement);
  const c = context(canvas, width, 10);
  const x = (t) => width * t / lastTime;
  for (const part of run.parts) {
    const next = part.end + 1 < run.time.length ? run.time[part.end + 1] : run.time[part.end];
    fillState(c, part.state, x(run.time[part.begin]), 0, Math.max(2, x(next) - x(run.time[part.begin])), 10);
  }
}

function makeScrubber() {
  const here = section('frames');
  if (several) here.classList.add('several');
  const slider = element('input', {type: 'range', min: 0, max: lead.time.length - 1, value: 0, 'aria-label': 'frame', id: 'slider'});
  const position = element('output', {id: 'position'});
  const rows = Array.from(new Set(runs.flatMap((run) => run.events.map((e) => rowAt(lead, Math.max(0, e.time)))))).sort((a, b) => a - b);
  const button = (text, title, act) => {
    const b = element('button', {type: 'button', title}, text);
    b.addEventListener('click', act);
    return b;
  };
  let timer = null;
  const play = button('play', 'play or pause', () => {
    if (timer !== null) clearInterval(timer);
    timer = timer === null ? setInterval(() => (shownRow + 1 < lead.time.length ? show(shownRow + 1) : play.click()), 66) : null;
    play.textContent = timer === null ? 'play' : 'pause';
  });
  const controls = element('div', {class: 'controls'},
    button('\u2039\u2039 event', 'event before', () => show(rows.filter((row) => row < shownRow).pop() || 0)),
    button('\u2039', 'frame before', () => show(shownRow - 1)), play, button('\u203A', 'next frame', () => show(shownRow + 1)),
    button('event \u203A\u203A', 'next event', () => show(rows.find((row) => row > shownRow) ?? lead.time.length - 1)), position);
  const strips = runs.map(() => element('canvas', {class: 'strip'}));
  here.append(controls, slider, ...strips, stateKey());
  slider.addEventListener('input', () => show(Number(slider.value)));

  const panels = runs.map(makeRunPanel);
  const holder = element('div', {class: 'columns'}, panels.map((p) => p.panel));
  holder.style.setProperty('--columns', String(Math.min(3, runs.length)));
  const cells = quantities.map(() => runs.map(() => element('td', {})));
  const table = element('table', {id: 'numbers'}, several ? element('thead', {}, element('tr', {}, element('th', {}), runs.map((_, r) => element('th', {}, runName(r))))) : null,
    element('tbody', {}, quantities.map(([name], q) => element('tr', {}, element('td', {}, name), cells[q]))));
  here.append(element('div', {class: 'shown'}, holder, element('div', {class: 'scroll'}, table)));

  const all = element('tbody', {});
  const details = element('details', {}, element('summary', {}, 'all columns of frames.csv of this frame'), element('div', {class: 'scroll tall'}, element('table', {}, all)));
  here.append(details);
  const listAll = (time) => {
    if (!details.open) return;
    const names = Array.from(new Set(runs.flatMap((run) => Object.keys(run.columns)))).sort();
    all.replaceChildren(...names.map((name) => element('tr', {}, element('td', {}, name), runs.map((run) => element('td', {}, short(run.value(name, rowAt(run, time))))))));
  };
  details.addEventListener('toggle', () => listAll(lead.time[shownRow]));

  whenShown.push((time) => {
    slider.value = String(shownRow);
    position.textContent = (shownRow + 1) + ' / ' + lead.time.length + ', ' + fixed(time, 2) + ' s';
    panels.forEach((p) => p.update(time));
    runs.forEach((run, r) => {
      const row = rowAt(run, time);
      quantities.forEach(([, text], q) => { cells[q][r].textContent = text(run, row); });
    });
    listAll(time);
  });
  whenRestyled.push(() => strips.forEach((strip, r) => drawStrip(strip, runs[r])));
}
