// Work of the pointer and the keys in a photograph: clicks, boxes, strokes, and the cursor of the keyboard.
// Zoom and pan are in use_zoom.ts. Positions are pixels of the photograph.
import { useLayoutEffect, useRef, useState } from 'preact/hooks';
import type { Brush } from './brush';
import { continued, strokeWidth } from './brush';
import type { Spot } from './marks';
import { drawingWidth } from './marks';
import type { Size } from './photo_frame';
import type { Box, Point, Stroke } from './prompt';

export const tools = ['include', 'exclude', 'box', 'brush', 'lasso', 'paint', 'erase'] as const;

export type Tool = (typeof tools)[number];

/** Returns whether the tool draws as wide as the brush is. */
export function isWide(tool: Tool): boolean {
  return tool === 'brush' || tool === 'paint' || tool === 'erase';
}

/** Returns whether the tool draws lines. */
export function drawsLines(tool: Tool): boolean {
  return isWide(tool) || tool === 'lasso';
}

/** A press that moves less than this, in screen pixels, is a click. */
const clickSlack = 5;
/** Step of the keyboard's cursor, in units of the drawing. */
const keyStep = 8;

const arrows: Record<string, readonly [number, number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};

function boxOf(a: Spot, b: Spot): Box {
  const [x, y] = [Math.min(a.x, b.x), Math.min(a.y, b.y)];
  return { x, y, width: Math.abs(a.x - b.x), height: Math.abs(a.y - b.y) };
}

/** What follows the pointer while nothing is pressed: see ClickPreview. */
export interface PointerWatch {
  move(view: string, point: Point, slack: number): void;
  hold(): void;
  leave(): void;
}

export interface DrawingProps {
  /** Name of the view. */
  readonly view: string;
  readonly photo: Size;
  readonly tool: Tool;
  readonly brush: Brush;
  readonly watch: PointerWatch;
  /** Called when the keyboard moves the cursor. */
  readonly onCursor?: ((spot: Spot) => void) | undefined;
  readonly onPoint: (point: Point) => void;
  readonly onBox: (box: Box) => void;
  readonly onStroke: (stroke: Stroke) => void;
}

/** Where the photograph is on the screen: see use_zoom.ts. */
interface Placed {
  readonly zoom: { readonly scale: number };
  readonly placed: Size;
  readonly isPanning: boolean;
  spotOf(event: PointerEvent): Spot;
  reveal(spot: Spot): void;
}

