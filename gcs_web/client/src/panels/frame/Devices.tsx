/** Who is here, and an address that lets one more device in, as a code for its camera. */

import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { send } from "../../core/socket";
import { announce, connected, devicesOpen, invitationEnded, people, welcome } from "../../core/store";
import type { Invitation } from "../../core/protocol";

/** Modules of white that a camera needs round a code. */
const QUIET = 4;

export function Devices() {
  const dialog = useRef<HTMLDivElement>(null);
  const invitation = useSignal<Invitation | null>(null);
  const refusal = useSignal("");
  const { people: here, in_control } = people.value;
  useEffect(() => dialog.current?.focus(), []);
  const again = useSignal(0);
  useEffect(() => {
    invitation.value = null;
    if (!connected.value) return undefined;
    let [timer, isOver] = [0, false];
    void send({ type: "invite" }).then((reply) => {
      if (isOver) return;
      refusal.value = reply.error;
      invitation.value = reply.invitation;
      if (reply.invitation !== null) timer = setTimeout(() => (again.value += 1), 1000 * reply.invitation.good_s);
    });
    return () => {
      isOver = true;
      clearTimeout(timer);
    };
  }, [invitationEnded.value.number, connected.value, in_control, again.value]);
  useEffect(
    () => () => {
      if (invitation.peek() !== null) void send({ type: "end_invitation" });
    },
    [],
  );
  const close = (): void => void (devicesOpen.value = false);
  return (
    <div
      ref={dialog}
      class="sheet-over devices"
      role="dialog"
      aria-label="People and devices"
      tabIndex={-1}
      onKeyDown={(event) => {
        if (event.key === "Escape" && !event.shiftKey) close();
      }}
    >
      <div class="block-head">
        <h2>People and devices</h2>
        <button type="button" class="control" onClick={close}>
          Close
        </button>
      </div>
      <ul class="list">
        {here.map(({ id, name }) => (
          <li key={id}>
            <b>{name}</b>
            <span class="quiet">
              {[id === welcome.value?.you ? "this page" : "", id === in_control ? "in control" : ""].filter(Boolean).join(", ")}
            </span>
          </li>
        ))}
      </ul>
      {invitation.value !== null && <Address invitation={invitation.value} />}
      {refusal.value !== "" && (
        <p class="refusal" role="alert">
          {refusal.value}
        </p>
      )}
    </div>
  );
}

function Address({ invitation: { address, code, only_here } }: { invitation: Invitation }) {
  const size = code.length + 2 * QUIET;
  const dark = code.flatMap((row, y) => [...row].map((bit, x) => (bit === "1" ? `M${x + QUIET} ${y + QUIET}h1v1h-1z` : "")));
  return (
    <>
      <p class={only_here ? "caution-text" : "quiet"}>
        {only_here
          ? "This station answers on its own machine only. A phone needs one that was started with a certificate."
          : "Scan to let one device in. Each code is good once, for two minutes, while it is shown here."}
      </p>
      {!only_here && (
        <svg class="code" viewBox={`0 0 ${size} ${size}`} role="img" aria-label="QR code of the address" shape-rendering="crispEdges">
          <rect width={size} height={size} fill="#fff" />
          <path d={dark.join("")} fill="#000" />
        </svg>
      )}
      <button type="button" class="control" onClick={() => void copy(address)}>
        Copy the address
      </button>
    </>
  );
}

async function copy(address: string): Promise<void> {
  try {
    await navigator.clipboard.writeText(address);
    announce("Address copied. It lets one browser in.");
  } catch {
    announce(`Address: ${address}`);
  }
}
