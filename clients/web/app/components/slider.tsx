import type { JSX } from 'preact';

interface Props {
  id: string;
  name: string;
  /** What the value means. */
  text: string;
  ends?: readonly [string, string];
  min: number;
  max: number;
  step: number;
  value: number;
  disabled?: boolean;
  onInput: (value: number) => void;
  /** Called when the slider is released. */
  onChange?: () => void;
}

export function Slider({ id, name, text, ends, onInput, ...input }: Props): JSX.Element {
  return (
    <div class={`slider ${ends ? '' : 'line'}`}>
      <label for={id}>{name}</label>
      <output for={id}>{text}</output>
      <input
        id={id}
        type="range"
        aria-valuetext={text}
        onInput={(event) => onInput(Number(event.currentTarget.value))}
        {...input}
      />
      {ends && (
        <span class="ends" aria-hidden="true">
          <span>{ends[0]}</span>
          <span>{ends[1]}</span>
        </span>
      )}
    </div>
  );
}
