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

/** Sets the text only if it differs, so that a screen reader does not repeat it. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function setAttribute(element, name, value) {
  if (value === null) element.removeAttribute(name);
  else if (element.getAttribute(name) !== String(value)) element.setAttribute(name, value);
}

const FRAME = 17; // ms per picture of a 60 Hz screen
const MARKS = { ok: '●', warn: '▲', fault: '■', idle: '○' };

/** Symbol for a level, so that colour is never the only code. */
export function mark(level) {
  return h('span', { class: `mark ${level}`, 'aria-hidden': 'true' }, MARKS[level]);
}

/** Rows of a table; header is a list of words. */
export function table(header, rows, caption) {
  const head = h('tr', {}, header.map((word) => h('th', { scope: 'col' }, word)));
  const body = rows.map((row) => h('tr', {}, row.map((cell) => h('td', {}, cell instanceof Node ? cell : String(cell ?? '')))));
  return h('table', {}, caption ? h('caption', { hidden: true }, caption) : null, h('thead', {}, head), h('tbody', {}, body));
}

const MOST = 10000; // ms, longest pause after a picture
const asked = new Set(); // requested drawings
let armed = false;
let restUntil = 0;

/** Returns a function that requests `update`, for text only: runs at most once per `period` (ms), independent of drawings. */
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
 * Returns a function that requests `draw`: runs in the next picture, at most once per `period()` (ms), never on a hidden page.
 * All drawings together get a quarter of the time, so that messages and clicks do not wait. The time of a picture includes the
 * waiting before it and the busy time after it; without a graphics card that is most of it.
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
      console.error(error); // a failing panel must not stop the others
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

const places = new Map(); // element with the text -> its place

function isCut(words) {
  return [words, ...words.querySelectorAll('li')].some((one) => one.scrollHeight > one.clientHeight + 1 || one.scrollWidth > one.clientWidth + 1);
}

/** Makes a text a Tab stop only if it is cut off. A text that is being read stays unchanged. */
function judge(words) {
  const place = places.get(words);
  if (place.matches('.unfolded, :focus')) return;
  if (isCut(words)) place.tabIndex = 0;
  else place.removeAttribute('tabindex');
}

const sizes = new ResizeObserver((entries) => entries.forEach(({ target }) => judge(target)));

/**
 * Lets a reader unfold a cut-off text. `words`, the only element in `place`, is cut off by the style sheet. Unfolded, it lies
 * above its surroundings. Under the mouse it takes no clicks, because it may cover a button.
 */
export function more(place, words) {
  place.classList.add('more');
  words.classList.add('all');
  places.set(words, place);
  const turn = () => {
    const unfold = place.hasAttribute('tabindex') && place.matches(':focus, :hover');
    if (unfold === place.classList.contains('unfolded')) return;
    // keeps the surroundings in place while the text is unfolded
    place.style.minHeight = unfold ? `${place.offsetHeight}px` : '';
    place.classList.toggle('unfolded', unfold);
    if (!unfold) judge(words);
  };
  for (const name of ['focus', 'blur', 'pointerenter', 'pointerleave']) place.addEventListener(name, turn);
  sizes.observe(words);
  new MutationObserver(() => judge(words)).observe(words, { childList: true, characterData: true, subtree: true });
  return place;
}
