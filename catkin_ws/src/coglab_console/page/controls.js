// Buttons and lists: they show the reason if disabled, need holding where required, and stay within the page.
import { h, setAttribute, setText } from './dom.js';
import { command, on, onDocs, operating, send, store } from './link.js';

const HOLD_PERIOD = 100; // ms
const watched = new Map(); // control -> { update, seen }
let made = 0;

/** Reason of the server why this browser cannot use a control now; empty if it can. */
export function blocked(name) {
  const desk = store.docs.desk;
  if (store.lost) return 'not live';
  if (!desk) return 'not connected yet';
  if (!operating()) return `${desk.roles.operator || 'nobody'} operates; press Take over`;
  return desk.reasons[name] ?? '';
}

/** Calls `update` now and whenever a reason may have changed, until the control leaves the page. */
export function watch(control, update) {
  watched.set(control, { update, seen: false });
  update();
}

function updateAll() {
  for (const [control, one] of watched) {
    one.seen ||= control.isConnected;
    if (one.seen && !control.isConnected) watched.delete(control);
    else one.update();
  }
}

on('link', updateAll);
onDocs(['desk'], updateAll);

/** Shows for 6 s, above the actions, why something was not done. */
export function refuse(text) {
  const refusal = document.getElementById('refusal');
  refusal.textContent = text;
  refusal.hidden = false;
  clearTimeout(refuse.timer);
  refuse.timer = setTimeout(() => {
    refusal.hidden = true;
  }, 6000);
}

/** Sends ten times a second that a button is down, from `hold()` until the server answers or until `release()`. */
function holding(button, { request, showMessage }) {
  let timer = null;
  const release = () => {
    if (timer === null) return;
    clearInterval(timer);
    timer = null;
    button.classList.remove('holding');
    send({ t: 'release' });
  };
  const hold = () => {
    const [name, args] = request();
    const once = () => send({ t: 'hold', name, arguments: args }, (answer) => {
      showMessage(answer.message);
      if (!answer.success) refuse(answer.message);
      release();
    });
    showMessage('hold …');
    button.classList.add('holding');
    timer = setInterval(once, HOLD_PERIOD);
    once();
  };
  return { hold, release };
}

/**
 * A button that acts when pressed, or, if `mustHold()`, after it was held for 0.8 s. Enter works like the mouse.
 * Release, loss of the focus, or a hidden page ends the holding.
 */
export function actionButton(label, { blockedBy, mustHold, request, showMessage, answered = () => {} }) {
  const button = h('button', { type: 'button' }, label, h('span', { class: 'fill' }));
  const { hold, release } = holding(button, { request, showMessage });
  let held = false; // the click event at the end of a holding does not count
  const begin = (event) => {
    held = !blockedBy() && mustHold();
    if (held) {
      hold();
      if (event.type === 'keydown') event.preventDefault();
    }
  };
  button.addEventListener('pointerdown', (event) => {
    if (event.button !== 0) return;
    if (button.hasPointerCapture(event.pointerId)) button.releasePointerCapture(event.pointerId); // so that a finger that slides off causes pointerleave
    begin(event);
  });
  button.addEventListener('contextmenu', (event) => event.preventDefault()); // menu after a long touch
  for (const name of ['pointerup', 'pointerleave', 'pointercancel', 'blur']) button.addEventListener(name, release);
  document.addEventListener('visibilitychange', release);
  button.addEventListener('keydown', (event) => {
    if (event.key !== 'Enter') return;
    if (event.repeat) event.preventDefault();
    else begin(event);
  });
  button.addEventListener('keyup', (event) => {
    if (event.key !== 'Enter') return;
    release();
    held = false;
  });
  button.addEventListener('click', async () => {
    const reason = held ? '' : blockedBy();
    if (reason) {
      showMessage(reason);
      refuse(`${label}: ${reason}`);
    } else if (held) held = false;
    else if (!mustHold()) {
      const answer = await command(...request());
      showMessage(answer.message);
      answered(answer);
      if (!answer.success) refuse(answer.message);
    }
  });
  return button;
}

/**
 * A button for a command; if disabled, the reason stands below it. { name (of the control in the server's reasons), request,
 * message (element for the answer), answered (callback for it), held (0.8 s), words (accessible name), why (reason element shared by several buttons) }.
 */
export function commandButton(label, { name, request, message, answered, held = false, words = null, why = null }) {
  const showMessage = (text) => setText(message, text);
  const button = actionButton(label, { blockedBy: () => blocked(name), mustHold: () => held, request, showMessage, answered });
  const reason = why ?? h('span', { class: 'why' });
  reason.id ||= `why-control-${made++}`;
  setAttribute(button, 'aria-describedby', reason.id);
  if (words) setAttribute(button, 'aria-label', words);
  watch(button, () => {
    const now = blocked(name);
    setAttribute(button, 'aria-disabled', now ? 'true' : null);
    setText(reason, now || (held && !why ? 'press and hold' : ''));
  });
  return why ? button : h('span', { class: 'control' }, button, reason);
}

