import type { ComponentChildren, JSX } from 'preact';
import { useEffect, useState } from 'preact/hooks';

interface Props {
  /** Text that says what the second press does. */
  sure: string;
  class?: string;
  label?: string;
  disabled?: boolean;
  onConfirm: () => void;
  children: ComponentChildren;
}

/** A button that asks for confirmation: only a second press within four seconds acts. */
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