export function useDrawing(props: DrawingProps, frame: Placed) {
  const { view, photo, tool, brush, watch, onCursor, onPoint, onBox, onStroke } = props;
  const { width, height } = photo;
  const { zoom, placed, spotOf } = frame;
  const pressed = useRef<(Spot & { screenX: number; screenY: number }) | undefined>(undefined);
  const [box, setBox] = useState<Box>();
  const [stroke, setStroke] = useState<Stroke>();
  const [cursor, setCursor] = useState<Spot>();
  /** Position of the mouse, where the brush shows its width. */
  const [mouse, setMouse] = useState<Spot>();

  const isDrag = ({ clientX, clientY }: PointerEvent) => {
    const from = pressed.current;
    return !!from && Math.hypot(clientX - from.screenX, clientY - from.screenY) > clickSlack;
  };
  const isLine = drawsLines(tool);
  const hasWidth = isWide(tool);
  const lineWidth = hasWidth ? strokeWidth(brush, width) : 0;
  const newStroke = ({ x, y }: Spot, shift: boolean): Stroke => {
    const isNot = tool === 'brush' ? brush.negative : tool === 'erase';
    return { path: [{ x, y }], negative: hasWidth && shift !== isNot, width: lineWidth };
  };
  const pointAt = ({ x, y }: Spot, shift: boolean): Point => {
    return { x, y, negative: shift || tool === 'exclude' };
  };
  const drop = () => {
    pressed.current = undefined;
    setBox(undefined);
    setStroke(undefined);
  };
  const finish = () => {
    if (stroke) onStroke(stroke);
    drop();
  };

  const press = (event: PointerEvent) => {
    if (event.button !== 0) return;
    pressed.current = { ...spotOf(event), screenX: event.clientX, screenY: event.clientY };
    watch.hold();
    if (isLine) setStroke(newStroke(spotOf(event), event.shiftKey));
    // A finger scrolls the page, unless it draws.
    if (event.pointerType !== 'touch' || tool === 'box' || isLine) {
      (event.currentTarget as Element).setPointerCapture(event.pointerId);
    }
  };
  /** Shows what a click would give. */
  const preview = (event: PointerEvent, spot: Spot) => {
    const clicks = tool === 'include' || tool === 'exclude';
    if (!clicks || frame.isPanning || event.pointerType === 'touch') return watch.leave();
    const slack = (clickSlack * width) / Math.max(placed.width, 1);
    return watch.move(view, pointAt(spot, event.shiftKey), slack);
  };
  const move = (event: PointerEvent) => {
    const spot = spotOf(event);
    if (hasWidth && event.pointerType !== 'touch') setMouse(spot);
    if (!pressed.current) {
      if (event.buttons === 0) preview(event, spot);
      return;
    }
    if (isLine) {
      setStroke((begun) => begun && continued(begun, spot, width / zoom.scale));
    } else if (isDrag(event)) {
      watch.leave();
      setBox(boxOf(pressed.current, spot));
    }
  };
  const release = (event: PointerEvent) => {
    const from = pressed.current;
    if (!from) return;
    if (isLine) return finish();
    const dragged = isDrag(event);
    drop();
    if (dragged) {
      const drawn = boxOf(from, spotOf(event));
      if (drawn.width >= 2 && drawn.height >= 2) onBox(drawn);
    } else {
      onPoint(pointAt(from, event.shiftKey));
    }
  };
  const enter = (at: Spot, shift: boolean) => {
    setCursor(at);
    if (!isLine) onPoint(pointAt(at, shift));
    else if (stroke) finish();
    else setStroke(newStroke(at, shift));
  };
  const key = (event: KeyboardEvent) => {
    const at = cursor ?? { x: width / 2, y: height / 2 };
    const arrow = arrows[event.key];
    if (arrow) {
      const step = ((event.shiftKey ? keyStep * 5 : keyStep) * width) / drawingWidth / zoom.scale;
      const x = Math.min(Math.max(at.x + arrow[0] * step, 0), width - 1);
      const y = Math.min(Math.max(at.y + arrow[1] * step, 0), height - 1);
      setCursor({ x, y });
      if (onCursor) onCursor({ x, y });
      frame.reveal({ x, y });
      setStroke((begun) => begun && continued(begun, { x, y }, width / zoom.scale));
    } else if (event.key === 'Enter') {
      enter(at, event.shiftKey);
    } else if (event.key === 'Escape' && stroke) {
      drop();
    } else {
      return;
    }
    event.preventDefault();
    event.stopPropagation();
  };
  // Before the next event, which may begin something with the new tool.
  useLayoutEffect(() => {
    drop();
    watch.leave();
  }, [view, tool, watch]);

  return {
    box,
    stroke,
    /** Position of the keyboard's cursor. */
    cursor,
    mouse: hasWidth ? mouse : undefined,
    brushWidth: hasWidth ? lineWidth : undefined,
    /** Ends what was begun, when a gesture takes the pointer. */
    interrupt: () => {
      drop();
      watch.leave();
    },
    handlers: {
      onPointerDown: press,
      onPointerMove: move,
      onPointerUp: release,
      onPointerCancel: () => {
        drop();
        watch.leave();
      },
      onPointerLeave: () => {
        setMouse(undefined);
        watch.leave();
      },
      onKeyDown: key,
      onFocus: (event: FocusEvent) =>
        (event.currentTarget as Element).matches(':focus-visible') &&
        setCursor(cursor ?? { x: width / 2, y: height / 2 }),
      onBlur: () => {
        setCursor(undefined);
        drop();
      },
    },
  };
}
