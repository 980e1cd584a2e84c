// The workbench of a job while it trains. When the job has made its model, it moves there by itself.
import type { JSX } from 'preact';
import { useEffect, useMemo, useState } from 'preact/hooks';
import type { Job } from '../../gen/pepeseg/v1/job_service_pb';
import { JobState } from '../../gen/pepeseg/v1/job_service_pb';
import { sceneIdOf } from '../api/clients';
import { FailureNote } from '../components/failure_note';
import { Header } from '../components/header';
import { renamePath } from '../router';
import type { Layout } from '../scene/layout';
import { useLayout } from '../scene/layout';
import { LayoutSwitch } from '../scene/layout_switch';
import { isJob } from '../scene/subject';
import { SceneWorkbench } from '../scene/workbench';
import { hasEnded } from '../training/job_states';
import { TrainingBanner } from '../training/training_banner';
import { TrainingOutcome } from '../training/training_outcome';
import { useTraining } from '../training/training_watch';
import { useModelViews } from './model_views';
import { useSceneName } from './training_screen';

interface ClicksProps {
  job: Job;
  layout: Layout;
  /** Model that is shown, once its views are there. */
  onShown: (model: string) => void;
}

function Clicks({ job, layout, onShown }: ClicksProps): JSX.Element {
  /** Model that was made, or chosen, on this screen. */
  const [chosen, setChosen] = useState('');
  const { value, failure, ask } = useModelViews(chosen || job.model || job.name);
  useEffect(() => {
    if (value) onShown(value.model);
  }, [value]);
  if (failure) return <FailureNote failure={failure} again={ask} />;
  if (!value) {
    return (
      <p class="loading" role="status">
        Waiting for the first state of the training that answers clicks …
      </p>
    );
  }
  const subject = { scene: job.scene, model: value.model, photos: job.dataset };
  return (
    <SceneWorkbench subject={subject} views={value.views} layout={layout} onModel={setChosen} />
  );
}

export function EarlyClicksScreen({ jobId }: { jobId: string }): JSX.Element {
  const { training, failure } = useTraining(`jobs/${jobId}`);
  const { job } = training;
  const [shown, setShown] = useState('');
  const name = useSceneName(job?.scene);
  const layout = useLayout();
  const isLost = job && hasEnded(job.state) && job.state !== JobState.SUCCEEDED;
  const has3d = shown !== '' && !isJob(shown);
  useEffect(() => {
    if (job && has3d) renamePath(`/scenes/${sceneIdOf(job.scene)}`);
  }, [has3d]);
  // Each step of the training draws its banner again, not the workbench.
  const clicks = useMemo(
    () => job && <Clicks job={job} layout={layout} onShown={setShown} />,
    [job?.name, job?.dataset, job?.model, layout.panes, layout.isPanelOpen],
  );
  return (
    <div class="screen wide">
      <Header title={name || 'Training'} back={has3d ? '/' : `/jobs/${jobId}`}>
        {shown !== '' && !isLost && <LayoutSwitch layout={layout} has3d={has3d} />}
      </Header>
      <main>
        <FailureNote failure={failure} />
        {!job && !failure && (
          <p class="loading" role="status">
            Asking for the training …
          </p>
        )}
        {isLost && <TrainingOutcome training={training} />}
        {job && !isLost && <TrainingBanner training={training} isReady={has3d} />}
        {!isLost && clicks}
      </main>
    </div>
  );
}
