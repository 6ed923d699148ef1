// Templates: {name} and {name:form}, with the forms of calibration/sentences: .2g, .1f, +.2f, .0%, views, picture, and lists.

/** `template` with its places filled by `params`, numbers with the `decimal` mark; parts that are sentences are looked up in `table`. Throws when one is missing. */
export function fill(template, params, table = {}, decimal = '.') {
  return template.replace(/\{(\w+)(?::([^}]*))?\}/g, (whole, name, form = '') => {
    if (!(name in params)) return whole;
    return formed(params[name], form, table, decimal);
  });
}

function formed(value, form, table, decimal) {
  if (form === 'views' && Array.isArray(value)) return formed(value.slice(0, 12), 'picture') + (value.length > 12 ? ' …' : '');
  if (form === 'picture' && Array.isArray(value)) return value.map((index) => index + 1).join(', ');
  if (form === 'picture' && typeof value === 'number') return String(value + 1);
  if (form === 'step') return `${value > 0 ? '+' : '−'} ${number(Math.abs(value), '', decimal)}`;
  if (Array.isArray(value)) return value.map((one) => formed(one, '', table, decimal)).join(form || (decimal === ',' && value.some(isBroken) ? '; ' : ', '));
  if (value !== null && typeof value === 'object') {
    if (!(value.id in table)) throw new Error(`no text for ${value.id}`);
    return fill(table[value.id], value.params ?? {}, table, decimal);
  }
  return typeof value === 'number' ? number(value, form, decimal) : String(value);
}

const isBroken = (value) => typeof value === 'number' && !Number.isInteger(value);

function number(value, form, decimal) {
  const [, sign, digits, kind] = /^(\+?)(?:\.(\d+))?([gf%]?)$/.exec(form) ?? [];
  let text;
  if (kind === 'f') text = value.toFixed(Number(digits));
  else if (kind === '%') text = `${(100 * value).toFixed(Number(digits ?? 0))} %`;
  else if (kind === 'g') text = String(Number(value.toPrecision(Number(digits ?? 6))));
  else text = String(value);
  return (sign && value >= 0 ? '+' : '') + text.replace('-', '−').replace('.', decimal);
}

const ACCENTED = { a: 'å', e: 'é', i: 'î', o: 'ö', u: 'û', A: 'Å', E: 'É', I: 'Î', O: 'Ö', U: 'Û', n: 'ñ', c: 'ç', s: 'š' };

/** The text 40 % longer, with accents, in brackets: what is not marked is not translated, what overflows is seen. */
export function pseudo(text) {
  const longer = text.replace(/\{[^}]*\}|./gs, (part) => (part.length > 1 ? part : (ACCENTED[part] ?? part)));
  const more = Math.ceil(0.4 * text.replace(/\{[^}]*\}/g, '').length);
  return `⟦${longer}${' ~~~~~'.repeat(Math.ceil(more / 6)).slice(0, more)}⟧`;
}
