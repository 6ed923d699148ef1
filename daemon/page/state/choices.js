// What a person chose on this device: language, theme, size. Nothing else is ever kept in the browser.
import { effect, signal } from '../vendor/preact.js';

function kept(name, otherwise) {
  const choice = signal(read(name) ?? otherwise);
  effect(() => {
    try {
      localStorage.setItem(`handeyed.${name}`, choice.value);
    } catch {
      // a browser that keeps nothing
    }
  });
  return choice;
}

function read(name) {
  try {
    return localStorage.getItem(`handeyed.${name}`);
  } catch {
    return null;
  }
}

const asked = new URLSearchParams(location.search);

export const LANGUAGES = { en: 'English', de: 'Deutsch', zh: '简体中文', es: 'Español' };
const preferred = navigator.languages.map((tag) => tag.slice(0, 2)).find((tag) => tag in LANGUAGES);
export const language = kept('language', preferred ?? 'en');
export const theme = kept('theme', 'auto'); // auto, light, dark
export const scale = kept('scale', '1'); // 1, 1.25, 1.5

for (const [name, choice] of Object.entries({ lang: language, theme, scale })) {
  if (asked.has(name)) choice.value = asked.get(name);
}

effect(() => {
  const root = document.documentElement;
  if (theme.value === 'auto') delete root.dataset.theme;
  else root.dataset.theme = theme.value;
  root.dataset.scale = scale.value;
});
