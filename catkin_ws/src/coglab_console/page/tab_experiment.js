// Experiment: participant, conditions, order of trials, notes; recorded handovers; questionnaires of a live study.
import { h, setText, table } from './dom.js';
import { command, onDocs, store } from './link.js';
import { choice, commandButton } from './controls.js';
import { clock } from './status.js';

export function field(label, input) {
  return h('label', {}, label, input);
}

const OUTCOMES = [['done', 'The trial is done'], ['failed', 'The robot has failed'], ['repeat', 'Do the trial again'], ['skipped', 'Skip the trial']];

function form(message) {
  const study = h('input', { type: 'text', maxlength: 40, autocomplete: 'off', pattern: '[a-z0-9][a-z0-9_.\\-]*' });
  const participant = h('input', { type: 'text', maxlength: 32, autocomplete: 'off', placeholder: 'P07' });
  const number = h('input', { type: 'number', min: 0, max: 9999, value: 0 });
  const conditions = h('input', { type: 'text', value: 'receive, give', maxlength: 400 });
  const repetitions = h('input', { type: 'number', min: 1, max: 50, value: 5 });
  const order = choice({});
  order.offer(['as_listed', 'latin_square', 'random'].map((word) => [word, word]));
  order.show('as_listed'); // in this order, receive and give need no action between trials
  const request = () => ['session_begin', {
    participant: participant.value.trim(),
    number: Number(number.value),
    conditions: conditions.value.split(',').map((word) => word.trim()).filter(Boolean),
    repetitions: Number(repetitions.value),
    order: order.button.value,
    study: study.value.trim(),
  }];
  const begin = commandButton('Begin the session', { name: 'session_begin', message, request });
  return h('form', { onsubmit: (event) => event.preventDefault() },
    field('Participant (a pseudonym, never a name)', participant), field('Number of the participant (row of the Latin square, seed)', number),
    field('Study, for the recordings; may be empty', study),
    field('Conditions, separated by commas. A condition that names an object, such as "receive ball", selects it.', conditions),
    h('div', { class: 'pair' }, field('Repetitions of each', repetitions), field('Order', order.button)), h('div', { class: 'row' }, begin));
}

function running(message, session) {
  const next = session.trials[session.position];
  const rows = session.trials.map((trial, i) => [i + 1, trial.condition, i === session.position && session.running ? 'under way' : trial.outcome || '·']);
  const around = rows.slice(Math.max(0, session.position - 4), session.position + 9);
  return [
    h('p', {}, `Session of ${session.participant}${session.study ? `, study ${session.study}` : ''}: ${session.position} of ${session.trials.length} trials.`),
    h('div', { class: 'row' },
      commandButton(next ? `Begin trial ${session.position + 1}: ${next.condition}` : 'All trials are done', { name: 'trial_begin', message, request: () => ['trial_begin', {}] }),
      ...OUTCOMES.map(([outcome, label]) => commandButton(label, { name: outcome === 'done' ? 'trial_done' : 'trial_end', message, request: () => ['trial_end', { outcome }] })),
      commandButton('End the session', { name: 'session_end', message, request: () => ['session_end', {}] })),
    table(['Trial', 'Condition', 'Outcome'], around, 'Trials around the present one'),
  ];
}

/** The newest recorded handovers, as in `./coglab trial list`. */
function recorded({ folder = '', recording = false, rows = [] } = {}) {
  const cells = rows.map((row) => [row.started?.slice(11, 19), [row.action, row.object].join(' '), [row.participant, row.condition].filter(Boolean).join(', '), row.outcome, row.duration_s, row.notes]);
  return [
    h('p', {}, recording ? `Each handover is recorded into ${folder}; ./coglab trial explain last, ./coglab trial report last.` : 'No recorder runs, so nothing of a session is written: launch without record:=none.'),
    rows.length ? table(['UTC', 'Handover', 'Trial of', 'Outcome', 's', 'Notes'], cells, 'Recorded handovers') : null,
  ];
}

