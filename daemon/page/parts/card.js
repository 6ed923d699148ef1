// The frame of everything: a titled section; `flush`: filled by a picture or a scene, the title on it.
import { html } from '../vendor/preact.js';

export const Card = ({ title, children, wide, brief, flush, low, id, aside }) =>
  html`<section class="card ${wide ? `wide-${wide}` : ''} ${brief ? 'brief' : ''} ${flush ? 'flush' : ''} ${low ? 'low' : ''}" aria-labelledby=${id}>
    <header><h2 id=${id}>${title}</h2>${aside}</header>
    ${children}
  </section>`;

export const Facts = ({ rows }) =>
  html`<dl class="facts">${rows.filter(Boolean).map(([name, value]) => html`<div><dt>${name}</dt><dd>${value}</dd></div>`)}</dl>`;
