// The pages Health (diagnostics tree, versions, parameters, browsers) and Help.
import { h, mark, setText, table } from './dom.js';
import { command, operating, store } from './link.js';
import { viewKind } from './view.js';
import { commandButton, watch } from './controls.js';

const LEVELS = [['ok', 'ok'], ['warn', 'warning'], ['fault', 'error'], ['idle', 'silent']];

/** Rows by the publishing node, whose name stands before the colon: Map of node to [row, name without the node]. */
function byNode(rows) {
  const nodes = new Map();
  for (const row of rows) {
    const [node, ...rest] = row.name.split(': ');
    nodes.set(node, [...(nodes.get(node) ?? []), [row, rest.join(': ') || node]]);
  }
  return nodes;
}

/** One line of the tree that can be opened: its element, and a function that shows level and words in it. */
function line(name, open, ...inside) {
  const words = h('span');
  const summary = h('summary', { 'data-name': name }, mark('idle'), words);
  const details = h('details', {}, summary, ...inside);
  details.open = open;
  let shown = 'idle';
  const show = (level, text) => {
    const [kind, word] = LEVELS[level] ?? LEVELS[2];
    if (kind !== shown) summary.firstChild.replaceWith(mark(kind));
    shown = kind;
    setText(words, text(word));
  };
  return { details, show };
}

/**
 * The diagnostics as a tree: a branch per node with the worst level of its leaves. Lines are rebuilt only if their names change,
 * because a line that is being pressed must stay. A rebuild keeps the opened lines and the focus.
 */
function diagnosticsTree(tree) {
  const turned = new Set(); // names of lines that differ from the default (branches open, leaves closed)
  let made = '';
  let shows = [];
  const item = (name, isOpen, ...inside) => {
    const one = line(name, isOpen !== turned.has(name), ...inside);
    one.details.addEventListener('toggle', () => (one.details.open === isOpen ? turned.delete(name) : turned.add(name)));
    return one;
  };
  const leafOf = (node, name) => {
    const values = h('div');
    const leaf = item(`${node}: ${name}`, false, values);
    const show = (row) => {
      leaf.show(row.level, (word) => `${name}: ${word}, ${row.message}`);
      values.replaceChildren(table(['Value', ''], row.values, row.name));
    };
    return { details: leaf.details, show };
  };
  const make = (nodes) => {
    const focused = document.activeElement?.dataset?.name;
    const branches = [...nodes].map(([node, rows]) => {
      const leaves = rows.map(([, name]) => leafOf(node, name));
      const branch = item(node, true, ...leaves.map((leaf) => leaf.details));
      const show = (now) => {
        branch.show(Math.max(...now.map(([row]) => row.level)), (word) => `${node}: ${word}`);
        leaves.forEach((leaf, i) => leaf.show(now[i][0]));
      };
      return { details: branch.details, show };
    });
    tree.replaceChildren(...branches.map((branch) => branch.details));
    if (focused) [...tree.querySelectorAll('summary')].find((one) => one.dataset.name === focused)?.focus();
    shows = branches.map((branch) => branch.show);
  };
  return (rows) => {
    const nodes = byNode(rows);
    const names = JSON.stringify(rows.map((row) => row.name));
    if (names !== made) make(nodes);
    made = names;
    [...nodes.values()].forEach((now, i) => shows[i](now));
  };
}

