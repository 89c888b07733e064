/** All commands by name: type a part of it, arrows choose, Enter runs. */

import { useSignal } from "@preact/signals";
import { useLayoutEffect, useRef } from "preact/hooks";
import { COMMANDS } from "./commands";
import { paletteOpen } from "../../core/store";
import { Keys } from "../../components/Keys";

export function Palette() {
  const text = useSignal("");
  const chosen = useSignal(0);
  const input = useRef<HTMLInputElement>(null);
  const opener = useRef<Element | null>(null);

  useLayoutEffect(() => {
    opener.current = document.activeElement;
    input.current?.focus();
    return () => opener.current instanceof HTMLElement && opener.current.focus();
  }, []);

  const words = text.value.toLowerCase().split(/\s+/);
  const found = COMMANDS.filter(
    ({ name, enabled }) => enabled() && words.every((word) => name.toLowerCase().includes(word)),
  );
  const index = Math.min(chosen.value, found.length - 1);
  const close = (): void => {
    paletteOpen.value = false;
  };
  const runChosen = (at: number): void => {
    close();
    found[at]?.run();
  };
  const onKeyDown = (event: KeyboardEvent): void => {
    const by = event.key === "ArrowDown" ? 1 : event.key === "ArrowUp" ? -1 : 0;
    if (by !== 0) chosen.value = Math.max(0, Math.min(found.length - 1, index + by));
    else if (event.key === "Enter") runChosen(index);
    else if (event.key === "Escape") close();
    else return;
    event.preventDefault();
    document.getElementById(`command-${chosen.value}`)?.scrollIntoView({ block: "nearest" });
  };
  return (
    <div class="sheet-over palette" role="dialog" aria-label="Commands" onKeyDown={onKeyDown}>
      <input
        ref={input}
        role="combobox"
        aria-label="Find a command"
        aria-expanded="true"
        aria-controls="command-list"
        aria-activedescendant={found.length > 0 ? `command-${index}` : undefined}
        placeholder="Find a command"
        autoComplete="off"
        value={text.value}
        onInput={(event) => {
          text.value = event.currentTarget.value;
          chosen.value = 0;
        }}
        onBlur={(event) =>
          !(event.relatedTarget instanceof Element && event.relatedTarget.closest(".palette")) && close()
        }
      />
      <ul id="command-list" role="listbox" aria-label="Commands">
        {found.map((command, at) => (
          <li
            key={command.name}
            id={`command-${at}`}
            role="option"
            aria-selected={at === index}
            onPointerDown={(event) => {
              event.preventDefault();
              runChosen(at);
            }}
          >
            {command.name}
            {command.keys?.[0] !== undefined && <Keys of={command.keys[0]} />}
          </li>
        ))}
      </ul>
      {found.length === 0 && <p class="quiet">No command has “{text.value}” in its name.</p>}
    </div>
  );
}
