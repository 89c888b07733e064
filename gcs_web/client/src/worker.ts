/** Keeps the page for moments at which the station does not answer: the page says so, and comes back by itself.
 *
 * The station is asked first for the page. Where it does not answer in time the kept page is shown, which may be an old
 * one, with all the files that were kept with it. Kept are these files alone, all of one moment: no address with a token, no answer that refuses, nothing of a project, a flight or the 3D view.
 */

interface KeepsAlive extends Event {
  waitUntil(work: Promise<unknown>): void;
}
interface Fetches extends KeepsAlive {
  readonly request: Request;
  /** Of the page that asks, and of the one that a navigation makes. */
  readonly clientId: string;
  readonly resultingClientId: string;
  respondWith(answer: Promise<Response>): void;
}
interface Worker {
  addEventListener(kind: "install" | "activate", run: (event: KeepsAlive) => void): void;
  addEventListener(kind: "fetch", run: (event: Fetches) => void): void;
  skipWaiting(): Promise<void>;
  readonly clients: { claim(): Promise<void> };
}

const worker = self as unknown as Worker;
const NAME = "page";
const FILES = ["/", "/static/app.js", "/static/app.css", "/static/icon.svg"];
/** A station that does not answer within this, when its page is opened, is not there. */
const PATIENCE_MS = 5000;
/** Pages that were opened without the station: their files are kept ones, too. */
const withoutStation = new Set<string>();

worker.addEventListener("install", (event) => event.waitUntil(Promise.all([keep(), worker.skipWaiting()])));
worker.addEventListener("activate", (event) => event.waitUntil(worker.clients.claim()));
worker.addEventListener("fetch", (event) => {
  const { origin, pathname, search } = new URL(event.request.url);
  const isKept = event.request.method === "GET" && origin === location.origin && search === "" && FILES.includes(pathname);
  if (isKept) event.respondWith(answer(event, pathname));
});

async function answer(event: Fetches, path: string): Promise<Response> {
  const isPage = path === "/";
  try {
    if (!isPage && withoutStation.has(event.clientId)) throw new Error("the page is a kept one");
    const asked = fetch(event.request);
    const fresh = await (isPage ? Promise.race([asked, tooLate()]) : asked);
    if (isPage && fresh.ok && !fresh.redirected) event.waitUntil(keep());
    return fresh;
  } catch (error) {
    const kept = await caches.match(path);
    if (kept === undefined) throw error;
    if (isPage) withoutStation.add(event.resultingClientId);
    return kept;
  }
}

function tooLate(): Promise<never> {
  return new Promise((_, refuse) => setTimeout(() => refuse(new Error("the station does not answer")), PATIENCE_MS));
}

/** All files or none: those of two versions do not fit. */
async function keep(): Promise<void> {
  const answers = await Promise.all(FILES.map((path) => fetch(path)));
  if (!answers.every(({ ok, redirected }) => ok && !redirected)) return;
  const cache = await caches.open(NAME);
  await Promise.all(answers.map((each, i) => cache.put(FILES[i] ?? "", each)));
}
