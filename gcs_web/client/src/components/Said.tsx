/** A sentence of the station, the commands in it (between backticks) set as code. */

export function Said({ text }: { text: string }) {
  return <>{text.split("`").map((part, at) => (at % 2 === 1 ? <code key={at}>{part}</code> : part))}</>;
}
