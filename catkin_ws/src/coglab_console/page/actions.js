// STOP and the action buttons. Below a disabled button stands the reason.
import { h, setAttribute, setText } from './dom.js';
import { command, onDocs, stop, store } from './link.js';
import { actionButton, blocked, choice, refuse, watch } from './controls.js';

const BUTTONS = [
  ['initialise', 'Initialise'],
  ['calibrate', 'Calibrate hand'],
  ['home', 'Home'],
  ['exchange_human_to_robot', 'Receive'],
  ['exchange_robot_to_human', 'Give'],
  ['take', 'Take'],
  ['put', 'Put'],
  ['reset', 'Go on'],
];

/** True for Space, or Ctrl+Space in a text field. Used in the capture phase, before any other listener gets the key. */
function isStop(event) {
  if (event.code !== 'Space') return false;
  const typing = event.target.closest?.('textarea, input:not([type=range])');
  return !typing || event.ctrlKey;
}

export function armStop(button) {
  const press = () => {
    button.classList.add('pressed');
    setTimeout(() => button.classList.remove('pressed'), 300);
    stop().then((answer) => {
      if (!answer.success) refuse(`STOP was not executed: ${answer.message}. If the arm moves, use the red button of the robot controller.`);
    });
  };
  document.addEventListener('keydown', (event) => {
    if (isStop(event) || (event.target === button && event.key === 'Enter')) {
      event.preventDefault();
      event.stopImmediatePropagation();
      if (!event.repeat) press();
    }
  }, true);
  document.addEventListener('keyup', (event) => {
    if (isStop(event)) event.preventDefault(); // otherwise the focused button would be clicked, too
  }, true);
  button.addEventListener('pointerdown', press);
  button.addEventListener('click', (event) => {
    if (event.detail === 0) press(); // by a screen reader
  });
}

let delivery = ''; // how the object is given; empty: its default

function argumentsOf(name) {
  if (name === 'exchange_robot_to_human' && delivery) return ['start', { action: name, delivery }];
  if (name === 'calibrate') return ['calibrate', { mode: 'fast' }];
  if (name === 'home') return ['home', {}];
  return ['start', { action: name }];
}

/** Sends a choice. If it is refused, shows the reason, and `show` restores the old choice. */
async function choose(label, name, args, show) {
  const answer = await command(name, args);
  if (answer.success) return;
  refuse(`${label}: ${answer.message}`);
  show();
}

function objectChoice() {
  const list = choice({ id: 'object', 'aria-describedby': 'why-side', blockedBy: () => blocked('select_object'), refused: (why) => refuse(`Object: ${why}`),
    onchange: () => choose('Object', 'select_object', { object_id: list.button.value }, show) });
  const show = () => list.show(store.docs.desk?.object ?? '');
  onDocs(['objects', 'desk'], () => {
    list.offer(['', ...(store.docs.objects?.rows ?? []).map((row) => row.id)].map((id) => [id, id || '(default)']));
    show();
  });
  watch(list.button, () => setAttribute(list.button, 'aria-disabled', blocked('select_object') ? 'true' : null));
  return list.button;
}

/** List of the ways to deliver the object; hidden if there is only one. */
function deliveryChoice() {
  const list = choice({ id: 'delivery', 'aria-label': 'Delivery: how the object is given', hidden: true, onchange: () => {
    delivery = list.button.value;
  } });
  onDocs(['objects', 'desk', 'status'], () => {
    const id = store.docs.status?.machine.object || store.docs.desk?.object || store.docs.status?.machine.fallback;
    const ways = (store.docs.objects?.rows ?? []).find((row) => row.id === id)?.deliveries ?? [];
    if (!ways.includes(delivery)) delivery = '';
    list.offer(['', ...ways].map((way) => [way, way || '(as usual)']));
    list.show(delivery);
    list.button.hidden = ways.length < 2;
  });
  return list.button;
}