export function healthPage(page) {
  page.className = 'page two';
  const tree = h('div', { id: 'diagnostics' });
  const drawTree = diagnosticsTree(tree);
  const versions = h('div');
  const parameters = h('div', { id: 'parameters' });
  const message = h('p', { 'aria-live': 'polite' });
  const filter = h('input', { type: 'search', placeholder: 'part of a name', oninput: () => show() });
  let known = [];
  const show = () => parameters.replaceChildren(table(['Parameter', 'Value'], known.filter(([name]) => name.includes(filter.value)).slice(0, 150), 'Parameters'));
  const read = h('button', { type: 'button', onclick: async () => {
    const answer = await command('parameters');
    known = answer.data ?? [];
    setText(marked, answer.message);
    show();
  } }, 'Read again');
  const marked = h('p');
  page.append(h('div', {}, h('h2', {}, 'Diagnostics'), tree),
    h('div', {}, h('h2', {}, 'Versions and browsers'), versions, h('h2', {}, 'Hand'), h('p', {}, 'A complete or forced calibration opens the hand, even if it holds an object: hold the button.'), h('div', { class: 'row' }, commandButton('Complete calibration', { name: 'calibrate_complete', message, held: true, request: () => ['calibrate', { mode: 'complete' }] }), commandButton('Forced calibration', { name: 'calibrate_forced', message, held: true, request: () => ['calibrate', { mode: 'complete', force: true }] })), message,
      h('h2', {}, 'Parameters'), marked, h('div', { class: 'row' }, read, h('label', {}, 'Filter', filter)), parameters));
  const draw = () => {
    const { rows = [], versions: words = {}, browsers = [] } = store.docs.health ?? {};
    drawTree(rows);
    const more = [['view', viewKind()], ['browsers', browsers.map((one) => `${one.name}${one.name === store.you ? ' (you)' : ''}`).join(', ')]];
    versions.replaceChildren(table(['', ''], [...Object.entries(words), ...more], 'Versions'));
  };
  draw();
  read.click();
  return { docs: { health: draw } };
}

const KEYS = [
  ['Space', 'STOP, everywhere; in a text field Ctrl+Space'], ['1 … 8', 'to an action; Enter triggers it; hold Enter if a held button is required'],
  ['O', 'to the list of objects; ↑ ↓ open it and go through it, Enter takes, Escape leaves it'], ['M', 'to a new note'], ['?', 'this page'], ['Tab, Shift+Tab', 'through everything'], ['← →', 'between pages, with the focus on one'],
];

export function helpPage(page) {
  page.className = 'page two';
  const message = h('p', { 'aria-live': 'polite' });
  const link = h('input', { type: 'text', readonly: true, 'aria-label': 'Link for one more browser' });
  const answered = (answer) => {
    link.value = answer.data ?? '';
  };
  const invite = commandButton('A link for one more browser', { name: 'invite', message, request: () => ['invite', {}], answered });
  page.append(
    h('div', {}, h('h2', {}, 'Keys'), table(['Key', 'Does'], KEYS, 'Keys'),
      h('h2', {}, 'After a stop'), h('p', {}, 'STOP brakes the arm, latches, and ends the action; the hand keeps what it holds. Then two acts: acknowledge the cause, and hold the button of the next motion for 0.8 s. Nothing is ever reset by itself.'),
      h('h2', {}, 'What this is not'), h('p', {}, 'STOP MOTION is software. It has no safety function: the red button of the robot controller is the emergency stop. Whether the robot is real or simulated is decided when the system is launched, never here.')),
    h('div', {}, h('h2', {}, 'One operator'), h('p', {}, 'One browser operates, all others watch; STOP and notes are everybody’s. Taking over is announced to the operator, who has 3 s to keep the control. A browser that has been away for 10 s no longer operates.'),
      h('div', { class: 'row' }, takeOver(message), invite), h('label', {}, 'Valid once', link), message,
      h('h2', {}, 'Who can move the robot'), h('p', {}, 'This page needs a link with a one-time token, and listens on this computer alone unless it was launched otherwise. ROS 1 itself has no authentication: anybody who reaches the ROS master can do everything, without this page. Keep the master on loopback or on a private network. From elsewhere: ssh -L 8790:127.0.0.1:8790 LAB-PC.'),
      h('h2', {}, 'Words of the picture'), h('p', {}, 'Orange: arm. Green: object. Pink: goal. Thin sky-blue path, dashed in 2D: where the next motion would go; thick blue: the motion under way. Sky-blue lines: workspace.'),
      h('p', {}, 'Graph of the state machine, whole: all of the machine, in small letters if necessary; follow: the surroundings of the active state, in readable letters.')));
  return {};
}

/** Take over, or keep the control while another browser takes over. */
export function takeOver(message) {
  const button = h('button', { type: 'button', onclick: async () => setText(message, (await command(operating() ? 'keep' : 'take_over')).message) }, 'Take over');
  watch(button, () => {
    const claimant = store.docs.desk?.roles.claimant;
    button.hidden = !store.docs.desk || (operating() && !claimant);
    setText(button, operating() ? `Keep the control (${claimant} takes over)` : 'Take over');
  });
  return button;
}
