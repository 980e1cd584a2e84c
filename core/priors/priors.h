#pragma once

#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <stop_token>
#include <thread>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "core/base/options.h"
#include "core/scene/capture.h"

namespace pepeseg {

// Source of masks or depth maps for a dataset that brings none.
enum class PriorMaker {
  // The operator's command if there is one and it succeeds; else SAM, for masks and where it is
  // installed; else the built-in method. Depth is then made with built-in masks only, which it
  // gives better borders: next to other masks it gains nothing
  // (tests/bench/results/bare_photographs.md).
  kAuto = 0,
  kNone = 1,
  kEmbedded = 2,        // the built-in method, see EmbedPriors
  kCommand = 3,         // the operator's command; the job fails if it does
  kSam = 4,             // masks only: a small SAM, see sam/sam_segmenter.h
  kSamAndEmbedded = 5,  // masks only: SAM's and the built-in ones, without duplicates
};

// Returns true for kSam and kSamAndEmbedded.
bool AsksForSam(PriorMaker maker);
// Returns true if SAM is expected to make the masks: where it is installed and either asked for, or
// free to be used and the operator has no command. It also makes them if a command fails, which is
// not expected.
bool ExpectsSam(PriorMaker masks, bool has_command, bool has_sam);

// Options of the priors stage.
struct PriorOptions {
  // Maker of the masks of a dataset that has none, or whose masks are not used.
  PriorMaker masks = PriorMaker::kAuto;
  // Maker of the depth maps of a dataset that has none, or whose maps are not used. Never SAM.
  PriorMaker depth = PriorMaker::kAuto;
};
// Passes each option with its words to `visit`.
void VisitOptions(PriorOptions& options, OptionVisitor visit);
// Returns INVALID_ARGUMENT for a value outside the enum, and for SAM as the maker of depth.
absl::Status Validate(const PriorOptions& options);

// Priors to compute.
struct EmbeddedPriors {
  bool masks = false, depth = false;
};

// Computes masks and depth without a network (embedded_masks.h, embedded_depth.h) for each training
// view that has none, on threads of its own; depth first, because it helps to find the masks'
// borders. Held-out views are left as they are. The result does not depend on the number of
// threads.
class EmbeddingTask {
 public:
  // Starts. Works on `num_threads` views at a time, 0: as many as the machine has cores. The
  // capture must outlive the task, and must not change before Finish.
  EmbeddingTask(const EmbeddedPriors& what, int num_threads, const Capture& capture);
  // Stops after the views that are being worked on.
  ~EmbeddingTask();
  EmbeddingTask(const EmbeddingTask&) = delete;
  EmbeddingTask& operator=(const EmbeddingTask&) = delete;

  // Waits for the priors and gives them to the views of `capture`, which is the one of the
  // constructor. Calls `progress` on the caller's thread for each view, and several times a second;
  // an error that it returns ends the call with that error, and no view gets a prior. To be called
  // once.
  absl::Status Finish(absl::FunctionRef<absl::Status(int done, int num_views)> progress,
                      Capture& capture);

 private:
  struct Made {
    DepthPrior depth;
    MaskSet masks;
  };
  void Work();
  Made MadeFor(const View& view) const;
  int WaitForMore(int num_done);

  const EmbeddedPriors what_;
  const Capture& capture_;
  const int opencv_threads_;   // of OpenCV before the task, which restricts it to one
  std::vector<size_t> views_;  // the training views, by index in the capture
  std::vector<Made> made_;     // by position in views_
  std::stop_source stop_;

  std::mutex mutex_;  // guards the members below, except threads_
  std::condition_variable changed_;
  size_t next_ = 0;   // position in views_
  int num_done_ = 0;  // views
  std::vector<std::jthread> threads_;
};

// Does such a task, and waits for it.
absl::Status EmbedPriors(const EmbeddedPriors& what, int num_threads, Capture& capture,
                         absl::FunctionRef<absl::Status(int done, int num_views)> progress);

}  // namespace pepeseg
