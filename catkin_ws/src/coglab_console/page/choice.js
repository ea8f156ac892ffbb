// A list to choose from that stays within the page. The browser's own takes every key while it is open, and Space is STOP.
import { h, setAttribute, setText } from './dom.js';

const STEPS = { ArrowDown: 1, ArrowUp: -1 };
const LINE = 44; // px, for a finger
const EDGE = 8; // px to the border of the window and to the footer, where STOP is
let made = 0;

/** Below the button where there is room above the footer, otherwise where there is more. */
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
    event.preventDefault(); // or the button would be clicked, too
    take();
  } else if (event.key === 'Escape') close();
}

/**
 * A button with a list: { button, offer(pairs of value and words), show(value) }. What is chosen is `button.value`, and
 * told as `change`. Arrows go through the open list, Enter takes, Escape and whatever takes the focus leave it. Where
 * `blockedBy()` has a reason the list stays closed, and `refused` is told it.
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
