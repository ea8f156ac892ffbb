// Text that has room for a few lines. Where it is longer it is shown in full while the focus or the mouse is on it.

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
