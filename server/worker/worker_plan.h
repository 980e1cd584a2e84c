#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "server/api/convert.h"
#include "server/worker/job_eta.h"
#include "server/worker/worker_job.h"

namespace pepeseg {

// What decides which stages a job runs, and how long each takes.
struct JobFacts {
  bool has_poses = false, has_masks = false, has_depth = false, has_gaussians = false;
  bool is_video = false;            // no photographs but frames of videos
  bool has_priors_command = false;  // a program of unknown speed makes masks and depth
  bool has_sam = false;             // SAM is installed
  bool on_device = false;           // a GPU computes, else the cores do
  bool has_lpips = false;
  int num_threads = 1;
  int64_t num_photographs = 0;
  std::optional<int64_t> num_to_segment;  // photographs that SAM has still to segment; absent: all
  double megapixels = 1;                  // of a view that is trained on
};

// Before any file is read: a view is taken to have a megapixel.
JobFacts FactsOf(const WorkerJob& job, const TrainingSettings& settings);
// Replaces what was assumed of photographs by what was read.
void SetViews(const Capture& capture, JobFacts& facts);

// The stages that run, in order, with what each is expected to take: core seconds on x86-64 with
// AVX-512 divided by the threads, and the steps of an H200 where a GPU computes. Only their ratios
// matter once a pace is measured (JobEta).
std::vector<PlannedStage> PlanStages(const JobFacts& facts, const TrainingSettings& settings);

}  // namespace pepeseg