function speedChoice() {
  const show = () => {
    input.value = Math.round((store.docs.status?.manager.scale ?? 1) * 100);
    setAttribute(input, 'aria-valuetext', `${input.value} %`);
  };
  const input = h('input', { id: 'speed', type: 'range', min: 0, max: 100, step: 5, 'aria-describedby': 'why-side',
    oninput: () => setAttribute(input, 'aria-valuetext', `${input.value} %`),
    onchange: () => choose('Speed', 'speed_scale', { value: Number(input.value) / 100 }, show) });
  onDocs(['status'], () => {
    if (document.activeElement !== input) show();
  });
  watch(input, () => setAttribute(input, 'aria-disabled', blocked('speed_scale') ? 'true' : null));
  return input;
}

/** Reason why the object cannot be chosen or the speed cannot be changed: one line for both. */
function sideReason() {
  const words = h('span', { class: 'why', id: 'why-side' });
  watch(words, () => {
    const [object, speed] = [blocked('select_object'), blocked('speed_scale')];
    setText(words, (object || speed).split(';')[0]); // one short line
  });
  return words;
}

/** One action button. If it is disabled, the reason stands below it. */
function oneAction(name, label) {
  const why = h('span', { class: 'why', id: `why-${name}` });
  let message = '';
  const showMessage = (text) => {
    message = text;
    setText(why, text);
    setTimeout(() => {
      message = '';
      update();
    }, 4000);
  };
  const mustHold = () => store.docs.desk?.guard.hold ?? true;
  const button = actionButton(label, { blockedBy: () => blocked(name), mustHold, request: () => argumentsOf(name), showMessage });
  setAttribute(button, 'aria-describedby', why.id);
  button.dataset.action = name;
  const update = () => {
    const reason = blocked(name);
    setAttribute(button, 'aria-disabled', reason ? 'true' : null);
    if (!message) setText(why, reason || (mustHold() ? 'press and hold' : ''));
  };
  watch(button, update);
  return { button, row: h('div', { class: 'act' }, button, why) };
}

/** Buttons for the actions of a user's configuration that the state machine accepts now. */
function ownActions() {
  const place = h('div', { class: 'own', hidden: true });
  let shown = '';
  onDocs(['desk'], () => {
    const names = store.docs.desk?.own ?? [];
    if (names.join() === shown) return;
    shown = names.join();
    place.hidden = names.length === 0;
    place.replaceChildren(...names.map((name) => oneAction(name, name.replaceAll('_', ' ')).row));
  });
  return place;
}

export function showActions(parent) {
  const buttons = BUTTONS.map(([name, label], i) => {
    const { button, row } = oneAction(name, `${i + 1} ${label}`);
    parent.append(row);
    return button;
  });
  parent.append(h('div', { class: 'side' }, h('div', { class: 'pick' }, h('label', {}, 'Object', objectChoice()), deliveryChoice()), h('label', {}, 'Speed', speedChoice()), sideReason()), ownActions());
  return buttons;
}

/** The cause of a stop and the button to acknowledge it, above the log. */
export function showCause(place) {
  const words = h('span');
  const why = h('span', { id: 'why-acknowledge' });
  const acknowledge = async () => {
    const reason = blocked('acknowledge');
    const answer = reason ? { success: false, message: reason } : await command('acknowledge', { stop: Number(button.value) });
    if (!answer.success) refuse(`Acknowledge: ${answer.message}`);
  };
  const button = h('button', { type: 'button', id: 'acknowledge', 'aria-describedby': why.id, onclick: acknowledge }, 'Acknowledge');
  place.append(words, h('span', { class: 'answer' }, button, why));
  watch(button, () => {
    const guard = store.docs.desk?.guard;
    const reason = blocked('acknowledge');
    button.value = guard?.stop ?? 0; // number of the stop whose cause is shown
    setText(words, guard?.unacknowledged ? guard.cause : guard?.hold ? 'The next motion needs a held button.' : '');
    button.hidden = why.hidden = !guard?.unacknowledged;
    setAttribute(button, 'aria-disabled', reason ? 'true' : null);
    setText(why, reason);
    document.getElementById('stop-words').hidden = Boolean(guard?.unacknowledged);
  });
}
