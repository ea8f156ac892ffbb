// Small helpers to build and update the page. Text goes in as text, never as markup.

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

/** Calls `draw` at most so often that it takes a quarter of the time, and never while the page is hidden. */
export function paced(draw, period) {
  const shortest = typeof period === 'function' ? period : () => period;
  let due = 0;
  let waiting = false;
  const run = () => {
    waiting = false;
    const began = performance.now();
    if (!document.hidden) draw();
    const took = performance.now() - began;
    due = performance.now() + Math.max(shortest(), 3 * took);
  };
  return () => {
    if (waiting) return;
    waiting = true;
    setTimeout(() => requestAnimationFrame(run), Math.max(0, due - performance.now()));
  };
}
