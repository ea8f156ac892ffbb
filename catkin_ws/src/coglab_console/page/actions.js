// STOP, and the buttons that set something going; why one is disabled stands below it.
import { h, setAttribute, setText } from './dom.js';
import { on, onDocs, operating, store } from './store.js';
import { command, send, stop } from './link.js';
import { choice } from './choice.js';

const HOLD_PERIOD = 100; // ms
const BUTTONS = [
  ['initialise', 'Initialise'],
  ['calibrate', 'Calibrate hand'],
  ['home', 'Home'],
  ['exchange_human_to_robot', 'Receive'],
  ['exchange_robot_to_human', 'Give'],
  ['take', 'Take'],
  ['put', 'Put'],
  ['reset', 'Go on (reset)'],
];

/** Space everywhere, Ctrl+Space where one types: on the way down, before anything else sees the key. */
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
      if (!answer.success) refuse(`STOP has not been taken: ${answer.message}. If the arm moves, use the red button of the robot controller.`);
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
    if (isStop(event)) event.preventDefault(); // or the button in focus would be clicked, too
  }, true);
  button.addEventListener('pointerdown', press);
  button.addEventListener('click', (event) => {
    if (event.detail === 0) press(); // by a screen reader
  });
}

function blocked(name) {
  const desk = store.docs.desk;
  if (store.lost) return 'not live';
  if (!desk) return 'not connected yet';
  if (!operating()) return `${desk.roles.operator || 'nobody'} operates`;
  return desk.reasons[name];
}

function argumentsOf(name) {
  if (name === 'calibrate') return ['calibrate', { mode: 'fast' }];
  if (name === 'home') return ['home', {}];
  return ['start', { action: name }];
}

/** Says above the actions, for some seconds, why something was not done. */
export function refuse(text) {
  const told = document.getElementById('told');
  told.textContent = text;
  told.hidden = false;
  clearTimeout(refuse.timer);
  refuse.timer = setTimeout(() => {
    told.hidden = true;
  }, 6000);
}

/**
 * A button that acts when pressed, or after 0.8 s of holding where `mustHold()`; Enter is as good as the mouse.
 * Letting go, losing the focus or the page ends the holding.
 */
export function actionButton(label, { blockedBy, mustHold, request, tell }) {
  const button = h('button', { type: 'button' }, label, h('span', { class: 'fill' }));
  let timer = null;
  let held = false; // the click that ends a holding is none
  const release = () => {
    if (timer === null) return;
    clearInterval(timer);
    timer = null;
    button.classList.remove('holding');
    send({ t: 'release' });
  };
  const hold = () => {
    held = true;
    const [name, args] = request();
    const once = () => send({ t: 'hold', name, arguments: args }, (answer) => {
      tell(answer.message);
      if (!answer.success) refuse(`${label}: ${answer.message}`);
      release();
    });
    tell('hold …');
    button.classList.add('holding');
    timer = setInterval(once, HOLD_PERIOD);
    once();
  };
  const begin = (event) => {
    held = false;
    if (!blockedBy() && mustHold()) {
      hold();
      if (event.type === 'keydown') event.preventDefault();
    }
  };
  button.addEventListener('pointerdown', (event) => {
    if (event.button !== 0) return;
    if (button.hasPointerCapture(event.pointerId)) button.releasePointerCapture(event.pointerId); // a finger that slides away leaves, too
    begin(event);
  });
  button.addEventListener('contextmenu', (event) => event.preventDefault()); // that of a long touch
  for (const name of ['pointerup', 'pointerleave', 'pointercancel', 'blur']) button.addEventListener(name, release);
  document.addEventListener('visibilitychange', release);
  button.addEventListener('keydown', (event) => {
    if (event.key !== 'Enter') return;
    if (event.repeat) event.preventDefault();
    else begin(event);
  });
  button.addEventListener('keyup', (event) => event.key === 'Enter' && release());
  button.addEventListener('click', async () => {
    const reason = blockedBy();
    if (reason) {
      tell(reason);
      refuse(`${label}: ${reason}`);
    } else if (!held && !mustHold()) {
      const answer = await command(...request());
      tell(answer.message);
      if (!answer.success) refuse(`${label}: ${answer.message}`);
    }
  });
  return button;
}

/** Sends a choice. One that is refused is taken back by `show`, and why is said. */
async function choose(label, name, args, show) {
  const answer = await command(name, args);
  if (answer.success) return;
  refuse(`${label}: ${answer.message}`);
  show();
}

function objectChoice() {
  const list = choice({ id: 'object', onchange: () => choose('Object', 'select_object', { object_id: list.button.value }, show) });
  const show = () => list.show(store.docs.desk?.object ?? '');
  onDocs(['objects', 'desk'], () => {
    list.offer(['', ...(store.docs.objects?.rows ?? []).map((row) => row.id)].map((id) => [id, id || '(default)']));
    show();
  });
  return list.button;
}

function speedChoice() {
  const show = () => {
    input.value = Math.round((store.docs.status?.manager.scale ?? 1) * 100);
    setAttribute(input, 'aria-valuetext', `${input.value} %`);
  };
  const input = h('input', { id: 'speed', type: 'range', min: 0, max: 100, step: 5,
    oninput: () => setAttribute(input, 'aria-valuetext', `${input.value} %`),
    onchange: () => choose('Speed', 'speed_scale', { value: Number(input.value) / 100 }, show) });
  onDocs(['status'], () => {
    if (document.activeElement !== input) show();
  });
  return input;
}

export function showActions(parent) {
  const rows = BUTTONS.map(([name, label], i) => {
    const why = h('span', { class: 'why', id: `why-${name}` });
    let told = '';
    const tell = (text) => {
      told = text;
      setText(why, text);
      setTimeout(() => {
        told = '';
        update();
      }, 4000);
    };
    const button = actionButton(`${i + 1} ${label}`, {
      blockedBy: () => blocked(name),
      mustHold: () => store.docs.desk?.guard.hold ?? true,
      request: () => argumentsOf(name),
      tell,
    });
    setAttribute(button, 'aria-describedby', why.id);
    button.dataset.action = name;
    const update = () => {
      const reason = blocked(name);
      setAttribute(button, 'aria-disabled', reason ? 'true' : null);
      if (!told) setText(why, reason || (store.docs.desk?.guard.hold ? 'press and hold' : ''));
    };
    parent.append(h('div', { class: 'act' }, button, why));
    return { button, update };
  });
  parent.append(h('div', { class: 'side' }, h('label', {}, 'Object', objectChoice()), h('label', {}, 'Speed', speedChoice())));
  const update = () => rows.forEach((row) => row.update());
  on('link', update);
  onDocs(['desk'], update);
  return rows.map((row) => row.button);
}

/** The cause of a stop with its acknowledgement, above the log. */
export function showCause(place) {
  const words = h('span');
  const button = h('button', { type: 'button', id: 'acknowledge', onclick: async () => {
    const answer = await command('acknowledge', { stop: Number(button.value) });
    if (!answer.success) refuse(`Acknowledge: ${answer.message}`);
  } }, 'Acknowledge');
  place.append(words, button);
  onDocs(['desk'], () => {
    const guard = store.docs.desk?.guard;
    place.parentElement.classList.toggle('told', Boolean(guard?.unacknowledged));
    button.value = guard?.stop ?? 0; // the stop whose cause stands beside it
    setText(words, guard?.unacknowledged ? guard.cause : guard?.hold ? 'The next motion needs a held button.' : '');
    button.hidden = !guard?.unacknowledged || !operating();
    document.getElementById('stop-words').hidden = Boolean(guard?.unacknowledged);
  });
}