const STEPS = { ArrowDown: 1, ArrowUp: -1 };
const LINE = 44; // px, height of a list line: wide enough for a finger
const EDGE = 8; // px between a list and the border of the window or the footer with STOP

/** Places the list below the button if it fits above the footer, otherwise on the side with more room. */
function place(list, button) {
  const box = button.getBoundingClientRect();
  const below = document.getElementById('foot').getBoundingClientRect().top - box.bottom - EDGE;
  const above = box.top - EDGE;
  const up = below < list.childElementCount * LINE && above > below;
  list.style.maxHeight = `${up ? above : below}px`;
  list.style.minWidth = `${box.width}px`;
  list.style.left = `${Math.max(0, Math.min(box.left, innerWidth - list.offsetWidth - EDGE))}px`;
  list.style.top = `${up ? box.top - list.offsetHeight : box.bottom}px`;
}

function onKey(event, isOpen, { open, close, step, take }) {
  if (STEPS[event.key]) {
    event.preventDefault();
    if (isOpen) step(STEPS[event.key]);
    else open();
  } else if (isOpen && event.key === 'Enter') {
    event.preventDefault(); // otherwise the button would be clicked, too
    take();
  } else if (event.key === 'Escape') close();
}

/**
 * A button with a list: { button, offer(pairs of value and words), show(value) }. `button.value` is the choice; a new choice
 * causes the event `change`. Arrows move in the open list, Enter chooses, Escape or loss of the focus closes it. If
 * `blockedBy()` returns a reason, the list stays closed and `refused` gets the reason.
 */
export function choice({ blockedBy = () => '', refused = () => {}, ...attributes }) {
  const id = `choice-${made++}`;
  const list = h('ul', { id, role: 'listbox', popover: 'manual', class: 'choice' });
  const words = h('span');
  const button = h('button', { type: 'button', role: 'combobox', class: 'choice', 'aria-haspopup': 'listbox', 'aria-controls': id, 'aria-expanded': 'false', ...attributes }, words, h('span', { 'aria-hidden': 'true' }, '▾'));
  let offered = [];
  let at = 0; // the line that Enter takes

  const point = (to) => {
    at = Math.max(0, Math.min(offered.length - 1, to));
    [...list.children].forEach((line, i) => line.classList.toggle('at', i === at));
    setAttribute(button, 'aria-activedescendant', list.children[at]?.id ?? null);
    list.children[at]?.scrollIntoView({ block: 'nearest' });
  };
  const elsewhere = (event) => {
    if (!button.contains(event.target) && !list.contains(event.target)) close();
  };
  const close = () => {
    document.removeEventListener('pointerdown', elsewhere, true);
    list.remove();
    setAttribute(button, 'aria-expanded', 'false');
    setAttribute(button, 'aria-activedescendant', null);
  };
  const open = () => {
    if (blockedBy()) return void refused(blockedBy());
    document.body.append(list);
    list.showPopover();
    place(list, button);
    setAttribute(button, 'aria-expanded', 'true');
    point(offered.findIndex(([value]) => value === button.value));
    document.addEventListener('pointerdown', elsewhere, true);
  };
  const show = (value) => {
    button.value = value;
    setText(words, offered.find(([one]) => one === value)?.[1] ?? value);
    [...list.children].forEach((line, i) => setAttribute(line, 'aria-selected', String(offered[i][0] === value)));
  };
  const take = (i) => {
    close();
    if (!offered[i] || offered[i][0] === button.value) return;
    show(offered[i][0]);
    button.dispatchEvent(new Event('change'));
  };
  const offer = (pairs) => {
    if (JSON.stringify(pairs) === JSON.stringify(offered)) return;
    close();
    offered = pairs;
    list.replaceChildren(...pairs.map(([, text], i) => h('li', { id: `${id}-${i}`, role: 'option', onclick: () => take(i) }, text)));
    show(button.value);
  };
  button.addEventListener('click', () => (list.isConnected ? close() : open()));
  button.addEventListener('keydown', (event) => onKey(event, list.isConnected, { open, close, step: (by) => point(at + by), take: () => take(at) }));
  button.addEventListener('blur', close);
  list.addEventListener('pointerdown', (event) => event.preventDefault()); // the button keeps the focus
  list.addEventListener('mousedown', (event) => event.preventDefault());
  return { button, offer, show };
}
