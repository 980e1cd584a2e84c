import type { ComponentChildren, JSX } from 'preact';
import { useEffect, useState } from 'preact/hooks';

interface Props {
  /** What the second press does, in words. */
  sure: string;
  class?: string;
  label?: string;
  disabled?: boolean;
  onConfirm: () => void;
  children: ComponentChildren;
}

/** Asks once more in its own place: the second press within four seconds does it. */
export function ConfirmButton({ sure, onConfirm, children, label, ...rest }: Props): JSX.Element {
  const [asking, setAsking] = useState(false);
  useEffect(() => {
    if (!asking) return undefined;
    const timer = setTimeout(() => setAsking(false), 4000);
    return () => clearTimeout(timer);
  }, [asking]);
  const press = () => {
    setAsking(!asking);
    if (asking) onConfirm();
  };
  return (
    <button
      type="button"
      {...rest}
      class={`${rest.class ?? ''} ${asking ? 'danger' : ''}`}
      aria-label={asking ? undefined : label}
      onClick={press}
    >
      {asking ? sure : children}
    </button>
  );
}
