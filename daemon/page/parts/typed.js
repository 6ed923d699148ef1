// Numbers as people type them (pure).

/** A typed number, a comma as good as a point; NaN for none. */
export function numberOf(text) {
  const plain = String(text).trim().replace('−', '-').replace(',', '.');
  return plain === '' ? NaN : Number(plain);
}
