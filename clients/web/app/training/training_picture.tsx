// The scene in a picture while it is trained.
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import { pictureUrl, scenes } from '../api/clients';
import { useAsked } from '../api/use_asked';
import { ScenePhoto } from '../components/photo';
import { countText, durationText } from '../format';
import type { Shown, Training } from './training_watch';

/** Longer side of the model's rendering, pixels. */
const modelSide = 1280;

/** Returns the URL of the new model's rendering of its first view; undefined while there is none. */
function usePreview(model: string | undefined): string | undefined {
  const { value } = useAsked(
    async (signal) => {
      if (!model) return undefined;
      const { views } = await scenes.listViews({ parent: model, pageSize: 1 }, { signal });
      return views[0] && pictureUrl(model, views[0].view, modelSide);
    },
    [model],
  );
  return value;
}

/** The newest picture of the scene as it is being trained. */
function Picture({ picture }: { picture: Shown }): JSX.Element {
  const step = `step ${countText(picture.step)} of ${countText(picture.numSteps)}`;
  return (
    <figure class="training-picture">
      <img src={picture.url} alt={`${picture.view} as it is being trained: ${step}`} />
      <figcaption>
        {step}
        {picture.seconds !== undefined && `, after ${durationText(picture.seconds)}`}
      </figcaption>
    </figure>
  );
}

/** The scene in a picture: of its model once that is drawn, of the training, or its first photograph. */
export function TrainingPicture({ training }: { training: Training }): JSX.Element | null {
  const { job, picture } = training;
  const preview = usePreview(job?.model);
  const [drawn, setDrawn] = useState('');
  if (!job) return null;
  const isDrawn = preview !== undefined && drawn === preview;
  return (
    <div class="training-stage">
      {preview && (
        <img src={preview} alt="The finished model" hidden={!isDrawn} onLoad={() => setDrawn(preview)} />
      )}
      {!isDrawn && picture && <Picture picture={picture} />}
      {!isDrawn && !picture && <ScenePhoto scene={job.scene} parent={job.dataset} />}
    </div>
  );
}
