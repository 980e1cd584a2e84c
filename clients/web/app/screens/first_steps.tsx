// What to do on a server without scenes of one's own.
import type { JSX } from 'preact';
import type { Scene } from '../../gen/pepeseg/v1/scene_service_pb';
import { sceneIdOf } from '../api/clients';
import { FileButtons } from '../components/drop_zone';
import type { IconName } from '../components/icons';
import { Icon } from '../components/icons';
import { Link } from '../router';
import type { DroppedFile } from '../upload/dataset_files';

interface Props {
  /** The sample scene, if the server has it. */
  sample: Scene | undefined;
  onFiles: (files: DroppedFile[]) => void;
}

interface Step {
  readonly icon: IconName;
  readonly title: string;
  readonly text: string;
}

const steps: readonly Step[] = [
  {
    icon: 'upload',
    title: 'Drop photographs',
    text: 'Twenty or more of the same things, from all around. A phone takes good ones.',
  },
  {
    icon: 'cube',
    title: 'Wait',
    text: 'The scene appears while it is trained. Clicks work before it is done.',
  },
  {
    icon: 'plus',
    title: 'Click',
    text: 'A click outlines a thing, in all photographs and in 3D.',
  },
];

export function FirstSteps({ sample, onFiles }: Props): JSX.Element {
  return (
    <section class="first-steps" aria-labelledby="first-title">
      <h2 id="first-title">Your first scene</h2>
      <ol>
        {steps.map(({ icon, title, text }) => (
          <li key={title}>
            <Icon name={icon} />
            <div>
              <strong>{title}</strong>
              <p class="quiet">{text}</p>
            </div>
          </li>
        ))}
      </ol>
      <div class="drop">
        <p>
          <strong>Drop photographs anywhere on this page, or choose them</strong>
        </p>
        <FileButtons onFiles={onFiles} />
      </div>
      {sample && (
        <p class="row wrap center">
          <span class="quiet">Only want to look?</span>
          <Link to={`/scenes/${sceneIdOf(sample.name)}`} class="button">
            <Icon name="photo" />
            Open the sample
          </Link>
        </p>
      )}
    </section>
  );
}
