#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/dataset/import.h"
#include "core/priors/priors.h"
#include "core/priors/sam/prompted_segmenter.h"
#include "core/priors/sam/sam_segmenter.h"
#include "core/scene/capture.h"
#include "core/scene/mask_set.h"
#include "core/train/photograph_masks.h"
#include "core/train/stage_log.h"
#include "core/train/training_inputs.h"

namespace pepeseg {

// Share of the work of stage "priors" that is done when the wait for SAM's masks starts.
inline constexpr double kShareBeforeSam = 0.1;

// Segments a training's photographs by SAM on threads of its own, while other stages run: a
// photograph can be segmented before its pose is known, and stage one needs no masks. The masks are
// kept in `folders.priors` for later runs, and so are the embeddings, which Training::Index moves
// to the model's folder.
//
// Threads: the training's thread calls the methods. The object's threads take photographs from a
// queue, at most SamPhotographsAtOnce() at a time; one mutex guards the queue and the states.
// Where the CPU computes, threads that run next to other stages have a low priority, which the
// system lets no thread raise again. When GiveMasks starts, each of them finishes its photograph
// and ends, and threads of the process's priority take over.
class PhotographSegmentation {
 public:
  // Starts the threads. files: those of the dataset; the photographs among them are segmented.
  //
  // next_to_other_stages: true while other stages run. The photographs that will be trained on if
  // all get a pose are then segmented meanwhile, by a GPU or on the time that these stages leave of
  // the cores; those that will be held out are not. False: nothing is segmented before GiveMasks.
  PhotographSegmentation(const TrainingInputs& inputs, const ImportOptions& import,
                         const std::vector<DatasetFile>& files, bool next_to_other_stages);
  // Interrupts the network and joins the threads.
  ~PhotographSegmentation();

  // Returns the number of photographs of training views that are still to be segmented.
  int64_t NumLeft(const Capture& capture) const;

  // Waits for the masks of the training views' photographs and gives them to the views, joined with
  // the views' own masks if `join`. Reports steps of stage "priors". To be called once.
  //
  // Returns CANCELLED when the training was cancelled. Any other error, of SamModel or for lack of
  // memory, leaves all views with the masks that they had.
  absl::Status GiveMasks(StageLog& stages, bool join, Capture& capture);

 private:
  struct Task {
    DatasetFile photograph;
    std::string sha256;  // of the uploaded file; empty: not known
    enum { kOpen, kRuns, kDone } state = kOpen;
  };
  // Scheduling priority of a thread. kLow is used only if the CPU computes.
  enum class Priority { kOfProcess, kLow };

  void StartThreads(Priority priority);
  void Stop();
  int AtOnce() const;  // photographs

  // On the object's threads.
  void OpenModel(Priority priority);
  void Work(Priority priority);
  std::optional<size_t> Next(Priority priority);
  absl::Status Segment(size_t task, PromptedSegmenter& segmenter);
  void Fail(const absl::Status& status);

  // On the training's thread.
  std::vector<size_t> Trained(const Capture& capture) const;
  int64_t CloseQueue(const std::vector<size_t>& tasks);
  absl::Status WaitFor(const std::vector<size_t>& tasks, StageLog& stages);
  void ReportProcessor(StageLog& stages);
  absl::StatusOr<std::vector<MaskSet>> MasksOfViews(bool join, const Capture& capture) const;
  absl::StatusOr<MaskSet> MasksOfView(const View& view, bool join, MaskWarp& warp) const;
  absl::Status TakeMasks(StageLog& stages, bool join, Capture& capture);

  int64_t NumDone(const std::vector<size_t>& tasks) const;  // with mutex_ held

  const TrainingInputs& inputs_;
  const PhotographMasks masks_;
  const int num_threads_;
  const Priority first_priority_;
  std::map<std::string, size_t> by_key_;  // index in tasks_, the photograph's number in masks_
  std::stop_source stop_;

  mutable std::mutex mutex_;             // guards the members below, except threads_
  std::condition_variable_any changed_;  // signals a change of the members below
  std::vector<Task> tasks_;              // in the order of views; only their states change
  std::deque<size_t> queue_;             // tasks to do, in order
  bool closed_ = false;                  // poses are known, and nothing more will be queued
  int num_running_ = 0;                  // photographs
  int64_t num_kept_ = 0;                 // photographs that an earlier run has segmented
  absl::Status status_;                  // the first failure
  std::unique_ptr<SamModel> model_;      // null: not opened yet

  std::vector<std::jthread> threads_;  // the first opens the model
};

}  // namespace pepeseg
