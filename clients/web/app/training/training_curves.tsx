import type { JSX } from 'preact';
import { Curve } from './curve';
import type { Training } from './training_watch';

/** The curves of the stages that have some. */
export function TrainingCurves({ training }: { training: Training }): JSX.Element {
  const { job, loss, psnr, gaussians, featureLoss } = training;
  const steps = job?.effectiveOptions?.reconstruct?.numSteps ?? 0;
  const featureSteps = job?.effectiveOptions?.features?.numSteps ?? 0;
  return (
    <div class="curves">
      <Curve title="Loss" samples={loss} numSteps={steps} digits={4} />
      <Curve title="Training PSNR" unit="dB" samples={psnr} numSteps={steps} />
      <Curve title="Gaussians" samples={gaussians} numSteps={steps} digits={0} />
      <Curve title="Loss of features" samples={featureLoss} numSteps={featureSteps} digits={4} />
    </div>
  );
}
