// The pages Contact, Objects, Primitives and Feedback.
import { h, mark, setText, table } from './dom.js';
import { store } from './link.js';
import { field } from './tab_experiment.js';
import { commandButton } from './controls.js';

const JOINTS = ['A1', 'A2', 'E1', 'A3', 'A4', 'A5', 'A6'];

export function contactPage(page) {
  page.className = 'page two';
  const message = h('p', { 'aria-live': 'polite' });
  const learnt = h('p');
  const detector = h('p');
  const bars = JOINTS.map((name) => {
    const fill = h('i');
    const limit = h('b');
    const value = h('span');
    const label = h('span', {}, name);
    return { name: label, row: h('div', { class: 'bar' }, label, h('span', {}, fill, limit), value), fill, limit, value, peak: 0 };
  });
  const title = h('span', {}, 'Change of the external torques, Nm');
  const k = h('input', { type: 'number', min: 3, max: 50, step: 0.5, value: 6 });
  const timeout = h('input', { type: 'number', min: 1, max: 60, value: 20 });
  page.append(
    h('div', {}, h('h2', {}, title), ...bars.map((bar) => bar.row),
      h('p', {}, 'Input of the contact detector. Bar: the largest change of the last second. Black line: its threshold, k robust standard deviations at rest. ●: the joint counts now.')),
    h('div', {}, h('h2', {}, 'Noise at rest'), learnt, h('div', { class: 'row' }, commandButton('Learn again at rest', { name: 'contact_learn', message, held: true, request: () => ['contact_learn', {}] })),
      h('h2', {}, 'Try the detector'), detector,
      h('div', { class: 'row' }, field('Threshold k', k), field('For, s', timeout),
        commandButton('Watch for contact', { name: 'contact_arm', message, held: true, request: () => ['contact_arm', { mode: 'contact', k: Number(k.value), timeout: Number(timeout.value) }] }),
        commandButton('Off', { name: 'contact_arm', message, request: () => ['contact_arm', { mode: 'off' }] })), message));

  const onState = (state) => {
    bars.forEach((bar, i) => {
      const rate = Math.abs(state.rate[i] ?? 0);
      bar.peak = Math.max(rate, bar.peak * 0.97);
      const threshold = state.threshold[i] ?? 0;
      setText(bar.name, `${JOINTS[i]} ${state.watched[i] ? '●' : '○'}`);
      const full = Math.max(1.5 * threshold, 0.05);
      bar.fill.style.width = `${Math.min(100, (100 * bar.peak) / full)}%`;
      bar.limit.style.left = `${(100 * threshold) / full}%`;
      setText(bar.value, i in state.rate ? bar.peak.toFixed(3) : '–');
    });
    const { alive, state: stands, mode } = store.docs.status?.contact ?? {};
    setText(detector, !alive ? 'The detector is silent: it does not run, or it gets no torques.'
      : state.margin !== null ? `Watching for ${mode}: margin ${state.margin.toFixed(2)}; contact from 1.`
        : stands === 'waiting' ? `Armed for ${mode}; waits until the arm stands still and the noise is learnt.` : 'The detector is off.');
    onStatus(); // its deviations follow from the newest thresholds
  };
  const onStatus = () => {
    const contact = store.docs.status?.contact;
    if (!contact) return;
    const sigma = (store.state?.threshold ?? []).map((value, i) => `${JOINTS[i]} ${(value / contact.k).toFixed(3)}`).join(', ');
    setText(title, `Change of the external torques within ${Math.round(contact.window * 1000)} ms, Nm`);
    setText(learnt, `${contact.learnt ? 'Learnt' : 'Learning; leave the arm alone'}: ${contact.samples} samples at rest; standard deviations ${sigma} Nm; k ${contact.k}`);
  };
  onStatus();
  return { state: onState, docs: { status: onStatus } };
}

