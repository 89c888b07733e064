/** Files of this computer, sent to the station. */

import { announce } from "./store";

/** Send a file, under its name; what kept it back, empty for nothing. */
export async function sendFile(file: File): Promise<string> {
  announce(`Sending ${file.name} ...`);
  try {
    const answer = await fetch(`/incoming/${encodeURIComponent(file.name)}`, { method: "PUT", body: file });
    return answer.ok ? "" : await answer.text();
  } catch {
    return `${file.name} could not be sent: no answer from the ground station`;
  }
}
