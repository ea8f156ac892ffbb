// The status column on the left, and the events: three lines in the footer, and the page Events.
import { h, mark, more, paced, setText } from './dom.js';
import { on, onDocs, store } from './link.js';
import { ageWords } from './cell.js';

const LEVELS = { info: 'idle', warning: 'warn', fault: 'fault' };

export function clock(stamp) {
  return new Date(stamp * 1000).toLocaleTimeString('en-GB');
}

function line(event) {
  return h('li', { class: event.level === 'fault' ? 'faultrow' : '' }, mark(LEVELS[event.level]), `${clock(event.stamp)} ${event.source}: ${event.text}${event.phase ? ` [${event.phase}]` : ''}`);
}

export function showLog(list) {
  more(list.parentElement, list);
  on('events', paced(() => list.replaceChildren(...store.events.slice(-3).reverse().map(line)), 150));
}

export function eventsPage(page) {
  page.className = 'page';
  const list = h('ol', { reversed: true, tabindex: '0', 'aria-label': 'All events, newest first' });
  page.append(h('h2', {}, 'Events, newest first'), list);
  const draw = paced(() => list.isConnected && list.replaceChildren(...store.events.slice(-300).reverse().map(line)), 300);
  draw();
  return { events: draw };
}

const NOW = ['Phase', 'Waits']; // above everything else
const ROWS = ['FRI', 'Arm', 'Motion', 'Hand', 'Person', 'Object', 'Contact', 'Why', 'Last'];
const LONG = ['Why', 'Last'];
const MOST_LINES = 6;
const OLD = 0.5; // s, age of a perceived frame from which it is marked
const UNKNOWN = ['fault', 'not known, the brain is silent'];
const RECENT = 5; // s, time for which a recognised reach is shown
const MODES = { POSITION: 'position control', CART_IMP: 'Cartesian impedance', JNT_IMP: 'joint impedance', OTHER: 'another control' };
const CONTROLLERS = { dmp: 'reach', ptp: 'to a posture' };
const MOTIONS = { idle: 'at rest', running: 'under way', holding: 'waits where it is', fault: 'fault' };
const CONTACTS = { contact: 'a touch', load: 'the weight', release: 'the person letting go' };

/** Row of a source that is missing or silent; null if it sends. `who`: its name at the start of a sentence. */
function missing(source, alive, who) {
  if (!alive) return ['fault', `${who} is not there`];
  const silence = store.state?.silent[source];
  return silence === undefined ? null : ['fault', `${who} has been silent for ${silence.toFixed(1)} s`];
}

function fri({ alive, fri: state, quality, cycle, reason }) {
  const gone = missing('arm', alive, 'the arm’s program');
  if (gone) return gone;
  const level = { PERFECT: 'ok', OK: 'ok', BAD: 'warn' }[quality] ?? 'fault';
  const latency = store.state?.fri;
  const more = latency === null || latency === undefined ? '' : `, late by ${latency.toFixed(1)} ms`;
  return [level, `${state || 'OFF'} ${quality || reason || 'no datagrams'}, ${(cycle * 1000).toFixed(0)} ms${more}`];
}

function arm({ alive, supervisor, words: does, allowed, held, mode, power }) {
  if (missing('arm', alive, '')) return ['fault', 'not known, the arm is silent'];
  const words = `${does}, ${MODES[mode] ?? mode}${power ? '' : ', not all drives on'}`;
  return [held || !power || ['stopped', 'disconnected'].includes(supervisor) ? 'fault' : allowed ? 'ok' : 'warn', words];
}

function motion({ alive, state, active, scale, reason }) {
  const gone = missing('controllers', alive, 'the motion control');
  if (gone) return gone;
  const dmp = store.state?.dmp ?? ['idle'];
  const going = dmp[0] === 'running' ? `, ${(dmp[2] * 100).toFixed(0)} cm and ${dmp[3].toFixed(1)} s to go` : '';
  const words = `${CONTROLLERS[active] ?? (active || 'none')} ${MOTIONS[state] ?? state}, ${Math.round(scale * 100)} %${going}${reason ? `: ${reason}` : ''}`;
  return [state === 'fault' ? 'fault' : state === 'running' ? 'ok' : 'idle', words];
}

function hand({ alive, connected, calibrated, calibrating, holding, motors, message }) {
  const gone = missing('hand', alive, 'the hand’s program');
  if (gone) return gone;
  if (!connected) return ['fault', message || 'does not answer'];
  if (calibrating) return ['idle', 'calibrates'];
  if (!calibrated) return ['warn', 'not calibrated'];
  return ['ok', `ready, ${motors}/5 motors, ${holding ? 'holds' : 'empty'}`];
}

function person() {
  const age = store.state?.ages.hand;
  const recognised = store.docs.recognition;
  const since = recognised ? Math.max(0, (store.state?.stamp ?? 0) - recognised.stamp) : Infinity;
  const reach = recognised?.decided && since < RECENT ? `, reaches ${recognised.pattern} (${since.toFixed(1)} s ago)` : '';
  return [age === undefined ? 'idle' : age < OLD ? 'ok' : 'warn', `hand ${ageWords('hand')}${reach}`];
}

