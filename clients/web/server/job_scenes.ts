// The scenes of jobs. The name of a job stands for its model while it trains, and has no scene in it, by
// which the gateway routes calls. The app watches a job before it asks its model, so the scene is in an
// answer that came through this back end. Where it did not, any server behind the gateway answers.
import type { DescMessage, MessageShape } from '@bufbuild/protobuf';
import { isMessage } from '@bufbuild/protobuf';
import type { Job } from '../gen/pepeseg/v1/job_service_pb';
import { JobEventSchema, JobSchema, ListJobsResponseSchema } from '../gen/pepeseg/v1/job_service_pb';

/** Maximum number of jobs that are remembered. */
const maxJobs = 1000;

const scenes = new Map<string, string>();

function jobsIn(message: MessageShape<DescMessage>): readonly Job[] {
  if (isMessage(message, JobSchema)) return [message];
  if (isMessage(message, ListJobsResponseSchema)) return message.jobs;
  if (isMessage(message, JobEventSchema) && message.event.case === 'snapshot') {
    return [message.event.value];
  }
  return [];
}

/** Remembers the scenes of the jobs in an answer of the server. */
export function learnScenes(message: MessageShape<DescMessage>): void {
  for (const { name, scene } of jobsIn(message)) {
    if (name === '' || scene === '') continue;
    scenes.delete(name);
    scenes.set(name, scene);
    const [oldest] = scenes.keys();
    if (scenes.size > maxJobs && oldest !== undefined) scenes.delete(oldest);
  }
}

/** Returns the name of a job's scene; undefined if it is not known. */
export function sceneOfJob(job: string): string | undefined {
  return scenes.get(job);
}
