/** The keys of a command, as they stand on the keyboard. */

const SIGNS: Readonly<Record<string, string>> = {
  Ctrl: "⌃",
  Shift: "⇧",
  Escape: "Esc",
  ArrowLeft: "←",
  ArrowRight: "→",
  ArrowUp: "↑",
  ArrowDown: "↓",
  PageUp: "PgUp",
  PageDown: "PgDn",
  Delete: "Del",
  Insert: "Ins",
};

/** `of`: as in `commands.ts`, "Ctrl+Shift+z". */
export function Keys({ of }: { of: string }) {
  const signs = of.split("+").map((key) => SIGNS[key] ?? (key.length === 1 ? key.toUpperCase() : key));
  return <kbd aria-hidden="true">{signs.join((signs.at(-1)?.length ?? 0) > 1 ? " " : "")}</kbd>;
}
