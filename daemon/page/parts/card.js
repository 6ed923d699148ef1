// The frame of everything: a titled section.
import { html } from '../vendor/preact.js';

export const Card = ({ title, children, wide, brief, id, aside }) =>
  html`<section class="card ${wide ? `wide-${wide}` : ''} ${brief ? 'brief' : ''}" aria-labelledby=${id}>
    <header><h2 id=${id}>${title}</h2>${aside}</header>
    ${children}
  </section>`;

export const Facts = ({ rows }) =>
  html`<dl class="facts">${rows.filter(Boolean).map(([name, value]) => html`<div><dt>${name}</dt><dd>${value}</dd></div>`)}</dl>`;
