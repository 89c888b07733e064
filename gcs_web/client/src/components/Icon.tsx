/** The few drawn signs of the page; decoration beside words, so hidden from screen readers. */

const PATHS = {
  goshawk: "M1 5l7 3 7-3-3 5-4-1-4 1zM6 11l2 3 2-3",
  check: "M3 8.5l3.2 3.2L13 5",
  warning: "M8 2.5l6.2 11H1.8zM8 6.5v3.4M8 11.6v.6",
  unknown: "M5 6a3 3 0 114.2 2.7c-.8.4-1.2.9-1.2 1.8M8 13v.2",
  down: "M4 6l4 4 4-4",
  play: "M5 3.5v9l7-4.5z",
  pause: "M5 3.5v9M11 3.5v9",
  sound: "M2 6h2.5L8 3v10L4.5 10H2zM10.5 5.5a3.5 3.5 0 010 5M12.5 3.5a6.4 6.4 0 010 9",
  muted: "M2 6h2.5L8 3v10L4.5 10H2zM11 6l4 4M15 6l-4 4",
  stop: "M5.4 2h5.2L14 5.4v5.2L10.6 14H5.4L2 10.6V5.4z",
} as const;

export function Icon({ name, filled = false }: { name: keyof typeof PATHS; filled?: boolean }) {
  return (
    <svg class="icon" viewBox="0 0 16 16" width="14" height="14" aria-hidden="true">
      <path
        d={PATHS[name]}
        fill={filled ? "currentColor" : "none"}
        stroke="currentColor"
        stroke-width="1.6"
        stroke-linecap="round"
        stroke-linejoin="round"
      />
    </svg>
  );
}
