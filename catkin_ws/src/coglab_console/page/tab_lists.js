// Objects, primitives and feedback controllers.
import { h, mark, setText, table } from './dom.js';
import { store } from './store.js';
import { sender } from './tab_experiment.js';

export function objectsPage(page) {
  page.className = 'page two';
  const told = h('p', { 'aria-live': 'polite' });
  const problems = h('p', { id: 'object-problems' });
  const list = h('div');
  const entry = h('pre', { tabindex: '0', 'aria-label': 'Entry of the database' });
  page.append(
    h('div', {}, h('h2', {}, 'Object database'), problems, h('div', { class: 'row' }, sender('Read the files again', told, () => ['objects_reload', {}])), told, list,
      h('p', {}, 'A new object: ./coglab object new NAME, then ./coglab object check NAME. The console writes no object file.')),
    h('div', {}, h('h2', {}, 'Entry'), entry));
  const draw = () => {
    const { rows = [], problems: words = '' } = store.docs.objects ?? {};
    problems.replaceChildren(mark(words ? 'warn' : 'ok'), words || 'Every file fits the schema.');
    list.replaceChildren(table(['Object', 'Name', 'kg', 'Shape', ''], rows.map((row) => [row.id, row.name, row.mass, row.shape?.type ?? '', h('button', { type: 'button', 'aria-label': `Show ${row.id}`, onclick: () => setText(entry, row.text) }, 'Show')]), 'Objects'));
    if (!entry.textContent && rows.length) setText(entry, rows[0].text);
  };
  draw();
  return { docs: { objects: draw } };
}

function plot(row) {
  const canvas = h('canvas', { width: 560, height: 150, role: 'img', 'aria-label': `Plot of ${row.name}: place along x, y, z and speed over time` });
  const context = canvas.getContext('2d');
  const end = row.plot[row.plot.length - 1][0];
  const all = row.plot.flatMap((point) => point.slice(1));
  const [low, high] = [Math.min(...all, 0), Math.max(...all, 0.1)];
  const x = (t) => 8 + (t / end) * 470;
  const y = (value) => 140 - ((value - low) / (high - low)) * 128;
  [['x, m', '#0072b2', []], ['y, m', '#009e73', [8, 4]], ['z, m', '#cc79a7', [2, 3]], ['speed, m/s', '#1b1f24', [12, 3, 3, 3]]].forEach(([name, colour, dash], i) => {
    context.strokeStyle = colour;
    context.lineWidth = 2.5;
    context.setLineDash(dash);
    context.beginPath();
    for (const point of row.plot) context.lineTo(x(point[0]), y(point[i + 1]));
    context.moveTo(484, 18 + 20 * i);
    context.lineTo(500, 18 + 20 * i);
    context.stroke();
    context.fillStyle = '#1b1f24';
    context.font = '12px sans-serif';
    context.fillText(name, 503, 22 + 20 * i);
  });
  context.fillText(`0 … ${end.toFixed(2)} s`, 484, 120);
  return canvas;
}

export function primitivesPage(page) {
  page.className = 'page two';
  const list = h('div');
  const bars = h('div');
  const verdict = h('p');
  page.append(h('div', {}, h('h2', {}, 'Primitives, as demonstrated'), list), h('div', {}, h('h2', {}, 'Recognised reach of the person'), verdict, bars));
  const draw = () => {
    const { rows = [], problem = '', file = '' } = store.docs.primitives ?? {};
    list.replaceChildren(h('p', {}, problem || file || 'The library has not been read yet.'), ...rows.flatMap((row) => [h('h3', {}, `${row.name}, ${row.duration} s, ${row.basis} basis functions, ${row.mapping}`), h('p', {}, row.description), plot(row)]));
  };
  const recognise = () => {
    const seen = store.docs.recognition;
    setText(verdict, seen ? `${seen.decided ? 'Decided' : 'Not decided'}: ${seen.pattern}, ${Math.round(seen.progress * 100)} % of the reach seen` : 'No recognition yet: the recogniser tells when the person’s hand moves.');
    bars.replaceChildren(...(seen?.rows ?? []).map(([name, share]) => {
      const fill = h('i');
      fill.style.width = `${100 * share}%`;
      return h('div', { class: 'bar' }, h('span', {}, name), h('span', {}, fill), h('span', {}, share.toFixed(2)));
    }));
  };
  draw();
  recognise();
  return { docs: { primitives: draw, recognition: recognise } };
}

export function feedbackPage(page) {
  page.className = 'page';
  const told = h('p', { 'aria-live': 'polite' });
  const list = h('div');
  const shares = h('div');
  page.append(h('h2', {}, 'Feedback controllers in execution order'), told, list, h('h2', {}, 'Who changed what in the newest cycle'), shares);
  const verbs = (row) => h('div', { class: 'row' }, ...[row.enabled ? 'disable' : 'enable', row.paused ? 'resume' : 'pause'].map((verb) => {
    const button = sender(verb, told, () => ['feedback', { verb, name: row.name }]);
    button.setAttribute('aria-label', `${verb} ${row.name}`);
    return button;
  }));
  const order = (rows, i, step) => {
    const names = rows.map((row) => row.name);
    [names[i], names[i + step]] = [names[i + step], names[i]];
    const button = sender(step < 0 ? '↑' : '↓', told, () => ['feedback_order', { names }]);
    button.setAttribute('aria-label', `${rows[i].name} ${step < 0 ? 'earlier' : 'later'}`);
    return button;
  };
  const draw = () => {
    const { rows = [], profile = '' } = store.docs.feedback ?? {};
    const cells = rows.map((row, i) => [i + 1, row.name, row.stage, row.activity + (row.waiting ? ` ${row.waiting}` : ''),
      [...row.reasons, row.fault && `fault: ${row.fault}`].filter(Boolean).join('; ') || '·', `${row.faults} / ${row.overruns}`, verbs(row),
      h('div', { class: 'row' }, i ? order(rows, i, -1) : null, i + 1 < rows.length ? order(rows, i, 1) : null)]);
    list.replaceChildren(h('p', {}, rows.length ? `Profile: ${profile || 'none'}` : 'No feedback controllers are loaded.'), table(['', 'Name', 'Stage', 'Activity', 'Paused because', 'Faults / overruns', '', 'Order'], cells, 'Feedback controllers'));
  };
  const attribute = () => {
    const { rows = [], inside = [] } = store.docs.attribution ?? {};
    shares.replaceChildren(
      rows.length ? table(['Controller', 'Reference', 'Changed by', 'Turned by, rad'], rows.map((row) => [row.controller, row.signal, row.size, row.angle]), 'Corrections') : h('p', {}, 'Nobody changed a reference.'),
      ...inside.map((one) => h('p', {}, `${one.controller}: ${one.values.map(([name, value, unit]) => `${name} ${value} ${unit}`).join(', ')}`)));
  };
  draw();
  attribute();
  return { docs: { feedback: draw, attribution: attribute } };
}