export function objectsPage(page) {
  page.className = 'page two';
  const message = h('p', { 'aria-live': 'polite' });
  const problems = h('ul', { id: 'object-problems' });
  const list = h('div');
  const entry = h('pre', { tabindex: '0', 'aria-label': 'Entry of the database' });
  page.append(
    h('div', {}, h('h2', {}, 'Object database'), problems, h('div', { class: 'row' }, commandButton('Read the files again', { name: 'objects_reload', message, held: true, request: () => ['objects_reload', {}] })), message, list,
      h('p', {}, 'A new object: ./coglab object new NAME, then ./coglab object check NAME. The console writes no object file.')),
    h('div', {}, h('h2', {}, 'Entry'), entry));
  const draw = () => {
    const { rows = [], asked = false, problems: words = [] } = store.docs.objects ?? {};
    const all = asked ? [['ok', `The database has checked its files: ${rows.length} objects, every file is valid.`]] : [['idle', 'The object database does not run, or was not read yet.']];
    problems.replaceChildren(...(words.length ? words.map((text) => ['warn', text]) : all).map(([level, text]) => h('li', { class: level === 'warn' ? 'warnrow' : '' }, mark(level), text)));
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
  const x = (t) => 8 + (t / end) * 428;
  const y = (value) => 140 - ((value - low) / (high - low)) * 128;
  [['x, m', '#0072b2', []], ['y, m', '#009e73', [8, 4]], ['z, m', '#cc79a7', [2, 3]], ['speed, m/s', '#1b1f24', [12, 3, 3, 3]]].forEach(([name, colour, dash], i) => {
    context.strokeStyle = colour;
    context.lineWidth = 2.5;
    context.setLineDash(dash);
    context.beginPath();
    for (const point of row.plot) context.lineTo(x(point[0]), y(point[i + 1]));
    context.moveTo(444, 18 + 20 * i);
    context.lineTo(462, 18 + 20 * i);
    context.stroke();
    context.fillStyle = '#1b1f24';
    context.font = '14px "DejaVu Sans", Verdana, sans-serif';
    context.fillText(name, 466, 23 + 20 * i);
  });
  context.fillText(`0 … ${end.toFixed(2)} s`, 444, 120);
  return canvas;
}

export function primitivesPage(page) {
  page.className = 'page two';
  const list = h('div');
  const bars = h('div');
  const verdict = h('p');
  const answer = h('p', { 'aria-live': 'polite' });
  const preview = (name, words) => commandButton(words, { name: 'preview', message: answer, words: name ? `${words} of ${name}` : words, request: () => ['preview', { primitive: name }] });
  page.append(h('div', {}, h('h2', {}, 'Primitives, as demonstrated'),
    h('p', {}, 'Preview: the cell shows the path that the arm would take with this primitive toward the goal of the next action. Nothing moves.'), h('div', { class: 'row' }, preview('', 'No preview')), answer, list), h('div', {}, h('h2', {}, 'Recognised reach of the person'), verdict, bars));
  const draw = () => {
    const { rows = [], problem = '', file = '' } = store.docs.primitives ?? {};
    list.replaceChildren(h('p', {}, problem || file || 'The library has not been read yet.'), ...rows.flatMap((row) => [h('h3', {}, `${row.name}, ${row.duration} s, ${row.basis} basis functions, ${row.mapping}`), h('p', {}, row.description), plot(row), h('div', { class: 'row' }, preview(row.name, 'Preview'))]));
  };
  const recognise = () => {
    const seen = store.docs.recognition;
    const age = seen && store.state ? `, ${Math.max(0, store.state.stamp - seen.stamp).toFixed(0)} s ago` : '';
    setText(verdict, seen ? `${seen.decided ? 'Decided' : 'Not decided'}: ${seen.pattern}, ${Math.round(seen.progress * 100)} % of the reach seen${age}` : 'No recognition yet: the recogniser publishes when the person’s hand moves.');
    bars.replaceChildren(...(seen?.rows ?? []).map(([name, share]) => {
      const fill = h('i');
      fill.style.width = `${100 * share}%`;
      return h('div', { class: 'bar' }, h('span', {}, name), h('span', {}, fill), h('span', {}, share.toFixed(2)));
    }));
  };
  draw();
  recognise();
  let shownSecond = 0;
  const onState = (state) => {
    if (Math.floor(state.stamp) !== shownSecond) recognise(); // its age, once a second
    shownSecond = Math.floor(state.stamp);
  };
  return { state: onState, docs: { primitives: draw, recognition: recognise } };
}

export function feedbackPage(page) {
  page.className = 'page';
  const message = h('p', { 'aria-live': 'polite' });
  const list = h('div');
  const shares = h('div');
  page.append(h('h2', {}, 'Feedback controllers in execution order'), message, list, h('h2', {}, 'Corrections in the newest cycle'), shares);
  // Rows are rebuilt only if they change, because a button that is held down must stay.
  let made = '';
  let shown = [];
  const why = h('p', { id: 'feedback-why' });
  const heldButton = (label, words, request) => commandButton(label, { name: 'feedback', message, held: true, words, why, request });
  const verbs = (row) => [row.enabled ? 'disable' : 'enable', row.paused ? 'resume' : 'pause'].map((verb) => heldButton(verb, `${verb} ${row.name}`, () => ['feedback', { verb, name: row.name }]));
  const order = (rows, i, step) => {
    const names = rows.map((row) => row.name);
    if (!names[i + step]) return null;
    [names[i], names[i + step]] = [names[i + step], names[i]];
    return heldButton(step < 0 ? '↑' : '↓', `${rows[i].name} ${step < 0 ? 'earlier' : 'later'}`, () => ['feedback_order', { names }]);
  };
  const make = (rows) => {
    shown = rows.map(() => ({ activity: h('span'), why: h('span'), faults: h('span') }));
    const cells = rows.map((row, i) => [i + 1, row.name, row.stage, shown[i].activity, shown[i].why, shown[i].faults, h('div', { class: 'row' }, ...verbs(row)), h('div', { class: 'row' }, order(rows, i, -1), order(rows, i, 1))]);
    list.replaceChildren(h('p', { id: 'feedback-profile' }), why, table(['', 'Name', 'Stage', 'Activity', 'Paused because', 'Faults / overruns', 'Hold to change', 'Hold to order'], cells, 'Feedback controllers'));
  };
  const draw = () => {
    const { rows = [], profile = '' } = store.docs.feedback ?? {};
    const key = JSON.stringify(rows.map((row) => [row.name, row.stage, row.enabled, row.paused]));
    if (key !== made) make(rows);
    made = key;
    const silence = store.state?.silent.controllers;
    const since = silence === undefined ? '' : `; silent for ${silence.toFixed(1)} s: the values shown are as old`;
    setText(document.getElementById('feedback-profile') ?? message, rows.length ? `Profile: ${profile || 'none'}${since}` : 'No feedback controllers are loaded.');
    rows.forEach((row, i) => {
      setText(shown[i].activity, row.activity + (row.waiting ? ` ${row.waiting}` : ''));
      setText(shown[i].why, [...row.reasons, row.fault && `fault: ${row.fault}`].filter(Boolean).join('; ') || '·');
      setText(shown[i].faults, `${row.faults} / ${row.overruns}`);
    });
  };
  const attribute = () => {
    const { rows = [], inside = [] } = store.docs.attribution ?? {};
    shares.replaceChildren(
      rows.length ? table(['Controller', 'Reference', 'Changed by', 'Turned by, rad'], rows.map((row) => [row.controller, row.signal, row.size, row.angle]), 'Corrections') : h('p', {}, 'No controller changed a reference.'),
      ...inside.map((one) => h('p', {}, `${one.controller}: ${one.values.map(([name, value, unit]) => `${name} ${value} ${unit}`).join(', ')}`)));
  };
  draw();
  attribute();
  return { state: draw, docs: { feedback: draw, attribution: attribute } };
}
