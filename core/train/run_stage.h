#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/base/progress.h"
#include "core/base/status_macros.h"
#include "core/model_files/checkpoint.h"
#include "core/train/stage_log.h"
#include "core/train/training_observer.h"

// The loop of stages one and two. `Trainer` is GaussianTrainer or FeatureTrainer.

namespace pepeseg {

// Returns a trainer, resumed from its farthest good checkpoint, which the log then reports, or
// created at step 0. checkpoints: null if none are kept. inputs: those of Trainer::Create. A
// checkpoint that does not fit is passed over; other errors are those of Create.
template <class Trainer, class... Inputs>
absl::StatusOr<std::unique_ptr<Trainer>> ResumeOrCreate(StageCheckpoints* checkpoints,
                                                        StageLog& log, Backend& backend,
                                                        const Inputs&... inputs) {
  std::unique_ptr<Trainer> trainer;
  // An error makes the next checkpoint be offered.
  const auto use = [&](const Checkpoint& file) -> absl::Status {
    ASSIGN_OR_RETURN(const auto state, Trainer::State::Read(file.sections));
    ASSIGN_OR_RETURN(trainer, Trainer::Resume(backend, inputs..., state));
    return absl::OkStatus();
  };
  if (checkpoints != nullptr) checkpoints->Resume(use);
  if (trainer == nullptr) return Trainer::Create(backend, inputs...);
  if (const int64_t step = checkpoints->first_step(); step > 0) log.ResumeAt(step);
  return trainer;
}

// Does the remaining steps and returns the result. Calls `progress` for each report; an error that
// it returns ends the stage with that error. It may call the trainer's Save().
template <class Trainer>
absl::StatusOr<typename Trainer::Product> RunSteps(Trainer& trainer, ProgressFn progress) {
  while (!trainer.done()) {
    ASSIGN_OR_RETURN(const StepReports reports, trainer.Step());
    for (const StepReport& report : reports) RETURN_IF_ERROR(progress(report));
  }
  return trainer.Result();
}

// Writes a checkpoint if one is due or if the report of a step, whose result is `reported`,
// cancelled the training. Returns `reported`. Its step may be behind the trainer's. Without
// `checkpoints` only returns `reported`.
template <class Trainer>
absl::Status SaveStep(absl::Status reported, Trainer& trainer, StageCheckpoints* checkpoints) {
  if (checkpoints == nullptr) return reported;
  const auto write = [&](const std::filesystem::path& path,
                         const CheckpointHeader& header) -> absl::Status {
    ASSIGN_OR_RETURN(const auto checkpoint, trainer.Save());
    RETURN_IF_ERROR(Validate(checkpoint));
    return WriteCheckpoint(path, header, SectionsOf(checkpoint));
  };
  if (absl::IsCancelled(reported)) checkpoints->Save(trainer.step(), write);
  if (reported.ok()) checkpoints->SaveIfDue(trainer.step(), write);
  return reported;
}

// Does the remaining steps and returns the result. Each step is followed by a report, which can
// cancel the training, by a checkpoint when one is due, and by `then`.
template <class Trainer>
absl::StatusOr<typename Trainer::Product> RunStage(
    Trainer& trainer, StageCheckpoints* checkpoints, StageLog& log,
    ProgressFn then = [](const StepReport&) { return absl::OkStatus(); }) {
  RETURN_IF_ERROR(log.ReportSkipped(trainer.skipped()));
  const Polling polling(log.observer());
  return RunSteps(trainer, [&](const StepReport& report) -> absl::Status {
    RETURN_IF_ERROR(log.ReportSkipped(trainer.skipped()));
    RETURN_IF_ERROR(SaveStep(log.Step(report), trainer, checkpoints));
    return then(report);
  });
}

}  // namespace pepeseg
