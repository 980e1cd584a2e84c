// The subject of a workbench: a model, or a job whose newest state stands for its model while it trains.

export interface Subject {
  /** Name of the scene. */
  readonly scene: string;
  /** Name of the model, or of the job. */
  readonly model: string;
  /** Name of the dataset or model that has the photographs. */
  readonly photos: string;
}

/**
 * Returns whether this names a job. A job answers prompts and renders; names, finds, selections and exports
 * come with its model. "Everything" waits for the model, too: an id of a segment holds for one state only.
 */
export function isJob(model: string): boolean {
  return model.startsWith('jobs/');
}
