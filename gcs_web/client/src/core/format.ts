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
