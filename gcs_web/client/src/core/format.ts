/** Numbers as people read them, and as people type them. */

/** With a true minus sign; "–" for a value that is not known. */
export function number(value: number | null | undefined, digits: number): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = value.toFixed(digits);
  if (Number(text) === 0) return (0).toFixed(digits); // never "−0.00"
  return text.replace("-", "−");
}

/** About three significant digits. */
export function short(value: number): string {
  const size = Math.abs(value);
  return number(value, size >= 100 ? 0 : size >= 20 ? 1 : 2);
}

/** As short as it can be without losing a millimetre; what an edited cell starts with. */
export function editable(value: number | null): string {
  return value === null ? "" : String(Number(value.toFixed(3))).replace("-", "−");
}

/** The number someone typed, or null where it is none. A comma may stand for the point. */
export function parse(text: string): number | null {
  const plain = text.trim().replace("−", "-").replace(",", ".");
  if (!/^[+-]?(\d+\.?\d*|\.\d+)$/.test(plain)) return null;
  return Number(plain);
}

export function age(seconds: number): string {
  return seconds < 60 ? `${seconds.toFixed(1)} s old` : `${Math.floor(seconds / 60)} min old`;
}

/** A time that something takes. */
export function span(seconds: number): string {
  if (seconds < 90) return `${Math.round(seconds)} s`;
  return seconds < 5400 ? `${Math.round(seconds / 60)} min` : `${(seconds / 3600).toFixed(1)} h`;
}

export function checksum(crc32: string): string {
  return crc32.length === 8 ? `${crc32.slice(0, 4)} ${crc32.slice(4)}` : crc32;
}

export function sentenceCase(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1);
}

export function initials(name: string): string {
  return name
    .split(/\s+/)
    .map((word) => word.charAt(0).toUpperCase())
    .join("")
    .slice(0, 3);
}

export function dayAndTime(iso: string): string {
  const date = new Date(iso);
  if (Number.isNaN(date.getTime())) return iso;
  return date.toLocaleString(undefined, { month: "short", day: "numeric", hour: "2-digit", minute: "2-digit" });
}

export function plural(count: number, one: string, many: string): string {
  return `${count} ${count === 1 ? one : many}`;
}

/** Most words of a text that is shown unopened. */
const MOST_WORDS = 24;
/** A clause with fewer words says too little to stand alone. */
const FEWEST_WORDS = 6;

/** The text if it is short; else as many of its sentences or clauses as are, or its first words. */
export function headOf(text: string): string {
  const words = text.trim().split(/\s+/);
  if (words.length <= MOST_WORDS + 1) return text;
  const first = words.slice(0, MOST_WORDS);
  const lastWith = (end: RegExp): number => first.findLastIndex((word, at) => at + 1 >= FEWEST_WORDS && end.test(word));
  const at = [/[.?!]$/, /[;:]$/, /,$/].map(lastWith).find((found) => found >= 0) ?? MOST_WORDS - 1;
  const head = first.slice(0, at + 1).join(" ");
  const whole = head.split("`").length % 2 === 1 ? head : head.slice(0, head.lastIndexOf("`")).trimEnd(); // no half command
  return /[.?!]$/.test(whole) ? whole : `${whole.replace(/[,;:]$/, "")} …`;
}
