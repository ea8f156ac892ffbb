// The column on the left: how everything stands, at a glance.
import { h, mark, paced, setText } from './dom.js';
import { on, onDocs, store } from './store.js';
import { ageWords } from './cell.js';

const ROWS = ['Phase', 'Waits', 'FRI', 'Arm', 'Motion', 'Hand', 'Person', 'Object', 'Contact', 'Why', 'Last'];
const OLD = 0.5; // s, sights of perception older than this deserve a mark

function fri({ alive, fri: state, quality, cycle, reason }) {
  if (!alive) return ['fault', 'the arm’s node is not there'];
  const level = { PERFECT: 'ok', OK: 'ok', BAD: 'warn' }[quality] ?? 'fault';
  const latency = store.state?.fri;
  const more = latency === null || latency === undefined ? '' : `, late by ${latency.toFixed(1)} ms`;
  return [level, `${state || 'OFF'} ${quality || reason || 'no datagrams'}, ${(cycle * 1000).toFixed(0)} ms${more}`];
}

function arm({ alive, supervisor, allowed, held, mode, power }) {
  if (!alive) return ['fault', 'unknown'];
  const words = `${supervisor}, ${mode.toLowerCase()}${power ? '' : ', not all drives on'}`;
  return [held || !power || ['stopped', 'disconnected'].includes(supervisor) ? 'fault' : allowed ? 'ok' : 'warn', words];
}

function motion({ alive, state, active, scale, reason }) {
  if (!alive) return ['fault', 'no controller manager'];
  const dmp = store.state?.dmp ?? ['idle'];
  const going = dmp[0] === 'running' ? `, ${(dmp[2] * 100).toFixed(0)} cm and ${dmp[3].toFixed(1)} s to go` : '';
  const words = `${active || 'none'} ${state}, ${Math.round(scale * 100)} %${going}${reason ? `: ${reason}` : ''}`;
  return [state === 'fault' ? 'fault' : state === 'running' ? 'ok' : 'idle', words];
}

function hand({ alive, connected, calibrated, calibrating, holding, motors, message }) {
  if (!alive || !connected) return ['fault', alive ? message || 'does not answer' : 'the hand’s node is not there'];
  if (calibrating) return ['warn', 'calibrates'];
  if (!calibrated) return ['warn', 'not calibrated'];
  return ['ok', `ready, ${motors}/5 motors, ${holding ? 'holds' : 'empty'}`];
}

function person() {
  const age = store.state?.ages.hand;
  const recognised = store.docs.recognition;
  const reach = recognised?.decided ? `, reaches ${recognised.pattern}` : '';
  return [age === undefined ? 'idle' : age < OLD ? 'ok' : 'warn', `hand ${ageWords('hand')}${reach}`];
}

function object() {
  const id = store.docs.status.machine.object;
  const next = store.docs.desk?.object || store.docs.status.machine.fallback;
  const seen = store.state?.ages.object;
  const words = id ? `${id} in the hand` : next ? `${next} next, ${ageWords('object')}` : 'none';
  return [id || (seen !== undefined && seen < OLD) ? 'ok' : 'idle', words];
}

function contact() {
  const margin = store.state?.margin;
  const { words, alive, state, mode } = store.docs.status.contact;
  if (!alive) return ['warn', 'no detector, or no torques'];
  if (state === 'waiting') return ['idle', `armed for ${mode}, until the arm is still`];
  if (margin === null || margin === undefined) return ['idle', `not armed${words ? `; last: ${words}` : ''}`];
  return [margin > 1 ? 'warn' : 'ok', `armed, margin ${margin.toFixed(2)} of 1`];
}

/** What the brain waits for and when it gives up, as it tells itself. */
function waiting({ waits }) {
  const { since = 0, left = null } = store.state ?? {};
  if (!waits) return ['idle', `${since.toFixed(1)} s, without a limit`];
  return [left !== null && left < 1 ? 'warn' : 'idle', `${waits}; ${left === null ? 'without a limit' : `${left.toFixed(1)} s left`}`];
}

function rows() {
  const { machine, arm: a, hand: g, manager } = store.docs.status;
  const last = store.events[store.events.length - 1];
  const stood = machine.state.endsWith('/fault') || machine.state.endsWith('/stopped');
  return {
    Phase: machine.alive ? [stood ? 'fault' : machine.hub ? 'ok' : 'idle', machine.words] : ['fault', 'the brain (/coglab) is not there'],
    Waits: waiting(machine),
    FRI: fri(a),
    Arm: arm(a),
    Motion: motion(manager),
    Hand: hand(g),
    Person: person(),
    Object: object(),
    Contact: contact(),
    Why: machine.why ? [stood ? 'fault' : 'warn', machine.why] : a.reason ? ['warn', a.reason] : ['idle', 'nothing has failed'],
    Last: last ? [{ info: 'idle', warning: 'warn', fault: 'fault' }[last.level], last.text] : ['idle', 'nothing yet'],
  };
}

export function showStatus(parent) {
  const cells = {};
  const list = h('dl');
  for (const name of ROWS) {
    const words = h('span');
    const cell = h('dd', { class: { Phase: 'phase', Waits: 'tall', Why: 'tall', Last: 'tall' }[name] ?? '' }, mark('idle'), words);
    cells[name] = { cell, words, level: 'idle' };
    list.append(h('dt', {}, name), cell);
  }
  parent.append(list);
  const update = paced(() => {
    if (!store.docs.status || parent.offsetParent === null) return;
    for (const [name, [level, text]] of Object.entries(rows())) {
      const row = cells[name];
      setText(row.words, text);
      if (row.level === level) continue;
      row.level = level;
      row.cell.firstChild.replaceWith(mark(level));
      row.cell.classList.toggle('warnrow', level === 'warn');
      row.cell.classList.toggle('faultrow', level === 'fault');
    }
  }, 100);
  on('state', update);
  on('events', update);
  onDocs(['status', 'desk', 'recognition'], update);
}
