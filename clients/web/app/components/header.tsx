import type { ComponentChildren, JSX } from 'preact';
import { useEffect } from 'preact/hooks';
import { Link } from '../router';
import { Icon } from './icons';

interface Props {
  title: string;
  /** Path of the screen above this one. */
  back?: string;
  children?: ComponentChildren;
}

export function Header({ title, back, children }: Props): JSX.Element {
  useEffect(() => {
    document.title = title === 'Scenes' ? 'pepeseg' : `${title} – pepeseg`;
  }, [title]);
  return (
    <header class="top">
      {back ? (
        <Link to={back} class="button bare" label="Back">
          <Icon name="back" />
        </Link>
      ) : (
        <span class="logo" aria-hidden="true" />
      )}
      <h1>{title}</h1>
      <span class="spacer" />
      {children}
    </header>
  );
}