/** A questionnaire of the live study: one number per item. Items left empty are asked again. */
function asked(one, of, message) {
  const inputs = one.items.map(([, text]) => h('input', { type: 'number', min: one.low, max: one.high, step: one.step, 'aria-label': text }));
  const request = () => ['answer', { questionnaire: one.name, of, answers: Object.fromEntries(one.items.flatMap(([item], i) => (inputs[i].value === '' ? [] : [[item, Number(inputs[i].value)]]))) }];
  return h('form', { onsubmit: (event) => event.preventDefault() }, h('h3', {}, one.title), h('p', {}, `${one.low}: ${one.ends[0]}; ${one.high}: ${one.ends[1]}`),
    ...one.items.map(([, text], i) => field(text, inputs[i])), h('div', { class: 'row' }, commandButton('Write the answers', { name: 'answer', message, words: `Write the answers: ${one.title}`, request })));
}

/** `forms`: those of the last time, so that what is being typed in one stays while another is written. */
function questions(study, message, forms) {
  const before = new Map(forms);
  forms.clear();
  if (!study) return [];
  for (const one of study.questionnaires) {
    const key = JSON.stringify([study.of, one]);
    forms.set(key, before.get(key) ?? asked(one, study.of, message));
  }
  const stands = study.problem || (study.questionnaires.length ? '' : 'Every questionnaire under this condition is answered.');
  return [h('h2', {}, `Questionnaires of ${study.participant}, condition ${study.condition}, study ${study.study}`), stands ? h('p', {}, stands) : null, ...forms.values()];
}

export function experimentPage(page) {
  page.className = 'page two';
  const message = h('p', { 'aria-live': 'polite' });
  const left = h('div');
  const text = h('textarea', { id: 'note', rows: 3, maxlength: 500 });
  const notes = h('div');
  let sending = false;
  const add = h('button', { type: 'button', onclick: async () => {
    if (sending) return;
    sending = true;
    const note = text.value;
    const answer = await command('note', { text: note.trim() });
    sending = false;
    setText(message, answer.message);
    if (answer.success && text.value === note) text.value = ''; // keep text typed meanwhile or refused
  } }, 'Add the note');
  const open = h('div');
  const recordings = h('div');
  page.append(
    h('div', {}, h('h2', {}, 'Session'), left, message, open),
    h('div', {}, h('h2', {}, 'Notes'), field('A note with the current time (M); it goes into the recording, too', text), h('div', { class: 'row' }, add), notes,
      h('h2', {}, 'Recorded handovers'), recordings));
  let shown = '';
  const draw = () => {
    const session = store.docs.desk?.experiment;
    if (!session) return;
    const key = JSON.stringify([session.participant, session.position, session.running]);
    if (key !== shown) {
      shown = key;
      left.replaceChildren(...(session.participant ? running(message, session) : [form(message)]));
    }
    notes.replaceChildren(table(['Time', 'Who', 'Note'], session.notes.slice().reverse().map((note) => [clock(note.stamp), note.who, note.text]), 'Notes'));
  };
  let before = '';
  const forms = new Map();
  const drawStudy = () => {
    const key = JSON.stringify(store.docs.study ?? null);
    if (key === before) return; // keep what is being typed
    before = key;
    open.replaceChildren(...questions(store.docs.study, message, forms).filter(Boolean));
  };
  const drawRecordings = () => recordings.replaceChildren(...recorded(store.docs.recordings).filter(Boolean));
  draw();
  drawStudy();
  drawRecordings();
  return { docs: { desk: draw, study: drawStudy, recordings: drawRecordings } };
}

/** Shows the session in the band at the top. */
export function showSession(place) {
  onDocs(['desk'], () => {
    const session = store.docs.desk?.experiment;
    if (!session?.participant) {
      setText(place, 'no session');
      return;
    }
    const { participant, position, running, trials } = session;
    const stands = position < trials.length ? `trial ${position + 1} of ${trials.length}: ${trials[position].condition} (${running ? 'under way' : 'next'})` : `${trials.length} trials, all done`;
    setText(place, `session ${participant} · ${stands}`);
  });
}
