// The graph of a state machine, laid out by Graphviz: active states are thick and filled; the last transition is text.
import { h, more, setText, svg } from './dom.js';
import { on, onDocs, store } from './link.js';
import { choice } from './controls.js';

const MAIN = '/coglab';
const READABLE = 14 / 11; // px per unit of the picture at which its letters (11 units) are 14 px high
const CRUMBS = 40; // characters that fit into the line
let drawn = null;
let parts = {};

function machines() {
  return Object.keys(store.docs).filter((name) => name.startsWith('graph:') && store.docs[name]).map((name) => name.slice(6));
}

function pathOf(points) {
  const [first, ...rest] = points;
  let text = `M${first}`;
  for (let i = 0; i + 2 < rest.length; i += 3) text += `C${rest[i]} ${rest[i + 1]} ${rest[i + 2]}`;
  const left = rest.slice(rest.length - (rest.length % 3));
  return text + left.map((point) => `L${point}`).join('');
}

function draw(picture, graph) {
  picture.replaceChildren();
  parts = { items: {}, edges: {} };
  const arrow = svg('marker', { id: 'arrow', viewBox: '0 0 8 8', refX: 7, refY: 4, markerWidth: 7, markerHeight: 7, orient: 'auto-start-reverse' }, svg('path', { d: 'M0 0L8 4L0 8z', fill: '#5c646c' }));
  picture.append(svg('defs', {}, arrow));
  for (const box of graph.boxes) picture.append(...shape(box, 'box', box.box[0] + 6, box.box[1] + 13, 'start'));
  for (const edge of graph.edges) {
    const line = svg('path', { class: 'edge', d: pathOf(edge.points), 'marker-end': 'url(#arrow)' }, svg('title', {}, edge.outcomes));
    parts.edges[`${edge.from} ${edge.to}`] = line;
    picture.append(line);
  }
  for (const node of graph.nodes) {
    const [x, y, w, high] = node.box;
    picture.append(...shape(node, 'node', x + w / 2, y + high / 2 + 4, 'middle'));
  }
  drawn = graph;
}

function shape(item, kind, x, y, anchor) {
  const [left, top, width, height] = item.box;
  const rect = svg('rect', { class: kind, x: left, y: top, width, height, rx: 4 });
  const text = svg('text', { x, y, 'text-anchor': anchor }, item.label);
  parts.items[item.path] = [rect, text, item.box];
  return [rect, text];
}

/** The part of the picture to show: the innermost active container, or all of it. */
function frameOf(active, follow, place) {
  const whole = [0, 0, ...drawn.size];
  if (!follow || !active.length) return whole;
  const deepest = active.reduce((a, b) => (b.split('/').length > a.split('/').length ? b : a));
  const box = drawn.boxes.filter((one) => deepest.startsWith(`${one.path}/`)).sort((a, b) => b.path.length - a.path.length)[0];
  const leaf = parts.items[deepest]?.[2];
  if (!box || !leaf) return whole;
  const [x, y, w, high] = box.box;
  const limit = [place.clientWidth, place.clientHeight].map((size) => Math.max(60, size / READABLE - 12)); // larger containers would be unreadable: show the surroundings of the state
  if (w <= limit[0] && high <= limit[1]) return [x - 6, y - 6, w + 12, high + 12];
  const width = Math.min(w, limit[0]);
  const height = Math.min(high, limit[1]);
  const clamp = (value, low, top) => Math.max(low, Math.min(value, Math.max(low, top)));
  return [clamp(leaf[0] + leaf[2] / 2 - width / 2, x, x + w - width) - 4, clamp(leaf[1] + leaf[3] / 2 - height / 2, y, y + high - height) - 4, width + 8, height + 8];
}

/** Containers down to a state; outer ones are left out if the text is too long. */
function wayTo(path) {
  const all = path.split('/').filter(Boolean).slice(1);
  const parts = [...all];
  while (parts.length > 2 && parts.join(' › ').length > CRUMBS) parts.shift();
  return (parts.length < all.length ? ['…', ...parts] : parts).join(' › ');
}

export function showGraph(parent) {
  const machine = choice({ 'aria-label': 'State machine to show', onchange: update });
  const extent = choice({ 'aria-label': 'How much of it', onchange: update });
  extent.offer([['follow', 'follow'], ['whole', 'whole']]);
  extent.show('follow');
  const crumbs = h('span', { 'aria-live': 'polite' });
  const last = h('span');
  const picture = svg('svg', { role: 'img', 'aria-label': 'Graph of the state machine' });
  parent.append(h('header', {}, machine.button, more(h('p', { class: 'crumbs' }, crumbs), crumbs), extent.button), picture, more(h('p', { class: 'last' }, last), last));

  function names() {
    const known = machines();
    const wanted = machine.button.value;
    machine.offer(known.map((name) => [name, name.replace(/^\//, '')]));
    if (!known.includes(wanted)) machine.show(known.includes(MAIN) ? MAIN : known[0] ?? '');
    return machine.button.value;
  }

  function update() {
    const name = names();
    const graph = store.docs[`graph:${name}`];
    if (!graph) {
      setText(crumbs, 'No state machine is on this master.');
      return;
    }
    if (graph !== drawn) draw(picture, graph);
    const { active, last: step } = store.docs.active?.[name] ?? { active: [], last: {} };
    for (const [path, [rect, text]] of Object.entries(parts.items)) {
      const on = active.includes(path) || active.some((one) => one.startsWith(`${path}/`));
      rect.classList.toggle('active', on);
      text.classList.toggle('active', on);
    }
    for (const line of Object.values(parts.edges)) line.classList.remove('last');
    if (step.path) {
      parts.edges[`${step.path}/${step.from} ${step.path}/${step.to}`]?.classList.add('last');
      const names = `${step.from}${step.outcome ? ` [${step.outcome}]` : ''} → ${step.to}`;
      setText(last, step.reason ? `${step.reason} (${names})` : names);
    } else setText(last, '');
    const deepest = active.reduce((a, b) => (b.length > a.length ? b : a), '');
    setText(crumbs, graph.problem || wayTo(deepest) || 'not active');
    picture.setAttribute('viewBox', frameOf(active, extent.button.value === 'follow', picture).join(' '));
  }

  new ResizeObserver(update).observe(picture);
  on('doc', (name) => {
    if (name.startsWith('graph:') || name === 'active') update();
  });
  onDocs(['active'], update);
}
