/** The one connection to the server: commands out, messages in, and again when it breaks. */

import { announce, connected, connection, doc, now_ms, retryAt_ms } from "./store";
import { receive } from "./receive";
import type { Edit, FromPage, Reply, ToPage } from "./protocol";

type WithoutSerial<T> = T extends unknown ? Omit<T, "serial"> : never;
type Edits = Extract<FromPage, Edit>;
type CommandToSend = WithoutSerial<FromPage>;
export type EditToSend = Edits extends infer T ? (T extends unknown ? Omit<T, "serial" | "revision"> : never) : never;

const FIRST_RETRY_MS = 250;
const LONGEST_RETRY_MS = 5000;
/** So long after the connection broke every try follows the one before soon: a station that is started anew is back. */
const EAGER_MS = 10_000;
const TICK_MS = 250;

let socket: WebSocket | null = null;
let serial = 0;
let retry_ms = FIRST_RETRY_MS;
let brokeAt_ms: number | null = null;
const waiting = new Map<number, (reply: Reply) => void>();

/** Connect, and stay connected for as long as the page is open. */
export function connect(): void {
  setInterval(() => (now_ms.value = performance.now()), TICK_MS);
  open();
}

function open(): void {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const opened = new WebSocket(`${scheme}://${location.host}/ws`);
  socket = opened;
  connection.value = connection.value === "closed" ? "closed" : "connecting";
  opened.onmessage = (event: MessageEvent<string>) => {
    const message = JSON.parse(event.data) as ToPage;
    if (message.type === "reply") answer(message);
    else receive(message);
    if (message.type === "welcome") [retry_ms, brokeAt_ms] = [FIRST_RETRY_MS, null];
  };
  opened.onclose = () => {
    socket = null;
    if (connection.value !== "outdated") connection.value = "closed";
    for (const number of [...waiting.keys()]) answer(refusal(number, "the connection closed before it was answered"));
    brokeAt_ms ??= performance.now();
    retryAt_ms.value = performance.now() + retry_ms;
    setTimeout(open, retry_ms);
    const eager = performance.now() - brokeAt_ms < EAGER_MS;
    retry_ms = eager ? FIRST_RETRY_MS : Math.min(2 * retry_ms, LONGEST_RETRY_MS);
  };
}

function answer(reply: Reply): void {
  const resolve = waiting.get(reply.serial);
  waiting.delete(reply.serial);
  resolve?.(reply);
}

function refusal(number: number, error: string): Reply {
  return {
    type: "reply",
    serial: number,
    error,
    nonce: "",
    here: null,
    there: null,
    compensation: null,
    name: "",
    flights: [],
    aligned: [],
    parts: [],
    scatter: null,
    incoming: null,
    plans: [],
    words: "",
    recorded_path: null,
    vehicles: [],
    invitation: null,
    spectrum: null,
    spectrogram: null,
    pairs: null,
  };
}

/** Send a command; resolves with the server's reply, or with a refusal if there is no connection. Never rejects. */
export function send(command: CommandToSend): Promise<Reply> {
  serial += 1;
  const number = serial;
  if (socket === null || !connected.value) {
    return Promise.resolve(refusal(number, "not sent: the page is not connected to the ground station"));
  }
  socket.send(JSON.stringify({ ...command, serial: number }));
  return new Promise((resolve) => waiting.set(number, resolve));
}

/** Send a command and put a refusal into the notice; true if it was done. */
export async function submit(command: CommandToSend): Promise<boolean> {
  const { error } = await send(command);
  if (error !== "") announce(error, "danger");
  return error === "";
}

/** Send a change of the document as the page shows it, or as it was when somebody began to make the change. */
export function edit(change: EditToSend, revision = doc.value?.revision ?? 0): Promise<Reply> {
  return send({ ...change, revision } as CommandToSend);
}

/** A sender with at most one command on its way: of those that come meanwhile the last one wins. */
export function latest<T>(
  build: (value: T) => CommandToSend,
  onReply: (reply: Reply) => void = () => {},
): (value: T) => void {
  let next: { value: T } | null = null;
  let busy = false;
  const pump = async (): Promise<void> => {
    busy = true;
    while (next !== null) {
      const { value } = next;
      next = null;
      onReply(await send(build(value)));
    }
    busy = false;
  };
  return (value) => {
    next = { value };
    if (!busy) void pump();
  };
}
