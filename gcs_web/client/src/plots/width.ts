/** How large an element is, as long as it is on the page. */

import { useSignal } from "@preact/signals";
import type { Signal } from "@preact/signals";
import { useLayoutEffect } from "preact/hooks";
import type { RefObject } from "preact";

export interface Size {
  width: number;
  height: number;
}

/** In CSS pixels; 0 before the first layout. */
export function useWidth(box: RefObject<HTMLElement | null>): Signal<number> {
  const width = useSignal(0);
  useSize(box, (size) => (width.value = size.width));
  return width;
}

/** As `useWidth`, with the height. */
export function useBox(box: RefObject<HTMLElement | null>): Signal<Size> {
  const size = useSignal<Size>({ width: 0, height: 0 });
  useSize(box, (next) => (size.value = next));
  return size;
}

function useSize(box: RefObject<HTMLElement | null>, take: (size: Size) => void): void {
  useLayoutEffect(() => {
    const element = box.current;
    if (element === null) return undefined;
    const measure = (): void => take({ width: element.clientWidth, height: element.clientHeight });
    const observer = new ResizeObserver(measure);
    observer.observe(element);
    measure();
    return () => observer.disconnect();
  }, []);
}
