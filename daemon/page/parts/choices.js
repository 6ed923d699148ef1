// This device's language, theme and size.
import { html } from '../vendor/preact.js';
import { LANGUAGES, language, scale, theme } from '../state/choices.js';
import { t } from '../state/words.js';
import { Card } from './card.js';

const Choice = ({ name, choice, options }) =>
  html`<label for=${`choose-${name}`}>${t(`choose.${name}`)}</label>
    <select id=${`choose-${name}`} value=${choice.value} onChange=${(event) => (choice.value = event.target.value)}>
      ${Object.entries(options).map(([value, text]) => html`<option value=${value}>${text}</option>`)}
    </select>`;

export const Choices = () =>
  html`<${Card} title=${t('choose.title')} id="choices" wide="half">
    <div class="choices">
    <div><${Choice} name="language" choice=${language} options=${language.value === 'pseudo' ? { ...LANGUAGES, pseudo: '⟦pseudo⟧' } : LANGUAGES} /></div>
    <div><${Choice} name="theme" choice=${theme} options=${{ auto: t('choose.auto'), light: t('choose.light'), dark: t('choose.dark') }} /></div>
    <div><${Choice} name="scale" choice=${scale} options=${{ 1: '100 %', 1.25: '125 %', 1.5: '150 %' }} /></div>
    </div>
  </${Card}>`;
