#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/stage.h"
#include "core/train/settings/training_settings.h"

namespace pepeseg {

// A stage that a training is expected to run.
struct PlannedStage {
  // Consecutive steps of the stage that cost about the same.
  struct Piece {
    int64_t num_steps = 0;
    double seconds_per_step = 0;
  };

  Stage stage = Stage::kPrepare;
  // Expected time on the processor that `on_device` names, seconds. Absent: unknown before it runs.
  std::optional<double> seconds = {};
  bool on_device = false;          // true: computes on a GPU; false: on the host's cores
  std::vector<Piece> pieces = {};  // in order; empty: all steps cost the same
};

// Facts that decide which stages run, and how long each takes; see core/train/training_facts.h.
struct TrainingFacts {
  bool has_poses = false, has_masks = false, has_depth = false, has_gaussians = false;
  bool is_video = false;            // all photographs are frames of videos
  bool has_priors_command = false;  // a program of unknown speed makes masks and depth
  bool has_sam = false;             // SAM is installed
  bool on_device = false;           // true: a GPU computes; false: the host's cores
  bool has_lpips = false;
  int num_threads = 1;
  int64_t num_photographs = 0;
  double video_megapixels = 0;  // frames of the videos times their pixels; 0: unknown, or no videos
  std::optional<int64_t> num_to_segment;  // photographs left for SAM to segment. Absent: all
  double megapixels = 1;                  // mean size of a view, as it is trained on
  double photo_megapixels = 1;            // mean size of a photograph as it is stored
};

// Returns the stages that run, in order, with their expected times: core seconds on x86-64 with
// AVX-512 divided by the number of threads, and seconds of an H200 where a GPU computes. Once a
// stage has measured its pace, only the ratios matter.
std::vector<PlannedStage> PlanStages(const TrainingFacts& facts, const TrainingSettings& settings);

// Returns true if stage "priors" runs before stage one: where the operator's command is expected to
// make something, or nothing is to be made. Else it runs after the scores, and SAM computes
// meanwhile.
bool PriorsComeFirst(const TrainingFacts& facts, const PriorOptions& priors);

// Returns true if stage "sfm" or "priors" may start a program: COLMAP, or the priors command.
bool RunsPrograms(const TrainingFacts& facts, const PriorOptions& priors);

}  // namespace pepeseg
