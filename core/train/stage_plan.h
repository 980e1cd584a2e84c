#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/capture.h"
#include "core/train/training_inputs.h"
#include "core/train/training_settings.h"

namespace pepeseg {

// A stage that a training is expected to run.
struct PlannedStage {
  // A run of the stage's steps that cost about the same.
  struct Piece {
    int64_t num_steps = 0;
    double seconds_per_step = 0;
  };

  std::string name;
  // Expected seconds on the processor that `on_device` names. Absent: unknown before it runs.
  std::optional<double> seconds = {};
  bool on_device = false;          // computes on a GPU, else on the host's cores
  std::vector<Piece> pieces = {};  // in order; empty: all steps cost the same
};

// What decides which stages run, and how long each takes.
struct TrainingFacts {
  bool has_poses = false, has_masks = false, has_depth = false, has_gaussians = false;
  bool is_video = false;            // all photographs are frames of videos
  bool has_priors_command = false;  // a program of unknown speed makes masks and depth
  bool has_sam = false;             // SAM is installed
  bool on_device = false;           // a GPU computes, else the cores do
  bool has_lpips = false;
  int num_threads = 1;
  int64_t num_photographs = 0;
  std::optional<int64_t> num_to_segment;  // photographs left for SAM to segment; absent: all
  double megapixels = 1;                  // of a view that is trained on
};

// Facts known before any file is read: a photograph is assumed to have one megapixel.
TrainingFacts FactsOf(const TrainingInputs& inputs, const TrainingSettings& settings,
                      bool on_device);
// Replaces what was assumed of the photographs by what was read.
void SetViews(const Capture& capture, TrainingFacts& facts);

// The stages that run, in order, with what each is expected to take: core seconds on x86-64 with
// AVX-512 divided by the threads, and seconds of an H200 where a GPU computes. Once a stage has
// measured its pace, only the ratios matter.
std::vector<PlannedStage> PlanStages(const TrainingFacts& facts, const TrainingSettings& settings);

// Whether the stages "sfm" and "priors" may start a program: COLMAP, or the priors command.
bool RunsPrograms(const TrainingFacts& facts, const PriorOptions& priors);

}  // namespace pepeseg
