// Chooses the screen by the path, so that a reload and the browser's back button work.
import type { ComponentChildren, JSX } from 'preact';
import { Store, useStore } from './store';

export type Route =
  | { screen: 'scenes' }
  | { screen: 'new' }
  | { screen: 'upload'; upload: string }
  | { screen: 'scene'; scene: string }
  | { screen: 'training'; job: string }
  | { screen: 'clicks'; job: string };

export function parsePath(path: string): Route {
  const [first, second, third] = path.split('/').filter(Boolean).map(decodeURIComponent);
  if (first === 'new') return { screen: 'new' };
  if (first === 'uploads' && second) return { screen: 'upload', upload: second };
  if (first === 'scenes' && second) return { screen: 'scene', scene: second };
  if (first === 'jobs' && second && third === 'clicks') return { screen: 'clicks', job: second };
  if (first === 'jobs' && second) return { screen: 'training', job: second };
  return { screen: 'scenes' };
}

const place = new Store(location.pathname);
window.addEventListener('popstate', () => place.set(location.pathname));

export function useRoute(): Route {
  return parsePath(useStore(place));
}

export function goTo(path: string, replace = false): void {
  if (replace) history.replaceState(null, '', path);
  else history.pushState(null, '', path);
  place.set(location.pathname);
  window.scrollTo(0, 0);
}

/** Shows another path of what is on the screen, which stays. */
export function renamePath(path: string): void {
  history.replaceState(null, '', `${path}${location.search}`);
}

/** Returns the value of a name in the URL's query; undefined without one. */
export function queryValue(name: string): string | undefined {
  return new URLSearchParams(location.search).get(name) ?? undefined;
}

/** Sets a value in the URL's query, or takes it out, without an entry in the browser's history. */
export function setQueryValue(name: string, value: string | undefined): void {
  if (queryValue(name) === value) return;
  const query = new URLSearchParams(location.search);
  if (value === undefined) query.delete(name);
  else query.set(name, value);
  const text = query.toString();
  history.replaceState(null, '', `${location.pathname}${text ? `?${text}` : ''}`);
}

interface LinkProps {
  to: string;
  class?: string;
  label?: string;
  current?: boolean;
  children: ComponentChildren;
}

export function Link({ to, class: className, label, current, children }: LinkProps): JSX.Element {
  const follow = (event: MouseEvent) => {
    if (event.ctrlKey || event.metaKey || event.shiftKey || event.button !== 0) return;
    event.preventDefault();
    goTo(to);
  };
  return (
    <a
      href={to}
      class={className}
      aria-label={label}
      aria-current={current ? 'page' : undefined}
      onClick={follow}
    >
      {children}
    </a>
  );
}
