#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/priors/priors.h"
#include "core/train/photograph_segmentation.h"
#include "core/train/priors_command.h"
#include "core/train/settings/training_settings.h"
#include "core/train/stage_log.h"
#include "core/train/training_inputs.h"

namespace pepeseg {

// Stage "priors": makes masks and depth maps where a dataset has none. The operator's command runs
// first; what it does not make, SAM (masks only) or the built-in methods make. PriorMaker decides
// which of them may run.
class PriorStage {
 public:
  // The arguments must outlive it.
  PriorStage(const TrainingInputs& inputs, const TrainingSettings& settings, StageLog& stages)
      : inputs_(inputs), settings_(settings), stages_(stages) {}

  // Starts to segment the photographs among `files` on threads of its own, next to the stages
  // before this one, if SAM is expected to make the masks. Does nothing when called again.
  void StartSam(const std::vector<DatasetFile>& files);
  // Starts to make the built-in priors of the scene's views on threads of its own, next to stage
  // one, if they are expected. Stage one must not change the capture meanwhile.
  void StartEmbedding(const TrainingScene& scene);
  // Returns the number of training photographs that SAM has still to segment; nullopt: SAM has not
  // started.
  std::optional<int64_t> NumToSegment(const Capture& capture) const;

  // Runs the stage, or skips it if there is nothing to make. Adds masks and depth to the views of
  // `scene.capture`, and to the scene's files and sources. Returns FAILED_PRECONDITION when the
  // command was requested by name and fails or does not exist. Without such a request a failure of
  // the command is a warning, as is one of SAM.
  absl::Status Run(TrainingScene& scene);

 private:
  PriorWants Asked(const TrainingScene& scene) const;
  EmbeddedPriors Embedded(PriorWants wants) const;
  absl::Status MakeByCommand(PriorWants asked, TrainingScene& scene);
  absl::Status TakeFromCommand(PriorWants wants, TrainingScene& scene);
  absl::Status RecordMade(const std::vector<DatasetFile>& made, bool masks, TrainingScene& scene);
  absl::Status MakeOthers(PriorWants asked, TrainingScene& scene);
  absl::Status TakeMasksOfSam(TrainingScene& scene);
  absl::Status Embed(EmbeddedPriors what, double share, TrainingScene& scene);
  bool MayUseSam() const;
  bool HasCommand() const { return !inputs_.tools.priors_command.program.empty(); }

  const TrainingInputs& inputs_;
  const TrainingSettings& settings_;
  StageLog& stages_;
  std::optional<PhotographSegmentation> segmentation_;  // absent: SAM has not started, or is done
  std::optional<EmbeddingTask> embedding_;              // absent: not started, or done
};

}  // namespace pepeseg
