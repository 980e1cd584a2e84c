import type { JSX } from 'preact';

/** Stands for the sections that need a finished model. */
export function AfterTraining(): JSX.Element {
  return (
    <section aria-labelledby="after-title">
      <h2 id="after-title">After the training</h2>
      <p class="quiet">
        The 3D view, “everything”, finding, names, selections and downloads come with the finished
        model.
      </p>
    </section>
  );
}