function object({ alive, object: id, fallback }) {
  if (missing('brain', alive, '')) return UNKNOWN;
  const next = store.docs.desk?.object || fallback;
  const seen = store.state?.ages.object;
  const words = id ? `${id} in the hand${next && next !== id ? `, ${next} next` : ''}` : next ? `${next} next, ${ageWords('object')}` : 'none';
  return [id || (seen !== undefined && seen < OLD) ? 'ok' : 'idle', words];
}

function contact() {
  const margin = store.state?.margin;
  const { words, state, mode, stamp } = store.docs.status.contact;
  const silence = store.state?.silent.contact;
  if (silence !== undefined) return ['warn', `silent for ${silence.toFixed(1)} s: no detector, or no torques`];
  if (!store.docs.status.contact.alive) return ['warn', 'no detector, or no torques'];
  if (state === 'waiting') return ['idle', `armed for ${CONTACTS[mode] ?? mode}, until the arm is still`];
  if (margin === null || margin === undefined) return ['idle', `not armed${words ? `; last: ${words}, ${Math.max(0, (store.state?.stamp ?? 0) - stamp).toFixed(0)} s ago` : ''}`];
  return ['ok', `armed, margin ${margin.toFixed(2)} of 1`];
}

function phase({ alive, hub, words }, stood) {
  return missing('brain', alive, 'the brain') ?? [stood ? 'fault' : hub ? 'ok' : 'idle', store.state?.words || words];
}

/** What the brain waits for, and the time left, as the brain publishes them. */
function waiting({ alive }) {
  const { since = 0, left = null, waits = '' } = store.state ?? {};
  if (missing('brain', alive, '')) return UNKNOWN;
  if (!waits) return ['idle', `for nothing with a limit; ${since.toFixed(1)} s in this phase`];
  return [left !== null && left < 1 ? 'warn' : 'idle', `${waits}; ${left === null ? 'without a limit' : `${left.toFixed(1)} s left`}`];
}

function why(machine, a, stood) {
  if (missing('brain', machine.alive, '')) return UNKNOWN;
  if (machine.why) return [stood ? 'fault' : 'warn', machine.why];
  return a.reason ? ['warn', a.reason] : ['idle', 'nothing has failed'];
}

function rows() {
  const { machine, arm: a, hand: g, manager } = store.docs.status;
  const last = store.events[store.events.length - 1];
  const stood = machine.state.endsWith('/fault') || machine.state.endsWith('/stopped');
  return {
    Phase: phase(machine, stood),
    Waits: waiting(machine),
    FRI: fri(a),
    Arm: arm(a),
    Motion: motion(manager),
    Hand: hand(g),
    Person: person(),
    Object: object(machine),
    Contact: contact(),
    Why: why(machine, a, stood),
    Last: last ? [LEVELS[last.level], `${clock(last.stamp)} ${last.text}`] : ['idle', 'nothing yet'],
  };
}

/** The rows by name, each with its elements: { cell, all (mark and words), words, level }. */
function makeRows(names, list) {
  const cells = {};
  for (const name of names) {
    const words = h('span', { 'aria-live': name === 'Phase' ? 'polite' : null });
    const all = h('span', {}, mark('idle'), words);
    const cell = more(h('dd', { class: LONG.includes(name) ? `long ${name.toLowerCase()}` : name.toLowerCase() }, all), all);
    cells[name] = { cell, all, words, level: 'idle' };
    list.append(h('dt', {}, name), cell);
  }
  return cells;
}

export function showStatus(parent, now) {
  const list = h('dl');
  const above = h('dl');
  const cells = { ...makeRows(NOW, above), ...makeRows(ROWS, list) };
  now.append(above);
  parent.append(list);
  const update = paced(() => {
    if (!store.docs.status || parent.offsetParent === null) return;
    let changed = false;
    for (const [name, [level, text]] of Object.entries(rows())) {
      const row = cells[name];
      changed ||= row.words.textContent !== text;
      setText(row.words, text);
      if (row.level === level) continue;
      row.level = level;
      row.all.firstChild.replaceWith(mark(level));
      row.cell.classList.toggle('warnrow', level === 'warn');
      row.cell.classList.toggle('faultrow', level === 'fault');
    }
    if (changed) fit(parent, list);
  }, 100);
  // The column may get smaller without new text: by a reason below a button, or by another window size.
  new ResizeObserver(() => fit(parent, list)).observe(parent);
  on('state', update);
  on('events', update);
  onDocs(['status', 'desk', 'recognition'], update);
}

/** Gives long rows as many lines as fit. With two lines each, all rows always fit. */
function fit(parent, list) {
  list.classList.remove('tight');
  for (let lines = MOST_LINES; lines >= 2; lines -= 1) {
    list.style.setProperty('--long', lines);
    if (parent.scrollHeight <= parent.clientHeight) return;
  }
  list.classList.add('tight');
}
