// Builds and updates elements of the page. Text goes in as text, never as markup.

/** An element: tag, attributes (on… are listeners, class names by `class`), children (nodes or text). */
export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith('on')) element.addEventListener(name.slice(2), value);
    else if (value === true) element.setAttribute(name, '');
    else if (value !== false && value !== null && value !== undefined) element.setAttribute(name, value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return element;
}

/** An SVG element. */
export function svg(tag, attributes = {}, ...children) {
  const element = document.createElementNS('http://www.w3.org/2000/svg', tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

/** Sets the text only where it differs: a screen reader is not told the same again. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function setAttribute(element, name, value) {
  if (value === null) element.removeAttribute(name);
  else if (element.getAttribute(name) !== String(value)) element.setAttribute(name, value);
}

const FRAME = 17; // ms, the screen's own
const MARKS = { ok: '●', warn: '▲', fault: '■', idle: '○' };

/** Shape and word for a level: colour is never the only code. */
export function mark(level) {
  return h('span', { class: `mark ${level}`, 'aria-hidden': 'true' }, MARKS[level]);
}

/** Rows of a table; header is a list of words. */
export function table(header, rows, caption) {
  const head = h('tr', {}, header.map((word) => h('th', { scope: 'col' }, word)));
  const body = rows.map((row) => h('tr', {}, row.map((cell) => h('td', {}, cell instanceof Node ? cell : String(cell ?? '')))));
  return h('table', {}, caption ? h('caption', { hidden: true }, caption) : null, h('thead', {}, head), h('tbody', {}, body));
}

const MOST = 10000; // ms, the longest rest after a picture
const asked = new Set(); // drawings that are to be done
let armed = false;
let restUntil = 0;

/** A function that asks for `update`, which changes words alone: done at most once a `period` (ms), whatever is drawn. */
export function paced(update, period) {
  let due = 0;
  let waiting = false;
  return () => {
    if (waiting) return;
    waiting = true;
    setTimeout(() => {
      waiting = false;
      const began = performance.now();
      if (!document.hidden) update();
      due = performance.now() + Math.max(period, 3 * (performance.now() - began));
    }, Math.max(0, due - performance.now()));
  };
}

/**
 * A function that asks for `draw`: done in the next picture, at most once a `period()` (ms), never while the page is hidden.
 * All drawings together take a quarter of the time: the time of a picture is what the page waited for its turn, drew, and was
 * busy afterwards, which without a graphics card is most of it, and messages and clicks would stand in line behind it.
 */
export function drawn(draw, period) {
  const job = { draw, period, due: 0 };
  return () => {
    asked.add(job);
    arm();
  };
}

function arm() {
  if (armed || !asked.size) return;
  armed = true;
  const due = Math.max(restUntil, Math.min(...[...asked].map((job) => job.due)));
  setTimeout(() => {
    const since = performance.now();
    requestAnimationFrame(() => picture(since));
  }, Math.max(0, due - performance.now()));
}

function picture(since) {
  const began = performance.now();
  for (const job of [...asked].filter((one) => one.due <= began)) {
    asked.delete(job);
    job.due = began + job.period();
    try {
      job.draw();
    } catch (error) {
      console.error(error); // one panel that fails takes no other along
    }
  }
  setTimeout(() => {
    const ended = performance.now();
    const took = Math.max(0, began - since - FRAME) + ended - began;
    restUntil = ended + Math.min(MOST, 3 * took);
    armed = false;
    arm();
  });
}

const places = new Map(); // words: their place

function isCut(words) {
  return [words, ...words.querySelectorAll('li')].some((one) => one.scrollHeight > one.clientHeight + 1 || one.scrollWidth > one.clientWidth + 1);
}

/** Tab stops only where something is cut off. What is being read stays as it is until it is left. */
function judge(words) {
  const place = places.get(words);
  if (place.matches('.unfolded, :focus')) return;
  if (isCut(words)) place.tabIndex = 0;
  else place.removeAttribute('tabindex');
}

const sizes = new ResizeObserver((entries) => entries.forEach(({ target }) => judge(target)));

/**
 * Makes a `place` on the page readable in full. `words`, the one element in it, is cut off by the style sheet, and lies
 * above its surroundings while it is unfolded; under the mouse it takes no clicks, because it may lie over a button.
 */
export function more(place, words) {
  place.classList.add('more');
  words.classList.add('all');
  places.set(words, place);
  const turn = () => {
    const unfold = place.hasAttribute('tabindex') && place.matches(':focus, :hover');
    if (unfold === place.classList.contains('unfolded')) return;
    // The surroundings stay where they are while the words have left their place.
    place.style.minHeight = unfold ? `${place.offsetHeight}px` : '';
    place.classList.toggle('unfolded', unfold);
    if (!unfold) judge(words);
  };
  for (const name of ['focus', 'blur', 'pointerenter', 'pointerleave']) place.addEventListener(name, turn);
  sizes.observe(words);
  new MutationObserver(() => judge(words)).observe(words, { childList: true, characterData: true, subtree: true });
  return place;
}
